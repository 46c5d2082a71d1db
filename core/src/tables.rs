//! The pipeline's tables: units, interactions, results, letters, and the queues between stages.

use crate::arrivals::Arrivals;
use crate::contacts::Pools;
use crate::countdown::Countdown;
use crate::environment::Environment;
use crate::error::{SetupError, Table, TableFull};
use crate::frame::Frame;
use crate::homes::{Home, Homes, Queues};
use crate::inbox::{From, Inbox, Post, Rejected};
use crate::list;
use crate::pending::Pending;
use crate::ring::{IndexRing, QueueSlot, slots_for};
use crate::room::{FrameRoom, Room};
use crate::storage::{Chain, InteractionSlot, Memory, UnitSlot, at, queue_slots};
use crate::sync::{CachePadded, site};
use crate::unit::{InteractionId, NONE, UnitId};

/// The frame being gathered. Whoever enters it writes to what is counted here: it is in one cache line,
/// which one worker after the other fetches once; nothing is there that is only read, or it would be fetched twice.
#[derive(Debug)]
pub(crate) struct Gathering {
    /// Units that have not entered it. The last one opens the frame: updates of it may start, and no update of
    /// the frame before is left.
    pub(crate) gate: Countdown,
    /// Candidate slots claimed in each frame in flight (spatial broad phase).
    found: [FrameRoom; 2],
}

/// Everything that outlives a frame.
pub(crate) struct Tables<'m, E: Environment + ?Sized> {
    pub(crate) units: &'m [UnitSlot<E::Object>],
    pub(crate) interactions: &'m [InteractionSlot<E::Interaction>],
    pub(crate) pools: Pools<'m, E::Contact>,
    pub(crate) post: Post<'m, E::Message>,
    pub(crate) queues: Queues<'m>,
    /// Units that have entered the frame being gathered.
    pub(crate) arrivals: Arrivals<'m>,
    /// The units of each home, one home's after another's.
    order: &'m [QueueSlot],
    pub(crate) gathering: CachePadded<Gathering>,
}

/// The largest table whose indices leave room for `NONE` and for doubling.
const MOST: usize = (u32::MAX / 2) as usize;

fn check(table: Table, capacity: usize, needed: usize) -> Result<(), TableFull> {
    if needed <= capacity { Ok(()) } else { Err(TableFull { table, capacity, needed }) }
}

impl<'m, E: Environment> Tables<'m, E> {
    pub(crate) fn new(
        memory: Memory<'m, E>,
        modelled: bool,
        homes: usize,
    ) -> Result<Self, SetupError> {
        let Memory { units, interactions, contacts, segments, letters, queues } = memory;
        if units.is_empty() {
            return Err(SetupError::NoUnits);
        }
        check(Table::Units, MOST, units.len())?;
        check(Table::Interactions, MOST.min(Pending::MOST_INTERACTIONS), interactions.len())?;
        check(Table::Contacts, MOST.min(2 * Room::MOST as usize), contacts.len())?;
        check(Table::Letters, MOST, letters.len())?;
        let needed = queue_slots(units.len(), interactions.len(), letters.len(), homes);
        check(Table::Queues, queues.len(), needed)?;
        if contacts.len() != segments.len() {
            let (contacts, segments) = (contacts.len(), segments.len());
            return Err(SetupError::UnequalContacts { contacts, segments });
        }
        for unit in units.iter_mut() {
            unit.frame.store(0, site::EXCLUSIVE);
            unit.modelled.store(NONE, site::EXCLUSIVE);
            // SAFETY: nobody but this pipeline reaches it, until the next one gives the unit another.
            unit.inbox = unsafe { Inbox::new() };
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
        let (all, shared) = (units.len(), interactions.len().div_ceil(homes));
        let homes = Homes::new(homes, || Ok(Home::new(ring(all)?, ring(shared)?, ring(all)?)))?;
        let queues = Queues { homes, render: [ring(all)?, ring(all)?] };
        let post = Post::new(letters, slots(letters.len()))?;
        let (cells, rest) = rest.split_at_mut_checked(units.len()).unwrap_or_default();
        let arrivals = Arrivals::new(cells);
        let order = rest.get(..units.len()).unwrap_or_default();
        let gathering = Gathering {
            gate: Countdown::new(units.len() as u32),
            found: [FrameRoom::new(), FrameRoom::new()],
        };
        let mut tables = Self {
            units,
            interactions,
            pools: Pools::new(contacts, segments),
            post,
            queues,
            arrivals,
            order,
            gathering: CachePadded::new(gathering),
        };
        let homes = u64::from(tables.queues.homes.count().get());
        let shared = |unit: UnitId| (u64::from(unit.0) * homes).checked_div(units.len() as u64);
        tables.set_homes(|unit| shared(unit).unwrap_or(0) as u32);
        Ok(tables)
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
    /// The home that `unit` was given.
    #[inline]
    pub(crate) fn home_of(&self, unit: UnitId) -> u32 {
        self.unit(unit).home.load(site::HOME)
    }

    /// Gives every unit a home, counted round. Nobody else may use the tables meanwhile.
    pub(crate) fn set_homes(&mut self, home_of: impl Fn(UnitId) -> u32) {
        self.come_for_all();
        let homes = self.queues.homes.count();
        for (index, unit) in self.units.iter().enumerate() {
            unit.home.store(home_of(UnitId(index as u32)) % homes, site::EXCLUSIVE);
        }
        let units = self.units;
        let home_of = |unit: UnitId| {
            units.get(unit.index()).map_or(0, |unit| unit.home.load(site::EXCLUSIVE))
        };
        self.queues.homes.settle(self.order, home_of);
    }

    /// Comes for every unit of an open frame that nobody has come for yet.
    fn come_for_all(&self) {
        for home in self.queues.homes.iter() {
            while let Some(unit) = home.opened.take() {
                if self.unit(UnitId(unit)).pending.arrive() {
                    // A queue has a slot for every index of its table.
                    let _fits = home.update.push(unit);
                }
            }
        }
    }

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
            return Err(Rejected { from, message, full });
        };
        self.post.post(&unit.inbox, stamp, from, message)
    }

    /// Slots for `count` pairs found in `frame`, or for as many as fit: even frames have the first half
    /// of all slots.
    pub(crate) fn claim_candidates(
        &self,
        count: u32,
        frame: Frame,
    ) -> (impl Iterator<Item = InteractionId> + use<E>, Result<(), TableFull>) {
        let half = (self.interactions.len() / 2) as u32;
        let room = &self.gathering.found[frame.parity()];
        let (claimed, outcome) = room.claim(count, half, Table::Interactions);
        let first = frame.parity() as u32 * half;
        (claimed.map(move |place| InteractionId(first + place)), outcome)
    }

    /// Candidate slots that `frame` has asked for so far.
    pub(crate) fn candidates_asked(&self, frame: Frame) -> u32 {
        self.gathering.found[frame.parity()].asked()
    }

    /// Empties what belonged to the frame before last, of the same parity as `frame`.
    pub(crate) fn reset_pools(&self, frame: Frame) {
        self.gathering.found[frame.parity()].reset();
        self.pools.reset(frame);
    }

    /// Puts `ids` onto `unit`'s list of this frame's candidates; its update waits for them.
    pub(crate) fn push_candidates(&self, ids: &[InteractionId], unit: UnitId) {
        let [first, .., last] = ids else {
            return ids.iter().for_each(|&only| self.push_chain(only, only, 1, unit));
        };
        for link in ids.windows(2) {
            self.interaction(link[0]).set_next(Chain::Candidates, unit, link[1].0);
        }
        self.push_chain(*first, *last, ids.len() as u32, unit);
    }

    /// Puts what is linked from `first` to `last`, `count` of them, onto `unit`'s list.
    fn push_chain(&self, first: InteractionId, last: InteractionId, count: u32, unit: UnitId) {
        let link = |next| self.interaction(last).set_next(Chain::Candidates, unit, next);
        self.unit(unit).pending.push(first, count, link);
    }

    /// Brings `unit`'s candidates into pair order. The caller has the unit exclusively.
    pub(crate) fn sort_candidates(&self, unit: UnitId) {
        let pending = &self.unit(unit).pending;
        let slot = |index| self.interaction(InteractionId(index));
        let first = list::sort(
            pending.first(),
            |index| slot(index).next(Chain::Candidates, unit),
            |index, to| slot(index).set_next(Chain::Candidates, unit, to),
            |a, b| (slot(a).other(unit), a) < (slot(b).other(unit), b),
        );
        pending.set_first(first);
    }
}
