//! The widest vector instructions that the machine has, chosen at run time, with the same bits from
//! every width.
//!
//! A kernel is written once, over `Isa`: sixteen lanes and the operations on them. `Simd::run`
//! compiles it for every set of instructions and picks one. Each operation is the IEEE 754 one, rounded
//! once: there is no fused multiply-add, no approximate reciprocal, and sums over lanes have one order,
//! `fold`'s. So a lane comes out the same whatever it was computed beside.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod prefetch;
mod scalar;
#[cfg(test)]
mod tests;

use thiserror::Error;

use self::scalar::Plain;
use crate::geometry::{LANES, Lanes};

pub(crate) use self::prefetch::{prefetch, prefetch_to_write};
#[cfg(target_arch = "x86_64")]
use self::{avx2::Avx2, avx512::Avx512};

/// A set of vector instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Instructions {
    /// What every machine of the target has: SSE2 on x86-64, NEON on AArch64.
    Scalar,
    /// AVX2, on x86-64.
    Avx2,
    /// AVX-512F and AVX-512VL, on x86-64.
    Avx512,
}

impl Instructions {
    /// All sets, the widest last.
    pub const ALL: [Self; 3] = [Self::Scalar, Self::Avx2, Self::Avx512];

    /// The name by which the program knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// The machine lacks a set of instructions.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("this machine has no {} instructions; the widest it has are {}", .asked.name(), .widest.name())]
pub struct Lacking {
    /// What was asked for.
    pub asked: Instructions,
    /// The widest set that the machine has.
    pub widest: Instructions,
}

/// A set of instructions that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Simd(Kind);

/// The sets, each with the proof that the machine has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Simd {
    /// These instructions.
    ///
    /// # Errors
    /// The machine lacks them.
    pub fn new(instructions: Instructions) -> Result<Self, Lacking> {
        let widest = || Self::detect().instructions();
        Self::have(instructions).ok_or_else(|| Lacking { asked: instructions, widest: widest() })
    }

    /// These instructions, if the machine has them.
    fn have(instructions: Instructions) -> Option<Self> {
        let kind = match instructions {
            Instructions::Scalar => Some(Kind::Scalar),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => Avx2::detect().map(Kind::Avx2),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => Avx512::detect().map(Kind::Avx512),
            #[cfg(not(target_arch = "x86_64"))]
            _ => None,
        };
        kind.map(Self)
    }

    /// The widest that the machine has.
    #[must_use]
    pub fn detect() -> Self {
        Self::available().last().unwrap_or(Self(Kind::Scalar))
    }

    /// All that the machine has, the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        Instructions::ALL.into_iter().filter_map(Self::have)
    }

    /// Which they are.
    #[must_use]
    pub fn instructions(self) -> Instructions {
        match self.0 {
            Kind::Scalar => Instructions::Scalar,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => Instructions::Avx2,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => Instructions::Avx512,
        }
    }

    /// How many numbers one register holds, [`HALF`] at least: lanes beyond that cost as much as doing them later.
    pub(crate) fn width(self) -> usize {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => LANES,
            _ => HALF,
        }
    }

    /// Those to use for a kernel that looks up among so many chunks of nodes.
    pub(crate) fn for_look_up(self, chunks: usize) -> Self {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(avx512) if chunks > Avx512::MOST_CHUNKS => Self(Kind::Avx2(avx512.avx2())),
            _ => self,
        }
    }

    /// Runs a kernel by these instructions.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Kind::Scalar => kernel.run(Plain),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(avx2) => avx2.run(kernel),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(avx512) => avx512.run(kernel),
        }
    }
}

/// Something to be compiled for every set of instructions.
pub(crate) trait Kernel {
    /// What it comes to.
    type Output;

    /// The kernel itself. It and all that it calls must be `#[inline(always)]`, or they are compiled
    /// for the baseline.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

/// Arithmetic on several numbers at once.
pub(crate) trait Arithmetic: Copy {
    /// So many numbers.
    type Lanes;
    /// The same, ready to be computed with.
    type Vector: Copy;

    fn splat(self, value: f32) -> Self::Vector;
    fn load(self, lanes: &Self::Lanes) -> Self::Vector;
    fn store(self, vector: Self::Vector, lanes: &mut Self::Lanes);
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    fn sqrt(self, a: Self::Vector) -> Self::Vector;
    /// The lesser ones; `b` where one is a NaN.
    fn min(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The greater ones; `b` where one is a NaN.
    fn max(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;

    /// The bits of `a` where those of `chooser` are set, of `b` elsewhere.
    fn choose(self, chooser: Self::Vector, a: Self::Vector, b: Self::Vector) -> Self::Vector;
}

/// The operations on half of [`LANES`] numbers at once.
pub(crate) trait HalfIsa: Arithmetic<Lanes = HalfLanes> {
    /// Rows become columns.
    fn transpose(self, rows: [Self::Vector; HALF]) -> [Self::Vector; HALF];
}

/// The operations on [`LANES`] numbers at once.
pub(crate) trait Isa: Arithmetic<Lanes = Lanes> {
    /// The same instructions on half as many numbers.
    type Half: HalfIsa;
    /// Vectors of a body's nodes, ready to be looked up by the nodes' numbers.
    type Table<'a>: Copy;

    fn half(self) -> Self::Half;

    /// Makes a table of vectors. `room` is memory that the table may use, of any content.
    fn table<'a>(self, chunks: &[Lanes3], room: &'a mut Vec<Quad>) -> Self::Table<'a>;

    /// The vectors of these nodes.
    ///
    /// # Safety
    /// Each of them is in the table.
    unsafe fn look_up(self, table: Self::Table<'_>, nodes: &[u32; LANES]) -> [Self::Vector; 3];

    /// The sum over the lanes, as [`fold`] takes it.
    fn sum(self, vector: Self::Vector) -> f32;

    /// The lanes in which `a` is less than `b`.
    fn less(self, a: Self::Vector, b: Self::Vector) -> LaneSet;
    /// The lanes in which `a` is at most `b`.
    fn at_most(self, a: Self::Vector, b: Self::Vector) -> LaneSet;

    /// Writes the nodes of some lanes, the first of which has the number `first`, and their vectors one
    /// after the other. What is written after them has no meaning.
    #[inline(always)]
    fn compress(
        self,
        kept: LaneSet,
        first: u32,
        vectors: [Self::Vector; 3],
        nodes: &mut [u32; LANES],
        to: [&mut Lanes; 3],
    ) {
        let mut from = [[0.0; LANES]; 3];
        for axis in 0..3 {
            self.store(vectors[axis], &mut from[axis]);
        }
        let [x, y, z] = to;
        for (place, lane) in lanes(kept).enumerate() {
            nodes[place] = first + lane as u32;
            (x[place], y[place], z[place]) = (from[0][lane], from[1][lane], from[2][lane]);
        }
    }
}

/// A set of lanes, a bit each.
pub(crate) type LaneSet = u16;

/// The lanes of a set, in ascending order.
#[inline(always)]
pub(crate) fn lanes(mut set: LaneSet) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (set != 0).then(|| set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        lane
    })
}

/// The first so many lanes, or all.
#[inline(always)]
pub(crate) fn first_lanes(count: usize) -> LaneSet {
    if count < LANES { (1 << count) - 1 } else { LaneSet::MAX }
}

/// The components x, y and z of [`LANES`] consecutive nodes, where loads and stores are fastest: a load
/// across two cache lines from a store before it can stall.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub(crate) struct Lanes3(pub(crate) [Lanes; 3]);

/// Half of [`LANES`].
pub(crate) const HALF: usize = LANES / 2;

/// So many numbers.
pub(crate) type HalfLanes = [f32; HALF];

/// The components x, y, z of one node and a number of no meaning.
pub(crate) type Quad = [f32; 4];

/// The sum over the lanes, in the order of [`fold_by`].
#[inline(always)]
pub(crate) fn fold(lanes: Lanes) -> f32 {
    fold_by(lanes, |lower, upper| lower + upper)
}

/// Lanes made into one number: the lower half is joined with the upper half until one is left.
#[inline(always)]
pub(crate) fn fold_by(mut lanes: Lanes, join: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for lane in 0..half {
            lanes[lane] = join(lanes[lane], lanes[lane + half]);
        }
        half /= 2;
    }
    lanes[0]
}

/// The least number of a vector that has no NaN.
#[inline(always)]
pub(crate) fn least<I: Isa>(isa: I, vector: I::Vector) -> f32 {
    let mut lanes = [0.0; LANES];
    isa.store(vector, &mut lanes);
    fold_by(lanes, |a, b| if a < b { a } else { b })
}

/// The greatest number of a vector that has no NaN.
#[inline(always)]
pub(crate) fn greatest<I: Isa>(isa: I, vector: I::Vector) -> f32 {
    let mut lanes = [0.0; LANES];
    isa.store(vector, &mut lanes);
    fold_by(lanes, |a, b| if a > b { a } else { b })
}
