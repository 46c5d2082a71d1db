//! The four stages (§5.1, Fig. 6).

use crate::unit::Work;

/// A stage of the pipeline, in the order that work flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Stage {
    /// Arrival in the frame and tests of bounding volumes.
    BroadPhase = 0,
    /// Exact detection and response, one interaction at a time.
    Interaction = 1,
    /// The unit's behaviour: messages, results of its interactions, integration.
    Update = 2,
    /// Drawing, by a token's holder, or who has the shared renderer, only.
    Render = 3,
}

impl Stage {
    /// All stages, first to last.
    pub const ALL: [Self; 4] = [Self::BroadPhase, Self::Interaction, Self::Update, Self::Render];

    /// The stage that `work` belongs to.
    #[inline]
    pub fn of(work: Work) -> Self {
        match work {
            Work::Enter(_) => Self::BroadPhase,
            Work::Interact(_) => Self::Interaction,
            Work::Update(_) => Self::Update,
            Work::Render(_) => Self::Render,
        }
    }
}

/// A set of stages: those with visible work, say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stages(u8);

impl Stages {
    /// No stage.
    pub const NONE: Self = Self(0);

    /// This set and `stage`, if `condition` holds.
    #[inline]
    #[must_use]
    pub fn with_if(self, stage: Stage, condition: bool) -> Self {
        Self(self.0 | u8::from(condition) << stage as u8)
    }

    /// Whether `stage` is in the set.
    #[inline]
    pub fn contains(self, stage: Stage) -> bool {
        self.0 & 1 << stage as u8 != 0
    }

    /// Whether the set has no stage.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn sets_are_sets() {
        for stage in Stage::ALL {
            let only = Stages::NONE.with_if(stage, true);
            assert!(!only.is_empty() && Stages::NONE.is_empty());
            assert_eq!(Stages::NONE.with_if(stage, false), Stages::NONE);
            assert_eq!(only.with_if(stage, true), only, "once is enough");
            for other in Stage::ALL {
                let both = only.with_if(other, true);
                assert_eq!(both, Stages::NONE.with_if(other, true).with_if(stage, true));
                assert_eq!(only.contains(other), other == stage);
                assert!(both.contains(stage) && both.contains(other));
            }
        }
    }
}
