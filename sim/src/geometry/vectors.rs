//! Vectors of a body's nodes, stored component by component in whole SIMD lanes.

use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use glam::Vec3;

/// Nodes that the kernels handle at once. Sums over lanes are taken in a fixed order, so this number
/// is part of what makes results equal on every machine: it never follows the machine's vector width.
pub const LANES: usize = 16;

/// One component of [`LANES`] consecutive nodes.
pub type Lanes = [f32; LANES];

/// [`Lanes`] in a cache line of their own: every load across two lines would take longer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line(pub(crate) Lanes);

/// One vector per node, as x, y and z arrays one after the other, each padded with zeros to whole
/// [`Lanes`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vectors {
    lines: Vec<Line>,
    len: usize,
}

impl Vectors {
    /// `len` zero vectors.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        Self { lines: vec![Line::default(); 3 * len.div_ceil(LANES)], len }
    }

    /// The given vectors.
    #[must_use]
    pub fn from_slice(vectors: &[Vec3]) -> Self {
        let mut result = Self::zeros(vectors.len());
        for (index, &vector) in vectors.iter().enumerate() {
            result.set(index, vector);
        }
        result
    }

    /// The number of vectors, without the padding.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no vector.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The vector at `index`, or `None` past the last.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Vec3> {
        let components = self.components();
        let at = |axis: usize| components[axis].as_flattened()[index];
        (index < self.len).then(|| Vec3::new(at(0), at(1), at(2)))
    }

    /// Replaces the vector at `index`; an index past the last is ignored.
    pub fn set(&mut self, index: usize, vector: Vec3) {
        if index < self.len {
            for (component, value) in self.components_mut().into_iter().zip(vector.to_array()) {
                component.as_flattened_mut()[index] = value;
            }
        }
    }

    /// Adds to the vector at `index`; an index past the last is ignored.
    pub fn add(&mut self, index: usize, vector: Vec3) {
        if let Some(old) = self.get(index) {
            self.set(index, old + vector);
        }
    }

    /// The x, y and z components, without the padding.
    #[must_use]
    pub fn as_slices(&self) -> [&[f32]; 3] {
        self.components().map(|component| &component.as_flattened()[..self.len])
    }

    /// As [`Vectors::as_slices`], to be replaced.
    pub fn as_mut_slices(&mut self) -> [&mut [f32]; 3] {
        let len = self.len;
        self.components_mut().map(|component| &mut component.as_flattened_mut()[..len])
    }

    /// The x, y and z components, all of the same length.
    #[inline(always)]
    pub(crate) fn components(&self) -> [&[Lanes]; 3] {
        components(&self.lines)
    }

    /// As [`Vectors::components`], to be replaced.
    #[inline(always)]
    pub(crate) fn components_mut(&mut self) -> [&mut [Lanes]; 3] {
        components_mut(&mut self.lines)
    }

    /// The components one after the other.
    pub(crate) fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// The components one after the other, to be replaced.
    #[inline(always)]
    pub(crate) fn lines_mut(&mut self) -> &mut [Line] {
        &mut self.lines
    }

    /// All vectors in order.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        let [x, y, z] = self.as_slices();
        x.iter().zip(y).zip(z).map(|((&x, &y), &z)| Vec3::new(x, y, z))
    }

    /// Becomes a copy of `other` without giving up memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.lines.clone_from(&other.lines);
        self.len = other.len;
    }
}

/// The x, y and z components of vectors' lines.
#[inline(always)]
pub(crate) fn components(lines: &[Line]) -> [&[Lanes]; 3] {
    let lanes: &[Lanes] = cast_slice(lines);
    let (x, others) = lanes.split_at(lanes.len() / 3);
    let (y, z) = others.split_at(x.len());
    [x, y, z]
}

/// One of them.
#[inline(always)]
pub(crate) fn component(lines: &[Line], axis: usize) -> &[Lanes] {
    let chunks = lines.len() / 3;
    &cast_slice(lines)[axis * chunks..][..chunks]
}

/// One of them.
#[inline(always)]
pub(crate) fn component_mut(lines: &mut [Line], axis: usize) -> &mut [Lanes] {
    let chunks = lines.len() / 3;
    &mut cast_slice_mut(lines)[axis * chunks..][..chunks]
}

/// As [`components`], to be replaced.
#[inline(always)]
pub(crate) fn components_mut(lines: &mut [Line]) -> [&mut [Lanes]; 3] {
    let lanes: &mut [Lanes] = cast_slice_mut(lines);
    let (x, others) = lanes.split_at_mut(lanes.len() / 3);
    let (y, z) = others.split_at_mut(x.len());
    [x, y, z]
}

/// `len` numbers, padded with zeros.
pub(crate) fn in_lanes(values: impl Iterator<Item = f32>, len: usize) -> Vec<Lanes> {
    let mut lanes = vec![[0.0; LANES]; len.div_ceil(LANES)];
    for (lane, value) in lanes.as_flattened_mut().iter_mut().zip(values) {
        *lane = value;
    }
    lanes
}
