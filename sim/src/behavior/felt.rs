//! What bodies tell a tool that works on them.

use glam::Vec3;

use super::Tool;
use crate::message::Custom;
use crate::object::Object;

/// A message from a body to a tool: what the body did to it in the last frame. What several bodies tell
/// in a frame adds up; what is no tool ignores it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Felt {
    /// The force of what the tool holds on it, in newtons.
    pub held: Vec3,
    /// Whether the tool's edge is in the body.
    pub cuts: bool,
}

impl Custom for Felt {
    fn process(&self, object: &mut Object) {
        if let Some(tool) = Tool::of_mut(object) {
            tool.told(*self);
        }
    }
}
