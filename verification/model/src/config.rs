//! What is modelled: sizes, ways of running, and bugs to be found.

use crate::work::{MOST_PAIRS, MOST_UNITS};

/// Which pairs are tested, and by whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BroadPhase {
    /// Whoever enters is tested against those that entered before.
    Spatial,
    /// Each pair is tested by the second of its ends that enters.
    Pairwise,
}

/// When a unit enters its next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// When it is updated.
    AfterUpdate,
    /// When it is rendered.
    AfterRender,
    /// When its frame is swapped.
    AfterSwap,
}

/// A way to get the protocol wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bug {
    /// An update passes its unit on, and only then arms the unit's countdown.
    ArmedAfterPublishing,
    /// Update(f + 1) does not wait for Render(f).
    RenderNotCounted,
    /// A unit lets the candidates that it found go, leaves the gate, and only then counts them.
    CountedAfterGate,
    /// A unit leaves the gate when it arrives, and only then counts the candidates that it found and lets them go.
    OpenedByLastArriver,
    /// A unit's update does not wait for the others' entries.
    NoGate,
    /// A frame's arrivals still count when the next one's first units enter.
    ArrivalsKept,
    /// The gate is armed again after the frame was opened, not before.
    GateArmedLate,
    /// The last but one swaps.
    SwapByLastButOne,
    /// The next frame is put on display before this one is swapped.
    DisplayedBeforeSwap,
    /// Whoever swaps keeps what it carries, and calls for what it queued afterwards.
    SwapsWithWork,
    /// Whatever is queued for rendering is rendered, of whatever frame it is.
    RenderedAhead,
    /// A queue hands out a rendering and keeps it.
    QueueKeeps,
    /// A call to render rings the bell of those that cannot.
    WrongBell,
    /// A sleeper does not look for work between announcing itself and sleeping.
    NoSecondLook,
    /// A worker that leaves takes what it carries along.
    LeaverDropsCarried,
    /// A worker that leaves does not pass on the call that woke it.
    LeaverSwallowsCall,
    /// A token that is given away stays.
    TokenDoubled,
    /// A worker sleeps with renderings that it keeps until the shared renderer is free.
    SleepsWithRendering,
    /// Whoever comes for a unit of the open frame updates it, whatever else it waits for.
    UpdatedWhenOpened,
    /// Whoever puts the shared renderer back does not look for renderings once more.
    NotLookedAgain,
    /// Whoever took the shared renderer, and finds that all is rendered, goes on to other work with it.
    GoesOnWithRenderer,
    /// A worker that leaves takes the shared renderer along.
    LeavesWithRenderer,
    /// A call to render rings the holders' bell, though the renderer is shared and nobody holds a token.
    RenderingCallsHolders,
}

/// A model.
#[derive(Clone, Debug)]
pub struct Config {
    /// Units, at most [`MOST_UNITS`].
    pub units: u8,
    /// Frames.
    pub frames: u8,
    /// The pairs that are tested, each end below `units`; `[a, a]` is a unit with itself.
    pub pairs: Vec<[u8; 2]>,
    /// Whether a test may also find that a pair is no candidate.
    pub may_miss: bool,
    /// Units that bypass the broad phase, a bit each.
    pub solitary: u8,
    /// Kind of broad phase.
    pub broad_phase: BroadPhase,
    /// Overlap of frames.
    pub entry: Entry,
    /// Workers, the late ones among them.
    pub workers: u8,
    /// Workers that join at any time, or never.
    pub late: u8,
    /// How many workers may leave.
    pub departures: u8,
    /// Tokens; the first workers hold them, and those that are left over lie about.
    pub tokens: u8,
    /// How often a token may be given away.
    pub handovers: u8,
    /// Whether the one token is the renderer that is left to all workers: they take it, and put it back,
    /// themselves.
    pub shared: bool,
    /// Whether a worker may keep what it sets free, and idle ones sleep until they are woken. Without,
    /// everything is queued, and whoever is idle looks again and again.
    pub sleep: bool,
    /// What is wrong.
    pub bug: Option<Bug>,
}

impl Config {
    /// `workers` that stay, one token, and nothing wrong.
    ///
    /// # Panics
    /// If there are more units or pairs than a model may have.
    pub fn new(workers: u8, units: u8, pairs: &[[u8; 2]], frames: u8) -> Self {
        assert!(units as usize <= MOST_UNITS && pairs.len() <= MOST_PAIRS);
        Self {
            units,
            frames,
            pairs: pairs.to_vec(),
            may_miss: false,
            solitary: 0,
            broad_phase: BroadPhase::Spatial,
            entry: Entry::AfterUpdate,
            workers,
            late: 0,
            departures: 0,
            tokens: 1,
            handovers: 0,
            shared: false,
            sleep: false,
            bug: None,
        }
    }

    pub(crate) fn has(&self, bug: Bug) -> bool {
        self.bug == Some(bug)
    }

    /// Whether holders alone are called for renderings.
    pub(crate) fn renderings_call_holders(&self) -> bool {
        !self.shared || self.has(Bug::RenderingCallsHolders)
    }

    /// Whether `unit` bypasses the broad phase: under modelled interactions whoever has none does.
    pub(crate) fn bypasses(&self, unit: u8) -> bool {
        match self.broad_phase {
            BroadPhase::Spatial => self.solitary >> unit & 1 == 1,
            BroadPhase::Pairwise => self.pairs_of(unit) == 0,
        }
    }

    /// The pairs that `unit` is an end of, a bit each.
    pub(crate) fn pairs_of(&self, unit: u8) -> u64 {
        let pairs = self.pairs.iter().enumerate();
        pairs.filter(|(_, ends)| ends.contains(&unit)).fold(0, |bits, (pair, _)| bits | 1 << pair)
    }

    /// The distinct ends of a pair.
    pub(crate) fn ends(&self, pair: u8) -> impl Iterator<Item = u8> + use<> {
        let [a, b] = self.pairs[pair as usize];
        [Some(a), (a != b).then_some(b)].into_iter().flatten()
    }
}
