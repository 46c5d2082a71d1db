//! Shuttle's threads: all of them on one, switched where its scheduler says.

pub(crate) use crate::dut::sync::let_others_run;
pub(crate) use shuttle::sync::{Condvar, Mutex};
pub(crate) use shuttle::thread::scope;

use shuttle::Config;
use shuttle::rand::{Rng, thread_rng};

/// Stacks on which a pipeline and the batches of its stages have room.
pub(crate) fn config() -> Config {
    let mut config = Config::default();
    config.stack_size = 1 << 20;
    config
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
