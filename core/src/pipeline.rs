//! The four stages wired (Fig. 6): tables, window, queues and bells under one roof, and what a
//! host may do with them. What a work unit does is in `protocol.rs`.

use crate::environment::Environment;
use crate::error::{NotShared, SetupError, StillRunning, Table, TableFull};
use crate::frame::{Entry, Frame, Window};
use crate::homes::Home;
use crate::inbox::{From, Rejected};
use crate::probe::NoProbe;
use crate::stage::{Stage, Stages};
use crate::storage::Memory;
use crate::sync::site;
use crate::tables::Tables;
use crate::token::{Shared, Token, TokenOffice};
use crate::unit::{UnitId, Work};
use crate::wait::{Bells, Spin, Waiting};
use crate::worker::Worker;

pub use crate::homes::MOST_HOMES;

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
    /// How many workers may render at once, each with a renderer of its own, of which one swaps the frame, if the
    /// renderer is not shared; with 0 no frame is ever swapped.
    pub tokens: u32,
    /// How many homes the units are shared out to: 1 to [`MOST_HOMES`], the nearest is taken;
    /// usually one for each worker. A worker does the units of its own home first, in the order of their
    /// numbers where a frame opens, and then comes to help in others, with updates only after some steps that found
    /// nothing. So what its core has in its cache
    /// stays there, units that are close in space meet in one cache if the host gives them one home, and
    /// none of the last is long if the host gives long ones low numbers.
    pub homes: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self { broad_phase: BroadPhase::default(), entry: Entry::default(), tokens: 1, homes: 1 }
    }
}

/// The pipeline: shared by all workers, owned by none.
///
/// It holds the queues' ends of [`MOST_HOMES`] homes, in cache lines of their own: several kilobytes
/// ([`size_of`] says how many for a target), which a small stack had better not be the place of.
///
/// A worker that is lost in mid-work (its callback panicked, it was forgotten, its task deleted) keeps the frames from
/// ever being done. A new pipeline over the same memory is sound then, and is the way to other numbers of units, too:
/// it begins with frame 0, without the letters of before, which [`take_letters`](Self::take_letters) hands over, and
/// with the states of modelled interactions as they are. Memory that was lent for good (`&'static mut`) cannot be lent
/// again.
pub struct Pipeline<'m, E: Environment, W: Waiting = Spin> {
    pub(crate) tables: Tables<'m, E>,
    pub(crate) window: Window,
    pub(crate) bells: Bells,
    pub(crate) waiting: W,
    pub(crate) office: TokenOffice,
    pub(crate) shared: Shared<E::Renderer>,
    pub(crate) config: Config,
}

impl<'m, E: Environment, W: Waiting> Pipeline<'m, E, W> {
    /// A pipeline over `memory`, at rest before its first frame.
    ///
    /// # Errors
    /// [`SetupError`] names the table that does not fit, or the interaction that joins nothing.
    pub fn new(memory: Memory<'m, E>, config: Config, waiting: W) -> Result<Self, SetupError> {
        let homes = (config.homes as usize).clamp(1, MOST_HOMES);
        let tables = Tables::new(memory, config.broad_phase == BroadPhase::Pairwise, homes)?;
        Ok(Self {
            window: Window::new(tables.units.len() as u32, Frame(0)),
            bells: Bells::new(),
            waiting,
            office: TokenOffice::new(config.tokens),
            shared: Shared::new(),
            config,
            tables,
        })
    }

    /// Lets `frames` more frames run.
    ///
    /// # Errors
    /// [`StillRunning`] if the frames let run before have not all been swapped: always after [`Self::run_without_end`].
    pub fn run(&mut self, frames: u32) -> Result<(), StillRunning> {
        self.run_up_to(Some(Frame(self.frame().0.wrapping_add(frames))))
    }

    /// Lets frames run without end: for a machine that never stops, or whose pipeline is shared for good, so that
    /// nobody can let more frames run. Who wants an end steps no worker any more; those that sleep are woken by the
    /// host, whose [`Waiting::sleep`] may return at any time. It is for good: another run takes another pipeline over
    /// the memory.
    ///
    /// # Errors
    /// [`StillRunning`] if the frames let run before have not all been swapped.
    pub fn run_without_end(&mut self) -> Result<(), StillRunning> {
        self.run_up_to(None)
    }

    fn run_up_to(&mut self, limit: Option<Frame>) -> Result<(), StillRunning> {
        if !self.finished() {
            return Err(StillRunning);
        }
        self.bells.forget_hunger();
        self.shared.regain();
        self.window.limit = limit;
        if !self.finished() {
            let units = 0..self.tables.units.len() as u32;
            units.for_each(|unit| self.push(Work::Enter(UnitId(unit))));
        }
        Ok(())
    }

    /// A worker of home 0. Any number may join and leave at any time.
    pub fn worker(&self) -> Worker<'_, 'm, E, W, NoProbe> {
        self.worker_at(0)
    }

    /// A worker of home `home`, counted round: with two homes, 2 is home 0.
    pub fn worker_at(&self, home: u32) -> Worker<'_, 'm, E, W, NoProbe> {
        Worker::new(self, home % self.tables.queues.homes.count(), NoProbe)
    }

    /// A render token for `renderer`.
    ///
    /// # Errors
    /// The renderer back, and the number of tokens there are, if all are out; a shared renderer has them all.
    pub fn token(
        &self,
        renderer: E::Renderer,
    ) -> Result<Token<'_, E::Renderer>, (E::Renderer, TableFull)> {
        let capacity = self.config.tokens as usize;
        let needed = capacity.saturating_add(1);
        let full = TableFull { table: Table::Tokens, capacity, needed };
        self.office.issue(renderer).map_err(|renderer| (renderer, full))
    }

    /// Leaves `renderer` to all workers instead of giving tokens to some: whoever has updated a unit renders it too, at
    /// once or between its next work units if another worker is rendering, and so it need not go from that core's cache
    /// to another's; what it leaves to others, whoever has the renderer renders. A frame's swap may so wait for an update
    /// of the next frame: where those take long a token's holder had better render. It stays until it is
    /// [taken back](Self::take_back), and all tokens with it.
    ///
    /// # Errors
    /// The renderer back, and the number of tokens there are, if any is out or there is none.
    pub fn share(&mut self, renderer: E::Renderer) -> Result<(), (E::Renderer, NotShared)>
    where
        E::Renderer: Send,
    {
        let tokens = self.config.tokens;
        if !self.office.close(tokens) {
            return Err((renderer, NotShared { tokens }));
        }
        self.shared.offer(renderer);
        Ok(())
    }

    /// The renderer that was left to all workers, if there is one.
    #[must_use = "dropping it drops the renderer"]
    pub fn take_back(&mut self) -> Option<E::Renderer> {
        let renderer = self.shared.withdraw()?;
        self.office.open(self.config.tokens);
        Some(renderer)
    }

    /// Whether every frame that was let run has been swapped.
    pub fn finished(&self) -> bool {
        self.window.is_limit(self.window.display())
    }

    /// The first frame that has not been swapped.
    pub fn frame(&self) -> Frame {
        self.window.display()
    }

    /// Posts a letter from outside the callbacks: a device, an interrupt handler, a user
    /// interface. It is processed by `to`'s first update in a later frame than the one now open, or sooner where
    /// this thread does not know yet that another one has opened that. Nobody else, no unit either, may post under the
    /// same `sender` meanwhile: letters of the same sender and place in the sequence come in an order that depends on
    /// the schedule.
    ///
    /// # Errors
    /// [`Rejected`] with the letter if all letters are under way, or if there is no unit `to`.
    pub fn post(
        &self,
        to: UnitId,
        from: From,
        message: E::Message,
    ) -> Result<(), Rejected<E::Message>> {
        let stamp = self.window.open();
        self.tables.post(to, stamp, from, message)
    }

    /// Gives every unit another home, counted round: to balance them, say; also within a run. At first they are shared
    /// out in the order of their numbers, as many to each home. It looks at each unit once for each home.
    pub fn set_homes(&mut self, home_of: impl Fn(UnitId) -> u32) {
        self.tables.set_homes(home_of);
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

    /// The largest number of candidates and of contacts that a frame in flight has asked room for so far, found
    /// or not; at rest, those of the last frame.
    pub fn high_water(&mut self) -> (usize, usize) {
        let both = [Frame(0), Frame(1)];
        let candidates = both.map(|frame| self.tables.candidates_asked(frame));
        let contacts = both.map(|frame| self.tables.pools.asked(frame));
        (candidates[0].max(candidates[1]) as usize, contacts[0].max(contacts[1]) as usize)
    }

    /// Stages in which work is queued at a home, or is to be rendered; `Render` only for a holder.
    #[inline]
    pub(crate) fn visible(&self, home: &Home<'_>, updates: bool, holder: bool) -> Stages {
        Stages::NONE
            .with_if(Stage::BroadPhase, !home.enter.looks_empty())
            .with_if(Stage::Interaction, !home.has_no_interactions())
            .with_if(Stage::Update, updates && !home.has_no_updates())
            .with_if(Stage::Render, holder && self.render_visible())
    }

    /// Whether anything but a rendering is queued at any home, or to be come for. It is looked for from this home round, and
    /// no farther than to what is seen first: what is looked at elsewhere comes from other cores.
    pub(crate) fn visible_anywhere(&self, from: u32) -> bool {
        let homes = &self.tables.queues.homes;
        homes.round_from(from).map(|number| homes.at(number)).any(Home::has_work)
    }

    #[inline]
    pub(crate) fn render_visible(&self) -> bool {
        let display = self.window.display();
        !self.tables.queues.render[display.parity()].looks_empty()
    }

    /// Queues `work`.
    #[inline]
    pub(crate) fn push(&self, work: Work) {
        let queues = &self.tables.queues;
        let (queue, index) = match work {
            Work::Enter(unit) => (&self.home_of(unit).enter, unit.0),
            Work::Interact(id) => queues.homes.queue_of(id),
            Work::Update(unit) => (&self.home_of(unit).update, unit.0),
            Work::Render(unit) => (&queues.render[self.rendered_frame(unit).parity()], unit.0),
        };
        // A queue has a slot for everything that may come to it.
        let _fits = queue.push(index);
    }

    fn home_of(&self, unit: UnitId) -> &Home<'m> {
        self.tables.queues.homes.at(self.tables.home_of(unit))
    }

    /// The frame of the unit's next update.
    pub(crate) fn next_frame(&self, unit: UnitId) -> Frame {
        Frame(self.tables.unit(unit).frame.load(site::FRAME_TAG))
    }

    /// The frame that a unit waiting to be rendered was updated in.
    pub(crate) fn rendered_frame(&self, unit: UnitId) -> Frame {
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
}

#[cfg(all(test, not(loom)))]
#[path = "pipeline_tests.rs"]
mod tests;
