//! What races are run with: environments, and who moves their hands.

use std::fmt;
use std::sync::Arc;

use super::error::ExperimentError;
use super::race::Runner;
use crate::blocking::Grain;
use crate::executor::{ExecutorError, OnFrame};
use crate::manager::{Settings, VeManager};
use crate::render::Renderer;
use crate::scene::ParticleScene;
use crate::scene::craniotomy::{self, Operation, Step};
use crate::scene::head::Head;

/// What a frame of a retraction takes, in particles updated: 5 ms of 3 µs each, roughly.
pub(super) const RETRACTION_WORK: u64 = 1_500;

/// An environment, and what is done in it.
#[derive(Clone, Debug)]
pub enum Subject {
    /// Particles, in blocks.
    Particles(ParticleScene),
    /// Automated retraction of a head's scalp (§8.3), one object a unit: two scripted hands cut, scrape
    /// and pull, and rest when they are done.
    Retraction(Arc<Head>),
}

impl Subject {
    /// Automated retraction on the synthetic head, which is built here, once for all runs.
    ///
    /// # Errors
    /// As [`Head::synthetic`].
    pub fn retraction() -> Result<Self, ExperimentError> {
        Ok(Self::Retraction(Arc::new(Head::synthetic()?)))
    }

    /// The number of objects; walls do not count.
    #[must_use]
    pub fn objects(&self) -> usize {
        match self {
            Self::Particles(scene) => scene.objects,
            Self::Retraction(_) => craniotomy::OBJECTS,
        }
    }

    /// What a frame takes, in particles updated.
    pub(super) fn work(&self) -> u64 {
        match self {
            Self::Particles(scene) => scene.objects as u64,
            Self::Retraction(_) => RETRACTION_WORK,
        }
    }

    /// The frames in which somebody's hands move.
    #[must_use]
    pub fn script_frames(&self) -> u64 {
        self.operation().map_or(0, |operation| operation.frames())
    }

    /// The environment before its first frame.
    ///
    /// # Errors
    /// The environment or the executor cannot be built.
    pub fn start(&self, runner: Runner) -> Result<Session, ExperimentError> {
        let (scene, grain) = match self {
            Self::Particles(scene) => (scene.build()?, Grain::Spatial),
            Self::Retraction(head) => (craniotomy::build(head)?, Grain::Pairwise),
        };
        let Runner { executor, threads } = runner;
        let settings = Settings { executor, threads, grain, ..Settings::default() };
        let manager = VeManager::new(scene, settings).map_err(ExecutorError::from)?;
        Ok(Session { manager, operation: self.operation() })
    }

    fn operation(&self) -> Option<Operation<'static>> {
        match self {
            Self::Particles(_) => None,
            Self::Retraction(head) => {
                Some(Operation::new(Arc::clone(head), Some(Step::Retraction)))
            }
        }
    }
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Particles(scene) => write!(f, "{} objects, seed {}", scene.objects, scene.seed),
            Self::Retraction(_) => write!(f, "retraction, {} objects", self.objects()),
        }
    }
}

/// One run of a [`Subject`].
pub struct Session {
    /// The environment.
    pub manager: VeManager,
    operation: Option<Operation<'static>>,
}

impl Session {
    /// Advances by `frames` frames; see [`VeManager::run`]. What hands do is posted frame by frame.
    ///
    /// # Errors
    /// As [`VeManager::run`].
    pub fn run(
        &mut self,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        let Self { manager, operation } = self;
        let Some(operation) = operation else {
            return manager.run(frames, renderer, on_frame);
        };
        // Nothing is drilled in a retraction, so there is no freed bone to look for.
        let mailbox = manager.mailbox();
        let (hands, mut watch) = operation.parts(renderer);
        manager.run(frames, &mut watch, &mut |record| {
            hands.swapped(record.frame, &mailbox);
            on_frame(record);
        })
    }
}
