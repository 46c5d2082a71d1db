//! Threads and what they work in, kept from run to run: to start a thread takes longer than a frame.

use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use rayon::{Scope, ThreadBuilder, ThreadPool, ThreadPoolBuilder};

use super::host::Own;
use crate::executor::ExecutorError;

/// The hired threads, and what each worker works in.
#[derive(Default)]
pub(super) struct Team {
    hired: Option<Hired>,
    /// By the workers' numbers; none for who has not worked yet, or is at work.
    own: Vec<Mutex<Option<Own>>>,
}

/// Threads that are Rayon's, asleep between two runs; of it only the lending of borrowed work to threads
/// that last is used here. None outlives this.
struct Hired {
    /// There until this is dropped, once all threads have started.
    pool: Option<ThreadPool>,
    threads: Vec<JoinHandle<()>>,
}

impl Hired {
    fn new(count: usize) -> Result<Self, ExecutorError> {
        // If not all start, those that did have ended when the error is returned.
        let mut hired = Self { pool: None, threads: Vec::with_capacity(count) };
        let start = |worker: ThreadBuilder| {
            let name = format!("worker {}", worker.index() + 1);
            hired.threads.push(thread::Builder::new().name(name).spawn(|| worker.run())?);
            Ok(())
        };
        hired.pool =
            Some(ThreadPoolBuilder::new().num_threads(count).spawn_handler(start).build()?);
        Ok(hired)
    }
}

impl Drop for Hired {
    fn drop(&mut self) {
        // That tells them to end.
        self.pool = None;
        for thread in self.threads.drain(..) {
            // What panics in borrowed work has come out of `work` already.
            let _ = thread.join();
        }
    }
}

impl Team {
    /// So many workers.
    ///
    /// # Errors
    /// The system gave no thread.
    pub(super) fn of(workers: usize) -> Result<Self, ExecutorError> {
        let mut team = Self::default();
        team.grow(workers)?;
        Ok(team)
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
            self.hired = Some(Hired::new(workers - 1)?);
        }
        self.own.resize_with(workers, Mutex::default);
        Ok(())
    }

    /// Calls `lead` on the calling thread and `attend`, with their numbers, on the others of so many workers at
    /// once, who were hired before; returns when all have.
    pub(super) fn work<R>(
        &self,
        workers: usize,
        attend: impl Fn(usize) + Sync,
        lead: impl FnOnce() -> R,
    ) -> R {
        let hired = self.hired.as_ref().and_then(|hired| hired.pool.as_ref());
        let Some(pool) = hired.filter(|_| workers > 1) else { return lead() };
        let attend = &attend;
        pool.in_place_scope(|scope: &Scope<'_>| {
            for index in 1..workers {
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
    use std::cell::RefCell;
    use std::collections::HashSet;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, Barrier};
    use std::thread::ThreadId;
    use std::time::Duration;

    use super::*;

    /// On which threads one run's attendants were, all at once, by their numbers.
    fn attendants(team: &Team, workers: usize) -> Vec<(usize, ThreadId)> {
        let (all, seen) = (Barrier::new(workers), Mutex::new(Vec::new()));
        let attend = |index| {
            all.wait();
            seen.lock().expect("no panic").push((index, thread::current().id()));
        };
        let leader = team.work(workers, attend, || {
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

    /// Says so when the thread that it is a part of has ended.
    struct Ending(Arc<AtomicUsize>);

    impl Drop for Ending {
        fn drop(&mut self) {
            // Long enough for whoever does not wait to be seen not to.
            thread::sleep(Duration::from_millis(50));
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    thread_local! {
        static ENDING: RefCell<Option<Ending>> = const { RefCell::new(None) };
    }

    #[test]
    fn no_thread_outlives_its_team() {
        let ended = Arc::new(AtomicUsize::new(0));
        let mut team = Team::default();
        team.grow(3).expect("threads");
        let all = Barrier::new(3);
        let attend = |_| {
            ENDING.set(Some(Ending(Arc::clone(&ended))));
            all.wait();
        };
        team.work(3, attend, || all.wait());
        assert_eq!(ended.load(Ordering::Relaxed), 0);
        drop(team);
        assert_eq!(ended.load(Ordering::Relaxed), 2);
    }

    #[test]
    fn threads_last_from_run_to_run() {
        let mut team = Team::default();
        team.grow(1).expect("nobody to hire");
        assert_eq!(attendants(&team, 1), []);
        team.grow(4).expect("threads");
        let first = attendants(&team, 4);
        assert_eq!(first.iter().map(|&(index, _)| index).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!(threads(&first).len(), 3);
        team.grow(2).expect("there are more already");
        assert_eq!(threads(&attendants(&team, 4)), threads(&first));
        assert_eq!(attendants(&team, 2).len(), 1, "the others are not called");
        team.grow(5).expect("threads");
        assert_eq!(threads(&attendants(&team, 5)).len(), 4);
    }
}
