//! Scenes that no executor could be made of.

use std::error::Error;
use std::fmt;

use super::{ExecutorError, MAX_THREADS};
use crate::blocking::{Blocking, Grain};
use crate::scene::Scene;

/// Why an executor cannot be made of a scene, and the scene: another executor may go on with it. What only wants the
/// reason takes an [`ExecutorError`].
pub struct Refused {
    /// What was to be executed, as it was.
    pub scene: Scene,
    /// Why it is not.
    pub error: ExecutorError,
}

impl Refused {
    /// The scene, and what `prepare` makes for it, if it has objects that can be grouped and there can be so many
    /// threads.
    pub(super) fn unless<T>(
        scene: Scene,
        grain: Grain,
        threads: usize,
        prepare: impl FnOnce() -> Result<T, ExecutorError>,
    ) -> Result<(Scene, T), Box<Self>> {
        let prepared = check(&scene, grain, threads).and_then(|()| prepare());
        match prepared {
            Ok(prepared) => Ok((scene, prepared)),
            Err(error) => Err(Box::new(Self { scene, error })),
        }
    }
}

fn check(scene: &Scene, grain: Grain, threads: usize) -> Result<(), ExecutorError> {
    if !(1..=MAX_THREADS).contains(&threads) {
        return Err(ExecutorError::Threads { threads });
    }
    Ok(Blocking::check(&scene.objects, grain)?)
}

impl From<Box<Refused>> for ExecutorError {
    fn from(refused: Box<Refused>) -> Self {
        refused.error
    }
}

impl fmt::Debug for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Refused").field("error", &self.error).finish_non_exhaustive()
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.error.fmt(f)
    }
}

impl Error for Refused {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.error.source()
    }
}
