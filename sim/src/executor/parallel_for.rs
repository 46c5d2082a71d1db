//! Stage after stage, each a parallel loop.

use std::sync::Arc;

use super::clock::{Running, Stage, StageSeconds};
use super::engine::Engine;
use super::{Executor, ExecutorError, FrameRecord, OnFrame, Refused, world};
use crate::blocking::Grain;
use crate::mailbox::Mailbox;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};
use crate::timeline::Timeline;

/// Parallel loops on a fixed number of threads.
pub trait ParallelFor: Sized + Send + Sync {
    /// Whether threads take up items one by one in their order: those that take longest had better come first then.
    const IN_ORDER: bool = false;

    /// Loops on so many threads, at least 1.
    ///
    /// # Errors
    /// The threads cannot be had.
    fn new(threads: usize) -> Result<Self, ExecutorError>;

    /// Does `work` where loops are begun at the least cost.
    fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        work()
    }

    /// The number of the thread that calls; 0 for one that has none.
    fn worker(&self) -> usize {
        0
    }

    /// Calls `body` with every item and its place, once. A thread that takes up some items calls
    /// `begin` first, with its number, below the number of threads; what it gives is kept until the
    /// thread has done them. A number belongs to one thread at a time.
    ///
    /// # Panics
    /// If `body` does.
    fn for_each<T: Send, S>(
        &self,
        items: &mut [T],
        begin: impl Fn(usize) -> S + Sync + Send,
        body: impl Fn(&mut S, usize, &mut T) + Sync + Send,
    );
}

/// Broad phase, interaction and update as a parallel loop each; then one thread renders.
pub struct LoopExecutor<P> {
    engine: Engine,
    loops: P,
    running: Running,
}

impl<P: ParallelFor> LoopExecutor<P> {
    /// Takes over a scene.
    ///
    /// # Errors
    /// No or too many threads, objects that cannot be grouped, or threads that cannot be had.
    pub fn new(scene: Scene, grain: Grain, threads: usize) -> Result<Self, Box<Refused>> {
        let (scene, loops) = Refused::unless(scene, grain, threads, || P::new(threads))?;
        let engine = Engine::new(scene, grain, threads);
        Ok(Self { engine, loops, running: Running::new() })
    }
}

impl<P: ParallelFor> Executor for LoopExecutor<P> {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        let Self { engine, loops, running } = self;
        running.begin();
        engine.world.outside.begin(engine.frame);
        if renderer.is_bound() {
            for _ in 0..frames {
                let pairs = loops.enter(|| engine.compute(loops, |_, _| ()));
                render(engine, loops.worker(), pairs, running, renderer, on_frame);
            }
        } else {
            loops.enter(|| {
                for _ in 0..frames {
                    let pairs = engine.compute(loops, |_, _| ());
                    render(engine, loops.worker(), pairs, running, renderer, on_frame);
                }
            });
        }
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.engine.frame
    }

    fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        world::visit(&self.engine.world.blocks, visit);
    }

    fn mailbox(&self) -> &Mailbox {
        self.engine.world.outside.mailbox()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        self.engine.world.change(change);
    }

    fn into_scene(self: Box<Self>) -> Scene {
        self.engine.into_scene()
    }

    fn watch(&mut self, timeline: Arc<Timeline>) {
        self.engine.watch(&timeline);
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        self.engine.stage_seconds(&self.running)
    }
}

/// Renders the frame that was computed, as this worker, and counts it.
fn render(
    engine: &mut Engine,
    worker: usize,
    pairs: PairCount,
    running: &mut Running,
    renderer: &mut dyn Renderer,
    on_frame: &mut OnFrame<'_>,
) {
    let frame = engine.frame;
    let clock = &engine.workers[worker].clock;
    {
        let _timer = clock.time(Stage::Render, frame);
        for block in &engine.world.blocks {
            engine.world.stages.render(block, renderer);
        }
        renderer.swap(frame);
    }
    on_frame(&FrameRecord { frame, swapped: running.swapped(frame, clock), pairs });
    engine.world.outside.swapped(frame);
    engine.frame += 1;
}
