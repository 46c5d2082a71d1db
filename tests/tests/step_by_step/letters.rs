//! When letters are read, and what becomes of those that are not.

use dualframe_core::inbox::From;
use dualframe_core::unit::UnitId;

use crate::crowd::{Crowd, ENTERED, FAR, finish, with};

#[test]
fn waiting_letters_are_taken() {
    with(3, 1, 1, |mut pipeline, _| {
        let from = From { sender: 7, sequence: 3 };
        for (round, message) in ["before the first frame", "after it"].into_iter().enumerate() {
            let to = UnitId(round as u32 + 1);
            assert_eq!(pipeline.post(to, from, message), Ok(()));
            let mut taken = vec![];
            pipeline.take_letters(|to, from, message| taken.push((to, from, message)));
            assert_eq!(taken, [(to, from, message)]);
            pipeline.take_letters(|_, _, _| unreachable!("they were taken"));
            pipeline.run(1).expect("at rest");
            finish(&pipeline, &FAR);
        }
    });
}

#[test]
fn a_letter_that_is_not_read_leaves_room_for_another() {
    with(1, 1, 1, |mut pipeline, _| {
        for sequence in 0..3 {
            let from = From { sender: 0, sequence };
            for _ in 0..2 {
                assert_eq!(pipeline.post(UnitId(0), from, "nothing"), Ok(()));
            }
            assert!(pipeline.post(UnitId(0), from, "too much").is_err());
            pipeline.run(1).expect("at rest");
            finish(&pipeline, &FAR);
        }
    });
}

/// From outside, between two steps: both units' updates of the open frame are still to come.
#[test]
fn a_letter_posted_while_a_frame_is_open_is_read_in_the_next_one() {
    with(2, 1, 1, |mut pipeline, _| {
        let from = From { sender: 7, sequence: 3 };
        let reads = Crowd { reads: true, ..FAR };
        pipeline.run(1).expect("at rest");
        let mut worker = pipeline.worker();
        assert_eq!([worker.step(&reads), worker.step(&reads)], [ENTERED, ENTERED]);
        drop(worker);
        for to in [0, 1].map(UnitId) {
            assert_eq!(pipeline.post(to, from, "for the next"), Ok(()));
        }
        for expected in [&[][..], &[(from, "for the next")], &[]] {
            finish(&pipeline, &reads);
            assert!(pipeline.objects_mut().all(|found| found.read == expected));
            pipeline.run(1).expect("at rest");
        }
    });
}

#[test]
fn letters_of_one_update_keep_their_order() {
    with(1, 1, 1, |mut pipeline, _| {
        pipeline.run(3).expect("at rest");
        finish(&pipeline, &Crowd { reads: true, writes: true, ..FAR });
        let from = |sequence| From { sender: 0, sequence };
        let found = pipeline.objects_mut().next().map(|found| found.read.as_slice());
        assert_eq!(found, Some(&[(from(0), "first"), (from(1), "second")][..]));
    });
}
