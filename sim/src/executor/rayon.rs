//! Rayon's work stealing.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::ExecutorError;
use super::parallel_for::{LoopExecutor, ParallelFor};

/// A rayon pool of as many threads as asked for; the calling one, besides them, waits for them, and renders if the
/// renderer [is bound](crate::render::Renderer::is_bound) to it. Callbacks must not use rayon: a thread that waits in
/// one for another, be it of another pool, may begin the next callback, and would then wait for itself.
pub type RayonExecutor = LoopExecutor<RayonLoops>;

/// Rayon's parallel iterators, on a pool of their own.
#[derive(Debug)]
pub struct RayonLoops(ThreadPool);

impl ParallelFor for RayonLoops {
    fn new(threads: usize) -> Result<Self, ExecutorError> {
        Ok(Self(ThreadPoolBuilder::new().num_threads(threads).build()?))
    }

    fn enter<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.0.install(work)
    }

    fn worker(&self) -> usize {
        self.0.current_thread_index().unwrap_or(0)
    }

    fn for_each<T: Send, S>(
        &self,
        items: &mut [T],
        begin: impl Fn(usize) -> S + Sync + Send,
        body: impl Fn(&mut S, usize, &mut T) + Sync + Send,
    ) {
        let begin = || begin(rayon::current_thread_index().unwrap_or(0));
        let loops = || {
            // Items are few and uneven: without this, a thread may have several to do while the others wait.
            let items = items.par_iter_mut().enumerate().with_max_len(1);
            items.for_each_init(begin, |state, (index, item)| body(state, index, item));
        };
        // Inside the pool this is a plain call.
        self.0.install(loops);
    }
}
