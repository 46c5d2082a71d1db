//! Vectors of a body's nodes, stored component by component in whole SIMD lanes.

use glam::Vec3;

/// Nodes that the kernels handle at once. Sums over lanes are taken in a fixed order, so this number
/// is part of what makes results equal on every machine: it never follows the machine's vector width.
pub const LANES: usize = 16;

/// One component of [`LANES`] consecutive nodes.
pub type Lanes = [f32; LANES];

/// One vector per node, as separate x, y and z arrays that are padded with zeros to whole
/// [`Lanes`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vectors {
    /// The components x, y and z, all of the same length.
    pub(crate) components: [Vec<Lanes>; 3],
    len: usize,
}

impl Vectors {
    /// `len` zero vectors.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        let chunks = len.div_ceil(LANES);
        Self { components: std::array::from_fn(|_| vec![[0.0; LANES]; chunks]), len }
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
        let at = |axis: usize| self.components[axis].as_flattened()[index];
        (index < self.len).then(|| Vec3::new(at(0), at(1), at(2)))
    }

    /// Replaces the vector at `index`; an index past the last is ignored.
    pub fn set(&mut self, index: usize, vector: Vec3) {
        if index < self.len {
            for (axis, value) in vector.to_array().into_iter().enumerate() {
                self.components[axis].as_flattened_mut()[index] = value;
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
        self.components.each_ref().map(|component| &component.as_flattened()[..self.len])
    }

    /// As [`Vectors::as_slices`], to be replaced.
    pub fn as_mut_slices(&mut self) -> [&mut [f32]; 3] {
        let len = self.len;
        self.components.each_mut().map(|component| &mut component.as_flattened_mut()[..len])
    }

    /// All vectors in order.
    pub fn iter(&self) -> impl Iterator<Item = Vec3> + '_ {
        let [x, y, z] = self.as_slices();
        x.iter().zip(y).zip(z).map(|((&x, &y), &z)| Vec3::new(x, y, z))
    }

    /// Becomes a copy of `other` without giving up memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        for (to, from) in self.components.iter_mut().zip(&other.components) {
            to.clone_from(from);
        }
        self.len = other.len;
    }
}

/// `len` numbers, padded with zeros.
pub(crate) fn in_lanes(values: impl Iterator<Item = f32>, len: usize) -> Vec<Lanes> {
    let mut lanes = vec![[0.0; LANES]; len.div_ceil(LANES)];
    for (lane, value) in lanes.as_flattened_mut().iter_mut().zip(values) {
        *lane = value;
    }
    lanes
}
