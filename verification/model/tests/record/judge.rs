//! Invariants 1 to 4, read off a record alone, and the state that a serial loop computes.

use dualframe_protocol::trace::{Event, Seen, Task};

use super::host::{Setup, fold, response};

/// Where each thing stands in a record, by frame and then by unit or pair.
struct Places {
    updates: Vec<usize>,
    renders: Vec<usize>,
    swaps: Vec<usize>,
}

/// Asserts that everything happened once and in order, and that the values are the serial ones.
pub(crate) fn judge(setup: &Setup, record: &[Seen], values: &[u32]) {
    let pairs = setup.pairs();
    let (units, frames) = (setup.units as usize, setup.frames as usize);
    let at = |frame: u32, unit: u32| frame as usize * units + unit as usize;
    let mut places = Places {
        updates: vec![usize::MAX; units * frames],
        renders: vec![usize::MAX; units * frames],
        swaps: vec![usize::MAX; frames],
    };
    let mut tests = vec![[0, usize::MAX]; pairs.len() * frames];
    let mut interactions = tests.clone();
    // The frame of a pair's test is that of the entry it is made in.
    let mut entering = vec![];
    let place = |slot: &mut usize, here: usize, seen: &Seen| {
        assert_eq!(std::mem::replace(slot, here), usize::MAX, "twice: {seen:?}");
    };
    let pair_at = |frame: u32, ends: [u32; 2]| {
        let pair = pairs.binary_search(&ends).expect("a pair that is to be tested");
        frame as usize * pairs.len() + pair
    };
    for (here, seen) in record.iter().enumerate() {
        match seen.event {
            Event::Begin(Task::Enter(_), frame) => {
                entering.resize(entering.len().max(seen.worker as usize + 1), 0);
                entering[seen.worker as usize] = frame;
            }
            Event::Test(ends, near) => {
                let frame = entering[seen.worker as usize];
                let [count, place] = &mut tests[pair_at(frame, ends)];
                (*count, *place) = (*count + 1, here);
                assert_eq!(near, setup.near(ends, frame), "in another frame: {seen:?}");
            }
            Event::Call(Task::Interact { ends, .. }, frame) => {
                let [count, place] = &mut interactions[pair_at(frame, ends)];
                (*count, *place) = (*count + 1, here);
            }
            Event::Call(Task::Update(unit), frame) => {
                place(&mut places.updates[at(frame, unit)], here, seen);
            }
            Event::Call(Task::Render(unit), frame) => {
                place(&mut places.renders[at(frame, unit)], here, seen);
            }
            Event::Swap(frame) => place(&mut places.swaps[frame as usize], here, seen),
            _ => {}
        }
    }
    for frame in 0..setup.frames {
        for &ends in &pairs {
            let ([tested, test], [done, interaction]) =
                (tests[pair_at(frame, ends)], interactions[pair_at(frame, ends)]);
            assert_eq!(tested, 1, "tests of {ends:?} in frame {frame}");
            let near = setup.near(ends, frame);
            assert_eq!(done, usize::from(near), "interactions of {ends:?} in frame {frame}");
            for end in ends {
                let last = if near { interaction } else { test };
                assert!(test <= last && last < places.updates[at(frame, end)], "{ends:?}, {frame}");
                assert!(frame == 0 || places.updates[at(frame - 1, end)] < test);
            }
        }
        places.in_order(setup, frame, at);
    }
    assert_eq!(values, serial(setup), "the state is the same in every schedule");
}

impl Places {
    fn in_order(&self, setup: &Setup, frame: u32, at: impl Fn(u32, u32) -> usize) {
        let swap = self.swaps[frame as usize];
        assert_ne!(swap, usize::MAX, "frame {frame} was not swapped");
        for unit in 0..setup.units {
            let (update, render) = (self.updates[at(frame, unit)], self.renders[at(frame, unit)]);
            assert!(update < render && render < swap, "unit {unit} in frame {frame}");
            if frame > 0 {
                assert!(self.renders[at(frame - 1, unit)] < update, "unit {unit} in {frame}");
                assert!(self.swaps[frame as usize - 1] < render, "unit {unit} in {frame}");
            }
            assert!(
                frame < 2 || self.swaps[frame as usize - 2] < update,
                "frame {frame} ran ahead"
            );
        }
    }
}

/// The values that a plain serial loop computes.
fn serial(setup: &Setup) -> Vec<u32> {
    let mut values: Vec<u32> = (1..=setup.units).collect();
    let pairs = setup.pairs();
    for frame in 0..setup.frames {
        let old = values.clone();
        for (unit, value) in (0..).zip(&mut values) {
            let mut mine: Vec<_> = pairs.iter().filter(|pair| pair.contains(&unit)).collect();
            mine.sort_unstable_by_key(|[a, b]| if *a == unit { *b } else { *a });
            for &&[a, b] in mine.iter().filter(|pair| setup.near(***pair, frame)) {
                let result = response(old[a as usize], old[b as usize], frame);
                *value = fold(fold(*value, result), result ^ 1);
            }
        }
    }
    values
}
