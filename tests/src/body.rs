//! A unit of the random virtual environments, and all its arithmetic: the pipeline's callbacks and
//! the sequential reference call the same functions, so that results can be compared bit by bit.

/// A pseudo-random number that depends on nothing but its arguments.
pub fn draw(seed: u64, about: &[u32]) -> u64 {
    // SplitMix64's finaliser over each word.
    about.iter().fold(mix(seed), |state, &word| mix(state ^ u64::from(word)))
}

fn mix(state: u64) -> u64 {
    let mut z = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A unit: an interval on a line, that moves, feels and hears.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Its number.
    pub unit: u32,
    /// How many updates it has gone through.
    pub age: u32,
    /// Whether it interacts with itself in every second frame.
    pub folds: bool,
    place: f32,
    speed: f32,
    half: f32,
    felt: f32,
    heard: u64,
}

impl Body {
    /// A body at `place`, `half` to each side, moving `speed` a frame.
    pub fn new(unit: u32, place: f32, half: f32, speed: f32, folds: bool) -> Self {
        Self { unit, age: 0, folds, place, speed, half, felt: 0.0, heard: 0 }
    }

    /// Whether two bodies' intervals overlap.
    pub fn near(&self, other: &Self) -> bool {
        (self.place - other.place).abs() <= self.half + other.half
    }

    /// Whether it interacts with itself in its next frame.
    pub fn folds_now(&self) -> bool {
        self.folds && (self.age + self.unit).is_multiple_of(2)
    }

    /// Takes in a letter.
    pub fn hear(&mut self, sender: u32, sequence: u32, word: u64) {
        let letter = mix(word ^ u64::from(sender) << 32 ^ u64::from(sequence));
        self.heard = mix(self.heard ^ letter);
    }

    /// Takes in an interaction's memory, before its records.
    pub fn meet(&mut self, other: u32, memory: &Memory) {
        self.felt = self.felt * 0.75 + memory.sum * 0.01 + other as f32 * 0.001;
    }

    /// Takes in one record. Floating-point: another order gives other bits.
    pub fn feel(&mut self, record: f32) {
        self.felt += record;
        self.felt *= 1.000_1;
    }

    /// Moves; the last act of an update that did not refuse.
    pub fn travel(&mut self) {
        self.place += self.speed + self.felt.clamp(-0.25, 0.25);
        if self.place.abs() > 8.0 {
            self.speed = -self.speed;
            self.place = self.place.clamp(-8.0, 8.0);
        }
    }

    /// Everything it is, in comparable form.
    pub fn bits(&self) -> [u64; 6] {
        let floats = [self.place, self.speed, self.felt].map(|float| u64::from(float.to_bits()));
        [u64::from(self.unit), u64::from(self.age), floats[0], floats[1], floats[2], self.heard]
    }
}

/// An interaction's own state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory {
    /// The frame that it was last written in.
    pub frame: u32,
    /// The ends of that writer.
    pub ends: [u32; 2],
    /// A sum: over all frames where the interaction is modelled, of one frame otherwise.
    pub sum: f32,
}

/// Longest response, in records.
pub const MOST_RECORDS: usize = 3;

/// An interaction's response: records, in one push or several.
pub fn respond(
    seed: u64,
    frame: u32,
    a: &Body,
    b: &Body,
    memory: &mut Memory,
    stays: bool,
) -> Vec<Vec<f32>> {
    let ends = [a.unit, b.unit];
    let depth = a.place - b.place;
    let before = if stays { memory.sum } else { 0.0 };
    *memory = Memory { frame, ends, sum: before + depth * 0.37 + a.felt - b.felt };
    let record = |k: u32| depth * (0.1 + k as f32) + memory.sum * 0.3;
    match draw(seed, &[11, frame, ends[0], ends[1]]) % 5 {
        0 => vec![],
        1 => vec![vec![record(0)]],
        2 => vec![vec![record(0), record(1)]],
        3 => vec![vec![record(0)], vec![], vec![record(1), record(2)]],
        _ => vec![vec![record(2)], vec![record(0)], vec![record(1)]],
    }
}

/// The letters that `unit` posts in `frame`: receivers and words.
pub fn letters(seed: u64, units: u32, unit: u32, frame: u32) -> impl Iterator<Item = (u32, u64)> {
    let count = draw(seed, &[12, unit, frame]) % (MOST_LETTERS as u64 + 1);
    (0..count as u32).map(move |k| {
        let word = draw(seed, &[13, unit, frame, k]);
        ((word % u64::from(units)) as u32, word)
    })
}

/// Most letters that one update posts.
pub const MOST_LETTERS: usize = 2;
