//! Devices that a person holds, and the forces they are given (§6.3).
//!
//! A haptic loop must run at about 1 kHz, a pipeline runs at 60 to 300 Hz. So each has its own rate:
//! the loop is a light thread ([`thread`]) that reads the device, computes a force and sends it, and it
//! never waits for the pipeline. What passes between them goes through cells that hold the latest value
//! ([`link`]): the state of the tool one way, a local model of the contact the other ([`model`], the
//! paper's Eq. 1).
//!
//! | room | what it does |
//! |---|---|
//! | [`law`] | the force of each tick, as a state machine stepped by time and sample: new models come in, and forces change, without a kick; the energy that sampling and delay generate is limited; forces fade when no new model comes |
//! | [`model`] | Eq. 1: force and gradient at a place, bounded to what the device can show |
//! | [`proxy`] | contact with a surface: the god-object, and the local model it gives |
//! | [`figures`] | what the loop measures about itself |
//! | [`link`], [`thread`], [`priority`] | the two rates, joined |
//! | [`mouse`], [`motion`], [`operator`] | devices: set from outside, scripted, simulated in a hand |
//!
//! A device of one's own, its loop, and frames that tell it what its tool meets:
//!
//! ```
//! use std::thread::{scope, sleep};
//! use std::time::Duration;
//!
//! use dualframe_sim::device::law::ForceSettings;
//! use dualframe_sim::device::link::HapticLink;
//! use dualframe_sim::device::model::LocalModel;
//! use dualframe_sim::device::thread::{HapticThread, RATE};
//! use dualframe_sim::device::{DeviceDescription, DeviceError, DeviceSample, HapticDevice, Wrench};
//! use dualframe_sim::manager::{Settings, VeManager};
//! use dualframe_sim::render::NullRenderer;
//! use dualframe_sim::scene::ParticleScene;
//! use glam::{Mat3, Vec3};
//!
//! /// A driver would ask its device, and tell it; this one's tip is held 1 mm below the floor.
//! struct Pen;
//!
//! impl HapticDevice for Pen {
//!     fn description(&self) -> DeviceDescription {
//!         let (max_force, max_stiffness) = (3.3, 1_000.0); // N, N/m
//!         DeviceDescription { max_force, max_stiffness, ..DeviceDescription::without_forces("pen") }
//!     }
//!
//!     fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
//!         Ok(DeviceSample::at(Vec3::NEG_Y * 1e-3))
//!     }
//!
//!     fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
//!         Ok(())
//!     }
//! }
//!
//! let mut manager = VeManager::new(ParticleScene::new(10).build()?, Settings::default())?;
//! let mut link = HapticLink::new();
//! let (end, mut simulation) = link.split();
//! scope(|scope| {
//!     let haptics = HapticThread::spawn(scope, Pen, end, ForceSettings::at(RATE), RATE)?;
//!     println!("{}", haptics.priority());
//!     let mut tool = simulation.tool();
//!     // Until the hand feels most of 1 N: models come in over some ticks.
//!     while tool.wrench.force.y < 0.9 {
//!         manager.run(1, &mut NullRenderer::new(), &mut |_| ())?;
//!         tool = simulation.tool();
//!         let (position, stiffness) = (tool.sample.position, 1_000.0);
//!         simulation.deliver(LocalModel {
//!             force: Vec3::NEG_Y * (stiffness * position.y),
//!             gradient: Mat3::from_diagonal(Vec3::NEG_Y * stiffness),
//!             position,
//!             time: tool.time,
//!             normal: Some(Vec3::Y),
//!             ..LocalModel::FREE
//!         })?;
//!         sleep(Duration::from_millis(16)); // for the next picture
//!     }
//!     // Here the loop is dropped: it stops, and lets the device go.
//!     Ok::<(), Box<dyn std::error::Error>>(())
//! })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Positions are in metres, forces in newtons, torques in newton metres, times in seconds on the haptic
//! loop's own clock, which begins with the loop.

mod bone;
mod entry;
pub mod figures;
pub mod law;
pub mod link;
pub mod model;
pub mod motion;
pub mod mouse;
pub mod operator;
mod passivity;
pub mod priority;
pub mod proxy;
mod stiffness;
pub mod thread;
mod watchdog;

use glam::{Quat, Vec3};
use thiserror::Error;

/// What a device says at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceSample {
    /// The place of the tool's tip, in metres.
    pub position: Vec3,
    /// The tool's orientation, of unit length.
    pub orientation: Quat,
    /// A bit for each button that is pressed, the first one lowest.
    pub buttons: u32,
}

/// How far from the origin a tool may be along each axis, in metres; usually 100, farther than any hand.
pub const FARTHEST: f32 = 100.0;

impl DeviceSample {
    /// A tool at a place, upright, no button pressed.
    #[must_use]
    pub fn at(position: Vec3) -> Self {
        Self { position, orientation: Quat::IDENTITY, buttons: 0 }
    }

    /// Whether its place is at most [`FARTHEST`] away along each axis and its orientation, to half a percent, of unit
    /// length: what is computed from it is finite then.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let within = self.position.abs().cmple(Vec3::splat(FARTHEST)).all();
        let square: f32 = self.orientation.to_array().iter().map(|part| part * part).sum();
        within && (square - 1.0).abs() < 0.01
    }
}

/// What a device is told to exert on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// In newtons.
    pub force: Vec3,
    /// In newton metres.
    pub torque: Vec3,
}

/// What a device can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceDescription {
    /// Its name, for people.
    pub name: &'static str,
    /// The least and the greatest rate it may be driven at, in hertz; usually up to 1,000 or 4,000.
    pub rates: [f64; 2],
    /// The steps in which it tells positions, in metres; usually 10⁻⁵ to 6·10⁻⁵; 0 for none.
    pub resolution: f32,
    /// The greatest force, in newtons; usually 3.3 to 12; 0 for a device without forces.
    pub max_force: f32,
    /// The greatest torque, in newton metres; usually 0 (three actuated axes) to 0.4.
    pub max_torque: f32,
    /// The greatest stiffness it can show, in newtons per metre; usually 1,000 to 14,500.
    pub max_stiffness: f32,
}

impl DeviceDescription {
    /// A device that is only read: no forces, any rate up to 4 kHz.
    #[must_use]
    pub fn without_forces(name: &'static str) -> Self {
        let (max_force, max_torque, max_stiffness) = (0.0, 0.0, 0.0);
        let rates = [1.0, 4_000.0];
        Self { name, rates, resolution: 0.0, max_force, max_torque, max_stiffness }
    }
}

/// Why a device could not be read or written. The loop counts it and tries again at the next tick.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum DeviceError {
    /// Nobody answers.
    #[error("the device is not connected")]
    Disconnected,
    /// It did not answer within the time that its driver allows.
    #[error("the device did not answer in time")]
    Timeout,
    /// A place where no hand is, an orientation that is not of unit length, or what is no number.
    #[error(
        "the device told a pose that is none: a number that is not finite, a place more than {FARTHEST} m away, or \
             an orientation that is not of unit length"
    )]
    InvalidPose,
    /// The driver panicked: the loop is over.
    #[error("the device's driver has panicked, and its haptic loop is over")]
    Panicked,
    /// The driver's own error, by its number.
    #[error("the device's driver says error {code}")]
    Driver {
        /// The driver's number for it.
        code: i32,
    },
}

/// A device that a person holds: position, orientation and buttons come in, force and torque go out.
///
/// A driver implements this. It is called by one thread, at the rate of the haptic loop, and should
/// return well within a tick (0.25 to 1 ms): a driver that has to wait does so in a thread of its own.
pub trait HapticDevice: Send {
    /// What it can do. It does not change while the loop runs.
    fn description(&self) -> DeviceDescription;

    /// Where the tool is. `time` is the loop's, in seconds, and never goes back; a real device has no
    /// need of it, a scripted or a simulated one moves by it.
    ///
    /// # Errors
    /// The device cannot be read now.
    fn read(&mut self, time: f64) -> Result<DeviceSample, DeviceError>;

    /// Exerts a force and a torque until the next call.
    ///
    /// # Errors
    /// The device cannot be written now.
    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_tool_can_be_like_is_not_valid() {
        let at = DeviceSample::at;
        assert!(at(Vec3::splat(-FARTHEST)).is_valid());
        for place in [1.01 * FARTHEST, f32::NAN, f32::NEG_INFINITY] {
            assert!(!at(Vec3::Y * place).is_valid(), "{place}");
        }
        let turned = |w: f32| DeviceSample {
            orientation: Quat::from_xyzw(0.6 * w, 0.0, 0.0, 0.8 * w),
            ..at(Vec3::ZERO)
        };
        assert!([1.0, -1.0, 0.998, 1.002].into_iter().all(|length| turned(length).is_valid()));
        for length in [0.0, 1e-30, 0.9, 1.1, 1e20, 1e30, f32::INFINITY, f32::NAN] {
            assert!(!turned(length).is_valid(), "{length}");
        }
    }
}
