//! How punctual the haptic loop is: the share of ticks at 1 kHz that begin more than half a millisecond
//! late, while a pipeline has every core busy, and beside it what an empty loop at that rate sees on the
//! same machine.
//!
//! The loops take turns, so that a bad phase of the machine meets all of them. With `--test`, one round of
//! a tenth of a second.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep, spawn};
use std::time::{Duration, Instant};

use dualframe_sim::device::figures::{LATE, Ticks};
use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::{HapticLink, ToolState};
use dualframe_sim::device::motion::Motion;
use dualframe_sim::device::operator::{Hand, SimulatedDevice};
use dualframe_sim::device::priority::Priority;
use dualframe_sim::device::proxy::{ContactStiffness, Proxy, Surface};
use dualframe_sim::device::thread::{HapticThread, RATE};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;
use glam::Vec3;

/// Particles of the environment that keeps the cores busy: the paper's usual number.
const PARTICLES: usize = 300;
/// Workers of the pipeline: as many as the machine has cores that the bar is stated for.
const WORKERS: usize = 2;

fn main() {
    let test = std::env::args().any(|argument| argument == "--test");
    let (rounds, seconds) = if test { (1, 0.1) } else { (5, 4.0) };
    let settings = Settings { threads: WORKERS, ..Settings::default() };
    let scene = ParticleScene::new(PARTICLES).build().expect("so many are allowed");
    let mut manager = VeManager::new(scene, settings).expect("two workers are allowed");
    let [mut idle, mut idle_first, mut busy, mut busy_first, mut haptic] = [Sum::default(); 5];
    let mut last = None;
    for _ in 0..rounds {
        idle.add(empty(seconds, false));
        idle_first.add(empty(seconds, true));
        busy.add(beside(&mut manager, || empty(seconds, false)));
        busy_first.add(beside(&mut manager, || empty(seconds, true)));
        let tool = haptics(&mut manager, seconds);
        haptic.add(tool.ticks);
        last = Some(tool);
    }
    println!("haptics: {PARTICLES} particles, {WORKERS} workers, {}", Priority::raise());
    println!("{:<44} {:>8} {:>12} {:>12}", "loop at 1 kHz", "ticks", "late by 0.5", "latest, ms");
    idle.print("empty, idle machine");
    idle_first.print("empty, idle machine, priority if allowed");
    busy.print("empty, full load");
    busy_first.print("empty, full load, priority if allowed");
    haptic.print("haptics, full load, priority if allowed");
    if let Some(ToolState { forces, .. }) = last {
        let (age, greatest) = (forces.age * 1e3, forces.greatest_age * 1e3);
        println!("force age {age:.1} ms, at most {greatest:.1}; {} models", forces.models);
        let (error, step) = (forces.error_rms(), forces.largest_step);
        println!("interpolation error {error:.4} N rms; largest step {step:.3} N a tick");
        println!("power {:.2e} W; least energy {:.2e} J", forces.power, forces.least_absorbed);
    }
}

/// The ticks of all rounds.
#[derive(Clone, Copy, Default)]
struct Sum(Ticks);

impl Sum {
    fn add(&mut self, ticks: Ticks) {
        let Self(sum) = self;
        sum.due += ticks.due;
        sum.late += ticks.late;
        sum.latest = sum.latest.max(ticks.latest);
    }

    fn print(self, name: &str) {
        let Self(ticks) = self;
        let (share, latest) = (100.0 * ticks.late_share(), ticks.latest * 1e3);
        println!("{name:<44} {:>8} {share:>10.3} % {latest:>12.3}", ticks.due);
    }
}

/// A loop that only looks at the clock, in a thread of its own.
fn empty(seconds: f64, priority: bool) -> Ticks {
    let ticking = move || {
        if priority {
            let _ = Priority::raise();
        }
        let period = Duration::from_secs_f64(1.0 / RATE);
        let began = Instant::now();
        let (mut due, mut ticks) = (began, Ticks::default());
        while began.elapsed().as_secs_f64() < seconds {
            sleep(due.saturating_duration_since(Instant::now()));
            let lateness = due.elapsed();
            let missed = (lateness.as_nanos() / period.as_nanos()) as u32;
            ticks.due += 1 + u64::from(missed);
            ticks.late += u64::from(missed) + u64::from(lateness.as_secs_f64() > LATE);
            ticks.latest = ticks.latest.max(lateness.as_secs_f64());
            due += period * (missed + 1);
        }
        ticks
    };
    spawn(ticking).join().expect("it does not panic")
}

/// Runs frames for as long as `work` takes in another thread.
fn beside<T: Send>(manager: &mut VeManager, work: impl FnOnce() -> T + Send) -> T {
    let done = AtomicBool::new(false);
    scope(|scope| {
        let working = scope.spawn(|| {
            let result = work();
            done.store(true, Ordering::Relaxed);
            result
        });
        while !done.load(Ordering::Relaxed) {
            run(manager, &mut || ());
        }
        working.join().expect("it does not panic")
    })
}

fn run(manager: &mut VeManager, on_frame: &mut dyn FnMut()) {
    let ran = manager.run(16, &mut NullRenderer::new(), &mut |_| on_frame());
    ran.expect("no table is full");
}

/// Flat bone below y = 0.
struct Bone;

impl Surface for Bone {
    fn distance(&self, point: Vec3) -> (f32, Vec3) {
        (point.y, Vec3::Y)
    }
}

/// The haptic loop against bone, whose local model comes from the pipeline's frames.
fn haptics(manager: &mut VeManager, seconds: f64) -> ToolState {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let pressing = Motion::at_rest(Vec3::Y * -0.01).expect("finite");
    let device = SimulatedDevice::new(Hand::FIRM, pressing);
    let mut proxy = Proxy::new(Vec3::Y);
    scope(|scope| {
        let settings = ForceSettings::default();
        let _thread =
            HapticThread::spawn(scope, device, end, settings, RATE).expect("a thread is free");
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < seconds {
            run(manager, &mut || {
                let tool = simulation.tool();
                proxy.follow(tool.sample.position, &Bone);
                let model = proxy.model(&tool, ContactStiffness::BONE);
                simulation.deliver(model).expect("finite");
            });
        }
        simulation.tool()
    })
}
