//! Seeded bugs: the model, broken in one place, must break the property that was seeded, and no
//! other in fewer steps. `-- --nocapture` prints a shortest way there.

use std::collections::HashSet;

use dualframe_protocol::config::{BroadPhase, Bug, Config};
use dualframe_protocol::model::{Action, Protocol, property};
use dualframe_protocol::state::{At, Rule, State};
use stateright::Model;

/// A state, and the state before it with what was done there.
type Reached = (State, Option<(usize, Action)>);

/// All states of `model` in the order of their distance from the first one, up to one in which what is broken is
/// `wanted`; and what that is.
fn search(model: &Protocol, wanted: impl Fn(&[&str]) -> bool) -> (Vec<Reached>, Vec<&'static str>) {
    let mut rules = model.properties();
    rules.retain(|rule| rule.expectation.discovery_is_failure());
    let first = State::initial(&model.0);
    let mut known = HashSet::from([first.clone()]);
    let mut reached: Vec<Reached> = vec![(first, None)];
    let (mut here, mut actions) = (0, vec![]);
    while let Some((state, _)) = reached.get(here) {
        let state = state.clone();
        let broken = rules.iter().filter(|rule| !(rule.condition)(model, &state));
        let broken: Vec<_> = broken.map(|rule| rule.name).collect();
        if wanted(&broken) {
            reached.truncate(here + 1);
            return (reached, broken);
        }
        model.actions(&state, &mut actions);
        for action in actions.drain(..) {
            let next = model.next_state(&state, action).filter(|next| known.insert(next.clone()));
            reached.extend(next.map(|next| (next, Some((here, action)))));
        }
        here += 1;
    }
    panic!("the seeded bug was not noticed");
}

/// Prints the way to the last of the states `reached`, and what is broken there.
fn print(bug: Bug, reached: &[Reached], broken: &[&str]) {
    let mut way: Vec<&Reached> = reached.last().into_iter().collect();
    while let Some((_, Some((before, _)))) = way.last() {
        way.push(&reached[*before]);
    }
    println!("\n{bug:?} breaks {broken:?} after {} states:", reached.len());
    for (before, after) in way.iter().skip(1).zip(&way).rev() {
        let Some((_, (worker, act))) = after.1 else { continue };
        println!("    worker {worker}, {:?}: {act:?}", before.0.workers[worker as usize].at);
    }
    println!("  and then:\n{}", way[0].0);
}

/// Asserts that a shortest way to break anything with `bug` in `config` breaks `expected`, and prints it.
fn breaks(bug: Bug, config: Config, expected: &str) {
    let model = Protocol(Config { bug: Some(bug), ..config });
    let (reached, broken) = search(&model, |broken| !broken.is_empty());
    print(bug, &reached, &broken);
    assert!(broken.contains(&expected), "{bug:?} breaks {broken:?}, not {expected}");
}

/// Two workers, three units in a row, two frames; nobody sleeps.
fn awake() -> Config {
    Config::new(2, 3, &[[0, 1], [1, 2]], 2)
}

/// The same with two units, and idle workers sleep.
fn sleeping(workers: u8) -> Config {
    Config { sleep: true, ..Config::new(workers, 2, &[[0, 1]], 2) }
}

/// The same, and the renderer is left to all workers.
fn sharing(workers: u8) -> Config {
    Config { shared: true, ..sleeping(workers) }
}

macro_rules! seeded {
    ($($name:ident: $bug:ident in $config:expr => $property:expr;)*) => {
        $(#[test]
        fn $name() {
            breaks(Bug::$bug, $config, $property);
        })*
    };
}

seeded! {
    armed_after_publishing: ArmedAfterPublishing in awake() => property::of(Rule::Order);
    render_not_counted: RenderNotCounted in awake() => property::of(Rule::Order);
    counted_after_gate: CountedAfterGate in awake() => property::of(Rule::Order);
    opened_by_last_arriver: OpenedByLastArriver in awake() => property::of(Rule::Order);
    no_gate: NoGate in awake() => property::of(Rule::Order);
    arrivals_kept: ArrivalsKept in awake() => property::of(Rule::Order);
    updated_when_opened: UpdatedWhenOpened in awake() => property::of(Rule::Order);
    gate_armed_late: GateArmedLate in awake() => property::PROGRESS;
    swap_by_last_but_one: SwapByLastButOne in awake() => property::of(Rule::Swap);
    displayed_before_swap: DisplayedBeforeSwap in Config { tokens: 2, ..awake() }
        => property::of(Rule::Swap);
    swaps_with_work: SwapsWithWork in sleeping(2) => property::SWAPS;
    rendered_ahead: RenderedAhead in awake() => property::of(Rule::Swap);
    queue_keeps: QueueKeeps in awake() => property::of(Rule::ExactlyOnce);
    wrong_bell: WrongBell in sleeping(3) => property::PROGRESS;
    no_second_look: NoSecondLook in sleeping(2) => property::PROGRESS;
    leaver_drops_carried: LeaverDropsCarried in Config { departures: 1, ..sleeping(2) }
        => property::PROGRESS;
    leaver_swallows_call: LeaverSwallowsCall in Config { departures: 2, ..sleeping(3) }
        => property::PROGRESS;
    token_doubled: TokenDoubled in Config { handovers: 1, ..awake() } => property::TOKEN;
    sleeps_with_rendering: SleepsWithRendering in sharing(2) => property::PROGRESS;
    not_looked_again: NotLookedAgain in sharing(2) => property::WAKES;
    goes_on_with_renderer: GoesOnWithRenderer in sharing(2) => property::WAKES;
    leaves_with_renderer: LeavesWithRenderer in Config { departures: 1, ..sharing(2) }
        => property::PROGRESS;
    rendering_calls_holders: RenderingCallsHolders in Config { departures: 1, ..sharing(2) }
        => property::PROGRESS;
}

/// Whoever is updated too early may also be read meanwhile: an update in the wrong order is not all that is noticed.
#[test]
fn access_is_broken_too() {
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        for bug in [Bug::CountedAfterGate, Bug::OpenedByLastArriver, Bug::NoGate] {
            let model = Protocol(Config { broad_phase, bug: Some(bug), ..awake() });
            let (reached, broken) = search(&model, |broken| broken.contains(&property::ACCESS));
            print(bug, &reached, &broken);
        }
    }
}

/// In either broad phase a test reads both units, and an interaction need not have begun for that to be seen.
#[test]
fn a_unit_is_updated_beside_its_test() {
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        let config = Config { broad_phase, ..Config::new(2, 2, &[[0, 1]], 1) };
        let entering = match broad_phase {
            BroadPhase::Spatial => At::Entering(1),
            BroadPhase::Pairwise => At::Arriving(1, 1),
        };
        for (arrived, updated) in [(0, 0), (1, 0), (1, 1)] {
            let mut state = State { arrived, ..State::initial(&config) };
            (state.workers[0].at, state.workers[1].at) = (At::Updating(updated), entering);
            let tests = arrived == 1;
            assert_eq!(state.access(&config), !tests, "{broad_phase:?}: unit {updated}");
        }
    }
}
