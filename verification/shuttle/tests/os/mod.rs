//! Shuttle's threads: all of them on one, switched where its scheduler says.

pub(crate) use shuttle::sync::{Condvar, Mutex};
pub(crate) use shuttle::thread::scope;

use shuttle::Config;
use shuttle::rand::{Rng, thread_rng};
use std::sync::atomic::Ordering;

/// Stacks on which a pipeline and the batches of its stages have room.
pub(crate) fn config() -> Config {
    let mut config = Config::default();
    config.stack_size = 1 << 20;
    config
}

/// A point at which shuttle may schedule another thread. Unlike `yield_now`, it does not ask for it.
pub(crate) fn let_others_run() {
    shuttle::sync::atomic::AtomicBool::new(false).load(Ordering::SeqCst);
}

/// A number below `bound`, of the schedule's own randomness, so that it is replayed.
pub(crate) fn below(bound: u32) -> u32 {
    thread_rng().gen_range(0..bound)
}

/// Nothing: shuttle ends all threads when one panics.
pub(crate) struct Alarm;

pub(crate) fn alarm() -> Alarm {
    Alarm
}
