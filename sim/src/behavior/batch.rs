//! Which mass–spring bodies of a block are advanced together.
//!
//! How many bodies are side by side, and which, never shows in the results.

use std::any::Any;
use std::cell::RefCell;
use std::cmp::Reverse;
use std::sync::Arc;

use super::abreast::{AdvanceAbreast, MOST, Nodes, seat};
use super::spring_kernel::{Advance, Springs};
use super::{Input, MassSpring, Workspace};
use crate::geometry::Mesh;
use crate::object::Object;
use crate::simd::{HALF, Simd};

/// The bodies that must move on average for a step side by side to cost less than their steps one by
/// one; usually 4.
const WORTH: u64 = 4;

/// The most nodes of a body that is advanced together with others; usually 1,024, with which sixteen
/// bodies fit a second-level cache of 1 MB.
const MOST_NODES: usize = 1_024;

thread_local! {
    /// A thread's, not a block's, so that it is still in the first-level cache at the next block.
    static NODES: RefCell<Nodes> = RefCell::default();
}

/// The nodes of the largest of these objects that may be advanced with others.
pub(crate) fn most_nodes<'o>(objects: impl Iterator<Item = &'o Object>) -> usize {
    let meshes = objects.filter_map(|object| object.geometry.as_mesh());
    let nodes = meshes.map(|mesh| mesh.topology().nodes());
    nodes.filter(|&nodes| nodes <= MOST_NODES).max().unwrap_or(0)
}

/// Makes room on this thread for bodies of so many nodes, so that its first block need not allocate.
pub(crate) fn reserve(nodes: usize) {
    NODES.with_borrow_mut(|own| own.reserve(nodes));
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

/// Begins the update of an object that is a mass–spring body and nothing else: its springs then wait
/// for [`advance`]. `false`, and nothing has happened, for any other object.
pub(crate) fn begin(object: &mut Object, place: usize, input: &mut Input<'_>) -> bool {
    let behavior: &dyn Any = &*object.behavior;
    let Some(behavior) = behavior.downcast_ref::<MassSpring>() else { return false };
    let fits = |mesh: &&mut Mesh| mesh.is_whole() && mesh.topology().nodes() <= MOST_NODES;
    let Some(mesh) = object.geometry.as_mesh_mut().filter(fits) else { return false };
    let springs = behavior.begin(mesh, input);
    let topology = Arc::as_ptr(mesh.topology()).addr();
    input.workspace.waiting.push(Waiting { place, topology, springs });
    true
}

/// Advances the springs of all bodies that wait.
pub(crate) fn advance(objects: &mut [Object], workspace: &mut Workspace, simd: Simd) {
    let mut waiting = std::mem::take(&mut workspace.waiting);
    waiting.sort_unstable_by_key(|body| (body.kind(), Reverse(body.springs.substeps), body.place));
    for mut alike in waiting.chunk_by(|a, b| a.kind() == b.kind()) {
        while let [first, ..] = alike {
            let (now, later) = alike.split_at(together(alike));
            if now.len() > 1 {
                advance_together(now, objects, simd);
            } else if let Some(mesh) = objects[first.place].geometry.as_mesh_mut() {
                advance_alone(mesh, first.springs, workspace, simd);
            }
            alike = later;
        }
    }
    workspace.waiting = waiting;
}

/// How many of the first bodies are best advanced together.
fn together(bodies: &[Waiting]) -> usize {
    let most = &bodies[..bodies.len().min(MOST)];
    let mut lanes = [0; HALF];
    for (place, body) in most.iter().enumerate() {
        let (_, lane) = seat(place);
        lanes[lane] += u64::from(body.springs.substeps);
    }
    let (all, longest) = (lanes.iter().sum::<u64>(), lanes.into_iter().max());
    if all >= WORTH * longest.unwrap_or(0) { most.len() } else { 1 }
}

fn advance_together(bodies: &[Waiting], objects: &mut [Object], simd: Simd) {
    let mut seated = [const { [const { None }; HALF] }; 2];
    for (place, object) in objects.iter_mut().enumerate() {
        if let Some(index) = bodies.iter().position(|body| body.place == place)
            && let Some(mesh) = object.geometry.as_mesh_mut()
        {
            let (turn, lane) = seat(index);
            seated[turn][lane] = Some((mesh.kernel_parts(), bodies[index].springs));
        }
    }
    NODES.with_borrow_mut(|nodes| simd.run(AdvanceAbreast { bodies: seated, nodes }));
}

/// Advances the springs of one body.
pub(super) fn advance_alone(
    mesh: &mut Mesh,
    springs: Springs,
    workspace: &mut Workspace,
    simd: Simd,
) {
    let parts = mesh.kernel_parts();
    let chunks = parts.topology.present().len();
    simd.for_look_up(chunks).run(Advance { parts, nodes: &mut workspace.alone, springs });
}
