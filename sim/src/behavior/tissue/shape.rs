//! What follows from a body's triangles and rest shape: masses, and the springs that resist bending.

use std::collections::BTreeMap;

use fnv::FnvHasher;
use glam::{DVec3, Vec3};
use std::hash::Hasher;

use super::material::TissueError;
use crate::geometry::Spring;

/// Twice the area of a triangle, in square metres.
fn double_area(rest: &[Vec3], triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|node| rest[node as usize].as_dvec3());
    (b - a).cross(c - a).length()
}

/// The area of a surface, in square metres.
pub(super) fn area(rest: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    triangles.iter().map(|&triangle| 0.5 * double_area(rest, triangle)).sum()
}

/// The nodes' masses, in kilograms: a third of those of the triangles around.
pub(super) fn masses(rest: &[Vec3], triangles: &[[u32; 3]], area_density: f32) -> Vec<f32> {
    let mut masses = vec![0.0; rest.len()];
    for &triangle in triangles {
        let third = double_area(rest, triangle) * f64::from(area_density) / 6.0;
        triangle.into_iter().for_each(|node| masses[node as usize] += third);
    }
    masses.into_iter().map(|mass| mass as f32).collect()
}

/// The nodes' distances from their centre of mass, in metres.
pub(super) fn to_center(rest: &[Vec3], masses: &[f32]) -> Vec<f32> {
    let moments = rest.iter().zip(masses).map(|(node, &mass)| node.as_dvec3() * f64::from(mass));
    let whole: f64 = masses.iter().copied().map(f64::from).sum();
    let center = (moments.sum::<DVec3>() / whole).as_vec3();
    rest.iter().map(|node| node.distance(center)).collect()
}

/// The springs that resist bending: one from far corner to far corner of two triangles with a common
/// edge that is not cut.
///
/// # Errors
/// An edge with more than one triangle on one side.
pub(super) fn bending(
    rest: &[Vec3],
    triangles: &[[u32; 3]],
    slits: &[[u32; 2]],
) -> Result<Vec<Spring>, TissueError> {
    let mut corners: BTreeMap<[u32; 2], [Option<u32>; 2]> = BTreeMap::new();
    for &[a, b, c] in triangles {
        for [p, q, corner] in [[a, b, c], [b, c, a], [c, a, b]] {
            let edge = [p.min(q), p.max(q)];
            let sides = corners.entry(edge).or_default();
            if sides[usize::from(p > q)].replace(corner).is_some() {
                return Err(TissueError::Manifold { edge });
            }
        }
    }
    let across = |(edge, sides): ([u32; 2], [Option<u32>; 2])| match sides {
        [Some(a), Some(b)] if a != b && !slits.contains(&edge) => {
            let rest = (rest[a as usize] - rest[b as usize]).length();
            Some(Spring { nodes: [a, b], rest })
        }
        _ => None,
    };
    Ok(corners.into_iter().filter_map(across).collect())
}

/// A hash over the rest shape and what is joined.
pub(super) fn digest(rest: &[Vec3], triangles: &[[u32; 3]], slits: &[[u32; 2]]) -> u64 {
    let mut hasher = FnvHasher::default();
    for number in rest.iter().flat_map(|node| node.to_array()) {
        hasher.write(&number.to_le_bytes());
    }
    for node in triangles.iter().flatten().chain(slits.iter().flatten()) {
        hasher.write(&node.to_le_bytes());
    }
    hasher.finish()
}
