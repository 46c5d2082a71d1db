//! The pipeline's memory, and what each core does: the same on every machine.

use core::fmt;

use dualframe_core::contacts::{ContactSlot, SegmentSlot};
use dualframe_core::inbox::LetterSlot;
use dualframe_core::pipeline::Pipeline;
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory, UnitSlot, queue_slots};
use dualframe_core::token::Token;
use dualframe_core::wait::Waiting;
use dualframe_core::worker::Step;

use crate::mail::{LETTERS, Outbox};
use crate::ve::{DISCS, Disc, FRAMES, Fault, Picture, Room};

/// Twice as many as pairs may be near each other in a frame.
const CANDIDATES: usize = 2 * 512;
const QUEUES: usize = queue_slots(DISCS, CANDIDATES, LETTERS, 1);

/// All memory of the pipeline.
pub(crate) struct Tables {
    units: [UnitSlot<Disc>; DISCS],
    interactions: [InteractionSlot<()>; CANDIDATES],
    contacts: [ContactSlot<[f32; 2]>; CANDIDATES],
    segments: [SegmentSlot; CANDIDATES],
    letters: [LetterSlot<u32>; LETTERS],
    queues: [QueueSlot; QUEUES],
}

impl Tables {
    pub(crate) const fn new() -> Self {
        Self {
            units: [const { UnitSlot::new(Disc::UNPLACED) }; DISCS],
            interactions: [const { InteractionSlot::spare(()) }; CANDIDATES],
            contacts: [const { ContactSlot::new() }; CANDIDATES],
            segments: [const { SegmentSlot::new() }; CANDIDATES],
            letters: [const { LetterSlot::new() }; LETTERS],
            queues: [const { QueueSlot::new() }; QUEUES],
        }
    }

    /// The memory, with every disc where it starts.
    pub(crate) fn lend(&mut self) -> Memory<'_, Room> {
        for (index, unit) in self.units.iter_mut().enumerate() {
            *unit.object_mut() = Disc::start(index);
        }
        Memory {
            units: &mut self.units,
            interactions: &mut self.interactions,
            contacts: &mut self.contacts,
            segments: &mut self.segments,
            letters: &mut self.letters,
            queues: &mut self.queues,
        }
    }
}

/// Works until all frames are swapped and returns how many steps had work to do; with a token it also
/// renders, and returns the picture. `nap` waits for an interrupt, unless what it is given says
/// that there is no need.
pub(crate) fn work<W: Waiting>(
    pipeline: &Pipeline<'_, Room, W>,
    token: Option<Token<'_, Picture>>,
    outbox: &Outbox,
    nap: impl Fn(&dyn Fn() -> bool),
) -> Result<(u32, Option<Picture>), Fault> {
    let mut worker = pipeline.worker();
    let renders = token.is_some();
    if let Some(token) = token {
        // The pipeline's own, and the worker has no other.
        let _held = worker.hold(token);
    }
    let mut steps = 0;
    while !pipeline.finished() {
        if renders && outbox.holds_back(pipeline) {
            nap(&|| outbox.is_done());
            continue;
        }
        match worker.step(&Room)? {
            Step::Worked(_) => steps += 1,
            Step::Idle => worker.wait(),
        }
    }
    Ok((steps, worker.release().map(Token::into_renderer)))
}

/// What a run came to.
pub(crate) struct Report<'s> {
    pub(crate) picture: Picture,
    /// Of each worker.
    pub(crate) steps: &'s [u32],
}

impl Report<'_> {
    /// Whether every frame was shown and every letter read.
    pub(crate) fn is_sound(&self) -> bool {
        self.picture.frames == FRAMES && self.picture.letters as usize == LETTERS
    }
}

impl fmt::Display for Report<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Picture { frames, letters, frames_with_letters, hash, .. } = &self.picture;
        writeln!(f, "frames {frames}")?;
        writeln!(f, "letters {letters}, read in {frames_with_letters} frames")?;
        writeln!(f, "steps of each worker {:?}", self.steps)?;
        write!(f, "hash {:016x}", hash.0)
    }
}
