//! Forces that change without a kick.

use glam::Vec3;

use super::Wrench;

/// The difference between what was shown and what a new model says, as it fades: at the moment in which a
/// model comes the force does not change at all, and after `over` seconds it is the new model's alone.
///
/// That is bumpless transfer, as in the switching of controllers (K. J. Åström, R. M. Murray, "Feedback
/// Systems", §10.4). A mix of the old and the new model would do as much for one model, but not when a
/// third comes while two are being mixed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SmoothEntry {
    offset: Wrench,
    began: f64,
    over: f64,
}

impl SmoothEntry {
    /// A model that says `new` comes at `time` where `shown` is being shown.
    pub(super) fn new(shown: Wrench, new: Wrench, time: f64, over: f64) -> Self {
        let offset = Wrench { force: shown.force - new.force, torque: shown.torque - new.torque };
        Self { offset, began: time, over }
    }

    /// The same model begins anew from `shown`, with as much time to come in.
    pub(super) fn again(&self, shown: Wrench, new: Wrench, time: f64) -> Self {
        Self::new(shown, new, time, self.over)
    }

    /// How much longer the new model takes to come in, in seconds.
    pub(super) fn left(&self, time: f64) -> f64 {
        (self.over - (time - self.began)).max(0.0)
    }

    /// What to show for a model that says `new`.
    pub(super) fn apply(&self, new: Wrench, time: f64) -> Wrench {
        let left = self.left(time) / self.over;
        // Also for a blend of no time, which is 0/0 at its beginning.
        let left = if left > 0.0 { left as f32 } else { 0.0 };
        Wrench {
            force: new.force + self.offset.force * left,
            torque: new.torque + self.offset.torque * left,
        }
    }
}

/// `wanted`, or as far towards it from `last` as a step of length `most` goes.
pub(super) fn limited_step(last: Vec3, wanted: Vec3, most: f32) -> Vec3 {
    last + (wanted - last).clamp_length_max(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(newtons: f32) -> Wrench {
        Wrench { force: Vec3::X * newtons, torque: Vec3::ZERO }
    }

    #[test]
    fn begins_with_what_was_shown_and_ends_with_the_new() {
        let entry = SmoothEntry::new(force(1.0), force(5.0), 2.0, 0.5);
        assert_eq!(entry.apply(force(5.0), 2.0), force(1.0));
        assert_eq!(entry.apply(force(5.0), 2.25), force(3.0));
        assert_eq!(entry.apply(force(5.0), 2.5), force(5.0));
        assert_eq!(entry.apply(force(5.0), 9.0), force(5.0));
        let at_once = SmoothEntry::new(force(1.0), force(5.0), 2.0, 0.0);
        assert_eq!(at_once.apply(force(5.0), 2.0), force(5.0));
    }

    #[test]
    fn steps_are_limited() {
        assert_eq!(limited_step(Vec3::ZERO, Vec3::Y, 0.25), Vec3::Y * 0.25);
        assert_eq!(limited_step(Vec3::Y, Vec3::Y * 0.9, 0.25), Vec3::Y * 0.9);
    }
}
