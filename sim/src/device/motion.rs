//! Scripted motion: a tool that follows keyframes.

use std::sync::Arc;

use glam::Vec3;
use thiserror::Error;

use super::{DeviceDescription, DeviceError, DeviceSample, FARTHEST, HapticDevice, Wrench};
use crate::geometry::rotation::{between, unit};

/// Where a tool is at one moment of a script.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keyframe {
    /// In seconds on the haptic loop's clock.
    pub time: f64,
    /// What the device says then. Its buttons hold until the next keyframe.
    pub sample: DeviceSample,
}

/// Keyframes that are no script.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum MotionError {
    /// There is none.
    #[error("a motion without keyframes")]
    Empty,
    /// A time, a place or an orientation that is not finite, or an orientation of no length, or of one beyond numbers.
    #[error("keyframe {index} has a number that is not finite, or no orientation")]
    NonFinite {
        /// The keyframe, from 0.
        index: usize,
    },
    /// A place where no hand is.
    #[error("keyframe {index} is more than {FARTHEST} m away along an axis")]
    TooFar {
        /// The keyframe, from 0.
        index: usize,
    },
    /// A keyframe that is not later than the one before it.
    #[error("keyframe {index} is not later than the one before it")]
    Order {
        /// The keyframe, from 0.
        index: usize,
    },
}

/// A motion through keyframes: straight and even between two of them, at rest before the first and after
/// the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion(Arc<[Keyframe]>);

impl Motion {
    /// A motion through some keyframes, in order of time. Orientations are taken to unit length.
    ///
    /// # Errors
    /// [`MotionError`]: no keyframe, one out of order, one too far away, or one with a number that is not finite.
    pub fn new(keyframes: impl IntoIterator<Item = Keyframe>) -> Result<Self, MotionError> {
        let mut keyframes: Vec<_> = keyframes.into_iter().collect();
        let mut last = f64::NEG_INFINITY;
        for (index, Keyframe { time, sample }) in keyframes.iter_mut().enumerate() {
            sample.orientation = unit(sample.orientation.to_array());
            let turned = DeviceSample { position: Vec3::ZERO, ..*sample };
            if !(time.is_finite() && sample.position.is_finite() && turned.is_valid()) {
                return Err(MotionError::NonFinite { index });
            }
            if !sample.is_valid() {
                return Err(MotionError::TooFar { index });
            }
            if *time <= last {
                return Err(MotionError::Order { index });
            }
            last = *time;
        }
        if keyframes.is_empty() { Err(MotionError::Empty) } else { Ok(Self(keyframes.into())) }
    }

    /// A tool that rests.
    ///
    /// # Errors
    /// [`MotionError::NonFinite`], [`MotionError::TooFar`].
    pub fn at_rest(position: Vec3) -> Result<Self, MotionError> {
        Self::new([Keyframe { time: 0.0, sample: DeviceSample::at(position) }])
    }

    /// Where the tool is at a time, in seconds.
    #[must_use]
    pub fn at(&self, time: f64) -> DeviceSample {
        let next = self.0.partition_point(|keyframe| keyframe.time <= time);
        let Some(from) = next.checked_sub(1) else { return self.0[0].sample };
        let (from, Some(to)) = (&self.0[from], self.0.get(next)) else {
            return self.0[from].sample;
        };
        let share = ((time - from.time) / (to.time - from.time)) as f32;
        DeviceSample {
            position: from.sample.position.lerp(to.sample.position, share),
            orientation: between(from.sample.orientation, to.sample.orientation, share),
            buttons: from.sample.buttons,
        }
    }

    /// When the last keyframe is, in seconds.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.0.last().map_or(0.0, |keyframe| keyframe.time)
    }
}

/// A device that follows a script, whatever force it is given.
#[derive(Clone, Debug)]
pub struct ScriptedDevice(Motion);

impl ScriptedDevice {
    /// A device that follows `motion`.
    #[must_use]
    pub fn new(motion: Motion) -> Self {
        Self(motion)
    }
}

impl HapticDevice for ScriptedDevice {
    fn description(&self) -> DeviceDescription {
        DeviceDescription::without_forces("scripted motion")
    }

    fn read(&mut self, time: f64) -> Result<DeviceSample, DeviceError> {
        Ok(self.0.at(time))
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::behavior::{self as scripted, Scripted};

    fn keyframe(time: f64, x: f32, buttons: u32) -> Keyframe {
        let orientation = Quat::from_rotation_z(x);
        Keyframe { time, sample: DeviceSample { position: Vec3::X * x, orientation, buttons } }
    }

    #[test]
    fn between_keyframes_and_beyond_them() {
        let motion = Motion::new([keyframe(1.0, 0.0, 1), keyframe(3.0, 0.5, 2)]).expect("in order");
        for (time, x, buttons) in [(0.0, 0.0, 1), (1.0, 0.0, 1), (2.0, 0.25, 1), (4.0, 0.5, 2)] {
            let sample = motion.at(time);
            assert_eq!((sample.position, sample.buttons), (Vec3::X * x, buttons), "{time} s");
            assert!(sample.orientation.angle_between(Quat::from_rotation_z(x)) < 1e-3);
        }
    }

    #[test]
    fn no_script() {
        assert_eq!(Motion::new([]), Err(MotionError::Empty));
        let order = [keyframe(1.0, 0.0, 0), keyframe(1.0, 0.0, 0)];
        assert_eq!(Motion::new(order), Err(MotionError::Order { index: 1 }));
        let broken = [keyframe(f64::NAN, 0.0, 0)];
        assert_eq!(Motion::new(broken), Err(MotionError::NonFinite { index: 0 }));
        for none in [0.0, 1e-30, 1e30, f32::NAN] {
            let mut none_at_all = keyframe(0.0, 0.0, 0);
            none_at_all.sample.orientation = Quat::from_xyzw(none, 0.0, 0.0, 0.0);
            let made = Motion::new([none_at_all]);
            assert_eq!(made, Err(MotionError::NonFinite { index: 0 }), "{none}");
        }
        let mut far = [keyframe(0.0, 0.0, 0), keyframe(1.0, 0.0, 0)];
        far[1].sample.position.z = 150.0;
        let error = Motion::new(far).expect_err("no hand is there");
        assert_eq!(error.to_string(), "keyframe 1 is more than 100 m away along an axis");
    }

    /// A tool's orientations are part of a simulation's state: the same bits as of anything scripted, and so on
    /// every machine.
    #[test]
    fn orientations_are_those_of_scripted_objects() {
        let rotations = [[0.1, -0.7, 0.3, 0.4], [0.9, 0.2, -0.1, -0.6], [-0.3, 0.5, 0.8, 0.2]];
        let mut keyframes = [0, 1, 2].map(|second| keyframe(f64::from(second), 0.0, 0));
        for (keyframe, rotation) in keyframes.iter_mut().zip(rotations) {
            keyframe.sample.orientation = Quat::from_array(rotation);
        }
        let motion = Motion::new(keyframes).expect("in order");
        let scripted = (0..3_u64).map(|second| scripted::Keyframe {
            frame: 64 * second,
            position: Vec3::ZERO,
            rotation: motion.at(second as f64).orientation,
        });
        let scripted = Scripted::new(scripted.collect()).expect("in order");
        for frame in 0..=128 {
            let orientation = motion.at(frame as f64 / 64.0).orientation;
            assert_eq!(orientation, scripted.at(frame).rotation, "frame {frame}");
            let length: f32 = orientation.to_array().iter().map(|part| part * part).sum();
            assert!((length - 1.0).abs() < 1e-6, "{length}");
        }
    }
}
