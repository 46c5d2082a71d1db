//! Surfaces: from fields, of sheets and of tubes.

mod manifold;
mod nets;
mod patch;
mod relax;
mod tube;

use std::collections::BTreeMap;

use glam::Vec3;

pub(super) use nets::extract;
pub(super) use tube::tube;

/// Triangles in space, counter-clockwise as seen from outside.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// In metres.
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// The sides of a triangle, in its sense.
pub(super) fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

impl Surface {
    /// The same without the nodes that are in no triangle.
    pub(super) fn compact(self) -> Self {
        let mut numbers = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        let triangles = self.triangles.iter().map(|triangle| {
            triangle.map(|node| {
                let number = &mut numbers[node as usize];
                if *number == u32::MAX {
                    *number = positions.len() as u32;
                    positions.push(self.positions[node as usize]);
                }
                *number
            })
        });
        let triangles = triangles.collect();
        Self { positions, triangles }
    }

    /// Those of its triangles that are connected by sides to the most others; the first such part of
    /// equals.
    pub(super) fn largest_part(self) -> Self {
        let mut beside: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for (number, &triangle) in self.triangles.iter().enumerate() {
            for [a, b] in sides(triangle) {
                beside.entry([a.min(b), a.max(b)]).or_default().push(number);
            }
        }
        let mut part = vec![usize::MAX; self.triangles.len()];
        let mut sizes = Vec::new();
        for seed in 0..self.triangles.len() {
            if part[seed] != usize::MAX {
                continue;
            }
            let (own, mut size, mut open) = (sizes.len(), 0, vec![seed]);
            part[seed] = own;
            while let Some(number) = open.pop() {
                size += 1;
                for [a, b] in sides(self.triangles[number]) {
                    for &other in &beside[&[a.min(b), a.max(b)]] {
                        if part[other] == usize::MAX {
                            part[other] = own;
                            open.push(other);
                        }
                    }
                }
            }
            sizes.push(size);
        }
        let most = sizes.iter().copied().max();
        let largest = sizes.iter().position(|&size| Some(size) == most);
        let mut parts = part.into_iter();
        let mut triangles = self.triangles;
        triangles.retain(|_| parts.next() == largest);
        Self { positions: self.positions, triangles }.compact()
    }

    /// Twice the area of a triangle, along its normal.
    pub(super) fn normal(&self, triangle: [u32; 3]) -> Vec3 {
        let [a, b, c] = triangle.map(|node| self.positions[node as usize]);
        (b - a).cross(c - a)
    }

    /// The area of each node's third of its triangles, in square metres.
    pub(super) fn node_areas(&self) -> Vec<f32> {
        let mut areas = vec![0.0; self.positions.len()];
        for &triangle in &self.triangles {
            let third = self.normal(triangle).length() / 6.0;
            triangle.iter().for_each(|&node| areas[node as usize] += third);
        }
        areas
    }

    /// The volume inside, in cubic metres.
    pub(super) fn volume(&self) -> f32 {
        let cone = |&triangle: &[u32; 3]| {
            self.normal(triangle).dot(self.positions[triangle[0] as usize]) / 6.0
        };
        self.triangles.iter().map(cone).sum()
    }

    /// Whether each node lies on the border.
    pub(super) fn on_border(&self) -> Vec<bool> {
        let mut border = vec![false; self.positions.len()];
        for [a, b] in self.border() {
            border[a as usize] = true;
            border[b as usize] = true;
        }
        border
    }

    /// The sides that only one triangle has, in its sense.
    pub(super) fn border(&self) -> Vec<[u32; 2]> {
        let mut all: Vec<[u32; 2]> = self.triangles.iter().copied().flat_map(sides).collect();
        all.sort_unstable();
        all.iter().copied().filter(|&[a, b]| all.binary_search(&[b, a]).is_err()).collect()
    }
}
