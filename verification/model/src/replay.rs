//! Replays what was seen of a real run, step by step, in the transition relation.
//!
//! Beginnings, tests, callbacks, swaps and ends are seen; arrivals are not. Those that only set
//! others free are made at once, since nothing that is seen later can need them undone. Of the rest,
//! whose order decides who tests a pair and who swaps, every order is kept in mind that what was
//! seen so far allows.

use std::collections::{HashMap, HashSet};
use std::fmt;

use stateright::Model;

use crate::config::Config;
use crate::model::{Action, Protocol};
use crate::state::{At, Because, State, Worker};
use crate::step::Act;
use crate::trace::{Event, Seen, Task};
use crate::work::{Work, indices};

/// A run that the model does not allow.
#[derive(Clone, Debug)]
pub struct Refused {
    /// Which of the things seen, or their number, if the run ended too early.
    pub step: usize,
    /// What was seen there.
    pub seen: Option<Seen>,
    /// Which of the workers below that was: whoever joins again is another one.
    pub worker: Option<u8>,
    /// What was seen just before.
    pub before: Vec<Seen>,
    /// Where the protocol stood.
    pub state: String,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.seen {
            Some(seen) => {
                writeln!(f, "step {}, {seen:?}, is not allowed at", self.step)?;
                self.worker
                    .map_or(Ok(()), |worker| writeln!(f, "    (it is worker {worker} here)"))?;
            }
            None => writeln!(f, "the run ended after {} steps, unfinished, at", self.step)?,
        }
        writeln!(f, "{}after", self.state)?;
        self.before.iter().try_for_each(|seen| writeln!(f, "    {seen:?}"))
    }
}

/// What a replay came to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Replayed {
    /// Steps seen.
    pub steps: usize,
    /// Most states that had to be kept in mind at once.
    pub states: usize,
}

/// Replays `record`, a run of all frames of `config`, whose numbers of workers, departures and
/// handovers are read off the record.
///
/// # Errors
/// [`Refused`] names the first step that the model does not allow.
///
/// # Panics
/// If more than 250 workers join.
pub fn replay(config: &Config, record: &[Seen]) -> Result<Replayed, Refused> {
    let count = |event| record.iter().filter(|seen| seen.event == event).count().min(251) as u8;
    let joins = count(Event::Join);
    assert!(joins <= 250, "too many workers");
    // One that does nothing but come for units: whoever leaves is not the last.
    let config = Config {
        workers: joins + 1,
        late: joins,
        departures: count(Event::Leave),
        handovers: count(Event::Release),
        may_miss: true,
        sleep: false,
        ..config.clone()
    };
    let mut initial = State::initial(&config);
    let idle = &mut initial.workers[0];
    initial.tokens += u8::from(std::mem::take(&mut idle.holds));
    let mut replay = Replay {
        model: Protocol(config),
        workers: HashMap::new(),
        joined: 0,
        busy: HashSet::new(),
    };
    let mut states = vec![initial];
    let mut replayed = Replayed { steps: record.len(), states: 1 };
    for (step, &seen) in record.iter().enumerate() {
        let in_turn = replay.follow(seen);
        let possible = replay.possible(states);
        replayed.states = replayed.states.max(possible.len());
        let allowed = possible.iter().filter(|_| in_turn);
        let next: HashSet<_> = allowed.filter_map(|state| replay.after(state, seen)).collect();
        states = next.into_iter().collect();
        if states.is_empty() {
            return Err(replay.refusal(step, record, &possible));
        }
    }
    let possible = replay.possible(states);
    let at_rest = |at: At| matches!(at, At::Awake | At::Gone | At::Outside);
    let is_over = |state: &State| {
        state.finished(&replay.model.0) && state.workers.iter().all(|worker| at_rest(worker.at))
    };
    if replay.busy.is_empty() && possible.iter().any(is_over) {
        return Ok(replayed);
    }
    Err(replay.refusal(record.len(), record, &possible))
}

struct Replay {
    model: Protocol,
    /// The model's worker that a thread's is now.
    workers: HashMap<u32, u8>,
    joined: u8,
    /// Threads that have begun a work unit and not ended it.
    busy: HashSet<u32>,
}

/// Whether what comes next there is unseen and only sets others free.
fn only_frees(at: At) -> bool {
    matches!(
        at,
        At::Found(..)
            | At::AtGate(..)
            | At::Opening(..)
            | At::Coming { .. }
            | At::Interacted(_)
            | At::Passing { .. }
            | At::PuttingBack(Because::Leaves)
            | At::Advancing(_)
            | At::Rendered(_)
            | At::Reentering(_)
            | At::Leaving { .. }
    )
}

/// Whether what comes next there is unseen, and its order may matter.
fn is_unseen(at: At) -> bool {
    matches!(at, At::Entering(_) | At::Arriving(..) | At::Counting)
}

/// Makes a worker ready to begin `work` if renderers are shared; `false` if another one renders. Who has the renderer
/// between two steps is not seen, and does not matter: here a worker has it from a rendering's beginning to its end.
fn turned(me: &mut Worker, free: &mut u8, work: Work) -> bool {
    if me.at != At::Awake || (work.is_rendering() && *free == 0) {
        return false;
    }
    (me.at, me.holds) = (At::GoingOn, work.is_rendering());
    *free -= u8::from(me.holds);
    true
}

impl Replay {
    fn refusal(&self, step: usize, record: &[Seen], possible: &[State]) -> Refused {
        let seen = record.get(step).copied();
        let worker = seen.and_then(|seen| self.workers.get(&seen.worker).copied());
        let before = record[step.saturating_sub(5)..step].to_vec();
        let state = possible.first().map(State::to_string).unwrap_or_default();
        Refused { step, seen, worker, before, state }
    }

    /// Keeps account of who is who; `false` if a work unit begins within another, or ends before it
    /// has begun.
    fn follow(&mut self, seen: Seen) -> bool {
        match seen.event {
            Event::Join => {
                self.joined += 1;
                self.workers.insert(seen.worker, self.joined);
                true
            }
            Event::Begin(..) => self.busy.insert(seen.worker),
            Event::End => self.busy.remove(&seen.worker),
            _ => true,
        }
    }

    fn acts(&self, state: &State, worker: u8) -> Vec<Action> {
        let mut acts = vec![];
        self.model.acts(state, worker, &mut acts);
        acts
    }

    /// What only frees in `state`. Whoever comes for a unit of an open frame does; here it is the one who never does
    /// anything else.
    fn frees(&self, state: &State) -> Option<Action> {
        let worker = state.workers.iter().position(|worker| only_frees(worker.at));
        let comes = || Some((0, Act::Come(indices(u64::from(state.opened)).next()? as u8)));
        worker.map_or_else(comes, |worker| self.acts(state, worker as u8).first().copied())
    }

    /// `state` after `action` and all that only frees; `None` if that breaks a rule.
    fn made(&self, state: &State, action: Action) -> Option<State> {
        let mut state = self.model.next_state(state, action)?;
        while let Some(act) = self.frees(&state) {
            state = self.model.next_state(&state, act)?;
        }
        let config = &self.model.0;
        let sound = state.broken.is_none() && state.access(config) && state.tokens(config);
        sound.then_some(state)
    }

    /// All states that an unseen step of `worker` may have led to.
    fn after_unseen(&self, state: &State, worker: usize) -> Vec<State> {
        let at = state.workers[worker].at;
        let steps = if is_unseen(at) { self.acts(state, worker as u8) } else { vec![] };
        let unseen = steps.into_iter().filter(|(_, act)| matches!(act, Act::Go { .. }));
        unseen.filter_map(|act| self.made(state, act)).collect()
    }

    /// All states that unseen steps may have led to.
    fn possible(&self, states: Vec<State>) -> Vec<State> {
        let mut known: HashSet<State> = states.iter().cloned().collect();
        let mut all = states;
        let mut next = 0;
        while let Some(state) = all.get(next).cloned() {
            next += 1;
            for worker in 0..state.workers.len() {
                for later in self.after_unseen(&state, worker) {
                    if known.insert(later.clone()) {
                        all.push(later);
                    }
                }
            }
        }
        all
    }

    /// `state` after what was seen, if that is allowed there.
    fn after(&self, state: &State, seen: Seen) -> Option<State> {
        let &worker = self.workers.get(&seen.worker)?;
        let me = &state.workers[worker as usize];
        let act = match seen.event {
            Event::Join | Event::Leave | Event::Hold | Event::Release
                if state.finished(&self.model.0) =>
            {
                return Some(state.clone());
            }
            Event::Join => Act::Join,
            Event::Leave => Act::Leave,
            Event::Hold => Act::Hold,
            Event::Release => Act::Release,
            Event::Begin(task, frame) => {
                let work = self.work(task)?;
                if self.frame(state, work) != frame {
                    return None;
                }
                Act::Take(work)
            }
            Event::Test(ends, near) => Act::Test { pair: self.pair(ends)?, near },
            Event::Call(task, frame) => {
                let work = self.work(task)?;
                let callback = match work {
                    Work::Interact(pair) => At::Interacting(pair),
                    Work::Update(unit) => At::Updating(unit),
                    Work::Render(unit) => At::Rendering(unit),
                    Work::Enter(_) => return None,
                };
                if me.at != callback || self.frame(state, work) != frame {
                    return None;
                }
                Act::Call { carry: false }
            }
            Event::Swap(frame) => {
                if me.at != At::Swapping || u32::from(state.display) != frame {
                    return None;
                }
                Act::Call { carry: false }
            }
            Event::End => {
                let mut ended = state.clone();
                self.put_back(&mut ended, worker);
                return (me.at == At::Awake).then_some(ended);
            }
        };
        // Somebody may have taken its token and not have been seen to hold it yet.
        let mut state = state.clone();
        state.workers[worker as usize].offers &= act != Act::Leave;
        if self.model.0.shared
            && let Act::Take(work) = act
            && !turned(&mut state.workers[worker as usize], &mut state.tokens, work)
        {
            return None;
        }
        let allowed = self.acts(&state, worker).contains(&(worker, act));
        let mut after = allowed.then(|| self.made(&state, (worker, act))).flatten()?;
        if matches!(seen.event, Event::Call(Task::Update(_), _)) {
            self.put_back(&mut after, worker);
        }
        Some(after)
    }

    /// Puts back a shared renderer that `worker` may have.
    fn put_back(&self, state: &mut State, worker: u8) {
        let me = &mut state.workers[worker as usize];
        if self.model.0.shared && std::mem::take(&mut me.holds) {
            state.tokens += 1;
        }
    }

    fn work(&self, task: Task) -> Option<Work> {
        Some(match task {
            Task::Enter(unit) => Work::Enter(unit as u8),
            Task::Interact { ends, .. } => Work::Interact(self.pair(ends)?),
            Task::Update(unit) => Work::Update(unit as u8),
            Task::Render(unit) => Work::Render(unit as u8),
        })
    }

    fn pair(&self, ends: [u32; 2]) -> Option<u8> {
        let found = self.model.0.pairs.iter().position(|pair| pair.map(u32::from) == ends);
        found.map(|pair| pair as u8)
    }

    /// The frame that `work` belongs to.
    fn frame(&self, state: &State, work: Work) -> u32 {
        let next = |unit: u8| u32::from(state.units[unit as usize].frame);
        match work {
            Work::Enter(unit) | Work::Update(unit) => next(unit),
            Work::Render(unit) => next(unit).wrapping_sub(1),
            Work::Interact(pair) => next(self.model.0.pairs[pair as usize][0]),
        }
    }
}
