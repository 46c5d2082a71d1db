//! What each work unit does, and what it sets free.
//!
//! One rule throughout: the last arriver at a countdown carries on. `PROTOCOL.md` states who may
//! write what when, and why.

use heapless::Vec;

use crate::carry::Carry;
use crate::contacts::Contacts;
use crate::environment::{Environment, Pair};
use crate::error::TableFull;
use crate::frame::{Entry, Frame};
use crate::inputs::Inputs;
use crate::pipeline::{BroadPhase, Pipeline};
use crate::storage::Chain;
use crate::sync::{seeded, site};
use crate::unit::{InteractionId, NONE, UnitId, Work};
use crate::wait::Waiting;

/// Pairs that are counted and given room together, so that what workers write in common is written
/// once for many. Usually 32: more than one block has neighbours.
type Batch<T> = Vec<T, 32>;

impl<E: Environment, W: Waiting> Pipeline<'_, E, W> {
    /// Broad phase: the unit arrives, and is tested against those that arrived before.
    pub(crate) fn enter(
        &self,
        env: &E,
        unit: UnitId,
        out: &mut Carry<'_, '_, E, W>,
    ) -> Result<(), TableFull> {
        let found = if self.tables.unit(unit).bypasses {
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

    /// Tests `unit` against every earlier arrival. A table that is full is reported once,
    /// with the last refusal's need; the frame goes on without the pairs that did not fit.
    fn meet_earlier(
        &self,
        env: &E,
        unit: UnitId,
        out: &mut Carry<'_, '_, E, W>,
    ) -> Result<(), TableFull> {
        let slot = self.tables.unit(unit);
        let mut outcome = Ok(());
        let mut found = Batch::new();
        let mut meet = |other, out: &mut _| {
            if found.push(other).is_err() {
                outcome = self.found(unit, &found, out).and(outcome);
                found.clear();
                let _fits = found.push(other);
            }
        };
        // SAFETY: a unit that has entered the frame is not updated before the gate opens, for
        // which this unit must have left it; until then it is only read.
        unsafe {
            slot.object.with(|object| {
                if env.interacts_within(object) {
                    meet(unit, out);
                }
                self.tables.arrivals.arrive(unit.0, self.next_frame(unit), |earlier| {
                    let earlier = UnitId(earlier);
                    let met = &self.tables.unit(earlier).object;
                    if met.with(|object_met| env.broad_phase(object, object_met)) {
                        meet(earlier, out);
                    }
                });
            });
        }
        self.found(unit, &found, out).and(outcome)
    }

    /// Pairs of `unit` found at run time.
    fn found(
        &self,
        unit: UnitId,
        others: &[UnitId],
        out: &mut Carry<'_, '_, E, W>,
    ) -> Result<(), TableFull> {
        if others.is_empty() {
            return Ok(());
        }
        let (ids, outcome) =
            self.tables.claim_candidates(others.len() as u32, self.next_frame(unit));
        let mut batch: Batch<InteractionId> = Vec::new();
        for (id, &other) in ids.zip(others) {
            self.tables.interaction(id).join([unit.min(other), unit.max(other)]);
            let _fits = batch.push(id);
        }
        self.candidates(unit, &batch, out);
        outcome
    }

    /// Arrives at every modelled interaction of `unit` and tests those whose other end is there.
    fn meet_modelled(&self, env: &E, unit: UnitId, out: &mut Carry<'_, '_, E, W>) {
        let mut next = self.tables.unit(unit).modelled.load(site::LIST_FOLLOW);
        let mut found = Batch::new();
        while next != NONE {
            let id = InteractionId(next);
            let slot = self.tables.interaction(id);
            next = slot.next(Chain::Modelled, unit);
            if !slot.arrivals.arrive() && !seeded!(TestedTwice) {
                continue;
            }
            slot.arrivals.arm(2);
            let [a, b] = slot.ends().map(|end| self.tables.unit(end));
            // SAFETY: both ends have entered the frame and this one has not left the gate, so
            // neither is updated; see `meet_earlier`.
            let near = unsafe { a.object.with(|a| b.object.with(|b| env.broad_phase(a, b))) };
            if near && found.push(id).is_err() {
                self.candidates(unit, &found, out);
                found.clear();
                let _fits = found.push(id);
            }
        }
        self.candidates(unit, &found, out);
    }

    /// Counts interactions of `unit` at both ends before anyone can end them, then lets them go.
    fn candidates(&self, unit: UnitId, ids: &[InteractionId], out: &mut Carry<'_, '_, E, W>) {
        if ids.is_empty() {
            return;
        }
        if seeded!(CountedAfterEmitted) {
            ids.iter().for_each(|&id| out.emit(Work::Interact(id)));
        }
        for &id in ids {
            let other = self.tables.interaction(id).other(unit);
            if other != unit && !seeded!(CountedAtOneEnd) {
                self.tables.push_candidates(&[id], other);
            }
        }
        self.tables.push_candidates(ids, unit);
        if !seeded!(CountedAfterEmitted) {
            ids.iter().for_each(|&id| out.emit(Work::Interact(id)));
        }
    }

    /// `unit` has entered its frame and made its tests. The last one opens the frame: whoever comes for a unit may
    /// update it, if it has no interactions left and is rendered.
    fn leave_gate(&self, unit: UnitId, out: &mut Carry<'_, '_, E, W>) {
        // Read before leaving: afterwards the unit may be updated by someone else.
        let frame = self.next_frame(unit);
        if seeded!(UpdatesAfterOwnTests) {
            self.ready(unit, out);
        }
        if !self.tables.gathering.gate.arrive() {
            return;
        }
        self.tables.reset_pools(if seeded!(PoolsResetEarly) { frame } else { frame.next() });
        self.opened(frame);
        if seeded!(UpdatesAfterOwnTests) {
            return;
        }
        self.tables.queues.homes.iter().for_each(|home| home.opened.offer());
        out.offered(self.tables.units.len() as u32);
        if seeded!(GateArmedLate) {
            self.opened(frame);
        }
    }

    /// `frame` has been gathered; the gate now gathers the next one.
    fn opened(&self, frame: Frame) {
        self.tables.gathering.gate.arm(self.tables.units.len() as u32);
        self.window.opened(frame);
    }

    /// One thing less that `unit`'s update waits for.
    #[inline]
    fn ready(&self, unit: UnitId, out: &mut Carry<'_, '_, E, W>) {
        if self.tables.unit(unit).pending.arrive() {
            out.emit(Work::Update(unit));
        }
    }

    /// Interaction: exact detection and response.
    pub(crate) fn interact(
        &self,
        env: &E,
        id: InteractionId,
        out: &mut Carry<'_, '_, E, W>,
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
        out: &mut Carry<'_, '_, E, W>,
    ) -> Result<(), E::Error> {
        let slot = self.tables.unit(unit);
        let frame = self.next_frame(unit);
        let mut inputs = Inputs::new(&self.tables, unit, frame);
        // SAFETY: the unit's countdown has ended: every interaction and the rendering that read
        // it are done, and none starts before it enters the next frame below.
        let outcome =
            unsafe { slot.object.with_mut(|object| env.update(unit, frame, object, &mut inputs)) };
        drop(inputs);
        // The next update waits for its frame's opening and for this frame's rendering. Stored
        // before the unit is passed on to either.
        slot.pending.arm(if seeded!(RenderingNotAwaited) { 1 } else { 2 });
        slot.frame.store(frame.next().0, site::FRAME_TAG);
        let on_display = self.window.display() == frame || seeded!(RenderedBeforeSwap);
        if on_display && (holder || out.takes_renderer()) {
            out.emit(Work::Render(unit));
        } else if !(on_display && out.keeps(unit)) {
            out.queue(Work::Render(unit));
        }
        if self.config.entry == Entry::AfterUpdate {
            self.advance(unit, frame, out);
        }
        if seeded!(PendingArmedLate) {
            slot.pending.arm(2);
        }
        outcome
    }

    /// Lets `unit`, done with `frame`, enter the next one, if there is to be one.
    fn advance(&self, unit: UnitId, frame: Frame, out: &mut Carry<'_, '_, E, W>) {
        if self.window.is_limit(frame.next()) {
            return;
        }
        if self.tables.unit(unit).bypasses {
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
        renderer: &mut E::Renderer,
        out: &mut Carry<'_, '_, E, W>,
    ) -> Result<(), E::Error> {
        let frame = self.rendered_frame(unit);
        // SAFETY: the unit's next update waits for the arrival below; until then it is only read.
        let mut outcome = unsafe {
            let object = &self.tables.unit(unit).object;
            object.with(|object| env.render(unit, frame, object, renderer))
        };
        if self.config.entry == Entry::AfterRender {
            self.advance(unit, frame, out);
        }
        if !seeded!(RenderingNotAwaited) {
            self.ready(unit, out);
        }
        if self.window.renders.arrive() {
            // A swap may take long, waiting for a display say: nothing is to wait for it that others could do.
            if !seeded!(SwapsWithWork) {
                out.let_go();
            }
            outcome = outcome.and(env.swap(frame, renderer));
            self.window.swapped(frame);
            self.after_swap(frame, out);
        }
        outcome
    }

    fn after_swap(&self, frame: Frame, out: &mut Carry<'_, '_, E, W>) {
        if self.window.is_limit(frame.next()) {
            // Whoever sleeps shall see that the pipeline is at rest.
            if !seeded!(EndNotAnnounced) {
                out.all_done();
            }
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
