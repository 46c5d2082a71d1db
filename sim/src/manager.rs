//! The VE Manager (§6.1, Fig. 9): the top-level container of an environment that runs.

use std::sync::Arc;

use crate::blocking::Grain;
use crate::executor::{
    Entry, Executor, ExecutorError, ExecutorKind, MAX_THREADS, OnFrame, PipelineExecutor,
    RayonExecutor, RayonOverlappedExecutor, Refused, SerialExecutor, StageSeconds, StaticExecutor,
    state_hash,
};
#[cfg(feature = "native-peers")]
use crate::executor::{
    OpenMpDynamicExecutor, OpenMpStaticExecutor, TbbForExecutor, TbbPipelineExecutor,
};
use crate::mailbox::Mailbox;
use crate::object::{Fault, Object, ObjectId};
use crate::pool::{Pool, cores};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::stages::Stages;
use crate::timeline::Timeline;

/// How an environment is to be run. No setting changes a result, unless a behaviour goes by whether it is drawn, as
/// `GpuMassSpring` of `render-wgpu` does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// What drives the stages.
    pub executor: ExecutorKind,
    /// Threads, the calling one included (besides the calling one for rayon's executors): 1 to [`MAX_THREADS`].
    pub threads: usize,
    /// Whether the pipeline's threads are bound to cores, all but the calling one; see [`Pool::new`]. Other executors'
    /// never are.
    pub pinned: bool,
    /// Blocks of objects, or every modelled pair by itself.
    pub grain: Grain,
    /// How far consecutive frames overlap (pipeline only).
    pub entry: Entry,
}

impl Default for Settings {
    /// The pipeline on all cores, by blocks, two frames in flight.
    fn default() -> Self {
        Self {
            executor: ExecutorKind::Pipeline,
            threads: cores().min(MAX_THREADS),
            pinned: false,
            grain: Grain::default(),
            entry: Entry::default(),
        }
    }
}

/// Runs an environment.
pub struct VeManager {
    executor: Box<dyn Executor>,
    pool: Arc<Pool>,
    settings: Settings,
    /// Whether a run has begun and not ended.
    running: bool,
}

impl VeManager {
    /// A manager of `scene`, before its next frame.
    ///
    /// # Errors
    /// A number of threads or of objects beyond its limit, numbers of objects that are not 0, 1, 2 … without gaps, or
    /// threads that cannot be had. The scene comes back: it can be run in another way.
    pub fn new(scene: Scene, settings: Settings) -> Result<Self, Box<Refused>> {
        let Settings { executor, threads, pinned, grain, entry } = settings;
        // The pool would take the nearest number.
        if !(1..=MAX_THREADS).contains(&threads) {
            return Err(Box::new(Refused { scene, error: ExecutorError::Threads { threads } }));
        }
        let pool = Arc::new(Pool::new(threads, pinned));
        let executor: Box<dyn Executor> = match executor {
            ExecutorKind::Pipeline => {
                Box::new(PipelineExecutor::new(scene, grain, entry, Arc::clone(&pool))?)
            }
            ExecutorKind::Serial => Box::new(SerialExecutor::new(scene, grain)?),
            ExecutorKind::Static => Box::new(StaticExecutor::new(scene, grain, threads)?),
            ExecutorKind::Rayon => Box::new(RayonExecutor::new(scene, grain, threads)?),
            ExecutorKind::RayonOverlapped => {
                Box::new(RayonOverlappedExecutor::new(scene, grain, threads)?)
            }
            #[cfg(feature = "native-peers")]
            ExecutorKind::OpenMpStatic => {
                Box::new(OpenMpStaticExecutor::new(scene, grain, threads)?)
            }
            #[cfg(feature = "native-peers")]
            ExecutorKind::OpenMpDynamic => {
                Box::new(OpenMpDynamicExecutor::new(scene, grain, threads)?)
            }
            #[cfg(feature = "native-peers")]
            ExecutorKind::TbbFor => Box::new(TbbForExecutor::new(scene, grain, threads)?),
            #[cfg(feature = "native-peers")]
            ExecutorKind::TbbPipeline => Box::new(TbbPipelineExecutor::new(scene, grain, threads)?),
        };
        Ok(Self { executor, pool, settings, running: false })
    }

    /// Advances by `frames` frames; see [`Executor::advance`]. A run of none does nothing: what was posted waits on.
    ///
    /// # Errors
    /// Those of [`Executor::advance`]; [`ExecutorError::BrokenOff`] after a run that panicked.
    ///
    /// # Panics
    /// If the renderer or `on_frame` does.
    pub fn run(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        if self.running {
            return Err(ExecutorError::BrokenOff);
        }
        if frames == 0 {
            // An executor would take messages for a frame that is still to come, and a recorder that begins
            // before that frame would not see them.
            return Ok(());
        }
        self.running = true;
        let done = self.executor.advance(frames, renderer, on_frame);
        self.running = false;
        done
    }

    /// How the environment is run, with as many threads as are asked for now.
    #[must_use]
    pub fn settings(&self) -> Settings {
        let threads = match self.settings.executor {
            ExecutorKind::Pipeline => self.pool.threads(),
            ExecutorKind::Serial => 1,
            _ => self.settings.threads,
        };
        Settings { threads, ..self.settings }
    }

    /// The pipeline's threads, whose number may be changed while frames run. The other executors
    /// keep the number they were built with.
    #[must_use]
    pub fn pool(&self) -> &Arc<Pool> {
        &self.pool
    }

    /// The number of the next frame: the scene's, and one more for each frame done since.
    #[must_use]
    pub fn frame(&self) -> u64 {
        self.executor.frame()
    }

    /// Where messages from outside are posted, by any thread at any time.
    #[must_use]
    pub fn mailbox(&self) -> Mailbox {
        self.executor.mailbox().clone()
    }

    /// Lets the rules, or the numbers that all stages share, be changed between two runs: gravity and
    /// the time step, say. The next frame is computed with what they are then.
    pub fn change(&mut self, change: &mut dyn FnMut(&mut Stages)) {
        self.executor.change(change);
    }

    /// Takes the environment out as it is after the last frame, with all messages that are under way; see
    /// [`Executor::into_scene`]. A manager of it with other settings goes on to the same bits.
    #[must_use]
    pub fn into_scene(self) -> Scene {
        self.executor.into_scene()
    }

    /// Shows every object in its present state, in no particular order.
    pub fn visit(&self, visit: &mut dyn FnMut(&Object)) {
        self.executor.visit(visit);
    }

    /// The objects that were taken out, and why, by number.
    #[must_use]
    pub fn quarantined(&self) -> Vec<(ObjectId, Fault)> {
        let mut quarantined = Vec::new();
        self.visit(&mut |object| {
            quarantined.extend(object.quarantined().map(|f| (object.id(), f)))
        });
        quarantined.sort_unstable_by_key(|&(id, _)| id);
        quarantined
    }

    /// The hash over the state of all objects.
    #[must_use]
    pub fn state_hash(&self) -> u64 {
        state_hash(&*self.executor)
    }

    /// Records on a timeline what workers do; see [`Executor::watch`].
    pub fn watch(&mut self, timeline: Arc<Timeline>) {
        self.executor.watch(timeline);
    }

    /// What each worker spent its time on.
    #[must_use]
    pub fn stage_seconds(&self) -> Vec<StageSeconds> {
        self.executor.stage_seconds()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ParticleScene;

    #[test]
    fn as_many_threads_as_there_are() {
        for (executor, threads) in [(ExecutorKind::Serial, 1), (ExecutorKind::Pipeline, 3)] {
            let settings = Settings { executor, threads: 3, ..Settings::default() };
            let scene = ParticleScene::new(1).build().expect("a valid scene");
            let manager = VeManager::new(scene, settings).expect("valid settings");
            assert_eq!(manager.settings().threads, threads, "{executor:?}");
        }
    }
}
