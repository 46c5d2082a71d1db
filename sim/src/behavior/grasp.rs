//! How tools hold things, as messages to what is held: tissue or a free piece of bone.
//!
//! A tool posts them by [`Input::post`] as [`Message::Custom`], a host by the mailbox. What cannot be held
//! ignores them, and so does everything if a number in them is not finite, or is negative where that makes no
//! sense.
//!
//! [`Input::post`]: super::Input::post
//! [`Message::Custom`]: crate::message::Message::Custom

use std::any::Any;

use glam::Vec3;

use super::piece::Piece;
use super::tissue::Tissue;
use crate::geometry::Geometry;
use crate::message::Custom;
use crate::object::{Object, ObjectId};

/// Takes hold of what is within a ball; a tool that held anything else of the object lets go of it.
///
/// Tissue is held by its nodes there as they are now, each by a spring of its own to a point that moves with
/// the tool; it holds none if there are none. A piece that has bone there is held at the ball's middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grasp {
    /// The tool.
    pub by: ObjectId,
    /// The middle of the ball, and where the tool is, in metres.
    pub point: Vec3,
    /// The ball's radius, in metres; usually 0.003 to 0.008.
    pub radius: f32,
    /// Of each spring, in newtons per metre; usually 100 to 1,000. Any stiffness is stable; for tissue it may
    /// be infinite.
    pub stiffness: f32,
    /// The greatest force on a node of tissue, in newtons, beyond which it slips off, possibly infinite;
    /// usually 0.5 to 10. The greatest force on a piece, which is never dropped; usually 20.
    pub strength: f32,
}

/// Moves a tool that holds: what it holds is to follow. Tissue follows within the next frame, evenly.
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

/// What can be held.
pub(super) trait Holdable {
    fn take(&mut self, geometry: &Geometry, grasp: &Grasp);
    fn hold(&mut self, hold: &Hold);
    fn let_go(&mut self, by: ObjectId);
}

/// What of an object can be held, if anything.
fn holdable(object: &mut Object) -> Option<(&mut dyn Holdable, &Geometry)> {
    let behavior: &mut dyn Any = &mut *object.behavior;
    let held: &mut dyn Holdable = if behavior.is::<Tissue>() {
        behavior.downcast_mut::<Tissue>()?
    } else {
        behavior.downcast_mut::<Piece>()?
    };
    Some((held, &object.geometry))
}

impl Custom for Grasp {
    fn process(&self, object: &mut Object) {
        if let Some((held, geometry)) = holdable(object) {
            held.take(geometry, self);
        }
    }
}

impl Custom for Hold {
    fn process(&self, object: &mut Object) {
        if let Some((held, _)) = holdable(object).filter(|_| self.position.is_finite()) {
            held.hold(self);
        }
    }
}

impl Custom for LetGo {
    fn process(&self, object: &mut Object) {
        if let Some((held, _)) = holdable(object) {
            held.let_go(self.by);
        }
    }
}
