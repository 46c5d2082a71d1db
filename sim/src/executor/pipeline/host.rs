//! The stages as the core's callbacks.

use std::cell::RefCell;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use dualframe_core::contacts::Contacts;
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::TableFull;
use dualframe_core::frame::Frame;
use dualframe_core::inbox;
use dualframe_core::inputs::Inputs;
use dualframe_core::unit::UnitId;

use super::overflow::Overflow;
use crate::behavior::{Room, Workspace};
use crate::block::Block;
use crate::cost::{TimedCost, is_timed};
use crate::executor::outside::Outside;
use crate::executor::{FrameRecord, OnFrame};
use crate::interaction::{ContactBuffer, ContactRecord, Scratch};
use crate::message::Message;
use crate::object::ObjectId;
use crate::render::Renderer;
use crate::stages::{PairCount, Stages};

/// Which unit each object is in, by the objects' numbers. Changed only between runs.
pub(super) struct Register(Vec<AtomicU32>);

impl Register {
    /// The objects of these blocks in the units of the same numbers.
    pub(super) fn new(blocks: &[Block]) -> Self {
        let objects = blocks.iter().flat_map(Block::objects);
        let register = Self(objects.map(|_| AtomicU32::new(0)).collect());
        blocks.iter().enumerate().for_each(|(unit, block)| register.locate(unit, block));
        register
    }

    /// Notes that the objects of `block` are in unit `unit`.
    pub(super) fn locate(&self, unit: usize, block: &Block) {
        for id in block.ids() {
            if let Some(place) = self.0.get(id.0 as usize) {
                // Relaxed, as is the load: the pipeline's lock separates runs from changes.
                place.store(unit as u32, Ordering::Relaxed);
            }
        }
    }

    /// The unit that `object` is in, if there is such an object.
    pub(super) fn unit_of(&self, object: ObjectId) -> Option<UnitId> {
        let place = self.0.get(object.0 as usize)?;
        Some(UnitId(place.load(Ordering::Relaxed)))
    }
}

/// What the workers of a run share.
#[derive(Clone, Copy)]
pub(super) struct Shared<'s> {
    pub(super) stages: &'s Stages,
    pub(super) outside: &'s Outside,
    pub(super) register: &'s Register,
    pub(super) overflow: &'s Overflow,
    /// The number of the pipeline's frame 0.
    pub(super) first_frame: u64,
    /// What each worker makes room for.
    pub(super) room: Room,
}

impl Shared<'_> {
    fn number(&self, frame: Frame) -> u64 {
        self.first_frame + u64::from(frame.0)
    }
}

/// What travels through the pipeline.
pub(super) struct Unit {
    pub(super) block: Block,
    /// What the interactions with units of a greater number, and within this one, counted in the
    /// frame last updated; so that every pair is counted once.
    pairs: PairCount,
}

impl From<Block> for Unit {
    fn from(block: Block) -> Self {
        Self { block, pairs: PairCount::default() }
    }
}

/// What the interaction of two units leaves to their updates, besides contacts.
#[derive(Default)]
pub(super) struct Found {
    candidates: u32,
    collisions: u32,
    /// All records, if the pipeline's table had no room for them.
    late: Option<Box<ContactBuffer>>,
}

impl Found {
    fn new(count: PairCount) -> Self {
        // As many as a block has objects, squared.
        let PairCount { candidates, collisions } = count;
        Self { candidates: candidates as u32, collisions: collisions as u32, late: None }
    }

    fn count(&self) -> PairCount {
        let [candidates, collisions] = [self.candidates, self.collisions].map(u64::from);
        PairCount { candidates, collisions }
    }
}

/// A message to one of the objects of a block.
pub(super) struct Parcel {
    pub(super) to: ObjectId,
    pub(super) message: Message,
}

/// What a worker works in, kept from run to run: its memory is there and warm.
pub(super) struct Own {
    scratch: RefCell<Scratch>,
    workspace: RefCell<Workspace>,
    results: RefCell<ContactBuffer>,
    letters: RefCell<Vec<(inbox::From, Parcel)>>,
}

impl Own {
    fn with_room(room: Room) -> Self {
        Self {
            scratch: RefCell::default(),
            workspace: RefCell::new(Workspace::with_room(room)),
            results: RefCell::new(ContactBuffer::with_capacity(room.contacts())),
            letters: RefCell::default(),
        }
    }
}

/// One worker's view of the environment.
pub(super) struct Host<'s> {
    shared: &'s Shared<'s>,
    own: Own,
}

impl<'s> Host<'s> {
    /// That of a worker who was here before, or of a new one.
    pub(super) fn new(shared: &'s Shared<'s>, own: Option<Own>) -> Self {
        Self { shared, own: own.unwrap_or_else(|| Own::with_room(shared.room)) }
    }

    pub(super) fn into_own(self) -> Own {
        self.own
    }
}

/// What a thread needs to render.
pub(super) struct Screen<'s> {
    pub(super) renderer: &'s mut dyn Renderer,
    pub(super) on_frame: &'s mut OnFrame<'s>,
    /// What was counted in the frame being rendered.
    pub(super) pairs: PairCount,
    /// What rendering took of that frame so far, if it is timed.
    pub(super) took: Duration,
    /// What it takes in a frame, if it stays with one thread.
    pub(super) rendering: &'s mut TimedCost,
    /// Counts the frames that are done.
    pub(super) frame: &'s mut u64,
}

impl Screen<'_> {
    /// Lets the renderer work for a frame.
    #[inline]
    fn show(&mut self, frame: u64, work: impl FnOnce(&mut dyn Renderer)) {
        let began = (is_timed(frame) && self.renderer.is_bound()).then(Instant::now);
        work(self.renderer);
        self.took += began.map_or(Duration::ZERO, |began| began.elapsed());
    }

    /// Notes what a frame's rendering took, once it is swapped.
    fn note(&mut self, frame: u64) {
        if is_timed(frame) && self.renderer.is_bound() {
            self.rendering.add(frame, std::mem::take(&mut self.took));
        }
    }
}

impl<'s> Environment for Host<'s> {
    type Object = Unit;
    type Interaction = Found;
    type Contact = ContactRecord;
    type Message = Parcel;
    type Renderer = Screen<'s>;
    type Error = TableFull;

    #[inline]
    fn broad_phase(&self, a: &Unit, b: &Unit) -> bool {
        self.shared.stages.broad_phase(&a.block, &b.block)
    }

    fn interacts_within(&self, unit: &Unit) -> bool {
        self.shared.stages.interacts_within(&unit.block)
    }

    fn interact(
        &self,
        pair: Pair,
        a: &Unit,
        b: &Unit,
        found: &mut Found,
        contacts: &mut Contacts<'_, '_, ContactRecord>,
    ) -> Result<(), TableFull> {
        let (stages, scratch) = (self.shared.stages, &mut *self.own.scratch.borrow_mut());
        let results = &mut *self.own.results.borrow_mut();
        results.clear();
        let counted = if pair.ends[0] == pair.ends[1] {
            stages.interact_within(&a.block, scratch, results)
        } else {
            stages.interact(&a.block, &b.block, scratch, results)
        };
        *found = Found::new(counted);
        if contacts.push(results.records()).is_err() {
            found.late = Some(Box::new(results.clone()));
        }
        Ok(())
    }

    fn update(
        &self,
        id: UnitId,
        frame: Frame,
        unit: &mut Unit,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), TableFull> {
        let shared = self.shared;
        let letters = &mut *self.own.letters.borrow_mut();
        letters.clear();
        letters.extend(std::iter::from_fn(|| inputs.next_letter()));
        let number = shared.number(frame);
        shared.overflow.deliver(id, number, |letter| letters.push(letter));
        // Each object's are found at once, however many the block has.
        letters.sort_unstable_by_key(|(from, parcel)| (parcel.to, *from));
        let from_outside = shared.outside.due(number);
        let mail = |object| {
            let first = letters.partition_point(|(_, parcel)| parcel.to < object);
            let own = letters[first..].iter().take_while(move |(_, parcel)| parcel.to == object);
            own.map(|(_, parcel)| &parcel.message).chain(from_outside.to(object))
        };
        let workspace = &mut *self.own.workspace.borrow_mut();
        let Unit { block, pairs } = unit;
        *pairs = PairCount::default();
        // The block brings them into its objects' order itself.
        let results = inputs.interactions_in_any_order().flat_map(|interaction| {
            if interaction.other >= id {
                *pairs += interaction.state.count();
            }
            let late = interaction.state.late.as_deref().map(ContactBuffer::records);
            interaction.contacts.chain(late)
        });
        let mut post = |from: ObjectId, to: ObjectId, message| {
            // A letter to nobody is lost, as `Input::post` says.
            let Some(unit) = shared.register.unit_of(to) else { return };
            if let Err(rejected) = inputs.post(unit, from.0, Parcel { to, message }) {
                shared.overflow.keep(number + 1, unit, rejected.from, rejected.message);
            }
        };
        shared.stages.update(number, block, results, workspace, mail, &mut post);
        Ok(())
    }

    fn render(
        &self,
        _: UnitId,
        frame: Frame,
        unit: &Unit,
        screen: &mut Screen<'s>,
    ) -> Result<(), TableFull> {
        screen.pairs += unit.pairs;
        let draw = |renderer: &mut dyn Renderer| self.shared.stages.render(&unit.block, renderer);
        screen.show(self.shared.number(frame), draw);
        Ok(())
    }

    fn swap(&self, frame: Frame, screen: &mut Screen<'s>) -> Result<(), TableFull> {
        let number = self.shared.number(frame);
        screen.show(number, |renderer| renderer.swap(number));
        screen.note(number);
        let pairs = std::mem::take(&mut screen.pairs);
        (screen.on_frame)(&FrameRecord { frame: number, swapped: Instant::now(), pairs });
        self.shared.outside.swapped(number);
        *screen.frame = number + 1;
        Ok(())
    }
}
