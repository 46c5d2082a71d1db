//! Thread migration (§5.3, Fig. 8), a pure function of what is visible.

use crate::stage::{Stage, Stages};

/// Where a worker in `current` turns for its next work unit; `None` when it sees none.
///
/// Fig. 8: process the current stage's queue; if it is empty, look one stage ahead and move down
/// if there is work; else move up, stage by stage. A token's holder, or who has the shared renderer, drains
/// rendering first: nobody else can, and a chain of carry-overs must not starve it. `visible` holds
/// [`Stage::Render`] for them only.
///
/// ```
/// use dualframe_core::{migrate::migrate, stage::{Stage, Stages}};
/// let visible = Stages::NONE.with_if(Stage::BroadPhase, true).with_if(Stage::Update, true);
/// assert_eq!(migrate(Stage::Interaction, visible), Some(Stage::Update), "down before up");
/// ```
pub fn migrate(current: Stage, visible: Stages) -> Option<Stage> {
    if visible.contains(Stage::Render) {
        return Some(Stage::Render);
    }
    let at = current as usize;
    // Here, one down, then up and around.
    let order = [0, 1, 3, 2].map(|down| Stage::ALL[(at + down) % 4]);
    order.into_iter().find(|&stage| visible.contains(stage))
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    fn set(stages: &[Stage]) -> Stages {
        stages.iter().fold(Stages::NONE, |set, &stage| set.with_if(stage, true))
    }

    #[test]
    fn stays_while_there_is_work() {
        for stage in Stage::ALL {
            let all_but_render = &Stage::ALL[..3];
            let expected = if stage == Stage::Render { Stage::BroadPhase } else { stage };
            assert_eq!(migrate(stage, set(all_but_render)), Some(expected));
        }
    }

    #[test]
    fn looks_down_one_then_up() {
        use Stage::{BroadPhase, Interaction, Render, Update};
        assert_eq!(migrate(BroadPhase, set(&[Interaction, Update])), Some(Interaction));
        assert_eq!(migrate(Update, set(&[BroadPhase, Interaction])), Some(Interaction));
        assert_eq!(migrate(Interaction, set(&[BroadPhase])), Some(BroadPhase));
        assert_eq!(migrate(Interaction, set(&[BroadPhase, Render])), Some(Render));
    }

    #[test]
    fn finds_any_visible_work_and_no_other() {
        for bits in 0..16_u8 {
            let visible = (0..4).filter(|i| bits >> i & 1 == 1).map(|i| Stage::ALL[i]);
            let visible = visible.fold(Stages::NONE, |set, stage| set.with_if(stage, true));
            for current in Stage::ALL {
                let found = migrate(current, visible);
                assert_eq!(found.is_none(), visible.is_empty());
                assert!(found.is_none_or(|stage| visible.contains(stage)));
            }
        }
    }
}
