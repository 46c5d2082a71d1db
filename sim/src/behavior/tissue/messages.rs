//! What tools do to tissue, as messages.
//!
//! A tool posts them by [`Input::post`] as [`Message::Custom`], a host by the mailbox. What is no
//! tissue ignores them, and so does tissue if a number in them is not finite or is negative where that
//! makes no sense.
//!
//! [`Input::post`]: crate::behavior::Input::post
//! [`Message::Custom`]: crate::message::Message::Custom

use std::any::Any;

use glam::Vec3;

use super::Tissue;
use super::anchors::Grip;
use crate::geometry::{Blade, Mesh, Sweep};
use crate::message::Custom;
use crate::object::{Object, ObjectId};

/// Takes hold of the nodes within a ball as they are now; a tool that held others lets go of them.
///
/// Each node is held by a spring of its own to a point that moves with the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grasp {
    /// The tool.
    pub by: ObjectId,
    /// The middle of the ball, and where the tool is, in metres.
    pub point: Vec3,
    /// The ball's radius, in metres; usually 0.003 to 0.006.
    pub radius: f32,
    /// Of each node's spring, in newtons per metre; usually 100 to 1,000, possibly infinite.
    pub stiffness: f32,
    /// The greatest force on a node, in newtons, beyond which it slips off; usually 0.5 to 5, possibly
    /// infinite.
    pub strength: f32,
}

/// Moves a tool that holds tissue: what it holds is to follow within the next frame, evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// The tool.
    pub by: ObjectId,
    /// Where it is, in metres, on the same point of it as in [`Grasp`].
    pub position: Vec3,
}

/// Lets go of all that a tool holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LetGo {
    /// The tool.
    pub by: ObjectId,
}

/// Breaks the pins of all nodes in a ball: tissue is scraped off what it has grown onto.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scrape {
    /// The middle of the ball, in metres.
    pub center: Vec3,
    /// Its radius, in metres.
    pub radius: f32,
}

/// Cuts where a blade has been in a frame.
///
/// Frame after frame a tool's cuts go on from each other; one whose blade was out of the tissue begins a
/// new one. Where the blade lies now counts, so a tool posts this in every frame in which its blade may
/// be in the tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// The tool.
    pub by: ObjectId,
    /// Where its blade was a frame ago.
    pub before: Blade,
    /// Where it is now.
    pub now: Blade,
}

/// The tissue that an object is, and its mesh.
fn tissue(object: &mut Object) -> Option<(&mut Tissue, &mut Mesh)> {
    let behavior: &mut dyn Any = &mut *object.behavior;
    Some((behavior.downcast_mut::<Tissue>()?, object.geometry.as_mesh_mut()?))
}

impl Custom for Grasp {
    fn process(&self, object: &mut Object) {
        let Some((tissue, mesh)) = tissue(object) else { return };
        let &Self { by, point, radius, stiffness, strength } = self;
        if !(point.is_finite() && radius >= 0.0 && stiffness > 0.0 && strength >= 0.0) {
            return;
        }
        let near = |&(_, offset): &(u32, Vec3)| offset.length() <= radius;
        let offsets = (0..).zip(mesh.positions.iter().map(|position| position - point));
        let nodes = offsets.filter(near).collect();
        let force = Vec3::ZERO;
        tissue.anchors.take(Grip { by, from: point, to: point, stiffness, strength, nodes, force });
    }
}

impl Custom for Hold {
    fn process(&self, object: &mut Object) {
        let Some((tissue, _)) = tissue(object) else { return };
        let grip = tissue.anchors.grip_mut(self.by);
        if let Some(grip) = grip.filter(|_| self.position.is_finite()) {
            grip.to = self.position;
        }
    }
}

impl Custom for LetGo {
    fn process(&self, object: &mut Object) {
        if let Some((tissue, _)) = tissue(object) {
            tissue.anchors.let_go(self.by);
        }
    }
}

impl Custom for Scrape {
    fn process(&self, object: &mut Object) {
        let Some((tissue, mesh)) = tissue(object) else { return };
        let is_off = |node: u32| {
            let position = mesh.positions.get(node as usize);
            position.is_some_and(|position| (position - self.center).length() <= self.radius)
        };
        tissue.anchors.pins.retain(|pin| !is_off(pin.node));
    }
}

impl Custom for Cut {
    fn process(&self, object: &mut Object) {
        let Some((tissue, mesh)) = tissue(object) else { return };
        if self.before.is_finite() && self.now.is_finite() {
            tissue.cut(mesh, self.by, Sweep { before: self.before, now: self.now });
        }
    }
}
