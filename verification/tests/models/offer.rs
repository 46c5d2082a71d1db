//! The offer: once a round each index is somebody's, who sees what came before the round.

use super::{Guarded, Model, Role, check, lend, lend_slice, together};
use dualframe_core_model::offer::Offer;
use dualframe_core_model::ring::QueueSlot;

pub(crate) const ALL: &[Model] = &[
    ("offer::takers_see_what_came_before", takers_see_what_came_before::<Offer<'static>>),
    ("offer::once_a_round", once_a_round::<Offer<'static>>),
];

/// What the models ask of an offer.
pub(crate) trait Offers: Sync + 'static {
    /// Of 0, 1, and so on up to `count`, none of which can be taken yet.
    fn make(count: usize) -> Self;
    /// Offers all of them.
    fn offer(&self);
    /// Takes the next one.
    fn take(&self) -> Option<u32>;
}

impl Offers for Offer<'static> {
    fn make(count: usize) -> Self {
        let slots = lend_slice(count, |_| QueueSlot::new());
        (0..).zip(slots.iter_mut()).for_each(|(index, slot)| slot.set(index));
        let mut offer = Self::new();
        offer.set(slots);
        offer
    }
    fn offer(&self) {
        Offer::offer(self);
    }
    fn take(&self) -> Option<u32> {
        Offer::take(self)
    }
}

/// One offers, two take: each index is one taker's, and both see what the first wrote, though the second of them reads
/// what the other one left.
pub(crate) fn takers_see_what_came_before<O: Offers>() {
    let taken =
        [[None, None], [Some(0), None], [None, Some(0)], [Some(0), Some(1)], [Some(1), Some(0)]];
    check("offer::takers_see_what_came_before", None, 3, taken, |order| {
        let offer = &*lend(O::make(2));
        let before: &Guarded<u32> = lend(Guarded::new(0));
        let opens: Role<Option<u32>> = Box::new(move || {
            before.set(1);
            offer.offer();
            None
        });
        let takes = || -> Role<Option<u32>> {
            Box::new(move || {
                offer.take().inspect(|_| assert_eq!(before.get(), 1, "the offer came after it"))
            })
        };
        let taken = together(order, vec![opens, takes(), takes()]);
        [taken[1], taken[2]]
    });
}

/// Whoever takes the only index offers it again, once: two rounds, be somebody suspended through one of them. Who finds
/// nothing comes again.
pub(crate) fn once_a_round<O: Offers>() {
    check("offer::once_a_round", None, 2, [[0, 2], [1, 1], [2, 0]], |order| {
        let offer = &*lend(O::make(1));
        offer.offer();
        let rounds: &Guarded<u32> = lend(Guarded::new(0));
        let take = move || {
            let taken = offer.take();
            if taken.is_some() {
                rounds.set(rounds.get() + 1);
                if rounds.get() == 1 {
                    offer.offer();
                }
            }
            taken.map_or(0, |_| 1)
        };
        let takes = || -> Role<u32> { Box::new(move || take() + take()) };
        let taken = together(order, vec![takes(), takes()]);
        assert_eq!(offer.take(), None);
        assert_eq!(taken.iter().sum::<u32>(), 2, "each round's is taken once");
        [taken[0], taken[1]]
    });
}
