//! How large an experiment is.

use super::machine::Machine;
use super::subject::RETRACTION_WORK;
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
    /// Objects updated, over so many runs with each number of objects that warm up for so many frames.
    pub(super) fn work(&self, runs: usize, warm_up: u64) -> u64 {
        let objects: usize = self.objects.iter().sum();
        (objects * runs) as u64 * (self.frames + warm_up)
    }
}

/// The sizes of automated retraction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Retraction {
    /// Numbers of threads, from 1 upwards.
    pub threads: Vec<usize>,
    /// Whether they leave a core to haptics.
    pub keeps_core: bool,
    /// Frames of each run that are timed.
    pub frames: u64,
    /// Rounds of each race.
    pub rounds: usize,
}

impl Retraction {
    /// On so many whole cores, of which one is left free as for haptics if there are more than two, as in the paper
    /// (Fig. 18).
    fn on(cores: usize, frames: u64, rounds: usize) -> Self {
        let keeps_core = cores > 2;
        let most = cores - usize::from(keeps_core);
        Self { threads: (1..=most.min(MAX_THREADS)).collect(), keeps_core, frames, rounds }
    }

    /// In particles updated, over so many runs that warm up for so many frames.
    pub(super) fn work(&self, runs: usize, warm_up: u64) -> u64 {
        runs as u64 * (self.frames + warm_up) * RETRACTION_WORK
    }
}

/// The sizes of all experiments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// What velocities and substeps are drawn from.
    pub seed: u64,
    /// Numbers of threads, from 1 upwards, for all but Fig. 18.
    pub threads: Vec<usize>,
    /// Figs. 11–13.
    pub scalability: Sweep,
    /// Fig. 14 and Table 1.
    pub load_balance: Sweep,
    /// Fig. 15.
    pub per_frame: Sweep,
    /// Figs. 16 and 17: a light and a heavy load.
    pub compare: Sweep,
    /// Fig. 18.
    pub retraction: Retraction,
}

impl Plan {
    /// The paper's sizes, on every number of threads up to as many as the machine runs at once.
    #[must_use]
    pub fn full() -> Self {
        let hundreds: Vec<usize> = (100..=1_000).step_by(100).collect();
        Self {
            seed: 1,
            threads: (1..=cores().min(MAX_THREADS)).collect(),
            scalability: Sweep { objects: hundreds.clone(), frames: 800, rounds: 7 },
            load_balance: Sweep { objects: hundreds, frames: 800, rounds: 7 },
            per_frame: Sweep { objects: vec![300], frames: 600, rounds: 15 },
            compare: Sweep { objects: vec![100, 1_000], frames: 400, rounds: 15 },
            retraction: Retraction::on(whole_cores(), 1_000, 7),
        }
    }

    /// Small enough for about two minutes on two cores.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            scalability: Sweep { objects: vec![100, 400, 700, 1_000], frames: 100, rounds: 5 },
            load_balance: Sweep { objects: vec![100, 500, 1_000], frames: 200, rounds: 3 },
            per_frame: Sweep { objects: vec![300], frames: 600, rounds: 5 },
            compare: Sweep { objects: vec![100, 1_000], frames: 100, rounds: 5 },
            retraction: Retraction::on(whole_cores(), 100, 3),
            ..Self::full()
        }
    }

    /// The greatest number of threads.
    #[must_use]
    pub fn most_threads(&self) -> usize {
        self.threads.iter().copied().max().unwrap_or(1)
    }
}

/// The cores of this machine, as far as is known: what a second hardware thread of one does, haptics on the first would
/// feel.
fn whole_cores() -> usize {
    let Machine { cores, threads, .. } = Machine::this();
    cores.unwrap_or(threads)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_for_haptics() {
        for (cores, threads, keeps_core) in
            [(1, 1, false), (2, 2, false), (3, 2, true), (6, 5, true)]
        {
            let plan = Retraction::on(cores, 10, 1);
            assert_eq!(plan.threads, (1..=threads).collect::<Vec<_>>(), "{cores} cores");
            assert_eq!(plan.keeps_core, keeps_core, "{cores} cores");
        }
        assert_eq!(Retraction::on(2 * MAX_THREADS, 10, 1).threads.len(), MAX_THREADS);
    }
}
