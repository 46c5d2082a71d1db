//! A hand, its device and the loop beside the pipeline, in simulated time.

use std::sync::{Arc, OnceLock};

use dualframe_sim::behavior::Instrument;
use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::{HapticLink, ToolState};
use dualframe_sim::device::motion::{Keyframe, Motion};
use dualframe_sim::device::operator::{Hand, SimulatedDevice};
use dualframe_sim::device::thread::HapticLoop;
use dualframe_sim::device::{DeviceDescription, DeviceError, DeviceSample, HapticDevice, Wrench};
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::record::Recorder;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use dualframe_sim::scene::craniotomy::{Operation, Step as Stage, TIME_STEP, TOOLS, build};
use dualframe_sim::scene::head::Head;
use glam::Vec3;

/// The period of the loop, in seconds.
pub(crate) const PERIOD: f64 = 1e-3;

/// The head, built once: it takes a second.
pub(crate) fn head() -> Arc<Head> {
    static HEAD: OnceLock<Arc<Head>> = OnceLock::new();
    Arc::clone(HEAD.get_or_init(|| Arc::new(Head::synthetic().expect("the synthetic head"))))
}

pub(crate) fn scene() -> Scene {
    build(&head()).expect("a sound scene")
}

pub(crate) fn manager(scene: Scene, executor: ExecutorKind, threads: usize) -> VeManager {
    let settings = Settings { executor, threads, ..Settings::default() };
    VeManager::new(scene, settings).expect("few threads")
}

/// A device at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) time: f64,
    pub(crate) place: Vec3,
    pub(crate) force: Vec3,
    pub(crate) speed: f32,
}

/// A simulated device whose every tick is kept.
pub(crate) struct Kept {
    pub(crate) device: SimulatedDevice,
    pub(crate) ticks: Vec<Tick>,
}

impl HapticDevice for Kept {
    fn description(&self) -> DeviceDescription {
        self.device.description()
    }

    fn read(&mut self, time: f64) -> Result<DeviceSample, DeviceError> {
        let sample = self.device.read(time)?;
        let speed = self.device.velocity().length();
        self.ticks.push(Tick { time, place: sample.position, force: Vec3::ZERO, speed });
        Ok(sample)
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceError> {
        self.ticks.last_mut().expect("it was read").force = wrench.force;
        self.device.write(wrench)
    }
}

/// What was seen of an operation.
pub(crate) struct Seen {
    pub(crate) ticks: Vec<Tick>,
    /// The right hand's tool after each frame: when, and where its tip was.
    pub(crate) tips: Vec<(f64, Vec3)>,
    /// The loop at the end.
    pub(crate) last: ToolState,
    pub(crate) hash: u64,
}

impl Seen {
    /// The ticks between two times, in seconds.
    pub(crate) fn during(&self, from: f64, to: f64) -> impl Iterator<Item = &Tick> {
        self.ticks.iter().filter(move |tick| from < tick.time && tick.time <= to)
    }

    /// The mean force between two times, in newtons.
    pub(crate) fn force(&self, from: f64, to: f64) -> Vec3 {
        self.during(from, to).map(|tick| tick.force).sum::<Vec3>()
            / self.during(from, to).count() as f32
    }

    /// No tick's step of the force was too great and no force beyond the device's greatest; the hand never
    /// got more energy than it gave, if it is `passive`; and the loop says the same of itself.
    pub(crate) fn is_sound(&self, passive: bool) {
        let most = ForceSettings::default().max_step * 1.000_001;
        let (mut energy, mut least) = (0.0_f64, 0.0_f64);
        for pair in self.ticks.windows(2) {
            let step = pair[0].force.distance(pair[1].force);
            assert!(step <= most, "a step of {step} N at {} s", pair[1].time);
            let way = pair[1].place - pair[0].place;
            energy -= pair[0].force.as_dvec3().dot(way.as_dvec3());
            least = least.min(energy);
        }
        let fastest = self.ticks.iter().map(|tick| f64::from(tick.speed)).fold(0.0, f64::max);
        // What a tick may generate before the limiter takes it back: K·(v·T)²/2.
        let stiffest = f64::from(SimulatedDevice::DESCRIPTION.max_stiffness);
        let one_tick = 0.5 * stiffest * (fastest * PERIOD) * (fastest * PERIOD);
        assert!(!passive || least > -one_tick, "{least} J, at most {fastest} m/s");
        let told = self.last.forces.least_absorbed;
        assert!((told - least).abs() < 1e-6, "the loop says {told} J of {least} J");
        let strongest = self.ticks.iter().map(|tick| tick.force.length()).fold(0.0, f32::max);
        assert!(strongest <= SimulatedDevice::DESCRIPTION.max_force * 1.000_001, "{strongest} N");
    }
}

/// The right hand operates with an instrument, or with those of a script, in a grip, for some seconds; the
/// pipeline is held up between two times.
pub(crate) struct Session {
    pub(crate) instrument: Option<Instrument>,
    pub(crate) script: Option<Stage>,
    pub(crate) hand: Hand,
    pub(crate) motion: Motion,
    pub(crate) seconds: f64,
    pub(crate) held_up: [f64; 2],
}

impl Session {
    pub(crate) fn new(
        instrument: Instrument,
        hand: Hand,
        keyframes: &[Keyframe],
        seconds: f64,
    ) -> Self {
        let motion = Motion::new(keyframes.iter().copied()).expect("in order");
        let (instrument, held_up) = (Some(instrument), [f64::INFINITY; 2]);
        Self { instrument, script: None, hand, motion, seconds, held_up }
    }

    /// The hand does what the script's right hand does.
    pub(crate) fn scripted(stage: Stage, hand: Hand) -> Self {
        let motion = Operation::new(head(), Some(stage)).motion(0).expect("it does something");
        let (seconds, held_up) = (motion.end(), [f64::INFINITY; 2]);
        Self { instrument: None, script: Some(stage), hand, motion, seconds, held_up }
    }

    /// Runs it: a frame every 1/60 s, and a thousand ticks a second between the frames.
    pub(crate) fn run(
        &self,
        manager: &mut VeManager,
        mut recorder: Option<&mut Recorder<&mut Vec<u8>>>,
    ) -> Seen {
        let mut link = HapticLink::new();
        let (end, simulation) = link.split();
        let device = SimulatedDevice::new(self.hand, self.motion.clone());
        let device = Kept { device, ticks: Vec::new() };
        let mut haptics = HapticLoop::new(device, end, ForceSettings::default());
        let mut operation = Operation::new(head(), self.script);
        operation.link(0, simulation);
        let mailbox = manager.mailbox();
        let take_up = |instrument| mailbox.post(TOOLS[0], Message::TakeUp(instrument));
        self.instrument.into_iter().for_each(take_up);
        let (mut tick, mut tips, mut last) = (0_u64, Vec::new(), None);
        for frame in 1..=(self.seconds / f64::from(TIME_STEP)) as u64 {
            let time = frame as f64 * f64::from(TIME_STEP);
            while (tick + 1) as f64 * PERIOD <= time {
                tick += 1;
                haptics.tick(tick as f64 * PERIOD);
            }
            if (self.held_up[0]..self.held_up[1]).contains(&time) {
                continue;
            }
            let mut renderer = NullRenderer::new();
            let (hands, mut watch) = operation.parts(&mut renderer);
            let mut on_frame = |record: &dualframe_sim::executor::FrameRecord| {
                hands.swapped(record.frame, &mailbox);
            };
            match &mut recorder {
                Some(recorder) => {
                    recorder.run(manager, 1, &mut watch, &mut on_frame).expect("it runs");
                }
                None => manager.run(1, &mut watch, &mut on_frame).expect("no table is full"),
            }
            last = hands.device(0);
            tips.push((time, tip(manager)));
        }
        assert!(manager.quarantined().is_empty());
        let (ticks, hash) = (haptics.device().ticks.clone(), manager.state_hash());
        Seen { ticks, tips, last: last.expect("it ticked"), hash }
    }

    /// Runs it in one thread. It is sound, but a force that comes back after the pipeline was held up pushes
    /// a hand out that has sunk in.
    pub(crate) fn alone(&self) -> Seen {
        let seen = self.run(&mut manager(scene(), ExecutorKind::Serial, 1), None);
        seen.is_sound(self.held_up[0] > self.seconds);
        seen
    }
}

/// Where the right hand's tool is.
pub(crate) fn tip(manager: &VeManager) -> Vec3 {
    let mut tip = None;
    manager.visit(&mut |object| {
        if object.id() == TOOLS[0] {
            tip = object.geometry.as_rigid().map(|rigid| rigid.pose.translation);
        }
    });
    tip.expect("the tool is there")
}
