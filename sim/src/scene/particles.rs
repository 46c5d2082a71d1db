//! The particle environment (§7.1.1): deformable bodies in a room of six walls.

use std::sync::Arc;

use glam::Vec3;
use thiserror::Error;

use super::Scene;
use super::random::SplitMix64;
use crate::behavior::{Fixed, MassSpring, MassSpringError};
use crate::blocking::Blocking;
use crate::geometry::{
    Bounds, Geometry, ICOSPHERE_NODES, Mesh, MeshError, Rigid, Topology, TopologyError, edges,
    icosphere,
};
use crate::interaction::{
    InteractionPair, NodeSpheres, NodesInShape, Penalty, ResponseError, RuleError, Rules,
};
use crate::object::{Drawing, Group, Object, ObjectId, VisualProperties};
use crate::simd::Simd;
use crate::stages::Stages;

/// The radius of a particle's nodes around its centre, in metres; usually 0.1.
const RADIUS: f32 = 0.1;
/// The radius of a node's contact sphere, in metres; usually 0.3 of the particle's radius, at which
/// no other node fits between neighbours.
const CONTACT_RADIUS: f32 = 0.03;
/// A node's mass, in kilograms; usually 0.01, which makes a particle weigh as much as foam rubber.
const NODE_MASS: f32 = 0.01;
/// The stiffness of a spring between two nodes, in newtons per metre; usually 60. One step a frame is
/// then stable.
const STIFFNESS: f32 = 60.0;
/// The stiffness of a spring to the centre, in newtons per metre; usually 300: without a stiff core
/// particles at the bottom of a pile are pressed flat.
const CENTER_STIFFNESS: f32 = 300.0;
/// The damping of a spring, in newton seconds per metre; usually 0.02.
const DAMPING: f32 = 0.02;
/// The stiffness of a contact between two nodes, in newtons per metre; usually 120.
const CONTACT_STIFFNESS: f32 = 120.0;
/// The radius of a particle's core, in metres; usually 0.1, that of its nodes at rest: cores meet
/// only when particles are pressed into each other.
const CORE_RADIUS: f32 = 0.1;
/// The stiffness of a contact between two cores, in newtons per metre; usually 2000.
const CORE_STIFFNESS: f32 = 2_000.0;
/// The damping of a contact between two nodes, in newton seconds per metre; usually 0.05.
const CONTACT_DAMPING: f32 = 0.05;
/// The stiffness of a wall against a node, in newtons per metre; usually 200.
const WALL_STIFFNESS: f32 = 200.0;
/// The damping of a wall against a node, in newton seconds per metre; usually 0.2.
const WALL_DAMPING: f32 = 0.2;
/// The coefficient of friction on a wall; usually 0.3.
const WALL_FRICTION: f32 = 0.3;
/// The acceleration of gravity, in metres per second squared; usually 9.81 downwards (−y).
const GRAVITY: f32 = 9.81;
/// The room's volume for each particle, in cubic metres; usually 0.046: a particle with its contact
/// spheres fills a fifth of it.
const VOLUME_PER_PARTICLE: f64 = 0.046;
/// The distance of neighbours at the start, in metres; usually 0.24, at which contact spheres just
/// overlap.
const SPACING: f32 = 0.24;
/// The greatest component of a particle's velocity at the start, in metres per second; usually 1.
const SPEED: f32 = 1.0;
/// The group of particles.
const PARTICLES: Group = Group(0);
/// The group of walls.
const WALLS: Group = Group(1);

/// Why a scene cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SceneError {
    /// No particle, or too many.
    #[error("{objects} particles were asked for; there can be 1 to {}", ParticleScene::MAX_OBJECTS)]
    Objects {
        /// The number asked for.
        objects: usize,
    },
    /// No substep, or too many.
    #[error(
        "up to {substeps} substeps a frame were asked for; there can be 1 to {}",
        ParticleScene::MAX_SUBSTEPS
    )]
    Substeps {
        /// The number asked for.
        substeps: u32,
    },
    /// A behaviour was refused.
    #[error(transparent)]
    MassSpring(#[from] MassSpringError),
    /// A mesh was refused.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A response was refused.
    #[error(transparent)]
    Penalty(#[from] ResponseError),
    /// A rule was refused.
    #[error(transparent)]
    Rule(#[from] RuleError),
    /// A topology was refused.
    #[error(transparent)]
    Topology(#[from] TopologyError),
}

/// The particle environment: once-subdivided icosahedra of 42 nodes and 162 springs in a room of six
/// walls whose volume grows with their number. They start close together, around the room's middle,
/// at random velocities; each integrates 1 to 10 substeps a frame, unless asked otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParticleScene {
    /// The number of particles, 1 to [`ParticleScene::MAX_OBJECTS`]. The six walls come on top.
    pub objects: usize,
    /// What velocities and substeps are drawn from.
    pub seed: u64,
    /// Whether there is gravity.
    pub gravity: bool,
    /// Whether springs, contacts and walls are damped and walls have friction. Without, energy is
    /// kept, up to the integrator's oscillation around it.
    pub damping: bool,
    /// The most substeps a frame, 1 to [`ParticleScene::MAX_SUBSTEPS`]; usually 10 (§7.1.1). Each particle's are
    /// drawn from 1 to this.
    pub most_substeps: u32,
}

impl ParticleScene {
    /// The most particles: what blocks can hold, less the walls.
    pub const MAX_OBJECTS: usize = Blocking::MAX_OBJECTS - 6;

    /// The most substeps a frame: ten times what experiments with uneven objects take. A frame of as many
    /// particles as there can be still ends.
    pub const MAX_SUBSTEPS: u32 = 1_000;

    /// The time from one frame to the next, in seconds; usually 1/240.
    pub const TIME_STEP: f32 = 1.0 / 240.0;

    /// So many particles without gravity, damped, from seed 1.
    #[must_use]
    pub fn new(objects: usize) -> Self {
        Self { objects, seed: 1, gravity: false, damping: true, most_substeps: 10 }
    }

    /// The room, from wall to wall.
    #[must_use]
    pub fn room(&self) -> Bounds {
        let half = Vec3::splat(half_side(&lattice(self.objects)));
        Bounds { min: -half, max: half }
    }

    /// Builds the objects and the rules.
    ///
    /// # Errors
    /// No particle, or more than [`ParticleScene::MAX_OBJECTS`]; no substeps, or more than
    /// [`ParticleScene::MAX_SUBSTEPS`].
    pub fn build(&self) -> Result<Scene, SceneError> {
        if !(1..=Self::MAX_OBJECTS).contains(&self.objects) {
            return Err(SceneError::Objects { objects: self.objects });
        }
        if !(1..=Self::MAX_SUBSTEPS).contains(&self.most_substeps) {
            return Err(SceneError::Substeps { substeps: self.most_substeps });
        }
        let centers = lattice(self.objects);
        let mut objects = self.particles(&centers)?;
        let half = half_side(&centers);
        for (index, normal) in wall_normals().into_iter().enumerate() {
            let id = ObjectId((self.objects + index) as u32);
            let geometry = Geometry::Rigid(Rigid::wall(normal * -half, normal));
            let mut wall = Object::new(id, WALLS, geometry, Fixed);
            wall.drawing = Drawing::Hidden;
            objects.push(wall);
        }
        let gravity = if self.gravity { Vec3::new(0.0, -GRAVITY, 0.0) } else { Vec3::ZERO };
        let stages = Stages {
            rules: self.rules()?,
            time_step: Self::TIME_STEP,
            gravity,
            callback_budget: None,
            simd: Simd::detect(),
        };
        Ok(Scene::new(objects, stages))
    }

    fn particles(&self, centers: &[Vec3]) -> Result<Vec<Object>, SceneError> {
        let (nodes, triangles) = icosphere(RADIUS);
        let edges = edges(&triangles);
        let topology = Arc::new(Topology::new(&nodes, triangles, &edges, true)?);
        let make = Mesh::new(topology, &nodes, &[NODE_MASS; ICOSPHERE_NODES], CONTACT_RADIUS)?;
        let mut random = SplitMix64::new(self.seed);
        let mut objects = Vec::with_capacity(centers.len() + 6);
        for (index, &center) in centers.iter().enumerate() {
            let positions: Vec<Vec3> = nodes.iter().map(|&node| center + node).collect();
            let mut mesh = make.another(&positions)?;
            let mut component = || random.symmetric();
            mesh.set_velocity(Vec3::new(component(), component(), component()) * SPEED);
            let substeps = random.up_to(self.most_substeps);
            let behavior = MassSpring::new(STIFFNESS, self.damped(DAMPING), substeps)?
                .with_center_stiffness(CENTER_STIFFNESS)?;
            let id = ObjectId(index as u32);
            let mut object = Object::new(id, PARTICLES, Geometry::Mesh(mesh), behavior);
            object.visual = VisualProperties { color: color(substeps, self.most_substeps) };
            objects.push(object);
        }
        Ok(objects)
    }

    fn rules(&self) -> Result<Rules, SceneError> {
        let mut rules = Rules::new();
        let contact = Penalty::new(CONTACT_STIFFNESS, self.damped(CONTACT_DAMPING), 0.0)?
            .with_body_stiffness(CORE_STIFFNESS)?;
        let (detection, response) =
            (Box::new(NodeSpheres { core_radius: CORE_RADIUS }), Box::new(contact));
        rules.model(PARTICLES, PARTICLES, InteractionPair { detection, response })?;
        let (damping, friction) = (self.damped(WALL_DAMPING), self.damped(WALL_FRICTION));
        let contact = Penalty::new(WALL_STIFFNESS, damping, friction)?;
        let (detection, response) = (Box::new(NodesInShape), Box::new(contact));
        rules.model(PARTICLES, WALLS, InteractionPair { detection, response })?;
        Ok(rules)
    }

    fn damped(&self, value: f32) -> f32 {
        if self.damping { value } else { 0.0 }
    }
}

/// From blue for one substep to orange for the most.
fn color(substeps: u32, most: u32) -> [f32; 4] {
    let share = (substeps - 1) as f32 / (most - 1).max(1) as f32;
    [0.1 + 0.8 * share, 0.3 + 0.1 * share, 0.8 - 0.7 * share, 1.0]
}

fn wall_normals() -> [Vec3; 6] {
    [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
}

/// The sites of a face-centred cubic lattice, the densest packing, that are nearest to its origin.
fn lattice(count: usize) -> Vec<Vec3> {
    // Half the points of a cubic grid are sites; a ball takes π/6 of its cube.
    let reach = (root(4.0 * count as f64) / 2.0) as i32 + 2;
    let mut sites = Vec::new();
    for x in -reach..=reach {
        for y in -reach..=reach {
            let odd = (x + y).rem_euclid(2);
            let first = -reach + (odd + reach).rem_euclid(2);
            sites.extend((first..=reach).step_by(2).map(|z| [x, y, z]));
        }
    }
    sites.sort_unstable_by_key(|&[x, y, z]| (x * x + y * y + z * z, x, y, z));
    sites.truncate(count);
    // Numbered, and so laid out in memory, by place: a block's objects lie together.
    sites.sort_unstable_by_key(|site| z_order(site.map(|coordinate| (coordinate + reach) as u32)));
    // Neighbours are one apart in two of the three coordinates.
    let unit = SPACING / 2.0_f32.sqrt();
    let place = |site: [i32; 3]| Vec3::from_array(site.map(|coordinate| coordinate as f32 * unit));
    sites.into_iter().map(place).collect()
}

/// The place of a cell on the Z-order curve, which keeps neighbours close: the bits of the three
/// coordinates in turn. Coordinates are below 2^21.
fn z_order(cell: [u32; 3]) -> u64 {
    let bit =
        |index: u32, axis: usize| u64::from(cell[axis] >> index & 1) << (3 * index + axis as u32);
    (0..21).flat_map(|index| (0..3).map(move |axis| bit(index, axis))).sum()
}

/// Half the side of the room, in metres: the density is the same for any number of particles, except
/// that a few of them are given at least the room they start in.
fn half_side(centers: &[Vec3]) -> f32 {
    let by_volume = root(centers.len() as f64 * VOLUME_PER_PARTICLE) as f32 / 2.0;
    let farthest = centers.iter().map(|center| center.abs().max_element()).fold(0.0, f32::max);
    by_volume.max(farthest + RADIUS + CONTACT_RADIUS)
}

/// The cube root by Newton's method, which unlike the platform's is the same on every machine.
fn root(value: f64) -> f64 {
    let mut root = value.max(1.0);
    for _ in 0..64 {
        root -= (root - value / (root * root)) / 3.0;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots() {
        for value in [0.046, 1.0, 27.0, 13.8, 400_000.0] {
            let root = root(value);
            assert!((root * root * root / value - 1.0).abs() < 1e-12, "{value}");
        }
    }

    #[test]
    fn sites_are_distinct_and_at_the_spacing() {
        for count in [1, 2, 13, 100, 1_000] {
            let sites = lattice(count);
            assert_eq!(sites.len(), count);
            for (index, a) in sites.iter().enumerate() {
                for b in &sites[..index] {
                    assert!(a.distance(*b) > SPACING * 0.999, "{count}");
                }
            }
        }
    }

    #[test]
    fn particles_start_inside_the_room() {
        for count in [1, 2, 5, 20, 300] {
            let centers = lattice(count);
            let half = half_side(&centers) + 1e-6;
            let reach = RADIUS + CONTACT_RADIUS;
            assert!(centers.iter().all(|c| c.abs().max_element() + reach <= half), "{count}");
        }
    }

    #[test]
    fn limits() {
        assert!(ParticleScene::new(0).build().is_err());
        assert!(ParticleScene::new(ParticleScene::MAX_OBJECTS + 1).build().is_err());
        for substeps in [0, ParticleScene::MAX_SUBSTEPS + 1, u32::MAX] {
            let scene = ParticleScene { most_substeps: substeps, ..ParticleScene::new(5) };
            assert_eq!(scene.build().err(), Some(SceneError::Substeps { substeps }));
        }
        let scene = ParticleScene::new(1).build().expect("one particle is allowed");
        assert_eq!(scene.objects.len(), 7);
        let mesh = scene.objects[0].geometry.as_mesh().expect("a particle is a mesh");
        assert_eq!(mesh.topology().spring_count(), 162);
    }
}
