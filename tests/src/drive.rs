//! Runs a case on threads that join, leave, and pass the tokens around, and judges the outcome.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Condvar, Mutex};

use dualframe_core::contacts::{ContactSlot, SegmentSlot};
use dualframe_core::inbox::{From, LetterSlot};
use dualframe_core::pipeline::{BroadPhase, Config, Pipeline};
use dualframe_core::ring::QueueSlot;
use dualframe_core::storage::{InteractionSlot, Memory as Tables, UnitSlot, queue_slots};
use dualframe_core::token::Token;
use dualframe_core::unit::UnitId;
use dualframe_core::wait::{Bell, Epoch, Waiting};
use dualframe_core::worker::{Step, Worker};

use crate::body::{MOST_LETTERS, MOST_RECORDS, Memory, draw};
use crate::checker::{Expected, check};
use crate::host::{Failure, Host, Screen};
use crate::random_ve::{Case, Fault, OUTSIDE};
use crate::reference::{self, Outcome};
use crate::seen::Seen;
use crate::trace::{Act, Record, Trace};
use crate::watchdog;

/// Sleeps on condition variables, for as long as it takes: a wake-up that is lost is a hang.
#[derive(Debug, Default)]
pub struct Park {
    rooms: [(Mutex<()>, Condvar); 2],
}

impl Waiting for Park {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        let (room, awake) = &self.rooms[usize::from(bell.is_for_holders())];
        let mut guard = room.lock().expect("no poison");
        while !bell.rung_since(seen) {
            guard = awake.wait(guard).expect("no poison");
        }
    }

    fn wake(&self, bell: &Bell, count: u32) {
        let (room, awake) = &self.rooms[usize::from(bell.is_for_holders())];
        drop(room.lock().expect("no poison"));
        (0..count.min(64)).for_each(|_| awake.notify_one());
    }
}

type Hand<'p, 'm, 'c> = Worker<'p, 'm, Host<'c>, Park>;
type Machine<'m, 'c> = Pipeline<'m, Host<'c>, Park>;

/// What the threads of one segment share.
struct Shop<'p, 'c> {
    case: &'c Case,
    trace: &'c Trace,
    segment: u32,
    /// Tokens that no worker holds.
    tokens: Mutex<Vec<Token<'p, Screen>>>,
    failures: Mutex<Vec<Failure>>,
    /// Work units done: when late joiners join.
    steps: AtomicU32,
    /// A thread has panicked; the others would wait for what it carried.
    broken: AtomicBool,
}

/// Runs `case` and says how much was seen, or everything that was wrong.
///
/// # Errors
/// A list of what was wrong, a line each.
pub fn run(case: &Case) -> Result<Seen, String> {
    let _watch = watchdog::watch(format!("{case:?}"));
    let trace = Trace::default();
    let (outcome, mut wrong) = run_pipeline(case, &trace);
    let expected = reference::run(case);
    for (body, reference) in outcome.bodies.iter().zip(&expected.bodies) {
        if body.bits() != reference.bits() {
            wrong.push(format!("state: {body:?}, sequentially {reference:?}"));
        }
    }
    for (memory, reference) in outcome.memories.iter().zip(&expected.memories) {
        if memory.sum.to_bits() != reference.sum.to_bits() {
            wrong.push(format!("interaction: {memory:?}, sequentially {reference:?}"));
        }
    }
    wrong.extend(compare_failures(&outcome.failures, &expected.failures));
    let records = trace.records();
    let broken = check(&Expected::of(case), &records);
    wrong.extend(broken.iter().map(|broken| format!("{broken:?}")));
    if wrong.is_empty() {
        return Ok(Seen::of(&records, outcome.failures.len()));
    }
    let count = wrong.len();
    wrong.truncate(12);
    Err(format!("{count} wrong:\n{}\nin {case:#?}", wrong.join("\n")))
}

type Failures = [(Fault, u32, [u32; 2])];

/// Every failure is reported by exactly one step; only a swap's error may give way, to that of the rendering that it
/// follows in the same step.
fn compare_failures(seen: &Failures, expected: &Failures) -> Vec<String> {
    let count = |all: &Failures, failure| all.iter().filter(|&other| other == failure).count();
    let drawing_fails =
        |of| expected.iter().any(|&(at, frame, _)| at == Fault::Render && frame == of);
    let mut wrong = vec![];
    for failure in seen.iter().chain(expected) {
        let gives_way = failure.0 == Fault::Swap && drawing_fails(failure.1);
        let (seen, expected) = (count(seen, failure), count(expected, failure));
        if seen != expected && (!gives_way || seen > expected) {
            wrong.push(format!("failure {failure:?} reported {seen} times, not {expected}"));
        }
    }
    wrong
}

/// Runs `case`, and returns what it came to and what the host saw go wrong.
fn run_pipeline<'c>(case: &'c Case, trace: &'c Trace) -> (Outcome, Vec<String>) {
    let units = case.units.len();
    // As tight as can be, so that a table that is emptied late is a full one.
    let most = match case.broad_phase {
        BroadPhase::Spatial => units * (units - 1) / 2 + units,
        BroadPhase::Pairwise => case.edges.len(),
    };
    let mut unit_slots: Vec<_> = case
        .units
        .iter()
        .map(
            |&(solitary, body)| {
                if solitary { UnitSlot::solitary(body) } else { UnitSlot::new(body) }
            },
        )
        .collect();
    let mut interactions: Vec<_> = match case.broad_phase {
        BroadPhase::Spatial => {
            (0..2 * most).map(|_| InteractionSlot::spare(Memory::default())).collect()
        }
        BroadPhase::Pairwise => {
            let slot = |&[a, b]: &[u32; 2]| {
                InteractionSlot::between(UnitId(a), UnitId(b), Memory::default())
            };
            case.edges.iter().map(slot).collect()
        }
    };
    let records = 2 * most * MOST_RECORDS;
    // Those due now and those for the next frame, and one from outside.
    let letters = 2 * MOST_LETTERS * units + 1;
    let queues = queue_slots(units, interactions.len(), letters, case.homes as usize);
    let mut wrong = vec![];
    let memory = Tables {
        units: &mut unit_slots,
        interactions: &mut interactions,
        contacts: &mut Vec::from_iter((0..records).map(|_| ContactSlot::new())),
        segments: &mut Vec::from_iter((0..records).map(|_| SegmentSlot::new())),
        letters: &mut Vec::from_iter((0..letters).map(|_| LetterSlot::new())),
        queues: &mut Vec::from_iter((0..queues).map(|_| QueueSlot::new())),
    };
    let Case { broad_phase, entry, tokens, homes, .. } = *case;
    let config = Config { broad_phase, entry, tokens, homes };
    let mut pipeline: Machine<'_, 'c> =
        Pipeline::new(memory, config, Park::default()).expect("memory that fits");
    let mut failures = vec![];
    let mut start = 0;
    for (segment, &frames) in case.segments.iter().enumerate() {
        let (to, word) = case.letter_from_outside(segment as u32);
        let from = From { sender: OUTSIDE, sequence: segment as u32 };
        let begin = trace.tick();
        pipeline.post(UnitId(to), from, word).expect("a letter slot");
        let act = Act::Post { to, due: start, rank: (from.sender, from.sequence) };
        trace.gather(vec![Record { begin, end: trace.tick(), thread: u32::MAX, act }]);
        pipeline.run(frames).expect("a pipeline at rest");
        start += frames;
        if case.shared {
            pipeline.share(Screen { token: 0 }).map_err(drop).expect("no token is out");
        }
        failures.extend(run_segment(case, trace, &pipeline, segment as u32));
        if !pipeline.finished() || pipeline.frame().0 != start {
            wrong.push(format!("stopped at {:?}, not at frame {start}", pipeline.frame()));
        }
        if pipeline.take_back().is_some() != case.shared {
            wrong.push("the shared renderer does not come back".to_owned());
        }
    }
    let bodies = pipeline.objects_mut().map(|body| *body).collect();
    let states = interactions.iter_mut().map(|slot| *slot.state_mut());
    let memories = if case.edges.is_empty() { vec![] } else { states.collect() };
    let mut faults = vec![];
    for failure in failures {
        match failure {
            Failure::Fault(at, frame, about) => faults.push((at, frame, about)),
            other => wrong.push(format!("{other:?}")),
        }
    }
    (Outcome { bodies, memories, failures: faults }, wrong)
}

fn run_segment<'c>(
    case: &'c Case,
    trace: &'c Trace,
    pipeline: &Machine<'_, 'c>,
    segment: u32,
) -> Vec<Failure> {
    let token = |token| pipeline.token(Screen { token }).map_err(drop).expect("a token");
    let tokens = if case.shared { 0 } else { case.tokens };
    let shop = Shop {
        case,
        trace,
        segment,
        tokens: Mutex::new((0..tokens).map(token).collect()),
        failures: Mutex::new(vec![]),
        steps: AtomicU32::new(0),
        broken: AtomicBool::new(false),
    };
    assert!(pipeline.token(Screen { token: u32::MAX }).is_err(), "one token too many");
    std::thread::scope(|scope| {
        for thread in 0..case.workers {
            let shop = &shop;
            scope.spawn(move || shop.work(pipeline, thread));
        }
    });
    shop.failures.into_inner().expect("no poison")
}

/// Says that a thread has panicked.
struct Alarm<'a>(&'a AtomicBool);

impl Drop for Alarm<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::SeqCst);
        }
    }
}

impl<'p, 'c> Shop<'p, 'c> {
    fn over(&self, pipeline: &Machine<'_, '_>) -> bool {
        pipeline.finished() || self.broken.load(Ordering::SeqCst)
    }

    /// Whether a worker may leave for good: not with the token in hand, nor while one lies about
    /// that this thread may have put there, for those who sleep would not notice it.
    fn may_go(&self, worker: &mut Hand<'p, '_, 'c>) -> bool {
        worker.renderer().is_none() && self.tokens.lock().expect("no poison").is_empty()
    }

    /// One thread, from joining to leaving. The first one never leaves, so that there is one.
    fn work(&self, pipeline: &'p Machine<'_, 'c>, thread: u32) {
        let _alarm = Alarm(&self.broken);
        let host = Host { case: self.case, trace: self.trace, thread, log: Mutex::new(Vec::new()) };
        let mut dice = Dice { seed: self.case.seed, about: [30, self.segment, thread, 0] };
        let joins = if thread == 0 || dice.one_in(2) { 0 } else { dice.below(60) };
        while self.steps.load(Ordering::SeqCst) < joins && !self.over(pipeline) {
            std::thread::yield_now();
        }
        // The first thread never leaves, so that there is one.
        let may_leave = thread != 0 && dice.one_in(2);
        let leaves = if may_leave { dice.below(120) } else { u32::MAX };
        let mut worker = pipeline.worker_at(thread);
        let mut stepped = 0;
        while !self.over(pipeline) && (stepped < leaves || !self.may_go(&mut worker)) {
            stepped = stepped.saturating_add(1);
            let step = worker.step(&host);
            if step != Ok(Step::Idle) {
                self.steps.fetch_add(1, Ordering::SeqCst);
            }
            if let Err(failure) = step {
                self.failures.lock().expect("no poison").push(failure);
            }
            if dice.one_in(12) {
                self.tokens.lock().expect("no poison").extend(worker.release());
            }
            if dice.one_in(24) {
                // Half of the time with the token in hand: then that is gone too.
                let holding = worker.renderer().map(|screen| screen.token);
                drop(worker);
                if dice.one_in(4) {
                    std::thread::yield_now();
                }
                worker = pipeline.worker_at(thread);
                if let Some(token) = holding {
                    let token = pipeline.token(Screen { token }).map_err(drop).expect("a token");
                    self.tokens.lock().expect("no poison").push(token);
                }
            }
            let idle = step == Ok(Step::Idle);
            if (idle || dice.one_in(6))
                && worker.renderer().is_none()
                && let Some(token) = self.tokens.lock().expect("no poison").pop()
            {
                worker.hold(token).map_err(drop).expect("this pipeline's token");
                continue;
            }
            if idle && self.case.sleep {
                worker.wait();
            } else if idle {
                std::thread::yield_now();
            }
        }
        self.tokens.lock().expect("no poison").extend(worker.release());
        drop(worker);
        self.trace.gather(host.log.into_inner().expect("no poison"));
    }
}

/// A thread's random decisions.
struct Dice {
    seed: u64,
    about: [u32; 4],
}

impl Dice {
    fn below(&mut self, bound: u32) -> u32 {
        self.about[3] += 1;
        (draw(self.seed, &self.about) % u64::from(bound)) as u32
    }

    fn one_in(&mut self, count: u32) -> bool {
        self.below(count) == 0
    }
}
