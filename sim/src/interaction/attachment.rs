//! Neighbours that have grown together: springs from one body to another, as an interaction.

use super::Detection;
use super::touches::{Touch, Touches};
use crate::object::Object;

/// A spring from a node of one body to a node of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The node of the pair's first object, and that of the second.
    pub nodes: [u32; 2],
    /// Its length at rest, in metres.
    pub rest: f32,
}

/// Finds the links of two bodies that are not at their rest length. The pair's first object is the one
/// that the first nodes of the links belong to.
///
/// As any detection it is asked of bodies whose boxes overlap, contact spheres included: those that are pulled
/// farther apart than that are not joined until they are nearer again.
///
/// A [`Touch`] is a link here: its normal points from the second node to the first, its depth is how much
/// the link is too short, in metres, and negative for one that is too long. A node that one of the bodies
/// does not have, and a link whose ends are in one place, are passed over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attached {
    links: Vec<Link>,
    /// How much longer than at rest a link may be and still hold, in metres.
    stretch: f32,
}

impl Attached {
    /// Two bodies that these links join, however long they become.
    #[must_use]
    pub fn new(links: Vec<Link>) -> Self {
        Self { links, stretch: f32::INFINITY }
    }

    /// The same for loose tissue: a link that is more than `stretch` metres longer than at rest does not
    /// hold, until its ends are nearer again. Usually 0.005.
    #[must_use]
    pub fn within(self, stretch: f32) -> Self {
        Self { stretch, ..self }
    }
}

impl Detection for Attached {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let (Some(first), Some(second)) = (first.geometry.as_mesh(), second.geometry.as_mesh())
        else {
            return;
        };
        for &Link { nodes, rest } in &self.links {
            let ends =
                first.positions.get(nodes[0] as usize).zip(second.positions.get(nodes[1] as usize));
            let Some((from, to)) = ends else { continue };
            let way = from - to;
            let length = way.length();
            if length > 0.0 && length != rest && length - rest <= self.stretch {
                touches.push(Touch {
                    nodes,
                    normal: (way / length).to_array(),
                    depth: rest - length,
                });
            }
        }
    }
}
