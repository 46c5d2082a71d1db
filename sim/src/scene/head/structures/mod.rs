//! The deformable structures: what there is, what it is made of and where it has grown on.
//!
//! | layer | structures |
//! |---|---|
//! | scalp: skin and galea, 5 mm | right frontotemporoparietal (operative), frontal, left, occipital, right mastoid |
//! | muscle, 8 mm | right and left temporalis |
//! | periosteum, 1 mm | right, under the operative scalp |
//! | dura, 0.5 mm | right convexity (operative), left convexity, posterior, falx, tentorium |
//! | brain, solid | frontal, parietal, temporal and occipital lobe on both sides, cerebellum, brainstem |
//! | vessels, tubes | superior sagittal sinus, middle meningeal artery, bridging vein, superficial temporal artery |

mod brain;
mod coverings;
mod make;
mod vessels;

use glam::Vec3;

use super::error::HeadError;
use super::layers::Layers;

pub(super) use vessels::resampled;

/// What a structure is part of, from the outside in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Skin and galea, which move as one over the loose tissue below them.
    Scalp,
    /// Muscle.
    Muscle,
    /// The skin of the bone.
    Periosteum,
    /// The hard skin of the brain and its folds.
    Dura,
    /// Brain.
    Brain,
    /// Blood vessels.
    Vessel,
}

/// The form of a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A surface with a border: thin tissue.
    Sheet,
    /// A closed surface that stands for what is inside.
    Solid,
    /// A closed tube: a ring of six nodes for each point of its path, in order, then the middles of its
    /// first and its last one.
    Tube,
}

/// How firmly a node is held to what does not move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// Grown together: not to be parted by hand. Usually never tears.
    Firm,
    /// Held by loose tissue that a blunt instrument parts: the areolar layer below the scalp, periosteum
    /// and dura on bone. Usually tears at 0.1 to 1 N a node.
    Loose,
}

/// A deformable structure at rest. Every surface is a manifold, consistently oriented, without
/// triangles of no area.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// What anatomists call it.
    pub name: &'static str,
    /// What it is part of.
    pub layer: Layer,
    /// Its form.
    pub form: Form,
    /// The nodes' places in the world, in metres.
    pub positions: Vec<Vec3>,
    /// Its triangles, counter-clockwise as seen from outside: from the side of the skin for what lies
    /// around the brain, from the right for the falx, from above for the tentorium.
    pub triangles: Vec<[u32; 3]>,
    /// Where it is held, in ascending order of nodes.
    pub pins: Vec<(u32, Hold)>,
    /// The stiffness of a spring along an edge, in newtons per metre: (√3/2)·E·t of a sheet or a vessel's
    /// wall, E times the edge's length of a solid body.
    pub stiffness: f32,
    /// Its mass over its surface, in kilograms per square metre.
    pub area_density: f32,
    /// The radius of a node's contact sphere, in metres.
    pub contact_radius: f32,
    /// Its colour: red, green, blue and opacity, linear, from 0 to 1.
    pub color: [f32; 4],
}

/// All 27 structures, always in the same order.
pub(super) fn structures(layers: &Layers) -> Result<Vec<Structure>, HeadError> {
    let made = coverings::make(layers).chain(brain::make(layers)).chain(vessels::make(layers));
    made.map(|structure| {
        let whole = !structure.triangles.is_empty();
        if whole { Ok(structure) } else { Err(HeadError::Structure { name: structure.name }) }
    })
    .collect()
}
