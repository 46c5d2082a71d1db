//! What the field uses elsewhere: OpenMP and oneTBB themselves, through C++.
//!
//! They make their threads when the first loop runs, and end the process where the system gives none.

mod shim;
mod tbb_pipeline;

use super::parallel_for::LoopExecutor;
use shim::{OpenMp, Tbb};

pub use tbb_pipeline::TbbPipelineExecutor;

/// OpenMP's `parallel for schedule(static)`, stage after stage.
pub type OpenMpStaticExecutor = LoopExecutor<OpenMp<false>>;
/// OpenMP's `parallel for schedule(dynamic)`, stage after stage.
pub type OpenMpDynamicExecutor = LoopExecutor<OpenMp<true>>;
/// oneTBB's `parallel_for` with its `auto_partitioner`, stage after stage.
pub type TbbForExecutor = LoopExecutor<Tbb>;
