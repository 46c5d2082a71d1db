//! The pipeline's tables: units, interactions, results, letters, and the queues between stages.

use crate::contacts::{Pools, Room};
use crate::environment::Environment;
use crate::error::{SetupError, Table, TableFull};
use crate::frame::Frame;
use crate::inbox::{From, Post, Rejected};
use crate::list;
use crate::ring::{IndexRing, QueueSlot, slots_for};
use crate::storage::{Chain, InteractionSlot, Memory, UnitSlot, at, queue_slots};
use crate::sync::site;
use crate::unit::{InteractionId, NONE, UnitId};

/// Queues carry only what nobody has in hand (§4.2).
#[derive(Debug)]
pub(crate) struct Queues<'m> {
    pub(crate) enter: IndexRing<'m>,
    pub(crate) interact: IndexRing<'m>,
    pub(crate) update: IndexRing<'m>,
    /// One for each frame in flight (§5.5).
    pub(crate) render: [IndexRing<'m>; 2],
}

/// Everything that outlives a frame.
pub(crate) struct Tables<'m, E: Environment + ?Sized> {
    pub(crate) units: &'m [UnitSlot<E::Object>],
    pub(crate) interactions: &'m [InteractionSlot<E::Interaction>],
    pub(crate) pools: Pools<'m, E::Contact>,
    pub(crate) post: Post<'m, E::Message>,
    pub(crate) queues: Queues<'m>,
    /// Candidate slots claimed in each frame in flight (spatial broad phase).
    found: [Room; 2],
}

/// The largest table whose indices leave room for `NONE` and for doubling.
const MOST: usize = (u32::MAX / 2) as usize;

fn check(table: Table, capacity: usize, needed: usize) -> Result<(), TableFull> {
    if needed <= capacity { Ok(()) } else { Err(TableFull { table, capacity, needed }) }
}

impl<'m, E: Environment> Tables<'m, E> {
    pub(crate) fn new(memory: Memory<'m, E>, modelled: bool) -> Result<Self, SetupError> {
        let Memory { units, interactions, contacts, segments, letters, queues } = memory;
        if units.is_empty() {
            return Err(SetupError::NoUnits);
        }
        check(Table::Units, MOST, units.len())?;
        check(Table::Interactions, MOST, interactions.len())?;
        check(Table::Contacts, MOST, contacts.len())?;
        check(Table::Letters, MOST, letters.len())?;
        let needed = queue_slots(units.len(), interactions.len(), letters.len());
        check(Table::Queues, queues.len(), needed)?;
        if contacts.len() != segments.len() {
            let (contacts, segments) = (contacts.len(), segments.len());
            return Err(SetupError::UnequalContacts { contacts, segments });
        }
        for unit in units.iter_mut() {
            unit.frame.store(0, site::EXCLUSIVE);
            unit.candidates.store(NONE, site::EXCLUSIVE);
            unit.modelled.store(NONE, site::EXCLUSIVE);
            unit.home.store(NONE, site::EXCLUSIVE);
            unit.inbox = crate::inbox::Inbox::new();
            // No rendering precedes the first update: it waits for the frame's opening only.
            unit.pending.arm(1);
            unit.bypasses = unit.solitary;
        }
        if modelled {
            link_modelled(units, interactions)?;
        }
        let mut rest = queues;
        let mut slots = |indices| -> &'m mut [QueueSlot] {
            let (slots, others) = ::core::mem::take(&mut rest)
                .split_at_mut_checked(slots_for(indices))
                .unwrap_or_default();
            rest = others;
            slots
        };
        let mut ring = |indices| IndexRing::new(slots(indices));
        let queues = Queues {
            enter: ring(units.len())?,
            interact: ring(interactions.len())?,
            update: ring(units.len())?,
            render: [ring(units.len())?, ring(units.len())?],
        };
        let post = Post::new(letters, slots(letters.len()))?;
        Ok(Self {
            units,
            interactions,
            pools: Pools::new(contacts, segments),
            post,
            queues,
            found: [Room::new(), Room::new()],
        })
    }
}

/// Strings every unit's modelled interactions on its list, in the order of their slots. A unit
/// without any is solitary.
fn link_modelled<O, I>(
    units: &mut [UnitSlot<O>],
    interactions: &[InteractionSlot<I>],
) -> Result<(), SetupError> {
    for (index, slot) in interactions.iter().enumerate().rev() {
        let [a, b] = slot.ends();
        if a == b || a.index().max(b.index()) >= units.len() {
            return Err(SetupError::BadEnds { interaction: index, ends: [a, b] });
        }
        slot.join([a.min(b), a.max(b)]);
        slot.arrivals.arm(2);
        for end in [a, b] {
            let head = &units[end.index()].modelled;
            slot.set_next(Chain::Modelled, end, head.load(site::EXCLUSIVE));
            head.store(index as u32, site::EXCLUSIVE);
        }
    }
    for unit in units {
        unit.bypasses = unit.modelled.load(site::EXCLUSIVE) == NONE;
    }
    Ok(())
}

impl<'m, E: Environment + ?Sized> Tables<'m, E> {
    /// A unit that the protocol names; not one that a host names.
    #[inline]
    pub(crate) fn unit(&self, unit: UnitId) -> &UnitSlot<E::Object> {
        // SAFETY: what travels was counted up to the number of units (PROTOCOL.md §9).
        unsafe { at(self.units, unit.index()) }
    }

    /// An interaction that the protocol names.
    #[inline]
    pub(crate) fn interaction(&self, id: InteractionId) -> &InteractionSlot<E::Interaction> {
        // SAFETY: what travels was counted up to the number of slots (PROTOCOL.md §9).
        unsafe { at(self.interactions, id.index()) }
    }

    /// Posts `message` to a unit that a host names.
    pub(crate) fn post(
        &self,
        to: UnitId,
        stamp: Frame,
        from: From,
        message: E::Message,
    ) -> Result<(), Rejected<E::Message>> {
        let Some(unit) = self.units.get(to.index()) else {
            let (capacity, needed) = (self.units.len(), to.index().saturating_add(1));
            let full = TableFull { table: Table::Units, capacity, needed };
            return Err(Rejected { message, full });
        };
        self.post.post(&unit.inbox, stamp, from, message)
    }

    /// A slot for a pair found in `frame`: even frames have the first half of the slots.
    pub(crate) fn claim_candidate(&self, frame: Frame) -> Result<InteractionId, TableFull> {
        let half = (self.interactions.len() / 2) as u32;
        let claimed = self.found[frame.parity()].claim(1, half, Table::Interactions)?;
        Ok(InteractionId(claimed + frame.parity() as u32 * half))
    }

    /// Candidate slots that `frame` has claimed so far.
    pub(crate) fn candidates_used(&self, frame: Frame) -> u32 {
        self.found[frame.parity()].used()
    }

    /// Empties what belonged to the frame before last, of the same parity as `frame`.
    pub(crate) fn reset_pools(&self, frame: Frame) {
        self.found[frame.parity()].reset();
        self.pools.reset(frame);
    }

    /// Puts `id` onto `unit`'s list of this frame's candidates.
    pub(crate) fn push_candidate(&self, id: InteractionId, unit: UnitId) {
        let head = &self.unit(unit).candidates;
        let slot = self.interaction(id);
        let mut first = head.load(site::LIST_FOLLOW);
        loop {
            slot.set_next(Chain::Candidates, unit, first);
            match head.exchange(first, id.0, site::CANDIDATE_PUSH) {
                Ok(_) => return,
                Err(found) => first = found,
            }
        }
    }

    /// Brings `unit`'s candidates into pair order and returns the first. The caller has the unit
    /// exclusively.
    pub(crate) fn sort_candidates(&self, unit: UnitId) -> u32 {
        let slot = |index| self.interaction(InteractionId(index));
        list::sort(
            self.unit(unit).candidates.load(site::CANDIDATE_HEAD),
            |index| slot(index).next(Chain::Candidates, unit),
            |index, to| slot(index).set_next(Chain::Candidates, unit, to),
            |a, b| (slot(a).other(unit), a) < (slot(b).other(unit), b),
        )
    }
}
