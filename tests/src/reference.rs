//! What a case must come to: a plain loop over frames, no pipeline.

use dualframe_core::pipeline::BroadPhase;

use crate::body::{Body, Memory, letters, respond};
use crate::random_ve::{Case, Fault, OUTSIDE};

/// The state after all frames.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Every unit's body.
    pub bodies: Vec<Body>,
    /// Every modelled interaction's memory; empty where interactions are found at run time.
    pub memories: Vec<Memory>,
    /// Every failure that a step must report, sorted. A swap's may be hidden by its last
    /// rendering's.
    pub failures: Vec<(Fault, u32, [u32; 2])>,
}

struct Interaction {
    ends: [u32; 2],
    slot: usize,
    records: Vec<f32>,
    memory: Memory,
}

/// Runs `case` sequentially.
pub fn run(case: &Case) -> Outcome {
    let mut bodies: Vec<_> = case.units.iter().map(|&(_, body)| body).collect();
    let mut memories = vec![Memory::default(); case.edges.len()];
    let mut failures = vec![];
    // Sender, sequence, receiver, word.
    let mut mail: Vec<(u32, u32, u32, u64)> = vec![];
    let starts = case.segments.iter().scan(0, |at, &frames| {
        *at += frames;
        Some(*at - frames)
    });
    let starts: Vec<u32> = starts.collect();
    for frame in 0..case.frames() {
        if let Some(segment) = starts.iter().position(|&start| start == frame) {
            let (to, word) = case.letter_from_outside(segment as u32);
            mail.push((OUTSIDE, segment as u32, to, word));
        }
        mail.sort_unstable();
        let found = interactions(case, frame, &bodies, &mut memories, &mut failures);
        let mut posted = vec![];
        for unit in 0..bodies.len() as u32 {
            let body = &mut bodies[unit as usize];
            body.age += 1;
            let failure = case.fails(Fault::Update, frame, [unit; 2]);
            failures.extend(failure.map(|_| (Fault::Update, frame, [unit; 2])));
            if failure != Some(0) {
                for &(sender, sequence, _, word) in mail.iter().filter(|letter| letter.2 == unit) {
                    body.hear(sender, sequence, word);
                }
                update(body, &found);
                let posts = letters(case.seed, case.units.len() as u32, unit, frame).enumerate();
                posted.extend(posts.map(|(k, (to, word))| (unit, k as u32, to, word)));
            }
            let failure = case.fails(Fault::Render, frame, [unit; 2]);
            failures.extend(failure.map(|_| (Fault::Render, frame, [unit; 2])));
        }
        let failure = case.fails(Fault::Swap, frame, [0; 2]);
        failures.extend(failure.map(|_| (Fault::Swap, frame, [0; 2])));
        mail = posted;
    }
    failures.sort_unstable();
    Outcome { bodies, memories, failures }
}

fn interactions(
    case: &Case,
    frame: u32,
    bodies: &[Body],
    memories: &mut [Memory],
    failures: &mut Vec<(Fault, u32, [u32; 2])>,
) -> Vec<Interaction> {
    let mut candidates = vec![];
    match case.broad_phase {
        BroadPhase::Pairwise => {
            for (slot, &[a, b]) in case.edges.iter().enumerate() {
                let ends = [a.min(b), a.max(b)];
                if bodies[a as usize].near(&bodies[b as usize]) {
                    candidates.push((ends, slot));
                }
            }
        }
        BroadPhase::Spatial => {
            let social = || (0..bodies.len() as u32).filter(|&unit| !case.is_solitary(unit));
            for a in social() {
                if bodies[a as usize].folds_now() {
                    candidates.push(([a; 2], 0));
                }
                for b in social().filter(|&b| b > a) {
                    if bodies[a as usize].near(&bodies[b as usize]) {
                        candidates.push(([a, b], 0));
                    }
                }
            }
        }
    }
    let stays = case.broad_phase == BroadPhase::Pairwise;
    let respond_to = |(ends, slot): ([u32; 2], usize)| {
        let [a, b] = ends.map(|end| &bodies[end as usize]);
        let mut memory = if stays { memories[slot] } else { Memory::default() };
        let records = respond(case.seed, frame, a, b, &mut memory, stays);
        if stays {
            memories[slot] = memory;
        }
        let mut records = records.concat();
        if case.fails(Fault::Interact, frame, ends).is_some() {
            failures.push((Fault::Interact, frame, ends));
            records.clear();
        }
        Interaction { ends, slot, records, memory }
    };
    candidates.into_iter().map(respond_to).collect()
}

/// Interactions in the order of the other end's number, then of the slot.
fn update(body: &mut Body, found: &[Interaction]) {
    let unit = body.unit;
    let other = |of: &Interaction| if of.ends[0] == unit { of.ends[1] } else { of.ends[0] };
    let mut own: Vec<_> = found.iter().filter(|of| of.ends.contains(&unit)).collect();
    own.sort_by_key(|of| (other(of), of.slot));
    for of in own {
        body.meet(other(of), &of.memory);
        of.records.iter().for_each(|&record| body.feel(record));
    }
    body.travel();
}
