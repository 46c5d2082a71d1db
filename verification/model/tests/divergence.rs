//! The replay is able to refuse: real traces with one thing changed, wherever it can be changed, are
//! no longer the model's.

use dualframe_core as dut;

mod os;
mod record;

use dualframe_protocol::config::Config;
use dualframe_protocol::replay::replay;
use dualframe_protocol::trace::{Event, Seen, Task};
use dut::frame::Entry;
use dut::pipeline::BroadPhase;
use record::{Park, Renderer, Setup, judge, run};

/// Four units of which most pairs are near, three frames, three workers.
fn real(broad_phase: BroadPhase, entry: Entry, renderer: Renderer) -> (Config, Vec<Seen>) {
    let (seed, near_percent, solitary) = (5, 60, 0);
    let (units, frames) = (4, 3);
    let setup = Setup {
        units,
        frames,
        broad_phase,
        entry,
        renderer,
        homes: 2,
        seed,
        near_percent,
        solitary,
    };
    let (record, values) = run(&setup, 3, Park::default());
    judge(&setup, &record, &values);
    replay(&setup.model(), &record).expect("unchanged, it is the model's");
    (setup.model(), record)
}

/// Whether an event is a step of the protocol, rather than of the host.
fn is_step(event: Event) -> bool {
    !matches!(event, Event::Join | Event::Leave | Event::Hold | Event::Release)
}

/// Asserts that every change of real traces is refused; `change` makes one at a step, if it can.
fn refused(name: &str, change: impl Fn(&mut Vec<Seen>, usize) -> Option<()>) {
    let mut changes = 0;
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        let entries = [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap];
        let renderers = [Renderer::Tokens(1), Renderer::Shared];
        let ways =
            entries.into_iter().flat_map(|entry| renderers.map(|renderer| (entry, renderer)));
        for (entry, renderer) in ways {
            let (config, record) = real(broad_phase, entry, renderer);
            for at in 0..record.len() {
                let mut changed = record.clone();
                if !is_step(record[at].event) || change(&mut changed, at).is_none() {
                    continue;
                }
                let Err(refusal) = replay(&config, &changed) else {
                    panic!("{name} at step {at}, {:?}: not refused", record[at]);
                };
                if changes == 50 {
                    println!("{name} at step {at}, {:?}:\n{refusal}", record[at]);
                }
                changes += 1;
            }
        }
    }
    println!("{name}: {changes} changes, all refused");
    assert!(changes > 50, "next to nothing was changed");
}

#[test]
fn a_dropped_step() {
    refused("dropped", |record, at| {
        record.remove(at);
        Some(())
    });
}

#[test]
fn a_doubled_step() {
    refused("doubled", |record, at| {
        record.insert(at, record[at]);
        Some(())
    });
}

#[test]
fn a_step_of_another_worker() {
    refused("another worker's", |record, at| {
        // Of two units that enter at once, either may be the later one, and test.
        if matches!(record[at].event, Event::Test(..)) {
            return None;
        }
        record[at].worker = (record[at].worker + 1) % 3;
        Some(())
    });
}

#[test]
fn a_step_of_a_wrong_frame() {
    refused("a frame later", |record, at| {
        match &mut record[at].event {
            Event::Begin(_, frame) | Event::Call(_, frame) | Event::Swap(frame) => *frame += 1,
            _ => return None,
        }
        Some(())
    });
}

#[test]
fn another_outcome_of_a_test() {
    refused("another outcome", |record, at| match &mut record[at].event {
        Event::Test(_, near) => {
            *near = !*near;
            Some(())
        }
        _ => None,
    });
}

/// Two tests of one entry may come in any order; nothing else that one worker does may.
#[test]
fn a_step_swapped_with_the_workers_next() {
    refused("swapped with the next", |record, at| {
        let mine = |seen: &Seen| seen.worker == record[at].worker;
        let next = at + 1 + record[at + 1..].iter().position(mine)?;
        let both_tests = [at, next].iter().all(|&at| matches!(record[at].event, Event::Test(..)));
        if both_tests || !is_step(record[next].event) {
            return None;
        }
        record.swap(at, next);
        Some(())
    });
}

/// An update that comes before its unit has entered the frame.
#[test]
fn an_update_before_its_entry() {
    refused("before its entry", |record, at| {
        let Event::Begin(Task::Update(unit), frame) = record[at].event else { return None };
        let entry = |seen: &Seen| seen.event == Event::Begin(Task::Enter(unit), frame);
        let entered = record.iter().position(entry)?;
        // Its beginning, its callback and its end, made by whoever entered the unit.
        let updater = record[at].worker;
        for step in 0..3 {
            let mine = record[at..].iter().position(|seen| seen.worker == updater)?;
            let seen = record.remove(at + mine);
            record.insert(entered + step, Seen { worker: record[entered].worker, ..seen });
        }
        Some(())
    });
}

/// A run that ends early is not a run.
#[test]
fn a_run_cut_short() {
    refused("cut short", |record, at| {
        record.truncate(at);
        Some(())
    });
}

/// A rendering that begins before another worker's has ended: a shared renderer is one worker's at a time.
#[test]
fn a_rendering_beside_another() {
    let step = |worker, event| Seen { worker, event };
    let whole = |worker, task| {
        let events = [Event::Begin(task, 0), Event::Call(task, 0), Event::End];
        events.map(|event| step(worker, event)).to_vec()
    };
    let enter = |unit| [Event::Begin(Task::Enter(unit), 0), Event::End].map(|event| step(0, event));
    let config = Config { shared: true, ..Config::new(1, 2, &[], 1) };
    let [first, second] = [whole(0, Task::Render(0)), whole(1, Task::Render(1))];
    let swap = step(1, Event::Swap(0));
    let start = [
        vec![step(0, Event::Join), step(1, Event::Join)],
        [enter(0), enter(1)].concat(),
        whole(0, Task::Update(0)),
        whole(1, Task::Update(1)),
    ];
    let apart = [start.concat(), first.clone(), second[..2].to_vec(), vec![swap, second[2]]];
    replay(&config, &apart.concat()).expect("one after the other");
    let (rendered, ended) = first.split_at(2);
    let beside = [start.concat(), rendered.to_vec(), second[..1].to_vec(), ended.to_vec()];
    let refusal = replay(&config, &beside.concat()).expect_err("they overlap");
    assert_eq!(refusal.seen, Some(second[0]));
}
