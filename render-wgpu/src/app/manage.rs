//! Managers that are made anew: of a scene that was taken out of another one.

use std::cell::RefCell;
use std::sync::Arc;

use dualframe_sim::executor::{ExecutorError, ExecutorKind, Refused, StageSeconds};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::scene::Scene;
use dualframe_sim::timeline::Timeline;

use super::args::Products;
use super::error::RunError;
use super::told::Told;

/// Spans of a worker that its timeline keeps for a trace; usually 65,536, some seconds of work.
const TRACED_SPANS: usize = 1 << 16;
/// Spans of a worker that its timeline keeps for a window; usually 4,096, more than is shown.
const SHOWN_SPANS: usize = 1 << 12;

/// How managers are made anew.
#[derive(Clone, Copy)]
pub(super) struct Manage<'a> {
    /// Makes a manager of a scene, each time by the same settings.
    pub(super) make: &'a dyn Fn(Scene) -> Result<VeManager, RunError>,
    pub(super) spent: &'a Spent,
}

/// What workers spent their time on under managers that are gone.
#[derive(Default)]
pub(super) struct Spent(RefCell<Vec<StageSeconds>>);

impl Spent {
    /// Adds the seconds of a manager that is gone.
    pub(super) fn add(&self, seconds: &[StageSeconds]) {
        let mut all = self.0.borrow_mut();
        if all.len() < seconds.len() {
            all.resize(seconds.len(), StageSeconds::default());
        }
        for (sum, worker) in all.iter_mut().zip(seconds) {
            sum.broad_phase += worker.broad_phase;
            sum.interaction += worker.interaction;
            sum.update += worker.update;
            sum.render += worker.render;
            sum.idle += worker.idle;
        }
    }

    /// All seconds, worker by worker, with those of the last manager.
    pub(super) fn with(self, last: &VeManager) -> Vec<StageSeconds> {
        self.add(&last.stage_seconds());
        self.0.into_inner()
    }
}

/// A timeline of so many workers, for a window or a trace.
pub(super) fn timeline_of(products: &Products, workers: usize) -> Arc<Timeline> {
    let spans = if products.trace.is_some() { TRACED_SPANS } else { SHOWN_SPANS };
    // One more for whoever renders beside rayon's workers.
    Arc::new(Timeline::new(workers + 1, spans))
}

/// A manager whose workers tell a timeline, if there is one, what they do.
pub(super) fn manage(
    scene: Scene,
    settings: Settings,
    timeline: Option<&Arc<Timeline>>,
) -> Result<VeManager, RunError> {
    let manager = VeManager::new(scene, settings).map_err(ExecutorError::from)?;
    Ok(watched(manager, timeline))
}

/// As [`manage`], of a scene that was taken out of another manager: where it cannot be run as asked for, for want of
/// threads, the serial executor goes on with it.
pub(super) fn go_on(
    scene: Scene,
    settings: Settings,
    timeline: Option<&Arc<Timeline>>,
    told: &Told,
) -> Result<VeManager, RunError> {
    match VeManager::new(scene, settings) {
        Ok(manager) => Ok(watched(manager, timeline)),
        Err(refused) => {
            let Refused { scene, error } = *refused;
            told.failure(&error.into());
            let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..settings };
            manage(scene, settings, timeline)
        }
    }
}

fn watched(mut manager: VeManager, timeline: Option<&Arc<Timeline>>) -> VeManager {
    if let Some(timeline) = timeline {
        manager.watch(Arc::clone(timeline));
    }
    manager
}

#[cfg(test)]
mod tests {
    use dualframe_sim::scene::ParticleScene;

    use super::*;

    #[test]
    fn what_cannot_be_run_as_asked_for_goes_on() {
        let scene = ParticleScene::new(3).build().expect("a valid scene");
        let told = Told::default();
        let settings = Settings { threads: 0, ..Settings::default() };
        let manager = go_on(scene, settings, None, &told).expect("the serial executor takes it");
        assert_eq!(manager.settings().executor, ExecutorKind::Serial);
        assert_ne!(format!("{:?}", told.status()), format!("{:?}", Told::default().status()));
    }
}
