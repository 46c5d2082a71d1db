//! What the models switch on and count in this very source. Compiled under loom only.
//!
//! Everything here is local to the operating-system thread that runs a model (loom runs all threads
//! of a model on one), so that models may run side by side.

use ::core::sync::atomic::Ordering;
use std::cell::Cell;

use crate::sync::Site;

std::thread_local! {
    static WEAKENED: Cell<Option<(&'static str, Ordering)>> = const { Cell::new(None) };
    static SEEDED: Cell<Option<Fault>> = const { Cell::new(None) };
    /// Whether any thread of the model at hand counts.
    static METERED: Cell<bool> = const { Cell::new(false) };
}

/// Runs everything from now on with `site` at `order`; `None` restores the code as shipped.
pub fn weaken(mutant: Option<(Site, Ordering)>) {
    WEAKENED.set(mutant.map(|(site, order)| (site.name, order)));
}

/// The order that an access at `site` is made with. Each access asks once, and is counted.
pub(crate) fn effective(site: Site) -> Ordering {
    count(|cost| cost.accesses += 1);
    match WEAKENED.get() {
        Some((name, order)) if name == site.name => order,
        _ => site.order,
    }
}

macro_rules! faults {
    ($($(#[doc = $what:literal])* $name:ident;)*) => {
        /// A protocol bug that a model can be run with.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Fault {
            $($(#[doc = $what])* $name,)*
        }

        impl Fault {
            /// All faults, for the runner of protocol mutants.
            pub const ALL: &[Self] = &[$(Self::$name),*];

            /// What is wrong.
            pub fn what(self) -> &'static str {
                match self {
                    $(Self::$name => concat!($($what),*),)*
                }
            }
        }
    };
}

faults! {
    /// Trap 1: an update waits for its own unit's tests only, while others still read it.
    UpdatesAfterOwnTests;
    /// Trap 2: an update does not wait for the unit's rendering in the frame before.
    RenderingNotAwaited;
    /// Trap 2: a unit's countdown is armed, and its candidates emptied, after the unit was passed on.
    PendingArmedLate;
    /// Trap 3: a unit is rendered before the frame before is swapped.
    RenderedBeforeSwap;
    /// Whoever swaps keeps what it carries, and calls for what it queued afterwards.
    SwapsWithWork;
    /// Trap 4: an interaction may end before it is counted.
    CountedAfterEmitted;
    /// Trap 4: an interaction is counted at one end only.
    CountedAtOneEnd;
    /// Trap 5: a frame's pools are emptied a frame too early.
    PoolsResetEarly;
    /// Trap 6: a push takes its place first and fills it later.
    TicketPush;
    /// Trap 7: announcements are batched by threes, and a worker goes idle with some unsent.
    BatchNotFlushed;
    /// Trap 8: a holder does what it carries before it renders what waits.
    CarriedBeforeRendering;
    /// Lost wake-up: a sleeper notes the bell's epoch after it has looked for work.
    EpochNotedLate;
    /// Lost wake-up: a worker leaves with a call that it was woken by.
    CallNotPassedOn;
    /// Lost wake-up: whoever swaps the last frame does not say so.
    EndNotAnnounced;
    /// A call to render wakes workers that cannot.
    RenderingCallsAnyone;
    /// Another pipeline's token is taken for one's own.
    ForeignToken;
    /// A token is issued although another host just took the last one.
    DoubledToken;
    /// A unit is rendered in the frame that was on display when its holder last looked.
    TagNotChecked;
    /// A worker leaves with what it carries.
    LeavesWithCarry;
    /// A worker leaves with the shared renderer.
    LeavesWithRenderer;
    /// A worker sleeps with the shared renderer.
    SleepsWithRenderer;
    /// A worker sleeps with a rendering that it keeps until the shared renderer is free.
    SleepsWithRendering;
    /// A worker goes to another home with a rendering that it keeps.
    TakesRenderingElsewhere;
    /// Lost wake-up: who puts the shared renderer back does not look whether a rendering was queued meanwhile.
    NotLookedAgain;
    /// Lost wake-up: who took the shared renderer, and finds that others have rendered all, goes on to other work with
    /// it.
    GoesOnWithRenderer;
    /// Lost wake-up: who queues a rendering, or leaves one behind, calls holders, where anyone could do it.
    RenderingCallsHolders;
    /// Whoever comes for a unit of the open frame updates it, whatever else it waits for.
    UpdatesWhenOpened;
    /// The gate is armed again after the frame's updates were let go.
    GateArmedLate;
    /// The countdown of renderings is armed again after the next frame is on display.
    RendersArmedLate;
    /// A modelled interaction is tested by both its arrivers.
    TestedTwice;
    /// An arrival that lost its race counts as made.
    ArrivalNotRetried;
    /// A pop that lost its race hands its index out all the same.
    PopNotRetried;
    /// A refused claim takes back what it added to the counter.
    RefusedClaimTakenBack;
    /// A letter that lost its race counts as posted.
    LetterNotRetried;
    /// A letter is processed in the frame it was posted in.
    LetterEarly;
    /// The writer of a latest-value cell takes a slot that somebody reads.
    SlotReusedEarly;
}

/// Runs everything from now on with `fault`; `None` restores the code as shipped.
pub fn seed(fault: Option<Fault>) {
    SEEDED.set(fault);
}

pub(crate) fn is_seeded(fault: Fault) -> bool {
    SEEDED.get() == Some(fault)
}

/// What a piece of code cost in the thread that ran it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Atomic accesses and fences.
    pub accesses: u32,
    /// Times that a loop went round again because another thread had changed the word meanwhile.
    pub retries: u32,
}

loom::thread_local! {
    static COST: Cell<Option<Cost>> = Cell::new(None);
}

/// Starts counting in this thread of a model, or stops, and says what was counted since the start.
pub fn meter(on: bool) -> Option<Cost> {
    METERED.set(METERED.get() || on);
    COST.with(|cost| cost.replace(on.then(Cost::default)))
}

fn count(add: impl FnOnce(&mut Cost)) {
    if !METERED.get() {
        return;
    }
    // Memory that a model lends is given back when its threads have ended.
    let _ended = COST.try_with(|cell| {
        if let Some(mut cost) = cell.get() {
            add(&mut cost);
            cell.set(Some(cost));
        }
    });
}

/// Another thread won the race for a word.
pub(crate) fn retried() {
    count(|cost| cost.retries += 1);
}
