//! The invariants of a run, read off its trace alone.

use std::collections::BTreeMap;

use dualframe_core::frame::Entry;
use dualframe_core::pipeline::BroadPhase;

use crate::random_ve::Case;
use crate::trace::{Act, Rank, Record};

/// What can be wrong with a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rule {
    /// Each unit is updated exactly once a frame.
    UpdatedOnce,
    /// Each unit is rendered exactly once a frame.
    RenderedOnce,
    /// Each pair is tested exactly once a frame, and no other; each unit asked once about itself.
    TestedOnce,
    /// Each accepted pair interacts exactly once a frame, and no other.
    InteractedOnce,
    /// Each frame is swapped exactly once.
    SwappedOnce,
    /// A pair is tested and interacts after both ends' updates of the frame before and before
    /// those of the frame, and interacts after its test.
    DetectionOrder,
    /// A unit is rendered after its update of the frame and before that of the next.
    RenderOrder,
    /// A frame is swapped after all its renderings, before the next frame's, and in turn.
    SwapOrder,
    /// No update of a frame before the frame before last is swapped.
    TwoFrames,
    /// A unit does not enter a frame earlier than the configuration says.
    Entry,
    /// Nobody else has a unit that is updated, or an interaction's memory that is written.
    Exclusive,
    /// No more renderings and swaps at once than tokens, and one at once by each.
    Tokens,
    /// A callback saw an object of another frame than its own.
    Stale,
    /// A letter was not read by the update it was due at.
    LetterLost,
    /// A letter was read twice.
    LetterDoubled,
    /// A letter was read in another frame, by another unit, or before it was posted.
    LetterAstray,
    /// An update's letters were not in the order of (sender, sequence).
    LetterOrder,
}

/// A broken rule, and where.
#[derive(Clone, Debug)]
pub struct Broken {
    /// The rule.
    pub rule: Rule,
    /// Where and how.
    pub how: String,
}

/// What a trace is checked against.
#[derive(Clone, Debug)]
pub struct Expected {
    /// Units.
    pub units: u32,
    /// Frames.
    pub frames: u32,
    /// Whether units are asked about interactions with themselves.
    pub asked_within: bool,
    /// How often each pair of units (the lower first) is tested in each frame.
    pub tests: BTreeMap<[u32; 2], usize>,
    /// Units that never meet others.
    pub solitary: Vec<bool>,
    /// When units enter a frame.
    pub entry: Entry,
    /// Tokens.
    pub tokens: usize,
}

impl Expected {
    /// What `case` promises.
    pub fn of(case: &Case) -> Self {
        let units = case.units.len() as u32;
        let solitary: Vec<_> = (0..units).map(|unit| case.is_solitary(unit)).collect();
        let mut tests = BTreeMap::new();
        let spatial = case.broad_phase == BroadPhase::Spatial;
        if spatial {
            let social = |unit: &u32| !solitary[*unit as usize];
            for a in (0..units).filter(social) {
                tests.extend((a + 1..units).filter(social).map(|b| ([a, b], 1)));
            }
        }
        for &edge in &case.edges {
            *tests.entry(sorted(edge)).or_default() += 1;
        }
        Self {
            units,
            frames: case.frames(),
            asked_within: spatial,
            tests,
            solitary,
            entry: case.entry,
            tokens: if case.shared { 1 } else { case.tokens as usize },
        }
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

type ByUnit<'t> = BTreeMap<(u32, u32), Vec<&'t Record>>;

/// Records of detection, by frame and ends.
type ByPair<'t> = BTreeMap<(u32, [u32; 2]), Vec<&'t Record>>;

struct Checker<'t> {
    expected: &'t Expected,
    /// By (frame, unit).
    updates: ByUnit<'t>,
    renders: ByUnit<'t>,
    /// By (frame, 0).
    swaps: ByUnit<'t>,
    /// Accepted or not; a unit asked about itself is a pair with itself.
    tests: ByPair<'t>,
    accepted: ByPair<'t>,
    interactions: ByPair<'t>,
    broken: Vec<Broken>,
}

/// Everything that is wrong with `records`, which are in the order in which they began.
pub fn check(expected: &Expected, records: &[Record]) -> Vec<Broken> {
    let mut checker = Checker {
        expected,
        updates: ByUnit::new(),
        renders: ByUnit::new(),
        swaps: ByUnit::new(),
        tests: ByPair::new(),
        accepted: ByPair::new(),
        interactions: ByPair::new(),
        broken: vec![],
    };
    records.iter().for_each(|record| checker.file(record));
    checker.counts();
    checker.detection();
    checker.rendering();
    checker.window();
    checker.overlaps(records);
    checker.letters(records);
    checker.broken
}

impl<'t> Checker<'t> {
    fn claim(&mut self, rule: Rule, holds: bool, how: impl FnOnce() -> String) {
        if !holds {
            self.broken.push(Broken { rule, how: how() });
        }
    }

    /// Files a record under its frame and whom it is about.
    fn file(&mut self, record: &'t Record) {
        let (fresh, frame) = match record.act {
            Act::Test { ends, seen, accepted } => {
                let key = (seen[0], sorted(ends));
                self.tests.entry(key).or_default().push(record);
                if accepted {
                    self.accepted.entry(key).or_default().push(record);
                }
                (seen[0] == seen[1], seen[0])
            }
            Act::Within { unit, seen, accepted } => {
                let key = (seen, [unit; 2]);
                self.tests.entry(key).or_default().push(record);
                if accepted {
                    self.accepted.entry(key).or_default().push(record);
                }
                (true, seen)
            }
            Act::Interact { ends, frame, seen, .. } => {
                self.interactions.entry((frame, ends)).or_default().push(record);
                (seen == [frame; 2] && ends[0] <= ends[1], frame)
            }
            Act::Update { unit, frame, seen, .. } => {
                self.updates.entry((frame, unit)).or_default().push(record);
                (seen == frame, frame)
            }
            Act::Render { unit, frame, seen, .. } => {
                self.renders.entry((frame, unit)).or_default().push(record);
                (seen == frame + 1, frame)
            }
            Act::Swap { frame, .. } => {
                self.swaps.entry((frame, 0)).or_default().push(record);
                (true, frame)
            }
            Act::Post { .. } | Act::Read { .. } => (true, 0),
        };
        let fresh = fresh && frame < self.expected.frames;
        self.claim(Rule::Stale, fresh, || format!("{record:?}"));
    }

    fn counts(&mut self) {
        let Expected { units, frames, tests, solitary, asked_within, .. } = self.expected;
        for frame in 0..*frames {
            for unit in 0..*units {
                let updates = self.updates.get(&(frame, unit)).map_or(0, Vec::len);
                self.claim(Rule::UpdatedOnce, updates == 1, || {
                    format!("unit {unit} updated {updates} times in frame {frame}")
                });
                let renders = self.renders.get(&(frame, unit)).map_or(0, Vec::len);
                self.claim(Rule::RenderedOnce, renders == 1, || {
                    format!("unit {unit} rendered {renders} times in frame {frame}")
                });
            }
            let swaps = self.swaps.get(&(frame, 0)).map_or(0, Vec::len);
            self.claim(Rule::SwappedOnce, swaps == 1, || {
                format!("frame {frame} swapped {swaps} times")
            });
            let all = (0..*units).flat_map(|a| (a..*units).map(move |b| [a, b]));
            for pair @ [a, b] in all {
                let asked = usize::from(*asked_within && !solitary[a as usize]);
                let due = if a == b { asked } else { tests.get(&pair).copied().unwrap_or(0) };
                let found = self.tests.get(&(frame, pair)).map_or(0, Vec::len);
                self.claim(Rule::TestedOnce, found == due, || {
                    format!("pair {pair:?} tested {found} times in frame {frame}, not {due}")
                });
                let due = self.accepted.get(&(frame, pair)).map_or(0, Vec::len);
                let found = self.interactions.get(&(frame, pair)).map_or(0, Vec::len);
                self.claim(Rule::InteractedOnce, found == due, || {
                    format!("pair {pair:?} interacts {found} times in frame {frame}, not {due}")
                });
            }
        }
    }

    fn detection(&mut self) {
        let all = self.tests.iter().chain(&self.interactions);
        let all: Vec<_> = all.map(|(key, records)| (*key, records.clone())).collect();
        for ((frame, ends), records) in all {
            for end in ends {
                let before = frame.checked_sub(1).and_then(|frame| self.updates.get(&(frame, end)));
                let updated = before
                    .into_iter()
                    .flatten()
                    .all(|update| records.iter().all(|record| update.end < record.begin));
                let next = self.updates.get(&(frame, end)).into_iter().flatten();
                let waited =
                    { next }.all(|update| records.iter().all(|record| record.end < update.begin));
                self.claim(Rule::DetectionOrder, updated && waited, || {
                    format!("unit {end} updated out of turn with {records:?}")
                });
            }
        }
        // Of several interactions of one pair, the k-th to begin had k tests before it.
        for (key, interactions) in self.interactions.clone() {
            let accepted = self.accepted.get(&key).cloned().unwrap_or_default();
            let mut tested: Vec<_> = accepted.iter().map(|record| record.end).collect();
            tested.sort_unstable();
            let after = interactions.iter().zip(tested).all(|(record, end)| end < record.begin);
            self.claim(Rule::DetectionOrder, after, || {
                format!("interaction before its test: {interactions:?}, {accepted:?}")
            });
        }
    }

    fn rendering(&mut self) {
        for (&(frame, unit), renders) in &self.renders.clone() {
            let own = self.updates.get(&(frame, unit)).cloned().unwrap_or_default();
            let next = self.updates.get(&(frame + 1, unit)).cloned().unwrap_or_default();
            for render in renders {
                let ordered = own.iter().all(|update| update.end < render.begin)
                    && next.iter().all(|update| render.end < update.begin);
                self.claim(Rule::RenderOrder, ordered, || format!("{render:?}, {own:?}, {next:?}"));
            }
            for swap in self.swaps.get(&(frame, 0)).cloned().unwrap_or_default() {
                let ordered = renders.iter().all(|render| render.end < swap.begin);
                self.claim(Rule::SwapOrder, ordered, || format!("{renders:?} after {swap:?}"));
            }
            let before = frame.checked_sub(1).and_then(|frame| self.swaps.get(&(frame, 0)));
            for swap in before.cloned().unwrap_or_default() {
                let ordered = renders.iter().all(|render| swap.end < render.begin);
                self.claim(Rule::SwapOrder, ordered, || format!("{renders:?} before {swap:?}"));
            }
        }
        let swaps: Vec<_> = self.swaps.values().flatten().copied().collect();
        for two in swaps.windows(2) {
            self.claim(Rule::SwapOrder, two[0].end < two[1].begin, || format!("{two:?}"));
        }
    }

    fn window(&mut self) {
        for (&(frame, _), updates) in &self.updates.clone() {
            let before_last = frame.checked_sub(2).and_then(|frame| self.swaps.get(&(frame, 0)));
            for swap in before_last.cloned().unwrap_or_default() {
                let waited = updates.iter().all(|update| swap.end < update.begin);
                self.claim(Rule::TwoFrames, waited, || format!("{updates:?} before {swap:?}"));
            }
        }
        let mut entered: Vec<&Record> = vec![];
        for (&(frame, ends), tests) in &self.tests {
            let Some(before) = frame.checked_sub(1) else { continue };
            let swap = self.swaps.get(&(before, 0)).into_iter().flatten();
            let renders = ends.into_iter().flat_map(|end| self.renders.get(&(before, end)));
            let needed: Vec<&Record> = match self.expected.entry {
                Entry::AfterUpdate => vec![],
                Entry::AfterRender => renders.flatten().copied().collect(),
                Entry::AfterSwap => swap.copied().collect(),
            };
            let late = |test: &&Record| needed.iter().any(|needed| test.begin < needed.end);
            entered.extend(tests.iter().copied().filter(late));
        }
        for record in entered {
            self.claim(Rule::Entry, false, || format!("{record:?}"));
        }
    }

    fn overlaps(&mut self, records: &[Record]) {
        for unit in 0..self.expected.units {
            // (when the last update ends, when the last of anything ends)
            let (mut updated, mut used) = (None, None);
            for record in records {
                let updates = matches!(record.act, Act::Update { .. });
                let touches = match record.act {
                    Act::Test { ends, .. } | Act::Interact { ends, .. } => ends.contains(&unit),
                    Act::Within { unit: of, .. }
                    | Act::Update { unit: of, .. }
                    | Act::Render { unit: of, .. } => of == unit,
                    _ => false,
                };
                if !touches {
                    continue;
                }
                let held = if updates { used } else { updated };
                self.claim(Rule::Exclusive, Some(record.begin) > held, || {
                    format!("unit {unit} was in use at {record:?}")
                });
                used = used.max(Some(record.end));
                if updates {
                    updated = updated.max(Some(record.end));
                }
            }
        }
        let mut memories: BTreeMap<u32, u64> = BTreeMap::new();
        for record in records {
            if let Act::Interact { id, .. } = record.act {
                let before = memories.insert(id, record.end);
                self.claim(Rule::Exclusive, Some(record.begin) > before, || {
                    format!("interaction {id} was in use at {record:?}")
                });
            }
        }
        let mut rendering: Vec<(u32, u64)> = vec![];
        for record in records {
            if let Act::Render { token, .. } | Act::Swap { token, .. } = record.act {
                rendering.retain(|&(_, end)| end > record.begin);
                let free = rendering.iter().all(|&(other, _)| other != token);
                rendering.push((token, record.end));
                let few = rendering.len() <= self.expected.tokens;
                self.claim(Rule::Tokens, free && few, || format!("{rendering:?} at {record:?}"));
            }
        }
    }

    fn letters(&mut self, records: &[Record]) {
        let mut posted: BTreeMap<(u32, u32, Rank), (u64, usize)> = BTreeMap::new();
        let mut last: BTreeMap<(u32, u32), Rank> = BTreeMap::new();
        for record in records {
            match record.act {
                Act::Post { to, due, rank } => {
                    let known = posted.insert((to, due, rank), (record.end, 0));
                    self.claim(Rule::LetterDoubled, known.is_none(), || format!("{record:?}"));
                }
                Act::Read { unit, frame, rank } => {
                    let letter = posted.get_mut(&(unit, frame, rank));
                    let astray = letter.as_ref().is_none_or(|(end, _)| *end > record.begin);
                    let reads = letter.map_or(0, |(_, reads)| {
                        *reads += 1;
                        *reads
                    });
                    self.claim(Rule::LetterAstray, !astray, || format!("{record:?}"));
                    self.claim(Rule::LetterDoubled, reads <= 1, || format!("{record:?}"));
                    let ordered = last.insert((unit, frame), rank).is_none_or(|last| last <= rank);
                    self.claim(Rule::LetterOrder, ordered, || format!("{record:?}"));
                }
                _ => {}
            }
        }
        for ((to, due, rank), (_, reads)) in posted {
            let update = self.updates.get(&(due, to)).and_then(|updates| updates.first());
            let refused = update
                .is_some_and(|update| matches!(update.act, Act::Update { refused: true, .. }));
            let read = reads > 0 || refused || due >= self.expected.frames;
            self.claim(Rule::LetterLost, read, || format!("to {to}, due {due}, from {rank:?}"));
        }
    }
}
