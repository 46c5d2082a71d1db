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

/// The most nodes of a body that is advanced together with others; usually 1,024, with which sixteen
/// bodies fit a second-level cache of 1 MB, or half as many in twice as many lanes.
const MOST_NODES: usize = 1_024;

/// What a body costs by itself before its first substep, in its substeps; usually 3.4.
const ALONE: f32 = 3.4;
/// What up to [`HALF`] bodies side by side cost before their first substep, likewise; usually 16.
const TURN: f32 = 16.0;
/// What a substep of theirs costs, likewise; usually 4.8.
const STEP: f32 = 4.8;
/// What a body costs where all lanes are full, before its first substep and for each, likewise; usually 2.9 and 0.48.
const FULL: [f32; 2] = [2.9, 0.48];
/// The fewest bodies that may be better off side by side than one by one, by what they cost; usually 5.
const FEWEST: usize = 5;

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

/// How many of these objects may be advanced together, if all may but rigid ones, whose updates take next to no time; 0
/// otherwise.
pub(crate) fn alike<'o>(objects: impl Iterator<Item = &'o Object>) -> usize {
    let mut bodies = objects.filter(|object| object.geometry.as_rigid().is_none()).map(kind);
    let Some(Some(first)) = bodies.next() else { return 0 };
    bodies.try_fold(1, |count, kind| (kind == Some(first)).then_some(count + 1)).unwrap_or(0)
}

/// The topology of an object that may be advanced together with others of its kind, and whether it is damped.
fn kind(object: &Object) -> Option<(usize, bool)> {
    let nodes = object.geometry.as_mesh()?.topology().nodes();
    let (topology, is_damped, _) = Order::of(object).springs?;
    may_be_abreast(nodes).then_some((topology, is_damped))
}

/// What a body's part is of what all that are advanced together take, by its substeps; of any other object nothing is known.
pub(crate) fn weight(object: &Object) -> Option<f32> {
    let [body, substep] = FULL;
    Order::of(object).springs.map(|(.., Reverse(substeps))| body + substep * substeps as f32)
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
            let registers = if is_small { Registers::of(simd) } else { Registers::SHORT };
            let (count, lanes) = together(alike, registers);
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

/// What bodies side by side are computed with.
#[derive(Clone, Copy)]
struct Registers {
    /// How many lanes one holds.
    lanes: usize,
    /// How many times as much a turn and a substep cost in all of them as in [`HALF`].
    cost: f32,
}

impl Registers {
    const SHORT: Self = Self { lanes: HALF, cost: 1.0 };

    fn of(simd: Simd) -> Self {
        match simd.width() {
            HALF => Self::SHORT,
            lanes => Self { lanes, cost: abreast::cost_of_all_lanes() },
        }
    }
}

/// Whether this machine has registers of more than [`HALF`] lanes.
pub(crate) fn has_long_registers() -> bool {
    Simd::detect().width() > HALF
}

/// Measures what is to be known of this machine's registers, unless it is known: ahead of frames, in which it is not.
pub(super) fn measure_registers() {
    if has_long_registers() {
        abreast::measure_cost_of_all_lanes();
    }
}

/// How many of the first bodies are best advanced together, and in how many lanes, of which there are at most
/// as many as registers hold: those that cost least of what they would in full lanes.
fn together(bodies: &[Waiting], registers: Registers) -> (usize, usize) {
    let width = registers.lanes;
    if bodies.len() < FEWEST {
        return (1, HALF);
    }
    // Nothing is cheaper than lanes that are full to the end.
    if let Some(last) = bodies.get(2 * width - 1)
        && bodies[0].springs.substeps / 2 <= last.springs.substeps
    {
        return (2 * width, width);
    }
    let mut best = Filling::alone(bodies);
    for (most, lanes) in [(HALF, HALF), (2 * HALF, HALF), (width, width), (2 * width, width)] {
        let filling = Filling::of(&bodies[..bodies.len().min(most)], lanes, registers);
        if filling.price < best.price {
            best = filling;
        }
    }
    (best.bodies, best.lanes)
}

/// What is done if so many bodies are advanced next.
struct Filling {
    bodies: usize,
    lanes: usize,
    /// What they cost, over what they would in full lanes.
    price: f32,
}

impl Filling {
    fn new(bodies: &[Waiting], lanes: usize, cost: f32) -> Self {
        let [body, substep] = FULL;
        let substeps: u64 = bodies.iter().map(|body| u64::from(body.springs.substeps)).sum();
        let full = body * bodies.len() as f32 + substep * substeps as f32;
        Self { bodies: bodies.len(), lanes, price: cost / full }
    }

    /// The first of these, by itself.
    fn alone(bodies: &[Waiting]) -> Self {
        Self::new(&bodies[..1], HALF, ALONE + bodies[0].springs.substeps as f32)
    }

    /// All of these, two at most for each of so many lanes.
    fn of(bodies: &[Waiting], lanes: usize, registers: Registers) -> Self {
        let mut substeps = [0; WIDEST];
        for (index, body) in bodies.iter().enumerate() {
            let (_, lane) = seat(index, lanes);
            substeps[lane] += u64::from(body.springs.substeps);
        }
        // As many as the longest lane has.
        let steps = substeps.into_iter().max().unwrap_or(0);
        let turns = bodies.len().div_ceil(lanes);
        let times = if lanes > HALF { registers.cost } else { 1.0 };
        Self::new(bodies, lanes, times * (TURN * turns as f32 + STEP * steps as f32))
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
    use glam::Vec3;

    use super::super::Fixed;
    use super::*;
    use crate::blocking::Grain;
    use crate::executor::{Executor, SerialExecutor};
    use crate::geometry::{Geometry, Rigid, Topology};
    use crate::object::Group;
    use crate::render::NullRenderer;
    use crate::scene::ParticleScene;

    /// How many bodies that wait with these substeps are advanced first, and in how many lanes of 16, which cost so many
    /// times as much as half of them.
    fn first_at(cost: f32, substeps: impl IntoIterator<Item = u32>) -> (usize, usize) {
        let springs = Springs {
            damping: 0.0,
            stiffness: 1.0,
            center_stiffness: 1.0,
            gravity: [0.0; 3],
            time: 0.01,
            substeps: 1,
        };
        let body =
            |substeps| Waiting { place: 0, topology: 0, springs: Springs { substeps, ..springs } };
        let registers = Registers { lanes: 2 * HALF, cost };
        together(&substeps.into_iter().map(body).collect::<Vec<_>>(), registers)
    }

    /// The same where all lanes cost half as much again as half of them.
    fn first_of(substeps: impl IntoIterator<Item = u32>) -> (usize, usize) {
        first_at(1.5, substeps)
    }

    #[test]
    fn as_many_are_side_by_side_as_are_cheapest() {
        // From 10 to 1, as particles have.
        let mixed = |count: u32| (0..count).map(move |body| 10 - 10 * body / count);
        assert_eq!(first_of(mixed(4)), (1, HALF));
        assert_eq!(first_of(mixed(16)), (16, HALF));
        assert_eq!(first_of(mixed(18)), (16, HALF), "two are cheaper by themselves than a turn");
        assert_eq!(first_of(mixed(30)), (30, 2 * HALF));
        assert_eq!(first_of(mixed(100)), (32, 2 * HALF));
        assert_eq!(first_of([8; 16]), (16, 2 * HALF));
        assert_eq!(first_of([8; 18]), (16, 2 * HALF));
        assert_eq!(first_of([8; 7]), (7, HALF));
        assert_eq!(first_of([1; 5]), (5, HALF), "a turn is cheaper than five bodies by themselves");
        assert_eq!(first_of([2, 1, 1, 1, 1]), (1, HALF), "but not if most lanes wait for one");
        assert_eq!(first_at(1.2, [8; 12]), (12, 2 * HALF));
        assert_eq!(first_at(1.9, [8; 12]), (8, HALF), "where registers of 16 are hardly faster");
        for others in [15, 31, 100] {
            let one_long = std::iter::once(1_000).chain((0..others).map(|_| 1));
            assert_eq!(first_of(one_long), (1, HALF), "{others} others");
        }
    }

    /// How many are alike of bodies with these topologies and dampings, and a wall.
    fn alike_of(bodies: &[(&Arc<Topology>, f32)]) -> usize {
        let object = |(id, (topology, damping)): (usize, &(&Arc<Topology>, f32))| {
            let nodes = topology.nodes();
            let mesh =
                Mesh::new(Arc::clone(topology), &vec![Vec3::ZERO; nodes], &vec![1.0; nodes], 0.1);
            let springs = MassSpring::new(1.0, *damping, 1).expect("positive values");
            let geometry = Geometry::Mesh(mesh.expect("a body"));
            Object::new(ObjectId(id as u32), Group(0), geometry, springs)
        };
        let wall = Geometry::Rigid(Rigid::wall(Vec3::ZERO, Vec3::Y));
        let wall = Object::new(ObjectId(bodies.len() as u32), Group(0), wall, Fixed);
        let objects: Vec<Object> = bodies.iter().enumerate().map(object).chain([wall]).collect();
        alike(objects.iter())
    }

    #[test]
    fn bodies_of_one_topology_and_all_damped_or_none_are_alike() {
        let topology = |nodes: usize| {
            let places: Vec<Vec3> = (0..nodes).map(|node| Vec3::X * node as f32).collect();
            Arc::new(Topology::new(&places, Vec::new(), &[[0, 1]], false).expect("a body"))
        };
        let [one, other, most, more] = [9, 9, MOST_NODES, MOST_NODES + 1].map(topology);
        assert_eq!(alike_of(&[]), 0, "a wall");
        assert_eq!(alike_of(&[(&one, 0.0); 3]), 3);
        assert_eq!(alike_of(&[(&one, 0.1), (&one, 0.2)]), 2);
        assert_eq!(alike_of(&[(&one, 0.1), (&one, 0.0)]), 0);
        assert_eq!(alike_of(&[(&one, 0.0), (&other, 0.0)]), 0);
        assert_eq!(alike_of(&[(&most, 0.0); 2]), 2);
        assert_eq!(alike_of(&[(&more, 0.0); 2]), 0);
    }

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
