//! The craniotomy (§7.1.2): two tools, 27 soft structures and the skull.
//!
//! | room | what it does |
//! |---|---|
//! | `build` | the objects and the modelled interactions, from a [`Head`] |
//! | `script`, `steps` | what two hands do, step by step of the operation |
//! | [`Operation`] | what the host does: it moves the hands, keeps the score and frees bone |
//! | `feel` | joins a hand with a haptic loop, so that it moves a tool and feels it |
//! | `freeing` | bone that a closed cut has freed becomes an object of its own |
//! | [`Report`] | what educators measure |
//! | `opening` | how the opening in the skull came out, beside the plan |

mod build;
mod feel;
mod freeing;
mod opening;
mod operation;
mod score;
mod script;
mod steps;

use crate::object::{Group, ObjectId};

pub use build::{BuildError, build};
pub use opening::Margin;
pub use operation::{LOOK_FRAMES, Operation};
pub use score::{Placement, Report};
pub use steps::Step;

use super::head::Head;

/// The time from one frame to the next, in seconds; usually 1/60. A craniotomy has no other: with one that
/// [`VeManager::change`] sets, bone would stop free pieces too early or too late, and seconds of the script and of the
/// score would be none.
///
/// [`VeManager::change`]: crate::manager::VeManager::change
pub const TIME_STEP: f32 = 1.0 / 60.0;
/// The two tools.
pub const TOOLS: [ObjectId; 2] = [ObjectId(0), ObjectId(1)];
/// The first of the 27 structures, which are numbered as in [`Head::structures`].
pub const FIRST_STRUCTURE: ObjectId = ObjectId(2);
/// The skull.
pub const SKULL: ObjectId = ObjectId(2 + Head::STRUCTURES as u32);
/// The number of objects at the start.
pub const OBJECTS: usize = SKULL.0 as usize + 1;
/// The group of tools.
const TOOL_GROUP: Group = Group(0);
/// The group of the skull.
const SKULL_GROUP: Group = Group(1);
/// The group of free pieces of bone.
const PIECES: Group = Group(2);
/// The group of the first structure: each has one of its own, so that only those interact that touch.
const FIRST_GROUP: u8 = 3;
