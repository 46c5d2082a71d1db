//! The ring, the inbox and the latest-value cell are linearizable: of every recorded history some
//! order that keeps to what happened before what is one that a single thread could see.
//!
//! Histories come from real threads and the core as shipped, and from loom, exhaustively for a few
//! operations. In both the clock is one atomic counter, acquired and released by each reading, so that
//! earlier by the clock is "happens before". One thing is allowed beyond a single thread's view, as
//! `IndexRing::pop` says: a pop may miss a push that is under way meanwhile.

mod linear {
    pub(crate) mod history;
    pub(crate) mod specs;
    pub(crate) mod subjects;
}
mod models;

use dualframe_core_model::instrument::{Fault, seed};
use linear::history::{Log, Object, is_linearizable};
use linear::specs::{CellOp, Fifo, Letters, MailOp, QueueOp, Register};
use linear::subjects::{Do, Program, modelled, shipped};
use models::{Role, check, free_lent, hunt::kill, lend, together};
use stateright::semantics::SequentialSpec;
use std::hint::spin_loop;
use std::sync::atomic::{AtomicU32, Ordering::AcqRel, Ordering::Acquire};

/// Histories of each object on real threads, at least.
const HISTORIES: u32 = 4000;
/// As many on a machine so busy that before them no two threads did anything at once.
const MOST_HISTORIES: u32 = 25 * HISTORIES;
/// Histories that the same threads make, one after the other.
const ROUNDS: u32 = 200;

/// A pseudo-random number below `bound`.
fn draw(state: &mut u64, bound: u32) -> u32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as u32 % bound
}

/// Runs each round's programs at once, one round after the other on the same threads, and returns
/// each round's logs.
fn on_threads<S>(rounds: Vec<Vec<Program<S>>>) -> Vec<Vec<Log<S>>>
where
    S: Object<Op: Send, Ret: Send>,
{
    let threads = rounds[0].len();
    let count = |round: &Vec<_>| AtomicU32::new(round.len() as u32);
    let absent: &Vec<AtomicU32> = &rounds.iter().map(count).collect();
    let ticks = &AtomicU32::new(0);
    let mut columns: Vec<Vec<_>> = (0..threads).map(|_| Vec::new()).collect();
    for round in rounds {
        columns.iter_mut().zip(round).for_each(|(column, program)| column.push(program));
    }
    let run = move |column: Vec<Program<S>>| -> Vec<Log<S>> {
        let meet = |absent: &AtomicU32| {
            absent.fetch_sub(1, AcqRel);
            // Spinning, so that all start at once; yielding, for there may be fewer processors.
            while absent.load(Acquire) > 0 {
                (0..500).take_while(|_| absent.load(Acquire) > 0).for_each(|_| spin_loop());
                std::thread::yield_now();
            }
        };
        let program = |(program, absent): (Program<S>, _)| {
            meet(absent);
            program(&|| ticks.fetch_add(1, AcqRel))
        };
        column.into_iter().zip(absent).map(program).collect()
    };
    let logs: Vec<Vec<Log<S>>> = std::thread::scope(|scope| {
        let running: Vec<_> =
            columns.into_iter().map(|column| scope.spawn(move || run(column))).collect();
        running.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    (0..absent.len()).map(|round| logs.iter().map(|log| log[round].clone()).collect()).collect()
}

/// Whether any two operations of `logs` overlapped.
fn overlaps<S: SequentialSpec>(logs: &[Log<S>]) -> bool {
    let mut spans: Vec<_> = logs.iter().flatten().map(|entry| (entry.0, entry.2)).collect();
    spans.sort_unstable();
    spans.windows(2).any(|pair| pair[1].0 < pair[0].1)
}

/// Records histories of random programs on real threads, and judges each.
fn judge_shipped<S>(name: &str, spec: S, programs: impl Fn(&mut u64) -> Vec<Program<S>>)
where
    S: Object<Op: Send, Ret: Send>,
{
    // On one processor operations are at once only where a thread is preempted in the midst of one.
    let needed = u32::from(std::thread::available_parallelism().is_ok_and(|count| count.get() > 1));
    let (mut state, mut histories, mut overlapping) = (1, 0, 0);
    while histories < HISTORIES || (overlapping < needed && histories < MOST_HISTORIES) {
        for logs in on_threads::<S>((0..ROUNDS).map(|_| programs(&mut state)).collect()) {
            assert!(is_linearizable(spec.clone(), &logs), "{name}: {logs:#?}");
            overlapping += u32::from(overlaps::<S>(&logs));
        }
        free_lent();
        histories += ROUNDS;
    }
    println!("{name}: {histories} histories, {overlapping} of them with operations at once");
    assert!(overlapping >= needed, "{name}: nothing was at once");
}

#[test]
fn the_ring_on_threads() {
    judge_shipped("ring", Fifo::of(0..2), |state| {
        let thread = |own: u32| {
            let mut steps =
                [Do::Pop, Do::Pass, Do::Pass, Do::Pop].map(|step| (draw(state, 9), step));
            steps.sort_unstable_by_key(|step| step.0);
            let mut steps: Vec<_> = steps.map(|step| step.1).into();
            steps.insert(draw(state, 4) as usize, Do::Push(own));
            steps
        };
        shipped::queue(5, 2, [2, 3, 4].map(thread))
    });
}

#[test]
fn the_inbox_on_threads() {
    judge_shipped("inbox", Letters::default(), |state| {
        let sender = |sender| (0..4).map(|at| MailOp::Post([sender, at], draw(state, 2))).collect();
        let [first, second] = [5, 6].map(sender);
        let collect = vec![MailOp::Collect(1), MailOp::Collect(1), MailOp::Collect(2)];
        shipped::inbox(8, [first, second, collect])
    });
}

#[test]
fn the_latest_value_cell_on_threads() {
    judge_shipped("latest", Register::default(), |_| shipped::latest(5, &[4, 4]));
}

/// Explores `programs` and judges every history; the outcomes are what the operations returned, by
/// thread.
fn judge_modelled<S>(
    name: &str,
    bound: Option<usize>,
    spec: fn() -> S,
    programs: fn() -> Vec<Program<S>>,
    expected: impl IntoIterator<Item = Vec<S::Ret>>,
) where
    S: Object<Ret: Ord + Send + Sync> + 'static,
{
    check(name, bound, 2, expected, move |order| {
        let ticks = &*lend(loom::sync::atomic::AtomicU32::new(0));
        let role = |program: Program<S>| -> Role<Log<S>> {
            Box::new(move || program(&|| ticks.fetch_add(1, AcqRel)))
        };
        let logs = together(order, programs().into_iter().map(role).collect());
        assert!(is_linearizable(spec(), &logs), "not linearizable: {logs:?}");
        logs.into_iter().flatten().map(|entry| entry.3).collect()
    });
}

/// One index inside, one outside; one thread pushes and pops, the other passes on and pops.
fn ring_modelled() {
    let programs = || modelled::queue(2, 1, [vec![Do::Push(1), Do::Pop], vec![Do::Pass, Do::Pop]]);
    let expected = [
        vec![None, Some(0), Some(0), None, Some(1)],
        vec![None, Some(0), Some(1), None, Some(1)],
        vec![None, Some(1), Some(0), None, Some(0)],
        // The other's push was under way.
        vec![None, Some(0), None, Some(1)],
        vec![None, None, Some(0), None, Some(1)],
    ];
    judge_modelled("linear::ring", Some(4), || Fifo::of(0..1), programs, expected);
}

/// One posts for this frame and the next, the other collects for both.
fn inbox_modelled() {
    let programs = || {
        let posts = vec![MailOp::Post([7, 0], 1), MailOp::Post([7, 1], 0)];
        modelled::inbox(2, [posts, vec![MailOp::Collect(1), MailOp::Collect(2)]])
    };
    let collected = [
        [vec![], vec![]],
        [vec![], vec![[7, 0]]],
        [vec![], vec![[7, 0], [7, 1]]],
        [vec![[7, 1]], vec![[7, 0]]],
    ];
    let expected = collected.map(|[first, second]| vec![vec![], vec![], first, second]);
    judge_modelled("linear::inbox", Some(3), Letters::default, programs, expected);
}

/// One publishes twice, two read.
fn latest_modelled() {
    let programs = || modelled::latest(2, &[2, 1]);
    let monotone = (0..=2).flat_map(|a| (a..=2).map(move |b| [a, b]));
    let read = monotone.flat_map(|[a, b]| (0..=2).map(move |c| [a, b, c]));
    let expected = read.map(|[a, b, c]| vec![None, None, Some(a), Some(b), Some(c)]);
    judge_modelled("linear::latest", Some(2), Register::default, programs, expected);
}

#[test]
fn the_ring_under_loom() {
    ring_modelled();
}

#[test]
fn the_inbox_under_loom() {
    inbox_modelled();
}

#[test]
fn the_latest_value_cell_under_loom() {
    latest_modelled();
}

/// Bugs in the core's own code make histories that are refused.
#[test]
fn seeded_bugs_are_refused() {
    let bugs = [
        (Fault::TicketPush, ring_modelled as fn()),
        (Fault::PopNotRetried, ring_modelled),
        (Fault::LetterNotRetried, inbox_modelled),
        (Fault::LetterEarly, inbox_modelled),
    ];
    for (fault, model) in bugs {
        seed(Some(fault));
        let how = kill(model).map(|kill| kill.how);
        assert_eq!(how.as_deref(), Some("not linearizable"), "{fault:?}");
    }
    seed(None);
}

/// Histories that no queue, inbox or cell makes.
#[test]
fn impossible_histories_are_refused() {
    use {CellOp::*, MailOp::*, QueueOp::*};
    let queue = |logs: &[Log<Fifo>]| is_linearizable(Fifo::default(), logs);
    let pushed: Log<Fifo> = vec![(0, Push(1), 1, None), (2, Push(2), 3, None)];
    assert!(queue(&[pushed.clone(), vec![(4, Pop, 5, Some(1))]]));
    assert!(!queue(&[pushed.clone(), vec![(4, Pop, 5, None)]]), "a stale empty");
    assert!(!queue(&[pushed.clone(), vec![(4, Pop, 5, Some(2))]]), "newest first");
    let twice = vec![(4, Pop, 5, Some(1)), (6, Pop, 7, Some(1))];
    assert!(!queue(&[pushed, twice]), "doubled");
    let slow: Log<Fifo> = vec![(0, Push(1), 9, None)];
    assert!(queue(&[slow.clone(), vec![(1, Pop, 2, None), (3, Pop, 4, Some(1))]]), "under way");
    let other = vec![(1, Push(2), 2, None)];
    let taken = vec![(3, Pop, 4, Some(1))];
    assert!(queue(&[slow.clone(), vec![(0, Pop, 10, None)], taken.clone(), other.clone()]));
    let late = vec![(5, Pop, 6, None)];
    assert!(!queue(&[slow.clone(), late, taken, other]), "a stale empty, with a push under way");
    assert!(!queue(&[slow, vec![(1, Pop, 2, Some(1)), (3, Pop, 4, Some(1))]]), "doubled");

    let inbox = |logs: &[Log<Letters>]| is_linearizable(Letters::default(), logs);
    let posted: Log<Letters> =
        vec![(0, Post([1, 0], 0), 1, vec![]), (2, Post([1, 1], 1), 3, vec![])];
    assert!(inbox(&[posted.clone(), vec![(4, Collect(1), 5, vec![[1, 0]])]]));
    assert!(!inbox(&[posted.clone(), vec![(4, Collect(1), 5, vec![])]]), "lost");
    assert!(!inbox(&[posted.clone(), vec![(4, Collect(1), 5, vec![[1, 0], [1, 1]])]]), "early");
    assert!(!inbox(&[posted, vec![(4, Collect(2), 5, vec![[1, 1], [1, 0]])]]), "out of order");

    let cell = |logs: &[Log<Register>]| is_linearizable(Register::default(), logs);
    let published: Log<Register> = vec![(0, Publish(1), 1, None), (2, Publish(2), 9, None)];
    assert!(cell(&[published.clone(), vec![(3, Read, 4, Some(1)), (5, Read, 6, Some(2))]]));
    assert!(
        !cell(&[published.clone(), vec![(3, Read, 4, Some(2)), (5, Read, 6, Some(1))]]),
        "back"
    );
    let others = [vec![(3, Read, 4, Some(2))], vec![(5, Read, 6, Some(1))]];
    assert!(!cell(&[&[published.clone()][..], &others].concat()), "back, for another reader");
    assert!(!cell(&[published, vec![(3, Read, 4, Some(0))]]), "older than what was published");
}
