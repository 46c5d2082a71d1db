//! Lanes as plain arrays, which the compiler makes into whatever the target's baseline has.

use super::{Isa, Quad};
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

impl Isa for Scalar {
    type Vector = Lanes;
    type Table<'a> = [&'a [Lanes]; 3];

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
    fn table<'a>(self, components: [&'a [Lanes]; 3], _: &'a mut Vec<Quad>) -> [&'a [Lanes]; 3] {
        components
    }

    #[inline(always)]
    fn look_up(self, table: [&[Lanes]; 3], nodes: &[u32; LANES]) -> [Lanes; 3] {
        // One length for all three, so that one comparison a node is enough.
        let len = table[0].len();
        let [x, y, z] = table.map(|component| component[..len].as_flattened());
        let mut found = [[0.0; LANES]; 3];
        for (lane, &node) in nodes.iter().enumerate() {
            let node = node as usize;
            found[0][lane] = x[node];
            found[1][lane] = y[node];
            found[2][lane] = z[node];
        }
        found
    }
}
