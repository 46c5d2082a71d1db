use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::Duration;

use super::*;
use crate::device::law::ForceSettings;
use crate::device::link::HapticLink;
use crate::device::operator::SimulatedDevice;
use crate::device::thread::{HapticLoop, HapticThread, RATE};
use crate::device::{DeviceDescription, DeviceError, HapticDevice, Wrench};

/// Where the device is.
const PLACE: Vec3 = Vec3::new(0.0, 0.0, 0.07);

/// A device at rest with its button down, and what becomes of it when it is told to.
struct Failing<'a>(&'a AtomicBool, fn() -> DeviceError);

impl HapticDevice for Failing<'_> {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        let pressed = DeviceSample { buttons: 1, ..DeviceSample::at(PLACE) };
        if self.0.load(Ordering::Relaxed) { Err(self.1()) } else { Ok(pressed) }
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// It is pulled out.
fn unplugged() -> DeviceError {
    DeviceError::Disconnected
}

/// A device that is pulled out with its button down: the simulation knows, and after a while its tool lets go.
#[test]
fn a_device_that_is_gone_is_told_of_and_lets_go() {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let is_gone = AtomicBool::new(false);
    let device = Failing(&is_gone, unplugged);
    let mut feel = Feel::new(simulation);
    let mut ticking = HapticLoop::new(device, end, ForceSettings::default());
    assert_eq!(feel.sample(), None, "nothing was said");
    assert_eq!(feel.told(), None);
    ticking.tick(0.1);
    let pressed = feel.sample().expect("it was said where the device is");
    assert_eq!((pressed.buttons, feel.told().and_then(|told| told.fault)), (1, None));
    is_gone.store(true, Ordering::Relaxed);
    ticking.tick(0.2);
    assert_eq!(feel.sample(), Some(pressed), "for a tick that is missed nobody lets go");
    assert_eq!(feel.told().and_then(|told| told.fault), Some(DeviceError::Disconnected));
    ticking.tick(0.2 + 0.9 * LETS_GO);
    assert_eq!(feel.sample(), Some(pressed), "nor for some");
    ticking.tick(0.2 + 1.1 * LETS_GO);
    assert_eq!(feel.sample(), Some(DeviceSample { buttons: 0, ..pressed }));
    is_gone.store(false, Ordering::Relaxed);
    ticking.tick(0.6);
    assert_eq!(feel.sample(), Some(pressed), "it is there again");
}

/// A driver that hangs, or a loop that was stopped, with the button down: after 0.25 s the tool lets go.
#[test]
fn a_loop_that_says_nothing_lets_go() {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let is_gone = AtomicBool::new(false);
    let device = Failing(&is_gone, unplugged);
    let mut feel = Feel::new(simulation);
    let mut ticking = HapticLoop::new(device, end, ForceSettings::default());
    for tick in 1..=2 {
        ticking.tick(f64::from(tick));
        let mut buttons = || feel.sample().expect("it was said").buttons;
        assert_eq!(buttons(), 1, "after however slow a tick");
        sleep(Duration::from_secs_f64(1.2 * LETS_GO));
        assert_eq!(buttons(), 0);
    }
}

/// A loop that was stopped with the button down is told of.
#[test]
fn a_loop_that_was_stopped_is_told_of() {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let is_gone = AtomicBool::new(false);
    let device = Failing(&is_gone, unplugged);
    let mut feel = Feel::new(simulation);
    scope(|scope| {
        let settings = ForceSettings::default();
        let haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        while feel.sample().is_none_or(|sample| sample.buttons == 0) {
            sleep(Duration::from_millis(1));
        }
        assert!(feel.told().is_some_and(|told| told.is_fresh));
        drop(haptics);
        feel.sample();
        sleep(Duration::from_secs_f64(1.2 * LETS_GO));
        assert_eq!(feel.sample(), Some(DeviceSample::at(PLACE)), "its tool has let go");
    });
    assert!(feel.told().is_some_and(|told| !told.is_fresh && told.ticks.due > 0));
}

/// A loop that is over does not come back: its tool lets go at once.
#[test]
fn a_driver_that_panicked_lets_go_at_once() {
    let mut link = HapticLink::new();
    let (end, simulation) = link.split();
    let panics = AtomicBool::new(false);
    let mut feel = Feel::new(simulation);
    scope(|scope| {
        let (settings, device) =
            (ForceSettings::default(), Failing(&panics, || panic!("it panics")));
        let _haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        while feel.sample().is_none_or(|sample| sample.buttons == 0) {
            sleep(Duration::from_millis(1));
        }
        panics.store(true, Ordering::Relaxed);
        let mut first_after = || {
            let sample = feel.sample();
            let fault = feel.told().and_then(|told| told.fault);
            sample.filter(|_| fault == Some(DeviceError::Panicked))
        };
        let last = loop {
            match first_after() {
                Some(sample) => break sample,
                None => sleep(Duration::from_millis(1)),
            }
        };
        assert_eq!(last, DeviceSample::at(PLACE));
    });
}
