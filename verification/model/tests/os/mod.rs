//! The machine's threads.

pub(crate) use std::sync::{Condvar, Mutex};
pub(crate) use std::thread::scope;

use std::hash::{BuildHasher, RandomState};

/// Now and then the processor is given away in the middle of a callback.
pub(crate) fn let_others_run() {
    if below(4) == 0 {
        std::thread::yield_now();
    }
}

/// Any number below `bound`; no two runs are the same anyway.
pub(crate) fn below(bound: u32) -> u32 {
    let drawn = RandomState::new().hash_one(());
    (drawn % u64::from(bound)) as u32
}

/// Ends the process if its thread panics: the others would wait for what it carried.
pub(crate) struct Alarm;

impl Drop for Alarm {
    fn drop(&mut self) {
        if std::thread::panicking() {
            std::process::abort();
        }
    }
}

pub(crate) fn alarm() -> Alarm {
    Alarm
}
