//! What all bodies of one make share on the device: triangles, edges, and who is whose neighbour.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use dualframe_sim::geometry::Topology;
use glam::Vec3;
use parry3d::shape::{Compound, SharedShape, TypedShape};
use wgpu::{BindGroup, Buffer, BufferUsages};

use super::layouts::Layouts;
use crate::gpu::Gpu;

/// The sides that a round shape is drawn with.
const ROUND_SIDES: u32 = 32;

/// One body to draw, as the shaders read it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Instance {
    pub(crate) rotation: [f32; 4],
    pub(crate) place: [f32; 3],
    pub(crate) first: u32,
    pub(crate) color: [f32; 4],
    pub(crate) nodes: u32,
    pub(crate) object: u32,
    pub(crate) velocity: [f32; 3],
}

/// What makes the bodies of a make alike. It is kept, so that its address stays its own.
enum Likeness {
    Deformable(Arc<Topology>),
    Rigid(SharedShape),
}

/// Some indices on the device.
pub(super) struct Indices {
    pub(super) buffer: Buffer,
    pub(super) count: u32,
}

impl Indices {
    fn new(gpu: &Gpu, indices: &[u32]) -> Self {
        let buffer = gpu.buffer("indices", bytemuck::cast_slice(indices), BufferUsages::INDEX);
        Self { buffer, count: indices.len() as u32 }
    }
}

/// Bodies of one make.
pub(super) struct Make {
    likeness: Likeness,
    pub(super) triangles: Indices,
    pub(super) edges: Indices,
    pub(super) rings: BindGroup,
    /// The nodes of a rigid shape, which never change.
    pub(super) own_numbers: Option<BindGroup>,
    /// Whether some side belongs to one triangle alone: at a border, where the inside may be seen, or at sharp
    /// edges, where triangles have nodes of their own.
    pub(super) is_open: bool,
    pub(super) nodes: u32,
    /// This frame's bodies that are drawn as surfaces.
    pub(super) surfaces: Vec<Instance>,
    /// This frame's bodies that are drawn as edges.
    pub(super) wires: Vec<Instance>,
    /// The frame in which it was drawn last.
    pub(super) used: u64,
}

impl Make {
    /// Where its likeness is in memory.
    pub(super) fn address(&self) -> usize {
        match &self.likeness {
            Likeness::Deformable(topology) => Arc::as_ptr(topology).addr(),
            Likeness::Rigid(shape) => Arc::as_ptr(&shape.0).addr(),
        }
    }

    /// Whether no body can be of this make any more.
    pub(super) fn is_gone(&self) -> bool {
        match &self.likeness {
            Likeness::Deformable(topology) => Arc::strong_count(topology) == 1,
            Likeness::Rigid(shape) => Arc::strong_count(&shape.0) == 1,
        }
    }

    pub(super) fn deformable(gpu: &Gpu, layouts: &Layouts, topology: &Arc<Topology>) -> Self {
        let springs = topology.springs().iter();
        let rests: HashMap<_, _> =
            springs.map(|spring| (ordered(spring.nodes), spring.rest)).collect();
        let surface = Surface::new(topology.nodes(), topology.triangles(), |pair| {
            rests.get(&pair).copied().unwrap_or(0.0)
        });
        let likeness = Likeness::Deformable(Arc::clone(topology));
        Self::new(gpu, layouts, likeness, &surface)
    }

    /// `None` for shapes that have no [`outline`].
    pub(super) fn rigid(gpu: &Gpu, layouts: &Layouts, shape: &SharedShape) -> Option<Self> {
        let (nodes, triangles) = outline(shape)?;
        let surface = Surface::new(nodes.len(), &triangles, |_| 0.0);
        let mut make = Self::new(gpu, layouts, Likeness::Rigid(shape.clone()), &surface);
        let components = (0..3).flat_map(|axis| nodes.iter().map(move |node| node[axis]));
        // Its nodes have no velocities of their own.
        let at_rest = std::iter::repeat_n(0.0, 3 * nodes.len());
        let numbers: Vec<f32> = components.chain(at_rest).collect();
        let numbers = bytemuck::cast_slice(&numbers);
        let buffer = gpu.buffer("rigid shape", numbers, BufferUsages::STORAGE);
        make.own_numbers = Some(layouts.list(&gpu.device, &buffer));
        Some(make)
    }

    fn new(gpu: &Gpu, layouts: &Layouts, likeness: Likeness, surface: &Surface) -> Self {
        let rings = bytemuck::cast_slice(&surface.rings);
        let rings = gpu.buffer("rings", rings, BufferUsages::STORAGE);
        Self {
            likeness,
            triangles: Indices::new(gpu, &surface.triangles),
            edges: Indices::new(gpu, &surface.edges),
            rings: layouts.list(&gpu.device, &rings),
            own_numbers: None,
            is_open: surface.is_open,
            nodes: surface.nodes,
            surfaces: Vec::new(),
            wires: Vec::new(),
            used: 0,
        }
    }
}

/// A surface as the shaders read it.
struct Surface {
    nodes: u32,
    triangles: Vec<u32>,
    edges: Vec<u32>,
    /// For each node where its ring begins, and where the last one ends; then for each triangle at the
    /// node the other two nodes and the distance to the first at rest.
    rings: Vec<u32>,
    is_open: bool,
}

impl Surface {
    /// `rest` is the length of the spring between two nodes, the lower first; 0 without a spring.
    fn new(nodes: usize, triangles: &[[u32; 3]], rest: impl Fn([u32; 2]) -> f32) -> Self {
        let mut around = vec![Vec::new(); nodes];
        let mut sides: HashMap<[u32; 2], u32> = HashMap::new();
        for &[a, b, c] in triangles {
            for [node, next, last] in [[a, b, c], [b, c, a], [c, a, b]] {
                around[node as usize].push([next, last]);
                *sides.entry(ordered([node, next])).or_default() += 1;
            }
        }
        let mut rings = Vec::with_capacity(nodes + 1 + 9 * triangles.len());
        let mut begin = nodes as u32 + 1;
        rings.push(begin);
        for ring in &around {
            begin += 3 * ring.len() as u32;
            rings.push(begin);
        }
        for (node, ring) in around.iter().enumerate() {
            for &[next, last] in ring {
                rings.extend([next, last, rest(ordered([node as u32, next])).to_bits()]);
            }
        }
        let mut edges: Vec<_> = sides.keys().copied().collect();
        edges.sort_unstable();
        Self {
            nodes: nodes as u32,
            triangles: triangles.as_flattened().to_vec(),
            edges: edges.into_flattened(),
            rings,
            is_open: sides.values().any(|&triangles| triangles != 2),
        }
    }
}

fn ordered([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// The surface of a rigid shape: nothing for what has none or no bounds, for single segments and triangles, and for
/// shapes of others' making. Rounded shapes are drawn without their rounding, as far within.
fn outline(shape: &SharedShape) -> Option<(Vec<Vec3>, Vec<[u32; 3]>)> {
    let outline = match shape.as_typed_shape() {
        TypedShape::Ball(shape) => Some(shape.to_trimesh(ROUND_SIDES, ROUND_SIDES / 2)),
        TypedShape::Cuboid(shape) => Some(faceted(shape.to_trimesh())),
        TypedShape::Capsule(shape) => Some(shape.to_trimesh(ROUND_SIDES, ROUND_SIDES / 4)),
        TypedShape::Cylinder(shape) => Some(faceted(shape.to_trimesh(ROUND_SIDES))),
        TypedShape::Cone(shape) => Some(faceted(shape.to_trimesh(ROUND_SIDES))),
        TypedShape::ConvexPolyhedron(shape) => Some(faceted(shape.to_trimesh())),
        TypedShape::RoundCuboid(shape) => Some(faceted(shape.inner_shape.to_trimesh())),
        TypedShape::RoundCylinder(shape) => {
            Some(faceted(shape.inner_shape.to_trimesh(ROUND_SIDES)))
        }
        TypedShape::RoundCone(shape) => Some(faceted(shape.inner_shape.to_trimesh(ROUND_SIDES))),
        TypedShape::RoundConvexPolyhedron(shape) => Some(faceted(shape.inner_shape.to_trimesh())),
        TypedShape::HeightField(shape) => Some(shape.to_trimesh()),
        TypedShape::Voxels(shape) => Some(faceted(shape.to_trimesh())),
        TypedShape::TriMesh(shape) => Some((shape.vertices().to_vec(), shape.indices().to_vec())),
        TypedShape::Compound(shape) => Some(together(shape)),
        _ => None,
    };
    // Of a field of heights all cells may have been removed.
    outline.filter(|(_, triangles)| !triangles.is_empty())
}

/// The surfaces of those of a compound's parts that have one.
fn together(compound: &Compound) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut nodes, mut triangles) = (Vec::new(), Vec::new());
    for (pose, part) in compound.shapes() {
        let Some((own, of_own)) = outline(part) else { continue };
        let first = nodes.len() as u32;
        nodes.extend(own.into_iter().map(|node| pose.transform_point(node)));
        triangles.extend(of_own.into_iter().map(|triangle| triangle.map(|node| first + node)));
    }
    (nodes, triangles)
}

/// Gives every triangle nodes of its own, so that its edges look sharp.
fn faceted((nodes, triangles): (Vec<Vec3>, Vec<[u32; 3]>)) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corners = triangles.as_flattened().iter();
    let own = corners.filter_map(|&node| nodes.get(node as usize).copied()).collect();
    let count = triangles.len() as u32;
    (own, (0..count).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect())
}

#[cfg(test)]
mod tests {
    use parry3d::math::Pose;

    use super::*;

    #[test]
    fn a_ring_has_every_triangle_at_its_node() {
        let tetrahedron = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let surface = Surface::new(4, &tetrahedron, |[a, b]| (10 * a + b) as f32);
        assert!(!surface.is_open);
        assert_eq!(surface.edges.len(), 2 * 6);
        assert_eq!(surface.rings[..5], [5, 14, 23, 32, 41]);
        // Node 0: its triangles in order, each with the distance to the next corner at rest.
        let ring: Vec<_> =
            surface.rings[5..14].chunks(3).map(|three| [three[0], three[1]]).collect();
        assert_eq!(ring, [[2, 1], [1, 3], [3, 2]]);
        assert_eq!(f32::from_bits(surface.rings[7]), 2.0);
    }

    #[test]
    fn a_compound_is_its_parts() {
        let ball = SharedShape::ball(1.0);
        let parts =
            [Vec3::ZERO, Vec3::X * 3.0].map(|at| (Pose::from_translation(at), ball.clone()));
        let (nodes, triangles) = outline(&SharedShape::compound(parts.to_vec())).expect("bounded");
        let (one, of_one) = outline(&ball).expect("bounded");
        assert_eq!((nodes.len(), triangles.len()), (2 * one.len(), 2 * of_one.len()));
        let second = triangles[of_one.len()].map(|node| nodes[node as usize]);
        assert_eq!(second, of_one[0].map(|node| one[node as usize] + Vec3::X * 3.0));
        let unbounded = SharedShape::new(parry3d::shape::HalfSpace::new(Vec3::Y));
        assert!(outline(&unbounded).is_none());
        // A part that has no surface hides none of the others.
        let with = |part| SharedShape::compound(vec![(Pose::IDENTITY, part), parts[1].clone()]);
        let line = SharedShape::segment(Vec3::ZERO, Vec3::X);
        assert_eq!(outline(&with(line.clone())).expect("the ball").1.len(), of_one.len());
        assert!(outline(&SharedShape::compound(vec![(Pose::IDENTITY, line)])).is_none());
    }

    #[test]
    fn rounded_shapes_and_fields_are_drawn() {
        let heights = parry3d::utils::Array2::repeat(3, 3, 0.5);
        for shape in [
            SharedShape::round_cuboid(1.0, 2.0, 3.0, 0.1),
            SharedShape::round_cylinder(1.0, 2.0, 0.1),
            SharedShape::round_cone(1.0, 2.0, 0.1),
            SharedShape::heightfield(heights, Vec3::ONE),
            SharedShape::voxels(Vec3::ONE, &[glam::IVec3::ZERO]),
        ] {
            let (nodes, triangles) = outline(&shape).expect("it has a surface");
            let is_there = |&node: &u32| (node as usize) < nodes.len();
            assert!(!triangles.is_empty() && triangles.as_flattened().iter().all(is_there));
        }
    }

    #[test]
    fn a_border_is_found() {
        assert!(Surface::new(3, &[[0, 1, 2]], |_| 0.0).is_open);
    }
}
