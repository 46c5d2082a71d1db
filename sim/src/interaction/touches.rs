//! The results module of an interaction pair (Fig. 3): what detection found.

use bytemuck::{cast_slice, cast_slice_mut};
use glam::Vec3;

use crate::geometry::{Bounds, LANES, Lanes, Line, Mesh};
use crate::simd::{Isa, LaneSet, Simd, first_lanes, greatest, least};

/// A place where two objects touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The node of each object, first the pair's first; [`Contact::BODY`] for a rigid shape.
    ///
    /// [`Contact::BODY`]: super::Contact::BODY
    pub nodes: [u32; 2],
    /// The unit normal of the contact, from the second object to the first.
    pub normal: [f32; 3],
    /// How deep the objects are in each other, in metres; less than 0 where they are so far apart and are
    /// about to touch.
    pub depth: f32,
}

/// What a detection found, and the memory it works in.
#[derive(Debug)]
pub struct Touches {
    list: Vec<Touch>,
    pub(super) near: [NearNodes; 2],
    pub(super) simd: Simd,
}

/// Touches of one pair for which there is room from the start; usually 2,048, more than two particles
/// can have, so that a frame need not allocate.
const ROOM: usize = 2_048;

impl Default for Touches {
    fn default() -> Self {
        Self { list: Vec::with_capacity(ROOM), near: Default::default(), simd: Simd::detect() }
    }
}

impl Touches {
    /// Adds a place where the objects touch.
    pub fn push(&mut self, touch: Touch) {
        self.list.push(touch);
    }

    /// The places in the order in which they were found.
    #[must_use]
    pub fn list(&self) -> &[Touch] {
        &self.list
    }

    pub(super) fn clear(&mut self) {
        self.list.clear();
    }

    /// The list and the nodes in reach, both to work on.
    pub(super) fn parts(&mut self) -> (&mut Vec<Touch>, &mut [NearNodes; 2]) {
        (&mut self.list, &mut self.near)
    }
}

/// The nodes of a mesh that are in reach of another object.
#[derive(Debug, Default)]
pub(super) struct NearNodes {
    nodes: Vec<u32>,
    components: [Vec<Line>; 3],
    len: usize,
}

impl NearNodes {
    /// Takes the nodes inside `bounds`, in ascending order.
    #[inline(always)]
    pub(super) fn select<I: Isa>(&mut self, isa: I, mesh: &Mesh, bounds: &Bounds) {
        let [x, y, z] = mesh.positions.components();
        self.reserve(x.len());
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let nodes = mesh.positions.len();
        let mut len = 0;
        for (chunk, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
            let first = chunk * LANES;
            let vectors = [isa.load(x), isa.load(y), isa.load(z)];
            // The padding lies at the origin, which may be inside.
            let mut inside = first_lanes(nodes - first);
            for axis in 0..3 {
                inside &= isa.at_most(isa.splat(min[axis]), vectors[axis]);
                inside &= isa.at_most(vectors[axis], isa.splat(max[axis]));
            }
            if inside != 0 {
                let [x, y, z] = self.components.each_mut().map(|lines| cast_slice_mut(lines));
                let to = [lanes_at(x, len), lanes_at(y, len), lanes_at(z, len)];
                isa.compress(inside, first as u32, vectors, lanes_at(&mut self.nodes, len), to);
                len += inside.count_ones() as usize;
            }
        }
        self.len = len;
        // Room for whole lanes, which hold the last node once more: no box grows by it.
        for component in &mut self.components {
            let numbers: &mut [f32] = cast_slice_mut(component);
            if let Some(&last) = numbers[..len].last() {
                numbers[len..len + LANES].fill(last);
            }
        }
    }

    /// The nodes' numbers.
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes[..self.len]
    }

    /// The position of the node at `index` of [`NearNodes::nodes`], in metres.
    pub(super) fn position(&self, index: usize) -> [f32; 3] {
        self.components.each_ref().map(|component| cast_slice(component)[index])
    }

    /// The positions in whole lanes, and in which there are nodes.
    #[inline(always)]
    pub(super) fn chunks(&self) -> impl Iterator<Item = ([&Lanes; 3], LaneSet)> + '_ {
        let [x, y, z] = self.components.each_ref();
        let there = (0..self.len).step_by(LANES).map(|first| first_lanes(self.len - first));
        x.iter().zip(y).zip(z).map(|((x, y), z)| [&x.0, &y.0, &z.0]).zip(there)
    }

    /// The box around the nodes.
    #[inline(always)]
    pub(super) fn bounds<I: Isa>(&self, isa: I) -> Bounds {
        let mut low = [isa.splat(f32::INFINITY); 3];
        let mut high = [isa.splat(f32::NEG_INFINITY); 3];
        for (components, _) in self.chunks() {
            for axis in 0..3 {
                let lanes = isa.load(components[axis]);
                low[axis] = isa.min(lanes, low[axis]);
                high[axis] = isa.max(lanes, high[axis]);
            }
        }
        Bounds {
            min: Vec3::from_array(low.map(|lanes| least(isa, lanes))),
            max: Vec3::from_array(high.map(|lanes| greatest(isa, lanes))),
        }
    }

    /// Makes room for the nodes of so many chunks.
    pub(super) fn reserve(&mut self, chunks: usize) {
        // One more than can be kept: whole lanes are written wherever the last one ended.
        let wanted = chunks + 1;
        if self.nodes.len() < wanted * LANES {
            self.nodes.resize(wanted * LANES, 0);
            for component in &mut self.components {
                component.resize(wanted, Line::default());
            }
        }
    }
}

/// Whole lanes from `start` on.
#[inline(always)]
fn lanes_at<T>(values: &mut [T], start: usize) -> &mut [T; LANES] {
    values[start..].first_chunk_mut().unwrap_or_else(|| unreachable!("`reserve` made room"))
}
