//! The haptic loops of two hands, whose devices are set by the mouse.

use std::fmt;
use std::thread::Scope;

use dualframe_sim::device::figures::{Forces, Ticks};
use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::{HapticLink, SimulationEnd, ToolState};
use dualframe_sim::device::mouse::{Mouse, MouseInput};
use dualframe_sim::device::thread::{HapticThread, LoopError};
use dualframe_sim::scene::craniotomy::TOOLS;
use glam::Vec3;
use serde::Serialize;

/// One for each hand.
pub(super) type Each<T> = [T; TOOLS.len()];

/// What joins two mice with two loops, and those with the simulation.
pub(super) struct Cells {
    /// Where the tools are at the beginning, in metres.
    places: Each<Vec3>,
    links: Each<HapticLink>,
    mice: Each<Mouse>,
}

/// Two loops that run.
pub(super) struct Loops<'scope, 'c> {
    pub(super) threads: Each<HapticThread<'scope>>,
    /// Where the tools are at the beginning, in metres.
    pub(super) places: Each<Vec3>,
    pub(super) inputs: Each<MouseInput<'c>>,
    pub(super) ends: Each<SimulationEnd<'c>>,
}

impl Cells {
    /// For tools at these places.
    pub(super) fn new(places: Each<Vec3>) -> Self {
        Self { places, links: Default::default(), mice: places.map(Mouse::new) }
    }

    /// Starts the loops at `rate` hertz.
    pub(super) fn start<'scope, 'c: 'scope>(
        &'c mut self,
        scope: &'scope Scope<'scope, '_>,
        rate: f64,
    ) -> Result<Loops<'scope, 'c>, LoopError> {
        let start = |link: &'c mut HapticLink, mouse: &'c mut Mouse| {
            let (loop_end, end) = link.split();
            let (input, device) = mouse.split();
            let settings = ForceSettings::at(rate);
            let thread = HapticThread::spawn(scope, device, loop_end, settings, rate)?;
            Ok::<_, LoopError>((thread, input, end))
        };
        let [link, other_link] = &mut self.links;
        let [mouse, other_mouse] = &mut self.mice;
        let (thread, input, end) = start(link, mouse)?;
        let (other_thread, other_input, other_end) = start(other_link, other_mouse)?;
        Ok(Loops {
            threads: [thread, other_thread],
            places: self.places,
            inputs: [input, other_input],
            ends: [end, other_end],
        })
    }
}

/// What a loop measured.
#[derive(Serialize)]
pub(super) struct HapticsReport {
    ticks: u64,
    late_share: f64,
    missed: u64,
    latest_ms: f64,
    models: u64,
    greatest_age_ms: f64,
    error_rms_n: f64,
    greatest_error_n: f32,
    largest_step_n: f32,
    absorbed_j: f64,
    least_absorbed_j: f64,
}

impl From<&ToolState> for HapticsReport {
    fn from(state: &ToolState) -> Self {
        let ToolState { ticks: Ticks { due, missed, latest, .. }, forces, .. } = *state;
        let Forces { models, greatest_age, greatest_error, largest_step, .. } = forces;
        Self {
            ticks: due,
            late_share: state.ticks.late_share(),
            missed,
            latest_ms: latest * 1e3,
            models,
            greatest_age_ms: greatest_age * 1e3,
            error_rms_n: forces.error_rms(),
            greatest_error_n: greatest_error,
            largest_step_n: largest_step,
            absorbed_j: forces.absorbed,
            least_absorbed_j: forces.least_absorbed,
        }
    }
}

impl fmt::Display for HapticsReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { ticks, models, latest_ms, greatest_age_ms, absorbed_j, .. } = self;
        let late = 100.0 * self.late_share;
        write!(f, "haptic loop: {ticks} ticks, {late:.2} % late, {latest_ms:.2} ms at most; ")?;
        write!(f, "{models} models, {greatest_age_ms:.1} ms old at most; ")?;
        let (error_rms, greatest_error) = (self.error_rms_n, self.greatest_error_n);
        write!(
            f,
            "error {error_rms:.3} N, {greatest_error:.2} N at most; {absorbed_j:.3} J absorbed"
        )
    }
}
