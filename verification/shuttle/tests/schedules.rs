//! Random and PCT schedules of whole runs of the real core.
use dualframe_core_shuttle as dut;

mod drive;
#[path = "../../model/tests/record/mod.rs"]
mod record;

use dut::frame::Entry;
use dut::pipeline::BroadPhase;
use record::{Setup, judge};

fn setup(broad_phase: BroadPhase, entry: Entry) -> Setup {
    Setup { units: 12, frames: 4, broad_phase, entry, tokens: 1, seed: 7, near_percent: 15, solitary: 0 }
}

#[test]
fn timing() {
    let s = setup(BroadPhase::Spatial, Entry::AfterUpdate);
    for pct in [false, true] {
    let n = 500;
    let t = std::time::Instant::now();
    let s = s.clone();
    let body = move || {
        let (record, values) = drive::run(&s, 4, drive::Park::default());
        judge(&s, &record, &values);
    };
    if pct { shuttle::check_pct(body, n, 3) } else { shuttle::check_random(body, n) };
    println!("pct {pct}: {:.3} ms each", t.elapsed().as_secs_f64() * 1e3 / n as f64);
    }
}
