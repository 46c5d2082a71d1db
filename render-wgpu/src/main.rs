//! The `dualframe` program: runs particles and operations, replays them, does the experiments, and says how fast, and
//! whether soundly.
#![forbid(unsafe_code)]

mod app;

use std::alloc::System;
use std::process::ExitCode;

use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

/// Counts heap allocations, so that "none while frames run" is measured in every run.
#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn main() -> ExitCode {
    app::main(&|| {
        let stats = ALLOCATOR.stats();
        stats.allocations + stats.reallocations
    })
}
