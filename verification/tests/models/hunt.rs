//! Runs models that are expected to fail, and says how they did.

use super::{EXPLORED, lock};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;

/// How a model failed.
#[derive(Clone, Debug)]
pub(crate) struct Kill {
    /// Executions up to and including the one that failed, of all models tried.
    pub(crate) executions: usize,
    /// What the failure said, in short.
    pub(crate) how: String,
}

impl fmt::Display for Kill {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} | {}", self.executions, self.how)
    }
}

/// Runs `model`; `None` if it passes.
pub(crate) fn kill(model: fn()) -> Option<Kill> {
    let before = EXPLORED.get();
    let failure = catch_unwind(AssertUnwindSafe(model)).err()?;
    let said = failure
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| failure.downcast_ref::<&str>().copied())
        .unwrap_or("a panic without words");
    Some(Kill { executions: EXPLORED.get() - before, how: shorten(said) })
}

/// Loom's verdicts by name, an assertion by its own words.
fn shorten(said: &str) -> String {
    if said.contains("exceeded maximum number of branches") {
        return "stall, at loom's limit of branches".into();
    }
    if said.contains("Causality violation") {
        return "data race".into();
    }
    let first = said.lines().next().unwrap_or_default();
    let words = first.strip_prefix("assertion `left == right` failed: ").unwrap_or(first);
    let words = words.split(": [").next().unwrap_or(words);
    words.chars().take(70).collect()
}

/// `judge` of every item, in the items' order, on as many threads as there are processors. Panics
/// inside stay unprinted: they are what is looked for.
pub(crate) fn each<T: Copy + Sync, R: Send>(items: &[T], judge: impl Fn(T) -> R + Sync) -> Vec<R> {
    std::panic::set_hook(Box::new(|_| ()));
    let (next, judged) = (Mutex::new(0..items.len()), Mutex::new(Vec::new()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let Some(at) = lock(&next).next() else { break };
                    let verdict = judge(items[at]);
                    lock(&judged).push((at, verdict));
                }
            });
        }
    });
    let _ = std::panic::take_hook();
    let mut judged = judged.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    judged.sort_by_key(|(at, _)| *at);
    judged.into_iter().map(|(_, verdict)| verdict).collect()
}
