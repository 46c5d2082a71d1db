//! What a picture looks like, apart from its objects.

use dualframe_sim::geometry::Bounds;
use glam::Vec3;

/// What the colour of a surface says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coloring {
    /// The object's own colour.
    #[default]
    Object,
    /// How far the springs along the sides of each node's triangles are stretched (red at 20 %) or pressed (blue at
    /// −20 %), from their length at rest (grey); where a surface ends, one of the two along its border. Bodies without
    /// springs keep their own colour.
    Strain,
    /// How fast each node is, or a rigid shape as a whole: from nearly black at rest over red and yellow to white at
    /// 3 m/s.
    Speed,
}

impl Coloring {
    /// Every colouring.
    pub const ALL: [Self; 3] = [Self::Object, Self::Strain, Self::Speed];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Object => "object",
            Self::Strain => "strain",
            Self::Speed => "speed",
        }
    }
}

/// How much work is spent on a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Hard-edged shadows, one sample a pixel: for adapters in software.
    Fast,
    /// Soft shadows, shade in crevices, four samples a pixel.
    Fine,
}

impl Quality {
    /// Samples a pixel.
    pub(crate) fn samples(self) -> u32 {
        match self {
            Self::Fast => 1,
            Self::Fine => 4,
        }
    }

    /// The width and height of the shadow map, in pixels.
    pub(crate) fn shadow_size(self) -> u32 {
        match self {
            Self::Fast => 1_024,
            Self::Fine => 2_048,
        }
    }
}

/// What a picture looks like, apart from its objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// The box that holds the objects, in metres. Light and shadow are fitted to it.
    pub focus: Bounds,
    /// Whether the focus is a room whose floor and far walls are drawn.
    pub room: bool,
    /// Towards the light, of any length.
    pub light: Vec3,
    /// What the colour of surfaces says.
    pub coloring: Coloring,
}

impl Look {
    /// A room, lit from above and behind the viewer's left shoulder.
    #[must_use]
    pub fn room(focus: Bounds) -> Self {
        let light = Vec3::new(-0.35, 1.0, 0.6);
        Self { focus, room: true, light, coloring: Coloring::default() }
    }
}
