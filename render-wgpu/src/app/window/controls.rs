//! What the person at the window can change.

use dualframe_render_wgpu::look::Coloring;
use dualframe_sim::executor::{ExecutorKind, MAX_THREADS};
use dualframe_sim::pool::cores;

use crate::app::args::Way;

/// The most workers that can be asked for at a window that was opened with so many: more than anybody has use for.
pub(in crate::app) fn most_threads(threads: usize) -> usize {
    MAX_THREADS.min(4 * cores()).max(threads)
}

/// What the person at the window can change. The overlay writes it; between two runs of frames the
/// session does what is new in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::app) struct Controls {
    pub(super) is_paused: bool,
    /// Frames to compute although paused.
    pub(super) steps: u64,
    /// Whether simulated time does not run ahead of the clock.
    pub(super) is_real_time: bool,
    pub(super) threads: usize,
    /// The most that can be asked for.
    pub(super) most_threads: usize,
    pub(super) frames_in_flight: u8,
    pub(super) executor: ExecutorKind,
    pub(super) coloring: Coloring,
    /// How often it was started anew.
    pub(super) restarts: u32,
    /// Whether the overlay is shown.
    pub(super) is_shown: bool,
}

impl Controls {
    pub(super) fn new(way: &Way) -> Self {
        Self {
            is_paused: false,
            steps: 0,
            is_real_time: true,
            threads: way.threads,
            most_threads: most_threads(way.threads),
            frames_in_flight: way.frames_in_flight,
            executor: way.executor,
            coloring: Coloring::default(),
            restarts: 0,
            is_shown: true,
        }
    }
}
