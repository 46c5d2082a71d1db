//! What happened, callback by callback, on one clock that all threads share.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// A letter's rank: its sender, and which of theirs it is.
pub type Rank = (u32, u32);

/// What a callback did.
///
/// Frames that a callback is not told (`Test`, `Within`) are read off the objects, which count
/// their updates; `seen` is that count where the frame is told as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Bounding volumes of two units compared.
    Test {
        /// The two units, in the order of the call.
        ends: [u32; 2],
        /// How many updates each had gone through.
        seen: [u32; 2],
        /// Whether they may interact.
        accepted: bool,
    },
    /// A unit asked whether it interacts with itself.
    Within {
        /// The unit.
        unit: u32,
        /// How many updates it had gone through.
        seen: u32,
        /// Whether it does.
        accepted: bool,
    },
    /// Detection and response.
    Interact {
        /// The interaction's slot.
        id: u32,
        /// Its ends.
        ends: [u32; 2],
        /// The frame.
        frame: u32,
        /// How many updates each end had gone through.
        seen: [u32; 2],
    },
    /// A unit's update.
    Update {
        /// The unit.
        unit: u32,
        /// The frame.
        frame: u32,
        /// How many updates it had gone through.
        seen: u32,
        /// It failed at once, without reading its inputs.
        refused: bool,
    },
    /// A unit's rendering.
    Render {
        /// The unit.
        unit: u32,
        /// The frame.
        frame: u32,
        /// How many updates it had gone through.
        seen: u32,
        /// The number of the token's renderer.
        token: u32,
    },
    /// A frame's swap.
    Swap {
        /// The frame.
        frame: u32,
        /// The number of the token's renderer.
        token: u32,
    },
    /// A letter posted.
    Post {
        /// Its receiver.
        to: u32,
        /// The frame whose update is to read it.
        due: u32,
        /// Sender and sequence.
        rank: Rank,
    },
    /// A letter read.
    Read {
        /// The reader.
        unit: u32,
        /// The frame of the update that read it.
        frame: u32,
        /// Sender and sequence.
        rank: Rank,
    },
}

/// An act, when it began and ended, and on which thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// The clock when it began.
    pub begin: u64,
    /// The clock when it ended.
    pub end: u64,
    /// The thread.
    pub thread: u32,
    /// What was done.
    pub act: Act,
}

/// The clock, and the records of all threads that are done.
#[derive(Debug, Default)]
pub struct Trace {
    clock: AtomicU64,
    gathered: Mutex<Vec<Record>>,
}

impl Trace {
    /// The next tick: no two calls return the same.
    pub fn tick(&self) -> u64 {
        self.clock.fetch_add(1, Ordering::SeqCst)
    }

    /// Takes in one thread's records.
    pub fn gather(&self, log: Vec<Record>) {
        self.gathered.lock().expect("no poison").extend(log);
    }

    /// All records, in the order in which they began.
    pub fn records(&self) -> Vec<Record> {
        let mut records = self.gathered.lock().expect("no poison").clone();
        records.sort_by_key(|record| record.begin);
        records
    }
}
