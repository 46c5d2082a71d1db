//! Rayon, with each frame rendered from a copy beside the next frame.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, Builder};

use super::clock::{Clock, Running, Stage, StageSeconds};
use super::engine::Engine;
use super::parallel_for::ParallelFor;
use super::rayon::RayonLoops;
use super::{Executor, ExecutorError, FrameRecord, OnFrame, Refused, world};
use crate::block::Block;
use crate::blocking::Grain;
use crate::mailbox::Mailbox;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages, draw};
use crate::timeline::Timeline;

/// As [`RayonExecutor`], but every update also copies what a renderer sees, and the calling thread
/// renders that copy while the pool computes the next frame: rendering overlaps without the pipeline. The calling
/// thread is one more than the pool's, and each call starts another, which waits for the pool. Callbacks must not use
/// rayon, as there.
///
/// [`RayonExecutor`]: super::RayonExecutor
pub struct RayonOverlappedExecutor {
    engine: Engine,
    loops: RayonLoops,
    pictures: Vec<Picture>,
    /// The frame to be shown next: the engine is ahead while it runs.
    frame: u64,
    /// The calling thread's.
    clock: Clock,
    running: Running,
}

/// What a renderer sees of one frame, block by block. The locks are never contended.
type Picture = Vec<Mutex<Vec<Object>>>;

/// One picture is rendered while the next is taken.
const PICTURES: usize = 2;

impl RayonOverlappedExecutor {
    /// Takes over a scene.
    ///
    /// # Errors
    /// No or too many threads, objects that cannot be grouped, or a pool that cannot be started.
    pub fn new(scene: Scene, grain: Grain, threads: usize) -> Result<Self, Box<Refused>> {
        let (scene, loops) = Refused::unless(scene, grain, threads, || RayonLoops::new(threads))?;
        let engine = Engine::new(scene, grain, threads);
        let mut pictures = Vec::with_capacity(PICTURES);
        pictures.resize_with(PICTURES, || picture(&engine.world.blocks));
        let frame = engine.frame;
        let (clock, running) = (Clock::default(), Running::new());
        Ok(Self { engine, loops, pictures, frame, clock, running })
    }
}

impl Executor for RayonOverlappedExecutor {
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        self.running.begin();
        let (used, unused) = sync_channel(PICTURES);
        let (taken_in, taken_out) = sync_channel(PICTURES);
        // One that a panicking renderer held is gone.
        self.pictures.resize_with(PICTURES, || picture(&self.engine.world.blocks));
        for picture in self.pictures.drain(..) {
            give_back(&used, picture);
        }
        let outside = Arc::clone(&self.engine.world.outside);
        let (engine, loops) = (&mut self.engine, &self.loops);
        let unused = thread::scope(|scope| {
            let work = move || {
                // Not where there is no thread: what came from outside is taken, and recorded, with this.
                engine.world.outside.begin(engine.frame);
                loops.enter(|| compute(engine, loops, frames, unused, &taken_in))
            };
            let computing =
                Builder::new().spawn_scoped(scope, work).map_err(ExecutorError::Spawn)?;
            // Both ends are dropped if the renderer panics, so that nobody waits for it then.
            let (used, taken_out) = (used, taken_out);
            for Taken { frame, pairs, picture } in taken_out {
                let rendering = self.clock.time(Stage::Render, frame);
                show(&picture, renderer);
                renderer.swap(frame);
                drop(rendering);
                let swapped = self.running.swapped(frame, &self.clock);
                on_frame(&FrameRecord { frame, swapped, pairs });
                // Before its picture is given back, without which the frame after next is not computed.
                outside.swapped(frame);
                self.frame = frame + 1;
                give_back(&used, picture);
            }
            drop(used);
            Ok::<_, ExecutorError>(computing.join())
        })?;
        match unused {
            Ok(unused) => self.pictures.extend(unused),
            Err(panic) => std::panic::resume_unwind(panic),
        }
        Ok(())
    }

    fn frame(&self) -> u64 {
        self.frame
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
        self.clock.watch(timeline, self.engine.workers.len());
    }

    fn stage_seconds(&self) -> Vec<StageSeconds> {
        let mut seconds = self.engine.stage_seconds(&self.running);
        seconds.push(self.clock.seconds(&self.running));
        seconds
    }
}

/// A frame ready to be rendered.
struct Taken {
    frame: u64,
    pairs: PairCount,
    picture: Picture,
}

/// Room for a picture of these blocks.
fn picture(blocks: &[Block]) -> Picture {
    let copy = |block: &Block| block.objects().iter().map(Object::snapshot).collect();
    blocks.iter().map(|block| Mutex::new(copy(block))).collect()
}

/// Computes frames and takes a picture of each, until nobody wants them any more.
fn compute(
    engine: &mut Engine,
    loops: &RayonLoops,
    frames: u64,
    unused: Receiver<Picture>,
    taken: &SyncSender<Taken>,
) -> Receiver<Picture> {
    for _ in 0..frames {
        let Ok(picture) = unused.recv() else { break };
        let frame = engine.frame;
        let pairs = engine.compute(loops, |index, block| copy(block, &picture[index]));
        engine.frame += 1;
        if taken.send(Taken { frame, pairs, picture }).is_err() {
            break;
        }
    }
    unused
}

/// Copies what a renderer sees of a block, whose number of objects never changes.
fn copy(block: &Block, copies: &Mutex<Vec<Object>>) {
    let mut copies = copies.lock().unwrap_or_else(PoisonError::into_inner);
    for (object, copy) in block.objects().iter().zip(copies.iter_mut()) {
        object.snapshot_into(copy);
    }
}

fn show(picture: &Picture, renderer: &mut dyn Renderer) {
    for copies in picture {
        for object in copies.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            draw(object, renderer);
        }
    }
}

fn give_back(used: &SyncSender<Picture>, picture: Picture) {
    // There is room for all pictures; a refusal means that nobody needs them any more.
    let _ = used.send(picture);
}
