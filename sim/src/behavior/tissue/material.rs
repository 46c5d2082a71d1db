//! What tissue is made of.

use thiserror::Error;

use crate::geometry::{MeshError, TopologyError};

/// What a piece of tissue is made of.
///
/// For a sheet of Young's modulus E and thickness t on a lattice of equilateral triangles, Poisson's
/// ratio 1/3, a spring's stiffness is (√3/2)·E·t. Scalp: E·t of 1 MPa × 5 mm at small strains, 4,330 N/m,
/// 5 kg/m²; dura: 30 MPa × 0.5 mm, 13,000 N/m, 0.55 kg/m².
///
/// **How stiff it can get.** A spring between nodes of inverse masses w₁ and w₂ acts at rest as one of
/// k/(1 + k h²(w₁ + w₂)) newtons per metre, for substeps of h seconds: a substep corrects each spring
/// once. Springs far beyond 1/(h²(w₁ + w₂)) are therefore stable but no stiffer than that: 50 N/m
/// at 5 mm edges, 5 kg/m² and 16 substeps at 60 frames a second. More substeps help by their square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// k of the springs along the edges, in newtons per metre; usually 20 (brain) to 13,000 (dura).
    pub stiffness: f32,
    /// k of the springs that resist bending, which join the far corners of two triangles with a common
    /// edge, in newtons per metre; usually 0.01 to 0.1 of `stiffness`, 0 for none.
    pub bending: f32,
    /// k of the springs to the centre of mass that keep a solid body's shape, in newtons per metre; usually
    /// 0 for a sheet, and `stiffness` for a solid body.
    pub to_center: f32,
    /// The rate at which velocities decay, per second: a substep of h seconds divides them by
    /// 1 + damping·h before gravity acts. Usually 1 to 10: tissue lies in tissue.
    pub damping: f32,
    /// The mass of the surface, in kilograms per square metre: density times thickness; usually 0.5
    /// (dura) to 6.6 (scalp), and for a solid body its mass over its surface.
    pub area_density: f32,
}

impl Material {
    /// The first value that is not allowed.
    pub(super) fn check(&self) -> Result<(), TissueError> {
        check("the stiffness", self.stiffness)?;
        check("the bending stiffness", self.bending)?;
        check("the stiffness to the centre", self.to_center)?;
        check("the damping", self.damping)?;
        check("the area density", self.area_density)
    }
}

pub(super) fn check(what: &'static str, value: f32) -> Result<(), TissueError> {
    if value >= 0.0 && value.is_finite() { Ok(()) } else { Err(TissueError::Value { what, value }) }
}

/// Why tissue cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum TissueError {
    /// A stiffness, a damping, a density or a strength is negative or not finite. (A pin's stiffness
    /// and strength may be infinite.)
    #[error("{what} is {value}; it must be finite and not negative")]
    Value {
        /// The name of the value.
        what: &'static str,
        /// The value.
        value: f32,
    },
    /// There are no substeps.
    #[error("a frame needs at least one substep")]
    NoSubsteps,
    /// A node without mass: it is in no triangle that has an area.
    #[error("node {node} has no mass; every node must be in a triangle that has an area")]
    Massless {
        /// The node.
        node: usize,
    },
    /// A pin of a node that the tissue does not have.
    #[error("a pin names node {node}, but the tissue has {nodes} nodes")]
    NoSuchNode {
        /// The node named.
        node: u32,
        /// The number of nodes.
        nodes: usize,
    },
    /// An edge with more than two triangles, or with two that run along it in the same direction.
    #[error("the edge of nodes {} and {} has more than one triangle on one side", .edge[0], .edge[1])]
    Manifold {
        /// The edge.
        edge: [u32; 2],
    },
    /// The triangles are not allowed.
    #[error(transparent)]
    Topology(#[from] TopologyError),
    /// The masses are not allowed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
