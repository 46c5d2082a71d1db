//! Runs every model. Plain `cargo test` does: the library under test is compiled under loom
//! whatever the environment says.

use crate::models::{all, named};

macro_rules! explored {
    ($($primitive:ident: $($model:ident)*;)*) => {
        $(mod $primitive {
            $(#[test]
            fn $model() {
                super::named(concat!(stringify!($primitive), "::", stringify!($model)))();
            })*
        })*
        const EXPLORED: &[&str] = &[$($(concat!(stringify!($primitive), "::", stringify!($model))),*),*];
    };
}

explored! {
    ring: hand_over earlier_push_is_found two_producers one_slot_laps two_slot_laps two_consumers;
    countdown: last_sees_all armed_again;
    arrivals: pairs_meet_once next_frame;
    offer: takers_see_what_came_before once_a_round;
    room: claimed_once;
    inbox: one_letter two_senders this_frame_stays full_pool;
    latest: one_reader slots_are_reused two_readers reader_is_replaced readers_are_limited;
    bell: ring_shows_work all_sleepers_end render_wakes_holders_only leaver_passes_it_on;
    token: never_doubled foreign_is_refused static_once;
    shared: sleepers_end leaver_calls busy_after_it all_rendered_meanwhile;
    pipeline: spatial_after_update spatial_after_render spatial_after_swap pairwise_after_update
        pairwise_after_render pairwise_after_swap pools_come_round two_tokens shared_renderer
        solitary_unit letters errors_do_no_harm within three_pairs rendering_comes_first two_holders_at_a_swap
        sleeps_through_a_swap rendering_waits_for_a_swap finished_shows_all;
    cost: alone in_vain;
}

/// No model is left out of the list above.
#[test]
fn every_model_has_a_test() {
    let mut listed: Vec<_> = all().map(|(name, _)| name).collect();
    let mut explored = EXPLORED.to_vec();
    listed.sort_unstable();
    explored.sort_unstable();
    assert_eq!(explored, listed);
}

/// The library's atomics are loom's: outside a model they refuse to work.
#[test]
fn the_library_is_compiled_under_loom() {
    let outside = std::panic::catch_unwind(|| {
        dualframe_core_model::countdown::Countdown::new(1).arrive();
    });
    assert!(outside.is_err(), "these would be models of nothing");
}
