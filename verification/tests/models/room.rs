//! Room in a table: no slot is claimed twice, and none is lost, while others ask for more than there is.

use super::{Guarded, Model, Role, check, lend, lend_slice, together};
use dualframe_core_model::room::Room;
use std::ops::Range;

pub(crate) const ALL: &[Model] = &[("room::claimed_once", claimed_once)];

/// Room for two. One asks for three, one for one, one for one twice: who asks for less than is left gets that, whatever
/// was refused before, and each slot is one claimer's. The outcome is how many slots each claim got.
fn claimed_once() {
    let shares = [[2, 0, 0, 0], [1, 1, 0, 0], [1, 0, 1, 0], [0, 1, 1, 0], [0, 0, 1, 1]];
    check("room::claimed_once", Some(4), 3, shares, |order| {
        let room = &*lend(Room::new());
        let slots: &[Guarded<u32>] = lend_slice(2, |_| Guarded::new(0));
        let claim = move |count| {
            let claimed = room.claim(count, 2);
            claimed.clone().for_each(|slot| slots[slot as usize].set(1 + count));
            claimed
        };
        let claims = |counts: Vec<u32>| -> Role<Vec<Range<u32>>> {
            Box::new(move || counts.into_iter().map(claim).collect())
        };
        let claimed = together(order, vec![claims(vec![3]), claims(vec![1]), claims(vec![1, 1])]);
        let claimed = claimed.concat();
        let mut all: Vec<_> = claimed.iter().cloned().flatten().collect();
        all.sort_unstable();
        assert_eq!(all, [0, 1], "each slot is claimed once");
        [0, 1, 2, 3].map(|claim| claimed[claim].len())
    });
}
