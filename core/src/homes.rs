//! Homes, and the queues between stages.

use ::core::iter;
use ::core::num::NonZeroU32;

use crate::error::TableFull;
use crate::offer::Offer;
use crate::ring::{IndexRing, QueueSlot};
use crate::sync::site;
use crate::unit::{InteractionId, UnitId};

/// The most homes that units are shared out to; workers beyond their number share them.
#[cfg(not(loom))]
pub const MOST_HOMES: usize = 16;
/// As many as models use: loom's stacks are small.
#[cfg(loom)]
pub const MOST_HOMES: usize = 2;

/// What there is to do of the units of one home, and a part of the interactions.
#[derive(Debug)]
pub(crate) struct Home<'m> {
    pub(crate) enter: IndexRing<'m>,
    /// By their places among those that come to this home: see [`Homes::queue_of`].
    interact: IndexRing<'m>,
    pub(crate) update: IndexRing<'m>,
    /// Its units of the frame that was opened last, for which nobody has come yet.
    pub(crate) opened: Offer<'m>,
}

impl<'m> Home<'m> {
    /// A home that no unit has yet.
    pub(crate) fn new(
        enter: IndexRing<'m>,
        interact: IndexRing<'m>,
        update: IndexRing<'m>,
    ) -> Self {
        Self { enter, interact, update, opened: Offer::new() }
    }

    /// Whether no interaction looks queued: a hint.
    #[inline]
    pub(crate) fn has_no_interactions(&self) -> bool {
        self.interact.looks_empty()
    }

    /// Whether no update looks queued, and no unit left to come for: a hint.
    #[inline]
    pub(crate) fn has_no_updates(&self) -> bool {
        self.opened.looks_empty() && self.update.looks_empty()
    }

    /// Whether anything looks queued, or there are units left to come for: a hint.
    pub(crate) fn has_work(&self) -> bool {
        !(self.has_no_updates() && self.has_no_interactions() && self.enter.looks_empty())
    }
}

/// All homes, of which there is at least one.
#[derive(Debug)]
pub(crate) struct Homes<'m> {
    count: NonZeroU32,
    first: Home<'m>,
    others: [Option<Home<'m>>; MOST_HOMES - 1],
}

impl<'m> Homes<'m> {
    pub(crate) fn new(
        count: usize,
        mut home: impl FnMut() -> Result<Home<'m>, TableFull>,
    ) -> Result<Self, TableFull> {
        let (first, mut others) = (home()?, [const { None }; MOST_HOMES - 1]);
        let mut homes = NonZeroU32::MIN;
        for other in others.iter_mut().take(count.saturating_sub(1)) {
            *other = Some(home()?);
            homes = homes.saturating_add(1);
        }
        Ok(Self { count: homes, first, others })
    }

    /// The number of homes.
    #[inline]
    pub(crate) fn count(&self) -> NonZeroU32 {
        self.count
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Home<'m>> {
        iter::once(&self.first).chain(self.others.iter().map_while(Option::as_ref))
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = &mut Home<'m>> {
        let others = self.others.iter_mut().map_while(Option::as_mut);
        iter::once(&mut self.first).chain(others)
    }

    /// A home that there is, by its number.
    #[inline]
    pub(crate) fn at(&self, number: u32) -> &Home<'m> {
        let others = self.others.get((number as usize).wrapping_sub(1));
        others.and_then(Option::as_ref).unwrap_or(&self.first)
    }

    /// The numbers of all homes, from this one round: workers of different homes do not all come to the same one first
    /// when nothing is left at their own.
    #[inline]
    pub(crate) fn round_from(&self, number: u32) -> impl Iterator<Item = u32> + use<> {
        (number..self.count.get()).chain(0..number)
    }

    /// The same, and this one again between two others: with many homes a round takes long, and of the units that are to be
    /// updated here meanwhile no other core has the data.
    #[inline]
    pub(crate) fn round_by_way_of(&self, number: u32) -> impl Iterator<Item = u32> + use<> {
        let others = self.round_from(number).skip(1);
        iter::once(number).chain(others.flat_map(move |other| [number, other]).skip(1))
    }

    /// The queue that an interaction goes to, one home's after the other's by its number, and its place among those that
    /// come there. They are queued for whoever has nothing else to do, and in one queue for all workers these would wait
    /// for each other; of several that were found together most find one at home.
    #[inline]
    pub(crate) fn queue_of(&self, id: InteractionId) -> (&IndexRing<'m>, u32) {
        (&self.at(id.0 % self.count).interact, id.0 / self.count)
    }

    /// An interaction that is queued at the home of this number.
    #[inline]
    pub(crate) fn pop_interaction(&self, number: u32) -> Option<InteractionId> {
        let place = self.at(number).interact.pop()?;
        Some(InteractionId(place * self.count.get() + number))
    }

    /// Lets every home have the units that `home_of` says are its, in the order of their numbers. `order` has a slot
    /// for each.
    pub(crate) fn settle(&mut self, mut order: &'m [QueueSlot], home_of: impl Fn(UnitId) -> u32) {
        let units = order.len() as u32;
        for (number, home) in (0..).zip(self.iter_mut()) {
            let mut count = 0;
            for unit in (0..units).filter(|&unit| home_of(UnitId(unit)) == number) {
                if let Some(slot) = order.get(count) {
                    slot.0.store(unit as usize, site::EXCLUSIVE);
                    count += 1;
                }
            }
            let (own, rest) = order.split_at_checked(count).unwrap_or_default();
            home.opened.set(own);
            order = rest;
        }
    }
}

/// Queues carry only what nobody has in hand (§4.2).
#[derive(Debug)]
pub(crate) struct Queues<'m> {
    pub(crate) homes: Homes<'m>,
    /// One for each frame in flight (§5.5).
    pub(crate) render: [IndexRing<'m>; 2],
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::ring::slots_for;
    use std::{vec, vec::Vec};

    fn ring(indices: usize) -> Result<IndexRing<'static>, TableFull> {
        let slots: Vec<_> = (0..slots_for(indices)).map(|_| QueueSlot::new()).collect();
        IndexRing::new(Vec::leak(slots))
    }

    fn homes(count: usize, interactions: usize) -> Homes<'static> {
        let home = || Ok(Home::new(ring(1)?, ring(interactions.div_ceil(count))?, ring(1)?));
        Homes::new(count, home).unwrap_or_else(|full: TableFull| panic!("{full}"))
    }

    #[test]
    fn interactions_are_spread_over_all_homes() {
        for (count, interactions) in [(1, 5), (2, 5), (3, 1), (3, 9), (MOST_HOMES, 100)] {
            let homes = homes(count, interactions);
            for id in (0..interactions as u32).map(InteractionId) {
                let (queue, place) = homes.queue_of(id);
                assert_eq!(queue.push(place), Ok(()), "{id:?} of {interactions} at {count} homes");
            }
            let mut left: Vec<_> = (0..interactions as u32).collect();
            for number in homes.round_from(0) {
                let found: Vec<_> = iter::from_fn(|| homes.pop_interaction(number)).collect();
                assert!(found.len() <= interactions.div_ceil(count), "no more than others");
                assert!(homes.at(number).has_no_interactions());
                left.retain(|&id| !found.contains(&InteractionId(id)));
            }
            assert_eq!(left, [], "each comes out as it went in");
        }
    }

    #[test]
    fn round_from_any_home() {
        let round = |from| homes(3, 0).round_from(from).collect::<Vec<_>>();
        assert_eq!([round(0), round(1), round(2)], [vec![0, 1, 2], vec![1, 2, 0], vec![2, 0, 1]]);
        let round = |count, home| homes(count, 0).round_by_way_of(home).collect::<Vec<_>>();
        assert_eq!([round(1, 0), round(2, 1)], [vec![0], vec![1, 0]]);
        assert_eq!([round(3, 0), round(3, 1)], [vec![0, 1, 0, 2], vec![1, 2, 1, 0]]);
    }
}
