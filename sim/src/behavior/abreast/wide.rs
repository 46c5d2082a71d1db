//! What all lanes cost, where registers hold as many, beside half of them: measured, for machines differ.

use std::iter;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use super::{AdvanceAbreast, Body, Nodes, WIDEST};
use crate::behavior::spring_kernel::Springs;
use crate::geometry::{Extent, Mesh, Topology, edges, icosphere};
use crate::simd::{HALF, Simd};

/// The least that it may be: all lanes do half of them, too. What came to less was disturbed.
const LEAST: f32 = 1.0;
/// The most: at twice as much half of them are done one after the other.
const MOST: f32 = 2.0;
/// What it is taken for where it is not measured; usually 1.5.
const USUAL: f32 = 1.5;
/// Measured once, and the same from then on.
static COST: OnceLock<f32> = OnceLock::new();
/// So often both are timed, by turns, of which the fastest counts: none of a shared core's pauses; usually 16.
const ROUNDS: usize = 16;
/// Substeps of each body; usually 10, the most of a particle.
const SUBSTEPS: u32 = 10;
/// Of what they are advanced by: bodies at rest stay as they are.
const SPRINGS: Springs = Springs {
    damping: 0.0,
    stiffness: 60.0,
    center_stiffness: 300.0,
    gravity: [0.0; 3],
    time: 1.0 / 240.0,
    substeps: SUBSTEPS,
};

/// How many times as long bodies in all lanes take as in half of them, if that has been measured: 1.1 or 1.2 where
/// instructions are as fast for sixteen numbers as for eight, up to 1.9 elsewhere.
pub(in super::super) fn cost_of_all_lanes() -> f32 {
    COST.get().copied().unwrap_or(USUAL)
}

/// Measures it, unless that has been done: in less than a millisecond, and waiting for who does already.
pub(in super::super) fn measure_cost_of_all_lanes() {
    COST.get_or_init(|| measured(Simd::detect()).unwrap_or(USUAL).clamp(LEAST, MOST));
}

fn measured(simd: Simd) -> Option<f32> {
    let (mut bodies, mut nodes) = (at_rest()?, Nodes::default());
    let mut fastest = [Duration::MAX; 2];
    for _ in 0..ROUNDS {
        for (lanes, fastest) in [HALF, WIDEST].into_iter().zip(&mut fastest) {
            let begin = Instant::now();
            advance(&mut bodies[..lanes], &mut nodes, simd);
            *fastest = begin.elapsed().min(*fastest);
        }
    }
    let [half, all] = fastest.map(|took| took.as_secs_f32());
    // Nothing is known of a clock that saw no time go by.
    (half > 0.0).then(|| all / half)
}

/// As many bodies as there are lanes, made as particles are.
fn at_rest() -> Option<Vec<Mesh>> {
    let (places, triangles) = icosphere(0.1);
    let edges = edges(&triangles);
    let topology = Topology::new(&places, triangles, &edges, true).ok()?;
    let first = Mesh::new(Arc::new(topology), &places, &vec![0.01; places.len()], 0.03).ok()?;
    iter::repeat_with(|| first.another(&places).ok()).take(WIDEST).collect()
}

/// A frame of these bodies, each in a lane.
fn advance(bodies: &mut [Mesh], nodes: &mut Nodes, simd: Simd) {
    let mut extents = [Extent::EMPTY; WIDEST];
    let mut seated = [const { [const { None }; WIDEST] }; 2];
    for (lane, (mesh, extent)) in bodies.iter_mut().zip(&mut extents).enumerate() {
        seated[0][lane] = Some(Body { parts: mesh.kernel_parts(), springs: SPRINGS, extent });
    }
    simd.run(AdvanceAbreast { bodies: seated, nodes });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_lanes_cost_can_be_measured() {
        let cost = measured(Simd::detect()).expect("bodies, and a clock");
        assert!(cost > 0.0 && cost.is_finite(), "{cost}");
        measure_cost_of_all_lanes();
        assert!((LEAST..=MOST).contains(&cost_of_all_lanes()));
    }

    #[test]
    fn bodies_of_a_measurement_stay_at_rest() {
        for simd in Simd::available() {
            let mut bodies = at_rest().expect("particles");
            let first = bodies[0].clone();
            advance(&mut bodies[..simd.width()], &mut Nodes::default(), simd);
            for body in &bodies {
                assert_eq!(body.positions, first.positions);
                assert_eq!(body.velocities, first.velocities);
            }
        }
    }
}
