//! Long-lived threads with equal shares fixed beforehand.

use std::mem;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::JoinHandle;

use super::barrier::Barrier;
use super::clock::{Clock, Running, Stage, StageSeconds, Timer};
use super::mail::Mail;
use super::on_panic::OnPanic;
use super::outside::Outside;
use super::world::{self, Candidates, Outbox, Outcome, Partners, World};
use super::{Executor, ExecutorError, FrameRecord, OnFrame, Refused};
use crate::behavior::{Room, Workspace};
use crate::block::Block;
use crate::blocking::{Blocking, Grain};
use crate::geometry::Bounds;
use crate::interaction::Scratch;
use crate::mailbox::Mailbox;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};
use crate::timeline::Timeline;

/// Long-lived threads, each with its equal share of blocks and of candidates, and a barrier after each
/// stage. The calling thread is one of them, and renders while the others wait.
pub struct StaticExecutor {
    team: Team,
    shared: Arc<Shared>,
    blocking: Blocking,
    /// Room for the blocks while they are formed anew.
    spare: Vec<Block>,
    own: Own,
    grain: Grain,
    running: Running,
    frame: u64,
}

/// What the threads share. The barriers keep them apart, so no lock is ever contended for writing.
struct Shared {
    blocks: Vec<RwLock<Block>>,
    found: Vec<Mutex<Vec<u32>>>,
    /// Each thread's, for its share of the candidates.
    outcomes: Vec<RwLock<Vec<Outcome>>>,
    outboxes: Vec<Mutex<Outbox>>,
    plan: RwLock<Plan>,
    barrier: Barrier,
    clocks: Vec<Clock>,
    frame: AtomicU64,
    stop: AtomicBool,
    outside: Arc<Outside>,
    room: Room,
}

/// What each thread has for itself.
struct Own {
    scratch: Scratch,
    workspace: Workspace,
}

/// All threads but the calling one.
struct Team {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// What the calling thread prepares for all.
struct Plan {
    stages: Stages,
    partners: Partners,
    bounds: Vec<Bounds>,
    candidates: Candidates,
    mail: Mail,
}

impl StaticExecutor {
    /// Takes over a scene.
    ///
    /// # Errors
    /// No or too many threads, objects that cannot be grouped, or a thread that cannot be started.
    pub fn new(scene: Scene, grain: Grain, threads: usize) -> Result<Self, Box<Refused>> {
        let (scene, waiting) = Refused::unless(scene, grain, threads, || start(threads))?;
        let frame = scene.frame;
        let world = World::new(scene, grain, threads);
        let count = world.blocks.len();
        let plan = Plan {
            stages: world.stages,
            partners: world.partners,
            bounds: Vec::with_capacity(count),
            candidates: Candidates::new(count),
            mail: world.mail,
        };
        let room = Room::of(world.blocks.iter());
        let outcomes = || RwLock::new(world::first_outcomes(count.div_ceil(threads), grain));
        let shared = Arc::new(Shared {
            blocks: world.blocks.into_iter().map(RwLock::new).collect(),
            found: (0..count).map(|_| Mutex::new(world::found_list())).collect(),
            outcomes: (0..threads).map(|_| outcomes()).collect(),
            outboxes: (0..count).map(|_| Mutex::new(world::outbox(1))).collect(),
            plan: RwLock::new(plan),
            barrier: Barrier::new(threads),
            clocks: (0..threads).map(|_| Clock::default()).collect(),
            frame: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            outside: world.outside,
            room,
        });
        let threads = waiting.into_iter().map(|thread| thread.begin(&shared)).collect();
        let team = Team { threads, shared: Arc::clone(&shared) };
        let (blocking, spare) = (world.blocking, Vec::with_capacity(count));
        let (own, running) = (Own::new(room), Running::new());
        Ok(Self { team, shared, blocking, spare, own, grain, running, frame })
    }

    /// Forms the blocks anew.
    fn regroup(&mut self) {
        let blocks = || self.shared.blocks.iter().map(write);
        self.spare.extend(blocks().map(|mut block| mem::take(&mut *block)));
        self.blocking.split(&mut self.spare);
        for (mut block, formed) in blocks().zip(self.spare.drain(..)) {
            *block = formed;
        }
    }

    /// Prepares the next frame while the other threads wait.
    fn prepare(&mut self) {
        if world::regroups_before(self.grain, self.frame) {
            self.regroup();
        }
        let mut plan = write(&self.shared.plan);
        plan.mail.turn();
        plan.bounds.clear();
        plan.bounds.extend(self.shared.blocks.iter().map(|block| read(block).bounds()));
        self.shared.frame.store(self.frame, Ordering::Relaxed);
    }

    fn render(&self, renderer: &mut dyn Renderer) {
        let _timer = self.shared.clocks[0].time(Stage::Render, self.frame);
        let plan = read(&self.shared.plan);
        for block in &self.shared.blocks {
            plan.stages.render(&read(block), renderer);
        }
        renderer.swap(self.frame);
    }
}

/// A thread that waits for what it is to share; without it, it ends.
struct Waiting {
    share: Sender<Arc<Shared>>,
    thread: JoinHandle<()>,
}

/// Starts all threads but the calling one.
fn start(threads: usize) -> Result<Vec<Waiting>, ExecutorError> {
    let start = |worker| {
        let (share, shared) = channel::<Arc<Shared>>();
        let work = move || shared.iter().for_each(|shared| shared.work(worker));
        let builder = std::thread::Builder::new().name(format!("static {worker}"));
        Ok(Waiting { share, thread: builder.spawn(work).map_err(ExecutorError::Spawn)? })
    };
    (1..threads).map(start).collect()
}

impl Waiting {
    fn begin(self, shared: &Arc<Shared>) -> JoinHandle<()> {
        // It waits: nothing else has its receiver.
        let _ = self.share.send(Arc::clone(shared));
        self.thread
    }
}

impl Own {
    fn new(room: Room) -> Self {
        Self { scratch: Scratch::new(), workspace: Workspace::with_room(room) }
    }
}

impl Shared {
    /// A thread's life: frames until it is told to stop.
    fn work(&self, worker: usize) {
        let mut own = Own::new(self.room);
        loop {
            self.barrier.wait();
            if self.stop.load(Ordering::Relaxed) {
                return;
            }
            self.compute(worker, &mut own);
        }
    }

    /// One thread's share of a frame.
    fn compute(&self, worker: usize, own: &mut Own) {
        let _guard = OnPanic::new(|| self.barrier.break_off());
        self.broad_phase(worker);
        self.barrier.wait();
        if worker == 0 {
            self.collect();
        }
        self.barrier.wait();
        self.interact(worker, &mut own.scratch);
        self.barrier.wait();
        self.update(worker, &mut own.workspace);
        self.barrier.wait();
    }

    fn broad_phase(&self, worker: usize) {
        let _timer = self.time(worker, Stage::BroadPhase);
        let plan = read(&self.plan);
        for first in self.share(worker, self.blocks.len()) {
            let block = |index: usize| read(&self.blocks[index]);
            let found = &mut lock(&self.found[first]);
            plan.partners.find(first, &plan.stages, &plan.bounds, block, found);
        }
    }

    /// Makes one list of what the broad phase found.
    fn collect(&self) {
        let mut plan = write(&self.plan);
        plan.candidates.clear();
        for (first, found) in self.found.iter().enumerate() {
            plan.candidates.extend(first, &lock(found));
        }
    }

    fn interact(&self, worker: usize, scratch: &mut Scratch) {
        let _timer = self.time(worker, Stage::Interaction);
        let plan = read(&self.plan);
        let pairs = &plan.candidates.pairs[self.share(worker, plan.candidates.pairs.len())];
        let mut outcomes = write(&self.outcomes[worker]);
        if outcomes.len() < pairs.len() {
            outcomes.resize_with(pairs.len(), Outcome::default);
        }
        for (&[first, second], outcome) in pairs.iter().zip(&mut *outcomes) {
            let other = (first != second).then(|| read(&self.blocks[second as usize]));
            let first = read(&self.blocks[first as usize]);
            outcome.compute(&plan.stages, &first, other.as_deref(), scratch);
        }
    }

    fn update(&self, worker: usize, workspace: &mut Workspace) {
        let _timer = self.time(worker, Stage::Update);
        let frame = self.frame.load(Ordering::Relaxed);
        let plan = read(&self.plan);
        let from_outside = self.outside.due(frame);
        let letters = |object| plan.mail.to(object).chain(from_outside.to(object));
        let outcomes: Vec<_> = self.outcomes.iter().map(read).collect();
        let pairs = plan.candidates.pairs.len();
        for index in self.share(worker, self.blocks.len()) {
            let results = plan.candidates.of_block(index).map(|place| {
                let sharer = self.sharer(place, pairs);
                outcomes[sharer][place - self.share(sharer, pairs).start].records()
            });
            let mut outbox = lock(&self.outboxes[index]);
            let mut post = |from, to, message| outbox.push((from, to, message));
            let mut block = write(&self.blocks[index]);
            plan.stages.update(frame, &mut block, results, workspace, letters, &mut post);
        }
    }

    fn time(&self, worker: usize, stage: Stage) -> Timer<'_> {
        // Relaxed: the barrier lies between.
        self.clocks[worker].time(stage, self.frame.load(Ordering::Relaxed))
    }

    /// A worker's part of so many items.
    fn share(&self, worker: usize, items: usize) -> Range<usize> {
        let workers = self.clocks.len();
        items * worker / workers..items * (worker + 1) / workers
    }

    /// The worker whose part of so many items the one at `place` is in.
    fn sharer(&self, place: usize, items: usize) -> usize {
        ((place + 1) * self.clocks.len() - 1) / items
    }

    /// What the last frame's interactions counted; its messages go to the mail.
    fn finish(&self) -> PairCount {
        let mut plan = write(&self.plan);
        for outbox in &self.outboxes {
            world::empty_into(&mut lock(outbox), &mut plan.mail);
        }
        let mut sum = PairCount::default();
        for (worker, outcomes) in self.outcomes.iter().enumerate() {
            let share = self.share(worker, plan.candidates.pairs.len());
            read(outcomes).iter().take(share.len()).for_each(|outcome| sum += outcome.pairs);
        }
        sum
    }
}

impl Executor for StaticExecutor {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        self.running.begin();
        self.shared.outside.begin(self.frame);
        for _ in 0..frames {
            self.prepare();
            self.shared.barrier.wait();
            self.shared.compute(0, &mut self.own);
            let pairs = self.shared.finish();
            self.render(renderer);
            let swapped = self.running.swapped(self.frame, &self.shared.clocks[0]);
            on_frame(&FrameRecord { frame: self.frame, swapped, pairs });
            self.shared.outside.swapped(self.frame);
            self.frame += 1;
        }
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.frame
    }

    fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        for block in &self.shared.blocks {
            read(block).objects().iter().for_each(&mut *visit);
        }
    }

    fn mailbox(&self) -> &Mailbox {
        self.shared.outside.mailbox()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        let mut plan = write(&self.shared.plan);
        if world::changes_pairs(&mut plan.stages, change) {
            let blocks = &self.shared.blocks;
            let block = |index: usize| read(&blocks[index]);
            plan.partners = Partners::new(&plan.stages, self.grain, blocks.len(), block);
        }
    }

    fn into_scene(self: Box<Self>) -> Scene {
        let Self { team, shared, frame, .. } = *self;
        drop(team);
        let Some(Shared { blocks, plan, outside, .. }) = Arc::into_inner(shared) else {
            unreachable!("the other threads have ended")
        };
        let Plan { stages, mail, .. } = plan.into_inner().unwrap_or_else(PoisonError::into_inner);
        let blocks = blocks.into_iter().map(RwLock::into_inner);
        let blocks = blocks.map(|block| block.unwrap_or_else(PoisonError::into_inner));
        let objects = blocks.flat_map(|block| block.objects);
        world::scene(objects, stages, frame, mail.into_letters(frame), &outside)
    }

    fn watch(&mut self, timeline: Arc<Timeline>) {
        for (index, clock) in self.shared.clocks.iter().enumerate() {
            clock.watch(Arc::clone(&timeline), index);
        }
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        self.shared.clocks.iter().map(|clock| clock.seconds(&self.running)).collect()
    }
}

impl Drop for Team {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if !self.shared.barrier.is_broken() {
            // Between two frames all others are waiting, also if a renderer panicked.
            self.shared.barrier.arrive();
        }
        for thread in self.threads.drain(..) {
            // A thread ends by panic only through a fault of the executor's own; there is nobody to
            // tell any more.
            let _ = thread.join();
        }
    }
}

fn read<T>(lock: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    lock.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(lock: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    lock.write().unwrap_or_else(PoisonError::into_inner)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
