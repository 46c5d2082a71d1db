//! Soft tissue: its physics, what tools do to it, and its cuts.
#![forbid(unsafe_code)]

#[path = "../common/mod.rs"]
mod common;
mod cuts;
mod patch;
mod physics;
mod same;
mod tools;
