//! What an update reads: the unit's letters and its interactions' results, in fixed orders.

use ::core::cell;
use ::core::marker::PhantomData;

use crate::contacts::Segments;
use crate::environment::Environment;
use crate::frame::Frame;
use crate::inbox::{From, Mail, Rejected};
use crate::storage::Chain;
use crate::sync::site;
use crate::tables::Tables;
use crate::unit::{InteractionId, NONE, UnitId};

/// One unit's inputs to one update: for the thread that updates it. Taking them compiles,
///
/// ```
/// use dualframe_core::{environment::Environment, inputs::Inputs};
/// fn shared<T: Sync>(_: &T) {}
/// fn update<E: Environment>(inputs: &Inputs<E>) {}
/// ```
///
/// and sharing them does not:
///
/// ```compile_fail,E0277
/// use dualframe_core::{environment::Environment, inputs::Inputs};
/// fn shared<T: Sync>(_: &T) {}
/// fn update<E: Environment>(inputs: &Inputs<E>) {
///     shared(inputs);
/// }
/// ```
pub struct Inputs<'t, 'm, E: Environment + ?Sized> {
    tables: &'t Tables<'m, E>,
    unit: UnitId,
    frame: Frame,
    mail: Mail<'t, 'm, E::Message>,
    /// Letters posted so far by this update, or rejected: a rejected one keeps its place.
    posted: u32,
    /// Not `Sync`: interactions are sorted by whoever asks for them.
    one_thread: PhantomData<cell::Cell<()>>,
}

/// An interaction that the unit took part in this frame.
#[derive(Debug)]
pub struct Interacted<'t, 'm, I, C> {
    /// The interaction's slot.
    pub id: InteractionId,
    /// The unit at the other end; the same unit for an interaction within it.
    pub other: UnitId,
    /// The interaction's state.
    pub state: &'t I,
    /// Its result records, a slice for each push.
    pub contacts: Segments<'t, 'm, C>,
}

impl<'t, 'm, E: Environment + ?Sized> Inputs<'t, 'm, E> {
    pub(crate) fn new(tables: &'t Tables<'m, E>, unit: UnitId, frame: Frame) -> Self {
        let mail = tables.post.collect(&tables.unit(unit).inbox, frame);
        Self { tables, unit, frame, mail, posted: 0, one_thread: PhantomData }
    }

    /// The unit's interactions of this frame that passed the broad phase, in pair order: by the
    /// other unit's number, and by slot where two units have several. They are sorted where they are:
    /// what an iterator in any order has still to give is then skipped, or given again.
    pub fn interactions(
        &self,
    ) -> impl Iterator<Item = Interacted<'t, 'm, E::Interaction, E::Contact>> + use<'t, 'm, E> {
        self.tables.sort_candidates(self.unit);
        self.interactions_in_any_order()
    }

    /// The same without the price of sorting, for a host that brings what it reads into an order of
    /// its own, or does not depend on one.
    pub fn interactions_in_any_order(
        &self,
    ) -> impl Iterator<Item = Interacted<'t, 'm, E::Interaction, E::Contact>> + use<'t, 'm, E> {
        let (tables, unit) = (self.tables, self.unit);
        let mut next = tables.unit(unit).pending.first();
        ::core::iter::from_fn(move || {
            if next == NONE {
                return None;
            }
            let id = InteractionId(next);
            let slot = tables.interaction(id);
            next = slot.next(Chain::Candidates, unit);
            let first = slot.contacts.load(site::SLOT_FIELD);
            Some(Interacted {
                id,
                other: slot.other(unit),
                // SAFETY: the interaction ended before this update began, and its slot is not
                // used again before this update, which outlives 't's use, has ended.
                state: unsafe { slot.state.with(|state| &*::core::ptr::from_ref(state)) },
                // SAFETY: as above; the frame's pool is reset when the next frame opens, for
                // which this update must have ended.
                contacts: unsafe { tables.pools.segments(first) },
            })
        })
    }

    /// The next letter posted to this unit before this frame, in the order of [`From::is_before`]. Those that are not
    /// taken when the update returns, or fails, are dropped.
    pub fn next_letter(&mut self) -> Option<(From, E::Message)> {
        self.mail.next()
    }

    /// Posts a letter to `to`, who processes it in the next frame's update. Letters of one update
    /// keep their order. Only one unit may post under a `sender` number in a frame: letters of the
    /// same sender and place in the sequence would come in an order that depends on the schedule.
    ///
    /// # Errors
    /// [`Rejected`] with the letter if all letters are under way, or if there is no unit `to`.
    pub fn post(
        &mut self,
        to: UnitId,
        sender: u32,
        message: E::Message,
    ) -> Result<(), Rejected<E::Message>> {
        let from = From { sender, sequence: self.posted };
        self.posted = self.posted.wrapping_add(1);
        self.tables.post(to, self.frame, from, message)
    }
}
