//! What a work unit does, an arrival at a countdown at a time (`core/PROTOCOL.md` §2).

use crate::config::{BroadPhase, Bug, Entry};
use crate::state::{At, Rule, Then};
use crate::step::Step;
use crate::work::{Work, indices};

impl Step<'_> {
    pub(crate) fn test(&mut self, pair: u8, near: bool) {
        let [a, b] =
            self.config.pairs[pair as usize].map(|end| self.state.units[end as usize].frame);
        self.claim(Rule::Order, a == b);
        self.claim(Rule::ExactlyOnce, self.state.tests[pair as usize] == a);
        self.state.tests[pair as usize] += 1;
        if near {
            self.claim(Rule::ExactlyOnce, self.state.found >> pair & 1 == 0);
            self.state.found |= 1 << pair;
            self.worker().uncounted |= 1 << pair;
        }
        if let At::Arriving(unit, left) = self.at() {
            self.state.arrived &= !(1 << pair);
            self.arriving(unit, left & !(1 << pair));
        }
    }

    /// `unit` has still to arrive at the pairs `left` (`Pairwise`).
    fn arriving(&mut self, unit: u8, left: u64) {
        if left == 0 {
            self.arrived(unit);
        } else {
            self.goes_to(At::Arriving(unit, left));
        }
    }

    /// `unit` has arrived; nobody but this worker knows yet of the pairs that it found.
    fn arrived(&mut self, unit: u8) {
        if self.config.has(Bug::OpenedByLastArriver) {
            self.goes_to(At::AtGate(unit, Then::End));
        } else {
            let found = std::mem::take(&mut self.worker().uncounted);
            self.found(unit, found);
        }
    }

    /// `unit` leaves the gate when the pairs that it found are counted and let go.
    fn found(&mut self, unit: u8, pairs: u64) {
        self.goes_to(match pairs {
            0 => At::AtGate(unit, Then::End),
            _ => At::Found(unit, pairs),
        });
    }

    /// Counts the first of `pairs` at both ends and lets it go.
    fn let_go(&mut self, unit: u8, pairs: u64) {
        let pair = pairs.trailing_zeros() as u8;
        if self.config.has(Bug::CountedAfterGate) {
            self.worker().uncounted |= 1 << pair;
        } else {
            self.count(pair);
        }
        self.emit(Work::Interact(pair));
        self.found(unit, pairs & !(1 << pair));
    }

    fn count(&mut self, pair: u8) {
        for end in self.config.ends(pair) {
            let pending = &mut self.state.unit(end).pending;
            *pending = pending.wrapping_add(1);
        }
    }

    /// One thing less that `unit`'s update waits for; whether that was the last.
    pub(crate) fn take_off(&mut self, unit: u8) -> bool {
        let pending = &mut self.state.unit(unit).pending;
        *pending = pending.wrapping_sub(1);
        *pending == 0
    }

    /// One thing less that `unit`'s update waits for, which this worker sets free if that was the last.
    fn ready(&mut self, unit: u8) {
        if self.take_off(unit) {
            self.emit(Work::Update(unit));
        }
    }

    pub(crate) fn call(&mut self) {
        match self.at() {
            At::Interacting(pair) => {
                self.state.found &= !(1 << pair);
                let [a, b] = self.config.pairs[pair as usize];
                self.ready(a);
                if a == b { self.end() } else { self.goes_to(At::Interacted(pair)) }
            }
            At::Updating(unit) => self.updated(unit),
            At::Rendering(unit) => self.rendered(unit),
            At::Swapping => self.swapped(),
            _ => unreachable!("no callback is running"),
        }
    }

    fn updated(&mut self, unit: u8) {
        let late = self.config.has(Bug::ArmedAfterPublishing);
        let counted = if self.config.has(Bug::RenderNotCounted) { 1 } else { 2 };
        let slot = self.state.unit(unit);
        slot.frame += 1;
        if !late {
            slot.pending = counted;
        }
        let is_displayed = self.state.is_displayed(unit);
        if self.config.shared && is_displayed {
            self.take_renderer();
        }
        let own = is_displayed && self.worker().holds;
        if self.config.shared {
            self.goes_to(At::Passing { unit, own });
        } else {
            self.pass_on(unit, own);
        }
    }

    /// `unit` is to be rendered, by this worker if it is its `own` rendering or once it has the shared renderer, and may
    /// enter its next frame.
    fn pass_on(&mut self, unit: u8, own: bool) {
        let is_kept = self.config.shared && self.state.is_displayed(unit);
        if own || is_kept {
            self.emit(Work::Render(unit));
        } else {
            self.queue(Work::Render(unit));
        }
        let late = self.config.has(Bug::ArmedAfterPublishing);
        let last = self.state.unit(unit).frame == self.config.frames;
        if self.config.entry == Entry::AfterUpdate && !last {
            self.goes_to(At::Advancing(unit));
        } else if late {
            self.goes_to(At::ArmingLate(unit));
        } else {
            self.end();
        }
    }

    /// `unit` may enter its next frame: by the first stage, or past it.
    fn advance(&mut self, unit: u8, then: Then) {
        if self.config.bypasses(unit) {
            self.goes_to(At::AtGate(unit, then));
        } else {
            self.emit(Work::Enter(unit));
            self.then(then);
        }
    }

    fn then(&mut self, then: Then) {
        match then {
            Then::End if self.worker().uncounted != 0 => {
                let uncounted = std::mem::take(&mut self.worker().uncounted);
                self.goes_to(At::CountingLate(uncounted, then));
            }
            Then::End => self.end(),
            Then::Rendered(unit) => self.goes_to(At::Rendered(unit)),
            Then::Enter(unit) if unit == self.config.units => self.end_of_swap(),
            Then::Enter(unit) => self.goes_to(At::Reentering(unit)),
        }
    }

    fn rendered(&mut self, unit: u8) {
        let slot = self.state.unit(unit);
        slot.rendered += 1;
        let last = slot.rendered == self.config.frames;
        if self.config.entry == Entry::AfterRender && !last {
            self.advance(unit, Then::Rendered(unit));
        } else {
            self.render_counted(unit);
        }
    }

    fn render_counted(&mut self, unit: u8) {
        if !self.config.has(Bug::RenderNotCounted) {
            self.ready(unit);
        }
        self.goes_to(At::Counting);
    }

    fn display_next(&mut self) {
        self.state.renders = self.config.units;
        self.state.display += 1;
    }

    fn swapped(&mut self) {
        let early = self.config.has(Bug::DisplayedBeforeSwap);
        let frame = self.state.display - u8::from(early);
        let all = self.state.units.iter().all(|unit| unit.rendered == frame + 1);
        self.claim(Rule::Swap, all);
        if !early {
            self.display_next();
        }
        let most = self.config.workers;
        if self.state.display == self.config.frames {
            // Whoever sleeps shall see that the pipeline is at rest.
            (self.worker().queued, self.worker().renders) = (most, most);
            self.end();
        } else if self.config.entry == Entry::AfterSwap {
            self.goes_to(At::Reentering(0));
        } else {
            self.end_of_swap();
        }
    }

    /// What waited for the swap is now visible to other holders.
    fn end_of_swap(&mut self) {
        self.worker().renders = self.config.workers;
        self.end();
    }

    pub(crate) fn go(&mut self) {
        match self.at() {
            At::Entering(unit) => {
                self.state.arrived |= 1 << unit;
                self.arrived(unit);
            }
            At::Arriving(unit, left) => {
                let first = left & left.wrapping_neg();
                self.state.arrived |= first;
                self.arriving(unit, left & !first);
            }
            At::Found(unit, pairs) => self.let_go(unit, pairs),
            At::AtGate(unit, then) => self.leave_gate(unit, then),
            At::CountingLate(pairs, then) => {
                for pair in indices(pairs).map(|pair| pair as u8) {
                    self.count(pair);
                    if self.config.has(Bug::OpenedByLastArriver) {
                        self.emit(Work::Interact(pair));
                    }
                }
                self.then(then);
            }
            At::Opening(unit, then) => self.open(unit, then),
            At::Interacted(pair) => {
                let [_, b] = self.config.pairs[pair as usize];
                self.ready(b);
                self.end();
            }
            At::Passing { unit, own } => self.pass_on(unit, own),
            At::Advancing(unit) if self.config.has(Bug::ArmedAfterPublishing) => {
                self.emit(Work::Enter(unit));
                self.goes_to(At::ArmingLate(unit));
            }
            At::Advancing(unit) => self.advance(unit, Then::End),
            At::ArmingLate(unit) => {
                self.state.unit(unit).pending = 2;
                self.end();
            }
            At::Coming { unit, turned } => self.came(unit, turned),
            At::Rendered(unit) => self.render_counted(unit),
            At::Counting => self.count_rendered(),
            At::Reentering(unit) => self.advance(unit, Then::Enter(unit + 1)),
            At::Taking | At::PuttingBack(_) | At::LookingAgain(_) => self.go_sharing(),
            At::GoingOn if self.worker().holds => self.go_sharing(),
            _ => self.go_waiting(),
        }
    }

    fn leave_gate(&mut self, unit: u8, then: Then) {
        if self.config.has(Bug::NoGate) {
            self.ready(unit);
            self.then(then);
            return;
        }
        self.state.gate = self.state.gate.wrapping_sub(1);
        if self.state.gate > 0 {
            self.then(then);
            return;
        }
        if !self.config.has(Bug::ArrivalsKept) && self.config.broad_phase == BroadPhase::Spatial {
            self.state.arrived = 0;
        }
        if !self.config.has(Bug::GateArmedLate) {
            self.state.gate = self.config.units;
        }
        self.goes_to(At::Opening(0, then));
    }

    fn open(&mut self, unit: u8, then: Then) {
        self.claim(Rule::ExactlyOnce, self.state.opened >> unit & 1 == 0);
        self.state.opened |= 1 << unit;
        self.count_queued(Work::Update(unit));
        if unit + 1 < self.config.units {
            self.goes_to(At::Opening(unit + 1, then));
            return;
        }
        if self.config.has(Bug::ArrivalsKept) {
            self.state.arrived = 0;
        }
        if self.config.has(Bug::GateArmedLate) {
            self.state.gate = self.config.units;
        }
        self.then(then);
    }

    fn count_rendered(&mut self) {
        self.state.renders -= 1;
        let last = if self.config.has(Bug::SwapByLastButOne) { 1 } else { 0 };
        if self.state.renders != last {
            self.end();
            return;
        }
        if self.config.has(Bug::DisplayedBeforeSwap) {
            self.display_next();
        }
        if self.config.has(Bug::SwapsWithWork) {
            self.goes_to(At::Swapping);
        } else {
            self.shed();
            self.announce(At::RingingToSwap, At::Swapping);
        }
    }
}
