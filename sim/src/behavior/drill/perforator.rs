//! A cranial perforator's clutch.

use std::hash::Hasher;

/// A clutch that lets the bit turn only while bone presses on its tip: the inner drill slides against the
/// outer one, and where the bone under it ends it is unloaded and both stop. The real one may fail to stop
/// in bone of less than 3 mm, when held aslant, or when pushed so hard that the rim that is left gives
/// way; so may this one, by the same mechanics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Perforator {
    engaged: bool,
    /// For how many frames the tip has been unloaded.
    unloaded: u8,
}

impl Perforator {
    /// How hard it is pushed, in newtons; usually 30.
    pub const PUSH: f32 = 30.0;
    /// The load on the tip from which on the clutch engages, in newtons; usually 12.
    pub const ENGAGE: f32 = 12.0;
    /// The load on the tip below which it lets go, in newtons; usually 7. Of 30 N, the tip bears 20 in
    /// full bone and no less than 9 in the diploe.
    pub const RELEASE: f32 = 7.0;
    /// Frames for which the tip must be unloaded before it lets go: the inner drill has a way to slide; usually
    /// 3.
    pub const DELAY: u8 = 3;
    /// How fast an engaged bit turns, in radians per second; usually 105: 1,000 rpm, of 800 to 1,200.
    pub const SPIN: f32 = 105.0;

    /// A clutch that is not engaged.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The load on the tip in this frame is so many newtons ([`Reaction::tip`](super::Reaction)); says how
    /// fast the bit turns, in radians per second.
    pub fn turn(&mut self, tip: f32) -> f32 {
        if tip >= if self.engaged { Self::RELEASE } else { Self::ENGAGE } {
            *self = Self { engaged: true, unloaded: 0 };
        } else if self.engaged {
            self.unloaded += 1;
            self.engaged = self.unloaded < Self::DELAY;
        }
        if self.engaged { Self::SPIN } else { 0.0 }
    }

    /// Whether it is engaged.
    #[must_use]
    pub fn is_engaged(&self) -> bool {
        self.engaged
    }

    /// Adds what it remembers to a state hash.
    pub fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write(&[u8::from(self.engaged), self.unloaded]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hysteresis() {
        let mut clutch = Perforator::new();
        let mut turns = |tips: &[f32]| -> Vec<bool> {
            tips.iter().map(|&tip| clutch.turn(tip) > 0.0).collect()
        };
        assert_eq!(turns(&[0.0, 11.9, 12.0, 7.0]), [false, false, true, true]);
        // A short dip is not enough.
        assert_eq!(turns(&[6.9, 0.0, 7.0, 6.9, 6.9]), [true; 5]);
        assert_eq!(turns(&[6.9, 11.9, 11.9, 12.0]), [false, false, false, true]);
        assert_eq!(turns(&[f32::NAN; 3]), [true, true, false]);
        assert!(!clutch.is_engaged());
    }
}
