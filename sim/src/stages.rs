//! The four stages of a frame, as every executor calls them.
//!
//! Results depend on the objects only: pairs are tested in an order of their own two objects, and an
//! update adds up what it is given in the order of the other objects' numbers. So blocking, threads
//! and order of calls never show in them.

use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use glam::Vec3;

use crate::behavior::{Input, SpringWork, Workspace, batch};
use crate::block::Block;
use crate::cost::is_timed;
use crate::interaction::{ContactBuffer, ContactRecord, PairScratch, Rules, Scratch, Segment};
use crate::message::Message;
use crate::object::{Fault, FaultKind, Object, ObjectId};
use crate::render::Renderer;
use crate::simd::{Simd, prefetch};

/// What the interaction stage counted. Independent of blocking and executor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairCount {
    /// Pairs of objects with a rule whose boxes and spheres overlap.
    pub candidates: u64,
    /// Those of them whose detection found something: touches, or links that are not at rest.
    pub collisions: u64,
}

impl std::ops::AddAssign for PairCount {
    fn add_assign(&mut self, other: Self) {
        self.candidates += other.candidates;
        self.collisions += other.collisions;
    }
}

/// What holds for a whole environment: the modelled interactions and the numbers all stages share.
pub struct Stages {
    /// The modelled interactions.
    pub rules: Rules,
    /// The time from one frame to the next, in seconds; greater than 0 and finite. With others most behaviours come to
    /// states that are not finite, and their objects are quarantined.
    pub time_step: f32,
    /// The acceleration of gravity, in metres per second squared.
    pub gravity: Vec3,
    /// How long one object's update may take before the object is quarantined, if there is a limit.
    /// It is a limit on time as measured, so what it does is not repeatable. To be measured, bodies are
    /// then updated one by one, which takes longer than together.
    pub callback_budget: Option<Duration>,
    /// The vector instructions by which kernels run; usually the widest. Results are the same.
    pub simd: Simd,
}

impl Stages {
    /// Whether objects of two blocks may touch.
    #[must_use]
    #[inline]
    pub fn broad_phase(&self, a: &Block, b: &Block) -> bool {
        a.bounds().overlaps(&b.bounds()) && self.objects_reach(a, b)
    }

    /// Whether objects of two blocks that overlap may touch.
    // Else the test before it, which mostly is all, would not be inlined either.
    #[inline(never)]
    fn objects_reach(&self, a: &Block, b: &Block) -> bool {
        if !self.rules.apply(a.groups(), b.groups()) {
            return false;
        }
        // The box around walls says nothing, but each of them has one; and so has each object that is to
        // reach them.
        a.reaches(self.simd, b.extent()) && b.reaches(self.simd, a.extent())
    }

    /// Whether objects within one block may touch each other.
    #[must_use]
    pub fn interacts_within(&self, block: &Block) -> bool {
        block.objects.len() > 1 && self.rules.apply(block.groups(), block.groups())
    }

    /// Lets the objects of one block interact with those of another, and adds what that does to them to `results`.
    pub fn interact(
        &self,
        a: &Block,
        b: &Block,
        scratch: &mut Scratch,
        results: &mut ContactBuffer,
    ) -> PairCount {
        let (few, many) = if a.objects.len() < b.objects.len() { (a, b) } else { (b, a) };
        let Scratch { pairs, pair } = scratch;
        pairs.clear();
        few.overlaps(self.simd, many, pairs);
        self.interact_pairs([few, many], pairs, pair, results)
    }

    /// Lets the objects within one block interact with each other, likewise.
    pub fn interact_within(
        &self,
        block: &Block,
        scratch: &mut Scratch,
        results: &mut ContactBuffer,
    ) -> PairCount {
        let Scratch { pairs, pair } = scratch;
        pairs.clear();
        block.overlaps_within(self.simd, pairs);
        self.interact_pairs([block; 2], pairs, pair, results)
    }

    /// Lets pairs of objects interact, given by their places in these blocks.
    fn interact_pairs(
        &self,
        [first, second]: [&Block; 2],
        pairs: &[[usize; 2]],
        scratch: &mut PairScratch,
        results: &mut ContactBuffer,
    ) -> PairCount {
        let mut count = PairCount::default();
        let members = |&[one, other]: &[usize; 2]| [first.member(one), second.member(other)];
        for (index, pair) in pairs.iter().enumerate() {
            // Of another block's objects the nodes are in no near cache; nor, with many objects, of any block's.
            let later = |ahead: usize| pairs.get(index + ahead).map(members).into_iter().flatten();
            later(2).for_each(|member| prefetch(member.object));
            for mesh in later(1).filter_map(|member| member.object.geometry.as_mesh()) {
                let [positions, _] = mesh.lines();
                prefetch(positions);
            }
            let [a, b] = members(pair);
            if let Some((pair, bodies)) = self.rules.find(a, b) {
                let touched = scratch.interact(pair, bodies, self, results);
                count += PairCount { candidates: 1, collisions: u64::from(touched) };
            }
        }
        count
    }

    /// Updates the objects of a block.
    ///
    /// `results` are the records of all interactions that the block, as it is, had in this frame, in any
    /// order; what they say of other blocks is ignored. `mail` gives the messages to an object in the order
    /// in which they are to be processed: by sender, then by order of posting. `post` is given (from, to,
    /// message) for each message that an object sends.
    ///
    /// An object whose callback panics, whose state is not finite afterwards, or that is over budget
    /// is quarantined.
    pub fn update<'m, 'r, M: Iterator<Item = &'m Message>>(
        &self,
        frame: u64,
        block: &mut Block,
        results: impl Iterator<Item = &'r [ContactRecord]>,
        workspace: &mut Workspace,
        mail: impl Fn(ObjectId) -> M,
        post: &mut dyn FnMut(ObjectId, ObjectId, Message),
    ) {
        let began = is_timed(frame).then(Instant::now);
        let Workspace { received: memory, springs, order } = workspace;
        let mut received = mem::take(memory);
        received.extend(block, results);
        block.prefetch_first(self.simd);
        // Interactions found the objects where they were before.
        block.put_in_order(order);
        for place in 0..block.objects.len() {
            block.prefetch_after(place, self.simd);
            let object = &mut block.objects[place];
            let received = received.at(order.get(place).map_or(place, |seat| seat.before));
            if object.quarantined().is_some() {
                continue;
            }
            if received.iter().any(|segment| segment.is_fault()) {
                object.quarantine(Fault { kind: FaultKind::Panicked, frame });
                continue;
            }
            let own_mail = mail(object.id());
            let given = Given { frame, place, received, springs: &mut *springs };
            self.update_object(object, given, own_mail, post);
        }
        batch::advance(&mut block.objects, springs, frame, self.simd);
        *memory = received.emptied();
        block.refresh();
        if let Some(began) = began {
            block.add_timing(frame, began.elapsed());
        }
    }

    fn update_object<'m>(
        &self,
        object: &mut Object,
        given: Given<'_>,
        mail: impl Iterator<Item = &'m Message>,
        post: &mut dyn FnMut(ObjectId, ObjectId, Message),
    ) {
        let Given { frame, place, .. } = given;
        let began = self.callback_budget.map(|budget| (Instant::now(), budget));
        let mut input = Input {
            frame,
            time_step: self.time_step,
            gravity: self.gravity,
            simd: self.simd,
            object: object.id(),
            received: given.received,
            springs: given.springs,
            post,
        };
        let mut waits = false;
        // Scenery that is told nothing is as it was, and need not be measured.
        let mut changed = !object.is_fixed();
        let done = catch_unwind(AssertUnwindSafe(|| {
            for message in mail {
                changed = true;
                // What has been taken out stays out.
                if object.quarantined().is_none() {
                    object.process(message, frame);
                }
            }
            if object.quarantined().is_none() && !object.is_fixed() {
                // Together no object has a time of its own to measure.
                waits = self.callback_budget.is_none() && batch::begin(object, place, &mut input);
                if !waits {
                    object.behavior.update(&mut object.geometry, &mut input);
                }
            }
            if waits {
                // Its springs are advanced with those of others, and its extent with them.
            } else if began.is_some_and(|(began, budget)| began.elapsed() > budget) {
                object.quarantine(Fault { kind: FaultKind::OverBudget, frame });
            } else if object.quarantined().is_none() && (changed || !object.is_finite()) {
                // Its shape may be the host's, too.
                object.refresh(frame, self.simd);
            }
        }));
        if done.is_err() {
            object.quarantine(Fault { kind: FaultKind::Panicked, frame });
        }
    }

    /// Draws the objects of a block.
    pub fn render(&self, block: &Block, renderer: &mut dyn Renderer) {
        for (place, object) in block.objects.iter().enumerate() {
            block.prefetch_drawn_after(place);
            draw(object, renderer);
        }
    }
}

/// Draws an object, unless it is hidden or quarantined.
pub fn draw(object: &Object, renderer: &mut dyn Renderer) {
    if object.is_drawn() {
        renderer.draw(object);
    }
}

/// What an object's update is given by its block.
struct Given<'a> {
    frame: u64,
    /// The object's place in the block.
    place: usize,
    received: &'a [Segment<'a>],
    springs: &'a mut SpringWork,
}
