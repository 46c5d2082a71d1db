//! Which mass–spring bodies of a block are advanced together.
//!
//! How many bodies are side by side, and which, never shows in the results.

use std::any::Any;
use std::cmp::Reverse;
use std::sync::Arc;

use super::abreast::{self, AdvanceAbreast, Body, WIDEST, seat};
use super::spring_kernel::{self, Advance, Springs};
use super::workspace::SpringWork;
use super::{Input, MassSpring};
use crate::geometry::{Extent, Mesh};
use crate::object::{Object, ObjectId};
use crate::simd::{HALF, Simd};

/// The bodies that must move on average for a step side by side to cost less than their steps one by
/// one; usually 4.
const WORTH: u64 = 4;

/// The most nodes of a body that is advanced together with others; usually 1,024, with which sixteen
/// bodies fit a second-level cache of 1 MB, or half as many in twice as many lanes.
const MOST_NODES: usize = 1_024;

/// What a step in all lanes costs, if a register holds them, over one in half of them, as a fraction; usually 5/4.
const WIDE_STEP: [u64; 2] = [5, 4];

/// Whether a body of so many nodes may be advanced together with others.
pub(super) fn may_be_abreast(nodes: usize) -> bool {
    nodes <= MOST_NODES
}

/// A body whose springs are left to be advanced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Waiting {
    /// Where the object is among those of its block.
    pub(crate) place: usize,
    /// Where its topology is in memory.
    topology: usize,
    springs: Springs,
}

impl Waiting {
    /// Bodies of equal kinds can be side by side.
    fn kind(&self) -> (usize, bool) {
        (self.topology, self.springs.damping > 0.0)
    }
}

/// The order in which a block has its objects from an update on: those that are advanced together one after the other,
/// and each with what makes as many substeps, as far as they stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Order {
    /// Where a body's topology is in memory, whether it is damped, and its substeps.
    springs: Option<(usize, bool, Reverse<u32>)>,
    id: ObjectId,
}

impl Order {
    pub(crate) fn of(object: &Object) -> Self {
        let behavior: &dyn Any = &*object.behavior;
        let body = behavior.downcast_ref::<MassSpring>().zip(object.geometry.as_mesh());
        let springs = body.map(|(behavior, mesh)| {
            let topology = Arc::as_ptr(mesh.topology()).addr();
            (topology, behavior.is_damped(), Reverse(behavior.substeps()))
        });
        Self { springs, id: object.id() }
    }
}

/// Begins the update of an object that is a mass–spring body and nothing else: its springs then wait
/// for [`advance`]. `false`, and nothing has happened, for any other object.
pub(crate) fn begin(object: &mut Object, place: usize, input: &mut Input<'_>) -> bool {
    let behavior: &dyn Any = &*object.behavior;
    let Some(behavior) = behavior.downcast_ref::<MassSpring>() else { return false };
    let fits = |mesh: &&mut Mesh| mesh.is_whole() && may_be_abreast(mesh.topology().nodes());
    let Some(mesh) = object.geometry.as_mesh_mut().filter(fits) else { return false };
    let springs = behavior.begin(mesh, input);
    let topology = Arc::as_ptr(mesh.topology()).addr();
    input.springs.waiting.push(Waiting { place, topology, springs });
    true
}

/// Advances the springs of all bodies that wait to this frame, and brings up to date where these are.
pub(crate) fn advance(objects: &mut [Object], work: &mut SpringWork, frame: u64, simd: Simd) {
    let SpringWork { waiting, alone, abreast } = work;
    for mut alike in waiting.chunk_by(|a, b| a.kind() == b.kind()) {
        while let [first, ..] = alike {
            let object = &mut objects[first.place];
            let Some(mesh) = object.geometry.as_mesh_mut() else { break };
            let is_small = mesh.topology().nodes() <= MOST_NODES / 2;
            let (count, lanes) = together(alike, if is_small { simd.width() } else { HALF });
            let (now, later) = alike.split_at(count);
            if now.len() > 1 {
                let extents = advance_together(now, lanes, objects, abreast, simd);
                for (body, extent) in now.iter().zip(extents) {
                    objects[body.place].settle(frame, extent);
                }
            } else {
                advance_alone(mesh, first.springs, alone, simd);
                object.refresh(frame, simd);
            }
            alike = later;
        }
    }
    waiting.clear();
}

/// How many of the first bodies are best advanced together, and in how many lanes, of which there are at most
/// `width`.
fn together(bodies: &[Waiting], width: usize) -> (usize, usize) {
    let half = Filling::of(bodies, HALF);
    let [cost, cost_of_half] = WIDE_STEP;
    if width > HALF {
        let all = Filling::of(bodies, width);
        if all.substeps * half.steps * cost_of_half > half.substeps * all.steps * cost {
            return (all.bodies, width);
        }
    }
    if half.substeps >= WORTH * half.steps { (half.bodies, HALF) } else { (1, HALF) }
}

/// What is done if as many bodies as there is room for are advanced together.
struct Filling {
    bodies: usize,
    /// Of all of them.
    substeps: u64,
    /// As many as the longest lane has substeps.
    steps: u64,
}

impl Filling {
    fn of(bodies: &[Waiting], lanes: usize) -> Self {
        let bodies = &bodies[..bodies.len().min(2 * lanes)];
        let mut substeps = [0; WIDEST];
        for (index, body) in bodies.iter().enumerate() {
            let (_, lane) = seat(index, lanes);
            substeps[lane] += u64::from(body.springs.substeps);
        }
        let steps = substeps.into_iter().max().unwrap_or(0);
        Self { bodies: bodies.len(), substeps: substeps.into_iter().sum(), steps }
    }
}

/// Says where each of them is then.
fn advance_together(
    bodies: &[Waiting],
    lanes: usize,
    objects: &mut [Object],
    nodes: &mut abreast::Nodes,
    simd: Simd,
) -> [Extent; 2 * WIDEST] {
    let mut extents = [Extent::EMPTY; 2 * WIDEST];
    let mut objects = objects.iter_mut();
    let mut next = 0;
    let mut seated = [const { [const { None }; WIDEST] }; 2];
    for (index, (body, extent)) in bodies.iter().zip(&mut extents).enumerate() {
        let object = objects.nth(body.place - next);
        next = body.place + 1;
        if let Some(mesh) = object.and_then(|object| object.geometry.as_mesh_mut()) {
            let (turn, lane) = seat(index, lanes);
            let (parts, springs) = (mesh.kernel_parts(), body.springs);
            seated[turn][lane] = Some(Body { parts, springs, extent });
        }
    }
    simd.run(AdvanceAbreast { bodies: seated, nodes });
    extents
}

/// Advances the springs of one body.
pub(super) fn advance_alone(
    mesh: &mut Mesh,
    springs: Springs,
    nodes: &mut spring_kernel::Nodes,
    simd: Simd,
) {
    let parts = mesh.kernel_parts();
    let chunks = parts.topology.present().len();
    simd.for_look_up(chunks).run(Advance { parts, nodes, springs });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocking::Grain;
    use crate::executor::{Executor, SerialExecutor};
    use crate::render::NullRenderer;
    use crate::scene::ParticleScene;

    #[test]
    fn bodies_side_by_side_are_measured_as_one_by_itself() {
        for simd in Simd::available() {
            // With 100 some lanes have two, some blocks a body that is by itself.
            for objects in [70, 100, 161] {
                let mut scene = ParticleScene::new(objects).build().expect("a valid scene");
                scene.stages.simd = simd;
                let mut executor =
                    SerialExecutor::new(scene, Grain::Spatial).expect("a valid scene");
                let advanced = executor.advance(3, &mut NullRenderer::new(), &mut |_| ());
                advanced.expect("nothing can be full");
                executor.visit(&mut |object| {
                    let (known, measured) =
                        (object.interaction_extent(), object.geometry.extent(simd));
                    assert_eq!(known, measured, "{:?} of {objects}", object.id());
                });
            }
        }
    }
}
