//! Homes, and the queues between stages.

use ::core::num::NonZeroU32;

use crate::error::TableFull;
use crate::offer::Offer;
use crate::ring::{IndexRing, QueueSlot};
use crate::sync::site;
use crate::unit::UnitId;

/// The most homes that units are shared out to; workers beyond their number share them.
#[cfg(not(loom))]
pub const MOST_HOMES: usize = 16;
/// As many as models use: loom's stacks are small.
#[cfg(loom)]
pub const MOST_HOMES: usize = 2;

/// What there is to do of the units of one home.
#[derive(Debug)]
pub(crate) struct Home<'m> {
    pub(crate) enter: IndexRing<'m>,
    pub(crate) update: IndexRing<'m>,
    /// Its units of the frame that was opened last, for which nobody has come yet.
    pub(crate) opened: Offer<'m>,
}

impl<'m> Home<'m> {
    /// A home that no unit has yet.
    pub(crate) fn new(enter: IndexRing<'m>, update: IndexRing<'m>) -> Self {
        Self { enter, update, opened: Offer::new() }
    }

    /// Whether no update looks queued, and no unit left to come for: a hint.
    #[inline]
    pub(crate) fn has_no_updates(&self) -> bool {
        self.opened.looks_empty() && self.update.looks_empty()
    }
}

/// All homes, of which there is at least one.
#[derive(Debug)]
pub(crate) struct Homes<'m> {
    first: Home<'m>,
    others: [Option<Home<'m>>; MOST_HOMES - 1],
}

impl<'m> Homes<'m> {
    pub(crate) fn new(
        count: usize,
        mut home: impl FnMut() -> Result<Home<'m>, TableFull>,
    ) -> Result<Self, TableFull> {
        let mut homes = Self { first: home()?, others: [const { None }; MOST_HOMES - 1] };
        for other in homes.others.iter_mut().take(count.saturating_sub(1)) {
            *other = Some(home()?);
        }
        Ok(homes)
    }

    /// The number of homes.
    pub(crate) fn count(&self) -> NonZeroU32 {
        NonZeroU32::MIN.saturating_add(self.iter().skip(1).count() as u32)
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Home<'m>> {
        ::core::iter::once(&self.first).chain(self.others.iter().map_while(Option::as_ref))
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = &mut Home<'m>> {
        let others = self.others.iter_mut().map_while(Option::as_mut);
        ::core::iter::once(&mut self.first).chain(others)
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
    pub(crate) interact: IndexRing<'m>,
    /// One for each frame in flight (§5.5).
    pub(crate) render: [IndexRing<'m>; 2],
}
