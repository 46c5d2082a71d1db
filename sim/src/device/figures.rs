//! What the haptic loop measures about itself, to be shown.

use super::passivity::Passivity;

/// A tick that begins so many seconds after it was due is late. Half a millisecond: half a period at
/// 1 kHz.
pub const LATE: f64 = 0.5e-3;
/// Over how many seconds power is averaged. Usually 1.
const POWER_TIME: f64 = 1.0;

/// When ticks began, beside when they were due.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ticks {
    /// How many there were, or should have been.
    pub due: u64,
    /// How many of them began more than [`LATE`] after they were due, or not at all.
    pub late: u64,
    /// How many of them were left out, because the next one was due before they could begin.
    pub missed: u64,
    /// The latest beginning, in seconds after it was due.
    pub latest: f64,
    /// Ticks at which the device could not be read or written.
    pub failed: u64,
}

impl Ticks {
    /// The share of ticks that were late: 0 to 1.
    #[must_use]
    pub fn late_share(&self) -> f64 {
        self.late as f64 / self.due.max(1) as f64
    }

    /// A tick began `lateness` seconds after it was due, and `missed` ones in between were left out.
    pub(super) fn began(&mut self, lateness: f64, missed: u64) {
        self.due += 1 + missed;
        self.missed += missed;
        self.late += missed + u64::from(lateness > LATE);
        self.latest = self.latest.max(lateness);
    }
}

/// What was exerted, and how good it was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Forces {
    /// The force's age in seconds: how long ago the tool was where the model in use holds.
    pub age: f64,
    /// The greatest age so far, in seconds.
    pub greatest_age: f64,
    /// Models that came in.
    pub models: u64,
    /// The last interpolation error, in newtons: when a model comes, how far the force that its
    /// predecessor gives is from the one that was then computed, at the place where that was.
    pub interpolation_error: f32,
    /// The greatest interpolation error, in newtons.
    pub greatest_error: f32,
    /// The largest step of the force from one tick to the next, in newtons.
    pub largest_step: f32,
    /// The damping that the passivity controller adds just now, in newton seconds per metre.
    pub damping: f64,
    /// Energy that the hand has put in since the start, less what it got back, in joules.
    pub absorbed: f64,
    /// The least that `absorbed` ever was, in joules: below 0, energy was generated.
    pub least_absorbed: f64,
    /// Energy that the hand put in per second, in watts: the average over the last whole second. Below
    /// 0 it got more than it gave.
    pub power: f64,
    errors: u64,
    squared_errors: f64,
    /// When the second began over which power is averaged, and `absorbed` then.
    second: (f64, f64),
}

impl Forces {
    /// The root mean square of the interpolation errors, in newtons.
    #[must_use]
    pub fn error_rms(&self) -> f64 {
        (self.squared_errors / self.errors.max(1) as f64).sqrt()
    }

    pub(super) fn interpolated(&mut self, error: f32) {
        self.errors += 1;
        self.interpolation_error = error;
        self.greatest_error = self.greatest_error.max(error);
        self.squared_errors += f64::from(error).powi(2);
    }

    pub(super) fn aged(&mut self, age: f64) {
        self.age = age;
        self.greatest_age = self.greatest_age.max(age);
    }

    pub(super) fn stepped(&mut self, step: f32) {
        self.largest_step = self.largest_step.max(step);
    }

    pub(super) fn energy(&mut self, time: f64, passivity: &Passivity) {
        self.damping = passivity.damping();
        self.absorbed = passivity.absorbed();
        self.least_absorbed = passivity.least();
        let (began, absorbed) = self.second;
        let elapsed = time - began;
        if elapsed >= POWER_TIME {
            self.power = (self.absorbed - absorbed) / elapsed;
            self.second = (time, self.absorbed);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn late_and_missed_ticks() {
        let mut ticks = Ticks::default();
        for (lateness, missed) in [(0.0, 0), (0.4e-3, 0), (0.6e-3, 0), (3.2e-3, 3), (0.1e-3, 0)] {
            ticks.began(lateness, missed);
        }
        let expected = Ticks { due: 8, late: 5, missed: 3, latest: 3.2e-3, failed: 0 };
        assert_eq!(ticks, expected);
        assert_eq!(ticks.late_share(), 5.0 / 8.0);
    }

    #[test]
    fn power_is_energy_per_second() {
        let (mut forces, mut passivity) = (Forces::default(), Passivity::new(0.0, 0.0));
        for tick in 1..=250 {
            passivity.observe(Vec3::Y, -Vec3::Y * 0.02);
            forces.energy(f64::from(tick) * 0.01, &passivity);
        }
        assert!((forces.power - 2.0).abs() < 1e-3, "{} W", forces.power);
        assert!((forces.absorbed - 5.0).abs() < 1e-3, "{} J", forces.absorbed);
        assert_eq!(forces.least_absorbed, 0.0);
    }

    /// A loop of 2.5 Hz has no tick at a second's end: a mean is over 1.2 s.
    #[test]
    fn power_is_over_the_time_that_passed() {
        let (mut forces, mut passivity) = (Forces::default(), Passivity::new(0.0, 0.0));
        for tick in 1..=12 {
            passivity.observe(Vec3::Y, -Vec3::Y * 0.02);
            forces.energy(f64::from(tick) * 0.4, &passivity);
            let expected = if tick < 3 { 0.0 } else { 0.05 };
            assert!((forces.power - expected).abs() < 1e-6, "{} W, tick {tick}", forces.power);
        }
    }

    #[test]
    fn errors() {
        let mut forces = Forces::default();
        for error in [3.0, 4.0, 0.0, 0.0] {
            forces.interpolated(error);
        }
        assert_eq!((forces.error_rms(), forces.greatest_error), (2.5, 4.0));
    }
}
