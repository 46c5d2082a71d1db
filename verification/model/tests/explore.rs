//! The protocol, explored completely: every reachable state keeps every invariant, and none is a
//! dead end. `-- --nocapture` prints the numbers of states; `-- --ignored` explores the full sizes.

use std::collections::HashMap;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::time::Instant;

use dualframe_protocol::config::{BroadPhase, Config, Entry};
use dualframe_protocol::model::{Protocol, property};
use dualframe_protocol::state::State;
use stateright::{Checker, Model};

/// Explores all states of `config`, up to the names of the workers.
fn explore(config: Config) {
    let start = Instant::now();
    let name = format!(
        "{:?} {:?}, {} workers ({} late, {} may leave), {} units, {} pairs, {} frames, sleep: {}, \
         shared: {}",
        config.broad_phase,
        config.entry,
        config.workers,
        config.late,
        config.departures,
        config.units,
        config.pairs.len(),
        config.frames,
        config.sleep,
        config.shared
    );
    let (sleep, entry) = (config.sleep, config.entry);
    let checker = Protocol(config).checker().symmetry_fn(State::representative).spawn_dfs().join();
    let (states, transitions) = (checker.unique_state_count(), checker.state_count());
    let seconds = start.elapsed().as_secs_f64();
    println!("{name}: {states} states, {transitions} transitions, {seconds:.1} s");
    let failed = checker
        .discoveries()
        .into_iter()
        .find(|(name, _)| checker.model().property(name).expectation.discovery_is_failure());
    if let Some((name, way)) = failed {
        panic!("{name} is broken by {:#?}\n{}", way.clone().into_actions(), way.last_state());
    }
    assert!(checker.is_done(), "cut short");
    checker.assert_any_discovery(property::FINISHES);
    assert_eq!(checker.discovery(property::SLEEPS).is_some(), sleep);
    assert_eq!(checker.discovery(property::OVERLAPS).is_some(), entry != Entry::AfterSwap);
}

/// Workers join late, leave, and hand the token on.
fn coming_and_going(config: Config, entry: Entry) -> Config {
    Config { entry, late: 1, departures: 2, handovers: 1, ..config }
}

/// Three workers, three units in a row, three frames.
fn three(entry: Entry) -> Config {
    coming_and_going(Config::new(3, 3, &[[0, 1], [1, 2]], 3), entry)
}

/// Three workers, two units, two frames; idle workers sleep, and work is carried.
fn small(entry: Entry) -> Config {
    coming_and_going(Config { sleep: true, ..Config::new(3, 2, &[[0, 1]], 2) }, entry)
}

macro_rules! explored {
    ($($name:ident: $config:expr;)*) => {
        mod spatial {
            use super::*;
            $(#[test]
            fn $name() {
                explore($config);
            })*
        }
        mod pairwise {
            use super::*;
            $(#[test]
            fn $name() {
                explore(Config { broad_phase: BroadPhase::Pairwise, ..$config });
            })*
        }
    };
}

explored! {
    after_update: Config { may_miss: true, ..three(Entry::AfterUpdate) };
    after_render: Config { may_miss: true, ..three(Entry::AfterRender) };
    after_swap: Config { may_miss: true, ..three(Entry::AfterSwap) };
    asleep_after_update: small(Entry::AfterUpdate);
    asleep_after_render: small(Entry::AfterRender);
    asleep_after_swap: small(Entry::AfterSwap);
}

#[test]
fn two_tokens() {
    explore(Config { tokens: 2, ..three(Entry::AfterUpdate) });
    explore(Config { tokens: 2, ..small(Entry::AfterUpdate) });
}

/// The renderer is left to all workers.
mod shared {
    use super::*;

    /// Nobody has a token that could be handed on.
    pub(super) fn sharing(config: Config) -> Config {
        Config { shared: true, handovers: 0, ..config }
    }

    #[test]
    fn awake() {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            explore(sharing(three(entry)));
        }
    }

    #[test]
    fn asleep() {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            explore(sharing(small(entry)));
        }
    }

    #[test]
    fn no_path_is_a_circle() {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            assert_no_circle(sharing(Config { departures: 1, ..small(entry) }));
        }
    }

    #[test]
    #[ignore = "minutes, see README.md"]
    fn no_path_is_a_circle_full() {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            assert_no_circle(sharing(Config { sleep: true, ..three(entry) }));
        }
    }
}

#[test]
fn a_solitary_unit_and_one_within_itself() {
    let config = Config { solitary: 4, ..Config::new(2, 3, &[[0, 1], [0, 0]], 3) };
    for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
        explore(Config { entry, ..config.clone() });
    }
    explore(Config {
        frames: 2,
        ..coming_and_going(Config { sleep: true, ..config }, Entry::AfterUpdate)
    });
}

/// Three workers, three units, two interactions, three frames, and all that may happen.
mod full {
    use super::*;

    macro_rules! full {
        ($($name:ident: $broad_phase:ident $entry:ident;)*) => {
            $(#[test]
            #[ignore = "minutes, see README.md"]
            fn $name() {
                let broad_phase = BroadPhase::$broad_phase;
                explore(Config { broad_phase, sleep: true, ..three(Entry::$entry) });
            })*
        };
    }

    full! {
        spatial_after_update: Spatial AfterUpdate;
        spatial_after_render: Spatial AfterRender;
        spatial_after_swap: Spatial AfterSwap;
        pairwise_after_update: Pairwise AfterUpdate;
        pairwise_after_render: Pairwise AfterRender;
        pairwise_after_swap: Pairwise AfterSwap;
    }

    #[test]
    #[ignore = "minutes, see README.md"]
    fn shared() {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            explore(super::shared::sharing(Config { sleep: true, ..three(entry) }));
        }
    }
}

/// No path comes back to where it was. So every path ends, and since no state is a dead end before
/// all frames are swapped, every path swaps them: progress, whatever the schedule.
#[test]
fn no_path_is_a_circle() {
    for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
        assert_no_circle(Config { departures: 1, ..small(entry) });
    }
}

#[test]
#[ignore = "minutes, see README.md"]
fn no_path_is_a_circle_full() {
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            assert_no_circle(Config { broad_phase, sleep: true, ..three(entry) });
        }
    }
}

/// Walks depth first, up to the names of the workers. Like stateright, it knows states by 64 bits.
fn assert_no_circle(config: Config) {
    let (broad_phase, entry) = (config.broad_phase, config.entry);
    let model = Protocol(config);
    let hash = BuildHasherDefault::<DefaultHasher>::default();
    let successors = |state: &State| -> Vec<State> {
        model.next_states(state).iter().map(State::representative).collect()
    };
    // Whether a state is on the path that is being walked.
    let mut on_path: HashMap<u64, bool> = HashMap::new();
    let start = State::initial(&model.0).representative();
    let mut path = vec![(hash.hash_one(&start), successors(&start))];
    on_path.insert(path[0].0, true);
    while let Some((name, next)) = path.last_mut() {
        let Some(state) = next.pop() else {
            on_path.insert(*name, false);
            path.pop();
            continue;
        };
        let name = hash.hash_one(&state);
        match on_path.get(&name) {
            Some(true) => panic!("comes back to\n{state}"),
            Some(false) => {}
            None => {
                on_path.insert(name, true);
                path.push((name, successors(&state)));
            }
        }
    }
    let states = on_path.len();
    println!("{broad_phase:?} {entry:?}: no circle in {states} states");
    assert!(states > 10_000, "next to nothing was walked");
}
