//! How the core would scale on more cores than there are, and what stops it: its own source in virtual time.
//!
//! No kernel of a simulator runs, and no processor reorders anything here: what callbacks and accesses take is said in
//! `scene.rs` and `machine.rs`. The figures are to be compared with each other; they are the same each time, but for some
//! hundredths where memory comes to lie elsewhere.
#![forbid(unsafe_code)]

use dualframe_core_shuttle as dut;

mod machine;
mod scene;

use std::sync::{Arc, Mutex};

use clap::Parser;
use dut::sync::{Site, site};
use dut::worker::Step;
use shuttle::{Config, MaxSteps, Runner};

use machine::{Earliest, Model, Spent, switch_off, switch_on};
use scene::{Scene, Slots};

/// Stacks on which a pipeline and the batches of its stages have room.
const STACK: usize = 1 << 20;
/// Ways of spending time that are told of each run.
const TOLD: usize = 6;

/// The arguments.
#[derive(Parser)]
struct Arguments {
    /// What it takes to fetch a cache line from another core, in ns.
    #[arg(long, value_name = "NS,NS,...", value_delimiter = ',', default_values_t = [60, 150])]
    transfer: Vec<u64>,
    /// Numbers of workers, up to 63.
    #[arg(
        long,
        value_name = "N,N,...",
        value_delimiter = ',',
        default_values_t = [2, 4, 8, 16],
        value_parser = clap::value_parser!(u32).range(1..64),
    )]
    workers: Vec<u32>,
    /// Sites of the core's `sync.rs` whose accesses are to take no time: what would be gained at most.
    #[arg(long, value_name = "SITE,SITE,...", value_delimiter = ',', value_parser = site_named)]
    free: Vec<Site>,
    /// See only whether it runs.
    #[arg(long)]
    test: bool,
    /// What cargo adds.
    #[arg(long, hide = true)]
    bench: bool,
}

/// The site of this name.
fn site_named(name: &str) -> Result<Site, String> {
    let named = site::ALL.iter().find(|site| site.name == name);
    named.copied().ok_or_else(|| "no access of the core is called so".into())
}

/// Objects, and the blocks that `sim` groups them in for 16 workers; and more and smaller ones, whose workers meet at what
/// they share more often.
const SIZES: [(u64, u32); 4] = [(300, 16), (1_000, 16), (1_000, 128), (10_000, 64)];

fn main() {
    let arguments = Arguments::parse();
    println!(
        "objects blocks transfer workers  us a frame    S_p    E_p  of all workers' time, in percent"
    );
    for &transfer in &arguments.transfer {
        for (objects, blocks) in SIZES {
            let (warm_up, frames) = if arguments.test { (1, 2) } else { (20, 60) };
            let scene = Scene { objects, blocks, warm_up, frames };
            let model = Model { transfer, free: arguments.free.clone() };
            let (alone, spent) = run(scene, &model, 1);
            tell(&scene, transfer, 1, [alone, alone], &spent);
            for &workers in &arguments.workers {
                let (time, spent) = run(scene, &model, workers);
                tell(&scene, transfer, workers, [alone, time], &spent);
            }
        }
    }
}

/// What a frame takes with one worker and with so many, and what their time went to.
fn tell(scene: &Scene, transfer: u64, workers: u32, [alone, time]: [f64; 2], spent: &Spent) {
    let Scene { objects, blocks, .. } = scene;
    let speed_up = alone / time;
    let efficiency = speed_up / f64::from(workers);
    let mut ways: Vec<_> = spent.iter().collect();
    ways.sort_by_key(|(_, time)| std::cmp::Reverse(**time));
    let all: u64 = spent.values().sum();
    let told = ways.iter().take(TOLD).map(|(way, time)| {
        let percent = 100.0 * **time as f64 / all as f64;
        format!("{way} {percent:.1}")
    });
    println!(
        "{objects:7} {blocks:6} {transfer:5} ns {workers:7} {:11.2} {speed_up:6.2} {efficiency:6.3}  {}",
        time / 1e3,
        told.collect::<Vec<_>>().join(", ")
    );
}

/// What a frame takes, in ns, and what all workers' time went to.
fn run(scene: Scene, model: &Model, workers: u32) -> (f64, Spent) {
    let mut config = Config::default();
    config.stack_size = STACK;
    config.max_steps = MaxSteps::None;
    let outcome = Arc::new(Mutex::new(None));
    let (kept, model) = (Arc::clone(&outcome), model.clone());
    let runs = Runner::new(Earliest::default(), config).run(move || {
        let mut slots = Slots::new(&scene, workers);
        let mut pipeline = slots.pipeline(&scene, workers);
        switch_on(model.clone(), workers as usize);
        shuttle::thread::scope(|scope| {
            for home in 0..workers {
                let (pipeline, scene) = (&pipeline, &scene);
                scope.spawn(move || {
                    let mut worker = pipeline.worker_at(home);
                    while !pipeline.finished() {
                        if worker.step(scene).expect("memory for all") == Step::Idle {
                            worker.wait();
                        }
                    }
                });
            }
        });
        let spent = switch_off();
        let screen = pipeline.take_back().expect("nobody renders");
        let measured = (screen.frame_time(&scene), spent);
        kept.lock().expect("no poison").replace(measured);
    });
    assert_eq!(runs, 1);
    let measured = outcome.lock().expect("no poison").take();
    measured.expect("a run that ended")
}
