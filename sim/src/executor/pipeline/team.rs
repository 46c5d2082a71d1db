//! Threads and what they work in, kept from run to run: to start a thread takes longer than a frame.

use std::sync::{Mutex, PoisonError};

use rayon::{Scope, ThreadPool, ThreadPoolBuilder};

use super::host::Own;
use crate::executor::ExecutorError;

/// The hired threads, and what each worker works in. They are Rayon's, asleep between two runs; of it
/// only the lending of borrowed work to threads that last is used here.
#[derive(Default)]
pub(super) struct Team {
    hired: Option<ThreadPool>,
    /// By the workers' numbers; none for who has not worked yet, or is at work.
    own: Vec<Mutex<Option<Own>>>,
}

impl Team {
    /// The number of workers, the calling thread included.
    pub(super) fn workers(&self) -> usize {
        self.own.len()
    }

    /// Hires threads until there are so many workers. What those that there were work in is kept.
    ///
    /// # Errors
    /// The system gave no thread.
    pub(super) fn grow(&mut self, workers: usize) -> Result<(), ExecutorError> {
        if workers <= self.own.len() {
            return Ok(());
        }
        if workers > 1 {
            let name = |index| format!("worker {}", index + 1);
            let pool = ThreadPoolBuilder::new().num_threads(workers - 1).thread_name(name);
            self.hired = Some(pool.build()?);
        }
        self.own.resize_with(workers, Mutex::default);
        Ok(())
    }

    /// Calls `lead` on the calling thread and `attend`, with their numbers, on all others at once;
    /// returns when all have.
    pub(super) fn work<R>(&self, attend: impl Fn(usize) + Sync, lead: impl FnOnce() -> R) -> R {
        let Some(hired) = &self.hired else { return lead() };
        let attend = &attend;
        hired.in_place_scope(|scope: &Scope<'_>| {
            for index in 1..self.own.len() {
                scope.spawn(move |_| attend(index));
            }
            lead()
        })
    }

    /// Takes what worker number `index` works in.
    pub(super) fn take_own(&self, index: usize) -> Option<Own> {
        let own = self.own.get(index)?;
        own.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Takes it back.
    pub(super) fn give_own(&self, index: usize, own: Own) {
        if let Some(place) = self.own.get(index) {
            *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(own);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::sync::Barrier;
    use std::thread::{self, ThreadId};

    use super::*;

    /// On which threads one run's attendants were, all at once, by their numbers.
    fn attendants(team: &Team) -> Vec<(usize, ThreadId)> {
        let (all, seen) = (Barrier::new(team.workers()), Mutex::new(Vec::new()));
        let attend = |index| {
            all.wait();
            seen.lock().expect("no panic").push((index, thread::current().id()));
        };
        let leader = team.work(attend, || {
            all.wait();
            thread::current().id()
        });
        assert_eq!(leader, thread::current().id());
        let mut seen = seen.into_inner().expect("no panic");
        seen.sort_unstable_by_key(|&(index, _)| index);
        seen
    }

    fn threads(attendants: &[(usize, ThreadId)]) -> HashSet<ThreadId> {
        attendants.iter().map(|&(_, thread)| thread).collect()
    }

    #[test]
    fn threads_last_from_run_to_run() {
        let mut team = Team::default();
        team.grow(1).expect("nobody to hire");
        assert_eq!(attendants(&team), []);
        team.grow(4).expect("threads");
        let first = attendants(&team);
        assert_eq!(first.iter().map(|&(index, _)| index).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!(threads(&first).len(), 3);
        team.grow(2).expect("there are more already");
        assert_eq!(threads(&attendants(&team)), threads(&first));
        team.grow(5).expect("threads");
        assert_eq!(threads(&attendants(&team)).len(), 4);
    }
}
