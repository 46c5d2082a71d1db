//! Runs models that are expected to fail, and says how they did.

use super::{EXPLORED, lock};
use std::cell::Cell;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::{Mutex, Once};

thread_local! {
    /// Whether this thread looks for failures: their panics are no news.
    static HUNTING: Cell<bool> = const { Cell::new(false) };
}

/// Panics stay unprinted from now on in threads that hunt, and in no others.
fn hush() {
    static HUSHED: Once = Once::new();
    HUSHED.call_once(|| {
        let print = take_hook();
        set_hook(Box::new(move |panic| {
            if !HUNTING.get() {
                print(panic);
            }
        }));
    });
}

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

/// `judge` of every item, in the items' order, on as many threads as there are processors.
pub(crate) fn each<T: Copy + Sync, R: Send>(items: &[T], judge: impl Fn(T) -> R + Sync) -> Vec<R> {
    hush();
    let (next, judged) = (Mutex::new(0..items.len()), Mutex::new(Vec::new()));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                HUNTING.set(true);
                loop {
                    let Some(at) = lock(&next).next() else { break };
                    let verdict = judge(items[at]);
                    lock(&judged).push((at, verdict));
                }
            });
        }
    });
    let mut judged = judged.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    judged.sort_by_key(|(at, _)| *at);
    judged.into_iter().map(|(_, verdict)| verdict).collect()
}
