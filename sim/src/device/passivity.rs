//! A limiter of the energy that sampling and delay generate.
//!
//! A sampled spring gives back more than it took: the force of a tick is held while the tool moves on.
//! So does a model that comes late. The limiter is the time-domain passivity observer and controller of
//! B. Hannaford, J.-H. Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics
//! and Automation 18(1), 2002, in the form with a reference energy of J.-H. Ryu, C. Preusche,
//! B. Hannaford, G. Hirzinger, "Time domain passivity control with reference energy following", IEEE
//! Trans. Control Systems Technology 13(5), 2005.
//!
//! - The observer counts the work E that the hand has put in: a force F, held over a tick in which the
//!   tool moves by Δx, takes −F·Δx from it, and that is exact (J.-H. Ryu, Y. S. Kim, B. Hannaford,
//!   "Sampled- and continuous-time passivity and stability of virtual environments", IEEE Trans.
//!   Robotics 20(4), 2004). Only where samples are lost is it not: the tool is taken to have moved evenly
//!   meanwhile, against the mean of the forces.
//! - The reference is the energy V that the local model stores where the tool is. Where E falls short of
//!   V, the difference was generated, and the controller takes it back by damping: α = (V − E)·T/Δx², at
//!   most a stated one. For a wall of stiffness K that comes to α = K·T/2, just what holding a force
//!   over a tick takes away from a loop. It acts a tick late, so at speed v up to K·(v·T)²/2 may be
//!   generated before it is taken back.
//! - Where E exceeds V, it was dissipated and is gone: no credit is kept, or the controller would act
//!   late (the fault of the first form that the second one mends).
//!
//! An energy tank (M. Franken et al., IEEE Trans. Robotics 27(4), 2011) bounds the energy as well, but by
//! cutting the force when it runs dry: in a stiff contact that is a kick at each bounce. Damping is
//! continuous in the motion.

use glam::Vec3;

/// Observer and controller. Without a controller (`max_damping` 0) it only observes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passivity {
    /// In newton seconds per metre.
    max_damping: f64,
    /// In metres.
    resolution: f64,
    /// What is being added, in newton seconds per metre.
    damping: f64,
    /// E, without what was dissipated, in joules.
    energy: f64,
    /// All that the hand has put in since the start, less what it got back, in joules.
    absorbed: f64,
    /// The least that `absorbed` ever was, in joules.
    least: f64,
}

impl Passivity {
    /// An observer that has seen nothing. `resolution` is the device's, in metres.
    pub(super) fn new(max_damping: f64, resolution: f32) -> Self {
        let resolution = resolution.into();
        Self { max_damping, resolution, damping: 0.0, energy: 0.0, absorbed: 0.0, least: 0.0 }
    }

    /// Counts the work of a tick, or of several, in which `force` was held while the tool moved by `way`.
    pub(super) fn observe(&mut self, force: Vec3, way: Vec3) {
        let work = -force.as_dvec3().dot(way.as_dvec3());
        self.energy += work;
        self.absorbed += work;
        self.least = self.least.min(self.absorbed);
    }

    /// The damping, in newtons, that takes back what was generated in a tick of `time` seconds with a way
    /// like the last one; `stored` is V, in joules.
    ///
    /// Of the way, one step of the device's resolution may be no motion at all and is not damped: a tool
    /// at rest between two steps would buzz.
    pub(super) fn resistance(&mut self, stored: f64, way: Vec3, time: f64) -> Vec3 {
        self.energy = self.energy.min(stored);
        let generated = stored - self.energy;
        let length = way.as_dvec3().length();
        let certain = length - self.resolution;
        if generated > 0.0 && certain > 0.0 {
            self.damping = (generated * time / (length * certain)).min(self.max_damping);
            way * (-self.damping * certain / (length * time)) as f32
        } else {
            self.damping = 0.0;
            Vec3::ZERO
        }
    }

    /// In newton seconds per metre.
    pub(super) fn damping(&self) -> f64 {
        self.damping
    }

    /// In joules; positive: the hand has put in more than it got.
    pub(super) fn absorbed(&self) -> f64 {
        self.absorbed
    }

    /// In joules; 0 at most.
    pub(super) fn least(&self) -> f64 {
        self.least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the way into a wall and out again the damping is K·T/2.
    #[test]
    fn half_the_stiffness_times_the_period() {
        let (stiffness, period, speed) = (2_000.0_f64, 1e-3, 0.1);
        let (mut passivity, mut force, mut place) =
            (Passivity::new(100.0, 0.0), Vec3::ZERO, 0.0_f64);
        for tick in 0..40 {
            let way = speed * period * if tick < 20 { -1.0 } else { 1.0 };
            place += way;
            let way = Vec3::Y * way as f32;
            passivity.observe(force, way);
            let depth = (-place).max(0.0);
            let stored = 0.5 * stiffness * depth * depth;
            let resistance = passivity.resistance(stored, way, period);
            let damping = passivity.damping();
            // In the tick of the turn, the damping of the way in still acts, and pushes.
            let expected = if tick == 20 { 3.0 } else { 1.0 };
            assert!((damping - expected).abs() < 1e-3 || depth < 1e-7, "tick {tick}: {damping}");
            force = Vec3::Y * (stiffness * depth) as f32 + resistance;
        }
        // What the last tick before the way out ends has generated is K·(v·T)²/2.
        assert!(passivity.least() > -1.01e-5, "{} J", passivity.least());
    }

    #[test]
    fn dissipated_energy_is_no_credit() {
        let mut passivity = Passivity::new(100.0, 0.0);
        passivity.observe(Vec3::Y, -Vec3::Y);
        assert_eq!(passivity.resistance(0.0, Vec3::Y, 1e-3), Vec3::ZERO);
        passivity.observe(Vec3::Y, Vec3::Y * 0.01);
        assert!(passivity.resistance(0.0, Vec3::Y * 0.01, 1e-3).y < 0.0);
        let at_rest = passivity.resistance(0.0, Vec3::ZERO, 1e-3);
        assert_eq!(at_rest, Vec3::ZERO, "at rest nothing can be taken");
    }

    #[test]
    fn a_step_of_the_resolution_is_no_motion() {
        let mut passivity = Passivity::new(100.0, 1e-5);
        passivity.observe(Vec3::Y, Vec3::Y);
        assert_eq!(passivity.resistance(0.0, Vec3::Y * 0.9e-5, 1e-3), Vec3::ZERO);
        let resistance = passivity.resistance(0.0, Vec3::Y * 3e-5, 1e-3);
        assert!(resistance.abs_diff_eq(Vec3::Y * -2.0, 1e-4), "{resistance}");
    }
}
