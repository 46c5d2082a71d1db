//! What the stage-by-stage executors have in common: plain data and the work of one item of each
//! stage.

use super::ExecutorError;
use super::mail::Mail;
use crate::block::Block;
use crate::blocking::{Blocking, FRAMES_PER_BLOCKING, Grain};
use crate::geometry::Bounds;
use crate::interaction::{Contact, ContactBuffer, Scratch};
use crate::message::Message;
use crate::object::{Object, ObjectId};
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};

/// Records that a candidate's buffer holds before it has to grow.
pub(super) const RECORDS_PER_CANDIDATE: usize = 512;
/// Candidates with a buffer from the start, for each block: itself and its neighbours in a grid, of
/// which each pair counts once, and some walls.
const CANDIDATES_PER_BLOCK: usize = 16;
/// Letters that a block can send in a frame before its outbox has to grow.
const LETTERS_PER_BLOCK: usize = 16;

/// An environment in blocks.
pub(super) struct World {
    pub(super) stages: Stages,
    pub(super) blocks: Vec<Block>,
    pub(super) blocking: Blocking,
    pub(super) partners: Partners,
    grain: Grain,
}

impl World {
    pub(super) fn new(scene: Scene, grain: Grain, workers: usize) -> Result<Self, ExecutorError> {
        let Scene { objects, stages } = scene;
        let (blocking, blocks) = Blocking::new(objects, grain, workers)?;
        let partners = Partners::new(&stages, &blocks, grain);
        Ok(Self { stages, blocks, blocking, partners, grain })
    }

    /// Whether blocks are formed anew before a frame.
    pub(super) fn regroups_before(&self, frame: u64) -> bool {
        regroups_before(self.grain, frame)
    }

    /// Forms the blocks anew.
    pub(super) fn regroup(&mut self) {
        for block in &mut self.blocks {
            self.blocking.drain(block);
        }
        self.blocking.split();
        for (index, block) in self.blocks.iter_mut().enumerate() {
            self.blocking.fill(index, block);
        }
    }
}

/// Whether blocks of this grain are formed anew before a frame.
pub(super) fn regroups_before(grain: Grain, frame: u64) -> bool {
    grain == Grain::Spatial && frame > 0 && frame.is_multiple_of(FRAMES_PER_BLOCKING)
}

/// Which blocks the broad phase has to look at, for each block those at or after it.
pub(super) struct Partners(Vec<Vec<u32>>);

impl Partners {
    /// All for blocks whose objects change; for single objects those there is a rule for.
    fn new(stages: &Stages, blocks: &[Block], grain: Grain) -> Self {
        let modelled = |a: &Block, b: &Block| match (grain, a.objects(), b.objects()) {
            (Grain::Pairwise, [a], [b]) => a.id() != b.id() && stages.rules.interact(a, b),
            _ => true,
        };
        let of = |first: usize| {
            let others =
                (first..blocks.len()).filter(|&other| modelled(&blocks[first], &blocks[other]));
            others.map(|other| other as u32).collect()
        };
        Self((0..blocks.len()).map(of).collect())
    }

    /// Finds the partners of block `first` that may interact with it. `may_touch` looks at the blocks
    /// themselves; it is asked only where their boxes overlap.
    pub(super) fn find(
        &self,
        first: usize,
        bounds: &[Bounds],
        mut may_touch: impl FnMut(usize) -> bool,
        found: &mut Vec<u32>,
    ) {
        found.clear();
        let own = bounds[first];
        let partners = self.0[first].iter().copied();
        let close = partners.filter(|&other| own.overlaps(&bounds[other as usize]));
        found.extend(close.filter(|&other| may_touch(other as usize)));
    }
}

/// The pairs of blocks that interact in a frame.
#[derive(Default)]
pub(super) struct Candidates {
    /// The pairs; a block with itself where its own objects may touch.
    pub(super) pairs: Vec<[u32; 2]>,
    /// For each block the places of the pairs it is in.
    of_block: Vec<Vec<u32>>,
}

impl Candidates {
    pub(super) fn new(blocks: usize) -> Self {
        let mut of_block = Vec::new();
        of_block.resize_with(blocks, || Vec::with_capacity(4 * CANDIDATES_PER_BLOCK));
        Self { pairs: Vec::with_capacity(CANDIDATES_PER_BLOCK * blocks), of_block }
    }

    pub(super) fn clear(&mut self) {
        self.pairs.clear();
        self.of_block.iter_mut().for_each(Vec::clear);
    }

    /// Adds what was found for block `first`.
    pub(super) fn extend(&mut self, first: usize, found: &[u32]) {
        for &second in found {
            let place = self.pairs.len() as u32;
            self.pairs.push([first as u32, second]);
            self.of_block[first].push(place);
            if second as usize != first {
                self.of_block[second as usize].push(place);
            }
        }
    }

    /// The places of the pairs that a block is in.
    pub(super) fn of_block(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        self.of_block[block].iter().map(|&place| place as usize)
    }
}

/// An empty list for what the broad phase finds for a block.
pub(super) fn found_list() -> Vec<u32> {
    Vec::with_capacity(4 * CANDIDATES_PER_BLOCK)
}

/// The blocks of a pair; a block with itself is given once.
pub(super) fn pair(blocks: &[Block], [first, second]: [u32; 2]) -> (&Block, Option<&Block>) {
    (&blocks[first as usize], (first != second).then(|| &blocks[second as usize]))
}

/// Whether objects of two blocks, or of one if they are the same, may touch.
pub(super) fn may_touch(stages: &Stages, first: &Block, second: Option<&Block>) -> bool {
    match second {
        Some(second) => stages.broad_phase(first, second),
        None => stages.interacts_within(first),
    }
}

/// The results of one candidate.
pub(super) struct Outcome {
    contacts: ContactBuffer,
    pub(super) pairs: PairCount,
}

impl Outcome {
    pub(super) fn new() -> Self {
        let contacts = ContactBuffer::with_capacity(RECORDS_PER_CANDIDATE);
        Self { contacts, pairs: PairCount::default() }
    }

    /// Interacts two blocks, or one with itself if there is no second.
    pub(super) fn compute(
        &mut self,
        stages: &Stages,
        first: &Block,
        second: Option<&Block>,
        scratch: &mut Scratch,
    ) {
        self.contacts.clear();
        let counted = match second {
            Some(second) => stages.interact(first, second, scratch, &mut self.contacts),
            None => stages.interact_within(first, scratch, &mut self.contacts),
        };
        // A buffer in growing memory is never full.
        self.pairs = counted.unwrap_or_default();
    }

    pub(super) fn segments(&self) -> impl Iterator<Item = &[Contact]> + '_ {
        self.contacts.segments()
    }
}

/// The number of outcomes to begin with.
pub(super) fn first_outcomes(blocks: usize) -> usize {
    CANDIDATES_PER_BLOCK * blocks
}

/// What the objects of a block sent in a frame, as (from, to, message).
pub(super) type Outbox = Vec<(ObjectId, ObjectId, Message)>;

/// An empty outbox for so many blocks.
pub(super) fn outbox(blocks: usize) -> Outbox {
    Vec::with_capacity(blocks * LETTERS_PER_BLOCK)
}

/// Moves what was sent to the next frame's mail.
pub(super) fn empty_into(outbox: &mut Outbox, mail: &mut Mail) {
    for (from, to, message) in outbox.drain(..) {
        mail.collect(from, to, message);
    }
}

/// Shows all objects of some blocks.
pub(super) fn visit(blocks: &[Block], visit: &mut dyn FnMut(&Object)) {
    blocks.iter().flat_map(Block::objects).for_each(visit);
}
