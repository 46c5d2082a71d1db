//! Support for tests of the pipeline as a whole: random virtual environments, a trace of what
//! their callbacks saw, a checker of that trace, counts of what was seen, a sequential reference, and a watchdog.
#![forbid(unsafe_code)]

pub mod body;
pub mod checker;
pub mod drive;
pub mod host;
pub mod random_ve;
pub mod reference;
pub mod seen;
pub mod trace;
pub mod watchdog;
