//! Sessions with all that can come from outside, and how they are replayed.

use dualframe_sim::behavior::{Instrument, MassSpring};
use dualframe_sim::device::DeviceSample;
use dualframe_sim::executor::FrameRecord;
use dualframe_sim::geometry::Geometry;
use dualframe_sim::mailbox::Mailbox;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::record::{
    Control, Header, ReadError, Reader, Recorder, Replay, ReplayError, Step, Totals,
};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{ParticleScene, Scene};
use glam::Vec3;

pub(crate) const PARTICLES: usize = 12;

/// Numbers that only look random (xorshift).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 >> 8
    }

    pub(crate) fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    /// From −1 to 1.
    fn symmetric(&mut self) -> f32 {
        self.below(2_001) as f32 / 1_000.0 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.symmetric(), self.symmetric(), self.symmetric())
    }
}

pub(crate) fn spec(seed: u64) -> ParticleScene {
    ParticleScene { seed, gravity: true, ..ParticleScene::new(PARTICLES) }
}

fn message(random: &mut Random) -> Message {
    let node = random.below(42) as u32;
    match random.below(9) {
        0..4 => Message::Impulse { node, impulse: (random.vector() * 3e-3).to_array() },
        4 => {
            let between_nodes = 40.0 + random.below(40) as f32;
            Message::Stiffness { between_nodes, to_center: 5.0 * between_nodes }
        }
        5 => Message::Damping(0.01 + 0.01 * random.symmetric().abs()),
        6 => Message::Pull { node, target: random.vector().to_array(), stiffness: 100.0 },
        7 => Message::Release,
        _ => match random.below(3) {
            0 => Message::Weightless(random.below(2) == 0),
            1 => Message::Device(DeviceSample::at(random.vector())),
            _ => Message::TakeUp(Instrument::ALL[random.below(7) as usize]),
        },
    }
}

/// To an object that may not be there.
fn post(mailbox: &Mailbox, random: &mut Random) {
    mailbox.post(ObjectId(random.below(PARTICLES as u64 + 8) as u32), message(random));
}

/// Adds a particle whose velocity is `spec`, four bytes for each component.
pub(crate) fn add(scene: &mut Scene, spec: &[u8]) {
    let component = |axis: usize| {
        let bytes = spec[4 * axis..4 * axis + 4].try_into().expect("four bytes");
        f32::from_le_bytes(bytes)
    };
    let mut model = ParticleScene::new(1).build().expect("one particle").objects.remove(0);
    let group = model.group();
    let mesh = model.geometry.as_mesh_mut().expect("a particle is a mesh");
    mesh.set_velocity(Vec3::new(component(0), component(1), component(2)));
    let behavior = MassSpring::new(60.0, 0.02, 2).expect("valid springs");
    let id = ObjectId(scene.objects.len() as u32);
    scene.objects.push(Object::new(id, group, Geometry::Mesh(mesh.clone()), behavior));
}

/// What became of a session.
pub(crate) struct Session {
    pub(crate) file: Vec<u8>,
    /// The state's hash at the start and at the end of each run, with the frames done until then.
    pub(crate) hashes: Vec<(u64, u64)>,
    pub(crate) totals: Totals,
}

impl Session {
    pub(crate) fn last(&self) -> u64 {
        self.hashes.last().expect("there is one").1
    }
}

/// A session of so many frames in runs of random lengths, each in the next of `ways`, with messages
/// posted between them and in them, controls, and an object that is added. It is written often.
pub(crate) fn session(seed: u64, frames: u64, ways: &[Settings]) -> Session {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let spec = spec(seed);
    let mut ways = ways.iter().cycle();
    let mut way = || *ways.next().expect("there are ways");
    let scene = spec.build().expect("a valid scene");
    let mut manager = VeManager::new(scene, way()).expect("valid settings");
    let mut recorder =
        Recorder::begin(Vec::new(), &Header::of(&spec), &manager).expect("it can be recorded");
    let mut hashes = vec![(0, manager.state_hash())];
    let mut is_added = false;
    while manager.frame() < frames {
        let mailbox = manager.mailbox();
        if random.below(2) == 0 {
            (0..random.below(4)).for_each(|_| post(&mailbox, &mut random));
        }
        if random.below(3) == 0 {
            let gravity = Control::Gravity(random.vector() * 9.0);
            recorder.control(&mut manager, gravity).expect("it is recorded");
        }
        if random.below(5) == 0 {
            let time_step = Control::TimeStep((1.0 + 0.2 * random.symmetric()) / 240.0);
            recorder.control(&mut manager, time_step).expect("it is recorded");
        }
        let length = [1, 2, 7, 25, 70][random.below(5) as usize].min(frames - manager.frame());
        let mut on_frame = |_: &FrameRecord| {
            if random.below(3) == 0 {
                (0..random.below(4)).for_each(|_| post(&mailbox, &mut random));
            }
        };
        let mut renderer = NullRenderer::new();
        recorder.run(&mut manager, length, &mut renderer, &mut on_frame).expect("it runs");
        recorder.write(&manager).expect("it is written");
        hashes.push((manager.frame(), manager.state_hash()));
        let adds = !is_added && manager.frame() > frames / 2;
        if adds {
            let velocity: Vec<u8> =
                random.vector().to_array().into_iter().flat_map(f32::to_le_bytes).collect();
            recorder.objects(&manager, &velocity).expect("it is recorded");
            manager = moved(manager, way(), |scene| add(scene, &velocity));
            is_added = true;
        } else if random.below(3) == 0 {
            manager = moved(manager, way(), |_| {});
        }
    }
    let (file, totals) = recorder.finish(&manager).expect("it is written");
    Session { file, hashes, totals }
}

pub(crate) fn moved(
    manager: VeManager,
    way: Settings,
    change: impl FnOnce(&mut Scene),
) -> VeManager {
    let mut scene = manager.into_scene();
    change(&mut scene);
    VeManager::new(scene, way).expect("valid settings")
}

/// What came of a replay.
#[derive(Debug)]
pub(crate) struct Played {
    pub(crate) frames: u64,
    pub(crate) hash: u64,
    pub(crate) letters: u64,
    pub(crate) checkpoints: u64,
    /// Why it ended before the recording did, if so.
    pub(crate) error: Option<ReplayError>,
}

/// Replays a recording in one way, by up to `most` frames at a time.
pub(crate) fn replay(file: &[u8], way: Settings, most: u64) -> Result<Played, ReplayError> {
    let mut replay = Replay::new(file)?;
    let spec: ParticleScene = replay.header().scene().expect("particles");
    let mut scene = spec.build().expect("a valid scene");
    replay.begin(&mut scene);
    let mut manager = VeManager::new(scene, way).expect("valid settings");
    let mut renderer = NullRenderer::new();
    let error = loop {
        match replay.advance(&mut manager, most, &mut renderer, &mut |_| {}) {
            Ok(Step::Over) => break None,
            Ok(Step::Advanced | Step::Agrees { .. }) => {}
            Ok(Step::Objects(spec)) => manager = moved(manager, way, |scene| add(scene, &spec)),
            Err(error) => break Some(error),
        }
    };
    let (frames, hash) = (manager.frame(), manager.state_hash());
    let (letters, checkpoints) = (replay.letters(), replay.checkpoints());
    Ok(Played { frames, hash, letters, checkpoints, error })
}

/// All events of a file as text, and why there are no more.
pub(crate) fn read(file: &[u8]) -> (Vec<String>, Option<ReadError>) {
    let reader = match Reader::new(file) {
        Ok(reader) => reader,
        Err(error) => return (Vec::new(), Some(error)),
    };
    let mut events = Vec::new();
    for event in reader {
        match event {
            Ok(event) => events.push(format!("{event:?}")),
            Err(error) => return (events, Some(error)),
        }
    }
    (events, None)
}
