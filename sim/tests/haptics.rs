//! The haptic loop: closed with a simulated device in a simulated hand against bone, with a pipeline
//! beside it that has a rate and a delay of its own.

use std::collections::VecDeque;
use std::sync::OnceLock;

use dualframe_sim::device::DeviceSample;
use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::{HapticLink, SimulationEnd, ToolState};
use dualframe_sim::device::model::LocalModel;
use dualframe_sim::device::motion::{Keyframe, Motion};
use dualframe_sim::device::operator::{Hand, SimulatedDevice};
use dualframe_sim::device::proxy::{ContactStiffness, Proxy, Surface};
use dualframe_sim::device::thread::HapticLoop;
use dualframe_sim::geometry::Volume;
use glam::Vec3;
use parry3d::math::Pose;

/// The radius of the round bone, in metres: a skull's.
const SKULL: f32 = 0.07;
/// The period of the loop, in seconds.
const PERIOD: f64 = 1e-3;

/// A flat bone below y = 0, a round one whose top is there, and a round one of voxels.
#[derive(Clone, Copy, Debug)]
enum Bone {
    Flat,
    Round,
    Voxels,
}

/// The round bone in voxels of half a millimetre, filled in part at the surface, as of a CT.
fn voxels() -> &'static Volume {
    static VOXELS: OnceLock<Volume> = OnceLock::new();
    VOXELS.get_or_init(|| {
        let (spacing, corner) = (0.000_5, Vec3::new(-0.02, -0.02, -0.020_1));
        let filled = |[x, y, z]: [u32; 3]| {
            let middle = Vec3::new(x as f32, y as f32, z as f32) + Vec3::splat(0.5);
            let (distance, _) = Bone::Round.distance(corner + middle * spacing);
            (255.0 * (0.5 - distance / spacing).clamp(0.0, 1.0)).round() as u8
        };
        let pose = Pose::from_translation(corner);
        Volume::from_fn([120, 44, 80], Vec3::splat(spacing), pose, filled).expect("small")
    })
}

impl Surface for Bone {
    fn distance(&self, point: Vec3) -> (f32, Vec3) {
        match self {
            Self::Flat => (point.y, Vec3::Y),
            Self::Round => {
                let from_centre = point + Vec3::Y * SKULL;
                (from_centre.length() - SKULL, from_centre.normalize_or(Vec3::Y))
            }
            Self::Voxels => voxels().distance(point),
        }
    }
}

/// A pipeline: looks at the tool `rate` times a second, and delivers what it computes `delay` seconds
/// later; not while it is held up.
struct Pipeline {
    bone: Bone,
    stiffness: ContactStiffness,
    rate: f64,
    delay: f64,
    held_up: [f64; 2],
    proxy: Proxy,
    frames: u64,
    under_way: VecDeque<(f64, LocalModel)>,
}

impl Pipeline {
    fn new(bone: Bone, rate: f64, delay: f64) -> Self {
        let proxy = Proxy::new(Vec3::Y);
        let (held_up, under_way) = ([f64::INFINITY; 2], VecDeque::new());
        let stiffness = ContactStiffness::BONE;
        Self { bone, stiffness, rate, delay, held_up, proxy, frames: 0, under_way }
    }

    fn step(&mut self, time: f64, end: &mut SimulationEnd<'_>) {
        if (self.held_up[0]..self.held_up[1]).contains(&time) {
            return;
        }
        while self.under_way.front().is_some_and(|&(due, _)| due <= time) {
            let (_, model) = self.under_way.pop_front().expect("there is one");
            end.deliver(model).expect("finite");
        }
        if time * self.rate >= self.frames as f64 {
            self.frames = (time * self.rate) as u64 + 1;
            let tool = end.tool();
            self.proxy.follow(tool.sample.position, &self.bone);
            self.under_way.push_back((time + self.delay, self.proxy.model(&tool, self.stiffness)));
        }
    }
}

/// What was seen at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen {
    time: f64,
    tool: ToolState,
    speed: f32,
}

/// Runs the closed loop for some seconds.
fn run(
    device: SimulatedDevice,
    mut pipeline: Pipeline,
    settings: ForceSettings,
    seconds: f64,
) -> Vec<Seen> {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let mut haptics = HapticLoop::new(device, end, settings);
    let ticks = (seconds / PERIOD).round() as u64;
    let tick = |tick: u64| {
        let time = tick as f64 * PERIOD;
        haptics.tick(time);
        pipeline.step(time, &mut simulation);
        Seen { time, tool: simulation.tool(), speed: haptics.device().velocity().length() }
    };
    (1..=ticks).map(tick).collect()
}

fn keyframe(time: f64, x: f32, y: f32) -> Keyframe {
    Keyframe { time, sample: DeviceSample::at(Vec3::new(x, y, 0.0)) }
}

/// A hand that comes down onto the bone again and again, strokes along it and rests on it.
fn pressing() -> Motion {
    let rounds = (0..30).flat_map(|round| {
        let time = 2.0 * f64::from(round);
        [
            keyframe(time + 0.2, 0.0, 0.01),
            keyframe(time + 0.3, 0.0, -0.02),
            keyframe(time + 1.0, 0.0, -0.02),
            keyframe(time + 1.5, 0.02, -0.02),
            keyframe(time + 1.9, 0.02, 0.01),
        ]
    });
    Motion::new(rounds).expect("in order")
}

/// What a tick may generate before the limiter, which acts a tick late, takes it back, in joules:
/// K·(v·T)²/2 for bone that is met at 0.4 m/s, faster than the hand gets here.
const ONE_TICK: f64 = 0.5 * 2_000.0 * (0.4 * PERIOD) * (0.4 * PERIOD);
/// Rate and delay of the pipeline, in hertz and seconds.
const PIPELINES: [(f64, f64); 3] = [(60.0, 2.0 / 60.0), (60.0, 1.0 / 60.0), (300.0, 1.0 / 300.0)];

/// The least energy that the hand had put in at any time, counted from what was seen.
fn least_energy(seen: &[Seen]) -> f64 {
    let (mut energy, mut least) = (0.0_f64, 0.0_f64);
    for pair in seen.windows(2) {
        let way = pair[1].tool.sample.position - pair[0].tool.sample.position;
        energy -= pair[0].tool.wrench.force.as_dvec3().dot(way.as_dvec3());
        least = least.min(energy);
    }
    least
}

/// The largest step of the force, in newtons.
fn largest_step(seen: &[Seen]) -> f32 {
    let step = |pair: &[Seen]| pair[1].tool.wrench.force.distance(pair[0].tool.wrench.force);
    seen.windows(2).map(step).fold(0.0, f32::max)
}

fn fastest(seen: &[Seen]) -> f32 {
    seen.iter().map(|seen| seen.speed).fold(0.0, f32::max)
}

/// Against bone for a minute: at no time has the hand got more energy than it gave, no step is too large,
/// the tool is never faster than the hand moves it in the air, and what interpolation leaves is small.
#[test]
fn closed_loop_is_passive_and_smooth() {
    let settings = ForceSettings::default();
    for hand in [Hand::LIGHT, Hand::FIRM] {
        let mut air = Pipeline::new(Bone::Flat, 60.0, 0.0);
        air.stiffness = ContactStiffness::new(0.0);
        let fastest_in_air =
            fastest(&run(SimulatedDevice::new(hand, pressing()), air, settings, 4.0));
        for (bone, (rate, delay)) in
            PIPELINES.map(|p| [Bone::Flat, Bone::Round, Bone::Voxels].map(|b| (b, p))).concat()
        {
            let case = format!("{hand:?}, {bone:?}, {rate} Hz, {delay} s");
            let device = SimulatedDevice::new(hand, pressing());
            let seen = run(device, Pipeline::new(bone, rate, delay), settings, 60.0);
            let (least, step) = (least_energy(&seen), largest_step(&seen));
            assert!(least > -ONE_TICK, "{case}: {least} J");
            assert!(step <= settings.max_step * 1.000_001, "{case}: a step of {step} N");
            assert!(fastest(&seen) < 1.05 * fastest_in_air, "{case}: {} m/s", fastest(&seen));
            let forces = seen.last().expect("there are ticks").tool.forces;
            assert!((forces.least_absorbed - least).abs() < 1e-9, "{case}: {forces:?}");
            assert!((forces.largest_step - step).abs() < 1e-6, "{case}: {forces:?}");
            assert!(forces.error_rms() < 0.1, "{case}: {} N", forces.error_rms());
            assert!(forces.greatest_age < delay + 2.0 / rate + PERIOD, "{case}: {forces:?}");
        }
    }
}

/// The control: the same loop without the limiter generates energy and swings up.
#[test]
fn without_the_limiter_the_loop_is_unstable() {
    let settings = ForceSettings { max_damping: 0.0, ..ForceSettings::default() };
    for (rate, delay) in PIPELINES {
        let device = SimulatedDevice::new(Hand::LIGHT, pressing());
        let seen = run(device, Pipeline::new(Bone::Flat, rate, delay), settings, 60.0);
        let (least, fastest) = (least_energy(&seen), fastest(&seen));
        assert!(least < -100.0 && fastest > 2.0, "{rate} Hz: {least} J, {fastest} m/s");
    }
}

/// The pipeline is held up for 200 ms while a hand presses: the force fades to nothing, and comes back
/// without a kick.
#[test]
fn fades_when_the_pipeline_is_held_up() {
    let settings = ForceSettings::default();
    let held_up = [3.0, 3.2];
    for (hand, bone) in [
        (Hand::LIGHT, Bone::Flat),
        (Hand::FIRM, Bone::Flat),
        (Hand::LIGHT, Bone::Voxels),
        (Hand::FIRM, Bone::Voxels),
    ] {
        for (rate, delay) in PIPELINES {
            let case = format!("{hand:?}, {bone:?}, {rate} Hz, {delay} s");
            let keyframes = [keyframe(0.2, 0.0, 0.01), keyframe(0.6, 0.0, -0.005)];
            let device = SimulatedDevice::new(hand, Motion::new(keyframes).expect("in order"));
            let pipeline = Pipeline { held_up, ..Pipeline::new(bone, rate, delay) };
            let seen = run(device, pipeline, settings, 6.0);
            let during =
                |from: f64, to: f64| seen.iter().filter(move |s| from < s.time && s.time < to);
            let force = |from, to| {
                let forces = during(from, to).map(|seen| seen.tool.wrench.force.length());
                forces.sum::<f32>() / during(from, to).count() as f32
            };
            let (before, after) = (force(2.5, 3.0), force(5.5, 6.0));
            assert!(before > 0.2, "{case}: it presses with {before} N");
            assert!(force(3.195, 3.2) == 0.0, "{case}: {} N", force(3.195, 3.2));
            assert!((after - before).abs() < 0.05 * before, "{case}: {before} N, then {after} N");
            assert!(largest_step(&seen) <= settings.max_step * 1.000_001, "{case}");
            let speed = during(3.2, 6.0).map(|seen| seen.speed).fold(0.0, f32::max);
            assert!(speed < 0.25, "{case}: thrown out at {speed} m/s");
        }
    }
}

/// A loop of another rate has the same forces, and its limits are those of its rate.
#[test]
fn settings_are_of_a_rate() {
    assert_eq!(ForceSettings::at(1_000.0), ForceSettings::default());
    let [slow, fast] = [100.0, 4_000.0].map(ForceSettings::at);
    assert_eq!((slow.max_step, fast.max_step), (5.0, 0.125));
    assert_eq!((slow.max_damping, fast.max_damping), (5.0, 20.0));
}

/// No model for ten seconds: it is as old as it was while it was felt.
#[test]
fn what_has_faded_grows_no_older() {
    let settings = ForceSettings::default();
    let pipeline = Pipeline { held_up: [3.0, 13.0], ..Pipeline::new(Bone::Flat, 60.0, 0.02) };
    let device = SimulatedDevice::new(Hand::LIGHT, pressing());
    let seen = run(device, pipeline, settings, 13.0);
    let age = seen.last().expect("there are ticks").tool.forces.greatest_age;
    // Three frames, the fade, and what it was when it came.
    assert!((0.1..0.25).contains(&age), "{age} s");
}

#[test]
fn same_inputs_same_bits() {
    let once = || {
        let device = SimulatedDevice::new(Hand::LIGHT, pressing());
        run(device, Pipeline::new(Bone::Round, 60.0, 0.02), ForceSettings::default(), 5.0)
    };
    let bits =
        |seen: Vec<Seen>| -> Vec<String> { seen.iter().map(|seen| format!("{seen:?}")).collect() };
    let first = bits(once());
    assert!(first.len() == 5_000 && first == bits(once()));
}
