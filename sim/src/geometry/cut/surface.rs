//! A surface that is being cut, and the elementary changes of it.

use glam::{DVec3, Vec3};

use super::{BORDER_SNAP, SNAP};

/// Where a node comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Birth {
    /// On the edge between two nodes, at a share of the way from the first.
    Between([u32; 2], f32),
    /// In a triangle, by its corners' shares.
    Inside([u32; 3], [f32; 3]),
    /// The other side of a cut: a copy of a node.
    Copy(u32),
}

/// A node of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Node {
    /// In the rest shape, in metres.
    pub(crate) rest: Vec3,
    /// In metres.
    pub(crate) position: Vec3,
    /// In metres per second.
    pub(crate) velocity: Vec3,
}

impl Node {
    fn mix<const N: usize>(nodes: [Self; N], shares: [f32; N]) -> Self {
        let mix = |of: fn(&Self) -> Vec3| {
            nodes.iter().zip(shares).map(|(node, share)| of(node) * share).sum()
        };
        Self { rest: mix(|n| n.rest), position: mix(|n| n.position), velocity: mix(|n| n.velocity) }
    }
}

/// A surface that is being cut.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CutSurface {
    pub(crate) nodes: Vec<Node>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The edges that are cut and whose sides still share both ends, the lower node first.
    pub(crate) slits: Vec<[u32; 2]>,
    /// Where each node that was added comes from, in order.
    pub(crate) births: Vec<Birth>,
    /// No edge is made that is shorter than this at rest, in metres.
    pub(crate) shortest: f32,
}

/// An edge, the lower node first.
pub(super) fn edge([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl CutSurface {
    pub(super) fn position(&self, node: u32) -> DVec3 {
        self.nodes[node as usize].position.as_dvec3()
    }

    /// The triangles with a corner at the node, by their places in ascending order.
    pub(super) fn fan(&self, node: u32) -> impl Iterator<Item = usize> + '_ {
        let around = move |(_, triangle): &(usize, &[u32; 3])| triangle.contains(&node);
        self.triangles.iter().enumerate().filter(around).map(|(place, _)| place)
    }

    /// The side of a triangle that is opposite a corner, in the triangle's direction.
    pub(super) fn opposite(&self, triangle: usize, corner: u32) -> [u32; 2] {
        let [a, b, c] = self.triangles[triangle];
        match corner {
            corner if corner == a => [b, c],
            corner if corner == b => [c, a],
            _ => [a, b],
        }
    }

    /// How many triangles an edge has.
    pub(super) fn count(&self, [p, q]: [u32; 2]) -> usize {
        self.fan(p).filter(|&place| self.triangles[place].contains(&q)).count()
    }

    /// Cuts an edge, if there is something to part.
    pub(super) fn slit(&mut self, ends: [u32; 2]) {
        let ends = edge(ends);
        if !self.slits.contains(&ends) && self.count(ends) == 2 {
            self.slits.push(ends);
        }
    }

    /// How near a side a crossing is moved to its end, or a node to the side, as a share.
    fn snap(&self, side: [u32; 2]) -> f64 {
        if self.count(side) == 1 { BORDER_SNAP } else { SNAP }
    }

    /// The node on an edge at a share of the way: one of its ends, if that is near, or a new one.
    pub(super) fn node_on(&mut self, [p, q]: [u32; 2], share: f64) -> u32 {
        let node = self.between([p, q], share as f32);
        let near = share.min(1.0 - share);
        let both = self.fan(p).filter(|&place| self.triangles[place].contains(&q));
        let around: Vec<u32> = both.flat_map(|place| self.triangles[place]).collect();
        // What is no number makes no node.
        let is_inside = near >= self.snap([p, q]);
        if !is_inside || self.is_crowded(&node, &around) {
            return if share < 0.5 { p } else { q };
        }
        self.split_edge([p, q], share as f32, node)
    }

    /// The node at a point of a triangle, given by its corners' shares: on a side, if that is near, or a
    /// new one.
    pub(super) fn node_in(&mut self, place: usize, shares: [f64; 3]) -> u32 {
        let corners = self.triangles[place];
        let distances = [0, 1, 2].map(|corner| {
            let side = [corners[(corner + 1) % 3], corners[(corner + 2) % 3]];
            (shares[corner] / self.snap(side), corner)
        });
        let nearer = |a: (f64, usize), b: (f64, usize)| if b.0 < a.0 { b } else { a };
        let (nearest, corner) = distances.into_iter().fold((f64::INFINITY, 0), nearer);
        let in_32_bits = shares.map(|share| share as f32);
        let node = Node::mix(corners.map(|node| self.nodes[node as usize]), in_32_bits);
        if nearest < 1.0 || self.is_crowded(&node, &corners) {
            let [p, q] = [(corner + 1) % 3, (corner + 2) % 3];
            let share = shares[q] / (shares[p] + shares[q]);
            return self.node_on([corners[p], corners[q]], share);
        }
        self.split_triangle(place, in_32_bits, node)
    }

    fn between(&self, ends: [u32; 2], share: f32) -> Node {
        Node::mix(ends.map(|node| self.nodes[node as usize]), [1.0 - share, share])
    }

    /// Whether an edge from a new node to one of those around would be too short.
    fn is_crowded(&self, node: &Node, around: &[u32]) -> bool {
        let distance = |&other: &u32| (self.nodes[other as usize].rest - node.rest).length();
        around.iter().map(distance).any(|distance| distance < self.shortest)
    }

    fn add(&mut self, node: Node, birth: Birth) -> u32 {
        self.nodes.push(node);
        self.births.push(birth);
        (self.nodes.len() - 1) as u32
    }

    fn split_edge(&mut self, [p, q]: [u32; 2], share: f32, node: Node) -> u32 {
        let new = self.add(node, Birth::Between([p, q], share));
        let both: Vec<usize> =
            self.fan(p).filter(|&place| self.triangles[place].contains(&q)).collect();
        for place in both {
            let whole = self.triangles[place];
            let with = |old: u32| whole.map(|corner| if corner == old { new } else { corner });
            self.triangles[place] = with(q);
            self.triangles.push(with(p));
        }
        if let Some(place) = self.slits.iter().position(|&slit| slit == edge([p, q])) {
            self.slits[place] = edge([p, new]);
            self.slits.push(edge([q, new]));
        }
        new
    }

    fn split_triangle(&mut self, place: usize, shares: [f32; 3], node: Node) -> u32 {
        let [a, b, c] = self.triangles[place];
        let new = self.add(node, Birth::Inside([a, b, c], shares));
        self.triangles[place] = [a, b, new];
        self.triangles.extend([[b, c, new], [c, a, new]]);
        new
    }

    /// A copy of a node, in no triangle yet.
    pub(super) fn copy(&mut self, node: u32) -> u32 {
        self.add(self.nodes[node as usize], Birth::Copy(node))
    }
}
