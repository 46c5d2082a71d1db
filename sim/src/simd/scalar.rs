//! Lanes as plain arrays, which the compiler makes into whatever the target's baseline has.

use super::{Isa, LaneSet, Lanes3, Quad, fold};
use crate::geometry::{LANES, Lanes};

#[derive(Clone, Copy)]
pub(super) struct Scalar;

#[inline(always)]
fn each(a: Lanes, b: Lanes, operation: impl Fn(f32, f32) -> f32) -> Lanes {
    let mut result = [0.0; LANES];
    for lane in 0..LANES {
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

impl Isa for Scalar {
    type Vector = Lanes;
    type Table<'a> = &'a [Quad];

    #[inline(always)]
    fn splat(self, value: f32) -> Lanes {
        [value; LANES]
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Lanes {
        *lanes
    }

    #[inline(always)]
    fn store(self, vector: Lanes, lanes: &mut Lanes) {
        *lanes = vector;
    }

    #[inline(always)]
    fn add(self, a: Lanes, b: Lanes) -> Lanes {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: Lanes, b: Lanes) -> Lanes {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: Lanes, b: Lanes) -> Lanes {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, a: Lanes, b: Lanes) -> Lanes {
        each(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn sqrt(self, a: Lanes) -> Lanes {
        a.map(f32::sqrt)
    }

    #[inline(always)]
    fn sum(self, vector: Lanes) -> f32 {
        fold(vector)
    }

    #[inline(always)]
    fn min(self, a: Lanes, b: Lanes) -> Lanes {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: Lanes, b: Lanes) -> Lanes {
        each(a, b, |a, b| if a > b { a } else { b })
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
