//! The geometry module of an object (Fig. 2): what it is shaped like and where it is.

mod bounds;
mod cut;
mod extent;
mod icosphere;
mod mesh;
mod ray;
mod rigid;
pub(crate) mod rotation;
mod topology;
pub(crate) mod union;
mod vectors;
mod volume;

pub use bounds::Bounds;
pub use cut::Blade;
pub(crate) use cut::{Birth, CutNode, CutSurface, Sweep};
pub use extent::Extent;
pub(crate) use extent::ROUNDING_MARGIN;
pub use icosphere::{ICOSPHERE_EDGES, ICOSPHERE_FACES, ICOSPHERE_NODES, icosphere};
pub(crate) use mesh::KernelParts;
pub use mesh::{Mesh, MeshError};
pub use rigid::Rigid;
pub(crate) use topology::Slot;
pub use topology::{Spring, Topology, TopologyError, edges};
pub use vectors::{LANES, Lanes, Vectors};
pub(crate) use vectors::{Line, component, component_mut, components, components_mut};
pub use volume::{BRICK_SIDE, BRICK_VOXELS, Brick, Part, Volume, VolumeError, Voxel};

use crate::simd::Simd;

/// An object's shape and place.
#[derive(Clone)]
pub enum Geometry {
    /// A deformable surface.
    Mesh(Mesh),
    /// A rigid shape with a pose.
    Rigid(Rigid),
    /// Voxel bone.
    Volume(Volume),
}

impl Geometry {
    /// The deformable surface, if it is one.
    #[must_use]
    pub fn as_mesh(&self) -> Option<&Mesh> {
        match self {
            Self::Mesh(mesh) => Some(mesh),
            Self::Rigid(_) | Self::Volume(_) => None,
        }
    }

    /// The deformable surface, to change it, if it is one.
    pub fn as_mesh_mut(&mut self) -> Option<&mut Mesh> {
        match self {
            Self::Mesh(mesh) => Some(mesh),
            Self::Rigid(_) | Self::Volume(_) => None,
        }
    }

    /// The rigid shape, if it is one.
    #[must_use]
    pub fn as_rigid(&self) -> Option<&Rigid> {
        match self {
            Self::Rigid(rigid) => Some(rigid),
            Self::Mesh(_) | Self::Volume(_) => None,
        }
    }

    /// The rigid shape, to change it, if it is one.
    pub fn as_rigid_mut(&mut self) -> Option<&mut Rigid> {
        match self {
            Self::Rigid(rigid) => Some(rigid),
            Self::Mesh(_) | Self::Volume(_) => None,
        }
    }

    /// The voxel bone, if it is that.
    #[must_use]
    pub fn as_volume(&self) -> Option<&Volume> {
        match self {
            Self::Volume(volume) => Some(volume),
            Self::Mesh(_) | Self::Rigid(_) => None,
        }
    }

    /// The voxel bone, to change it, if it is that.
    pub fn as_volume_mut(&mut self) -> Option<&mut Volume> {
        match self {
            Self::Volume(volume) => Some(volume),
            Self::Mesh(_) | Self::Rigid(_) => None,
        }
    }

    /// Where it is, by these instructions.
    #[must_use]
    pub fn extent(&self, simd: Simd) -> Extent {
        match self {
            Self::Mesh(mesh) => mesh.extent(simd),
            Self::Rigid(rigid) => {
                Extent::new(rigid.bounds(), rigid.pose.translation, rigid.is_finite())
            }
            Self::Volume(volume) => {
                let bounds = volume.bounds().inflated(volume.margin);
                Extent::new(bounds, volume.center(), volume.is_finite())
            }
        }
    }
}
