//! What the stage-by-stage executors have in common: plain data and the work of one item of each
//! stage.

use std::ops::Deref;
use std::sync::Arc;

use super::mail::Mail;
use super::outside::Outside;
use crate::block::Block;
use crate::blocking::{Blocking, FRAMES_PER_BLOCKING, Grain};
use crate::geometry::Bounds;
use crate::interaction::{ContactBuffer, ContactRecord, Scratch};
use crate::message::{Letter, Message};
use crate::object::{Object, ObjectId};
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};

/// Records that a candidate's buffer holds before it has to grow, of two blocks and of two single objects.
const RECORDS_PER_CANDIDATE: usize = 512;
const RECORDS_PER_PAIR: usize = 128;
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
    pub(super) mail: Mail,
    pub(super) outside: Arc<Outside>,
    grain: Grain,
}

impl World {
    /// Of a scene whose objects can be grouped.
    pub(super) fn new(scene: Scene, grain: Grain, workers: usize) -> Self {
        let Scene { objects, stages, frame, mail: under_way, mailbox } = scene;
        let (blocking, blocks) = Blocking::group(objects, grain, workers);
        let partners = Partners::new(&stages, grain, blocks.len(), |index| &blocks[index]);
        let mut mail = Mail::default();
        let collect = |from, to, message| mail.collect(from, to, message);
        let outside = Arc::new(Outside::new(mailbox, under_way, frame, collect));
        Self { stages, blocks, blocking, partners, mail, outside, grain }
    }

    /// The environment before the frame `frame`.
    pub(super) fn into_scene(self, frame: u64) -> Scene {
        let objects = self.blocks.into_iter().flat_map(|block| block.objects);
        scene(objects, self.stages, frame, self.mail.into_letters(frame), &self.outside)
    }

    /// Changes what all stages share.
    pub(super) fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        if changes_pairs(&mut self.stages, change) {
            let Self { stages, blocks, grain, .. } = &*self;
            self.partners = Partners::new(stages, *grain, blocks.len(), |index| &blocks[index]);
        }
    }

    /// Whether blocks are formed anew before a frame.
    pub(super) fn regroups_before(&self, frame: u64) -> bool {
        regroups_before(self.grain, frame)
    }

    /// Forms the blocks anew: those that are close come one after the other, or those that take longest come first,
    /// which is best where threads take them up one by one in their order.
    pub(super) fn regroup(&mut self, longest_first: bool) {
        if longest_first {
            self.blocking.deal(&mut self.blocks, 1, 0.0);
        } else {
            self.blocking.split(&mut self.blocks);
        }
    }
}

/// Changes what all stages share, and says whether other groups have rules with each other then.
pub(super) fn changes_pairs(stages: &mut Stages, change: &mut dyn FnMut(&mut Stages)) -> bool {
    let before = stages.rules.partners();
    change(stages);
    stages.rules.partners() != before
}

/// The environment before the frame `frame`; `mail` is between its objects.
pub(super) fn scene(
    objects: impl Iterator<Item = Object>,
    stages: Stages,
    frame: u64,
    mail: impl Iterator<Item = Letter>,
    outside: &Outside,
) -> Scene {
    let mut objects: Vec<Object> = objects.collect();
    objects.sort_unstable_by_key(Object::id);
    // An object's letter to nobody is not for one that is added. One from outside keeps its place, and goes to whoever
    // has the number when it is processed: it may have been posted after the object is said to be added.
    let is_for_somebody = |letter: &Letter| (letter.to.0 as usize) < objects.len();
    let mail = mail.filter(is_for_somebody).chain(outside.take_letters(frame)).collect();
    Scene { objects, stages, frame, mail, mailbox: outside.mailbox().clone() }
}

/// Whether blocks of this grain are formed anew before a frame.
pub(super) fn regroups_before(grain: Grain, frame: u64) -> bool {
    grain == Grain::Spatial && frame > 0 && frame.is_multiple_of(FRAMES_PER_BLOCKING)
}

/// Which blocks the broad phase has to look at, for each block those at or after it.
pub(super) struct Partners(Vec<Vec<u32>>);

impl Partners {
    /// All for blocks whose objects change; for single objects those there is a rule for.
    pub(super) fn new<B: Deref<Target = Block>>(
        stages: &Stages,
        grain: Grain,
        blocks: usize,
        block: impl Fn(usize) -> B,
    ) -> Self {
        let modelled = |a: &Block, b: &Block| match (grain, a.objects(), b.objects()) {
            (Grain::Pairwise, [a], [b]) => a.id() != b.id() && stages.rules.interact(a, b),
            _ => true,
        };
        let of = |first: usize| {
            let own = block(first);
            let others = (first..blocks).filter(|&other| modelled(&own, &block(other)));
            others.map(|other| other as u32).collect()
        };
        Self((0..blocks).map(of).collect())
    }

    /// Finds the partners of block `first`, itself among them, whose objects may touch its own. `block` is asked for
    /// others only where their boxes overlap.
    pub(super) fn find<B: Deref<Target = Block>>(
        &self,
        first: usize,
        stages: &Stages,
        bounds: &[Bounds],
        block: impl Fn(usize) -> B,
        found: &mut Vec<u32>,
    ) {
        found.clear();
        let (own, around) = (block(first), bounds[first]);
        let partners = self.0[first].iter().copied();
        let close = partners.filter(|&other| around.overlaps(&bounds[other as usize]));
        found.extend(close.filter(|&other| match other as usize {
            other if other == first => stages.interacts_within(&own),
            other => stages.broad_phase(&own, &block(other)),
        }));
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

/// The results of one candidate.
#[derive(Default)]
pub(super) struct Outcome {
    contacts: ContactBuffer,
    pub(super) pairs: PairCount,
}

impl Outcome {
    /// Interacts two blocks, or one with itself if there is no second.
    pub(super) fn compute(
        &mut self,
        stages: &Stages,
        first: &Block,
        second: Option<&Block>,
        scratch: &mut Scratch,
    ) {
        self.contacts.clear();
        self.pairs = match second {
            Some(second) => stages.interact(first, second, scratch, &mut self.contacts),
            None => stages.interact_within(first, scratch, &mut self.contacts),
        };
    }

    pub(super) fn records(&self) -> &[ContactRecord] {
        self.contacts.records()
    }
}

/// Outcomes to begin with, for so many blocks, with room for what candidates usually give.
pub(super) fn first_outcomes(blocks: usize, grain: Grain) -> Vec<Outcome> {
    let records = match grain {
        Grain::Spatial => RECORDS_PER_CANDIDATE,
        Grain::Pairwise => RECORDS_PER_PAIR,
    };
    let outcome = |_| Outcome {
        contacts: ContactBuffer::with_capacity(records),
        pairs: PairCount::default(),
    };
    (0..CANDIDATES_PER_BLOCK * blocks).map(outcome).collect()
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
