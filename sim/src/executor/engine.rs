//! The stages up to update as parallel loops.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::clock::{Clock, Running, Stage, StageSeconds, Timer};
use super::mail::Mail;
use super::parallel_for::ParallelFor;
use super::world::{self, Candidates, Outbox, Outcome, World};
use crate::behavior::{Room, Workspace};
use crate::block::Block;
use crate::blocking::Grain;
use crate::geometry::Bounds;
use crate::interaction::Scratch;
use crate::scene::Scene;
use crate::stages::PairCount;
use crate::timeline::Timeline;

/// An environment that is computed loop by loop.
pub(super) struct Engine {
    pub(super) world: World,
    pub(super) workers: Vec<Worker>,
    pub(super) frame: u64,
    bounds: Vec<Bounds>,
    found: Vec<Vec<u32>>,
    candidates: Candidates,
    outcomes: Vec<Outcome>,
}

/// What belongs to one thread. The locks are never contended: a thread does one callback after the other.
pub(super) struct Worker {
    pub(super) clock: Clock,
    scratch: Mutex<Scratch>,
    updating: Mutex<Updating>,
}

/// What the updates of a thread need.
pub(super) struct Updating {
    pub(super) workspace: Workspace,
    pub(super) outbox: Outbox,
}

impl Worker {
    /// What belongs to a thread that may have to update all of these blocks.
    pub(super) fn new(blocks: &[Block]) -> Self {
        let workspace = Workspace::with_room(Room::of(blocks.iter()));
        let updating = Mutex::new(Updating { workspace, outbox: world::outbox(blocks.len()) });
        Self { clock: Clock::default(), scratch: Mutex::default(), updating }
    }

    /// What interactions need, and their time.
    pub(super) fn begin_interaction(&self, frame: u64) -> (Timer<'_>, MutexGuard<'_, Scratch>) {
        (self.clock.time(Stage::Interaction, frame), lock(&self.scratch))
    }

    /// What updates need, and their time.
    pub(super) fn begin_update(&self, frame: u64) -> (Timer<'_>, MutexGuard<'_, Updating>) {
        (self.clock.time(Stage::Update, frame), lock(&self.updating))
    }

    /// Moves what was sent to the next frame's mail.
    pub(super) fn collect(workers: &[Self], mail: &mut Mail) {
        for worker in workers {
            world::empty_into(&mut lock(&worker.updating).outbox, mail);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Engine {
    /// Of a scene whose objects can be grouped.
    pub(super) fn new(scene: Scene, grain: Grain, threads: usize) -> Self {
        let frame = scene.frame;
        let world = World::new(scene, grain, threads);
        let blocks = world.blocks.len();
        Self {
            workers: (0..threads).map(|_| Worker::new(&world.blocks)).collect(),
            frame,
            bounds: Vec::with_capacity(blocks),
            found: (0..blocks).map(|_| world::found_list()).collect(),
            candidates: Candidates::new(blocks),
            outcomes: world::first_outcomes(blocks, grain),
            world,
        }
    }

    /// Computes the frame [`Self::frame`], which is then to be counted. `updated` is shown each block right
    /// after its update.
    pub(super) fn compute<P: ParallelFor>(
        &mut self,
        loops: &P,
        updated: impl Fn(usize, &Block) + Sync + Send,
    ) -> PairCount {
        if self.world.regroups_before(self.frame) {
            self.world.regroup(P::IN_ORDER);
        }
        self.world.mail.turn();
        self.broad_phase(loops);
        let pairs = self.interact(loops);
        self.update(loops, updated);
        pairs
    }

    fn broad_phase(&mut self, loops: &impl ParallelFor) {
        let World { stages, blocks, partners, .. } = &self.world;
        self.bounds.clear();
        self.bounds.extend(blocks.iter().map(Block::bounds));
        let (bounds, workers, frame) = (&self.bounds, &self.workers, self.frame);
        let begin = |worker: usize| workers[worker].clock.time(Stage::BroadPhase, frame);
        loops.for_each(&mut self.found, begin, |_timer, first, found| {
            partners.find(first, stages, bounds, |index| &blocks[index], found);
        });
        self.candidates.clear();
        for (first, found) in self.found.iter().enumerate() {
            self.candidates.extend(first, found);
        }
    }

    fn interact(&mut self, loops: &impl ParallelFor) -> PairCount {
        let World { stages, blocks, .. } = &self.world;
        let pairs = &self.candidates.pairs;
        if self.outcomes.len() < pairs.len() {
            self.outcomes.resize_with(pairs.len(), Outcome::default);
        }
        let (workers, frame) = (&self.workers, self.frame);
        let outcomes = &mut self.outcomes[..pairs.len()];
        let begin = |worker: usize| workers[worker].begin_interaction(frame);
        loops.for_each(outcomes, begin, |(_timer, scratch), place, outcome| {
            let (first, second) = world::pair(blocks, pairs[place]);
            outcome.compute(stages, first, second, scratch);
        });
        outcomes.iter().fold(PairCount::default(), |mut sum, outcome| {
            sum += outcome.pairs;
            sum
        })
    }

    fn update(&mut self, loops: &impl ParallelFor, updated: impl Fn(usize, &Block) + Sync + Send) {
        let World { stages, blocks, mail, outside, .. } = &mut self.world;
        let (candidates, outcomes, workers) = (&self.candidates, &self.outcomes, &self.workers);
        let (frame, from_outside) = (self.frame, outside.due(self.frame));
        let letters = |object| mail.to(object).chain(from_outside.to(object));
        let begin = |worker: usize| workers[worker].begin_update(frame);
        loops.for_each(blocks, begin, |(_timer, updating), index, block| {
            let Updating { workspace, outbox } = &mut **updating;
            let outcomes = candidates.of_block(index).map(|place| &outcomes[place]);
            let results = outcomes.map(Outcome::records);
            let mut post = |from, to, message| outbox.push((from, to, message));
            stages.update(frame, block, results, workspace, letters, &mut post);
            updated(index, block);
        });
        Worker::collect(&self.workers, mail);
    }

    pub(super) fn into_scene(self) -> Scene {
        self.world.into_scene(self.frame)
    }

    pub(super) fn watch(&self, timeline: &Arc<Timeline>) {
        for (index, worker) in self.workers.iter().enumerate() {
            worker.clock.watch(Arc::clone(timeline), index);
        }
    }

    pub(super) fn stage_seconds(&self, running: &Running) -> Vec<StageSeconds> {
        self.workers.iter().map(|worker| worker.clock.seconds(running)).collect()
    }
}
