//! The haptic loop in its thread: it ticks, tells the simulation, stops when dropped, and goes on after
//! a device's error. No times are asserted.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::thread::{scope, sleep};
use std::time::Duration;

use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::{HapticLink, SimulationEnd, ToolState};
use dualframe_sim::device::model::LocalModel;
use dualframe_sim::device::motion::Motion;
use dualframe_sim::device::mouse::Mouse;
use dualframe_sim::device::operator::{Hand, SimulatedDevice};
use dualframe_sim::device::thread::{HapticLoop, HapticThread, LoopError, RATE};
use dualframe_sim::device::{DeviceDescription, DeviceError, DeviceSample, HapticDevice, Wrench};
use glam::{Mat3, Vec3};

/// A device that counts, and that fails at each third reading.
struct Faulty {
    reads: Arc<AtomicU64>,
    writes: Arc<AtomicU64>,
}

impl HapticDevice for Faulty {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        match self.reads.fetch_add(1, Ordering::SeqCst) % 3 {
            0 => Ok(DeviceSample::at(Vec3::X)),
            1 => Err(DeviceError::Timeout),
            _ => Ok(DeviceSample::at(Vec3::NAN)),
        }
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        self.writes.fetch_add(1, Ordering::SeqCst);
        Ok(())
    }
}

/// Waits until the loop says something.
fn until(end: &mut SimulationEnd<'_>, said: impl Fn(&ToolState) -> bool) -> ToolState {
    loop {
        let tool = end.tool();
        if said(&tool) {
            return tool;
        }
        sleep(Duration::from_millis(1));
    }
}

#[test]
fn ticks_and_tells_what_the_mouse_does() {
    let (mut link, mut mouse) = (HapticLink::new(), Mouse::new(Vec3::ZERO));
    let (end, mut simulation) = link.split();
    let (mut input, device) = mouse.split();
    scope(|scope| {
        let settings = ForceSettings::default();
        let haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        println!("{}", haptics.priority());
        input.set(DeviceSample::at(Vec3::Y));
        let tool = until(&mut simulation, |tool| tool.sample.position == Vec3::Y);
        assert!(tool.ticks.due > 0 && tool.time > 0.0);
        let model = LocalModel { time: tool.time, ..LocalModel::FREE };
        simulation.deliver(model).expect("finite");
        until(&mut simulation, |tool| tool.forces.models == 1);
    });
}

#[test]
fn stops_when_dropped_and_lets_go() {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let (reads, writes) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(0)));
    let device = Faulty { reads: Arc::clone(&reads), writes: Arc::clone(&writes) };
    scope(|scope| {
        let settings = ForceSettings::default();
        let haptics = HapticThread::spawn(scope, device, end, settings, 500.0).expect("it starts");
        until(&mut simulation, |tool| tool.ticks.due > 3);
        drop(haptics);
        let stopped = reads.load(Ordering::SeqCst);
        sleep(Duration::from_millis(20));
        assert_eq!(reads.load(Ordering::SeqCst), stopped, "it ticks on");
        let written = writes.load(Ordering::SeqCst);
        assert_eq!(written, stopped + 1, "one write a tick, and one that lets go");
    });
}

/// A tool that was pressed when its loop was stopped: the simulation is told that nobody reads or pushes it any more.
#[test]
fn a_loop_that_is_stopped_says_so() {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let place = Motion::at_rest(Vec3::X).expect("finite");
    let device = SimulatedDevice::new(Hand::FIRM, place);
    scope(|scope| {
        // However long this thread is held up, the force does not fade.
        let settings = ForceSettings { timeout: 1e9, ..ForceSettings::default() };
        let haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        let force = Vec3::Y * 5.0;
        simulation.deliver(LocalModel { force, ..LocalModel::FREE }).expect("finite");
        let pushed = until(&mut simulation, |tool| tool.wrench.force.y > 0.0);
        assert!(pushed.is_fresh);
        drop(haptics);
        let last = simulation.tool();
        assert_eq!((last.is_fresh, last.fault, last.wrench), (false, None, Wrench::default()));
        assert!(last.time >= pushed.time && last.sample.position.distance(Vec3::X) < 0.1);
    });
}

/// However late a tick is, those that were due until then were counted, and no others.
#[test]
fn as_many_ticks_are_due_as_periods_have_passed() {
    let (mut link, mut mouse) = (HapticLink::new(), Mouse::new(Vec3::ZERO));
    let ((end, mut simulation), (_, device)) = (link.split(), mouse.split());
    scope(|scope| {
        let settings = ForceSettings::default();
        let _haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        for due in [1, 10, 30] {
            let tool = until(&mut simulation, |tool| tool.ticks.due >= due);
            assert_eq!(tool.ticks.due, 1 + (tool.time * RATE) as u64, "{tool:?}");
        }
    });
}

#[test]
fn goes_on_after_errors() {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let device = Faulty { reads: Arc::default(), writes: Arc::default() };
    scope(|scope| {
        let settings = ForceSettings::default();
        let _haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        until(&mut simulation, |tool| tool.fault == Some(DeviceError::Timeout));
        let tool = until(&mut simulation, |tool| tool.fault == Some(DeviceError::InvalidPose));
        assert_eq!(tool.sample.position, Vec3::X, "the last place that it told");
        let tool = until(&mut simulation, |tool| tool.fault.is_none() && tool.ticks.failed > 3);
        assert!(tool.ticks.failed < tool.ticks.due);
    });
}

/// A device that tells where it is, and takes no force.
struct Deaf;

impl HapticDevice for Deaf {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        Ok(DeviceSample::at(Vec3::X))
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceError> {
        Err(DeviceError::Timeout)
    }
}

#[test]
fn a_device_that_takes_no_force_is_told_of() {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let mut haptics = HapticLoop::new(Deaf, end, ForceSettings::default());
    haptics.tick(0.0);
    let tool = simulation.tool();
    assert_eq!((tool.is_fresh, tool.sample.position), (true, Vec3::X));
    assert_eq!((tool.fault, tool.ticks.failed), (Some(DeviceError::Timeout), 1));
}

/// A device that is pressed 5 mm deep into what the simulation tells, and whose driver panics as soon as a force is
/// exerted. It keeps the last force.
struct Panicking(Arc<AtomicU32>);

impl HapticDevice for Panicking {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        assert_eq!(self.0.load(Ordering::SeqCst), 0, "a force is exerted");
        Ok(DeviceSample::at(Vec3::Y * -5e-3))
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceError> {
        self.0.store(wrench.force.length().to_bits(), Ordering::SeqCst);
        Ok(())
    }
}

#[test]
fn a_driver_that_panics_lets_go_and_is_told() {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let force = Arc::new(AtomicU32::new(0));
    let device = Panicking(Arc::clone(&force));
    scope(|scope| {
        let settings = ForceSettings::default();
        let haptics = HapticThread::spawn(scope, device, end, settings, RATE).expect("it starts");
        let force = Vec3::Y * 5.0;
        simulation.deliver(LocalModel { force, ..LocalModel::FREE }).expect("finite");
        let told = until(&mut simulation, |tool| tool.fault.is_some());
        assert_eq!(told.fault, Some(DeviceError::Panicked));
        assert_eq!((told.wrench, told.ticks.failed), (Wrench::default(), 1));
        assert!(told.time > 0.0 && told.sample.position == Vec3::Y * -5e-3);
        drop(haptics);
    });
    assert_eq!(f32::from_bits(force.load(Ordering::SeqCst)), 0.0, "the force stays on the hand");
}

#[test]
fn a_loop_that_is_too_slow_is_refused() {
    let (mut link, mut mouse) = (HapticLink::new(), Mouse::new(Vec3::ZERO));
    let ((end, _), (_, device)) = (link.split(), mouse.split());
    scope(|scope| {
        let spawned = HapticThread::spawn(scope, device, end, ForceSettings::default(), 99.0);
        let error = spawned.expect_err("no such rate");
        assert_eq!(error.to_string(), "a haptic loop at 99 Hz: mouse takes 100 to 4000 Hz");
    });
}

#[test]
fn rates_are_the_devices() {
    for rate in [100.0, 4_001.0, f64::NAN] {
        let mut link = HapticLink::new();
        let (end, _) = link.split();
        let device = Faulty { reads: Arc::default(), writes: Arc::default() };
        scope(|scope| {
            let spawned = HapticThread::spawn(scope, device, end, ForceSettings::default(), rate);
            let error = spawned.expect_err("no such rate");
            assert!(matches!(error, LoopError::Rate { .. }));
            assert!(error.to_string().contains("takes 500 to 4000 Hz"), "{error}");
        });
    }
}

#[test]
fn settings_are_positive_numbers() {
    let settings = ForceSettings::default();
    let wrong = [
        (ForceSettings { max_step: -0.5, ..settings }, "the greatest step of the force", "-0.5"),
        (
            ForceSettings { max_torque_step: f32::NAN, ..settings },
            "the greatest step of the torque",
            "NaN",
        ),
        (ForceSettings { entry: -1.0, ..settings }, "the time in which a model comes in", "-1"),
        (
            ForceSettings { timeout: f64::NAN, ..settings },
            "the time after which forces fade",
            "NaN",
        ),
        (ForceSettings { fade: f64::INFINITY, ..settings }, "the time in which forces fade", "inf"),
        (ForceSettings { max_damping: -2.0, ..settings }, "the greatest damping", "-2"),
    ];
    for (settings, what, value) in wrong {
        let mut link = HapticLink::new();
        let (end, _) = link.split();
        let device = Faulty { reads: Arc::default(), writes: Arc::default() };
        scope(|scope| {
            let spawned = HapticThread::spawn(scope, device, end, settings, RATE);
            let error = spawned.map(|_| ()).expect_err("no such settings").to_string();
            assert_eq!(error, format!("{what} is {value}, which must be a number from 0 on"));
        });
    }
}

/// A device at which something has gone wrong.
struct Astray;

impl HapticDevice for Astray {
    fn description(&self) -> DeviceDescription {
        SimulatedDevice::DESCRIPTION
    }

    fn read(&mut self, _time: f64) -> Result<DeviceSample, DeviceError> {
        Ok(DeviceSample::at(Vec3::Y * -1e36))
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceError> {
        assert!(wrench.force.is_finite() && wrench.torque.is_finite(), "{wrench:?}");
        Ok(())
    }
}

/// A wall below y = 0, of 2 N/mm.
fn wall() -> LocalModel {
    let gradient = Mat3::from_diagonal(Vec3::new(0.0, -2_000.0, 0.0));
    LocalModel { gradient, normal: Some(Vec3::Y), ..LocalModel::FREE }
}

#[test]
fn a_place_where_no_hand_is_is_no_place() {
    let mut link = HapticLink::new();
    let (end, mut simulation) = link.split();
    let mut haptics = HapticLoop::new(Astray, end, ForceSettings::default());
    simulation.deliver(wall()).expect("finite");
    for tick in 1..=3 {
        assert_eq!(haptics.tick(f64::from(tick) / RATE), Wrench::default());
    }
    let tool = simulation.tool();
    assert_eq!((tool.fault, tool.ticks.failed), (Some(DeviceError::InvalidPose), 3));
}

#[test]
fn a_link_that_is_split_anew_has_forgotten() {
    let mut link = HapticLink::new();
    for _ in 0..2 {
        let (end, mut simulation) = link.split();
        assert_eq!(simulation.tool().ticks.due, 0);
        let device = Faulty { reads: Arc::default(), writes: Arc::default() };
        let mut haptics = HapticLoop::new(device, end, ForceSettings::default());
        haptics.tick(1.0 / RATE);
        assert_eq!(simulation.tool().forces.models, 0);
        simulation.deliver(wall()).expect("finite");
        // Two of these readings fail.
        (2..=4).for_each(|tick| _ = haptics.tick(f64::from(tick) / RATE));
        let tool = simulation.tool();
        assert_eq!((tool.forces.models, tool.ticks.due), (1, 4));
    }
}
