//! What the tests share.

// Every test binary compiles all of it and uses some.
#![allow(dead_code)]

use std::sync::Arc;

use dualframe_sim::behavior::{Behavior, Input, MassSpring, Workspace};
use dualframe_sim::block::Block;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{
    Entry, Executor, PipelineExecutor, RayonExecutor, RayonOverlappedExecutor, SerialExecutor,
    StaticExecutor, state_hash,
};
#[cfg(feature = "native-peers")]
use dualframe_sim::executor::{
    OpenMpDynamicExecutor, OpenMpStaticExecutor, TbbForExecutor, TbbPipelineExecutor,
};
use dualframe_sim::geometry::{Geometry, Mesh, Topology};
use dualframe_sim::interaction::{ContactBuffer, Rules, Scratch, Segment};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::pool::Pool;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{ParticleScene, Scene};
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::{PairCount, Stages};
use dualframe_sim::state::StateHash;
use glam::Vec3;

/// A particle scene, or the test ends.
pub(crate) fn particles(objects: usize, gravity: bool, damping: bool) -> Scene {
    let scene = ParticleScene { gravity, damping, ..ParticleScene::new(objects) };
    scene.build().expect("the number of particles is allowed")
}

/// How many executors there are.
pub(crate) const EXECUTORS: usize = if cfg!(feature = "native-peers") { 11 } else { 7 };

/// Every executor for a scene, with a name, one after the other.
pub(crate) fn executors(
    scene: impl Fn() -> Scene,
    grain: Grain,
    threads: usize,
) -> impl Iterator<Item = (&'static str, Box<dyn Executor>)> {
    (0..EXECUTORS).map(move |number| executor(number, scene(), grain, threads))
}

/// One of [`EXECUTORS`] for a scene, with its name.
pub(crate) fn executor(
    number: usize,
    scene: Scene,
    grain: Grain,
    threads: usize,
) -> (&'static str, Box<dyn Executor>) {
    let ok = "the scene and the number of threads are allowed";
    let pipeline = |scene, entry| {
        let pool = Arc::new(Pool::new(threads, false));
        Box::new(PipelineExecutor::new(scene, grain, entry, pool).expect(ok))
    };
    match number {
        0 => ("pipeline", pipeline(scene, Entry::AfterUpdate)),
        1 => ("pipeline, render first", pipeline(scene, Entry::AfterRender)),
        2 => ("pipeline, one frame", pipeline(scene, Entry::AfterSwap)),
        3 => ("serial", Box::new(SerialExecutor::new(scene, grain).expect(ok))),
        4 => ("static", Box::new(StaticExecutor::new(scene, grain, threads).expect(ok))),
        5 => ("rayon", Box::new(RayonExecutor::new(scene, grain, threads).expect(ok))),
        6 => {
            ("overlapped", Box::new(RayonOverlappedExecutor::new(scene, grain, threads).expect(ok)))
        }
        #[cfg(feature = "native-peers")]
        7 => {
            ("openmp static", Box::new(OpenMpStaticExecutor::new(scene, grain, threads).expect(ok)))
        }
        #[cfg(feature = "native-peers")]
        8 => (
            "openmp dynamic",
            Box::new(OpenMpDynamicExecutor::new(scene, grain, threads).expect(ok)),
        ),
        #[cfg(feature = "native-peers")]
        9 => ("tbb for", Box::new(TbbForExecutor::new(scene, grain, threads).expect(ok))),
        #[cfg(feature = "native-peers")]
        10 => {
            ("tbb pipeline", Box::new(TbbPipelineExecutor::new(scene, grain, threads).expect(ok)))
        }
        _ => panic!("there are {EXECUTORS} executors"),
    }
}

/// Advances an executor; the counts of its frames, its state and what was drawn.
pub(crate) fn run(executor: &mut dyn Executor, frames: u64) -> (Vec<PairCount>, u64, NullRenderer) {
    let (mut counts, mut renderer) = (Vec::new(), NullRenderer::new());
    let first = executor.frame();
    let done = executor.advance(frames, &mut renderer, &mut |record| {
        assert_eq!(record.frame, first + counts.len() as u64, "frames swap in order");
        counts.push(record.pairs);
    });
    done.expect("no table is full");
    (counts, state_hash(executor), renderer)
}

/// A serial run of a scene.
pub(crate) fn serial(scene: Scene) -> SerialExecutor {
    SerialExecutor::new(scene, Grain::Spatial).expect("the scene is well formed")
}

/// The state of all objects but one.
pub(crate) fn hash_without(executor: &dyn Executor, without: ObjectId) -> u64 {
    let mut hash = StateHash::default();
    executor.visit(&mut |object| {
        if object.id() != without {
            hash.add(object);
        }
    });
    hash.finish()
}

/// The simplest driver: blocks of `size` objects by number, every pair of blocks in descending order,
/// results handed over in descending order too. No messages.
pub(crate) struct Reference {
    pub(crate) stages: Stages,
    pub(crate) blocks: Vec<Block>,
    frame: u64,
}

impl Reference {
    pub(crate) fn new(scene: Scene, size: usize) -> Self {
        let mut blocks = Vec::new();
        let mut objects = scene.objects.into_iter().peekable();
        while objects.peek().is_some() {
            blocks.push(Block::new(objects.by_ref().take(size).collect()));
        }
        Self { stages: scene.stages, blocks, frame: 0 }
    }

    pub(crate) fn step(&mut self) -> PairCount {
        let mut scratch = Scratch::new();
        let (mut buffer, mut count) = (ContactBuffer::default(), PairCount::default());
        for first in (0..self.blocks.len()).rev() {
            let a = &self.blocks[first];
            for b in self.blocks[..first].iter().rev() {
                count += self.stages.interact(a, b, &mut scratch, &mut buffer);
            }
            count += self.stages.interact_within(a, &mut scratch, &mut buffer);
        }
        let mut workspace = Workspace::default();
        let segments: Vec<_> = Segment::all(buffer.records()).map(Segment::records).collect();
        for block in &mut self.blocks {
            let results = segments.iter().rev().copied();
            let nobody = |_| std::iter::empty();
            let post = &mut |_, _, _| {};
            self.stages.update(self.frame, block, results, &mut workspace, nobody, post);
        }
        self.frame += 1;
        count
    }

    pub(crate) fn hash(&self) -> u64 {
        let mut hash = StateHash::default();
        self.blocks.iter().flat_map(Block::objects).for_each(|object| hash.add(object));
        hash.finish()
    }
}

/// An object of one node of 1 kg at the origin that behaves as given.
pub(crate) fn point(id: u32, behavior: impl Behavior) -> Object {
    let topology = Topology::new(&[Vec3::ZERO], Vec::new(), &[], false).expect("one node");
    let mesh = Mesh::new(Arc::new(topology), &[Vec3::ZERO], &[1.0], 0.1).expect("one mass");
    Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh), behavior)
}

/// A behaviour made of a function.
pub(crate) struct Acting<F>(pub(crate) F);

impl<F> Behavior for Acting<F>
where
    F: FnMut(&mut Geometry, &mut Input<'_>) + Send + Sync + 'static,
{
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        (self.0)(geometry, input);
    }
}

/// Springs without damping in one step a frame.
pub(crate) fn springs(stiffness: f32) -> MassSpring {
    MassSpring::new(stiffness, 0.0, 1).expect("a stiffness")
}

/// Stages without rules and gravity.
pub(crate) fn no_rules() -> Stages {
    Stages {
        rules: Rules::new(),
        time_step: 1.0 / 240.0,
        gravity: Vec3::ZERO,
        callback_budget: None,
        simd: Simd::detect(),
    }
}
