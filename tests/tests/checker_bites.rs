//! Every rule of the checker can fail: a sound trace passes, and each way of breaking it is
//! noticed under the rule's own name.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;

use dualframe_core::frame::Entry;
use dualframe_tests::checker::{Expected, Rule, check};
use dualframe_tests::trace::{Act, Record};

const UNITS: u32 = 3;
const FRAMES: u32 = 4;

fn expected() -> Expected {
    // Units 0 and 1 meet; unit 2 is solitary.
    Expected {
        units: UNITS,
        frames: FRAMES,
        asked_within: true,
        tests: BTreeMap::from([([0, 1], 1)]),
        solitary: vec![false, false, true],
        entry: Entry::AfterUpdate,
        tokens: 1,
    }
}

/// What one thread would leave behind, frame by frame; unit 0 posts two letters to unit 1 in
/// each.
fn sound() -> Vec<Record> {
    let mut acts = vec![];
    for frame in 0..FRAMES {
        for unit in 0..2 {
            acts.push(Act::Within { unit, seen: frame, accepted: unit == 1 });
        }
        acts.push(Act::Test { ends: [1, 0], seen: [frame; 2], accepted: true });
        acts.push(Act::Interact { id: 0, ends: [0, 1], frame, seen: [frame; 2] });
        acts.push(Act::Interact { id: 1, ends: [1, 1], frame, seen: [frame; 2] });
        for unit in 0..UNITS {
            let letters = (0..2).map(|k| (0, k));
            if unit == 0 {
                acts.extend(letters.map(|rank| Act::Post { to: 1, due: frame + 1, rank }));
            } else if unit == 1 && frame > 0 {
                acts.extend(letters.map(|rank| Act::Read { unit, frame, rank }));
            }
            acts.push(Act::Update { unit, frame, seen: frame, refused: false });
        }
        for unit in 0..UNITS {
            acts.push(Act::Render { unit, frame, seen: frame + 1, token: 0 });
        }
        acts.push(Act::Swap { frame, token: 0 });
    }
    let record = |(tick, act)| {
        let begin = 10 * tick as u64;
        Record { begin, end: begin + 5, thread: 0, act }
    };
    acts.into_iter().enumerate().map(record).collect()
}

fn rules(expected: &Expected, mut records: Vec<Record>) -> Vec<Rule> {
    records.sort_by_key(|record| record.begin);
    let mut rules: Vec<_> = check(expected, &records).iter().map(|broken| broken.rule).collect();
    rules.sort_unstable();
    rules.dedup();
    rules
}

fn find(records: &[Record], what: impl Fn(&Act) -> bool) -> usize {
    records.iter().position(|record| what(&record.act)).expect("an act of this kind")
}

fn update(unit: u32, frame: u32) -> impl Fn(&Act) -> bool {
    move |act| matches!(*act, Act::Update { unit: u, frame: f, .. } if (u, f) == (unit, frame))
}

fn render(unit: u32, frame: u32) -> impl Fn(&Act) -> bool {
    move |act| matches!(*act, Act::Render { unit: u, frame: f, .. } if (u, f) == (unit, frame))
}

fn swap(frame: u32) -> impl Fn(&Act) -> bool {
    move |act| matches!(*act, Act::Swap { frame: f, .. } if f == frame)
}

fn test(frame: u32) -> impl Fn(&Act) -> bool {
    move |act| matches!(*act, Act::Test { seen, .. } if seen[0] == frame)
}

fn interact(id: u32, frame: u32) -> impl Fn(&Act) -> bool {
    move |act| matches!(*act, Act::Interact { id: i, frame: f, .. } if (i, f) == (id, frame))
}

fn read(sequence: u32, frame: u32) -> impl Fn(&Act) -> bool {
    move |act| matches!(*act, Act::Read { frame: f, rank, .. } if (rank.1, f) == (sequence, frame))
}

/// Leaves one record out.
fn lose(what: impl Fn(&Act) -> bool) -> Vec<Record> {
    let mut records = sound();
    records.remove(find(&records, what));
    records
}

/// Has one record twice, the second time after everything.
fn double(what: impl Fn(&Act) -> bool) -> Vec<Record> {
    let mut records = sound();
    let (at, after) = (find(&records, what), 10 * records.len() as u64);
    records.push(Record { begin: after, end: after + 5, ..records[at] });
    records
}

/// Moves one record to just before another.
fn hasten(what: impl Fn(&Act) -> bool, before: impl Fn(&Act) -> bool) -> Vec<Record> {
    let mut records = sound();
    let (from, to) = (find(&records, what), find(&records, before));
    records[from].begin = records[to].begin - 4;
    records[from].end = records[to].begin - 1;
    records
}

/// Lets one record last until another has begun.
fn stretch(what: impl Fn(&Act) -> bool, into: impl Fn(&Act) -> bool) -> Vec<Record> {
    let mut records = sound();
    let (from, to) = (find(&records, what), find(&records, into));
    records[from].end = records[to].begin + 1;
    records
}

/// Rewrites one act.
fn forge(what: impl Fn(&Act) -> bool, with: impl Fn(&mut Act)) -> Vec<Record> {
    let mut records = sound();
    let at = find(&records, what);
    with(&mut records[at].act);
    records
}

#[track_caller]
fn bites(rule: Rule, records: Vec<Record>) {
    let rules = rules(&expected(), records);
    assert!(rules.contains(&rule), "{rule:?} not noticed, only {rules:?}");
}

#[test]
fn a_sound_trace_passes() {
    assert_eq!(rules(&expected(), sound()), []);
}

#[test]
fn lost_or_doubled_work_is_noticed() {
    bites(Rule::UpdatedOnce, lose(update(1, 2)));
    bites(Rule::UpdatedOnce, double(update(2, 2)));
    bites(Rule::RenderedOnce, lose(render(0, 3)));
    bites(Rule::RenderedOnce, double(render(0, 3)));
    bites(Rule::TestedOnce, lose(test(1)));
    bites(Rule::TestedOnce, double(test(1)));
    bites(Rule::TestedOnce, lose(|act| matches!(act, Act::Within { seen: 2, .. })));
    bites(Rule::InteractedOnce, lose(interact(0, 1)));
    bites(Rule::InteractedOnce, double(interact(1, 3)));
    bites(Rule::SwappedOnce, lose(swap(2)));
    bites(Rule::SwappedOnce, double(swap(3)));
}

#[test]
fn work_that_was_not_due_is_noticed() {
    // A solitary unit tested; a pair that was not accepted interacting.
    let solitary = |act: &mut Act| *act = Act::Test { ends: [2, 0], seen: [1; 2], accepted: true };
    bites(Rule::TestedOnce, forge(test(1), solitary));
    let refused = |act: &mut Act| *act = Act::Test { ends: [0, 1], seen: [1; 2], accepted: false };
    bites(Rule::InteractedOnce, forge(test(1), refused));
}

#[test]
fn detection_out_of_turn_is_noticed() {
    bites(Rule::DetectionOrder, hasten(test(2), update(1, 1)));
    bites(Rule::DetectionOrder, hasten(interact(0, 2), test(2)));
    bites(Rule::DetectionOrder, hasten(update(0, 2), interact(0, 2)));
    bites(Rule::DetectionOrder, hasten(update(0, 2), interact(0, 1)));
}

#[test]
fn rendering_and_swaps_out_of_turn_are_noticed() {
    bites(Rule::RenderOrder, hasten(render(2, 1), update(2, 1)));
    bites(Rule::RenderOrder, hasten(update(2, 2), render(2, 1)));
    bites(Rule::SwapOrder, hasten(swap(1), render(2, 1)));
    bites(Rule::SwapOrder, hasten(render(0, 2), swap(1)));
    bites(Rule::SwapOrder, hasten(swap(2), swap(1)));
}

#[test]
fn a_third_frame_in_flight_is_noticed() {
    bites(Rule::TwoFrames, hasten(update(2, 2), swap(0)));
    bites(Rule::TwoFrames, stretch(swap(0), update(0, 2)));
}

#[test]
fn entering_early_is_noticed() {
    // Sound, if frames may overlap as far as they can.
    let early = hasten(test(1), render(0, 0));
    assert_eq!(rules(&expected(), early.clone()), []);
    for entry in [Entry::AfterRender, Entry::AfterSwap] {
        let expected = Expected { entry, ..expected() };
        assert_eq!(rules(&expected, early.clone()), [Rule::Entry]);
    }
    let between = hasten(test(1), swap(0));
    let after_render = Expected { entry: Entry::AfterRender, ..expected() };
    assert_eq!(rules(&after_render, between.clone()), []);
    let after_swap = Expected { entry: Entry::AfterSwap, ..expected() };
    assert_eq!(rules(&after_swap, between), [Rule::Entry]);
}

#[test]
fn shared_access_to_what_is_written_is_noticed() {
    bites(Rule::Exclusive, stretch(update(0, 1), render(0, 1)));
    bites(Rule::Exclusive, stretch(interact(0, 1), update(0, 1)));
    bites(Rule::Exclusive, stretch(render(1, 1), update(1, 2)));
    let same_memory = |act: &mut Act| {
        *act = Act::Interact { id: 0, ends: [1, 1], frame: 1, seen: [1; 2] };
    };
    let mut records = forge(interact(1, 1), same_memory);
    let at = find(&records, interact(0, 1));
    records[at].end += 6;
    bites(Rule::Exclusive, records);
}

#[test]
fn rendering_without_the_token_is_noticed() {
    bites(Rule::Tokens, stretch(render(0, 1), render(1, 1)));
    // With two tokens, two at once are right, unless both are the same one, or they are three.
    let two = Expected { tokens: 2, ..expected() };
    assert_eq!(rules(&two, stretch(render(0, 1), render(1, 1))), [Rule::Tokens]);
    let others = |records: &mut Vec<Record>| {
        for unit in 0..UNITS {
            let at = find(records, render(unit, 1));
            records[at].act = Act::Render { unit, frame: 1, seen: 2, token: unit };
        }
    };
    let mut records = stretch(render(0, 1), render(1, 1));
    others(&mut records);
    assert_eq!(rules(&two, records), []);
    let mut records = stretch(render(0, 1), render(2, 1));
    others(&mut records);
    let at = find(&records, render(1, 1));
    records[at].end = records[find(&records, render(2, 1))].begin + 1;
    assert_eq!(rules(&two, records), [Rule::Tokens]);
}

#[test]
fn an_object_of_another_frame_is_noticed() {
    let stale = |act: &mut Act| {
        let Act::Render { seen, .. } = act else { unreachable!() };
        *seen += 1;
    };
    bites(Rule::Stale, forge(render(0, 1), stale));
    let stale = |act: &mut Act| {
        let Act::Test { seen, .. } = act else { unreachable!() };
        seen[1] += 1;
    };
    bites(Rule::Stale, forge(test(1), stale));
    let beyond = |act: &mut Act| *act = Act::Swap { frame: FRAMES, token: 0 };
    bites(Rule::Stale, forge(swap(3), beyond));
}

#[test]
fn letters_lost_doubled_astray_or_shuffled_are_noticed() {
    bites(Rule::LetterLost, lose(read(1, 2)));
    bites(Rule::LetterDoubled, double(read(1, 2)));
    let later = |act: &mut Act| *act = Act::Read { unit: 1, frame: 3, rank: (0, 7) };
    bites(Rule::LetterAstray, forge(read(1, 3), later));
    let posted = |act: &Act| matches!(act, Act::Post { due: 2, .. });
    bites(Rule::LetterAstray, hasten(read(0, 2), posted));
    bites(Rule::LetterOrder, hasten(read(1, 2), read(0, 2)));
    // An update that refuses its inputs loses its letters rightly.
    let mut records = lose(read(1, 2));
    records.remove(find(&records, read(0, 2)));
    let at = find(&records, update(1, 2));
    records[at].act = Act::Update { unit: 1, frame: 2, seen: 2, refused: true };
    assert_eq!(rules(&expected(), records), []);
}
