//! The stages as the core's callbacks.

use std::cell::RefCell;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Instant;

use dualframe_core::contacts::Contacts;
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::Frame;
use dualframe_core::inputs::Inputs;
use dualframe_core::unit::UnitId;

use crate::block::Block;
use crate::executor::FrameRecord;
use crate::interaction::{self, Contact, ContactSink, Scratch};
use crate::message::Message;
use crate::object::ObjectId;
use crate::render::Renderer;
use crate::stages::{PairCount, Stages};

/// What the workers of a run share.
pub(super) struct Shared<'s> {
    pub(super) stages: &'s Stages,
    /// The number of the pipeline's frame 0.
    pub(super) first_frame: u64,
    /// The unit that each object is in. Changed only between runs.
    unit_of: Vec<AtomicU32>,
    /// What was counted in each frame that may be under way: an interaction of frame f + 2 may
    /// run before frame f is swapped, one of frame f + 3 not.
    counts: [[AtomicU64; 2]; 4],
}

impl<'s> Shared<'s> {
    pub(super) fn new(stages: &'s Stages, first_frame: u64, objects: usize) -> Self {
        let unit_of = (0..objects).map(|_| AtomicU32::new(0)).collect();
        Self { stages, first_frame, unit_of, counts: Default::default() }
    }

    /// Notes that the objects of `block` are in unit `unit`.
    pub(super) fn locate(&self, unit: usize, block: &Block) {
        for object in block.objects() {
            if let Some(place) = self.unit_of.get(object.id().0 as usize) {
                // Relaxed, as is the load: the pipeline's lock separates runs from changes.
                place.store(unit as u32, Ordering::Relaxed);
            }
        }
    }

    /// The unit that `object` is in, if there is such an object.
    pub(super) fn unit_of(&self, object: ObjectId) -> Option<UnitId> {
        let place = self.unit_of.get(object.0 as usize)?;
        Some(UnitId(place.load(Ordering::Relaxed)))
    }

    fn number(&self, frame: Frame) -> u64 {
        self.first_frame + u64::from(frame.0)
    }

    fn count(&self, frame: Frame, count: PairCount) {
        let [candidates, collisions] = &self.counts[frame.0 as usize % 4];
        // Relaxed: sums, read at the frame's swap, which follows all its interactions.
        candidates.fetch_add(count.candidates, Ordering::Relaxed);
        collisions.fetch_add(count.collisions, Ordering::Relaxed);
    }

    fn take_counts(&self, frame: Frame) -> PairCount {
        let [candidates, collisions] = &self.counts[frame.0 as usize % 4];
        PairCount {
            candidates: candidates.swap(0, Ordering::Relaxed),
            collisions: collisions.swap(0, Ordering::Relaxed),
        }
    }
}

/// A message to one of the objects of a block.
pub(super) struct Parcel {
    pub(super) to: ObjectId,
    pub(super) message: Message,
}

/// One worker's view of the environment.
pub(super) struct Host<'s> {
    shared: &'s Shared<'s>,
    scratch: RefCell<Scratch>,
    letters: RefCell<Vec<(ObjectId, Parcel)>>,
}

impl<'s> Host<'s> {
    pub(super) fn new(shared: &'s Shared<'s>) -> Self {
        let (scratch, letters) = (RefCell::default(), RefCell::default());
        Self { shared, scratch, letters }
    }
}

/// What the render token owns.
pub(super) struct Screen<'s> {
    pub(super) renderer: &'s mut dyn Renderer,
    pub(super) on_frame: &'s mut dyn FnMut(&FrameRecord),
}

/// Puts results into the pipeline's pools.
struct Sink<'a, 'c, 'm>(&'a mut Contacts<'c, 'm, Contact>);

impl ContactSink for Sink<'_, '_, '_> {
    fn push(&mut self, segment: &[Contact]) -> Result<(), interaction::TableFull> {
        let full = |TableFull { capacity, needed, .. }| interaction::TableFull { capacity, needed };
        self.0.push(segment).map_err(full)
    }
}

impl<'s> Environment for Host<'s> {
    type Object = Block;
    type Interaction = ();
    type Contact = Contact;
    type Message = Parcel;
    type Renderer = Screen<'s>;
    type Error = TableFull;

    fn broad_phase(&self, a: &Block, b: &Block) -> bool {
        self.shared.stages.broad_phase(a, b)
    }

    fn interacts_within(&self, block: &Block) -> bool {
        self.shared.stages.interacts_within(block)
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Block,
        b: &Block,
        (): &mut (),
        contacts: &mut Contacts<'_, '_, Contact>,
    ) -> Result<(), TableFull> {
        let (stages, scratch) = (self.shared.stages, &mut *self.scratch.borrow_mut());
        let sink = &mut Sink(contacts);
        let counted = if pair.ends[0] == pair.ends[1] {
            stages.interact_within(a, scratch, sink)
        } else {
            stages.interact(a, b, scratch, sink)
        };
        let count = counted.map_err(|interaction::TableFull { capacity, needed }| TableFull {
            table: dualframe_core::error::Table::Contacts,
            capacity,
            needed,
        })?;
        self.shared.count(pair.frame, count);
        Ok(())
    }

    fn update(
        &self,
        _: UnitId,
        frame: Frame,
        block: &mut Block,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        let shared = self.shared;
        let letters = &mut *self.letters.borrow_mut();
        letters.clear();
        while let Some((from, parcel)) = inputs.next_letter() {
            letters.push((ObjectId(from.sender), parcel));
        }
        let mail = letters.iter().map(|(from, parcel)| (parcel.to, *from, &parcel.message));
        let segments = inputs.interactions().flat_map(|interaction| interaction.contacts);
        segments.for_each(|segment| block.receive(segment));
        let mut outcome = Ok(());
        let mut post = |from: ObjectId, to: ObjectId, message| {
            // A letter to nobody is lost, as `Input::post` says.
            let Some(unit) = shared.unit_of(to) else { return };
            if let Err(rejected) = inputs.post(unit, from.0, Parcel { to, message }) {
                outcome = Err(rejected.full);
            }
        };
        shared.stages.update(shared.number(frame), block, mail, &mut post);
        outcome
    }

    fn render(
        &self,
        _: UnitId,
        _: Frame,
        block: &Block,
        screen: &mut Screen<'s>,
    ) -> Result<(), TableFull> {
        self.shared.stages.render(block, screen.renderer);
        Ok(())
    }

    fn swap(&self, frame: Frame, screen: &mut Screen<'s>) -> Result<(), TableFull> {
        let number = self.shared.number(frame);
        screen.renderer.swap(number);
        let pairs = self.shared.take_counts(frame);
        (screen.on_frame)(&FrameRecord { frame: number, swapped: Instant::now(), pairs });
        Ok(())
    }
}
