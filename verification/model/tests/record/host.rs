//! The callbacks and the probe.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use dualframe_protocol::config::{self, Config};
use dualframe_protocol::trace::{Event, Seen, Task};

use crate::dut::contacts::Contacts;
use crate::dut::environment::{Environment, Pair};
use crate::dut::error::TableFull;
use crate::dut::frame::{Entry, Frame};
use crate::dut::inputs::Inputs;
use crate::dut::pipeline::BroadPhase;
use crate::dut::probe::Probe;
use crate::dut::unit::{UnitId, Work};

/// Whose the renderer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Renderer {
    /// That of each of so many tokens.
    Tokens(u32),
    /// Left to all workers.
    Shared,
}

impl Renderer {
    /// The tokens that the pipeline has; a shared renderer has the one there is.
    pub(crate) fn tokens(self) -> u32 {
        match self {
            Self::Tokens(tokens) => tokens,
            Self::Shared => 1,
        }
    }
}

/// A virtual environment and how it runs.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    pub(crate) units: u32,
    pub(crate) frames: u32,
    pub(crate) broad_phase: BroadPhase,
    pub(crate) entry: Entry,
    pub(crate) renderer: Renderer,
    pub(crate) homes: u32,
    /// Decides which pairs are modelled, and which are near in which frame.
    pub(crate) seed: u64,
    /// Of a hundred pairs, how many are near.
    pub(crate) near_percent: u64,
    /// One bit for each unit that never meets another (spatial broad phase).
    pub(crate) solitary: u32,
}

/// A hash of a few numbers (splitmix64's finaliser over each).
fn draw(seed: u64, about: &[u32]) -> u64 {
    about.iter().fold(seed, |state, &word| {
        let mut z = (state ^ u64::from(word)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

impl Setup {
    /// The model of this run.
    pub(crate) fn model(&self) -> Config {
        let pairs: Vec<_> = self.pairs().iter().map(|pair| pair.map(|unit| unit as u8)).collect();
        let solitary = (0..self.units).filter(|&unit| self.is_solitary(unit));
        Config {
            broad_phase: match self.broad_phase {
                BroadPhase::Spatial => config::BroadPhase::Spatial,
                BroadPhase::Pairwise => config::BroadPhase::Pairwise,
            },
            entry: match self.entry {
                Entry::AfterUpdate => config::Entry::AfterUpdate,
                Entry::AfterRender => config::Entry::AfterRender,
                Entry::AfterSwap => config::Entry::AfterSwap,
            },
            tokens: self.renderer.tokens() as u8,
            shared: self.renderer == Renderer::Shared,
            solitary: solitary.fold(0, |bits, unit| bits | 1 << unit),
            ..Config::new(1, self.units as u8, &pairs, self.frames as u8)
        }
    }

    pub(crate) fn is_solitary(&self, unit: u32) -> bool {
        match self.broad_phase {
            BroadPhase::Spatial => self.solitary >> unit & 1 == 1,
            BroadPhase::Pairwise => !self.pairs().iter().any(|pair| pair.contains(&unit)),
        }
    }

    /// What is tested in each frame: `[a, b]` with a < b, or `[a, a]` where a unit is asked about
    /// itself.
    pub(crate) fn pairs(&self) -> Vec<[u32; 2]> {
        let all = (0..self.units).flat_map(|a| (a..self.units).map(move |b| [a, b]));
        match self.broad_phase {
            BroadPhase::Spatial => {
                all.filter(|pair| pair.iter().all(|&unit| self.solitary >> unit & 1 == 0)).collect()
            }
            BroadPhase::Pairwise => {
                let modelled =
                    |[a, b]: &[u32; 2]| a != b && draw(self.seed, &[*a, *b]).is_multiple_of(2);
                all.filter(modelled).collect()
            }
        }
    }

    /// Whether a pair is a candidate in a frame.
    pub(crate) fn near(&self, [a, b]: [u32; 2], frame: u32) -> bool {
        draw(self.seed, &[a, b, frame]) % 100 < self.near_percent
    }
}

/// Who has an object: the host's own watch on the lends of the core.
#[derive(Debug, Default)]
pub(crate) struct Watching {
    readers: AtomicU32,
    writers: AtomicU32,
}

impl Watching {
    fn read(&self, pause: fn()) {
        self.readers.fetch_add(1, Ordering::SeqCst);
        assert_eq!(self.writers.load(Ordering::SeqCst), 0, "read while it is written");
        pause();
        assert_eq!(self.writers.load(Ordering::SeqCst), 0, "written while it is read");
        self.readers.fetch_sub(1, Ordering::SeqCst);
    }

    fn write(&self, pause: fn()) {
        assert_eq!(self.writers.fetch_add(1, Ordering::SeqCst), 0, "written twice at once");
        assert_eq!(self.readers.load(Ordering::SeqCst), 0, "written while it is read");
        pause();
        assert_eq!(self.readers.load(Ordering::SeqCst), 0, "read while it is written");
        self.writers.fetch_sub(1, Ordering::SeqCst);
    }
}

/// A unit's object.
#[derive(Debug)]
pub(crate) struct Body {
    pub(crate) id: u32,
    pub(crate) updates: u32,
    pub(crate) value: u32,
    watching: Watching,
}

impl Body {
    pub(crate) fn new(id: u32) -> Self {
        Self { id, updates: 0, value: id + 1, watching: Watching::default() }
    }
}

/// What a token owns: nothing, since the record says who rendered what.
#[derive(Debug, Default)]
pub(crate) struct Screen;

/// Everything that was seen, in one order.
#[derive(Debug, Default)]
pub(crate) struct Recorder(Mutex<Vec<Seen>>);

impl Recorder {
    pub(crate) fn see(&self, worker: u32, event: Event) {
        self.0.lock().expect("no poison").push(Seen { worker, event });
    }

    /// The record, in which an interaction's beginning is told its ends.
    pub(crate) fn into_record(self) -> Vec<Seen> {
        let mut record = self.0.into_inner().expect("no poison");
        for at in 0..record.len() {
            let Seen { worker, event: Event::Begin(Task::Interact { slot, .. }, _) } = record[at]
            else {
                continue;
            };
            let by_worker = record[at + 1..].iter().find(|seen| seen.worker == worker);
            if let Some(Seen { event: Event::Call(Task::Interact { ends, .. }, _), .. }) = by_worker
            {
                let ends = *ends;
                if let Event::Begin(task, _) = &mut record[at].event {
                    *task = Task::Interact { ends, slot };
                }
            }
        }
        record
    }
}

/// One worker's callbacks, and its probe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Host<'a> {
    pub(crate) setup: &'a Setup,
    pub(crate) recorder: &'a Recorder,
    pub(crate) worker: u32,
    /// What a callback does in its middle: lets others run.
    pub(crate) pause: fn(),
}

/// The result of an interaction.
pub(crate) fn response(a: u32, b: u32, frame: u32) -> u32 {
    a.wrapping_mul(7).wrapping_add(b.wrapping_mul(13)).wrapping_add(frame)
}

/// One term of an update; not commutative, so that the order of the terms shows.
pub(crate) fn fold(value: u32, term: u32) -> u32 {
    value.wrapping_mul(31).wrapping_add(term)
}

impl Host<'_> {
    pub(crate) fn see(&self, event: Event) {
        self.recorder.see(self.worker, event);
    }

    fn test(&self, ends: [u32; 2], frame: u32) -> bool {
        let near = self.setup.near(ends, frame);
        self.see(Event::Test(ends, near));
        near
    }
}

impl Environment for Host<'_> {
    type Object = Body;
    type Interaction = u32;
    type Contact = u32;
    type Message = u32;
    type Renderer = Screen;
    type Error = TableFull;

    fn broad_phase(&self, a: &Body, b: &Body) -> bool {
        assert_eq!(a.updates, b.updates, "both ends are in one frame");
        a.watching.read(|| ());
        b.watching.read(self.pause);
        self.test([a.id.min(b.id), a.id.max(b.id)], a.updates)
    }

    fn interacts_within(&self, body: &Body) -> bool {
        body.watching.read(|| ());
        self.test([body.id; 2], body.updates)
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Body,
        b: &Body,
        state: &mut u32,
        contacts: &mut Contacts<'_, '_, u32>,
    ) -> Result<(), TableFull> {
        let (frame, ends) = (pair.frame.0, pair.ends.map(|end| end.0));
        assert_eq!([a.id, b.id], ends);
        assert_eq!([a.updates, b.updates], [frame; 2], "between the ends' updates");
        a.watching.read(|| ());
        b.watching.read(self.pause);
        *state = frame;
        let result = response(a.value, b.value, frame);
        contacts.push(&[result])?;
        contacts.push(&[result ^ 1])?;
        self.see(Event::Call(Task::Interact { ends, slot: pair.id.0 }, frame));
        Ok(())
    }

    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &mut Body,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        assert_eq!((unit.0, frame.0), (body.id, body.updates), "updates in order");
        body.watching.write(self.pause);
        for interaction in inputs.interactions() {
            assert_eq!(*interaction.state, frame.0, "the interaction of this frame");
            for segment in interaction.contacts {
                body.value = segment.iter().fold(body.value, |value, &term| fold(value, term));
            }
        }
        body.updates += 1;
        self.see(Event::Call(Task::Update(unit.0), frame.0));
        Ok(())
    }

    fn render(
        &self,
        unit: UnitId,
        frame: Frame,
        body: &Body,
        _: &mut Screen,
    ) -> Result<(), TableFull> {
        assert_eq!((unit.0, frame.0 + 1), (body.id, body.updates), "rendered as updated");
        body.watching.read(self.pause);
        self.see(Event::Call(Task::Render(unit.0), frame.0));
        Ok(())
    }

    fn swap(&self, frame: Frame, _: &mut Screen) -> Result<(), TableFull> {
        self.see(Event::Swap(frame.0));
        Ok(())
    }
}

impl Probe for Host<'_> {
    fn begin(&mut self, work: Work, frame: Frame) {
        let task = match work {
            Work::Enter(unit) => Task::Enter(unit.0),
            // Its ends are filled in when the record is complete.
            Work::Interact(id) => Task::Interact { ends: [u32::MAX; 2], slot: id.0 },
            Work::Update(unit) => Task::Update(unit.0),
            Work::Render(unit) => Task::Render(unit.0),
        };
        self.see(Event::Begin(task, frame.0));
    }

    fn end(&mut self, _: Work, _: Frame) {
        self.see(Event::End);
    }
}
