//! How much a run saw of what can go wrong: many runs that saw next to nothing show nothing.

use std::collections::BTreeMap;
use std::ops::AddAssign;

use crate::random_ve::OUTSIDE;
use crate::trace::{Act, Record};

/// What was seen in one run, or in several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Runs.
    pub runs: usize,
    /// Interactions of two units with each other.
    pub pairs: usize,
    /// Letters that units read from each other, or from themselves.
    pub letters: usize,
    /// Steps that reported a callback's failure.
    pub failures: usize,
    /// Callbacks that began while another thread was in one.
    pub overlaps: usize,
    /// Updates that began before the frame before theirs was swapped.
    pub ahead: usize,
}

impl Seen {
    /// What is seen in one run's `records`, which are in the order in which they began, and of its `failures`.
    pub fn of(records: &[Record], failures: usize) -> Self {
        let mut seen = Self { runs: 1, failures, ..Self::default() };
        let swaps: BTreeMap<_, _> = records.iter().filter_map(swap).collect();
        let mut busy_until: BTreeMap<u32, u64> = BTreeMap::new();
        for record in records {
            let Record { begin, end, thread, act } = *record;
            match act {
                // In the middle of an update, whose record it is beside, or from outside.
                Act::Post { .. } => continue,
                Act::Read { rank: (sender, _), .. } => {
                    seen.letters += usize::from(sender != OUTSIDE);
                    continue;
                }
                Act::Interact { ends: [a, b], .. } => seen.pairs += usize::from(a != b),
                Act::Update { frame, .. } => {
                    let swap = frame.checked_sub(1).and_then(|before| swaps.get(&before));
                    seen.ahead += usize::from(swap.is_some_and(|&swap| begin < swap));
                }
                _ => {}
            }
            let beside = |(&other, &until): (&u32, &u64)| other != thread && until > begin;
            seen.overlaps += usize::from(busy_until.iter().any(beside));
            let until = busy_until.entry(thread).or_default();
            *until = end.max(*until);
        }
        seen
    }
}

/// The frame that `record` swaps, and when that began.
fn swap(record: &Record) -> Option<(u32, u64)> {
    if let Act::Swap { frame, .. } = record.act { Some((frame, record.begin)) } else { None }
}

impl AddAssign for Seen {
    fn add_assign(&mut self, other: Self) {
        let Self { runs, pairs, letters, failures, overlaps, ahead } = other;
        self.runs += runs;
        self.pairs += pairs;
        self.letters += letters;
        self.failures += failures;
        self.overlaps += overlaps;
        self.ahead += ahead;
    }
}
