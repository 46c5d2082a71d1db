//! What tools do to tissue, as messages; how they hold it is a matter of [`Grasp`].
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
use crate::behavior::grasp::{Grasp, Hold, Holdable};
use crate::geometry::{Blade, Geometry, Mesh, Sweep};
use crate::message::Custom;
use crate::object::{Object, ObjectId};

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
/// Frame after frame a tool's cuts go on from each other; one whose blade was out of the tissue, or that a frame went by
/// without, begins a new one. Where the blade lies now counts, so a tool posts this in every frame in which its blade may
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

impl Holdable for Tissue {
    fn take(&mut self, geometry: &Geometry, grasp: &Grasp) {
        let Some(mesh) = geometry.as_mesh() else { return };
        let &Grasp { by, point, radius, stiffness, strength } = grasp;
        let somewhere = point.is_finite() && radius.is_finite() && radius >= 0.0;
        if !(somewhere && stiffness > 0.0 && strength >= 0.0) {
            return;
        }
        let near = |&(_, offset): &(u32, Vec3)| offset.length() <= radius;
        let offsets = (0..).zip(mesh.positions.iter().map(|position| position - point));
        let nodes = offsets.filter(near).collect();
        let force = Vec3::ZERO;
        self.anchors.take(Grip { by, from: point, to: point, stiffness, strength, nodes, force });
    }

    fn hold(&mut self, hold: &Hold) {
        if let Some(grip) = self.anchors.grip_mut(hold.by) {
            grip.to = hold.position;
        }
    }

    fn let_go(&mut self, by: ObjectId) {
        self.anchors.let_go(by);
    }
}

impl Custom for Scrape {
    fn process(&self, object: &mut Object) {
        let Some((tissue, mesh)) = tissue(object).filter(|_| self.radius.is_finite()) else {
            return;
        };
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
