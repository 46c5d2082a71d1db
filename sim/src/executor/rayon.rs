//! Rayon's work stealing, stage after stage.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::clock::{Clock, Stage, StageSeconds, Timer};
use super::mail::Mail;
use super::world::{self, Candidates, Outbox, Outcome, World};
use super::{Executor, ExecutorError, FrameRecord, MAX_THREADS};
use crate::block::Block;
use crate::blocking::Grain;
use crate::geometry::Bounds;
use crate::interaction::Scratch;
use crate::message::Message;
use crate::object::{Object, ObjectId};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::PairCount;

/// The stages up to update on a rayon pool; the calling thread renders.
pub struct RayonExecutor {
    engine: Engine,
    pool: ThreadPool,
    running: Duration,
}

impl RayonExecutor {
    /// Takes over a scene.
    ///
    /// # Errors
    /// No or too many threads, objects that cannot be grouped, or a pool that cannot be started.
    pub fn new(scene: Scene, grain: Grain, threads: usize) -> Result<Self, ExecutorError> {
        let engine = Engine::new(scene, grain, threads)?;
        Ok(Self { engine, pool: pool(threads)?, running: Duration::ZERO })
    }
}

impl Executor for RayonExecutor {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut dyn FnMut(&FrameRecord),
    ) -> Result<(), ExecutorError> {
        let began = Instant::now();
        for _ in 0..frames {
            let frame = self.engine.frame;
            let pairs = self.pool.install(|| self.engine.compute(|_, _| ()));
            {
                let _timer = self.engine.workers[0].clock.time(Stage::Render);
                for block in &self.engine.world.blocks {
                    self.engine.world.stages.render(block, renderer);
                }
                renderer.swap(frame);
            }
            on_frame(&FrameRecord { frame, swapped: Instant::now(), pairs });
        }
        self.running += began.elapsed();
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.engine.frame
    }

    fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        world::visit(&self.engine.world.blocks, visit);
    }

    fn post(&mut self, to: ObjectId, message: Message) {
        self.engine.mail.collect(ObjectId::HOST, to, message);
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        self.engine.stage_seconds(self.running)
    }
}

/// A pool of so many threads.
pub(super) fn pool(threads: usize) -> Result<ThreadPool, ExecutorError> {
    Ok(ThreadPoolBuilder::new().num_threads(threads).build()?)
}

/// The stages up to update as rayon loops, to be called from inside a pool.
pub(super) struct Engine {
    pub(super) world: World,
    pub(super) mail: Mail,
    pub(super) workers: Vec<Worker>,
    pub(super) frame: u64,
    bounds: Vec<Bounds>,
    found: Vec<Vec<u32>>,
    candidates: Candidates,
    outcomes: Vec<Outcome>,
    outboxes: Vec<Outbox>,
}

/// What belongs to one thread of the pool. The lock is never contended.
#[derive(Default)]
pub(super) struct Worker {
    scratch: Mutex<Scratch>,
    pub(super) clock: Clock,
}

impl Engine {
    pub(super) fn new(scene: Scene, grain: Grain, threads: usize) -> Result<Self, ExecutorError> {
        if !(1..=MAX_THREADS).contains(&threads) {
            return Err(ExecutorError::Threads { threads });
        }
        let world = World::new(scene, grain, threads)?;
        let blocks = world.blocks.len();
        Ok(Self {
            mail: Mail::new(),
            workers: (0..threads).map(|_| Worker::default()).collect(),
            frame: 0,
            bounds: Vec::with_capacity(blocks),
            found: (0..blocks).map(|_| world::found_list()).collect(),
            candidates: Candidates::new(blocks),
            outcomes: (0..world::first_outcomes(blocks)).map(|_| Outcome::new()).collect(),
            outboxes: (0..blocks).map(|_| world::outbox()).collect(),
            world,
        })
    }

    /// Computes the next frame. `updated` is shown each block right after its update.
    pub(super) fn compute(&mut self, updated: impl Fn(usize, &Block) + Sync) -> PairCount {
        if self.world.regroups_before(self.frame) {
            self.world.regroup();
        }
        self.mail.turn();
        self.broad_phase();
        let pairs = self.interact();
        self.update(updated);
        self.frame += 1;
        pairs
    }

    fn broad_phase(&mut self) {
        let World { stages, blocks, partners, .. } = &self.world;
        self.bounds.clear();
        self.bounds.extend(blocks.iter().map(Block::bounds));
        let (bounds, workers) = (&self.bounds, &self.workers);
        let timed = || this(workers).clock.time(Stage::BroadPhase);
        self.found.par_iter_mut().enumerate().for_each_init(timed, |_, (first, found)| {
            let may_touch = |second: usize| {
                let (first, second) = world::pair(blocks, [first as u32, second as u32]);
                world::may_touch(stages, first, second)
            };
            partners.find(first, bounds, may_touch, found);
        });
        self.candidates.clear();
        for (first, found) in self.found.iter().enumerate() {
            self.candidates.extend(first, found);
        }
    }

    fn interact(&mut self) -> PairCount {
        let World { stages, blocks, .. } = &self.world;
        let pairs = &self.candidates.pairs;
        if self.outcomes.len() < pairs.len() {
            self.outcomes.resize_with(pairs.len(), Outcome::new);
        }
        let workers = &self.workers;
        let outcomes = &mut self.outcomes[..pairs.len()];
        let begin = || begin(workers, Stage::Interaction);
        outcomes.par_iter_mut().zip(pairs).for_each_init(
            begin,
            |(_timer, scratch), (outcome, &pair)| {
                let (first, second) = world::pair(blocks, pair);
                outcome.compute(stages, first, second, scratch);
            },
        );
        outcomes.iter().fold(PairCount::default(), |mut sum, outcome| {
            sum += outcome.pairs;
            sum
        })
    }

    fn update(&mut self, updated: impl Fn(usize, &Block) + Sync) {
        let World { stages, blocks, .. } = &mut self.world;
        let (candidates, outcomes, workers) = (&self.candidates, &self.outcomes, &self.workers);
        let (frame, mail) = (self.frame, &self.mail);
        let timed = || this(workers).clock.time(Stage::Update);
        let work = blocks.par_iter_mut().zip(&mut self.outboxes).enumerate();
        work.for_each_init(timed, |_, (index, (block, outbox))| {
            let outcomes = candidates.of_block(index).map(|place| &outcomes[place]);
            outcomes.flat_map(Outcome::segments).for_each(|segment| block.receive(segment));
            let mut post = |from, to, message| outbox.push((from, to, message));
            stages.update(frame, block, mail.letters(), &mut post);
            updated(index, block);
        });
        for outbox in &mut self.outboxes {
            world::empty_into(outbox, &mut self.mail);
        }
    }

    pub(super) fn stage_seconds(&self, running: Duration) -> Vec<StageSeconds> {
        self.workers.iter().map(|worker| worker.clock.seconds(running)).collect()
    }
}

/// The worker of the calling thread of the pool.
fn this(workers: &[Worker]) -> &Worker {
    &workers[rayon::current_thread_index().unwrap_or(0)]
}

/// The calling thread's scratch memory, and the time it is used for a stage.
fn begin(workers: &[Worker], stage: Stage) -> (Timer<'_>, MutexGuard<'_, Scratch>) {
    let worker = this(workers);
    (worker.clock.time(stage), worker.scratch.lock().unwrap_or_else(PoisonError::into_inner))
}
