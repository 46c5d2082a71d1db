//! Vessels.

use glam::Vec3;

use super::Surface;

/// The nodes around a tube: a hexagon's.
const SIDES: u32 = 6;
/// Half the root of 3: a hexagon's height.
const HEIGHT: f32 = 0.866_025_4;
/// A hexagon's corners, one after the other.
const HEXAGON: [[f32; 2]; SIDES as usize] =
    [[1.0, 0.0], [0.5, HEIGHT], [-0.5, HEIGHT], [-1.0, 0.0], [-0.5, -HEIGHT], [0.5, -HEIGHT]];

/// A closed tube of `radius` metres along a path of two points or more, with a ring at each.
pub(in crate::scene::head) fn tube(path: &[Vec3], radius: f32) -> Surface {
    let mut surface = Surface::default();
    let (Some(&first), Some(&last)) = (path.first(), path.last()) else { return surface };
    let mut across = Vec3::X;
    for (number, &point) in path.iter().enumerate() {
        let before = path[number.saturating_sub(1)];
        let along = (path.get(number + 1).unwrap_or(&last) - before).normalize_or(Vec3::Z);
        // The direction of the ring before, turned as little as can be.
        across = (across - along * across.dot(along)).normalize_or(along.any_orthonormal_vector());
        let other = along.cross(across);
        let ring = HEXAGON.map(|[x, y]| point + (across * x + other * y) * radius);
        surface.positions.extend(ring);
    }
    let rings = path.len() as u32;
    for ring in 1..rings {
        for side in 0..SIDES {
            let [a, b] = [side, (side + 1) % SIDES].map(|side| (ring - 1) * SIDES + side);
            let [c, d] = [a + SIDES, b + SIDES];
            surface.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    let caps = rings * SIDES;
    surface.positions.extend([first, last]);
    for side in 0..SIDES {
        let [a, b] = [side, (side + 1) % SIDES];
        let end = (rings - 1) * SIDES;
        surface.triangles.extend([[caps, b, a], [caps + 1, end + a, end + b]]);
    }
    surface
}
