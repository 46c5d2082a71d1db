//! What can go wrong with a run.

use std::io;
use std::path::PathBuf;

use dualframe_render_wgpu::error::GraphicsError;
use dualframe_sim::device::thread::LoopError;
use dualframe_sim::executor::ExecutorError;
use dualframe_sim::image::FileError;
use dualframe_sim::record::RecordError;
use dualframe_sim::scene::SceneError;
use dualframe_sim::scene::craniotomy::BuildError;
use dualframe_sim::scene::head::HeadError;
use thiserror::Error;

use super::{BAD_ARGUMENT, NO_PICTURE, UNSOUND};

/// Why a run failed.
#[derive(Debug, Error)]
pub(super) enum RunError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Executor(#[from] ExecutorError),
    #[error(transparent)]
    Graphics(#[from] GraphicsError),
    #[error("cannot write {}", path.display())]
    Write {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("there is no thread to write pictures")]
    Writer(#[source] io::Error),
    #[error("the report cannot be printed")]
    Print(#[source] io::Error),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error("the recording failed before frame {frame}; it is whole up to an earlier one")]
    Recording {
        frame: u64,
        #[source]
        source: RecordError,
    },
    #[error(transparent)]
    Haptics(#[from] LoopError),
    #[error(transparent)]
    Operation(#[from] BuildError),
    #[error("the image cannot be brought up to date")]
    Drilled(#[from] HeadError),
    // It says all that it comes from.
    #[error("{0}")]
    Image(FileError),
}

impl RunError {
    /// The status that the program ends with.
    pub(super) fn status(&self) -> u8 {
        match self {
            Self::Graphics(_) => NO_PICTURE,
            Self::Haptics(LoopError::Rate { .. }) => BAD_ARGUMENT,
            _ => UNSOUND,
        }
    }
}
