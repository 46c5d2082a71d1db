//! Executors: what drives the four stages, frame by frame.
//!
//! Every executor calls the same [`Stages`] on the same
//! [`Block`](crate::block::Block)s and comes to the same bits.

mod barrier;
mod clock;
mod engine;
mod mail;
#[cfg(feature = "native-peers")]
mod native;
pub(crate) mod on_panic;
mod outside;
mod parallel_for;
mod pipeline;
mod rayon;
mod rayon_overlapped;
mod refused;
mod serial;
mod static_;
mod world;

use std::sync::Arc;
use std::time::Instant;

use thiserror::Error;

use crate::blocking::BlockingError;
use crate::mailbox::Mailbox;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::{PairCount, Stages};
use crate::timeline::Timeline;

pub use self::rayon::{RayonExecutor, RayonLoops};
pub use clock::{Stage, StageSeconds};
#[cfg(feature = "native-peers")]
pub use native::{
    OpenMpDynamicExecutor, OpenMpStaticExecutor, TbbForExecutor, TbbPipelineExecutor,
};
pub use parallel_for::{LoopExecutor, ParallelFor};
pub use pipeline::{Entry, PipelineExecutor};
pub use rayon_overlapped::RayonOverlappedExecutor;
pub use refused::Refused;
pub use serial::SerialExecutor;
pub use static_::StaticExecutor;

/// The ways to drive an environment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExecutorKind {
    /// The dual-frame pipeline.
    #[default]
    Pipeline,
    /// One thread, stage after stage: the serial time that speed-ups refer to (§7.2).
    Serial,
    /// Long-lived threads, equal shares fixed beforehand, a barrier after each stage.
    Static,
    /// Rayon's work stealing, stage after stage.
    Rayon,
    /// As [`ExecutorKind::Rayon`], but a copy of each frame is rendered beside the next frame.
    RayonOverlapped,
    /// OpenMP's `schedule(static)`, stage after stage.
    #[cfg(feature = "native-peers")]
    OpenMpStatic,
    /// OpenMP's `schedule(dynamic)`, stage after stage.
    #[cfg(feature = "native-peers")]
    OpenMpDynamic,
    /// oneTBB's `parallel_for`, stage after stage.
    #[cfg(feature = "native-peers")]
    TbbFor,
    /// oneTBB's `parallel_pipeline`, with rendering beside updates.
    #[cfg(feature = "native-peers")]
    TbbPipeline,
}

impl ExecutorKind {
    /// Every way, the pipeline first.
    pub const ALL: &'static [Self] = &[
        Self::Pipeline,
        Self::Serial,
        Self::Static,
        Self::Rayon,
        Self::RayonOverlapped,
        #[cfg(feature = "native-peers")]
        Self::OpenMpStatic,
        #[cfg(feature = "native-peers")]
        Self::OpenMpDynamic,
        #[cfg(feature = "native-peers")]
        Self::TbbFor,
        #[cfg(feature = "native-peers")]
        Self::TbbPipeline,
    ];

    /// The name by which the program knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pipeline => "pipeline",
            Self::Serial => "serial",
            Self::Static => "static",
            Self::Rayon => "rayon",
            Self::RayonOverlapped => "rayon-overlapped",
            #[cfg(feature = "native-peers")]
            Self::OpenMpStatic => "openmp-static",
            #[cfg(feature = "native-peers")]
            Self::OpenMpDynamic => "openmp-dynamic",
            #[cfg(feature = "native-peers")]
            Self::TbbFor => "tbb-for",
            #[cfg(feature = "native-peers")]
            Self::TbbPipeline => "tbb-pipeline",
        }
    }
}

/// Why an executor cannot be built, or cannot go on.
#[derive(Debug, Error)]
pub enum ExecutorError {
    /// The objects cannot be grouped.
    #[error(transparent)]
    Blocking(#[from] BlockingError),
    /// The number of threads is not allowed.
    #[error("{threads} threads were asked for; there can be 1 to {MAX_THREADS}")]
    Threads {
        /// The number asked for.
        threads: usize,
    },
    /// The system gave no thread.
    #[error("a worker thread could not be started")]
    Spawn(#[source] std::io::Error),
    /// The pipeline cannot be built.
    #[error(transparent)]
    Setup(#[from] dualframe_core::error::SetupError),
    /// The pipeline's table of blocks that meet is full.
    #[error(transparent)]
    Table(#[from] dualframe_core::error::TableFull),
    /// A renderer, or who was told of a frame, panicked in an earlier run.
    #[error("a run was broken off by a panic; its objects are of different frames")]
    BrokenOff,
    /// Rayon's pool could not be built.
    #[error("the thread pool could not be started")]
    Pool(#[from] ::rayon::ThreadPoolBuildError),
}

impl ExecutorError {
    /// Whether the environment can go on, without the threads that were asked for. After any other error that a run
    /// ends with, its state may depend on who came when.
    #[must_use]
    pub fn can_go_on(&self) -> bool {
        matches!(self, Self::Spawn(_) | Self::Pool(_))
    }
}

/// The most threads an executor may have.
pub const MAX_THREADS: usize = 256;

/// What is known of a frame once it is swapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRecord {
    /// The frame, counted from 0.
    pub frame: u64,
    /// When it was swapped.
    pub swapped: Instant,
    /// What its interaction stage counted.
    pub pairs: PairCount,
}

/// Who is told of every frame once it is swapped, by the thread that swapped it: see [`Renderer`] for what that may be.
pub type OnFrame<'a> = dyn FnMut(&FrameRecord) + Send + 'a;

/// Something that advances an environment frame by frame.
pub trait Executor: Send {
    /// Advances by `frames` frames. Every frame's objects go to the renderer, then the frame is
    /// swapped and `on_frame` is told, in the order of the frames; when this returns, all of them are
    /// swapped. The renderer is called by one thread at a time, and by the calling thread only if it
    /// [is bound](Renderer::is_bound) to that. A caller that is a thread of a Rayon pool may be given other jobs of that
    /// pool before this returns, and must hold nothing that they wait for.
    ///
    /// # Errors
    /// More than 512 blocks, of which more than 128 threads are the usual cause, crowd so fast that the pipeline's
    /// table of blocks that meet, which grows every
    /// [`FRAMES_PER_BLOCKING`](crate::blocking::FRAMES_PER_BLOCKING) frames, is full. The environment cannot go
    /// on then: a frame without some of its interactions would not be the same for every schedule. Or the
    /// pipeline's pool was enlarged and the threads cannot be had, or the one that computes beside a renderer; frames
    /// before that are done, and it can go on, once no more threads are asked for than can be had.
    ///
    /// # Panics
    /// If the renderer or `on_frame` does. The objects are still there, some of them a frame or two ahead of
    /// others: they can be looked at, but must not be advanced any more as if nothing had happened.
    fn advance(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError>;

    /// The number of the next frame: the scene's, and one more for each frame done since.
    fn frame(&self) -> u64;

    /// Shows every object in its present state, in no particular order.
    fn visit(&self, visit: &mut dyn FnMut(&Object));

    /// Where messages from outside are posted.
    fn mailbox(&self) -> &Mailbox;

    /// Lets the rules, or the numbers that all stages share, be changed between two runs.
    fn change(&mut self, change: &mut dyn FnMut(&mut Stages));

    /// Takes the environment out as it is after the last frame done, with all messages that are under
    /// way: to go on by another executor, say, or with another object. After an error its state depends
    /// on the schedule.
    fn into_scene(self: Box<Self>) -> Scene;

    /// Records on `timeline`, from the next frame on, what each worker does. Workers have the numbers
    /// that they have in [`Executor::stage_seconds`]. An executor has one timeline for life, the first that
    /// it is given.
    fn watch(&mut self, timeline: Arc<Timeline>);

    /// What each worker spent its time on since the executor was built. With [`RayonOverlappedExecutor`] the
    /// calling thread, which renders beside the workers, comes after them as one more.
    fn stage_seconds(&self) -> Vec<StageSeconds>;
}

/// The state hash of an executor's objects.
#[must_use]
pub fn state_hash(executor: &dyn Executor) -> u64 {
    let mut hashes = crate::state::StateHash::default();
    executor.visit(&mut |object| hashes.add(object));
    hashes.finish()
}
