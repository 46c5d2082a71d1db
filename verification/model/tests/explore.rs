//! Explore.
use dualframe_protocol::config::*;
use dualframe_protocol::model::*;
use dualframe_protocol::state::State;
use stateright::{Checker, Model};

fn go(name: &str, config: Config) {
    let start = std::time::Instant::now();
    let checker = Protocol(config).checker().threads(1).symmetry_fn(State::representative).spawn_dfs().join();
    println!("{name}: {} states, {} transitions, depth {}, {:.1} s; found {:?}", checker.unique_state_count(), checker.state_count(), checker.max_depth(), start.elapsed().as_secs_f64(), checker.discoveries().keys().collect::<Vec<_>>());
    for n in ["1 exactly once", "2 order", "3 swap", "4 two frames", property::ACCESS, property::TOKEN, property::PROGRESS] {
        if let Some(p) = checker.discovery(n) { println!("VIOLATED {n}"); for a in p.clone().into_actions() { println!("  {a:?}"); } println!("{:#?}", p.last_state()); break; }
    }
}

#[test]
fn sizes() {
    let pairs = [[0, 1], [1, 2]];
    go("sleep 2w2o1i2f all", Config { sleep: true, departures: 1, handovers: 1, late: 1, ..Config::new(3, 2, &[[0, 1]], 2) });
    go("sleep 3w3o2i1f", Config { sleep: true, ..Config::new(3, 3, &pairs, 1) });
    go("sleep 3w3o2i2f", Config { sleep: true, ..Config::new(3, 3, &pairs, 2) });
    go("safety all 3w3o2i3f", Config { departures: 1, handovers: 1, late: 1, ..Config::new(3, 3, &pairs, 3) });
    go("safety all 3w3o2i3f may_miss", Config { departures: 1, handovers: 1, late: 1, may_miss: true, ..Config::new(3, 3, &pairs, 3) });
    go("sleep 3w3o2i3f", Config { sleep: true, ..Config::new(3, 3, &pairs, 3) });
    go("sleep 3w3o2i3f all", Config { sleep: true, departures: 1, handovers: 1, late: 1, ..Config::new(3, 3, &pairs, 3) });
}
