//! What a host supplies: objects, interactions, a renderer, and the callbacks of the stages
//! (§5.2). None of it needs `unsafe`.

use crate::contacts::Contacts;
use crate::error::TableFull;
use crate::frame::Frame;
use crate::inputs::Inputs;
use crate::unit::{InteractionId, UnitId};

/// An interaction, as its callbacks see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The interaction's slot.
    pub id: InteractionId,
    /// The frame it is detected in.
    pub frame: Frame,
    /// Its two ends, the lower number first; equal for a unit's interaction within itself.
    pub ends: [UnitId; 2],
}

/// A virtual environment. The core calls it from any worker at any time, but
///
/// - `update` has its object exclusively; detection, response and rendering share objects
///   read-only, several at once;
/// - an object's interactions of a frame all come between its updates of the frame before and of
///   that frame; its rendering comes between its updates of that frame and of the next.
///
/// No update of frame f + 2 comes before the swap of frame f. Its tests and interactions may, under
/// [`Entry::AfterUpdate`](crate::frame::Entry::AfterUpdate): what they count for a frame's swap to read has to be kept
/// for three frames there, not for two.
///
/// A callback that returns an error ends its work unit like one that succeeds: the frame goes on
/// and the error comes out of [`crate::worker::Worker::step`].
///
/// The environment itself need not be `Sync`: each worker may step with a value of its own, which
/// can hold scratch memory.
///
/// # Panics
/// A callback that panics unwinds through `step`, and its work unit is lost: the pipeline stops, soundly, and never
/// finishes; who waits for it waits for good, and no other batch can be run. A host that must go on catches panics in
/// its callbacks, and sees to it that nothing else of its own panics: [`crate::wait::Waiting`], probes, the conversion
/// into [`Self::Error`], and what drops a message.
pub trait Environment {
    /// What a unit holds: one object, or a block of objects.
    type Object: Send + Sync;
    /// State of an interaction of its own: for a modelled interaction it stays from frame to
    /// frame; for one found at run time it is whatever the slot's last user left, memory to
    /// reuse.
    type Interaction: Send + Sync;
    /// A record of an interaction's results.
    type Contact: Copy + Send + Sync;
    /// What units may send each other.
    type Message: Send + Sync;
    /// The graphics context, owned by the render token, or left to all workers.
    type Renderer;
    /// What a callback may fail with.
    type Error: From<TableFull>;

    /// Whether two units may interact this frame: a test of bounding volumes, symmetric.
    fn broad_phase(&self, a: &Self::Object, b: &Self::Object) -> bool;

    /// Whether a unit has an interaction with itself this frame: a block's objects with each
    /// other. Asked by the spatial broad phase only, and not of solitary units.
    fn interacts_within(&self, _block: &Self::Object) -> bool {
        false
    }

    /// Exact detection and, on a hit, response: results go to `contacts` or into `state`, never
    /// into the objects. `a` and `b` are the objects of the first and second of the pair's ends, and the same one for an
    /// interaction within a unit.
    ///
    /// # Errors
    /// The host's; a full table of contacts among them.
    fn interact(
        &self,
        pair: Pair,
        a: &Self::Object,
        b: &Self::Object,
        state: &mut Self::Interaction,
        contacts: &mut Contacts<'_, '_, Self::Contact>,
    ) -> Result<(), Self::Error>;

    /// Brings `object` from the frame before to `frame`: its messages, its interactions' results,
    /// its behaviour.
    ///
    /// # Errors
    /// The host's.
    fn update(
        &self,
        unit: UnitId,
        frame: Frame,
        object: &mut Self::Object,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Self::Error>;

    /// Draws `object` as it is after its update in `frame`.
    ///
    /// # Errors
    /// The host's.
    fn render(
        &self,
        unit: UnitId,
        frame: Frame,
        object: &Self::Object,
        renderer: &mut Self::Renderer,
    ) -> Result<(), Self::Error>;

    /// Shows `frame`: every unit of it has been rendered, none of the next. With several tokens it is called once, with
    /// the renderer of whoever rendered the last unit.
    ///
    /// # Errors
    /// The host's; the frame counts as swapped all the same.
    fn swap(&self, frame: Frame, renderer: &mut Self::Renderer) -> Result<(), Self::Error>;
}
