//! A state of the protocol.

use std::fmt;

use crate::config::Config;
use crate::work::{Work, Works, indices};

/// A rule that a transition has broken (DESIGN invariants 1 to 4 and 6). Access (5) and progress (7)
/// are read off states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// Something happened twice, or was lost.
    ExactlyOnce,
    /// An update came before what it waits for, or a test before the updates that it reads.
    Order,
    /// A frame was swapped before its last rendering, or rendered before the last swap.
    Swap,
    /// A unit was updated while the frame before last was not swapped.
    TwoFrames,
    /// Somebody rendered without a token.
    Token,
}

/// A unit, as the protocol sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Unit {
    /// The frame of its next update.
    pub frame: u8,
    /// What has to happen before that.
    pub pending: u8,
    /// How often it was rendered.
    pub rendered: u8,
}

/// What a worker goes on with after its unit has left the gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Then {
    /// It is done.
    End,
    /// It takes the rendering of this unit off the unit's countdown.
    Rendered(u8),
    /// It lets units from this number on enter the next frame.
    Enter(u8),
}

/// Why a worker puts the shared renderer back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Because {
    /// It has seen no rendering.
    NothingSeen,
    /// What it had seen when it took it, others have rendered.
    NothingLeft,
    /// It leaves for good.
    Leaves,
}

/// Where a worker is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum At {
    /// Not joined yet.
    Outside,
    /// Left for good.
    Gone,
    /// Between two steps.
    Awake,
    /// Begun to enter a unit: it tests pairs, then arrives (`Spatial`).
    Entering(u8),
    /// Entering: pairs that are to be arrived at (`Pairwise`).
    Arriving(u8, u64),
    /// Has arrived with this unit: counts these pairs, which it found, and lets them go.
    Found(u8, u64),
    /// About to leave the gate with this unit.
    AtGate(u8, Then),
    /// Counts these pairs late (seeded bugs only).
    CountingLate(u64, Then),
    /// Lets whoever comes take the frame's opening off units' countdowns, from this one on.
    Opening(u8, Then),
    /// In the callback of an interaction.
    Interacting(u8),
    /// Takes the interaction off the countdown of its second end.
    Interacted(u8),
    /// In the callback of an update.
    Updating(u8),
    /// Has updated the unit, and carries its rendering, keeps it until the shared renderer is free, or queues it.
    Passing {
        /// The unit.
        unit: u8,
        /// Whether the worker itself may render it now.
        own: bool,
    },
    /// Lets the unit enter its next frame.
    Advancing(u8),
    /// Arms the unit's countdown late (a seeded bug only).
    ArmingLate(u8),
    /// In the callback of a rendering.
    Rendering(u8),
    /// Takes the rendering off the unit's countdown.
    Rendered(u8),
    /// Takes the rendering off the frame's.
    Counting,
    /// Announces what it has queued, and will swap.
    RingingToSwap,
    /// Announces the renderings that it kept and has queued, and will sleep.
    RingingToSleep,
    /// In the callback of a swap.
    Swapping,
    /// Lets units enter the next frame, from this one on, after a swap.
    Reentering(u8),
    /// Announces what it has queued.
    Ringing,
    /// Leaves, for good or without its token: looks at what is left behind, and rings for it.
    Leaving {
        /// For good.
        gone: bool,
    },
    /// Has seen a rendering: takes the shared renderer, if it is free.
    Taking,
    /// Puts the shared renderer back.
    PuttingBack(Because),
    /// Has put the shared renderer back, and looks for renderings once more.
    LookingAgain(Because),
    /// Has seen a rendering then, and rings for it.
    Calling,
    /// Has looked for renderings, and goes on: with one if it has the shared renderer, or with whatever it finds.
    GoingOn,
    /// Has taken a unit of the open frame that nobody had come for, and is to arrive at its countdown.
    Coming {
        /// The unit.
        unit: u8,
        /// Whether it has looked for renderings in this step.
        turned: bool,
    },
    /// Its step found nothing to do: it will sleep.
    Idle,
    /// Has announced that it will sleep; rung since or not.
    Announced(bool),
    /// Has looked whether the shared renderer is free, and not yet for work.
    Glanced {
        /// Rung since it announced itself.
        rung: bool,
        /// Whether it was.
        free: bool,
    },
    /// Has looked again and found nothing; rung since it announced itself or not.
    Looked(bool),
    /// Asleep.
    Asleep,
    /// Awake, and still counted among the sleepers.
    Returning,
}

/// A worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Worker {
    /// Where it is.
    pub at: At,
    /// What it carries.
    pub carried: Works,
    /// Whether it holds a token, or has the shared renderer.
    pub holds: bool,
    /// Whether it has laid a token down that nobody has taken yet: it neither sleeps nor leaves.
    pub offers: bool,
    /// Work units queued and not announced, at most as many as there are workers.
    pub queued: u8,
    /// The same of renderings.
    pub renders: u8,
    /// Pairs that it found before it arrived, and has not counted yet; when it has arrived, in seeded bugs only.
    pub uncounted: u64,
}

impl Worker {
    fn new(at: At, holds: bool) -> Self {
        Self {
            at,
            carried: Works::default(),
            holds,
            offers: false,
            queued: 0,
            renders: 0,
            uncounted: 0,
        }
    }

    /// Whether others count it among a bell's sleepers.
    pub(crate) fn is_counted_asleep(&self) -> bool {
        matches!(
            self.at,
            At::Announced(_) | At::Glanced { .. } | At::Looked(_) | At::Asleep | At::Returning
        )
    }

    /// Whether it listens to the holders' bell, or else to that of all others.
    pub(crate) fn is_holder(&self, config: &Config) -> bool {
        self.holds && !config.shared
    }

    /// Whether it is in a callback other than those of the renderer.
    fn is_at_other_work(&self) -> bool {
        matches!(self.at, At::Entering(_) | At::Arriving(..) | At::Interacting(_) | At::Updating(_))
    }

    /// Whether it is about to leave for good.
    pub(crate) fn is_leaving(&self) -> bool {
        matches!(self.at, At::PuttingBack(Because::Leaves) | At::Leaving { gone: true })
    }

    pub(crate) fn is_present(&self) -> bool {
        !matches!(self.at, At::Outside | At::Gone)
    }
}

/// A state of everything.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct State {
    /// Units.
    pub units: Vec<Unit>,
    /// In how many frames each pair was tested.
    pub tests: Vec<u8>,
    /// Workers.
    pub workers: Vec<Worker>,
    /// What is queued, wherever.
    pub queue: Works,
    /// Units that have arrived (`Spatial`), or pairs with one end that has (`Pairwise`), a bit each.
    pub arrived: u64,
    /// Candidates whose interaction has not ended, a bit each.
    pub found: u64,
    /// Units of the open frame for which nobody has come yet, a bit each.
    pub opened: u8,
    /// Units that have not left the gate.
    pub gate: u8,
    /// Units of the frame on display that are not rendered.
    pub renders: u8,
    /// The frame on display.
    pub display: u8,
    /// Tokens that nobody holds; 1 while the shared renderer is free.
    pub tokens: u8,
    /// How many workers may still leave.
    pub departures: u8,
    /// How often a token may still be given away.
    pub handovers: u8,
    /// The rule that the last transition has broken.
    pub broken: Option<Rule>,
}

impl State {
    /// All units are about to enter the first frame.
    pub fn initial(config: &Config) -> Self {
        let unit = Unit { frame: 0, pending: 1, rendered: 0 };
        let mut queue = Works::default();
        (0..config.units).for_each(|unit| _ = queue.put(Work::Enter(unit)));
        let present = config.workers - config.late;
        let held = if config.shared { 0 } else { config.tokens.min(present) };
        let worker = |number| {
            let at = if number < present { At::Awake } else { At::Outside };
            Worker::new(at, number < held)
        };
        Self {
            units: vec![unit; config.units as usize],
            tests: vec![0; config.pairs.len()],
            workers: (0..config.workers).map(worker).collect(),
            queue,
            arrived: 0,
            found: 0,
            opened: 0,
            gate: config.units,
            renders: config.units,
            display: 0,
            tokens: config.tokens - held,
            departures: config.departures,
            handovers: config.handovers,
            broken: None,
        }
    }

    /// The same state for all orders of the workers, who are all alike.
    #[must_use]
    pub fn representative(&self) -> Self {
        let mut state = self.clone();
        state.workers.sort_unstable();
        state
    }

    /// Whether every frame is swapped.
    pub fn finished(&self, config: &Config) -> bool {
        self.display == config.frames
    }

    pub(crate) fn unit(&mut self, unit: u8) -> &mut Unit {
        &mut self.units[unit as usize]
    }

    /// Whether `worker` would find something in the queues, or a unit to come for.
    pub(crate) fn anything_is_visible(&self, holder: bool) -> bool {
        self.opened != 0 || self.visible(holder).next().is_some()
    }

    /// What `worker` would find in the queues.
    pub(crate) fn visible(&self, holder: bool) -> impl Iterator<Item = Work> {
        self.queue.iter().filter(move |work| match *work {
            Work::Render(unit) => holder && self.is_displayed(unit),
            _ => true,
        })
    }

    /// What `worker` carries, and finds in the queues, that it can do if it `renders` or not.
    pub(crate) fn work(&self, worker: &Worker, renders: bool) -> impl Iterator<Item = Work> {
        let carried = worker.carried.iter().filter(move |work| renders || !work.is_rendering());
        carried.chain(self.visible(renders))
    }

    /// Whether a rendering is queued that may be rendered now.
    pub(crate) fn rendering_is_visible(&self) -> bool {
        self.visible(true).any(Work::is_rendering)
    }

    /// Whether the frame of `unit`'s last update is on display.
    pub(crate) fn is_displayed(&self, unit: u8) -> bool {
        self.units[unit as usize].frame == self.display + 1
    }

    /// Pairs that `unit`, which is entering, is to test before it arrives (`Spatial`): with itself and with
    /// units that have arrived.
    pub(crate) fn due<'s>(&'s self, config: &'s Config, unit: u8) -> impl Iterator<Item = u8> + 's {
        let here = move |end| end == unit || self.arrived >> end & 1 == 1;
        let frame = self.units[unit as usize].frame;
        indices(config.pairs_of(unit))
            .map(|pair| pair as u8)
            .filter(move |&pair| self.tests[pair as usize] == frame && config.ends(pair).all(here))
    }

    /// Invariant 5: nobody else has a unit that is updated.
    pub fn access(&self, config: &Config) -> bool {
        let writes = |worker: &Worker| match worker.at {
            At::Updating(unit) => 1_u64 << unit,
            _ => 0,
        };
        let ends = |pair| config.ends(pair).fold(0_u64, |bits, end| bits | 1 << end);
        let reads = |worker: &Worker| match worker.at {
            At::Entering(unit) => {
                self.due(config, unit).fold(1 << unit, |bits, pair| bits | ends(pair))
            }
            At::Arriving(_, left) if self.arrived >> left.trailing_zeros() & 1 == 1 => {
                ends(left.trailing_zeros() as u8)
            }
            At::Interacting(pair) => ends(pair),
            At::Rendering(unit) => 1 << unit,
            _ => 0,
        };
        let mut written = 0;
        for worker in &self.workers {
            let mine = writes(worker);
            if written & mine != 0 {
                return false;
            }
            written |= mine;
        }
        self.workers.iter().all(|worker| reads(worker) & written == 0)
    }

    /// No queued rendering waits for a callback, which may take long, while somebody sleeps, unless for one that renders
    /// or swaps.
    pub fn wakes_for_rendering(&self, config: &Config) -> bool {
        let sleeps = |worker: &Worker| worker.at == At::Asleep;
        let comes =
            |worker: &Worker| worker.is_present() && !sleeps(worker) && !worker.is_at_other_work();
        let waits = config.shared && self.rendering_is_visible();
        !waits || !self.workers.iter().any(sleeps) || self.workers.iter().any(comes)
    }

    /// Whoever is in a swap, which may take long, carries nothing, and has called for what it queued.
    pub fn swaps_empty_handed(&self) -> bool {
        let has_nothing = |worker: &Worker| {
            worker.carried.is_empty() && (worker.queued, worker.renders) == (0, 0)
        };
        self.workers.iter().all(|worker| worker.at != At::Swapping || has_nothing(worker))
    }

    /// Invariant 6: no more tokens than there are.
    pub fn tokens(&self, config: &Config) -> bool {
        let held = self.workers.iter().filter(|worker| worker.holds).count();
        held + self.tokens as usize <= config.tokens as usize
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { queue, opened, gate, renders, display, tokens, .. } = self;
        writeln!(f, "    queued {queue:?}; frame {display} is on display, {renders} to render;")?;
        writeln!(f, "    {gate} before the gate; {tokens} tokens lie about; opened {opened:b}")?;
        for (number, unit) in self.units.iter().enumerate() {
            let Unit { frame, pending, rendered } = unit;
            writeln!(
                f,
                "    unit {number}: next update is frame {frame}'s, waits for {pending}; \
                 rendered {rendered} times"
            )?;
        }
        for (number, worker) in self.workers.iter().enumerate() {
            let Worker { at, carried, .. } = worker;
            let token = if worker.holds { " with a token" } else { "" };
            writeln!(f, "    worker {number}{token}: {at:?}, carries {carried:?}")?;
        }
        Ok(())
    }
}
