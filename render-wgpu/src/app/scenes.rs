//! The scenes that a recording can be of.

use dualframe_sim::record::wire::Malformed;
use dualframe_sim::record::{Header, SceneSpec};
use dualframe_sim::scene::{ParticleScene, Scene, SceneError};
use dualframe_sim::simd::Simd;
use thiserror::Error;

/// A scene of any kind.
pub(super) enum AnyScene {
    Particles(ParticleScene),
}

/// Why a recording's scene cannot be built.
#[derive(Debug, Error)]
pub(super) enum AnySceneError {
    #[error("its scene is of a kind that this program does not know: {kind:?}")]
    Kind { kind: String },
    #[error("its scene is malformed")]
    Malformed(#[from] Malformed),
    #[error("its scene cannot be built")]
    Build(#[from] SceneError),
    #[error("objects are added, which no {kind} scene does")]
    Addition { kind: &'static str },
}

impl AnyScene {
    /// What a recording is of.
    pub(super) fn of(header: &Header) -> Result<Self, AnySceneError> {
        match header.kind() {
            ParticleScene::KIND => Ok(Self::Particles(header.scene()?)),
            kind => Err(AnySceneError::Kind { kind: kind.to_owned() }),
        }
    }

    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Particles(_) => ParticleScene::KIND,
        }
    }

    /// The environment at its start.
    pub(super) fn build(&self, simd: Simd) -> Result<Scene, AnySceneError> {
        let mut scene = match self {
            Self::Particles(particles) => particles.build()?,
        };
        scene.stages.simd = simd;
        Ok(scene)
    }

    /// Adds objects as the bytes say that were recorded when they were added.
    pub(super) fn add(&self, _scene: &mut Scene, _spec: &[u8]) -> Result<(), AnySceneError> {
        match self {
            Self::Particles(_) => Err(AnySceneError::Addition { kind: self.kind() }),
        }
    }
}
