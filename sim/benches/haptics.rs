//! How punctual the haptic loop is: the share of ticks at 1 kHz that begin more than half a millisecond
//! late, while a pipeline has every core busy, with particles and with a craniotomy in which the loop leads a
//! tool; and beside it what an empty loop at that rate sees on the same machine.
//!
//! The loops take turns, so that a bad phase of the machine meets all of them. With `--test`, one round of
//! a tenth of a second.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep, spawn};
use std::time::{Duration, Instant};

use dualframe_sim::behavior::Instrument;
use dualframe_sim::blocking::Grain;
use dualframe_sim::device::DeviceSample;
use dualframe_sim::device::figures::{LATE, Ticks};
use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::{HapticLink, ToolState};
use dualframe_sim::device::motion::{Keyframe, Motion};
use dualframe_sim::device::operator::{Hand, SimulatedDevice};
use dualframe_sim::device::priority::Priority;
use dualframe_sim::device::proxy::{ContactStiffness, Proxy, Surface};
use dualframe_sim::device::thread::{HapticThread, RATE};
use dualframe_sim::executor::FrameRecord;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::craniotomy::{self, Operation, TOOLS};
use dualframe_sim::scene::head::{Entry, Head};
use dualframe_sim::scene::{ParticleScene, Scene};
use glam::Vec3;

/// Particles of the environment that keeps the cores busy: the paper's usual number.
const PARTICLES: usize = 300;
/// Workers of the pipeline: as many as the machine has cores that the bar is stated for.
const WORKERS: usize = 2;

fn main() {
    let test = std::env::args().any(|argument| argument == "--test");
    let (rounds, seconds) = if test { (1, 0.1) } else { (5, 4.0) };
    let particles = ParticleScene::new(PARTICLES).build().expect("so many are allowed");
    let mut particles = manager(particles, Grain::default());
    let head = Arc::new(Head::synthetic().expect("the synthetic head"));
    let craniotomy = craniotomy::build(&head).expect("a sound scene");
    let mut craniotomy = manager(craniotomy, Grain::Pairwise);
    let mut sums = [Sum::default(); 8];
    let mut last = None;
    for _ in 0..rounds {
        let idle = [empty(seconds, false), empty(seconds, true)];
        let [beside_particles, beside_craniotomy] = [&mut particles, &mut craniotomy]
            .map(|load| [false, true].map(|priority| beside(load, || empty(seconds, priority))));
        let tools = [haptics(&mut particles, seconds), operate(&mut craniotomy, &head, seconds)];
        let [[a, b], [c, d], [e, f], [g, h]] =
            [idle, beside_particles, beside_craniotomy, tools.map(|tool| tool.ticks)];
        sums.iter_mut().zip([a, b, c, d, g, e, f, h]).for_each(|(sum, ticks)| sum.add(ticks));
        last = Some(tools);
    }
    println!("haptics: {WORKERS} workers, {}", Priority::raise());
    println!("{:<52} {:>8} {:>12} {:>12}", "loop at 1 kHz", "ticks", "late by 0.5", "latest, ms");
    let names = [
        "empty, idle machine",
        "empty, idle machine, priority if allowed",
        "empty, 300 particles",
        "empty, 300 particles, priority if allowed",
        "haptics, 300 particles, priority if allowed",
        "empty, craniotomy",
        "empty, craniotomy, priority if allowed",
        "haptics, craniotomy, priority if allowed",
    ];
    names.into_iter().zip(sums).for_each(|(name, sum)| sum.print(name));
    for (load, tool) in ["300 particles", "craniotomy"].into_iter().zip(last.into_iter().flatten())
    {
        print(load, &tool);
    }
}

fn manager(scene: Scene, grain: Grain) -> VeManager {
    let settings = Settings { threads: WORKERS, grain, ..Settings::default() };
    VeManager::new(scene, settings).expect("two workers are allowed")
}

/// What a loop said of its forces.
fn print(load: &str, ToolState { forces, .. }: &ToolState) {
    println!("{load}:");
    let (age, greatest) = (forces.age * 1e3, forces.greatest_age * 1e3);
    println!("  force age {age:.1} ms, at most {greatest:.1}; {} models", forces.models);
    let (error, step) = (forces.error_rms(), forces.largest_step);
    println!("  interpolation error {error:.4} N rms; largest step {step:.3} N a tick");
    println!("  power {:.2e} W; least energy {:.2e} J", forces.power, forces.least_absorbed);
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
        println!("{name:<52} {:>8} {share:>10.3} % {latest:>12.3}", ticks.due);
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

fn run(manager: &mut VeManager, on_frame: &mut (dyn FnMut() + Send)) {
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
    let device = SimulatedDevice::new(Hand::FIRM, pressing());
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

/// A hand that comes from above bone and presses: one that began in it would have energy that it never put in.
fn pressing() -> Motion {
    let to = |time: f64, height: f32| Keyframe { time, sample: DeviceSample::at(Vec3::Y * height) };
    Motion::new([to(0.0, 0.002), to(0.1, -0.01)]).expect("in order")
}

/// The haptic loop in the craniotomy: a hand strokes over the skull with an elevator.
fn operate(manager: &mut VeManager, head: &Arc<Head>, seconds: f64) -> ToolState {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let device = SimulatedDevice::new(Hand::FIRM, strokes(head, seconds));
    let mut operation = Operation::new(Arc::clone(head), None);
    operation.link(0, simulation);
    let mailbox = manager.mailbox();
    mailbox.post(TOOLS[0], Message::TakeUp(Instrument::Elevator));
    scope(|scope| {
        let settings = ForceSettings::default();
        let _thread =
            HapticThread::spawn(scope, device, end, settings, RATE).expect("a thread is free");
        let mut renderer = NullRenderer::new();
        let (hands, mut watch) = operation.parts(&mut renderer);
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < seconds {
            let mut on_frame = |record: &FrameRecord| hands.swapped(record.frame, &mailbox);
            manager.run(4, &mut watch, &mut on_frame).expect("no table is full");
        }
        hands.device(0).expect("it ticked")
    })
}

/// Strokes of 20 mm, two a second, at the place of the burr hole, where a hand presses with 4 N.
fn strokes(head: &Head, seconds: f64) -> Motion {
    let Entry { point, inward, .. } = head.plan.burr_hole;
    let aside = inward.any_orthonormal_vector() * 0.01;
    let ends = (0..=(2.0 * seconds) as u32).map(|number| {
        let side = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
        let sample = DeviceSample::at(point + inward * 0.01 + aside * side);
        Keyframe { time: 0.5 + 0.5 * f64::from(number), sample }
    });
    let above = DeviceSample::at(point - inward * 0.02 + aside);
    let first = Keyframe { time: 0.0, sample: above };
    Motion::new(std::iter::once(first).chain(ends)).expect("in order")
}
