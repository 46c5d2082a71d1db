//! A mouse as the tool: positions are set from outside, forces are only told.

use std::fmt;

use dualframe_core::latest::{Latest, Reader, Writer};
use glam::Vec3;

use super::{DeviceDescription, DeviceError, DeviceSample, HapticDevice, Wrench};

/// The greatest force that is computed, in newtons; usually 10, about what desktop devices exert.
const FORCE: f32 = 10.0;
/// The greatest stiffness by which it is, in newtons per metre; usually 2,000, likewise.
const STIFFNESS: f32 = 2_000.0;
/// A writer, one reader, and one slot to write into.
const SLOTS: usize = 3;

/// What joins a window, which knows where the mouse is, with the haptic loop.
#[derive(Debug)]
pub struct Mouse(Latest<DeviceSample, SLOTS>);

impl Mouse {
    /// A mouse at a place, no button pressed.
    #[must_use]
    pub fn new(position: Vec3) -> Self {
        Self(Latest::new(DeviceSample::at(position)))
    }

    /// The window's end and the device.
    #[expect(
        clippy::missing_panics_doc,
        reason = "a cell that is borrowed alone has no reader yet"
    )]
    pub fn split(&mut self) -> (MouseInput<'_>, MouseDevice<'_>) {
        let (writer, readers) = self.0.split();
        let reader = readers.reader().expect("the first reader");
        (MouseInput(writer), MouseDevice(reader))
    }
}

/// Where positions are set.
pub struct MouseInput<'c>(Writer<'c, DeviceSample, SLOTS>);

impl MouseInput<'_> {
    /// The tool is here now. Waits for nobody.
    pub fn set(&mut self, sample: DeviceSample) {
        self.0.publish(sample);
    }
}

/// A device whose positions are set by a [`MouseInput`]. It exerts nothing; its forces are those that a
/// usual desktop device would exert, for a person to see.
pub struct MouseDevice<'c>(Reader<'c, DeviceSample, SLOTS>);

impl HapticDevice for MouseDevice<'_> {
    fn description(&self) -> DeviceDescription {
        let (max_force, max_stiffness) = (FORCE, STIFFNESS);
        DeviceDescription { max_force, max_stiffness, ..DeviceDescription::without_forces("mouse") }
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        Ok(self.0.read())
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        Ok(())
    }
}

impl fmt::Debug for MouseInput<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MouseInput").finish_non_exhaustive()
    }
}

impl fmt::Debug for MouseDevice<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MouseDevice").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn says_what_was_set() {
        let mut mouse = Mouse::new(Vec3::X);
        // A mouse may be split anew once both ends are gone.
        for place in [Vec3::Y, Vec3::Z] {
            let (mut input, mut device) = mouse.split();
            input.set(DeviceSample { buttons: 2, ..DeviceSample::at(place) });
            let sample = device.read(0.0).expect("a mouse is always there");
            assert_eq!((sample.position, sample.buttons), (place, 2));
        }
    }
}
