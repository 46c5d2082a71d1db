//! Lanes as plain arrays, which the compiler makes into whatever the target's baseline has.

use super::{Arithmetic, HALF, HalfIsa, HalfLanes, Isa, LaneSet, Lanes3, Quad, fold};
use crate::geometry::{LANES, Lanes};

/// Lanes of which there are so many.
#[derive(Clone, Copy)]
pub(super) struct Plain<const N: usize>;

/// All of them.
pub(super) type Scalar = Plain<LANES>;

#[inline(always)]
fn each<const N: usize>(a: [f32; N], b: [f32; N], operation: impl Fn(f32, f32) -> f32) -> [f32; N] {
    let mut result = [0.0; N];
    for lane in 0..N {
        result[lane] = operation(a[lane], b[lane]);
    }
    result
}

#[inline(always)]
fn set(a: Lanes, b: Lanes, holds: impl Fn(f32, f32) -> bool) -> LaneSet {
    let mut set = 0;
    for lane in 0..LANES {
        set |= LaneSet::from(holds(a[lane], b[lane])) << lane;
    }
    set
}

impl<const N: usize> Arithmetic for Plain<N> {
    type Lanes = [f32; N];
    type Vector = [f32; N];

    #[inline(always)]
    fn splat(self, value: f32) -> [f32; N] {
        [value; N]
    }

    #[inline(always)]
    fn load(self, lanes: &[f32; N]) -> [f32; N] {
        *lanes
    }

    #[inline(always)]
    fn store(self, vector: [f32; N], lanes: &mut [f32; N]) {
        *lanes = vector;
    }

    #[inline(always)]
    fn add(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        each(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn sqrt(self, a: [f32; N]) -> [f32; N] {
        a.map(f32::sqrt)
    }

    #[inline(always)]
    fn min(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: [f32; N], b: [f32; N]) -> [f32; N] {
        each(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn choose(self, chooser: [f32; N], a: [f32; N], b: [f32; N]) -> [f32; N] {
        let mut chosen = b;
        for lane in 0..N {
            let set = chooser[lane].to_bits();
            chosen[lane] = f32::from_bits(set & a[lane].to_bits() | !set & b[lane].to_bits());
        }
        chosen
    }
}

impl HalfIsa for Plain<HALF> {
    #[inline(always)]
    fn transpose(self, rows: [HalfLanes; HALF]) -> [HalfLanes; HALF] {
        let mut columns = rows;
        for (row, values) in rows.iter().enumerate() {
            for (column, &value) in values.iter().enumerate() {
                columns[column][row] = value;
            }
        }
        columns
    }
}

impl Isa for Scalar {
    type Half = Plain<HALF>;
    type Table<'a> = &'a [Quad];

    #[inline(always)]
    fn half(self) -> Plain<HALF> {
        Plain
    }

    #[inline(always)]
    fn sum(self, vector: Lanes) -> f32 {
        fold(vector)
    }

    #[inline(always)]
    fn less(self, a: Lanes, b: Lanes) -> LaneSet {
        set(a, b, |a, b| a < b)
    }

    #[inline(always)]
    fn at_most(self, a: Lanes, b: Lanes) -> LaneSet {
        set(a, b, |a, b| a <= b)
    }

    #[inline(always)]
    fn table<'a>(self, chunks: &[Lanes3], room: &'a mut Vec<Quad>) -> &'a [Quad] {
        room.clear();
        for Lanes3([x, y, z]) in chunks {
            room.extend(x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z, 0.0]));
        }
        room
    }

    #[inline(always)]
    unsafe fn look_up(self, table: &[Quad], nodes: &[u32; LANES]) -> [Lanes; 3] {
        let mut found = [[0.0; LANES]; 3];
        for (lane, &node) in nodes.iter().enumerate() {
            let [x, y, z, _] = table[node as usize];
            found[0][lane] = x;
            found[1][lane] = y;
            found[2][lane] = z;
        }
        found
    }
}
