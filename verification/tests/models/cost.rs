//! What one step may cost: the table of PROTOCOL.md §8, asserted of every step of every model.

use super::ve::{HOMES, Setup, build, step_alone, verify};
use super::{Guarded, Model, check, lend};
use dualframe_core_model::frame::Entry;
use dualframe_core_model::instrument::{Cost, meter};
use dualframe_core_model::pipeline::BroadPhase;
use dualframe_core_model::stage::Stage;
use dualframe_core_model::worker::Step;
use std::cell::Cell;

/// What a step did, as its callbacks saw it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Did {
    /// The last callback's stage; the broad phase if there was none.
    pub(crate) stage: Stage,
    /// Bounding volumes tested.
    pub(crate) tests: u32,
    /// Pairs that may interact.
    pub(crate) found: u32,
    /// Pushes of contacts.
    pub(crate) pushes: u32,
    /// The updated unit's interactions, read once.
    pub(crate) candidates: u32,
    /// Letters posted.
    pub(crate) posts: u32,
    /// Whether a frame was swapped.
    pub(crate) swaps: bool,
}

const NOTHING: Did = Did {
    stage: Stage::BroadPhase,
    tests: 0,
    found: 0,
    pushes: 0,
    candidates: 0,
    posts: 0,
    swaps: false,
};

loom::thread_local! {
    static DID: Cell<Did> = Cell::new(NOTHING);
}

thread_local! {
    /// What the bounds are multiplied by, in percent: to see them fail.
    static SHARE: Cell<u32> = const { Cell::new(100) };
    /// The largest share of its bound that a step of each stage came to, in percent.
    static REACHED: Cell<[u32; 4]> = const { Cell::new([0; 4]) };
}

/// Makes every bound smaller from now on: so many percent of what the table says.
pub(crate) fn tighten(percent: u32) {
    SHARE.set(percent);
}

/// A callback notes what it did.
pub(crate) fn note(add: impl FnOnce(&mut Did)) {
    DID.with(|cell| {
        let mut did = cell.get();
        add(&mut did);
        cell.set(did);
    });
}

/// Work units that a worker carries at most, under loom: an interaction, a rendering that it keeps, and one that is
/// neither.
const CARRIED: u32 = 3;
/// Letters under way at most, in any model.
const LETTERS: u32 = 2;

/// A push onto a ring that nobody disputes.
const PUSH: u32 = 4;
/// A pop that nobody disputes, or that finds the ring empty.
const POP: u32 = 3;
/// Passing a work unit on: whose it is, whether somebody is hungry, its frame, the push.
const EMIT: u32 = 3 + PUSH;
/// One fence, two bells.
const ANNOUNCE: u32 = 5;
/// Looks at all queues and an offer, and pops from the one chosen; a rendering of another frame goes back.
const LOOK: u32 = 10 + (2 + POP + 1 + PUSH);
/// Coming for a unit of an open frame.
const COME: u32 = 4;
/// Rendering is looked for first, then anything at home and elsewhere, and at most four times at each home
/// what was seen may be gone; so may its units be that are to be come for. One at home may be passed on.
fn find(units: u32) -> u32 {
    13 + 4 * (HOMES as u32 * LOOK + units * COME) + EMIT
}
/// A shared renderer is put back, and a rendering looked for behind a fence.
const PUT_BACK: u32 = 1 + 1 + 3;
/// It is taken if a rendering is seen; or put back if none is, and taken again if one is seen all the same. It is put
/// back where others have rendered what was seen.
const SHARE_RENDERER: u32 = 3 + PUT_BACK + 2 + PUT_BACK;
/// Looks at all queues of a home, whose units all wait for more, and once again when they have been come for.
const LOOK_IN_VAIN: u32 = 22;
/// Where nobody takes away what was seen, and something is found: a rendering without coming for units.
fn find_alone(units: u32, stage: Stage) -> u32 {
    let comes = if stage == Stage::Render { 0 } else { units * COME + EMIT };
    3 + (HOMES as u32 - 1) * 10 + LOOK + comes
}
/// Once round a loop whose word another thread changed.
const RETRY: u32 = 4;

/// Sorting a list of `n` by merges: a pass for each doubling and one to see that it is sorted; `each`
/// accesses for an element in a pass.
fn sort(n: u32, each: u32) -> u32 {
    (n * each + 3) * (1 + n.next_power_of_two().ilog2())
}

/// The most that a step may cost that did `did` in a pipeline of `units`, retries apart.
///
/// Each unit has a modelled interaction with each other. `opens`: whether it opens a frame, where nobody interferes; `None` where others do, and it may.
fn bound(units: u32, did: Did, opens: Option<bool>) -> u32 {
    let find =
        if opens.is_some() { find_alone(units, did.stage) } else { SHARE_RENDERER + find(units) };
    let let_go = CARRIED * (1 + PUSH) + ANNOUNCE;
    let share = 2 + let_go;
    let gate = |opens| if opens { 8 + HOMES as u32 } else { 2 };
    // A solitary unit leaves the gate where others are passed on; there is none where one is alone.
    let pass_on = EMIT + if opens.is_none() { gate(true) } else { 0 };
    let work = match did.stage {
        Stage::BroadPhase => {
            4 + 4 * (units - 1)
                + 3 * did.tests
                + did.found * (17 + EMIT)
                + gate(opens != Some(false))
        }
        Stage::Interaction => 4 + 3 * did.pushes + 2 * (1 + EMIT),
        Stage::Update => {
            let candidates = sort(did.candidates, 13) + 6 * did.candidates;
            let letters = 2 + LETTERS * (5 + 3 + PUSH) + sort(LETTERS, 7);
            // Two to take a shared renderer.
            let renderer = if opens.is_some() { 0 } else { 2 };
            6 + renderer + candidates + letters + did.posts * (6 + POP) + EMIT + pass_on
        }
        // What is carried is queued ahead of a swap; under `Entry::AfterSwap` every unit is passed on behind it.
        Stage::Render => {
            let swap = if did.swaps { let_go + units * EMIT } else { 0 };
            5 + (1 + EMIT) + swap + pass_on
        }
    };
    find + share + 3 + work + ANNOUNCE
}

/// Runs `step` and asserts that it cost no more than the table says.
pub(crate) fn metered<R>(units: u32, opens: Option<bool>, step: impl FnOnce() -> R) -> R {
    DID.with(|did| did.set(NOTHING));
    meter(true);
    let result = step();
    let Cost { accesses, retries } = meter(false).expect("it was started");
    let did = DID.with(Cell::get);
    assert!(opens.is_none() || retries == 0, "nobody interferes: {did:?}");
    let most = (bound(units, did, opens) + RETRY * retries) * SHARE.get() / 100;
    assert!(accesses <= most, "a step of {accesses} accesses, {most} are allowed: {did:?}");
    let mut reached = REACHED.get();
    let highest = &mut reached[did.stage as usize];
    *highest = (*highest).max(100 * accesses / most);
    REACHED.set(reached);
    result
}

/// A worker alone, in pipelines of every kind, of one to six units near each other or 4 to 24 far from
/// each other: no retries, and no step costs more than the table says, which is at most four times too much.
fn alone() {
    REACHED.set([0; 4]);
    check("cost::alone", None, 72, [()], |order| {
        let entry = [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap][order % 3];
        let broad_phase = [BroadPhase::Spatial, BroadPhase::Pairwise][order / 3 % 2];
        // Tests are cheap: it takes many to see what they cost.
        let (letters, far) = (true, order / 36 == 1);
        let [units, frames] = if far { [4, 1] } else { [1, 3] };
        let units = units * (1 + order / 6 % 6) as u32;
        let setup = Setup { units, frames, broad_phase, entry, letters, far, ..Setup::default() };
        let (pipeline, world) = build(setup);
        let mut worker = pipeline.worker();
        let Ok(token) = pipeline.token(lend(Guarded::new(0))) else { panic!("a token is left") };
        assert!(worker.hold(token).is_ok());
        let mut entered = 0;
        while !pipeline.finished() {
            let opens = (entered + 1) % units == 0;
            let did = step_alone(&mut worker, world, opens);
            assert_ne!(did, Step::Idle, "nobody else has the work");
            entered += u32::from(did == Step::Worked(Stage::BroadPhase));
        }
        verify(pipeline, world);
    });
    let reached = REACHED.get();
    println!("cost::alone: highest share of the bound, by stage: {reached:?} %");
    assert!(reached.iter().all(|&percent| percent > 25), "bounds that say little: {reached:?} %");
}

/// A worker finds that all units of the open frame wait for an interaction that another one has in hand.
fn in_vain() {
    check("cost::in_vain", None, 2, [()], |order| {
        let setup = Setup { units: 2, frames: 1, ..Setup::default() };
        let (pipeline, world) = build(setup);
        let [mut busy, mut worker] = [0, 1].map(|_| pipeline.worker());
        if order == 1 {
            let Ok(token) = pipeline.token(lend(Guarded::new(0))) else {
                panic!("a token is left")
            };
            assert!(worker.hold(token).is_ok());
        }
        for opens in [false, true] {
            assert_eq!(step_alone(&mut busy, world, opens), Step::Worked(Stage::BroadPhase));
        }
        meter(true);
        let found = worker.step(world);
        let Cost { accesses, retries } = meter(false).expect("it was started");
        assert!(matches!(found, Ok(Step::Idle)) && retries == 0);
        // It counts itself among the hungry.
        let most = 13 + HOMES as u32 * LOOK_IN_VAIN + setup.units * COME + 1;
        assert!(accesses <= most, "a step of {accesses} accesses, {most} are allowed");
        assert!(2 * accesses > most, "a bound that says little: {accesses} of {most}");
    });
}

pub(crate) const ALL: &[Model] = &[("cost::alone", alone), ("cost::in_vain", in_vain)];
