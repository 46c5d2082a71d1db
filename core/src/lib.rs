//! The dual-frame four-stage pipeline: broad phase, interaction, update, render, at most two
//! consecutive frames in flight, and workers that migrate to wherever work lies.
#![cfg_attr(not(loom), no_std)]
#![deny(clippy::unwrap_used, clippy::expect_used)]

#[cfg(all(test, not(loom)))]
extern crate std;

pub mod arrivals;
pub mod contacts;
pub mod countdown;
pub mod environment;
pub mod error;
pub mod frame;
pub mod inbox;
pub mod inputs;
pub mod latest;
mod list;
pub mod migrate;
pub mod pipeline;
pub mod probe;
pub mod ring;
pub mod stage;
pub mod storage;
pub mod sync;
mod tables;
pub mod token;
pub mod unit;
pub mod wait;
pub mod worker;
