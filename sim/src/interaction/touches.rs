//! The results module of an interaction pair (Fig. 3): what detection found.

use crate::geometry::Bounds;
use crate::geometry::{LANES, Lanes, Mesh};

/// A place where two objects touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// The node of each object, first the pair's first; [`Contact::BODY`] for a rigid shape.
    ///
    /// [`Contact::BODY`]: super::Contact::BODY
    pub nodes: [u32; 2],
    /// The unit normal of the contact, from the second object to the first.
    pub normal: [f32; 3],
    /// How deep the objects are in each other, in metres.
    pub depth: f32,
}

/// What a detection found, and the memory it works in.
#[derive(Debug)]
pub struct Touches {
    list: Vec<Touch>,
    pub(super) near: [NearNodes; 2],
}

/// Touches of one pair for which there is room from the start; usually 2,048, more than two particles
/// can have, so that a frame need not allocate.
const ROOM: usize = 2_048;

impl Default for Touches {
    fn default() -> Self {
        Self { list: Vec::with_capacity(ROOM), near: Default::default() }
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
    components: [Vec<Lanes>; 3],
    len: usize,
}

impl NearNodes {
    /// Takes the nodes inside `bounds`, in ascending order.
    pub(super) fn select(&mut self, mesh: &Mesh, bounds: &Bounds) {
        let [x, y, z] = mesh.positions.components.each_ref();
        self.reserve(x.len());
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let mut len = 0;
        for (chunk, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
            let mut inside = [true; LANES];
            for (axis, lanes) in [x, y, z].into_iter().enumerate() {
                for (inside, &value) in inside.iter_mut().zip(lanes) {
                    *inside &= (value >= min[axis]) & (value <= max[axis]);
                }
            }
            if inside == [false; LANES] {
                continue;
            }
            for (lane, inside) in inside.into_iter().enumerate() {
                // Written in any case, kept only if inside: no branch to be mispredicted.
                self.nodes[len] = (chunk * LANES + lane) as u32;
                for (near, lanes) in self.components.iter_mut().zip([x, y, z]) {
                    near.as_flattened_mut()[len] = lanes[lane];
                }
                len += usize::from(inside);
            }
        }
        // The padding lies at the origin, which may be inside.
        let nodes = mesh.positions.len() as u32;
        while len > 0 && self.nodes[len - 1] >= nodes {
            len -= 1;
        }
        self.len = len;
        self.pad();
    }

    /// The nodes' numbers.
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes[..self.len]
    }

    /// The position of the node at `index` of [`NearNodes::nodes`], in metres.
    pub(super) fn position(&self, index: usize) -> [f32; 3] {
        self.components.each_ref().map(|component| component.as_flattened()[index])
    }

    /// The positions in whole lanes; beyond the last node they are infinitely far away.
    pub(super) fn chunks(&self) -> impl Iterator<Item = [&Lanes; 3]> + '_ {
        let [x, y, z] = self.components.each_ref().map(|c| &c[..self.len.div_ceil(LANES)]);
        x.iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z])
    }

    /// The box around the nodes.
    pub(super) fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for index in 0..self.len {
            let point = self.position(index).into();
            bounds = bounds.union(&Bounds { min: point, max: point });
        }
        bounds
    }

    /// Makes room for the nodes of so many chunks.
    pub(super) fn reserve(&mut self, chunks: usize) {
        // One more than can be kept: the last write may be one that is not.
        let wanted = (chunks + 1) * LANES;
        if self.nodes.len() < wanted {
            self.nodes.resize(wanted, 0);
            for component in &mut self.components {
                component.resize(chunks + 1, [0.0; LANES]);
            }
        }
    }

    fn pad(&mut self) {
        let end = self.len.next_multiple_of(LANES);
        for component in &mut self.components {
            component.as_flattened_mut()[self.len..end].fill(f32::INFINITY);
        }
    }
}
