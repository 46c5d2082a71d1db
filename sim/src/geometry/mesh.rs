//! A deformable surface: nodes with positions, velocities and masses.

use std::sync::Arc;

use glam::Vec3;
use thiserror::Error;

use super::extent::{Extent, Measure};
use super::topology::Topology;
use super::vectors::{Lanes, Line, Vectors, in_lanes};
use crate::simd::Simd;

/// Why a mesh cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum MeshError {
    /// The number of positions or masses is not the topology's number of nodes.
    #[error("{given} {what} were given for {nodes} nodes")]
    Length {
        /// What there were too many or too few of.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// The number of nodes.
        nodes: usize,
    },
    /// A mass is negative or not finite, or so small that its inverse is not finite.
    #[error(
        "the mass of node {node} is {mass} kg; it and its inverse must be finite and not negative"
    )]
    Mass {
        /// The node.
        node: usize,
        /// Its mass, in kilograms.
        mass: f32,
    },
    /// The contact radius is negative or not finite.
    #[error("the contact radius is {radius} m; it must be finite and not negative")]
    Radius {
        /// The radius, in metres.
        radius: f32,
    },
}

/// A deformable surface.
#[derive(Clone, Debug)]
pub struct Mesh {
    topology: Arc<Topology>,
    /// The nodes' positions, in metres.
    pub positions: Vectors,
    /// The nodes' velocities, in metres per second.
    pub velocities: Vectors,
    /// Bodies of one make share them: a quarter less to be brought into the caches for each.
    masses: Arc<Masses>,
    contact_radius: f32,
}

/// The nodes' masses, which never change.
#[derive(Debug)]
struct Masses {
    /// In kilograms.
    masses: Vec<Lanes>,
    /// In 1/kg.
    inverse: Vec<Lanes>,
}

impl Mesh {
    /// A surface at rest.
    ///
    /// `positions` are in metres, `masses` in kilograms, one each per node; a node of mass 0 is held
    /// fast: no force moves it. `contact_radius`, in metres, is that of the contact sphere which each
    /// node carries.
    ///
    /// # Errors
    /// Lists of another length than the topology's number of nodes; a mass or radius that is negative or not
    /// finite, or a mass that is less than 1/[`f32::MAX`] and not 0.
    pub fn new(
        topology: Arc<Topology>,
        positions: &[Vec3],
        masses: &[f32],
        contact_radius: f32,
    ) -> Result<Self, MeshError> {
        let nodes = topology.nodes();
        check_length("masses", masses.len(), nodes)?;
        let is_right = |value: f32| value >= 0.0 && value.is_finite();
        let inverse = |&mass: &f32| if mass > 0.0 { 1.0 / mass } else { 0.0 };
        let wrong = |&(_, mass): &(usize, &f32)| !(is_right(*mass) && inverse(mass).is_finite());
        if let Some((node, &mass)) = masses.iter().enumerate().find(wrong) {
            return Err(MeshError::Mass { node, mass });
        }
        if !is_right(contact_radius) {
            return Err(MeshError::Radius { radius: contact_radius });
        }
        let masses = Masses {
            inverse: in_lanes(masses.iter().map(inverse), nodes),
            masses: in_lanes(masses.iter().copied(), nodes),
        };
        Self::at_rest(topology, Arc::new(masses), positions, contact_radius)
    }

    /// Another surface of the same make, at rest, with its nodes at `positions`, in metres.
    ///
    /// # Errors
    /// A list of another length than the number of nodes.
    pub fn another(&self, positions: &[Vec3]) -> Result<Self, MeshError> {
        let (topology, masses) = (Arc::clone(&self.topology), Arc::clone(&self.masses));
        Self::at_rest(topology, masses, positions, self.contact_radius)
    }

    fn at_rest(
        topology: Arc<Topology>,
        masses: Arc<Masses>,
        positions: &[Vec3],
        contact_radius: f32,
    ) -> Result<Self, MeshError> {
        let nodes = topology.nodes();
        check_length("positions", positions.len(), nodes)?;
        let (positions, velocities) = (Vectors::from_slice(positions), Vectors::zeros(nodes));
        Ok(Self { topology, positions, velocities, masses, contact_radius })
    }

    /// What the nodes are joined by.
    #[must_use]
    pub fn topology(&self) -> &Arc<Topology> {
        &self.topology
    }

    /// The nodes' masses, in kilograms; 0 for a node that is held fast.
    #[must_use]
    pub fn masses(&self) -> &[f32] {
        &self.masses.masses.as_flattened()[..self.topology.nodes()]
    }

    /// The nodes' inverse masses, in 1/kg; 0 for a node that is held fast.
    pub(crate) fn inverse_masses(&self) -> &[f32] {
        &self.masses.inverse.as_flattened()[..self.topology.nodes()]
    }

    /// The radius of each node's contact sphere, in metres.
    #[must_use]
    pub fn contact_radius(&self) -> f32 {
        self.contact_radius
    }

    /// Gives every node the same velocity, in metres per second.
    pub fn set_velocity(&mut self, velocity: Vec3) {
        for node in 0..self.velocities.len() {
            self.velocities.set(node, velocity);
        }
    }

    /// Changes a node's velocity by an impulse, in newton seconds; a node past the last is ignored.
    pub fn apply_impulse(&mut self, node: u32, impulse: Vec3) {
        let node = node as usize;
        if let Some(&inverse_mass) = self.masses.inverse.as_flattened().get(node) {
            self.velocities.add(node, impulse * inverse_mass);
        }
    }

    /// Changes the velocities of all nodes by equal shares of an impulse, in newton seconds.
    pub fn apply_body_impulse(&mut self, impulse: Vec3) {
        let share = (impulse / self.topology.nodes().max(1) as f32).to_array();
        for (component, share) in self.velocities.components_mut().into_iter().zip(share) {
            for (velocities, inverse_masses) in component.iter_mut().zip(&self.masses.inverse) {
                for (velocity, inverse_mass) in velocities.iter_mut().zip(inverse_masses) {
                    *velocity += share * inverse_mass;
                }
            }
        }
    }

    /// Multiplies the velocities of all nodes that are not held fast.
    pub(crate) fn damp(&mut self, factor: f32) {
        for component in self.velocities.components_mut() {
            for (velocities, masses) in component.iter_mut().zip(&self.masses.masses) {
                for (velocity, &mass) in velocities.iter_mut().zip(masses) {
                    *velocity *= if mass > 0.0 { factor } else { 1.0 };
                }
            }
        }
    }

    /// The mean of the nodes' positions, in metres.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.extent(Simd::detect()).center
    }

    /// Where it is, by these instructions.
    pub(super) fn extent(&self, simd: Simd) -> Extent {
        simd.run(Measure(self))
    }

    /// Whether positions and velocities, which anybody may replace, are as many as there are nodes.
    pub(crate) fn is_whole(&self) -> bool {
        [&self.positions, &self.velocities].iter().all(|list| list.len() == self.topology.nodes())
    }

    /// Becomes a copy of another mesh; gives up no memory of positions and velocities unless topologies differ.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        if !Arc::ptr_eq(&self.topology, &other.topology) {
            self.clone_from(other);
            return;
        }
        // Bodies of one topology may still differ in mass.
        if !Arc::ptr_eq(&self.masses, &other.masses) {
            self.masses.clone_from(&other.masses);
        }
        self.contact_radius = other.contact_radius;
        self.positions.copy_from(&other.positions);
        self.velocities.copy_from(&other.velocities);
    }

    /// Where positions and velocities are in memory.
    pub(crate) fn lines(&self) -> [&[Line]; 2] {
        [self.positions.lines(), self.velocities.lines()]
    }

    /// The parts a kernel works on, all borrowed at once.
    pub(crate) fn kernel_parts(&mut self) -> KernelParts<'_> {
        KernelParts {
            topology: &self.topology,
            positions: self.positions.lines_mut(),
            velocities: self.velocities.lines_mut(),
            masses: &self.masses.masses,
            inverse_masses: &self.masses.inverse,
            contact_radius: self.contact_radius,
        }
    }
}

fn check_length(what: &'static str, given: usize, nodes: usize) -> Result<(), MeshError> {
    if given == nodes { Ok(()) } else { Err(MeshError::Length { what, given, nodes }) }
}

/// A mesh, taken apart for a kernel.
pub(crate) struct KernelParts<'a> {
    pub(crate) topology: &'a Topology,
    pub(crate) positions: &'a mut [Line],
    pub(crate) velocities: &'a mut [Line],
    pub(crate) masses: &'a [Lanes],
    pub(crate) inverse_masses: &'a [Lanes],
    /// In metres.
    pub(crate) contact_radius: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(mass: f32, contact_radius: f32) -> Result<Mesh, MeshError> {
        let topology = Topology::new(&[Vec3::ZERO], Vec::new(), &[], false).expect("a node");
        Mesh::new(Arc::new(topology), &[Vec3::ZERO], &[mass], contact_radius)
    }

    #[test]
    fn masses_and_radii_that_cannot_be() {
        for value in [-1.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(mesh(value, 1.0), Err(MeshError::Mass { node: 0, .. })), "{value}");
            assert!(matches!(mesh(1.0, value), Err(MeshError::Radius { .. })), "{value}");
        }
        assert!(
            matches!(mesh(1e-39, 1.0), Err(MeshError::Mass { node: 0, .. })),
            "1/m is infinite"
        );
        for (mass, radius) in [(0.0, 0.0), (1e-38, 1.0), (f32::MAX, f32::MAX)] {
            assert!(mesh(mass, radius).is_ok(), "{mass} kg, {radius} m");
        }
    }

    /// Two nodes, the first of which is held.
    fn half_held(masses: [f32; 2], contact_radius: f32, topology: &Arc<Topology>) -> Mesh {
        let places = [Vec3::ZERO, Vec3::X];
        let mut mesh = Mesh::new(Arc::clone(topology), &places, &masses, contact_radius)
            .expect("as many masses as nodes");
        mesh.set_velocity(Vec3::X);
        mesh
    }

    fn pair() -> Arc<Topology> {
        let places = [Vec3::ZERO, Vec3::X];
        Arc::new(Topology::new(&places, Vec::new(), &[], false).expect("two nodes"))
    }

    #[test]
    fn what_is_held_goes_on_as_it_is_moved() {
        let mut mesh = half_held([0.0, 1.0], 0.1, &pair());
        mesh.damp(0.5);
        assert_eq!(mesh.velocities, Vectors::from_slice(&[Vec3::X, Vec3::X * 0.5]));
    }

    #[test]
    fn a_copy_is_the_whole_mesh() {
        let topology = pair();
        let from = half_held([0.0, 1.0], 0.1, &topology);
        for other in [topology, pair()] {
            let mut to = half_held([2.0, 3.0], 0.2, &other);
            to.set_velocity(Vec3::ZERO);
            to.copy_from(&from);
            assert!(Arc::ptr_eq(to.topology(), from.topology()));
            assert_eq!((to.masses(), to.contact_radius()), (from.masses(), 0.1));
            assert_eq!(to.inverse_masses(), from.inverse_masses());
            assert_eq!(
                (to.positions, to.velocities),
                (from.positions.clone(), from.velocities.clone())
            );
        }
    }
}
