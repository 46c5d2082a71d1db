//! The four stages wired (Fig. 6): what each work unit does, and what it sets free.
//!
//! One rule throughout: the last arriver at a countdown carries on. `PROTOCOL.md` states who may
//! write what when, and why.

use crate::arrivals::Arrivals;
use crate::contacts::Contacts;
use crate::environment::{Environment, Pair};
use crate::error::{SetupError, StillRunning, Table, TableFull};
use crate::frame::{Entry, Frame, Window};
use crate::inbox::{From, Rejected};
use crate::inputs::Inputs;
use crate::probe::NoProbe;
use crate::stage::{Stage, Stages};
use crate::storage::{Chain, Memory};
use crate::sync::site;
use crate::tables::Tables;
use crate::token::{Token, TokenOffice};
use crate::unit::{InteractionId, NONE, UnitId, Work};
use crate::wait::{Bells, Spin, Waiting};
use crate::worker::{Outputs, Worker};

/// Which pairs the broad phase tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BroadPhase {
    /// Every two units: whoever enters the frame is tested against those that entered before.
    /// Right where anything may meet anything.
    #[default]
    Spatial,
    /// The modelled interactions, each tested by its second arriver (the paper's way). Right for
    /// few, known pairs.
    Pairwise,
}

/// How a pipeline runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Which pairs are tested.
    pub broad_phase: BroadPhase,
    /// How far consecutive frames overlap.
    pub entry: Entry,
    /// How many workers may render at once.
    pub tokens: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self { broad_phase: BroadPhase::default(), entry: Entry::default(), tokens: 1 }
    }
}

/// The pipeline: shared by all workers, owned by none.
pub struct Pipeline<'m, E: Environment, W: Waiting = Spin> {
    pub(crate) tables: Tables<'m, E>,
    pub(crate) window: Window,
    pub(crate) bells: Bells,
    pub(crate) waiting: W,
    arrivals: Arrivals,
    pub(crate) office: TokenOffice,
    config: Config,
}

impl<'m, E: Environment, W: Waiting> Pipeline<'m, E, W> {
    /// A pipeline over `memory`, at rest before its first frame.
    ///
    /// # Errors
    /// [`SetupError`] names the table that does not fit, or the interaction that joins nothing.
    pub fn new(memory: Memory<'m, E>, config: Config, waiting: W) -> Result<Self, SetupError> {
        let tables = Tables::new(memory, config.broad_phase == BroadPhase::Pairwise)?;
        Ok(Self {
            window: Window::new(tables.units.len() as u32),
            bells: Bells::new(),
            waiting,
            arrivals: Arrivals::new(),
            office: TokenOffice::new(config.tokens),
            config,
            tables,
        })
    }

    /// Lets `frames` more frames run.
    ///
    /// # Errors
    /// [`StillRunning`] if the frames let run before have not all been swapped.
    pub fn run(&mut self, frames: u32) -> Result<(), StillRunning> {
        if !self.finished() {
            return Err(StillRunning);
        }
        if frames > 0 {
            self.window.limit = Frame(self.window.limit.0.wrapping_add(frames));
            let units = 0..self.tables.units.len() as u32;
            units.for_each(|unit| self.tables.queues.enter.push(unit));
        }
        Ok(())
    }

    /// A worker. Any number may join and leave at any time.
    pub fn worker(&self) -> Worker<'_, 'm, E, W, NoProbe> {
        Worker::new(self, NoProbe)
    }

    /// A render token for `renderer`.
    ///
    /// # Errors
    /// The renderer back, and the number of tokens there are, if all are out.
    pub fn token(
        &self,
        renderer: E::Renderer,
    ) -> Result<Token<'_, E::Renderer>, (E::Renderer, TableFull)> {
        let capacity = self.config.tokens as usize;
        let full = TableFull { table: Table::Tokens, capacity, needed: capacity + 1 };
        self.office.issue(renderer).map_err(|renderer| (renderer, full))
    }

    /// Whether every frame that was let run has been swapped.
    pub fn finished(&self) -> bool {
        self.window.display() == self.window.limit
    }

    /// The first frame that has not been swapped.
    pub fn frame(&self) -> Frame {
        self.window.display()
    }

    /// Posts a letter from outside the callbacks: a device, an interrupt handler, a user
    /// interface. It is processed by `to`'s first update in a later frame than the one now open.
    ///
    /// # Errors
    /// [`Rejected`] with the message if all letters are under way.
    ///
    /// # Panics
    /// If there is no unit `to`.
    pub fn post(
        &self,
        to: UnitId,
        from: From,
        message: E::Message,
    ) -> Result<(), Rejected<E::Message>> {
        let stamp = self.window.open();
        self.tables.post.post(&self.tables.unit(to).inbox, stamp, from, message)
    }

    /// Takes every letter that waits in an inbox, in order for each unit: to post them anew where
    /// the objects have moved to other units, say.
    pub fn take_letters(&mut self, mut take: impl FnMut(UnitId, From, E::Message)) {
        let never = self.window.open().next();
        for (index, unit) in self.tables.units.iter().enumerate() {
            for (from, message) in self.tables.post.collect(&unit.inbox, never) {
                take(UnitId(index as u32), from, message);
            }
        }
    }

    /// Every unit's object, by exclusive access to the pipeline.
    pub fn objects_mut(&mut self) -> impl Iterator<Item = &mut E::Object> {
        // SAFETY: `&mut self` means that no worker exists, so nobody else has any object; each
        // cell is lent once.
        self.tables.units.iter().map(|unit| unsafe {
            unit.object.with_mut(|object| &mut *::core::ptr::from_mut(object))
        })
    }

    /// The largest number of candidates and of contacts that one of the last two frames used.
    pub fn high_water(&mut self) -> (usize, usize) {
        let both = [Frame(0), Frame(1)];
        let candidates = both.map(|frame| self.tables.candidates_used(frame));
        let contacts = both.map(|frame| self.tables.pools.used(frame));
        (candidates[0].max(candidates[1]) as usize, contacts[0].max(contacts[1]) as usize)
    }

    /// Stages in which work is queued; `Render` only for a holder.
    #[inline]
    pub(crate) fn visible(&self, holder: bool) -> Stages {
        let queues = &self.tables.queues;
        Stages::NONE
            .with_if(Stage::BroadPhase, !queues.enter.looks_empty())
            .with_if(Stage::Interaction, !queues.interact.looks_empty())
            .with_if(Stage::Update, !queues.update.looks_empty())
            .with_if(Stage::Render, holder && self.render_visible())
    }

    #[inline]
    pub(crate) fn render_visible(&self) -> bool {
        let display = self.window.display();
        !self.tables.queues.render[display.parity()].looks_empty()
    }

    /// A queued work unit of `stage`.
    #[inline]
    pub(crate) fn pop(&self, stage: Stage) -> Option<Work> {
        let queues = &self.tables.queues;
        match stage {
            Stage::BroadPhase => queues.enter.pop().map(|unit| Work::Enter(UnitId(unit))),
            Stage::Interaction => queues.interact.pop().map(|id| Work::Interact(InteractionId(id))),
            Stage::Update => queues.update.pop().map(|unit| Work::Update(UnitId(unit))),
            Stage::Render => self.pop_render(),
        }
    }

    /// A unit of the frame on display. Another holder may have swapped since `display` was read,
    /// and the queue may then hold units of a frame that may not be rendered yet: those go back.
    fn pop_render(&self) -> Option<Work> {
        let display = self.window.display();
        let queue = &self.tables.queues.render[display.parity()];
        let unit = UnitId(queue.pop()?);
        if self.rendered_frame(unit) == display {
            return Some(Work::Render(unit));
        }
        queue.push(unit.0);
        None
    }

    /// Queues `work`.
    #[inline]
    pub(crate) fn push(&self, work: Work) {
        let queues = &self.tables.queues;
        match work {
            Work::Enter(unit) => queues.enter.push(unit.0),
            Work::Interact(id) => queues.interact.push(id.0),
            Work::Update(unit) => queues.update.push(unit.0),
            Work::Render(unit) => queues.render[self.rendered_frame(unit).parity()].push(unit.0),
        }
    }

    /// The frame of the unit's next update.
    fn next_frame(&self, unit: UnitId) -> Frame {
        Frame(self.tables.unit(unit).frame.load(site::FRAME_TAG))
    }

    /// The frame that a unit waiting to be rendered was updated in.
    fn rendered_frame(&self, unit: UnitId) -> Frame {
        self.next_frame(unit).previous()
    }

    /// The frame that `work` belongs to.
    pub(crate) fn frame_of(&self, work: Work) -> Frame {
        match work {
            Work::Enter(unit) | Work::Update(unit) => self.next_frame(unit),
            Work::Render(unit) => self.rendered_frame(unit),
            Work::Interact(id) => self.next_frame(self.tables.interaction(id).ends()[0]),
        }
    }

    /// Broad phase: the unit arrives, and is tested against those that arrived before.
    pub(crate) fn enter(
        &self,
        env: &E,
        unit: UnitId,
        out: &mut impl Outputs,
    ) -> Result<(), TableFull> {
        let found = if self.tables.unit(unit).solitary {
            Ok(())
        } else {
            match self.config.broad_phase {
                BroadPhase::Spatial => self.meet_earlier(env, unit, out),
                BroadPhase::Pairwise => {
                    self.meet_modelled(env, unit, out);
                    Ok(())
                }
            }
        };
        self.leave_gate(unit, out);
        found
    }

    /// Tests `unit` against every earlier arrival. A table that is full is reported once; the
    /// frame goes on without the pairs that did not fit.
    fn meet_earlier(&self, env: &E, unit: UnitId, out: &mut impl Outputs) -> Result<(), TableFull> {
        let slot = self.tables.unit(unit);
        let mut outcome = Ok(());
        let mut earlier = self.arrivals.arrive(unit.0, &slot.arrival).map(UnitId);
        // SAFETY: a unit that has entered the frame is not updated before the gate opens, for
        // which this unit must have left it; until then it is only read.
        unsafe {
            slot.object.with(|object| {
                if env.interacts_within(object) {
                    outcome = outcome.and(self.found(unit, unit, out));
                }
                while let Some(other) = earlier {
                    let met = self.tables.unit(other);
                    if met.object.with(|object_met| env.broad_phase(object, object_met)) {
                        outcome = outcome.and(self.found(unit, other, out));
                    }
                    earlier = Arrivals::before(&met.arrival).map(UnitId);
                }
            });
        }
        outcome
    }

    /// A pair found at run time.
    fn found(&self, unit: UnitId, other: UnitId, out: &mut impl Outputs) -> Result<(), TableFull> {
        let id = self.tables.claim_candidate(self.next_frame(unit))?;
        self.tables.interaction(id).join([unit.min(other), unit.max(other)]);
        self.candidate(id, out);
        Ok(())
    }

    /// Arrives at every modelled interaction of `unit` and tests those whose other end is there.
    fn meet_modelled(&self, env: &E, unit: UnitId, out: &mut impl Outputs) {
        let mut next = self.tables.unit(unit).modelled.load(site::LIST_FOLLOW);
        while next != NONE {
            let id = InteractionId(next);
            let slot = self.tables.interaction(id);
            next = slot.next(Chain::Modelled, unit);
            if !slot.arrivals.arrive() {
                continue;
            }
            slot.arrivals.arm(2);
            let [a, b] = slot.ends().map(|end| self.tables.unit(end));
            // SAFETY: both ends have entered the frame and this one has not left the gate, so
            // neither is updated; see `meet_earlier`.
            let near = unsafe { a.object.with(|a| b.object.with(|b| env.broad_phase(a, b))) };
            if near {
                self.candidate(id, out);
            }
        }
    }

    /// Counts an interaction at both ends before anyone can end it, then lets it go.
    fn candidate(&self, id: InteractionId, out: &mut impl Outputs) {
        let [a, b] = self.tables.interaction(id).ends();
        for end in ends(a, b) {
            self.tables.push_candidate(id, end);
            self.tables.unit(end).pending.add(1);
        }
        out.emit(Work::Interact(id));
    }

    /// `unit` has entered its frame and made its tests. The last one opens the frame: whatever
    /// has no interactions left, and is rendered, can be updated.
    fn leave_gate(&self, unit: UnitId, out: &mut impl Outputs) {
        // Read before leaving: afterwards the unit may be updated by someone else.
        let frame = self.next_frame(unit);
        if !self.window.gate.arrive() {
            return;
        }
        self.arrivals.clear();
        self.tables.reset_pools(frame.next());
        self.window.opened(frame);
        (0..self.tables.units.len() as u32).for_each(|unit| self.ready(UnitId(unit), out));
    }

    /// One thing less that `unit`'s update waits for.
    #[inline]
    fn ready(&self, unit: UnitId, out: &mut impl Outputs) {
        if self.tables.unit(unit).pending.arrive() {
            out.emit(Work::Update(unit));
        }
    }

    /// Interaction: exact detection and response.
    pub(crate) fn interact(
        &self,
        env: &E,
        id: InteractionId,
        out: &mut impl Outputs,
    ) -> Result<(), E::Error> {
        let slot = self.tables.interaction(id);
        let [a, b] = slot.ends();
        let frame = self.next_frame(a);
        let pair = Pair { id, frame, ends: [a, b] };
        let mut contacts = Contacts::new(&self.tables.pools, frame);
        // SAFETY: this interaction's count at both ends keeps both from being updated; an
        // interaction is in one place at a time, so its state is this worker's alone, and its
        // readers, the ends' updates, wait for it.
        let outcome = unsafe {
            let a = &self.tables.unit(a).object;
            let b = &self.tables.unit(b).object;
            slot.state.with_mut(|state| {
                a.with(|a| b.with(|b| env.interact(pair, a, b, state, &mut contacts)))
            })
        };
        slot.contacts.store(contacts.first(), site::SLOT_FIELD);
        for end in ends(a, b) {
            self.ready(end, out);
        }
        outcome
    }

    /// Update: the unit goes to `frame`, then to rendering, then or at once to the next frame.
    pub(crate) fn update(
        &self,
        env: &E,
        unit: UnitId,
        holder: bool,
        out: &mut impl Outputs,
    ) -> Result<(), E::Error> {
        let slot = self.tables.unit(unit);
        let frame = self.next_frame(unit);
        let mut inputs = Inputs::new(&self.tables, unit, frame);
        // SAFETY: the unit's countdown has ended: every interaction and the rendering that read
        // it are done, and none starts before it enters the next frame below.
        let outcome =
            unsafe { slot.object.with_mut(|object| env.update(unit, frame, object, &mut inputs)) };
        drop(inputs);
        slot.candidates.store(NONE, site::CANDIDATE_HEAD);
        // The next update waits for its frame's opening and for this frame's rendering. Stored
        // before the unit is passed on to either.
        slot.pending.arm(2);
        slot.frame.store(frame.next().0, site::FRAME_TAG);
        if holder && self.window.display() == frame {
            out.emit(Work::Render(unit));
        } else {
            out.queue(Work::Render(unit));
        }
        if self.config.entry == Entry::AfterUpdate {
            self.advance(unit, frame, out);
        }
        outcome
    }

    /// Lets `unit`, done with `frame`, enter the next one, if there is to be one.
    fn advance(&self, unit: UnitId, frame: Frame, out: &mut impl Outputs) {
        if frame.next() == self.window.limit {
            return;
        }
        if self.tables.unit(unit).solitary {
            self.leave_gate(unit, out);
        } else {
            out.emit(Work::Enter(unit));
        }
    }

    /// Render: draws the unit; the frame's last one swaps.
    pub(crate) fn render(
        &self,
        env: &E,
        unit: UnitId,
        token: &mut Token<'_, E::Renderer>,
        out: &mut impl Outputs,
    ) -> Result<(), E::Error> {
        let frame = self.rendered_frame(unit);
        let renderer = &mut token.renderer;
        // SAFETY: the unit's next update waits for the arrival below; until then it is only read.
        let mut outcome = unsafe {
            let object = &self.tables.unit(unit).object;
            object.with(|object| env.render(unit, frame, object, renderer))
        };
        // Entering first: the unit's frame tag may change as soon as its update may start.
        if self.config.entry == Entry::AfterRender {
            self.advance(unit, frame, out);
        }
        self.ready(unit, out);
        if self.window.renders.arrive() {
            outcome = outcome.and(env.swap(frame, renderer));
            self.window.swapped(frame);
            self.after_swap(frame, out);
        }
        outcome
    }

    fn after_swap(&self, frame: Frame, out: &mut impl Outputs) {
        if frame.next() == self.window.limit {
            // Whoever sleeps shall see that the pipeline is at rest.
            out.all_done();
            return;
        }
        if self.config.entry == Entry::AfterSwap {
            (0..self.tables.units.len() as u32)
                .for_each(|unit| self.advance(UnitId(unit), frame, out));
        }
        // What waited for this swap in the other render queue is now visible to other holders.
        out.renders_visible();
    }
}

/// The distinct ends of an interaction.
fn ends(a: UnitId, b: UnitId) -> impl Iterator<Item = UnitId> {
    [Some(a), (a != b).then_some(b)].into_iter().flatten()
}
