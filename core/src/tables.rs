//! The pipeline's tables: units, interactions, results, letters, and the queues between stages.

use crate::arrivals::Arrivals;
use crate::contacts::{Pools, Room};
use crate::environment::Environment;
use crate::error::{SetupError, Table, TableFull};
use crate::frame::Frame;
use crate::inbox::Post;
use crate::list;
use crate::ring::{IndexRing, QueueSlot, slots_for};
use crate::storage::{Chain, InteractionSlot, Memory, UnitSlot, queue_slots};
use crate::sync::site;
use crate::unit::{InteractionId, NONE, UnitId};

/// The most homes that units are shared out to; workers beyond their number share them.
pub const MOST_HOMES: usize = 16;

/// The queues of the units of one home.
#[derive(Debug)]
pub(crate) struct Home<'m> {
    pub(crate) enter: IndexRing<'m>,
    pub(crate) update: IndexRing<'m>,
}

/// All homes, of which there is at least one.
#[derive(Debug)]
pub(crate) struct Homes<'m> {
    first: Home<'m>,
    others: [Option<Home<'m>>; MOST_HOMES - 1],
}

impl<'m> Homes<'m> {
    fn new(count: usize, mut home: impl FnMut() -> Home<'m>) -> Self {
        let first = home();
        Self { first, others: ::core::array::from_fn(|other| (other + 1 < count).then(&mut home)) }
    }

    /// The number of homes.
    pub(crate) fn count(&self) -> u32 {
        self.iter().count() as u32
    }

    fn iter(&self) -> impl Iterator<Item = &Home<'m>> {
        ::core::iter::once(&self.first).chain(self.others.iter().map_while(Option::as_ref))
    }

    /// A home that there is, by its number.
    #[inline]
    pub(crate) fn at(&self, number: u32) -> &Home<'m> {
        let others = self.others.get((number as usize).wrapping_sub(1));
        others.and_then(Option::as_ref).unwrap_or(&self.first)
    }

    /// All homes, the one of this number before the others.
    #[inline]
    pub(crate) fn from(&self, number: u32) -> impl Iterator<Item = &Home<'m>> {
        let own = self.at(number);
        let others = self.iter().filter(move |&home| !::core::ptr::eq(home, own));
        ::core::iter::once(own).chain(others)
    }
}

/// Queues carry only what nobody has in hand (§4.2).
#[derive(Debug)]
pub(crate) struct Queues<'m> {
    pub(crate) homes: Homes<'m>,
    pub(crate) interact: IndexRing<'m>,
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
    pub(crate) arrivals: Arrivals<'m>,
    /// Candidate slots claimed in each frame in flight (spatial broad phase).
    found: [Room; 2],
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
        check(Table::Interactions, MOST, interactions.len())?;
        check(Table::Contacts, MOST, contacts.len())?;
        check(Table::Letters, MOST, letters.len())?;
        let needed = queue_slots(units.len(), interactions.len(), letters.len(), homes);
        check(Table::Queues, queues.len(), needed)?;
        if contacts.len() != segments.len() {
            let (contacts, segments) = (contacts.len(), segments.len());
            return Err(SetupError::UnequalContacts { contacts, segments });
        }
        for unit in units.iter_mut() {
            unit.frame.store(0, site::EXCLUSIVE);
            unit.candidates.store(NONE, site::EXCLUSIVE);
            unit.modelled.store(NONE, site::EXCLUSIVE);
            unit.inbox = crate::inbox::Inbox::new();
            // No rendering precedes the first update: it waits for the frame's opening only.
            unit.pending.arm(1);
            unit.bypasses = unit.solitary;
        }
        if modelled {
            link_modelled(units, interactions)?;
        }
        let mut rest = queues;
        let mut ring = |indices| {
            let (slots, others) = ::core::mem::take(&mut rest).split_at_mut(slots_for(indices));
            rest = others;
            slots
        };
        let homes = Homes::new(homes, || Home {
            enter: IndexRing::new(ring(units.len())),
            update: IndexRing::new(ring(units.len())),
        });
        let queues = Queues {
            homes,
            interact: IndexRing::new(ring(interactions.len())),
            render: [IndexRing::new(ring(units.len())), IndexRing::new(ring(units.len()))],
        };
        let free: &'m mut [QueueSlot] = ring(letters.len());
        let arrivals = Arrivals::new(&mut rest[..units.len()]);
        let count = units.len() as u64;
        let mut tables = Self {
            units,
            interactions,
            pools: Pools::new(contacts, segments),
            post: Post::new(letters, free),
            queues,
            arrivals,
            found: [Room::new(), Room::new()],
        };
        let homes = u64::from(tables.queues.homes.count());
        tables.set_homes(|unit| (u64::from(unit.0) * homes / count) as u32);
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
        let homes = self.queues.homes.count();
        for (index, unit) in self.units.iter().enumerate() {
            unit.home.store(home_of(UnitId(index as u32)) % homes, site::EXCLUSIVE);
        }
    }

    #[inline]
    pub(crate) fn unit(&self, unit: UnitId) -> &UnitSlot<E::Object> {
        &self.units[unit.index()]
    }

    #[inline]
    pub(crate) fn interaction(&self, id: InteractionId) -> &InteractionSlot<E::Interaction> {
        &self.interactions[id.index()]
    }

    /// Slots for `count` pairs found in `frame`, or none: even frames have the first half of all slots.
    pub(crate) fn claim_candidates(
        &self,
        count: u32,
        frame: Frame,
    ) -> Result<impl Iterator<Item = InteractionId> + use<E>, TableFull> {
        let half = (self.interactions.len() / 2) as u32;
        let claimed = self.found[frame.parity()].claim(count, half, Table::Interactions)?;
        let first = claimed + frame.parity() as u32 * half;
        Ok((first..first + count).map(InteractionId))
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

    /// Puts `ids` onto `unit`'s list of this frame's candidates.
    pub(crate) fn push_candidates(&self, ids: &[InteractionId], unit: UnitId) {
        let [first, .., last] = ids else {
            return ids.iter().for_each(|&only| self.push_chain(only, only, unit));
        };
        for link in ids.windows(2) {
            self.interaction(link[0]).set_next(Chain::Candidates, unit, link[1].0);
        }
        self.push_chain(*first, *last, unit);
    }

    /// Puts what is linked from `first` to `last` onto `unit`'s list.
    fn push_chain(&self, first: InteractionId, last: InteractionId, unit: UnitId) {
        let head = &self.unit(unit).candidates;
        let mut next = head.load(site::LIST_FOLLOW);
        loop {
            self.interaction(last).set_next(Chain::Candidates, unit, next);
            match head.exchange(next, first.0, site::CANDIDATE_PUSH) {
                Ok(_) => return,
                Err(found) => next = found,
            }
        }
    }

    /// Brings `unit`'s candidates into pair order. The caller has the unit exclusively.
    pub(crate) fn sort_candidates(&self, unit: UnitId) {
        let head = &self.unit(unit).candidates;
        let slot = |index| self.interaction(InteractionId(index));
        let first = list::sort(
            head.load(site::CANDIDATE_HEAD),
            |index| slot(index).next(Chain::Candidates, unit),
            |index, to| slot(index).set_next(Chain::Candidates, unit, to),
            |a, b| (slot(a).other(unit), a) < (slot(b).other(unit), b),
        );
        head.store(first, site::CANDIDATE_HEAD);
    }
}
