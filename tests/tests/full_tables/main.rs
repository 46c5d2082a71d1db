//! Floods: a table that is too small is a typed error that names what it holds and what it would
//! have had to hold; the frame swaps all the same, and nothing is dropped without an error.
#![forbid(unsafe_code)]

mod at_once;
mod flood;
mod setup;

use std::sync::atomic::Ordering::SeqCst;

use dualframe_core::error::Table;
use dualframe_core::inbox::From as Sender;
use dualframe_core::unit::UnitId;

use flood::{Flood, Sizes, drive, full};

#[test]
fn candidates_beyond_the_table() {
    // 6 units: 15 pairs and 6 units with themselves, in each of 3 frames; room for 4 in a frame.
    let flood = Flood::default();
    let errors = Sizes::spatial(6, 8, 0, 1).run(&flood, 3);
    // Each of a frame's errors names what was needed up to then; the last one names it all.
    let needs = [6, 10, 15, 21].map(|needed| full(Table::Interactions, 4, needed));
    assert_eq!(errors, needs.repeat(3));
    assert_eq!(flood.interactions.load(SeqCst), 3 * 4, "what fits is done");
    // The first unit to enter finds itself and the second itself and the first, which leaves room
    // for one more: it and the others all report.
}

#[test]
fn no_room_for_candidates_at_all() {
    for candidates in [0, 1] {
        let flood = Flood::default();
        let errors = Sizes::spatial(3, candidates, 0, 1).run(&flood, 2);
        let needs = [1, 3, 6].map(|needed| full(Table::Interactions, 0, needed));
        assert_eq!(errors, needs.repeat(2));
        assert_eq!(flood.interactions.load(SeqCst), 0);
    }
}

#[test]
fn exactly_enough_candidates_are_enough() {
    let flood = Flood::default();
    assert_eq!(Sizes::spatial(6, 2 * 21, 0, 1).run(&flood, 5), []);
    assert_eq!(flood.interactions.load(SeqCst), 5 * 21);
}

#[test]
fn more_pairs_than_are_counted_together() {
    // Whoever enters last finds 40 others at once, or 39 and itself.
    let flood = Flood::default();
    assert_eq!(Sizes::spatial(40, 2 * 820, 0, 1).run(&flood, 3), []);
    assert_eq!(flood.interactions.load(SeqCst), 3 * 820);
    let star: Vec<_> = (0..40).map(|unit| [unit, 40]).collect();
    let flood = Flood::default();
    assert_eq!(Sizes::pairwise(41, &star).run(&flood, 3), []);
    assert_eq!(flood.interactions.load(SeqCst), 3 * 40);
}

#[test]
fn contacts_beyond_the_table() {
    // 6 interactions a frame, 3 records each, room for 8 in a frame: 2 pushes fit, 4 do not.
    let flood = Flood { records: 3, ..Flood::default() };
    let mut errors = Sizes::spatial(3, 12, 16, 1).run(&flood, 4);
    // The interactions of two frames may alternate.
    errors.sort_by_key(|error| error.needed);
    let needs = [9, 12, 15, 18].map(|needed| [full(Table::Contacts, 8, needed); 4]);
    assert_eq!(errors, needs.concat());
    assert_eq!(flood.interactions.load(SeqCst), 4 * 6);
    assert_eq!(flood.pushes_refused.load(SeqCst), errors.len(), "no push is lost silently");
    // Each record is read by each end: the pushes that fit, wholly, and nothing of the others.
    let read = flood.contacts_read.load(SeqCst);
    assert!(read.is_multiple_of(3) && (4 * 2 * 3..=4 * 2 * 6).contains(&read), "{read}");
}

#[test]
fn a_push_longer_than_the_table() {
    let flood = Flood { records: 100, ..Flood::default() };
    let errors = Sizes::spatial(1, 2, 16, 1).run(&flood, 3);
    assert_eq!(errors, [full(Table::Contacts, 8, 100); 3]);
    assert_eq!(flood.contacts_read.load(SeqCst), 0);
}

#[test]
fn letters_beyond_the_pool() {
    // 2 units post 3 letters each in each of 5 frames; room for 4 under way.
    let flood = Flood { letters: 3, ..Flood::default() };
    let sizes = Sizes::spatial(2, 6, 0, 4);
    let errors = sizes.run(&flood, 5);
    assert!(!errors.is_empty());
    assert!(errors.iter().all(|&error| error == full(Table::Letters, 4, 5)), "{errors:?}");
    let [posted, refused, read] =
        [&flood.posted, &flood.posts_refused, &flood.read].map(|count| count.load(SeqCst));
    assert_eq!(posted + refused, 2 * 3 * 5);
    // What is not read is what was posted in the last frame, and that fits the pool.
    assert!(read <= posted && posted - read <= 4, "{posted} posted, {read} read");
    assert!(read >= 4 * 4, "a letter slot is free again when its letter is read: {read}");
}

#[test]
fn letters_from_outside_beyond_the_pool() {
    Sizes::spatial(2, 6, 0, 3).with(|pipeline| {
        let mut pipeline = pipeline.expect("tables that fit");
        let flood = Flood::default();
        for round in 0..3_usize {
            for sequence in 0..3 {
                let from = Sender { sender: 9, sequence };
                assert_eq!(pipeline.post(UnitId(1), from, 40 + sequence), Ok(()));
            }
            let from = Sender { sender: 9, sequence: 3 };
            let rejected = pipeline.post(UnitId(0), from, 43).expect_err("no room");
            assert_eq!((rejected.message, rejected.full), (43, full(Table::Letters, 3, 4)));
            pipeline.run(1).expect("at rest");
            assert_eq!(drive(&pipeline, &flood), []);
            assert_eq!(flood.read.load(SeqCst), 3 * (round + 1), "all that were taken are read");
        }
    });
}

#[test]
fn letters_to_nobody() {
    Sizes::spatial(2, 6, 0, 3).with(|pipeline| {
        let pipeline = pipeline.expect("tables that fit");
        for (nobody, needed) in [(2, 3), (u32::MAX, 1 << 32)] {
            let from = Sender { sender: 9, sequence: 0 };
            let rejected = pipeline.post(UnitId(nobody), from, 41).expect_err("nobody's letter");
            assert_eq!((rejected.message, rejected.full), (41, full(Table::Units, 2, needed)));
        }
    });
}
