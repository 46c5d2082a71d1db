//! What a worker carries (§4.2): what its work units set free, as long as nobody is hungry; and what of the
//! queues it takes next.

use heapless::{Deque, Vec};

use crate::environment::Environment;
use crate::homes::Home;
use crate::pipeline::Pipeline;
use crate::stage::Stage;
use crate::sync::{fence, seeded, site};
use crate::unit::{InteractionId, UnitId, Work};
use crate::wait::Waiting;

/// Interactions, and other work units, that a worker may carry at once: more than one block has neighbours,
/// so that a unit's interactions need no queue. Usually 32; beyond it they are queued.
#[cfg(not(loom))]
const MOST_CARRIED: usize = 32;
/// Nobody else sees what is carried: what is queued is what models are about.
#[cfg(loom)]
const MOST_CARRIED: usize = 1;

/// Interactions of the frame being gathered that a worker keeps while it can update: what it does when
/// nothing is left but updates that others are at, for which the frame's opening waits. Usually 4.
const RESERVE: usize = MOST_CARRIED / 8;

/// Renderings that a worker keeps at most until nobody else has the shared renderer. Usually 8: it asks for that ahead of
/// every step; beyond it they are queued.
const MOST_KEPT: usize = MOST_CARRIED.div_ceil(4);

/// Steps in a row that have to find nothing before a worker takes updates of other homes. Usually 32, some microseconds:
/// the units' data are at the worker of their own home, which is mostly at something short and comes for them next; who
/// takes one from it makes it take another one's.
#[cfg(not(loom))]
const PATIENCE: u32 = 32;
/// Who finds nothing because of it does what one does whose look came too early.
#[cfg(loom)]
const PATIENCE: u32 = 0;

/// Carry-over (§4.2): outputs are carried as long as nobody is hungry; and how many sleepers what was
/// queued is to wake.
pub(crate) struct Carry<'p, 'm, E: Environment, W: Waiting> {
    pub(crate) pipeline: &'p Pipeline<'m, E, W>,
    /// Interactions, oldest first.
    interactions: Deque<InteractionId, MOST_CARRIED>,
    /// All else, newest first.
    works: Vec<Work, MOST_CARRIED>,
    /// Units of the frame on display that this worker updated and is to render by the shared renderer, which another
    /// one had.
    kept: Vec<UnitId, MOST_KEPT>,
    queued: u32,
    renders: u32,
    /// Whether this worker is counted among the hungry.
    hungry: bool,
    /// Steps that have still to find nothing before this worker takes updates of other homes.
    patience: u32,
    /// Whether this worker has the shared renderer.
    pub(crate) renders_shared: bool,
    pub(crate) home: u32,
}

impl<'p, 'm, E: Environment, W: Waiting> Carry<'p, 'm, E, W> {
    /// Nothing, in the hands of a worker of home `home`.
    pub(crate) fn new(pipeline: &'p Pipeline<'m, E, W>, home: u32) -> Self {
        Self {
            pipeline,
            interactions: Deque::new(),
            works: Vec::new(),
            kept: Vec::new(),
            queued: 0,
            renders: 0,
            hungry: false,
            patience: PATIENCE,
            renders_shared: false,
            home,
        }
    }

    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        !self.has_next() && (self.kept.is_empty() || seeded!(SleepsWithRendering))
    }

    /// Whether something is carried that this worker can do next, whoever renders.
    #[inline]
    fn has_next(&self) -> bool {
        !self.works.is_empty() || !self.interactions.is_empty()
    }

    /// Whether a rendering is carried: on top, then, for only holders can do it.
    pub(crate) fn has_rendering(&self) -> bool {
        matches!(self.works.last(), Some(Work::Render(_)))
    }

    /// `work` can be done now, by this worker too.
    #[inline]
    pub(crate) fn emit(&mut self, work: Work) {
        if matches!(work, Work::Update(unit) if self.is_at_home_elsewhere(unit)) {
            self.queue(work);
            return;
        }
        // One work unit is for this worker itself.
        if (self.has_next() && self.pipeline.bells.somebody_is_hungry()) || !self.carry(work) {
            self.queue(work);
        }
    }

    /// `work` is for whoever comes for it first: this worker cannot do it now, or is not to keep it.
    #[inline]
    pub(crate) fn queue(&mut self, work: Work) {
        self.pipeline.push(work);
        *self.calls_for(Stage::of(work)) += 1;
    }

    /// So many units are there to come for.
    pub(crate) fn offered(&mut self, units: u32) {
        self.queued += units;
    }

    /// Renderings that were queued already can be done now, by other holders if there are any.
    pub(crate) fn renders_visible(&mut self) {
        self.renders = u32::MAX / 2;
    }

    /// The pipeline is at rest.
    pub(crate) fn all_done(&mut self) {
        (self.queued, self.renders) = (u32::MAX / 2, u32::MAX / 2);
    }

    /// Whether this worker has the shared renderer, or has it from now on, since nobody else had it.
    #[inline]
    pub(crate) fn takes_renderer(&mut self) -> bool {
        self.renders_shared = self.renders_shared || self.pipeline.shared.take();
        self.renders_shared
    }

    /// Keeps the rendering of `unit`, which this worker has updated for the frame on display, until nobody else has the
    /// shared renderer; `false` if no renderer is shared, or so many are kept already.
    #[inline]
    pub(crate) fn keeps(&mut self, unit: UnitId) -> bool {
        self.pipeline.shared.is_offered() && self.kept.push(unit).is_ok()
    }

    /// A rendering that was kept, if this worker has the shared renderer now: of the unit that its core has seen last.
    #[inline]
    pub(crate) fn take_kept(&mut self) -> Option<Work> {
        if self.renders_shared { self.kept.pop().map(Work::Render) } else { None }
    }

    /// Gives all that is carried to whoever comes first.
    fn shed(&mut self) {
        self.shed_works();
        self.queue_kept();
    }

    fn shed_works(&mut self) {
        while let Some(id) = self.interactions.pop_front() {
            self.queue(Work::Interact(id));
        }
        while let Some(work) = self.works.pop() {
            self.queue(work);
        }
    }

    /// Gives the renderings that are kept to whoever comes first.
    pub(crate) fn queue_kept(&mut self) {
        while let Some(unit) = self.kept.pop() {
            self.queue(Work::Render(unit));
        }
    }

    /// Gives what is carried to those who found nothing to do, if there are any, and calls for what was queued
    /// since the last call, a rendering that was put back say: what is done next may take long.
    #[inline]
    pub(crate) fn share(&mut self) {
        if !self.is_empty() && self.pipeline.bells.somebody_is_hungry() {
            self.shed_works();
            // Nobody else can render meanwhile.
            if !self.renders_shared {
                self.queue_kept();
            }
        }
        self.announce();
    }

    /// Gives what is carried to whoever comes first, and calls for all that was queued.
    pub(crate) fn let_go(&mut self) {
        self.shed();
        self.announce();
    }

    /// Carries `work`, if there is room for it.
    #[inline]
    fn carry(&mut self, work: Work) -> bool {
        if let Work::Interact(id) = work {
            return self.interactions.push_back(id).is_ok();
        }
        if self.works.push(work).is_err() {
            return false;
        }
        // A rendering stays on top: only holders can do it.
        if let [.., below @ Work::Render(_), top] = self.works.as_mut_slice() {
            ::core::mem::swap(below, top);
        }
        true
    }

    /// The next that is carried, or an update at home: first what others wait for.
    pub(crate) fn take(&mut self) -> Option<Work> {
        let Some(&id) = self.interactions.front() else { return self.works.pop() };
        let oldest = Work::Interact(id);
        // Updates wait for the open frame's; for the next frame's nobody does before it is open.
        let is_awaited = self.pipeline.frame_of(oldest) == self.pipeline.window.open();
        if is_awaited && self.works.is_empty() {
            self.come_home();
        }
        let before_updates = is_awaited || self.interactions.len() > RESERVE;
        let other = match self.works.last() {
            Some(Work::Update(_)) | None if before_updates => None,
            Some(_) => self.works.pop(),
            None => self.pop_update(),
        };
        if other.is_some() {
            return other;
        }
        // Of those that nobody waits for the newest: its units are in this worker's caches.
        let id =
            if is_awaited { self.interactions.pop_front() } else { self.interactions.pop_back() };
        id.map(Work::Interact)
    }

    /// Comes for units of this worker's home, up to the first that is free: who then ends what another of them waits for
    /// is the last, and updates it with what it has just read in its core's cache.
    fn come_home(&mut self) {
        let home = self.pipeline.tables.queues.homes.at(self.home);
        if let Some(unit) = self.come(home) {
            self.emit(Work::Update(unit));
        }
    }

    /// An update at this worker's home.
    #[inline]
    fn pop_update(&mut self) -> Option<Work> {
        self.pop(self.home, Stage::Update)
    }

    /// A work unit of `stage` that is queued at the home of this number, or a rendering.
    #[inline]
    pub(crate) fn pop(&mut self, number: u32, stage: Stage) -> Option<Work> {
        let homes = &self.pipeline.tables.queues.homes;
        let home = homes.at(number);
        match stage {
            Stage::BroadPhase => home.enter.pop().map(|unit| Work::Enter(UnitId(unit))),
            Stage::Interaction => homes.pop_interaction(number).map(Work::Interact),
            Stage::Update => {
                let unit = self.come(home).or_else(|| home.update.pop().map(UnitId));
                unit.map(Work::Update)
            }
            Stage::Render => self.pop_render(),
        }
    }

    /// Comes for units of the frame that is open, and has the first that waits for nothing else: others are updated by
    /// whoever ends what they wait for.
    #[inline]
    fn come(&self, home: &Home<'_>) -> Option<UnitId> {
        let is_free =
            |unit| self.pipeline.tables.unit(unit).pending.arrive() || seeded!(UpdatesWhenOpened);
        // Once round at most, so that a step is bounded.
        let mut comes = (0..home.opened.len()).map_while(|_| home.opened.take().map(UnitId));
        comes.find(|&unit| is_free(unit))
    }

    /// A unit of the frame on display. Another holder may have swapped since `display` was read, and the
    /// queue may then hold units of a frame that may not be rendered yet: those go back, and who has
    /// looked for them in vain meanwhile is called.
    pub(crate) fn pop_render(&mut self) -> Option<Work> {
        let display = self.pipeline.window.display();
        let queue = &self.pipeline.tables.queues.render[display.parity()];
        let unit = UnitId(queue.pop()?);
        let work = Work::Render(unit);
        if self.pipeline.rendered_frame(unit) == display || seeded!(TagNotChecked) {
            return Some(work);
        }
        self.queue(work);
        None
    }

    /// Takes the shared renderer if there is something to render, and else has it no longer.
    #[inline]
    pub(crate) fn share_renderer(&mut self) {
        if self.pipeline.shared.is_offered()
            && (self.has_rendering()
                || !self.kept.is_empty()
                || self.pipeline.render_visible()
                || self.puts_renderer_back_and_sees())
        {
            self.takes_renderer();
        }
    }

    /// Puts the shared renderer back, if this worker has it, and calls somebody for what there is to render all the same,
    /// ahead of this step's work.
    #[inline]
    pub(crate) fn gives_renderer_up(&mut self) {
        if self.puts_renderer_back_and_sees() {
            *self.calls_for(Stage::Render) += 1;
        }
    }

    /// Puts the shared renderer back, if this worker has it, and says whether there is something to render all the
    /// same: whoever found it taken meanwhile may sleep before this worker's next step.
    fn puts_renderer_back_and_sees(&mut self) -> bool {
        if !self.renders_shared {
            return false;
        }
        self.put_renderer_back();
        fence(site::FENCE_PUT_BACK);
        !seeded!(NotLookedAgain) && self.pipeline.render_visible()
    }

    fn put_renderer_back(&mut self) {
        if ::core::mem::take(&mut self.renders_shared) {
            self.pipeline.shared.put_back();
        }
    }

    /// Whether `unit` is another home's, whose worker is to have it if it comes for it in time.
    #[inline]
    fn is_at_home_elsewhere(&self, unit: UnitId) -> bool {
        self.pipeline.tables.home_of(unit) != self.home
    }

    /// A step has found nothing, which counts this worker among the hungry, or something, or is the last one.
    #[inline]
    pub(crate) fn set_hungry(&mut self, hungry: bool) {
        self.patience = if hungry { self.patience.saturating_sub(1) } else { PATIENCE };
        if self.hungry != hungry {
            self.hungry = hungry;
            self.pipeline.bells.count_hungry(hungry);
        }
    }

    /// Whether updates of the home of this number are for this worker now: those of its own are at any time.
    #[inline]
    pub(crate) fn takes_updates_of(&self, number: u32) -> bool {
        number == self.home || self.patience == 0
    }

    /// Whom queued work of a stage calls: anyone, but holders alone to render, unless the renderer is shared.
    #[inline]
    fn calls_for(&mut self, stage: Stage) -> &mut u32 {
        let is_for_holders = stage == Stage::Render
            && (!self.pipeline.shared.is_offered() || seeded!(RenderingCallsHolders));
        if is_for_holders { &mut self.renders } else { &mut self.queued }
    }

    /// Gives away what is carried, and any call that this worker was woken by and has not
    /// answered: whoever called counted on it, and may sleep or have left by now.
    pub(crate) fn leave(&mut self) {
        self.set_hungry(false);
        if seeded!(LeavesWithCarry) {
            self.works.clear();
            self.interactions.clear();
            self.kept.clear();
        }
        self.shed();
        if !seeded!(LeavesWithRenderer) {
            self.put_renderer_back();
        }
        if seeded!(CallNotPassedOn) {
            return self.announce();
        }
        // Whoever still counts this worker among the sleepers has queued its work before this.
        fence(site::FENCE_LEAVE);
        let has_rendering = self.pipeline.render_visible();
        *self.calls_for(Stage::Render) += u32::from(has_rendering);
        self.queued += u32::from(self.pipeline.visible_anywhere(self.home));
        self.announce();
    }

    pub(crate) fn announce(&mut self) {
        if seeded!(BatchNotFlushed) && self.queued + self.renders < 3 {
            return;
        }
        if self.queued > 0 || self.renders > 0 {
            self.pipeline.bells.announce(&self.pipeline.waiting, self.queued, self.renders);
            (self.queued, self.renders) = (0, 0);
        }
    }
}

impl<E: Environment, W: Waiting> Drop for Carry<'_, '_, E, W> {
    fn drop(&mut self) {
        self.leave();
    }
}

#[cfg(all(test, not(loom)))]
#[path = "carry_tests.rs"]
mod tests;
