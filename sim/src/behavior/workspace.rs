//! What updates need and leave nothing in.

use super::received::Received;
use super::{abreast, batch, spring_kernel};
use crate::block::{Block, Seat};

/// Contact records of one object in one frame for which there is room from the start; usually 120, twice
/// what the densest pile has, so that a frame need not allocate.
pub(crate) const CONTACTS_PER_OBJECT: usize = 120;
/// Other objects that one object touches at once, likewise; usually 24, twice the densest packing's.
const TOUCHED_PER_OBJECT: usize = 24;

/// Memory that updates use. It belongs to a thread, not to a block, so that it is still in the thread's
/// caches when the next block comes.
#[derive(Debug, Default)]
pub struct Workspace {
    /// Empty between two updates.
    pub(crate) received: Received<'static>,
    pub(crate) springs: SpringWork,
    /// Where the objects of a block that is brought into its order were before.
    pub(crate) order: Vec<Seat>,
}

/// What springs are advanced in.
#[derive(Debug, Default)]
pub(crate) struct SpringWork {
    pub(super) alone: spring_kernel::Nodes,
    pub(super) abreast: abreast::Nodes,
    /// Bodies whose springs are left to be advanced, as they come in their block.
    pub(crate) waiting: Vec<batch::Waiting>,
}

/// Objects for which there is room at least: a single one may be touched by more others than usual.
const FEWEST_OBJECTS: usize = 4;

/// How much room the updates of some blocks need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    objects: usize,
    /// Nodes of a body.
    nodes: usize,
    /// Nodes of a body that may be advanced beside others.
    abreast: usize,
}

impl Room {
    /// What these blocks need, now and when their objects are dealt out anew.
    pub(crate) fn of<'b>(blocks: impl Iterator<Item = &'b Block>) -> Self {
        let mut room = Self { objects: FEWEST_OBJECTS, nodes: 0, abreast: 0 };
        for block in blocks {
            room.objects = room.objects.max(block.objects.capacity());
            let meshes = block.objects.iter().filter_map(|object| object.geometry.as_mesh());
            for nodes in meshes.map(|mesh| mesh.topology().nodes()) {
                room.nodes = room.nodes.max(nodes);
                if batch::may_be_abreast(nodes) {
                    room.abreast = room.abreast.max(nodes);
                }
            }
        }
        room
    }

    /// Contact records of one block in one frame, also those within it.
    pub(crate) fn contacts(&self) -> usize {
        self.objects * CONTACTS_PER_OBJECT
    }
}

impl Workspace {
    /// Memory that usually need not grow.
    pub(crate) fn with_room(room: Room) -> Self {
        let mut workspace = Self::default();
        let Self { received, springs, order } = &mut workspace;
        received.reserve(room.objects, room.objects * TOUCHED_PER_OBJECT);
        order.reserve(room.objects);
        springs.waiting.reserve(room.objects);
        springs.alone.reserve(room.nodes);
        springs.abreast.reserve(room.abreast);
        if room.abreast > 0 {
            batch::measure_registers();
        }
        workspace
    }
}
