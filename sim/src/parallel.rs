//! What is built on all cores, before an executor has it.

use std::error::Error;
use std::sync::OnceLock;

use rayon::{ThreadPool, ThreadPoolBuilder};

thread_local! {
    /// A pool of this thread alone; none where it is in another one.
    static ALONE: Option<ThreadPool> =
        ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().ok();
}

/// Does `work` with Rayon's threads, or on the calling one alone where the system gives none: Rayon would panic.
pub(crate) fn on_all_cores<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    static HAS_THREADS: OnceLock<bool> = OnceLock::new();
    // An error without a cause says that they are there already.
    let begin = || !ThreadPoolBuilder::new().build_global().is_err_and(|e| e.source().is_some());
    if *HAS_THREADS.get_or_init(begin) {
        return work();
    }
    ALONE.with(|alone| match alone {
        Some(alone) => alone.install(work),
        None => work(),
    })
}
