//! Managers that are made anew: of a scene that was taken out of another one.

use std::sync::Arc;

use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::scene::Scene;
use dualframe_sim::timeline::Timeline;

use super::error::RunError;

/// Makes a manager of a scene, each time by the same settings.
pub(super) type Manage<'a> = &'a dyn Fn(Scene) -> Result<VeManager, RunError>;

/// A manager whose workers tell a timeline, if there is one, what they do.
pub(super) fn manage(
    scene: Scene,
    settings: Settings,
    timeline: Option<&Arc<Timeline>>,
) -> Result<VeManager, RunError> {
    let mut manager = VeManager::new(scene, settings)?;
    if let Some(timeline) = timeline {
        manager.watch(Arc::clone(timeline));
    }
    Ok(manager)
}
