//! oneTBB's `parallel_pipeline`.

use std::sync::Arc;
use std::thread;

use super::super::clock::{Running, Stage, StageSeconds};
use super::super::engine::{Updating, Worker};
use super::super::parallel_for::ParallelFor;
use super::super::world::{self, Candidates, Outcome, World};
use super::super::{Executor, ExecutorError, FrameRecord, OnFrame, Refused};
use super::shim::Tbb;
use crate::block::Block;
use crate::blocking::Grain;
use crate::geometry::Bounds;
use crate::mailbox::Mailbox;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};
use crate::timeline::Timeline;

/// Two oneTBB pipelines a frame: blocks are searched for partners and interact with them, in
/// parallel, and what that gave is listed in order; then blocks are updated, in parallel, and rendered
/// in order, beside the updates of later blocks.
///
/// They cannot be one: an update needs the interactions of blocks that come after it, and a filter
/// knows only its own token.
///
/// oneTBB runs a serial filter on any thread, and has no filter that is bound to one any more. Where the renderer
/// [is bound](Renderer::is_bound) to the calling thread, the render filter renders when that thread comes by,
/// everything that has been updated so far; otherwise it leaves its block to the next time. What is left in the end
/// the calling thread renders behind the pipeline.
pub struct TbbPipelineExecutor {
    world: World,
    arena: Tbb,
    workers: Vec<Worker>,
    bounds: Vec<Bounds>,
    searches: Vec<Search>,
    candidates: Candidates,
    /// For each block the place of its first search result among the candidates.
    first_places: Vec<usize>,
    running: Running,
    frame: u64,
}

/// What the first pipeline finds for a block: its partners, and what interacting with each gave.
struct Search {
    found: Vec<u32>,
    outcomes: Vec<Outcome>,
}

impl TbbPipelineExecutor {
    /// Takes over a scene.
    ///
    /// # Errors
    /// No or too many threads, or objects that cannot be grouped.
    pub fn new(scene: Scene, grain: Grain, threads: usize) -> Result<Self, Box<Refused>> {
        let (scene, arena) = Refused::unless(scene, grain, threads, || Tbb::new(threads))?;
        let frame = scene.frame;
        let world = World::new(scene, grain, threads);
        let blocks = world.blocks.len();
        Ok(Self {
            arena,
            workers: (0..threads).map(|_| Worker::new(&world.blocks)).collect(),
            bounds: Vec::with_capacity(blocks),
            searches: (0..blocks).map(|_| Search::new(grain)).collect(),
            candidates: Candidates::new(blocks),
            first_places: Vec::with_capacity(blocks),
            running: Running::new(),
            frame,
            world,
        })
    }

    fn prepare(&mut self) {
        if self.world.regroups_before(self.frame) {
            self.world.regroup(true);
        }
        self.world.mail.turn();
        self.bounds.clear();
        self.bounds.extend(self.world.blocks.iter().map(Block::bounds));
    }

    /// The first pipeline.
    fn interact(&mut self) -> PairCount {
        let Self { world, workers, bounds, candidates, first_places, frame, .. } = self;
        let mut pairs = PairCount::default();
        candidates.clear();
        first_places.clear();
        self.arena.pipeline(
            &mut self.searches,
            |worker, first, search| search.run(world, bounds, first, &workers[worker], *frame),
            |_, first, search| {
                first_places.push(candidates.pairs.len());
                candidates.extend(first, &search.found);
                search.outcomes().for_each(|outcome| pairs += outcome.pairs);
            },
        );
        pairs
    }

    /// The second pipeline.
    fn update(&mut self, renderer: &mut dyn Renderer) {
        let Self { searches, workers, candidates, first_places, frame, .. } = self;
        let World { stages, blocks, mail, outside, .. } = &mut self.world;
        let from_outside = outside.due(*frame);
        let letters = |object| mail.to(object).chain(from_outside.to(object));
        let outcome = |place: usize| {
            let first = candidates.pairs[place][0] as usize;
            &searches[first].outcomes[place - first_places[first]]
        };
        let work = |worker: usize, index: usize, block: &mut Block| {
            let (_timer, mut updating) = workers[worker].begin_update(*frame);
            let Updating { workspace, outbox } = &mut *updating;
            let results = candidates.of_block(index).map(outcome).map(Outcome::records);
            let mut post = |from, to, message| outbox.push((from, to, message));
            stages.update(*frame, block, results, workspace, letters, &mut post);
        };
        let mut waiting: Vec<&Block> = Vec::with_capacity(blocks.len());
        let (caller, is_bound) = (thread::current().id(), renderer.is_bound());
        self.arena.pipeline(blocks, work, |worker, _, block| {
            waiting.push(block);
            if !is_bound || thread::current().id() == caller {
                let _timer = workers[worker].clock.time(Stage::Render, *frame);
                waiting.drain(..).for_each(|block| stages.render(block, renderer));
            }
        });
        let _timer = workers[0].clock.time(Stage::Render, *frame);
        waiting.drain(..).for_each(|block| stages.render(block, renderer));
        renderer.swap(*frame);
        Worker::collect(workers, mail);
    }
}

impl Search {
    fn new(grain: Grain) -> Self {
        Self { found: world::found_list(), outcomes: world::first_outcomes(1, grain) }
    }

    /// Finds the partners of block `first`, and lets it interact with them.
    fn run(&mut self, world: &World, bounds: &[Bounds], first: usize, worker: &Worker, frame: u64) {
        let World { stages, blocks, partners, .. } = world;
        let timer = worker.clock.time(Stage::BroadPhase, frame);
        partners.find(first, stages, bounds, |index| &blocks[index], &mut self.found);
        drop(timer);
        if self.outcomes.len() < self.found.len() {
            self.outcomes.resize_with(self.found.len(), Outcome::default);
        }
        let (_timer, mut scratch) = worker.begin_interaction(frame);
        for (&second, outcome) in self.found.iter().zip(&mut self.outcomes) {
            let (first, second) = world::pair(blocks, [first as u32, second]);
            outcome.compute(stages, first, second, &mut scratch);
        }
    }

    fn outcomes(&self) -> impl Iterator<Item = &Outcome> {
        self.outcomes.iter().take(self.found.len())
    }
}

impl Executor for TbbPipelineExecutor {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        self.running.begin();
        self.world.outside.begin(self.frame);
        for _ in 0..frames {
            self.prepare();
            let pairs = self.interact();
            self.update(renderer);
            let swapped = self.running.swapped(self.frame, &self.workers[0].clock);
            on_frame(&FrameRecord { frame: self.frame, swapped, pairs });
            self.world.outside.swapped(self.frame);
            self.frame += 1;
        }
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.frame
    }

    fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        world::visit(&self.world.blocks, visit);
    }

    fn mailbox(&self) -> &Mailbox {
        self.world.outside.mailbox()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        self.world.change(change);
    }

    fn into_scene(self: Box<Self>) -> Scene {
        self.world.into_scene(self.frame)
    }

    fn watch(&mut self, timeline: Arc<Timeline>) {
        for (index, worker) in self.workers.iter().enumerate() {
            worker.clock.watch(Arc::clone(&timeline), index);
        }
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        self.workers.iter().map(|worker| worker.clock.seconds(&self.running)).collect()
    }
}
