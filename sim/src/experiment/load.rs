//! What stands in for a graphics device while executors are compared.

use super::error::ExperimentError;
use super::work::{spin, steps_per_second};
use crate::executor::ExecutorKind;
use crate::manager::{Settings, VeManager};
use crate::object::Object;
use crate::render::{NullRenderer, Renderer};
use crate::scene::ParticleScene;

/// The share of a serial frame's work that the stand-in makes of rendering; usually 0.15.
pub const RENDER_SHARE: f64 = 0.15;
/// Frames from which the share is calibrated.
const FRAMES: u64 = 60;
/// Frames before them.
const WARM_UP: u64 = 20;
/// Runs from which the share is calibrated; the fastest counts.
const RUNS: usize = 3;

/// What rendering costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderLoad {
    /// [`NullRenderer`]: next to nothing.
    Null,
    /// [`StandIn`].
    StandIn(StandIn),
}

impl RenderLoad {
    /// What it is called in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::StandIn(_) => "stand-in",
        }
    }

    /// The renderer of a run.
    #[must_use]
    pub fn renderer(self) -> Box<dyn Renderer> {
        match self {
            Self::Null => Box::new(NullRenderer::new()),
            Self::StandIn(stand_in) => Box::new(stand_in),
        }
    }
}

/// A renderer that works for an equal while on each object and has nothing to show for it. The work is
/// a number of steps, so that a draw reads no clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StandIn {
    steps: u64,
}

impl StandIn {
    /// A stand-in that makes rendering [`RENDER_SHARE`] of a scene's serial frame.
    ///
    /// # Errors
    /// The scene cannot be built or run.
    pub fn calibrated(scene: ParticleScene) -> Result<Self, ExperimentError> {
        let mut frame = f64::INFINITY;
        for _ in 0..RUNS {
            frame = frame.min(serial_frame(scene)?);
        }
        let spinning = frame * RENDER_SHARE / (1.0 - RENDER_SHARE) / scene.objects as f64;
        Ok(Self { steps: (spinning * steps_per_second()) as u64 })
    }
}

impl Renderer for StandIn {
    fn draw(&mut self, _: &Object) {
        spin(self.steps);
    }

    fn swap(&mut self, _: u64) {}
}

/// Seconds of a serial frame without rendering.
fn serial_frame(scene: ParticleScene) -> Result<f64, ExperimentError> {
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let mut manager = VeManager::new(scene.build()?, settings)?;
    let mut idle = StandIn { steps: 0 };
    manager.run(WARM_UP, &mut idle, &mut |_| ())?;
    let began = std::time::Instant::now();
    manager.run(FRAMES, &mut idle, &mut |_| ())?;
    Ok(began.elapsed().as_secs_f64() / FRAMES as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibrated_stand_in_works() {
        let stand_in = StandIn::calibrated(ParticleScene::new(5)).expect("a valid scene");
        assert!(stand_in.steps > 0);
    }
}
