//! The once-subdivided icosahedron, the particles' shape (§7.1.1).

use glam::Vec3;

/// The nodes of a once-subdivided icosahedron: 12 corners, then 30 edge midpoints.
pub const ICOSPHERE_NODES: usize = 42;
/// Its triangles.
pub const ICOSPHERE_FACES: usize = 80;
/// Its edges.
pub const ICOSPHERE_EDGES: usize = 120;

/// The faces of the icosahedron, counter-clockwise as seen from outside.
const FACES: [[u32; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// The nodes (metres, around the origin, all `radius` metres from it) and the triangles of a
/// once-subdivided icosahedron. Built by sums, products, divisions and square roots only, so that it
/// has the same bits on every machine.
///
/// `radius` is to be from 1e-18 to 1e18 m; usually 0.1 m. Of others the squares are too small or too large, and places
/// may be no numbers.
#[must_use]
pub fn icosphere(radius: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut nodes: Vec<Vec3> = corners().into_iter().map(|p| on_sphere(p, radius)).collect();
    let mut midpoints: Vec<[u32; 2]> = Vec::with_capacity(30);
    let mut triangles = Vec::with_capacity(ICOSPHERE_FACES);
    for [a, b, c] in FACES {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            let edge = [from.min(to), from.max(to)];
            let known = midpoints.iter().position(|&known| known == edge);
            let index = known.unwrap_or_else(|| {
                let middle = nodes[from as usize] + nodes[to as usize];
                nodes.push(on_sphere(middle, radius));
                midpoints.push(edge);
                midpoints.len() - 1
            });
            (12 + index) as u32
        });
        triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    (nodes, triangles)
}

/// The corners of an icosahedron: three golden rectangles.
fn corners() -> [Vec3; 12] {
    let g = (1.0 + 5.0_f32.sqrt()) / 2.0;
    [
        Vec3::new(-1.0, g, 0.0),
        Vec3::new(1.0, g, 0.0),
        Vec3::new(-1.0, -g, 0.0),
        Vec3::new(1.0, -g, 0.0),
        Vec3::new(0.0, -1.0, g),
        Vec3::new(0.0, 1.0, g),
        Vec3::new(0.0, -1.0, -g),
        Vec3::new(0.0, 1.0, -g),
        Vec3::new(g, 0.0, -1.0),
        Vec3::new(g, 0.0, 1.0),
        Vec3::new(-g, 0.0, -1.0),
        Vec3::new(-g, 0.0, 1.0),
    ]
}

fn on_sphere(point: Vec3, radius: f32) -> Vec3 {
    point * (radius / point.length())
}

#[cfg(test)]
mod tests {
    use super::super::topology::edges;
    use super::*;

    #[test]
    fn counts_and_radius() {
        let (nodes, triangles) = icosphere(0.1);
        assert_eq!(nodes.len(), ICOSPHERE_NODES);
        assert_eq!(triangles.len(), ICOSPHERE_FACES);
        assert_eq!(edges(&triangles).len(), ICOSPHERE_EDGES);
        assert!(nodes.iter().all(|node| (node.length() - 0.1).abs() < 1e-7));
    }

    #[test]
    fn the_smallest_and_the_largest() {
        for radius in [1e-18, 1e18] {
            let (nodes, _) = icosphere(radius);
            assert!(nodes.iter().all(|node| (node.length() / radius - 1.0).abs() < 1e-6));
        }
    }

    #[test]
    fn triangles_face_outwards() {
        let (nodes, triangles) = icosphere(1.0);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|node| nodes[node as usize]);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }

    #[test]
    fn every_node_has_five_or_six_edges() {
        let (_, triangles) = icosphere(1.0);
        let edges = edges(&triangles);
        for node in 0..ICOSPHERE_NODES as u32 {
            let degree = edges.iter().filter(|edge| edge.contains(&node)).count();
            assert_eq!(degree, if node < 12 { 5 } else { 6 });
        }
    }
}
