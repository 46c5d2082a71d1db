//! Histories of operations, when each began and ended, and the judgement over them.

use stateright::semantics::{ConsistencyTester, LinearizabilityTester, SequentialSpec};
use std::fmt::Debug;

/// One thread's operations: when it was invoked, what, when it returned, with what.
pub(crate) type Log<S> = Vec<(u32, <S as SequentialSpec>::Op, u32, <S as SequentialSpec>::Ret)>;

/// An object's specification, and what its operations need to know of the rest of the history.
pub(crate) trait Object:
    SequentialSpec<Op: Clone + Debug, Ret: Clone + Debug> + Clone
{
    /// Notes it.
    fn annotate(_logs: &mut [Log<Self>]) {}
}

/// Runs `operation`, and notes what it returned and when by `clock`, whose calls are all ordered: an
/// operation that returned before another was invoked happened before it.
pub(crate) fn record<S: SequentialSpec>(
    log: &mut Log<S>,
    clock: impl Fn() -> u32,
    op: S::Op,
    operation: impl FnOnce() -> S::Ret,
) -> &S::Ret {
    let invoked = clock();
    let result = operation();
    log.push((invoked, op, clock(), result));
    &log[log.len() - 1].3
}

/// Whether some order of the operations that keeps to the clock is one that `spec`, alone, allows.
pub(crate) fn is_linearizable<S: Object>(spec: S, logs: &[Log<S>]) -> bool {
    let mut logs = logs.to_vec();
    S::annotate(&mut logs);
    let mut events: Vec<_> = logs
        .iter()
        .enumerate()
        .flat_map(|(thread, log)| log.iter().map(move |entry| (thread, entry)))
        .flat_map(|(thread, (invoked, op, returned, result))| {
            [(*invoked, thread, Ok(op)), (*returned, thread, Err(result))]
        })
        .collect();
    events.sort_by_key(|event| event.0);
    let mut tester = LinearizabilityTester::new(spec);
    for (_, thread, event) in events {
        let noted = match event {
            Ok(op) => tester.on_invoke(thread, op.clone()).map(drop),
            Err(result) => tester.on_return(thread, result.clone()).map(drop),
        };
        noted.expect("a thread's operations follow each other");
    }
    tester.is_consistent()
}
