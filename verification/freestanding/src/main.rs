//! The core's whole run-time path in a program that links only if nothing in it can panic or
//! allocate: no standard library, no C library, and a panic handler and an allocator that call
//! what is defined nowhere. It also runs, and its exit status says whether it did what it should.
//!
//! Everything that the core is given is opaque to the optimiser ([`black_box`]): it cannot see that
//! these tables are long enough, only that the core never looks past their ends.
#![no_std]
#![no_main]

mod start;
mod ve;

use core::hint::black_box;

use dualframe_core::contacts::{ContactSlot, SegmentSlot};
use dualframe_core::error::Table;
use dualframe_core::frame::Entry;
use dualframe_core::inbox::{From, LetterSlot};
use dualframe_core::latest::Latest;
use dualframe_core::pipeline::{BroadPhase, Config, Pipeline};
use dualframe_core::probe::NoProbe;
use dualframe_core::ring::{IndexRing, QueueSlot};
use dualframe_core::storage::{InteractionSlot, Memory, Static, UnitSlot, queue_slots};
use dualframe_core::unit::UnitId;
use dualframe_core::wait::{Bell, Epoch, Waiting};
use dualframe_core::worker::{Step, Worker};

use crate::ve::{Failure, Ve};

const UNITS: usize = 6;
const INTERACTIONS: usize = 2 * UNITS * (UNITS + 1) / 2;
const CONTACTS: usize = 6 * INTERACTIONS;
const LETTERS: usize = 16;
const HOMES: usize = 2;
const QUEUES: usize = queue_slots(UNITS, INTERACTIONS, LETTERS, HOMES);
const FRAMES: u32 = 40;

/// Never sleeps: there is only one thread.
struct Awake;

impl Waiting for Awake {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        black_box(bell.rung_since(seen));
    }

    fn wake(&self, bell: &Bell, count: u32) {
        black_box((bell.is_for_holders(), count));
    }
}

/// Runs everything; `true` if all of it did what it should.
fn all() -> bool {
    for broad_phase in [BroadPhase::Spatial, BroadPhase::Pairwise] {
        for entry in [Entry::AfterUpdate, Entry::AfterRender, Entry::AfterSwap] {
            if pipeline(black_box(Config { broad_phase, entry, tokens: 2, homes: HOMES as u32 }))
                != Ok(())
            {
                return false;
            }
        }
    }
    latest::<3>() && latest::<16>() && latest::<256>() && ring() && once()
}

fn pipeline(config: Config) -> Result<(), Failure> {
    let mut units = [const { UnitSlot::new(0.0) }; UNITS];
    let mut interactions = [const { InteractionSlot::spare(0) }; INTERACTIONS];
    if config.broad_phase == BroadPhase::Pairwise {
        for (slot, b) in interactions.iter_mut().zip(1..) {
            let b = UnitId(b % UNITS as u32);
            let a = UnitId((b.0 + 1) % UNITS as u32);
            *slot = InteractionSlot::between(a, b, 0);
        }
    }
    let [first, ..] = &mut units;
    *first = UnitSlot::solitary(0.5);
    let mut contacts = [const { ContactSlot::new() }; CONTACTS];
    let mut segments = [const { SegmentSlot::new() }; CONTACTS];
    let mut letters = [const { LetterSlot::new() }; LETTERS];
    let mut queues = [const { QueueSlot::new() }; QUEUES];
    let memory = Memory {
        units: black_box(&mut units[..]),
        interactions: black_box(&mut interactions[..]),
        contacts: black_box(&mut contacts[..]),
        segments: black_box(&mut segments[..]),
        letters: black_box(&mut letters[..]),
        queues: black_box(&mut queues[..]),
    };
    let mut pipeline = Pipeline::new(memory, config, Awake)?;
    for _ in 0..2 {
        black_box(&mut pipeline).run(black_box(FRAMES))?;
        frames(black_box(&pipeline))?;
    }
    let pipeline = black_box(&mut pipeline);
    pipeline.set_homes(|unit| black_box(unit.0));
    shared(pipeline)?;
    endless(pipeline)?;
    pipeline.take_letters(|unit, from, letter| {
        black_box((unit, from, letter));
    });
    let sum: f32 = pipeline.objects_mut().map(|object| *object).sum();
    let finite = sum.is_finite() && pipeline.high_water().1 > 0;
    if finite { Ok(()) } else { Err(Failure::Wrong) }
}

/// Workers that come and go, a token that changes hands, letters from outside, until all is swapped.
fn frames(pipeline: &Pipeline<'_, Ve, Awake>) -> Result<(), Failure> {
    let first = pipeline.frame();
    let token = pipeline.token(0).map_err(|(_, full)| full)?;
    let mut holder = pipeline.worker();
    holder.hold(token).map_err(|_| Failure::Wrong)?;
    while !pipeline.finished() {
        let mut guest = pipeline.worker_at(1);
        for _ in 0..black_box(7) {
            turn(&mut holder)?;
            turn(&mut guest)?;
        }
        if let Some(token) = holder.release() {
            guest.hold(token).map_err(|_| Failure::Wrong)?;
        }
        post(pipeline)?;
        for _ in 0..black_box(3) {
            turn(&mut guest)?;
            turn(&mut holder)?;
        }
        if let Some(token) = guest.release() {
            holder.hold(token).map_err(|_| Failure::Wrong)?;
        }
    }
    let shown = holder.release().map(|token| token.into_renderer());
    let swapped = pipeline.frame().0.wrapping_sub(first.0);
    if shown == Some(FRAMES) && swapped == FRAMES { Ok(()) } else { Err(Failure::Wrong) }
}

/// A run whose renderer is left to all workers.
fn shared(pipeline: &mut Pipeline<'_, Ve, Awake>) -> Result<(), Failure> {
    pipeline.run(black_box(FRAMES))?;
    pipeline.share(0).map_err(|_| Failure::Wrong)?;
    while !pipeline.finished() {
        let mut workers = [0, 1].map(|home| pipeline.worker_at(home));
        for _ in 0..black_box(7) {
            for worker in &mut workers {
                turn(worker)?;
            }
        }
    }
    if pipeline.take_back() == Some(FRAMES) { Ok(()) } else { Err(Failure::Wrong) }
}

/// A run that goes on for as long as somebody steps.
fn endless(pipeline: &mut Pipeline<'_, Ve, Awake>) -> Result<(), Failure> {
    pipeline.run_without_end()?;
    let first = pipeline.frame();
    let token = pipeline.token(0).map_err(|(_, full)| full)?;
    let mut worker = pipeline.worker().probed(NoProbe);
    worker.hold(token).map_err(|_| Failure::Wrong)?;
    while pipeline.frame().0.wrapping_sub(first.0) < black_box(FRAMES) {
        turn(&mut worker)?;
        black_box(worker.probe());
        if worker.renderer().is_none() {
            return Err(Failure::Wrong);
        }
    }
    if pipeline.finished() { Err(Failure::Wrong) } else { Ok(()) }
}

fn turn(worker: &mut Worker<'_, '_, Ve, Awake>) -> Result<(), Failure> {
    if worker.step(&Ve)? == Step::Idle && !black_box(worker.has_cause_to_wake()) {
        worker.wait();
    }
    Ok(())
}

/// A letter to a unit, and one to nobody, which comes back.
fn post(pipeline: &Pipeline<'_, Ve, Awake>) -> Result<(), Failure> {
    let from = From { sender: black_box(99), sequence: black_box(0) };
    let to = UnitId(black_box(2));
    if let Err(rejected) = pipeline.post(to, from, 1.0)
        && rejected.full.table != Table::Letters
    {
        return Err(Failure::Wrong);
    }
    let nobody = UnitId(black_box(u32::MAX));
    match pipeline.post(nobody, from, 1.0) {
        Err(rejected) if rejected.full.table == Table::Units => Ok(()),
        _ => Err(Failure::Wrong),
    }
}

/// A static that is handed out once.
fn once() -> bool {
    static ONCE: Static<u32> = Static::new(0);
    black_box(&ONCE).take().is_some() && black_box(&ONCE).take().is_none()
}

/// A latest-value cell, written and read in turns.
fn latest<const SLOTS: usize>() -> bool {
    let mut cell = Latest::<u64, SLOTS>::new(black_box(0));
    let (mut writer, readers) = black_box(&mut cell).split();
    let Ok(mut first) = readers.reader() else { return false };
    for value in 1..black_box(100) {
        writer.publish(value);
        if first.read() != value {
            return false;
        }
        // Refused where `first` is the only one allowed.
        if let Ok(mut second) = readers.reader() {
            writer.publish(value + 1);
            if second.read() != value + 1 {
                return false;
            }
        }
    }
    true
}

/// A ring on its own, and an index that does not fit it.
fn ring() -> bool {
    let mut slots = [const { QueueSlot::new() }; 8];
    let Ok(ring) = IndexRing::new(black_box(&mut slots[..])) else { return false };
    (0..black_box(8)).all(|index| ring.push(index).is_ok())
        && ring.push(black_box(8)).is_err()
        && (0..black_box(8)).all(|index| ring.pop() == Some(index))
        && ring.pop().is_none()
        && ring.looks_empty()
}
