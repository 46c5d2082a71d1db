//! The protocol of `dualframe-core` as a transition relation, small enough to be explored
//! completely, and exact enough that traces of the real code can be replayed in it.
//!
//! A work unit is carried by a worker or queued; which queue it is in, in what order, and why a
//! worker carries it are left open, so that every policy of the core is covered. Each arrival at a
//! countdown is a step of its own; a callback begins at one step and ends at another.
#![deny(clippy::unwrap_used, clippy::expect_used)]

pub mod config;
pub mod model;
mod renderer;
pub mod replay;
mod stages;
pub mod state;
pub mod step;
pub mod trace;
mod waiting;
pub mod work;
