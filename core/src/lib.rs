//! The dual-frame four-stage pipeline: broad phase, interaction, update, render, at most two
//! consecutive frames in flight, each from its first update to its swap, and workers that migrate to wherever work lies.
//!
//! # Realtime contract
//!
//! The core does not allocate, lock, call the system, print or panic; all memory is the host's
//! (`verification/freestanding` is a program that links only if nothing in the core can panic or
//! allocate, built with overflow checks off, as releases are). One [`worker::Worker::step`] does at
//! most one work unit: its own cost is a bounded number of atomic operations (`PROTOCOL.md` §8), except
//! that a compare-and-swap is retried when another worker, or a letter's poster, succeeded at the same word meanwhile.
//! A worker that is suspended anywhere holds back only the work unit in its hand or that it looks at, what it carries (72
//! others at most, and the shared renderer while it has it) and calls for what it has queued in this step; in a swap it
//! carries nothing and owes no call. One that is suspended while it waits may also hold back the call that it was
//! woken by, and so the work unit that this was for, until another looks: workers that wait on one bell had better have
//! like priorities, and none may be deleted there. Every queue stays usable. A full table is a returned error
//! that names the capacity needed. Waiting is the host's ([`wait::Waiting`]).
//!
//! | call | guarantee | in an interrupt |
//! |---|---|---|
//! | [`latest::Writer::publish`], [`latest::Reader::read`] | wait-free where the target adds in one instruction; a value copied | yes |
//! | [`pipeline::Pipeline::finished`], [`frame`](pipeline::Pipeline::frame) | wait-free: a load | yes |
//! | [`pipeline::Pipeline::post`] | lock-free; rings nobody; a letter of an earlier pipeline in the same memory is dropped | yes |
//! | [`pipeline::Pipeline::token`], [`storage::Static::take`] | lock-free | yes |
//! | [`worker::Worker::step`] | lock-free beside the callbacks, of which a unit that enters may ask one for each that came before (`PROTOCOL.md` §8); calls [`wait::Waiting::wake`] | if that and the callbacks may be |
//! | [`worker::Worker::release`], dropping one | lock-free; queues what it carries; calls [`wait::Waiting::wake`] | if that may be |
//! | a step that looks for updates in an open frame; with [`frame::Entry::AfterSwap`] the one that swaps | takes up every unit, each once a frame at most | as any step |
//! | [`worker::Worker::wait`] | the host's | no |
//!
//! # Targets
//!
//! Any with compare-and-swap on words of 32 bits or more; for others there is the feature `portable-atomic`, by which
//! every exchange is a critical section (README.md, "Embedding the core", says what that crate is to be told). Where
//! adding to a word takes a loop (Armv7-M, Armv8.0 without LSE), or a critical section, what is wait-free elsewhere is
//! lock-free or waits for that.
//!
//! # One idea
//!
//! The last arriver carries on: every synchronisation is a [`countdown::Countdown`], and whoever
//! takes it to zero owns what comes next. `core/PROTOCOL.md` has the states, the memory orders and
//! a proof sketch; the package `dualframe-verification` model-checks this very source.
//!
//! # From the paper to the modules
//!
//! | paper | module |
//! |---|---|
//! | §4.1 objects and interaction pairs, §5.2 callbacks | [`environment`], [`inputs`] |
//! | §4.2 queues and carry-over | [`ring`], [`worker`] |
//! | §5.1 four stages (Fig. 6) | [`stage`], [`pipeline`] |
//! | §5.1, §5.3 render token | [`token`] |
//! | §5.3 thread migration (Fig. 8) | [`migrate`], [`worker`] |
//! | §5.4 synchronisation | [`countdown`], [`arrivals`], [`offer`] |
//! | §5.5 consecutive frames | [`frame`] |
//! | §5.6 temp buffers, preallocation | [`contacts`], [`room`], [`storage`] |
//! | §6.1 threads come and go | [`worker`], [`wait`] |
//! | §6.2 messages | [`inbox`] |
//! | §6.3 haptics | [`latest`] |
//! | Table 1 | [`probe`] |
#![cfg_attr(not(any(loom, shuttle)), no_std)]
#![deny(clippy::unwrap_used, clippy::expect_used)]

#[cfg(target_pointer_width = "16")]
compile_error!("units and slots are numbered by 32 bits, and an index has to hold their numbers");

#[cfg(not(any(target_has_atomic = "ptr", feature = "portable-atomic", loom)))]
compile_error!("this target has no compare-and-swap: turn on the feature `portable-atomic`");

#[cfg(all(test, not(loom)))]
extern crate std;

/// The README's example, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

pub mod arrivals;
mod carry;
pub mod contacts;
pub mod countdown;
pub mod environment;
pub mod error;
pub mod frame;
mod homes;
pub mod inbox;
pub mod inputs;
#[cfg(loom)]
pub mod instrument;
pub mod latest;
mod list;
pub mod migrate;
#[cfg(shuttle)]
pub mod observer;
pub mod offer;
mod pending;
pub mod pipeline;
pub mod probe;
mod protocol;
pub mod ring;
pub mod room;
pub mod stage;
pub mod storage;
// For the models, which name every access; hosts have no use for it.
#[doc(hidden)]
pub mod sync;
mod tables;
pub mod token;
pub mod unit;
pub mod wait;
pub mod worker;
