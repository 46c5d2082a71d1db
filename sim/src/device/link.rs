//! What the haptic loop and the simulation tell each other, each at its own rate.

use std::fmt;

use dualframe_core::latest::{Latest, Reader, Writer};
use glam::Vec3;

use super::figures::{Forces, Ticks};
use super::model::{LocalModel, ModelError};
use super::{DeviceError, DeviceSample, Wrench};

/// A writer, one reader, and one slot to write into.
const SLOTS: usize = 3;

/// The tool, as the haptic loop last had it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolState {
    /// When it was read, or that was tried, in seconds on the loop's clock. A local model that is computed from it
    /// takes it over.
    pub time: f64,
    /// The last sample.
    pub sample: DeviceSample,
    /// Whether that was read then; else it is an older one, as after the loop was stopped.
    pub is_fresh: bool,
    /// What is being exerted.
    pub wrench: Wrench,
    /// Why the device cannot be read or written just now, if it cannot.
    pub fault: Option<DeviceError>,
    /// When ticks began.
    pub ticks: Ticks,
    /// What was exerted, and how good it was.
    pub forces: Forces,
}

impl ToolState {
    /// Before the first tick.
    fn unseen() -> Self {
        Self {
            time: 0.0,
            sample: DeviceSample::at(Vec3::ZERO),
            is_fresh: false,
            wrench: Wrench::default(),
            fault: None,
            ticks: Ticks::default(),
            forces: Forces::default(),
        }
    }
}

/// What the loop goes by until it is told something.
const NO_MODEL: Numbered = (0, LocalModel::FREE);

/// A local model with its number, from 1; 0 for none.
pub(super) type Numbered = (u64, LocalModel);

/// The two cells between the loop and the simulation. Neither end ever waits for the other.
#[derive(Debug)]
pub struct HapticLink {
    tools: Latest<ToolState, SLOTS>,
    models: Latest<Numbered, SLOTS>,
}

impl Default for HapticLink {
    fn default() -> Self {
        Self::new()
    }
}

impl HapticLink {
    /// A link over which nothing was said.
    #[must_use]
    pub fn new() -> Self {
        Self { tools: Latest::new(ToolState::unseen()), models: Latest::new(NO_MODEL) }
    }

    /// The loop's end and the simulation's. Nothing was said over the link then: what was before is forgotten.
    #[expect(
        clippy::missing_panics_doc,
        reason = "cells that are borrowed alone have no reader yet"
    )]
    pub fn split(&mut self) -> (LoopEnd<'_>, SimulationEnd<'_>) {
        let (mut tools_in, tools_out) = self.tools.split();
        let (mut models_in, models_out) = self.models.split();
        tools_in.publish(ToolState::unseen());
        models_in.publish(NO_MODEL);
        let models_out = models_out.reader().expect("the first reader");
        let tools_out = tools_out.reader().expect("the first reader");
        (
            LoopEnd { tools: tools_in, models: models_out },
            SimulationEnd { tools: tools_out, models: models_in, delivered: 0 },
        )
    }
}

/// What the haptic loop holds.
pub struct LoopEnd<'c> {
    tools: Writer<'c, ToolState, SLOTS>,
    models: Reader<'c, Numbered, SLOTS>,
}

impl LoopEnd<'_> {
    /// The newest model and its number.
    pub(super) fn model(&mut self) -> Numbered {
        self.models.read()
    }

    pub(super) fn publish(&mut self, tool: ToolState) {
        self.tools.publish(tool);
    }
}

/// What the simulation holds.
pub struct SimulationEnd<'c> {
    tools: Reader<'c, ToolState, SLOTS>,
    models: Writer<'c, Numbered, SLOTS>,
    delivered: u64,
}

impl SimulationEnd<'_> {
    /// The tool as it last was.
    pub fn tool(&mut self) -> ToolState {
        self.tools.read()
    }

    /// Delivers a local model, also when it is the same as before: it says that the simulation is alive.
    ///
    /// # Errors
    /// [`ModelError::NonFinite`]; nothing is delivered.
    pub fn deliver(&mut self, model: LocalModel) -> Result<(), ModelError> {
        let model = model.checked()?;
        self.delivered += 1;
        self.models.publish((self.delivered, model));
        Ok(())
    }
}

impl fmt::Debug for LoopEnd<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LoopEnd").finish_non_exhaustive()
    }
}

impl fmt::Debug for SimulationEnd<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SimulationEnd").field("delivered", &self.delivered).finish_non_exhaustive()
    }
}
