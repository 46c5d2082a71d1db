//! Random virtual environments and random ways of running them.

use dualframe_core::frame::Entry;
use dualframe_core::pipeline::BroadPhase;
use proptest::prelude::*;

use crate::body::{Body, draw};

/// One virtual environment and how it is run. Everything that a callback or a worker decides at
/// random comes from `seed`; only the interleaving is the machine's.
#[derive(Clone, Debug)]
pub struct Case {
    /// Seeds costs, yields, faults, letters, and the workers' comings and goings.
    pub seed: u64,
    /// Which pairs are tested.
    pub broad_phase: BroadPhase,
    /// Whether each unit was made solitary (spatial broad phase only), and its body.
    pub units: Vec<(bool, Body)>,
    /// Modelled interactions (pairwise broad phase only); a pair may occur several times.
    pub edges: Vec<[u32; 2]>,
    /// Frames of each call of `run`.
    pub segments: Vec<u32>,
    /// How far frames overlap.
    pub entry: Entry,
    /// Worker threads.
    pub workers: u32,
    /// Render tokens.
    pub tokens: u32,
    /// Whether all of them are in one renderer that is left to all workers.
    pub shared: bool,
    /// Homes that the units are shared out to.
    pub homes: u32,
    /// Whether callbacks fail now and then.
    pub faults: bool,
    /// Whether idle workers sleep until they are woken, instead of looking again and again.
    pub sleep: bool,
}

/// Where a callback fails on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// In `interact`, before its response is pushed.
    Interact,
    /// In `update`.
    Update,
    /// In `render`.
    Render,
    /// In `swap`.
    Swap,
}

impl Case {
    /// Whether a callback fails, and how: 0 and 1 are two ways.
    pub fn fails(&self, at: Fault, frame: u32, about: [u32; 2]) -> Option<u64> {
        let drawn = draw(self.seed, &[at as u32, frame, about[0], about[1]]);
        (self.faults && drawn.is_multiple_of(13)).then_some(drawn / 13 % 2)
    }

    /// All frames of all segments.
    pub fn frames(&self) -> u32 {
        self.segments.iter().sum()
    }

    /// Whether `unit` never meets another.
    pub fn is_solitary(&self, unit: u32) -> bool {
        match self.broad_phase {
            BroadPhase::Spatial => self.units[unit as usize].0,
            BroadPhase::Pairwise => !self.edges.iter().any(|edge| edge.contains(&unit)),
        }
    }

    /// The letter that the host posts before each segment: its receiver and word.
    pub fn letter_from_outside(&self, segment: u32) -> (u32, u64) {
        let word = draw(self.seed, &[14, segment]);
        ((word % self.units.len() as u64) as u32, word)
    }
}

/// The sender's number of letters from outside.
pub const OUTSIDE: u32 = 1000;

fn body() -> impl Strategy<Value = (bool, Body)> {
    // Wide enough that a third of the pairs overlap, fast enough that they change.
    let solitary = prop::bool::weighted(0.15);
    let place = -6.0_f32..6.0;
    (solitary, place, 0.2_f32..3.0, -1.5_f32..1.5, prop::bool::weighted(0.3)).prop_map(
        |(solitary, place, half, speed, folds)| (solitary, Body::new(0, place, half, speed, folds)),
    )
}

/// Random cases of one broad phase; `sleep` says what idle workers do.
pub fn cases(broad_phase: BroadPhase, sleep: bool) -> impl Strategy<Value = Case> {
    let entry =
        prop_oneof![Just(Entry::AfterUpdate), Just(Entry::AfterRender), Just(Entry::AfterSwap)];
    let bodies = prop::collection::vec(body(), 1..8);
    let edges = prop::collection::vec((0..64_u32, 0..64_u32), 0..12);
    let segments = prop::collection::vec(1..6_u32, 1..4);
    let rendering = (1..=2_u32, prop::bool::ANY);
    let running = (segments, entry, 1..=8_u32, rendering, 1..=3_u32, prop::bool::ANY);
    (any::<u64>(), bodies, edges, running).prop_map(
        move |(
            seed,
            mut units,
            edges,
            (segments, entry, workers, (tokens, shared), homes, faults),
        )| {
            let count = units.len() as u32;
            for (unit, (_, body)) in units.iter_mut().enumerate() {
                body.unit = unit as u32;
            }
            let ends = |(a, step): (u32, u32)| [a % count, (a + 1 + step % (count - 1)) % count];
            let modelled = broad_phase == BroadPhase::Pairwise && count > 1;
            let edges = if modelled { edges.into_iter().map(ends).collect() } else { vec![] };
            Case {
                seed,
                broad_phase,
                units,
                edges,
                segments,
                entry,
                workers,
                tokens,
                shared,
                homes,
                faults,
                sleep,
            }
        },
    )
}
