//! Operations of every set of instructions on numbers that are special. Those of arithmetic, which IEEE 754 leaves no
//! choice, are compared by whole bodies, in `tests/simd.rs`.

use super::*;

const SPECIAL: [f32; 12] = [
    f32::NAN,
    -f32::NAN,
    0.0,
    -0.0,
    f32::INFINITY,
    f32::NEG_INFINITY,
    1e-42,
    -1e-42,
    f32::MAX,
    f32::MIN_POSITIVE,
    1.5,
    -1.5,
];

/// Sixteen pairs of numbers.
#[derive(Clone, Copy)]
struct Pairs {
    a: Lanes,
    b: Lanes,
}

/// Every two special numbers, in each lane.
fn pairs() -> impl Iterator<Item = Pairs> {
    let count = SPECIAL.len();
    (0..count * count).map(move |first| {
        let pair = |lane: usize| (first + lane) % (count * count);
        Pairs {
            a: std::array::from_fn(|lane| SPECIAL[pair(lane) / count]),
            b: std::array::from_fn(|lane| SPECIAL[pair(lane) % count]),
        }
    })
}

/// What the operations come to: sets of lanes, and bits lane by lane.
#[derive(Debug, PartialEq)]
struct Outcome {
    less: LaneSet,
    at_most: LaneSet,
    min: [u32; LANES],
    max: [u32; LANES],
    chosen: [u32; LANES],
    chosen_half: [u32; HALF],
    columns: [[u32; HALF]; HALF],
    nodes: Vec<u32>,
    kept: Vec<[u32; 3]>,
}

/// The lanes kept by [`Isa::compress`].
const KEPT: LaneSet = 0b1010_0110_0001_1001;
const FIRST: u32 = 32;

fn bits<const N: usize>(lanes: [f32; N]) -> [u32; N] {
    lanes.map(f32::to_bits)
}

fn halves(lanes: Lanes) -> [HalfLanes; 2] {
    [0, 1].map(|half| std::array::from_fn(|lane| lanes[half * HALF + lane]))
}

fn choose(chooser: f32, a: f32, b: f32) -> u32 {
    chooser.to_bits() & a.to_bits() | !chooser.to_bits() & b.to_bits()
}

impl Outcome {
    fn expected(Pairs { a, b }: Pairs) -> Self {
        let set = |holds: fn(f32, f32) -> bool| {
            (0..LANES).fold(0, |set, lane| set | LaneSet::from(holds(a[lane], b[lane])) << lane)
        };
        let pick = |first: fn(f32, f32) -> bool| {
            bits(std::array::from_fn(
                |lane| if first(a[lane], b[lane]) { a[lane] } else { b[lane] },
            ))
        };
        let ([low, high], [of_b, _]) = (halves(a), halves(b));
        let row = |row: usize| if row.is_multiple_of(2) { low } else { high };
        Self {
            less: set(|a, b| a < b),
            at_most: set(|a, b| a <= b),
            min: pick(|a, b| a < b),
            max: pick(|a, b| a > b),
            chosen: std::array::from_fn(|lane| choose(b[lane], a[lane], a[LANES - 1 - lane])),
            chosen_half: std::array::from_fn(|lane| choose(of_b[lane], low[lane], high[lane])),
            columns: std::array::from_fn(|column| bits(std::array::from_fn(|at| row(at)[column]))),
            nodes: lanes(KEPT).map(|lane| FIRST + lane as u32).collect(),
            kept: lanes(KEPT).map(|lane| bits([a[lane], b[lane], a[lane]])).collect(),
        }
    }
}

/// The operations of a set of instructions.
struct Try(Pairs);

impl Kernel for Try {
    type Output = Outcome;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Outcome {
        let Self(Pairs { a, b }) = self;
        let (x, y, half) = (isa.load(&a), isa.load(&b), isa.half());
        let stored = |vector: I::Vector| {
            let mut lanes = [0.0; LANES];
            isa.store(vector, &mut lanes);
            bits(lanes)
        };
        let half_stored = |vector: <I::Half as Arithmetic>::Vector| {
            let mut lanes = [0.0; HALF];
            half.store(vector, &mut lanes);
            bits(lanes)
        };
        let ([low, high], [of_b, _]) = (halves(a), halves(b));
        let rows =
            std::array::from_fn(|row| half.load(if row.is_multiple_of(2) { &low } else { &high }));
        let mut reversed = a;
        reversed.reverse();
        let (mut nodes, [mut p, mut q, mut r]) = ([0; LANES], [[0.0; LANES]; 3]);
        isa.compress(KEPT, FIRST, [x, y, x], &mut nodes, [&mut p, &mut q, &mut r]);
        let count = KEPT.count_ones() as usize;
        Outcome {
            less: isa.less(x, y),
            at_most: isa.at_most(x, y),
            min: stored(isa.min(x, y)),
            max: stored(isa.max(x, y)),
            chosen: stored(isa.choose(y, x, isa.load(&reversed))),
            chosen_half: half_stored(half.choose(
                half.load(&of_b),
                half.load(&low),
                half.load(&high),
            )),
            columns: half.transpose(rows).map(half_stored),
            nodes: nodes[..count].to_vec(),
            kept: (0..count).map(|place| bits([p[place], q[place], r[place]])).collect(),
        }
    }
}

#[test]
fn every_operation_is_the_same() {
    for simd in Simd::available() {
        for pairs in pairs() {
            let name = simd.instructions().name();
            assert_eq!(simd.run(Try(pairs)), Outcome::expected(pairs), "{name}");
        }
    }
}

/// A sum over lanes, and the least and greatest.
struct Fold(Lanes);

impl Kernel for Fold {
    type Output = [u32; 3];

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> [u32; 3] {
        let vector = isa.load(&self.0);
        bits([isa.sum(vector), least(isa, vector), greatest(isa, vector)])
    }
}

#[test]
fn lanes_are_folded_in_one_order() {
    for simd in Simd::available() {
        for seed in 0..200_u32 {
            // Of such different sizes that every other order is rounded otherwise.
            let number = |lane: usize| {
                let mixed = crate::mix::mix(u64::from(seed) << 8 | lane as u64);
                (mixed as f32 / u64::MAX as f32 - 0.5) * 10_f32.powi((mixed % 9) as i32)
            };
            let lanes: Lanes = std::array::from_fn(number);
            let ordered = |join: fn(f32, f32) -> f32| lanes.into_iter().reduce(join).unwrap_or(0.0);
            let expected = bits([fold(lanes), ordered(f32::min), ordered(f32::max)]);
            assert_eq!(simd.run(Fold(lanes)), expected, "{}", simd.instructions().name());
        }
        let zeros: Lanes = [-0.0; LANES];
        assert_eq!(simd.run(Fold(zeros))[0], fold(zeros).to_bits());
    }
}
