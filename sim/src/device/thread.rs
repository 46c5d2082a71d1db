//! The haptic loop's own light thread.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread::{Builder, Scope, ScopedJoinHandle, sleep};
use std::time::{Duration, Instant};
use std::{fmt, io};

use thiserror::Error;

use super::figures::Ticks;
use super::law::{ForceLaw, ForceSettings, SettingsError};
use super::link::{LoopEnd, ToolState};
use super::priority::Priority;
use super::{DeviceError, DeviceSample, HapticDevice, Wrench};

/// The usual rate of the loop, in hertz: 1,000 (§6.3). Stiff contact asks for it; the skin feels up to
/// about that.
pub const RATE: f64 = 1_000.0;
/// The least rate of the loop, in hertz: 100. At less, the damping that bone of K = 2 kN/m takes to be passive, K·T/2,
/// is more than a device of m = 0.1 kg bears, m/T.
pub const MIN_RATE: f64 = 100.0;
/// The greatest rate of the loop, in hertz: 4,000, the most that desktop devices take.
pub const MAX_RATE: f64 = 4_000.0;

/// Why a loop cannot be started.
#[derive(Debug, Error)]
pub enum LoopError {
    /// A rate that the device, or the loop, is not made for.
    #[error("a haptic loop at {rate} Hz: {device} takes {least} to {most} Hz")]
    Rate {
        /// The rate asked for, in hertz.
        rate: f64,
        /// The device.
        device: &'static str,
        /// The least rate, in hertz.
        least: f64,
        /// The greatest rate, in hertz.
        most: f64,
    },
    /// Settings that are none.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The system gives no thread.
    #[error("no thread for the haptic loop: {0}")]
    Thread(#[from] io::Error),
}

/// One tick after the other: reads the device, computes a force and sends it.
///
/// [`HapticThread`] ticks it by the clock; a test or a replay ticks it by hand, and gets the same bits for
/// the same times.
pub struct HapticLoop<'c, D> {
    device: D,
    end: LoopEnd<'c>,
    law: ForceLaw,
    /// Of the last tick.
    time: f64,
    sample: DeviceSample,
    ticks: Ticks,
}

impl<'c, D: HapticDevice> HapticLoop<'c, D> {
    /// A loop that has not ticked. The settings are used as they are: [`ForceSettings::checked`].
    pub fn new(device: D, end: LoopEnd<'c>, settings: ForceSettings) -> Self {
        let law = ForceLaw::new(device.description(), settings);
        let sample = DeviceSample::at(glam::Vec3::ZERO);
        Self { device, end, law, time: 0.0, sample, ticks: Ticks::default() }
    }

    /// A tick at `time` seconds on the loop's clock, which must be more than at the tick before. It never
    /// waits, but for the device.
    pub fn tick(&mut self, time: f64) -> Wrench {
        // Whoever ticks by hand is never late.
        self.ticks.began(0.0, 0);
        self.exert(time)
    }

    fn exert(&mut self, time: f64) -> Wrench {
        self.time = time;
        let (number, model) = self.end.model();
        let read = self.device.read(time).and_then(|sample| {
            if sample.is_valid() { Ok(sample) } else { Err(DeviceError::InvalidPose) }
        });
        let wrench = match &read {
            Ok(sample) => self.law.step(time, sample, (number, &model)),
            Err(_) => self.law.step_blind(),
        };
        let written = self.device.write(wrench);
        self.sample = read.unwrap_or(self.sample);
        self.publish(wrench, read.is_ok(), read.err().or(written.err()));
        wrench
    }

    fn publish(&mut self, wrench: Wrench, is_fresh: bool, fault: Option<DeviceError>) {
        self.ticks.failed += u64::from(fault.is_some());
        let (time, sample, ticks, forces) =
            (self.time, self.sample, self.ticks, *self.law.forces());
        self.end.publish(ToolState { time, sample, is_fresh, wrench, fault, ticks, forces });
    }

    /// The device.
    pub fn device(&self) -> &D {
        &self.device
    }
}

/// The haptic loop in a thread. It sleeps between ticks, takes no lock, and waits for nobody but the
/// device. Dropping it stops the loop, lets the device go without force, tells the simulation that nobody reads it any
/// more, and joins the thread. A driver that panics ends the loop: the device is let go, and the simulation sees
/// [`DeviceError::Panicked`].
#[derive(Debug)]
pub struct HapticThread<'scope> {
    stop: Arc<AtomicBool>,
    priority: Priority,
    thread: Option<ScopedJoinHandle<'scope, ()>>,
}

impl<'scope> HapticThread<'scope> {
    /// Starts a loop at `rate` hertz, usually [`RATE`].
    ///
    /// # Errors
    /// A rate that is not the device's, is below [`MIN_RATE`] or above [`MAX_RATE`]; settings that are none; a thread
    /// that cannot be had.
    pub fn spawn<D: HapticDevice + 'scope>(
        scope: &'scope Scope<'scope, '_>,
        device: D,
        end: LoopEnd<'scope>,
        settings: ForceSettings,
        rate: f64,
    ) -> Result<Self, LoopError> {
        let description = device.description();
        let [least, most] = description.rates;
        let [least, most] = [least.max(MIN_RATE), most.min(MAX_RATE)];
        if !(least..=most).contains(&rate) {
            return Err(LoopError::Rate { rate, device: description.name, least, most });
        }
        let settings = settings.checked()?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let (tell, told) = mpsc::sync_channel(1);
        let mut ticking = HapticLoop::new(device, end, settings);
        let thread = Builder::new().name("haptics".into()).spawn_scoped(scope, move || {
            let priority = Priority::raise();
            // Who asked may have gone meanwhile.
            let _ = tell.send(priority);
            ticking.run(Duration::from_secs_f64(1.0 / rate), &stopped);
        })?;
        let gone = || Priority::Ordinary { reason: "its thread has ended".into() };
        let priority = told.recv().unwrap_or_else(|_| gone());
        Ok(Self { stop, priority, thread: Some(thread) })
    }

    /// Whether the loop runs before other threads. Where it does not, ticks are late under load: that is
    /// to be shown to whoever relies on the forces.
    #[must_use]
    pub fn priority(&self) -> &Priority {
        &self.priority
    }
}

impl Drop for HapticThread<'_> {
    fn drop(&mut self) {
        // Relaxed: the flag orders nothing, and the thread that sees it late stops late.
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A driver that panicked has ended the loop already, and the simulation was told.
            let _ = thread.join();
        }
    }
}

impl<D: HapticDevice> HapticLoop<'_, D> {
    /// Ticks every `period` until it is told to stop, or the driver panics; either way the device lets go.
    fn run(&mut self, period: Duration, stop: &AtomicBool) {
        // What a panic leaves half done is only told from here on.
        let ticking = catch_unwind(AssertUnwindSafe(|| self.tick_until(period, stop)));
        // A device that cannot be told to let go now lets go by its own watchdog.
        let _ = catch_unwind(AssertUnwindSafe(|| self.device.write(Wrench::default())));
        // What was said last would pass for what a hand still does.
        self.publish(Wrench::default(), false, ticking.err().map(|_| DeviceError::Panicked));
    }

    /// A tick that comes too late for the next one leaves that one out: ticks in a burst would be ticks of
    /// no time.
    fn tick_until(&mut self, period: Duration, stop: &AtomicBool) {
        let began = Instant::now();
        let mut due = began;
        while !stop.load(Ordering::Relaxed) {
            sleep(due.saturating_duration_since(Instant::now()));
            let now = Instant::now();
            let lateness = now.saturating_duration_since(due);
            let missed = (lateness.as_nanos() / period.as_nanos()) as u32;
            self.ticks.began(lateness.as_secs_f64(), u64::from(missed));
            self.exert(now.duration_since(began).as_secs_f64());
            due += period * (missed + 1);
        }
    }
}

impl<D: fmt::Debug> fmt::Debug for HapticLoop<'_, D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { device, law, ticks, .. } = self;
        let mut debug = f.debug_struct("HapticLoop");
        debug.field("device", device).field("law", law).field("ticks", ticks);
        debug.finish_non_exhaustive()
    }
}
