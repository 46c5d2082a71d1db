//! Real threads on the core, for a sanitizer to watch: random virtual environments with four workers,
//! inboxes whose letters pass through a ring from sender to receiver and back, a latest-value cell.
//! Ends with an error where a result is wrong; what a sanitizer finds, it reports itself.
#![deny(unsafe_code)]

use std::process::ExitCode;
use std::thread::ScopedJoinHandle;

use dualframe_core::contacts::{ContactSlot, Contacts, SegmentSlot};
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::{Entry, Frame};
use dualframe_core::inbox::{From, Inbox, LetterSlot, Post};
use dualframe_core::inputs::Inputs;
use dualframe_core::latest::Latest;
use dualframe_core::pipeline::{BroadPhase, Config, Pipeline};
use dualframe_core::ring::{IndexRing, QueueSlot, slots_for};
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::worker::Step;
use dualframe_tests::body::draw;
use dualframe_tests::drive::Park;
use dualframe_tests::watchdog::watch;

/// Virtual environments.
const CASES: u64 = 200;
/// Frames of each.
const FRAMES: u32 = 40;
/// Letters, publications and passings-on of each thread.
const TURNS: u32 = 100_000;

/// A random environment. Its callbacks share nothing but what the core lends them: no clock, no
/// lock, whose own ordering would hide a missing one.
#[derive(Clone, Copy)]
struct Crowd {
    seed: u64,
    units: u32,
    config: Config,
    /// Whether idle workers sleep.
    sleep: bool,
    /// Whether the renderer is left to all workers.
    shared: bool,
}

/// Place, speed, what was felt, what was heard.
type Body = [f32; 4];

impl Environment for Crowd {
    type Object = Body;
    type Interaction = f32;
    type Contact = f32;
    type Message = f32;
    type Renderer = Vec<f32>;
    type Error = TableFull;

    fn broad_phase(&self, a: &Body, b: &Body) -> bool {
        (a[0] - b[0]).abs() < 2.0
    }

    fn interacts_within(&self, body: &Body) -> bool {
        body[1] > 0.0
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Body,
        b: &Body,
        state: &mut f32,
        contacts: &mut Contacts<'_, '_, f32>,
    ) -> Result<(), TableFull> {
        *state = (a[0] - b[0]) * 0.3 + pair.frame.0 as f32;
        contacts.push(&[a[0] - b[0], a[1]])?;
        contacts.push(&[b[1]])
    }

    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &mut Body,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        for interaction in inputs.interactions() {
            body[2] = body[2] * 0.5 + interaction.state;
            interaction.contacts.flatten().for_each(|&record| body[2] = body[2] * 0.9 + record);
        }
        while let Some((_, heard)) = inputs.next_letter() {
            body[3] = body[3] * 0.5 + heard;
        }
        body[0] = (body[0] + body[1] + (body[2] + body[3]).sin() * 0.2).clamp(-4.0, 4.0);
        let to = draw(self.seed, &[1, unit.0, frame.0]) % u64::from(self.units);
        inputs.post(UnitId(to as u32), unit.0, body[0]).map_err(|rejected| rejected.full)
    }

    fn render(
        &self,
        _: UnitId,
        _: Frame,
        body: &Body,
        picture: &mut Vec<f32>,
    ) -> Result<(), TableFull> {
        picture.push(body[0]);
        Ok(())
    }

    fn swap(&self, _: Frame, picture: &mut Vec<f32>) -> Result<(), TableFull> {
        picture.clear();
        Ok(())
    }
}

impl Crowd {
    fn of(seed: u64) -> Self {
        let one_of = |what, count| draw(seed, &[2, what]) as usize % count;
        let entry = [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap][one_of(0, 3)];
        let broad_phase = [BroadPhase::Spatial, BroadPhase::Pairwise][one_of(1, 2)];
        let tokens = 1 + one_of(2, 2) as u32;
        let homes = 1 + one_of(6, 3) as u32;
        let config = Config { broad_phase, entry, tokens, homes };
        let [sleep, shared] = [4, 7].map(|what| one_of(what, 2) == 1);
        Self { seed, units: 1 + one_of(3, 10) as u32, config, sleep, shared }
    }

    /// Every body's bits after all frames, by so many workers.
    fn run(self, workers: u32) -> Result<Vec<[u32; 4]>, String> {
        let n = self.units as usize;
        let pairs: Vec<_> = (0..self.units).flat_map(|b| (0..b).map(move |a| [a, b])).collect();
        let mut interactions: Vec<_> = match self.config.broad_phase {
            BroadPhase::Spatial => {
                (0..2 * (pairs.len() + n)).map(|_| InteractionSlot::spare(0.0)).collect()
            }
            BroadPhase::Pairwise => pairs
                .iter()
                .map(|&[a, b]| InteractionSlot::between(UnitId(a), UnitId(b), 0.0))
                .collect(),
        };
        let unit = |unit: u32| {
            let float = |about| draw(self.seed, &[about, unit]) as f32 / u64::MAX as f32;
            let body = [float(3) * 8.0 - 4.0, float(4) - 0.5, 0.0, 0.0];
            if float(5) < 0.2 { UnitSlot::solitary(body) } else { UnitSlot::new(body) }
        };
        let (contacts, letters) = (6 * (pairs.len() + n), 2 * n);
        let queues = queue_slots(n, interactions.len(), letters, self.config.homes as usize);
        let memory = Memory {
            units: &mut Vec::from_iter((0..self.units).map(unit)),
            interactions: &mut interactions,
            contacts: &mut Vec::from_iter((0..contacts).map(|_| ContactSlot::new())),
            segments: &mut Vec::from_iter((0..contacts).map(|_| SegmentSlot::new())),
            letters: &mut Vec::from_iter((0..letters).map(|_| LetterSlot::new())),
            queues: &mut Vec::from_iter((0..queues).map(|_| QueueSlot::new())),
        };
        let made = Pipeline::new(memory, self.config, Park::default());
        let mut pipeline = made.map_err(|error| error.to_string())?;
        pipeline.run(FRAMES).map_err(|error| error.to_string())?;
        if self.shared {
            pipeline.share(Vec::new()).map_err(|(_, full)| full.to_string())?;
        }
        std::thread::scope(|scope| {
            let pipeline = &pipeline;
            let running: Vec<_> =
                (0..workers).map(|home| scope.spawn(move || self.work(pipeline, home))).collect();
            join(running).into_iter().collect::<Result<(), String>>()
        })?;
        Ok(pipeline.objects_mut().map(|body| body.map(f32::to_bits)).collect())
    }

    /// One worker's life; the first ones have a token each, if the renderer is not left to all.
    fn work(self, pipeline: &Pipeline<'_, Self, Park>, home: u32) -> Result<(), String> {
        let mut worker = pipeline.worker_at(home);
        if let Ok(token) = pipeline.token(Vec::new()) {
            worker.hold(token).map_err(|_| "another pipeline's token")?;
        }
        while !pipeline.finished() {
            let step = worker.step(&self).map_err(|full| full.to_string())?;
            if step == Step::Idle && self.sleep {
                worker.wait();
            } else if step == Step::Idle {
                std::thread::yield_now();
            }
        }
        Ok(())
    }
}

/// Four workers compute what one does.
fn environments() -> Result<(), String> {
    for seed in 0..CASES {
        // A worker that fails leaves the others waiting.
        let _watched = watch(format!("seed {seed}"));
        let crowd = Crowd::of(seed);
        if crowd.run(4)? != crowd.run(1)? {
            return Err(format!("seed {seed}: four workers have other results than one"));
        }
    }
    Ok(())
}

/// Ends threads one by one, as the system does it: ThreadSanitizer does not see how a scope waits for
/// its threads, since the standard library is not instrumented.
fn join<'s, T: 's>(threads: impl IntoIterator<Item = ScopedJoinHandle<'s, T>>) -> Vec<T> {
    threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
}

/// Four threads pass a few indices on through one ring.
fn ring() -> Result<(), String> {
    let mut slots = [const { QueueSlot::new() }; 4];
    let ring = IndexRing::new(&mut slots).map_err(|full| full.to_string())?;
    let push = |index| ring.push(index).expect("a slot for each of four indices");
    (0..4).for_each(push);
    std::thread::scope(|scope| {
        let pass_on = || {
            for _ in 0..TURNS {
                let popped = ring.pop();
                popped.into_iter().for_each(push);
            }
        };
        let running: Vec<_> = (0..4).map(|_| scope.spawn(pass_on)).collect();
        join(running);
    });
    let mut left: Vec<_> = std::iter::from_fn(|| ring.pop()).collect();
    left.sort_unstable();
    if left == [0, 1, 2, 3] { Ok(()) } else { Err(format!("the ring holds {left:?}")) }
}

/// Two threads post to one that collects; messages are memory of their own.
fn inbox() -> Result<(), String> {
    let mut slots: Vec<_> = (0..8).map(|_| LetterSlot::new()).collect();
    let mut queue: Vec<_> = (0..slots_for(8)).map(|_| QueueSlot::new()).collect();
    let post = Post::new(&mut slots, &mut queue).map_err(|full| full.to_string())?;
    // SAFETY: there is one pool.
    #[expect(unsafe_code, reason = "an inbox apart from a pipeline")]
    let inbox = unsafe { Inbox::new() };
    let (letters, sound) = std::thread::scope(|scope| {
        let (post, inbox) = (&post, &inbox);
        let send = move |sender| {
            for sequence in 0..TURNS {
                let mut message = vec![sequence; 4];
                while let Err(rejected) =
                    post.post(inbox, Frame(0), From { sender, sequence }, message)
                {
                    message = rejected.message;
                    std::thread::yield_now();
                }
            }
        };
        let running: Vec<_> = (0..2).map(|sender| scope.spawn(move || send(sender))).collect();
        let (mut letters, mut sound) = (0, 0);
        let mut collect = || {
            for (from, message) in post.collect(inbox, Frame(1)) {
                letters += 1;
                sound += u32::from(message == [from.sequence; 4]);
            }
        };
        while !running.iter().all(|thread| thread.is_finished()) {
            collect();
            std::thread::yield_now();
        }
        join(running);
        collect();
        (letters, sound)
    });
    let all = 2 * TURNS;
    if (letters, sound) == (all, all) {
        Ok(())
    } else {
        Err(format!("{letters} letters of {all} received, {sound} of them as they were sent"))
    }
}

/// One thread publishes, three read: no value is torn, none is older than one read before.
fn latest() -> Result<(), String> {
    let mut cell = Latest::<[u32; 8], 5>::new([0; 8]);
    let (mut writer, readers) = cell.split();
    std::thread::scope(|scope| {
        let publish = move || (1..=TURNS).for_each(|turn| writer.publish([turn; 8]));
        let writing = scope.spawn(publish);
        let read = move || {
            let mut reader = readers.reader().map_err(|full| full.to_string())?;
            let mut before = 0;
            for _ in 0..TURNS {
                let value = reader.read();
                if value != [value[0]; 8] || value[0] < before {
                    return Err(format!("{value:?} after {before}"));
                }
                before = value[0];
            }
            Ok(())
        };
        let running: Vec<_> = (0..3).map(|_| scope.spawn(read)).collect();
        join([writing]);
        join(running).into_iter().collect()
    })
}

fn main() -> ExitCode {
    for (name, run) in [
        ("ring", ring as fn() -> Result<(), String>),
        ("inbox", inbox),
        ("latest", latest),
        ("environments", environments),
    ] {
        if let Err(wrong) = run() {
            eprintln!("{name}: {wrong}");
            return ExitCode::FAILURE;
        }
        println!("{name}: sound");
    }
    ExitCode::SUCCESS
}
