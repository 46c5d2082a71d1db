//! Why an experiment failed.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::Experiment;
use crate::executor::ExecutorError;
use crate::scene::SceneError;
use crate::scene::craniotomy::BuildError;
use crate::scene::head::HeadError;

/// Why an experiment failed.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// The environment cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The head to be operated on cannot be built.
    #[error(transparent)]
    Head(#[from] HeadError),
    /// The environment of an operation cannot be built.
    #[error(transparent)]
    Operation(#[from] BuildError),
    /// An executor cannot be built, or cannot go on.
    #[error(transparent)]
    Executor(#[from] ExecutorError),
    /// Two runs that must end in the same state did not, so their times say nothing.
    #[error("{run} ended in state {hash:016x}, others in {expected:016x}")]
    Differs {
        /// The run.
        run: String,
        /// The hash over its state.
        hash: u64,
        /// The hash over the state of the runs before.
        expected: u64,
    },
    /// Objects were taken out, so that a run did less work than it should.
    #[error("{objects} objects were quarantined in {run}")]
    Quarantined {
        /// The run.
        run: String,
        /// The number of objects.
        objects: usize,
    },
    /// The plan has other sizes than an experiment takes.
    #[error("{experiment:?} cannot be planned so: it takes {takes}")]
    Plan {
        /// The experiment.
        experiment: Experiment,
        /// What it takes.
        takes: &'static str,
    },
    /// A file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A figure cannot be drawn.
    #[error("cannot draw {figure}: {reason}")]
    Draw {
        /// The figure's name.
        figure: &'static str,
        /// What the plotting library says.
        reason: String,
    },
}
