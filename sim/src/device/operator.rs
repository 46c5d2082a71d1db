//! A simulated haptic device in a simulated hand, to close the loop without either.

use glam::{DVec3, Vec3};

use super::motion::Motion;
use super::{DeviceDescription, DeviceError, DeviceSample, HapticDevice, Wrench};

/// The longest step in which the motion is integrated, in seconds. Usually 20 µs: the lightest device, of 0.05 kg, in
/// the stiffest hand, of 500 N/m, on a wall of 5,000 N/m swings at some 330 rad/s, so a step is below a hundredth of a
/// radian.
const LONGEST_STEP: f64 = 20e-6;

/// A hand that holds the device: a mass on a spring and a damper, whose other end goes where the hand
/// wants to be (N. Hogan, "Controlling impedance at the man/machine interface", IEEE ICRA 1989;
/// R. B. Gillespie, M. Cutkosky, "Stable user-specific haptic rendering of the virtual wall", ASME 1996).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// What of the hand moves with the device, in kilograms. Usually 0 to 0.15.
    pub mass: f64,
    /// In newton seconds per metre, besides the device's own 0.5. Usually 0 (a light grip) to 5.
    pub damping: f64,
    /// In newtons per metre. Usually 50 (a light grip) to 500.
    pub stiffness: f64,
    /// How fast the hand makes up, by eye, for being elsewhere than it wants to be: the share of the way a
    /// second. Usually 0 (without looking) to 3: what the eye sees moves the hand some 0.2 s later (R. C.
    /// Miall et al., "Is the cerebellum a Smith predictor?", J. Motor Behavior 1993).
    pub correction: f64,
}

/// How far from where it wants to be a hand aims at most, to make up for what holds it back, in metres; usually
/// 10 mm: 5 N in a firm grip.
const MOST_CORRECTION: f64 = 0.01;

impl Hand {
    /// A light grip, the hardest case for stability: little damping.
    pub const LIGHT: Self = Self { mass: 0.0, damping: 0.0, stiffness: 50.0, correction: 0.0 };
    /// A firm grip.
    pub const FIRM: Self = Self { mass: 0.15, damping: 5.0, stiffness: 500.0, correction: 0.0 };
    /// A firm grip of somebody who looks.
    pub const GUIDED: Self = Self { correction: 2.0, ..Self::FIRM };
}

/// A desktop device with three actuated axes in the hand of an operator.
///
/// Between two readings the force last written is held, as a real device's amplifiers do, and the motion
/// is integrated in small steps. The same calls give the same bits.
#[derive(Clone, Debug)]
pub struct SimulatedDevice {
    hand: Hand,
    /// Where the hand wants to be.
    intention: Motion,
    position: DVec3,
    velocity: DVec3,
    force: DVec3,
    /// By how much the hand aims beside where it wants to be, in metres.
    aside: DVec3,
    time: f64,
}

impl SimulatedDevice {
    /// The mass of the device as felt at its tip, in kilograms. Usually 0.1 (0.05 to 0.3).
    pub const MASS: f64 = 0.1;
    /// The friction of its joints, in newton seconds per metre. Usually 0.5 (0.1 to 5).
    pub const DAMPING: f64 = 0.5;
    /// What it can do: as a Force Dimension omega.3 has it, by its maker's data sheet, but without the
    /// stiffness that this reaches by damping of its own.
    pub const DESCRIPTION: DeviceDescription = DeviceDescription {
        name: "simulated device",
        rates: [500.0, 4_000.0],
        resolution: 1e-5,
        max_force: 12.0,
        max_torque: 0.0,
        max_stiffness: 5_000.0,
    };

    /// A device at rest, in a hand that wants to follow `intention`.
    #[must_use]
    pub fn new(hand: Hand, intention: Motion) -> Self {
        let position = intention.at(0.0).position.as_dvec3();
        let (velocity, force, aside) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        Self { hand, intention, position, velocity, force, aside, time: 0.0 }
    }

    /// The tip's velocity, in metres per second.
    #[must_use]
    pub fn velocity(&self) -> Vec3 {
        self.velocity.as_vec3()
    }

    /// Semi-implicit Euler, in even steps.
    fn advance(&mut self, time: f64) {
        let elapsed = (time - self.time).max(0.0);
        let steps = (elapsed / LONGEST_STEP).ceil();
        let step = elapsed / steps.max(1.0);
        let mass = Self::MASS + self.hand.mass;
        for index in 0..steps as u64 {
            let now = self.time + index as f64 * step;
            let target = self.intention.at(now).position.as_dvec3();
            let missing = target - self.position;
            self.aside = (self.aside + missing * (self.hand.correction * step))
                .clamp_length_max(MOST_CORRECTION);
            let spring = (missing + self.aside) * self.hand.stiffness;
            let damping = self.velocity * (Self::DAMPING + self.hand.damping);
            self.velocity += (self.force + spring - damping) * (step / mass);
            self.position += self.velocity * step;
        }
        self.time = self.time.max(time);
    }
}

impl HapticDevice for SimulatedDevice {
    fn description(&self) -> DeviceDescription {
        Self::DESCRIPTION
    }

    fn read(&mut self, time: f64) -> Result<DeviceSample, DeviceError> {
        self.advance(time);
        let resolution = f64::from(Self::DESCRIPTION.resolution);
        let position = (self.position / resolution).round() * resolution;
        Ok(DeviceSample { position: position.as_vec3(), ..self.intention.at(time) })
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceError> {
        self.force = wrench.force.as_dvec3();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step of the hand's target: the analytic step response of m·x″ + b·x′ + k·(x − 1 cm) = 0.
    #[test]
    fn step_response() {
        let keyframes = [(0.0, 0.0), (1e-9, 0.01)];
        let keyframes = keyframes.map(|(time, x)| super::super::motion::Keyframe {
            time,
            sample: DeviceSample::at(Vec3::X * x),
        });
        let hand = Hand { mass: 0.1, damping: 1.0, stiffness: 100.0, correction: 0.0 };
        let motion = Motion::new(keyframes).expect("in order");
        let mut device = SimulatedDevice::new(hand, motion);
        let decay: f64 = 1.5 / (2.0 * 0.2);
        let swing = (100.0 / 0.2 - decay * decay).sqrt();
        for tick in 1..500 {
            let time = f64::from(tick) * 1e-3;
            let x = f64::from(device.read(time).expect("always there").position.x);
            let (sin, cos) = (swing * time).sin_cos();
            let expected = 0.01 * (1.0 - (-decay * time).exp() * (cos + decay / swing * sin));
            assert!((x - expected).abs() < 3e-5, "{x} for {expected} at {time} s");
        }
    }

    /// Of the 10 mm by which the force bends the hand little is left after a few seconds.
    #[test]
    fn who_looks_makes_up_for_a_force() {
        let motion = Motion::at_rest(Vec3::ZERO).expect("finite");
        let mut device = SimulatedDevice::new(Hand::GUIDED, motion);
        device.write(Wrench { force: Vec3::Y * 4.0, torque: Vec3::ZERO }).expect("always there");
        let place = device.read(0.2).expect("always there").position;
        assert!(place.y > 0.004, "{place} after 0.2 s");
        let place = device.read(4.0).expect("always there").position;
        assert!(place.length() < 2e-5, "{place} after 4 s");
    }

    #[test]
    fn a_held_force_bends_the_hand() {
        let motion = Motion::at_rest(Vec3::ZERO).expect("finite");
        let mut device = SimulatedDevice::new(Hand::FIRM, motion);
        device.write(Wrench { force: Vec3::Y * 5.0, torque: Vec3::ZERO }).expect("always there");
        let place = device.read(2.0).expect("always there").position;
        assert!(place.abs_diff_eq(Vec3::Y * 0.01, 2e-5), "{place}");
    }

    #[test]
    fn what_has_passed_does_not_pass_again() {
        let read = |times: &[f64]| {
            let motion = Motion::at_rest(Vec3::ZERO).expect("finite");
            let mut device = SimulatedDevice::new(Hand::FIRM, motion);
            let force = Wrench { force: Vec3::Y * 5.0, torque: Vec3::ZERO };
            device.write(force).expect("always there");
            let places =
                times.iter().map(|&time| device.read(time).expect("always there").position);
            places.last()
        };
        assert_eq!(read(&[0.02, 0.01, 0.02]), read(&[0.02]));
    }
}
