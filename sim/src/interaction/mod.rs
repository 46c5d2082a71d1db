//! Interactions (§4.1, Fig. 3): what objects do to each other.
//!
//! An interaction only reads its two objects. What it finds goes to a [`ContactBuffer`], and the
//! objects' next updates add it up (§5.6).

mod attachment;
mod bone_nodes;
mod burr;
mod compliant;
mod contact;
mod error;
mod impulses;
mod nodes;
mod penalty;
mod piece;
mod rules;
mod shape;
mod touches;

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::geometry::LANES;
use crate::object::Object;
use crate::stages::Stages;

pub use attachment::{Attached, Link};
pub use bone_nodes::NodesInBone;
pub use burr::{BurrForce, BurrInBone};
pub use compliant::Compliant;
pub use contact::{Contact, ContactBuffer, ContactRecord, Segment};
pub use error::ResponseError;
pub use impulses::Impulses;
pub use nodes::NodeSpheres;
pub use penalty::Penalty;
pub use piece::{PieceInBone, PieceOnBone};
pub(crate) use rules::group_set;
pub use rules::{InteractionPair, RuleError, Rules};
pub use shape::NodesInShape;
pub use touches::{Touch, Touches};

/// Finds where two objects touch. How it may be helped by other threads says [`Behavior`](crate::behavior::Behavior).
pub trait Detection: Send + Sync {
    /// Adds the places where the objects touch. What it finds may depend on the two objects only. It is asked
    /// about those whose [extents overlap](crate::geometry::Extent::overlaps).
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches);
}

/// Says what touching does to two objects. How it may be helped by other threads says
/// [`Behavior`](crate::behavior::Behavior).
pub trait Response: Send + Sync {
    /// Adds the impulses of one frame of `time_step` seconds on the one and on the other object. It
    /// is called only for objects that touch.
    fn respond(
        &self,
        bodies: [&Object; 2],
        touches: &Touches,
        time_step: f32,
        impulses: [&mut Impulses; 2],
    );
}

/// Nodes of one object for which there is room from the start; usually 256, so that a worker's first
/// interaction need not allocate.
const NODES: usize = 256;

/// Pairs of objects whose extents overlap, of two blocks or within one, for which there is room from the start,
/// likewise; usually 8,192, some twenty for each of four hundred objects.
const PAIRS: usize = 8_192;

/// Memory that the interactions of one worker use one after the other.
#[derive(Debug)]
pub struct Scratch {
    /// The places of objects whose extents overlap, while two blocks interact.
    pub(crate) pairs: Vec<[usize; 2]>,
    pub(crate) pair: PairScratch,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { pairs: Vec::with_capacity(PAIRS), pair: PairScratch::default() }
    }
}

impl Scratch {
    /// Memory that grows as it is used.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

/// An object of a block, and its place there.
#[derive(Clone, Copy)]
pub(crate) struct Member<'o> {
    pub(crate) object: &'o Object,
    pub(crate) place: usize,
}

/// What the interaction of one pair works in.
#[derive(Debug)]
pub(crate) struct PairScratch {
    touches: Touches,
    impulses: [Impulses; 2],
}

impl Default for PairScratch {
    fn default() -> Self {
        let mut scratch = Self { touches: Touches::default(), impulses: Default::default() };
        scratch.impulses.iter_mut().for_each(|impulses| impulses.reset(NODES));
        scratch.touches.near.iter_mut().for_each(|near| near.reserve(NODES / LANES));
        scratch
    }
}

impl PairScratch {
    /// Lets two objects interact and stores the results; says whether they touched.
    pub(crate) fn interact(
        &mut self,
        pair: &InteractionPair,
        [first, second]: [Member<'_>; 2],
        stages: &Stages,
        results: &mut ContactBuffer,
    ) -> bool {
        self.touches.clear();
        self.touches.simd = stages.simd;
        let bodies = [first.object, second.object];
        for (impulses, body) in self.impulses.iter_mut().zip(bodies) {
            impulses.reset(body.geometry.as_mesh().map_or(0, |mesh| mesh.positions.len()));
        }
        let done = catch_unwind(AssertUnwindSafe(|| {
            pair.detection.detect(bodies[0], bodies[1], &mut self.touches);
            if !self.touches.list().is_empty() {
                let [on_first, on_second] = &mut self.impulses;
                pair.response.respond(
                    bodies,
                    &self.touches,
                    stages.time_step,
                    [on_first, on_second],
                );
            }
        }));
        if done.is_err() {
            for ends in [[first, second], [second, first]] {
                let head = ContactRecord::head(1, ends);
                let fault = ContactRecord::contact(Contact::FAULT, [0.0; 3]);
                results.push(Segment::new(&[head, fault]));
            }
            return false;
        }
        for (impulses, ends) in self.impulses.iter_mut().zip([[first, second], [second, first]]) {
            // Nobody would read what scenery is told.
            if !ends[0].object.is_fixed()
                && let Some(segment) = impulses.segment(ends)
            {
                results.push(segment);
            }
        }
        !self.touches.list().is_empty()
    }
}
