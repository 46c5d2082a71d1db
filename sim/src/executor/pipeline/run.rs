//! Frames run with the same tables: batches, and the threads that work on them.

use std::mem;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread;

use dualframe_core::error::{Table, TableFull};
use dualframe_core::inbox::From;
use dualframe_core::pipeline::Pipeline;
use dualframe_core::token::Token;
use dualframe_core::worker::Step;

use super::clock::{StageClock, Times};
use super::host::{Host, Parcel, Screen, Shared};
use super::memory::Limits;
use super::team::Team;
use crate::block::Block;
use crate::blocking::{Blocking, FRAMES_PER_BLOCKING, Grain};
use crate::executor::on_panic::OnPanic;
use crate::executor::world;
use crate::pool::{Crew, Pool};
use crate::timeline::Timeline;

type SimPipeline<'m, 's> = Pipeline<'m, Host<'s>, &'s Crew>;

/// What workers leave behind.
pub(super) struct Report {
    pub(super) times: Vec<Times>,
    pub(super) failure: Option<TableFull>,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// All frames are done, or a table failed.
    Done,
    /// A table is to grow: that for so much in a frame, or for so many letters more.
    Outgrown(Table, usize),
    /// More threads are wanted than there are.
    Threads,
}

/// What is done between two batches.
pub(super) struct Regrouping<'x> {
    /// What forms blocks anew, where there are any, and room for them.
    pub(super) blocking: Option<(&'x mut Blocking, &'x mut Vec<Block>)>,
    /// Objects' messages for the next frame.
    pub(super) mail: &'x mut Vec<(From, Parcel)>,
    pub(super) homes: u32,
    /// What of the tables may be used before they are to grow.
    pub(super) limits: Limits,
}

impl Regrouping<'_> {
    /// Posts the messages for the next frame, which is `due`, to wherever their objects are now.
    fn post_mail(&mut self, due: u64, shared: &Shared<'_>, pipeline: &SimPipeline<'_, '_>) {
        for (from, parcel) in self.mail.drain(..) {
            // A message to nobody is lost.
            if let Some(unit) = shared.register.unit_of(parcel.to)
                && let Err(rejected) = pipeline.post(unit, from, parcel)
            {
                shared.overflow.keep(due, unit, rejected.from, rejected.message);
            }
        }
    }

    fn take_mail(&mut self, shared: &Shared<'_>, pipeline: &mut SimPipeline<'_, '_>) {
        pipeline.take_letters(|_, from, parcel| self.mail.push((from, parcel)));
        shared.overflow.empty(|letter| self.mail.push(letter));
    }

    /// Whether a batch has outgrown a table; candidates are counted where blocks are formed.
    fn outgrown(&self, shared: &Shared<'_>, pipeline: &mut SimPipeline<'_, '_>) -> End {
        let ((_, contacts), letters) = (pipeline.high_water(), shared.overflow.most());
        if contacts > self.limits.most_contacts {
            End::Outgrown(Table::Contacts, contacts)
        } else if letters > 0 {
            End::Outgrown(Table::Letters, letters)
        } else {
            End::Done
        }
    }

    /// Gives the blocks the homes that they were dealt to.
    fn settle(&self, pipeline: &mut SimPipeline<'_, '_>) {
        if let Some((blocking, _)) = &self.blocking {
            pipeline.set_homes(|unit| blocking.home(unit.index()));
        }
    }

    /// Forms the blocks anew from where their objects are, if that is due before a frame. `rendering` is what
    /// that takes in a frame, in seconds, if the calling thread alone does it.
    ///
    /// # Errors
    /// How many of them may meet, if the table of those that do is to grow first.
    fn regroup_before(
        &mut self,
        frame: u64,
        shared: &Shared<'_>,
        pipeline: &mut SimPipeline<'_, '_>,
        rendering: f32,
    ) -> Result<(), usize> {
        let due = self.blocking.as_mut().filter(|_| world::regroups_before(Grain::Spatial, frame));
        let Some((blocking, blocks)) = due else { return Ok(()) };
        blocks.extend(pipeline.objects_mut().map(|unit| mem::take(&mut unit.block)));
        // Home 0 is the calling thread's, which alone renders if anything is known of that.
        blocking.deal(blocks, self.homes, rendering);
        for (index, (unit, block)) in pipeline.objects_mut().zip(blocks.drain(..)).enumerate() {
            shared.register.locate(index, &block);
            unit.block = block;
        }
        self.settle(pipeline);
        self.take_mail(shared, pipeline);
        self.post_mail(frame, shared, pipeline);
        let boxes = pipeline.objects_mut().map(|unit| unit.block.bounds());
        self.limits.check_pairs(boxes)
    }
}

/// Sends everybody home, also when the calling thread unwinds, out of a renderer say.
struct Dismissal<'s>(&'s Crew);

impl Drop for Dismissal<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.abort();
        }
        self.0.close();
    }
}

/// What all threads of a run share, besides the pipeline.
#[derive(Clone, Copy)]
pub(super) struct Context<'s, 'x> {
    pub(super) shared: &'s Shared<'s>,
    pub(super) crew: &'s Crew,
    pub(super) pool: &'x Pool,
    pub(super) team: &'x Team,
    /// How many work, the calling thread included.
    pub(super) workers: usize,
    pub(super) report: &'x Mutex<Report>,
    pub(super) timeline: Option<&'x Timeline>,
}

impl<'s> Context<'s, '_> {
    /// Runs batch after batch until all frames are done, a table fails, or tables or team are to grow. What
    /// panics comes back as the result, when everybody has gone home.
    pub(super) fn run(
        self,
        frames: u64,
        mut pipeline: SimPipeline<'_, 's>,
        mut regrouping: Regrouping<'_>,
        screen: Screen<'s>,
    ) -> thread::Result<End> {
        regrouping.settle(&mut pipeline);
        regrouping.post_mail(self.shared.first_frame, self.shared, &pipeline);
        // A single worker has nobody to share it with.
        let kept = if screen.renderer.is_bound() || self.workers == 1 {
            Some(screen)
        } else {
            pipeline.share(screen).err().map(|(screen, _)| screen)
        };
        let pipeline = RwLock::new(pipeline);
        let attend = |index| self.attend(index, &pipeline);
        let batches = || self.batches(frames, &pipeline, &mut regrouping, kept);
        let run = AssertUnwindSafe(|| self.team.work(self.workers, attend, batches));
        let ended = catch_unwind(run);
        let mut rested = pipeline.into_inner().unwrap_or_else(PoisonError::into_inner);
        regrouping.take_mail(self.shared, &mut rested);
        ended
    }

    /// What the calling thread does while the others attend.
    fn batches(
        self,
        frames: u64,
        pipeline: &RwLock<SimPipeline<'_, 's>>,
        regrouping: &mut Regrouping<'_>,
        mut kept: Option<Screen<'s>>,
    ) -> End {
        let dismissal = Dismissal(self.crew);
        let host = Host::new(self.shared, self.team.take_own(0));
        self.crew.await_present(self.workers - 1, self.pool);
        self.make_room_for(self.workers);
        let (mut done, mut end) = (0, End::Done);
        while done < frames && self.failure().is_none() && !self.crew.is_aborted() {
            if self.pool.threads() > self.workers {
                end = End::Threads;
                break;
            }
            let frame = self.shared.first_frame + done;
            let batch = (FRAMES_PER_BLOCKING - frame % FRAMES_PER_BLOCKING).min(frames - done);
            let Some(mut resting) = self.write(pipeline) else { break };
            let rendering = kept.as_ref().map_or(0.0, |screen| screen.rendering.seconds());
            if let Err(pairs) =
                regrouping.regroup_before(frame, self.shared, &mut resting, rendering)
            {
                end = End::Outgrown(Table::Interactions, pairs);
                break;
            }
            if resting.run(batch as u32).is_err() {
                break;
            }
            drop(resting);
            self.crew.start();
            kept = self.lead(&read(pipeline), &host, kept);
            done += batch;
            let Some(mut rested) = self.write(pipeline) else { break };
            end = regrouping.outgrown(self.shared, &mut rested);
            if end != End::Done {
                break;
            }
        }
        self.team.give_own(0, host.into_own());
        drop(dismissal);
        self.crew.see_off(self.pool);
        end
    }

    /// Waits until all others have left the batch; nothing if this thread panicked between two batches.
    fn write<'l, T>(self, lock: &'l RwLock<T>) -> Option<RwLockWriteGuard<'l, T>> {
        // They are about to: to sleep until they have would take longer.
        let mut guard = None;
        self.pool.spin(|| {
            guard = lock.try_write().ok();
            guard.is_some() || lock.is_poisoned()
        });
        guard.or_else(|| lock.write().ok())
    }

    /// The calling thread's part in a batch; it alone renders if it has kept the screen.
    fn lead(
        self,
        pipeline: &SimPipeline<'_, 's>,
        host: &Host<'s>,
        kept: Option<Screen<'s>>,
    ) -> Option<Screen<'s>> {
        match kept.map(|screen| pipeline.token(screen)).transpose() {
            Ok(token) => self.work(0, pipeline, host, token).map(Token::into_renderer),
            Err((screen, full)) => {
                self.fail(full);
                Some(screen)
            }
        }
    }

    /// A hired thread's life.
    fn attend(self, index: usize, pipeline: &RwLock<SimPipeline<'_, 's>>) {
        self.pool.pin(index);
        let host = Host::new(self.shared, self.team.take_own(index));
        self.crew.report();
        let mut last = 0;
        while let Some(run) = self.crew.await_run(last, self.pool, index) {
            let _guard = OnPanic::new(|| self.crew.abort());
            let pipeline = read(pipeline);
            self.work(index, &pipeline, &host, None);
            // Whoever left because fewer were wanted may be wanted again in the same batch.
            if pipeline.finished() || self.crew.is_aborted() {
                last = run;
            }
        }
        self.team.give_own(index, host.into_own());
        self.crew.leave();
    }

    /// Steps until the batch is done, or until this worker is not wanted any more.
    fn work<'p>(
        self,
        index: usize,
        pipeline: &'p SimPipeline<'_, 's>,
        host: &Host<'s>,
        token: Option<Token<'p, Screen<'s>>>,
    ) -> Option<Token<'p, Screen<'s>>> {
        let clock = StageClock::start(self.timeline, index, self.shared.first_frame);
        let mut worker = pipeline.worker_at(index as u32).probed(clock);
        if let Some(token) = token
            && let Err(token) = worker.hold(token)
        {
            return Some(token);
        }
        while index < self.pool.threads() && !self.crew.is_aborted() {
            match worker.step(host) {
                Ok(Step::Worked(_)) => {}
                Ok(Step::Idle) if pipeline.finished() => break,
                Ok(Step::Idle) => {
                    worker.probe().stop();
                    self.crew.idle(self.pool, &worker);
                }
                Err(full) => self.fail(full),
            }
        }
        self.note(index, worker.probe());
        worker.release()
    }

    /// Notes the times of so many workers without allocating later.
    fn make_room_for(self, workers: usize) {
        let mut report = self.report.lock().unwrap_or_else(PoisonError::into_inner);
        if report.times.len() < workers {
            report.times.resize(workers, Times::default());
        }
    }

    fn note(self, index: usize, clock: &mut StageClock<'_>) {
        let mut report = self.report.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(times) = report.times.get_mut(index) {
            clock.stop();
            times.add(clock.times());
        }
    }

    /// Notes the first failure and makes everybody leave: a frame without some of its
    /// interactions would not be the same for every schedule.
    fn fail(self, full: TableFull) {
        let mut report = self.report.lock().unwrap_or_else(PoisonError::into_inner);
        report.failure.get_or_insert(full);
        drop(report);
        self.crew.abort();
    }

    fn failure(self) -> Option<TableFull> {
        self.report.lock().unwrap_or_else(PoisonError::into_inner).failure
    }
}

fn read<T>(lock: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    lock.read().unwrap_or_else(PoisonError::into_inner)
}
