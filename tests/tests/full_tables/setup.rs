//! Memory and interactions that a pipeline refuses to be made of, and what errors say.

use dualframe_core::error::{NotShared, SetupError, StillRunning, Table};
use dualframe_core::pipeline::MOST_HOMES;
use dualframe_core::storage::queue_slots;
use dualframe_core::unit::UnitId;

use crate::flood::{Sizes, full};

#[test]
fn memory_that_does_not_fit() {
    let good = Sizes::spatial(5, 20, 10, 3);
    assert_eq!(good.refused(), None);
    let needed = queue_slots(5, 20, 3, 1);
    // Two queues of the home and two of rendering; interactions; free letters; arrivals and the home's units.
    let [of_units, others] = [8, 4 + 2 * 5];
    assert_eq!(needed, 4 * of_units + 32 + others);
    assert_eq!(
        queue_slots(5, 20, 3, 3),
        8 * of_units + 3 * 8 + others,
        "seven interactions at each"
    );
    let most = queue_slots(5, 65, 3, MOST_HOMES);
    assert_eq!(queue_slots(5, 65, 3, MOST_HOMES + 1), most, "there are no more homes than that");
    assert_eq!(queue_slots(5, 20, 3, 0), needed, "there is always one home");
    for queues in [0, needed - 1] {
        let few = Sizes { queues: Some(queues), ..good.clone() };
        assert_eq!(few.refused(), Some(SetupError::Table(full(Table::Queues, queues, needed))));
    }
    assert_eq!(Sizes { queues: Some(needed + 5), ..good.clone() }.refused(), None);
    assert_eq!(Sizes { units: 0, ..good.clone() }.refused(), Some(SetupError::NoUnits));
    let unequal = SetupError::UnequalContacts { contacts: 10, segments: 9 };
    assert_eq!(Sizes { segments: 9, ..good }.refused(), Some(unequal));
    // Where a word has 32 bits refused claims are added to one half of it at most.
    let narrow = 2 * usize::from(u16::MAX);
    let wide = Sizes::spatial(5, 20, narrow + 1, 3).refused();
    let refused = SetupError::Table(full(Table::Contacts, narrow, narrow + 1));
    assert_eq!(wide, (usize::BITS == 32).then_some(refused));
}

#[test]
fn interactions_that_join_nothing() {
    for ends in [[0, 0], [0, 3], [3, 1], [u32::MAX, 0], [u32::MAX; 2]] {
        let bad = Sizes::pairwise(3, &[[0, 1], ends, [1, 2]]);
        let expected = SetupError::BadEnds { interaction: 1, ends: ends.map(UnitId) };
        assert_eq!(bad.refused(), Some(expected));
    }
    assert_eq!(Sizes::pairwise(3, &[[0, 1], [1, 0], [2, 1]]).refused(), None);
}

#[test]
fn errors_speak() {
    let said = full(Table::Interactions, 4, 5).to_string();
    assert_eq!(said, "table of interactions found in a frame is full: 4 fit, 5 needed");
    let said = SetupError::BadEnds { interaction: 1, ends: [UnitId(0), UnitId(3)] }.to_string();
    assert!(said.contains("interaction 1") && said.contains("unit 3"), "{said}");
    let said = SetupError::from(full(Table::Units, 4, 5)).to_string();
    assert_eq!(said, full(Table::Units, 4, 5).to_string());
    assert!(StillRunning.to_string().contains("still running"));
    for (tokens, what) in [(0, "without a render token"), (1, "the render token"), (3, "of 3")] {
        let said = NotShared { tokens }.to_string();
        assert!(said.contains(what), "{said}");
    }
}
