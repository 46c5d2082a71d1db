//! Each protocol bug that can be seeded into the core's own code (`core/src/instrument.rs`) makes
//! the model fail that is named for it here.

use crate::models::hunt::{Kill, each, kill};
use crate::models::named;
use dualframe_core_model::instrument::{Fault, seed};

/// The model that has to notice.
fn killer(fault: Fault) -> &'static str {
    use Fault::*;
    match fault {
        UpdatesAfterOwnTests => "pipeline::pairwise_after_update",
        RenderingNotAwaited => "pipeline::spatial_after_update",
        PendingArmedLate => "pipeline::spatial_after_update",
        RenderedBeforeSwap => "pipeline::rendering_waits_for_a_swap",
        SwapsWithWork => "pipeline::rendering_waits_for_a_swap",
        CountedAfterEmitted => "pipeline::three_pairs",
        CountedAtOneEnd => "pipeline::spatial_after_swap",
        PoolsResetEarly => "pipeline::three_pairs",
        TicketPush => "ring::earlier_push_is_found",
        BatchNotFlushed => "bell::all_sleepers_end",
        CarriedBeforeRendering => "pipeline::rendering_comes_first",
        EpochNotedLate => "bell::ring_shows_work",
        CallNotPassedOn => "bell::leaver_passes_it_on",
        EndNotAnnounced => "bell::all_sleepers_end",
        RenderingCallsAnyone => "bell::render_wakes_holders_only",
        ForeignToken => "token::foreign_is_refused",
        DoubledToken => "token::never_doubled",
        TagNotChecked => "pipeline::sleeps_through_a_swap",
        LeavesWithCarry => "pipeline::spatial_after_update",
        LeavesWithRenderer => "shared::leaver_calls",
        SleepsWithRenderer => "shared::sleepers_end",
        SleepsWithRendering => "shared::sleepers_end",
        TakesRenderingElsewhere => "shared::all_rendered_meanwhile",
        NotLookedAgain => "shared::busy_after_it",
        GoesOnWithRenderer => "shared::all_rendered_meanwhile",
        RenderingCallsHolders => "shared::leaver_calls",
        UpdatesWhenOpened => "pipeline::spatial_after_update",
        GateArmedLate => "pipeline::solitary_unit",
        RendersArmedLate => "pipeline::two_holders_at_a_swap",
        TestedTwice => "pipeline::pairwise_after_update",
        ArrivalNotRetried => "arrivals::pairs_meet_once",
        PopNotRetried => "ring::two_consumers",
        RefusedClaimTakenBack => "room::claimed_once",
        LetterNotRetried => "inbox::two_senders",
        LetterEarly => "inbox::this_frame_stays",
        SlotReusedEarly => "latest::slots_are_reused",
    }
}

#[test]
fn every_seeded_bug_is_noticed() {
    let judge = |fault| -> Option<Kill> {
        seed(Some(fault));
        kill(named(killer(fault)))
    };
    let kills = each(Fault::ALL, judge);
    println!("| fault | what is wrong | killed by | executions | how |\n|---|---|---|---|---|");
    for (&fault, kill) in Fault::ALL.iter().zip(&kills) {
        let verdict = kill.as_ref().map_or("- | SURVIVES".into(), Kill::to_string);
        let (what, killer) = (fault.what().trim(), killer(fault));
        println!("| `{fault:?}` | {what} | `{killer}` | {verdict} |");
    }
    let all = Fault::ALL.iter().zip(&kills);
    let alive: Vec<_> = all.filter(|(_, kill)| kill.is_none()).map(|(fault, _)| fault).collect();
    assert!(alive.is_empty(), "no model notices: {alive:?}");
    assert!(kills.len() >= 15, "a table of nothing shows nothing");
}
