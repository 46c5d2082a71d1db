//! A small VE whose callbacks use all that the core offers them.

use core::hint::black_box;

use dualframe_core::contacts::Contacts;
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::{SetupError, StillRunning, TableFull};
use dualframe_core::frame::Frame;
use dualframe_core::inputs::Inputs;
use dualframe_core::unit::UnitId;

/// What may go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    /// A table is full.
    Full(TableFull),
    /// The pipeline could not be built, or not be run.
    Host,
    /// The core did not do what it should.
    Wrong,
}

impl From<TableFull> for Failure {
    fn from(full: TableFull) -> Self {
        Self::Full(full)
    }
}

impl From<SetupError> for Failure {
    fn from(_: SetupError) -> Self {
        Self::Host
    }
}

impl From<StillRunning> for Failure {
    fn from(_: StillRunning) -> Self {
        Self::Host
    }
}

/// Bodies on a line, which push and write to each other.
pub(crate) struct Ve;

impl Environment for Ve {
    type Object = f32;
    type Interaction = u32;
    type Contact = f32;
    type Message = f32;
    type Renderer = u32;
    type Error = Failure;

    fn broad_phase(&self, a: &f32, b: &f32) -> bool {
        black_box(a - b).abs() < 1e6
    }

    fn interacts_within(&self, place: &f32) -> bool {
        black_box(*place) > 0.0
    }

    fn interact(
        &self,
        pair: Pair,
        a: &f32,
        b: &f32,
        state: &mut u32,
        contacts: &mut Contacts<'_, '_, f32>,
    ) -> Result<(), Failure> {
        *state = state.wrapping_add(pair.frame.0);
        contacts.push(&[a - b])?;
        contacts.push(black_box(&[0.1, 0.2][..]))?;
        Ok(())
    }

    fn update(
        &self,
        unit: UnitId,
        _: Frame,
        place: &mut f32,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Failure> {
        for met in inputs.interactions() {
            let push: f32 = met.contacts.flatten().sum();
            *place += 0.001 * push + black_box(*met.state) as f32 * 0.0;
        }
        while let Some((from, letter)) = inputs.next_letter() {
            *place += letter * from.sender as f32 * 0.001;
        }
        #[cfg(feature = "allocate")]
        {
            extern crate alloc;
            *place += *black_box(alloc::boxed::Box::new(*place));
        }
        #[cfg(feature = "index")]
        {
            *place += [1.0, 2.0][black_box(unit.index())];
        }
        // A full pool of letters is no failure of this VE.
        let to = UnitId(black_box(unit.0 ^ 1));
        let _ = inputs.post(to, unit.0, *place);
        Ok(())
    }

    fn render(&self, _: UnitId, _: Frame, place: &f32, _: &mut u32) -> Result<(), Failure> {
        black_box(*place);
        Ok(())
    }

    fn swap(&self, _: Frame, shown: &mut u32) -> Result<(), Failure> {
        *shown += 1;
        Ok(())
    }
}
