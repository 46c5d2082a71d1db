//! A cranial perforator's clutch.

use std::hash::Hasher;

/// A clutch that lets the bit turn only while bone presses on its tip: the inner drill slides against the
/// outer one, and where the bone under it ends it is unloaded and both stop. The real one may fail to stop
/// in bone of less than 3 mm or when held aslant; so may this one, by the same mechanics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Perforator {
    engaged: bool,
}

impl Perforator {
    /// The load on the tip from which on the clutch engages, in newtons; usually 10.
    pub const ENGAGE: f32 = 10.0;
    /// The load on the tip below which it lets go, in newtons; usually 4.
    pub const RELEASE: f32 = 4.0;
    /// How fast an engaged bit turns, in radians per second; usually 105: 1,000 rpm, of 800 to 1,200.
    pub const SPIN: f32 = 105.0;

    /// A clutch that is not engaged.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The load on the tip is so many newtons now ([`Reaction::tip`](super::Reaction)); says how fast the
    /// bit turns, in radians per second.
    pub fn turn(&mut self, tip: f32) -> f32 {
        let least = if self.engaged { Self::RELEASE } else { Self::ENGAGE };
        self.engaged = tip >= least;
        if self.engaged { Self::SPIN } else { 0.0 }
    }

    /// Whether it is engaged.
    #[must_use]
    pub fn is_engaged(&self) -> bool {
        self.engaged
    }

    /// Adds what it remembers to a state hash.
    pub fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write(&[u8::from(self.engaged)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hysteresis() {
        let mut clutch = Perforator::new();
        let turns = [0.0, 9.9, 10.0, 5.0, 4.0, 3.9, 9.0, 11.0].map(|tip| clutch.turn(tip) > 0.0);
        assert_eq!(turns, [false, false, true, true, true, false, false, true]);
        assert!(clutch.turn(f32::NAN) == 0.0 && !clutch.is_engaged());
    }
}
