//! The latest-value cell: values never torn, never older than one read before; slots are reused.

use super::{Model, Role, check, lend, together};
use dualframe_core_model::latest::Latest;

pub(crate) const ALL: &[Model] = &[
    ("latest::one_reader", one_reader),
    ("latest::slots_are_reused", slots_are_reused),
    ("latest::two_readers", two_readers),
    ("latest::reader_is_replaced", reader_is_replaced),
    ("latest::readers_are_limited", readers_are_limited),
];

/// A value that shows whether it was torn.
fn value(number: u32) -> [u32; 2] {
    [number, !number]
}

fn number([number, check]: [u32; 2]) -> u32 {
    assert_eq!(check, !number, "torn");
    number
}

/// One publication, two reads: each of the three monotone sequences, no other.
fn one_reader() {
    check("latest::one_reader", None, 2, [[0, 0], [0, 1], [1, 1]], |order| {
        let (mut writer, readers) = lend(Latest::<_, 3>::new(value(0))).split();
        let write: Role<[u32; 2]> = Box::new(move || {
            writer.publish(value(1));
            [0, 0]
        });
        let read: Role<[u32; 2]> = Box::new(move || {
            let mut reader = readers.reader().unwrap();
            [(), ()].map(|()| number(reader.read()))
        });
        together(order, vec![write, read])[1]
    });
}

/// Three publications over three slots: the third needs a slot that the reader may be inside.
fn slots_are_reused() {
    let monotone = (0..=3).flat_map(|a| (a..=3).map(move |b| [a, b]));
    check("latest::slots_are_reused", Some(4), 2, monotone, |order| {
        let (mut writer, readers) = lend(Latest::<_, 3>::new(value(0))).split();
        let write: Role<[u32; 2]> = Box::new(move || {
            (1..=3).for_each(|number| writer.publish(value(number)));
            [0, 0]
        });
        let read: Role<[u32; 2]> = Box::new(move || {
            let mut reader = readers.reader().unwrap();
            [(), ()].map(|()| number(reader.read()))
        });
        together(order, vec![write, read])[1]
    });
}

/// Two readers, each of two publications or the first value.
fn two_readers() {
    let any = (0..=2).flat_map(|a| (0..=2).map(move |b| [a, b]));
    check("latest::two_readers", Some(2), 3, any, |order| {
        let (mut writer, readers) = lend(Latest::<_, 4>::new(value(0))).split();
        let write: Role<u32> = Box::new(move || {
            (1..=2).for_each(|number| writer.publish(value(number)));
            0
        });
        let read = || -> Role<u32> {
            Box::new(move || {
                let mut reader = readers.reader().unwrap();
                let first = number(reader.read());
                let second = number(reader.read());
                assert!(first <= second, "an older value after a newer one");
                second
            })
        };
        let seen = together(order, vec![write, read(), read()]);
        [seen[1], seen[2]]
    });
}

/// A reader leaves, another takes its place, and the writer has a slot for each publication: it
/// sees the one leave whenever it has seen the other enter.
fn reader_is_replaced() {
    check(
        "latest::reader_is_replaced",
        Some(3),
        3,
        [None, Some(0), Some(1), Some(2), Some(3)],
        |order| {
            let (mut writer, readers) = lend(Latest::<_, 3>::new(value(0))).split();
            let mut first = readers.reader().unwrap();
            let write: Role<Option<u32>> = Box::new(move || {
                (1..=3).for_each(|number| writer.publish(value(number)));
                None
            });
            let leave: Role<Option<u32>> = Box::new(move || {
                assert_eq!(number(first.read()) & !3, 0);
                drop(first);
                None
            });
            let replace: Role<Option<u32>> = Box::new(move || {
                let mut reader = readers.reader().ok()?;
                let seen = number(reader.read());
                // It stays for good.
                std::mem::forget(reader);
                Some(seen)
            });
            together(order, vec![write, leave, replace])[2]
        },
    );
}

/// A refused reader takes no place: whoever asks when there is room gets it. Room for one, three
/// ask; the first keeps it while a second is refused, then leaves before the third asks.
fn readers_are_limited() {
    check("latest::readers_are_limited", None, 2, [false, true], |order| {
        let (_, readers) = lend(Latest::<_, 3>::new(0_u32)).split();
        let first = readers.reader().unwrap();
        let refused: Role<bool> = Box::new(move || {
            // Kept until the model ends.
            readers.reader().map(std::mem::forget).is_ok()
        });
        let again: Role<bool> = Box::new(move || {
            drop(first);
            readers.reader().map(std::mem::forget).is_ok()
        });
        let got = together(order, vec![refused, again]);
        assert_ne!(got[0], got[1], "there was room for one, and for no more");
        got[0]
    });
}
