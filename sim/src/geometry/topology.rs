//! What the nodes of a deformable body are joined by; shared by all bodies of one make.

use glam::Vec3;
use thiserror::Error;

use super::vectors::{LANES, Lanes, in_lanes};

/// A spring between two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// The two nodes it joins.
    pub nodes: [u32; 2],
    /// Its length at rest, in metres.
    pub rest: f32,
}

/// Why a topology cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum TopologyError {
    /// A triangle or a spring names a node that the body does not have.
    #[error("node {node} is named, but the body has {nodes} nodes")]
    NoSuchNode {
        /// The node named.
        node: u32,
        /// The number of nodes of the body.
        nodes: usize,
    },
    /// A node is nowhere, or so far from others that what joins them has no finite length.
    #[error("the position of node {node} is not finite, or too far from others for springs")]
    Position {
        /// The node.
        node: u32,
    },
    /// A spring joins a node to itself.
    #[error("a spring joins node {node} to itself")]
    Loop {
        /// The node.
        node: u32,
    },
    /// The body has more nodes than a contact record can name.
    #[error("{nodes} nodes are more than the {} a body may have", Topology::MAX_NODES)]
    TooManyNodes {
        /// The number of nodes asked for.
        nodes: usize,
    },
}

/// For [`LANES`] consecutive nodes one neighbour each.
///
/// A node with fewer neighbours than its lane mates is its own neighbour in the slots left over: a
/// spring without length pulls at nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Slot {
    pub(crate) neighbour: [u32; LANES],
    pub(crate) rest: Lanes,
}

/// The triangles and springs of a deformable body.
///
/// Springs are kept a second time as a node-centred neighbour table: each node gathers the forces of
/// its own springs, so that no two lanes ever write to the same node.
#[derive(Clone, Debug, PartialEq)]
pub struct Topology {
    nodes: usize,
    triangles: Vec<[u32; 3]>,
    springs: Vec<Spring>,
    slots: Vec<Slot>,
    /// Where the slots of each chunk of nodes begin; one entry more than there are chunks.
    first_slot: Vec<usize>,
    /// For bodies with springs to their centre: each node's distance to it at rest, in metres.
    center_rest: Option<Vec<Lanes>>,
    /// 1 for each node, 0 for the padding.
    present: Vec<Lanes>,
}

impl Topology {
    /// The most nodes a body may have; greater node numbers have a meaning of their own in contact
    /// records.
    pub const MAX_NODES: usize = 1 << 24;

    /// Joins the nodes at `positions` (metres, at rest) by springs along `edges` and, where
    /// `to_center` says so, by one spring from each node to the mean of all nodes.
    ///
    /// # Errors
    /// A triangle or an edge that names a node past the last, an edge from a node to itself, a position that is not
    /// finite or so far away that a spring's length is not, or more than [`Topology::MAX_NODES`] nodes.
    pub fn new(
        positions: &[Vec3],
        triangles: Vec<[u32; 3]>,
        edges: &[[u32; 2]],
        to_center: bool,
    ) -> Result<Self, TopologyError> {
        let nodes = positions.len();
        if nodes > Self::MAX_NODES {
            return Err(TopologyError::TooManyNodes { nodes });
        }
        let named = triangles.iter().flatten().chain(edges.iter().flatten());
        if let Some(&node) = named.into_iter().find(|&&node| node as usize >= nodes) {
            return Err(TopologyError::NoSuchNode { node, nodes });
        }
        if let Some(&[node, _]) = edges.iter().find(|[a, b]| a == b) {
            return Err(TopologyError::Loop { node });
        }
        let length = |[a, b]: [u32; 2]| (positions[a as usize] - positions[b as usize]).length();
        let springs: Vec<Spring> =
            edges.iter().map(|&nodes| Spring { nodes, rest: length(nodes) }).collect();
        let center_rest = to_center.then(|| distances_to_mean(positions));
        let nowhere = positions.iter().position(|position| !position.is_finite());
        let endless = springs.iter().find(|spring| !spring.rest.is_finite());
        let distances = center_rest.as_deref().unwrap_or_default().as_flattened();
        let far = distances.iter().position(|distance| !distance.is_finite());
        let node = nowhere.or(far).map(|node| node as u32);
        if let Some(node) = node.or(endless.map(|spring| spring.nodes[0])) {
            return Err(TopologyError::Position { node });
        }
        let (slots, first_slot) = neighbour_table(nodes, &springs);
        let present = in_lanes(std::iter::repeat_n(1.0, nodes), nodes);
        Ok(Self { nodes, triangles, springs, slots, first_slot, center_rest, present })
    }

    /// The number of nodes.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// The triangles of the surface, counter-clockwise as seen from outside.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The springs between nodes.
    #[must_use]
    pub fn springs(&self) -> &[Spring] {
        &self.springs
    }

    /// The number of all springs, those to the centre included.
    #[must_use]
    pub fn spring_count(&self) -> usize {
        self.springs.len() + if self.center_rest.is_some() { self.nodes } else { 0 }
    }

    /// Each node's distance to the mean of all nodes at rest, in metres, where springs lead there.
    #[must_use]
    pub fn center_rest(&self) -> Option<&[f32]> {
        self.center_rest.as_ref().map(|rest| &rest.as_flattened()[..self.nodes])
    }

    /// The neighbours of the nodes of one chunk of lanes.
    pub(crate) fn slots(&self, chunk: usize) -> &[Slot] {
        &self.slots[self.first_slot[chunk]..self.first_slot[chunk + 1]]
    }

    /// As [`Topology::center_rest`], in whole lanes.
    pub(crate) fn center_lanes(&self) -> Option<&[Lanes]> {
        self.center_rest.as_deref()
    }

    /// 1 for each node, 0 for the padding.
    pub(crate) fn present(&self) -> &[Lanes] {
        &self.present
    }
}

/// The edges of a surface, each once, the lower node first, in ascending order.
#[must_use]
pub fn edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let sides = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let mut edges: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

fn neighbour_table(nodes: usize, springs: &[Spring]) -> (Vec<Slot>, Vec<usize>) {
    let mut neighbours: Vec<Vec<(u32, f32)>> = vec![Vec::new(); nodes];
    for &Spring { nodes: [a, b], rest } in springs {
        neighbours[a as usize].push((b, rest));
        neighbours[b as usize].push((a, rest));
    }
    let (mut slots, mut first_slot) = (Vec::new(), vec![0]);
    for (chunk, lists) in neighbours.chunks(LANES).enumerate() {
        let depth = lists.iter().map(Vec::len).max().unwrap_or(0);
        for row in 0..depth {
            let own = std::array::from_fn(|lane| (chunk * LANES + lane) as u32);
            let mut slot = Slot { neighbour: own, rest: [0.0; LANES] };
            for (lane, list) in lists.iter().enumerate() {
                if let Some(&(neighbour, rest)) = list.get(row) {
                    slot.neighbour[lane] = neighbour;
                    slot.rest[lane] = rest;
                }
            }
            slots.push(slot);
        }
        first_slot.push(slots.len());
    }
    (slots, first_slot)
}

fn distances_to_mean(positions: &[Vec3]) -> Vec<Lanes> {
    let mean = positions.iter().copied().sum::<Vec3>() / positions.len().max(1) as f32;
    in_lanes(positions.iter().map(|&position| (position - mean).length()), positions.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_length_is_refused() {
        let refused = |places: &[Vec3], to_center| {
            Topology::new(places, Vec::new(), &[[0, 1]], to_center).expect_err("too far")
        };
        for (places, to_center, node) in [
            ([Vec3::ZERO, Vec3::X * f32::NAN], false, 1),
            ([Vec3::Y * f32::INFINITY, Vec3::ZERO], true, 0),
            ([Vec3::ZERO, Vec3::splat(1e30)], false, 0),
        ] {
            assert_eq!(refused(&places, to_center), TopologyError::Position { node }, "{places:?}");
        }
        let far = [Vec3::ZERO, Vec3::splat(1e30)];
        let to_center = Topology::new(&far, Vec::new(), &[], true);
        assert_eq!(to_center, Err(TopologyError::Position { node: 0 }));
        assert!(Topology::new(&far, Vec::new(), &[], false).is_ok());
    }
}
