//! Seeded bugs: the model, broken in one place, must break the property that was seeded, and no
//! other first. `-- --nocapture` prints the shortest way there.

use dualframe_protocol::config::{Bug, Config};
use dualframe_protocol::model::{Protocol, property};
use dualframe_protocol::state::Rule;
use stateright::{Checker, HasDiscoveries, Model};

/// Asserts that the first property that breaks with `bug` in `config` is `expected`, and prints how.
fn breaks(bug: Bug, config: Config, expected: &str) {
    let model = Protocol(Config { bug: Some(bug), ..config });
    let found = model.checker().finish_when(HasDiscoveries::AnyFailures).spawn_bfs().join();
    let discoveries = found.discoveries();
    let is_failure =
        |name: &&'static str| found.model().property(name).expectation.discovery_is_failure();
    let mut broken: Vec<_> = discoveries.keys().copied().filter(is_failure).collect();
    let length = |name: &&'static str| discoveries[name].clone().into_actions().len();
    broken.sort_by_key(|name| (length(name), *name));
    let states = found.unique_state_count();
    println!("\n{bug:?} breaks {broken:?} after {states} states:");
    let first = *broken.first().expect("the seeded bug was not noticed");
    let way = discoveries[first].clone();
    let last = way.last_state().clone();
    for (state, action) in way.into_vec() {
        if let Some((worker, act)) = action {
            println!("    worker {worker}, {:?}: {act:?}", state.workers[worker as usize].at);
        }
    }
    println!("  and then:\n{last}");
    // Several may break in as few steps.
    let firsts = broken.iter().take_while(|name| length(name) == length(&first));
    assert!(
        firsts.copied().any(|name| name == expected),
        "{bug:?} breaks {broken:?}, not {expected}"
    );
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
    counted_after_gate: CountedAfterGate in awake() => property::ACCESS;
    no_gate: NoGate in awake() => property::ACCESS;
    arrivals_kept: ArrivalsKept in awake() => property::of(Rule::Order);
    gate_armed_late: GateArmedLate in awake() => property::PROGRESS;
    swap_by_last_but_one: SwapByLastButOne in awake() => property::of(Rule::Swap);
    displayed_before_swap: DisplayedBeforeSwap in Config { tokens: 2, ..awake() }
        => property::of(Rule::Swap);
    rendered_ahead: RenderedAhead in awake() => property::of(Rule::Swap);
    queue_keeps: QueueKeeps in awake() => property::of(Rule::ExactlyOnce);
    wrong_bell: WrongBell in sleeping(3) => property::PROGRESS;
    no_second_look: NoSecondLook in sleeping(2) => property::PROGRESS;
    leaver_drops_carried: LeaverDropsCarried in Config { departures: 1, ..sleeping(2) }
        => property::PROGRESS;
    leaver_swallows_call: LeaverSwallowsCall in Config { departures: 2, ..sleeping(3) }
        => property::PROGRESS;
    token_doubled: TokenDoubled in Config { handovers: 1, ..awake() } => property::TOKEN;
    not_looked_again: NotLookedAgain in sharing(2) => property::WAKES;
    goes_on_with_renderer: GoesOnWithRenderer in sharing(2) => property::WAKES;
    leaves_with_renderer: LeavesWithRenderer in Config { departures: 1, ..sharing(2) }
        => property::PROGRESS;
    rendering_calls_holders: RenderingCallsHolders in Config { departures: 1, ..sharing(2) }
        => property::PROGRESS;
}
