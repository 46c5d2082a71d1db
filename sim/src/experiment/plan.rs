//! How large an experiment is.

use crate::executor::MAX_THREADS;
use crate::pool::cores;

/// The sizes of one experiment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sweep {
    /// Numbers of particles.
    pub objects: Vec<usize>,
    /// Frames of each run that are timed.
    pub frames: u64,
    /// Rounds of each race.
    pub rounds: usize,
}

impl Sweep {
    /// Objects updated, over all runs of so many runners that warm up for so many frames.
    pub(super) fn work(&self, runners: usize, warm_up: u64) -> u64 {
        let objects: usize = self.objects.iter().sum();
        (objects * runners * self.rounds) as u64 * (self.frames + warm_up)
    }
}

/// The sizes of all experiments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// What velocities and substeps are drawn from.
    pub seed: u64,
    /// Numbers of threads, from 1 upwards.
    pub threads: Vec<usize>,
    /// Figs. 11–13.
    pub scalability: Sweep,
    /// Fig. 14 and Table 1.
    pub load_balance: Sweep,
    /// Fig. 15.
    pub per_frame: Sweep,
    /// Figs. 16 and 17: a light and a heavy load.
    pub compare: Sweep,
}

impl Plan {
    /// The paper's sizes, on every number of threads up to the number of cores.
    #[must_use]
    pub fn full() -> Self {
        let hundreds: Vec<usize> = (100..=1_000).step_by(100).collect();
        Self {
            seed: 1,
            threads: (1..=cores().min(MAX_THREADS)).collect(),
            scalability: Sweep { objects: hundreds.clone(), frames: 800, rounds: 7 },
            load_balance: Sweep { objects: hundreds, frames: 800, rounds: 1 },
            per_frame: Sweep { objects: vec![300], frames: 600, rounds: 15 },
            compare: Sweep { objects: vec![100, 1_000], frames: 400, rounds: 15 },
        }
    }

    /// Small enough for about two minutes on two cores.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            scalability: Sweep { objects: vec![100, 400, 700, 1_000], frames: 100, rounds: 5 },
            load_balance: Sweep { objects: vec![100, 500, 1_000], frames: 200, rounds: 1 },
            per_frame: Sweep { objects: vec![300], frames: 600, rounds: 5 },
            compare: Sweep { objects: vec![100, 1_000], frames: 100, rounds: 5 },
            ..Self::full()
        }
    }

    /// The greatest number of threads.
    #[must_use]
    pub fn most_threads(&self) -> usize {
        self.threads.iter().copied().max().unwrap_or(1)
    }
}
