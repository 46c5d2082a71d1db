//! The message passing interface (§6.2).

use std::any::Any;
use std::fmt;

use crate::behavior::Instrument;
use crate::device::DeviceSample;
use crate::object::{Object, ObjectId};

/// Something told to an object. It is processed immediately before the object's next update; what is
/// posted in frame f's updates is processed in frame f+1's, ordered by sender and then by the order
/// of posting.
#[derive(Debug)]
pub enum Message {
    /// Changes the velocity of one node of a deformable body. Nodes that do not exist are ignored, and other bodies; the
    /// behaviour is not asked. An impulse that is not finite is the end of the object: it is quarantined.
    Impulse {
        /// The node.
        node: u32,
        /// The impulse, in newton seconds.
        impulse: [f32; 3],
    },
    /// Sets the stiffness of a mass–spring body's springs, in newtons per metre; negative or
    /// non-finite values are ignored.
    Stiffness {
        /// Of the springs between nodes.
        between_nodes: f32,
        /// Of the springs to the centre.
        to_center: f32,
    },
    /// Sets the damping of a mass–spring body's springs, in newton seconds per metre, usually 0.02 for a particle
    /// ([`MassSpring`] says how much is stable); or that of a [`Tissue`], a rate per second, usually 1 to 10
    /// ([`Material::damping`]). Negative or non-finite values are ignored. Who sends it has to know which of the two
    /// the object is.
    ///
    /// [`MassSpring`]: crate::behavior::MassSpring
    /// [`Tissue`]: crate::behavior::Tissue
    /// [`Material::damping`]: crate::behavior::tissue::Material::damping
    Damping(f32),
    /// Pulls a mass–spring body by a damped spring from one node to a point fixed in space, in every
    /// update from this one on until it is released or pulled otherwise: a person holds it.
    ///
    /// A resting body's node is off its target by about the force on the body over the stiffness: by its
    /// weight's, say. The damping is critical for the whole body's mass on the spring. Any stiffness is
    /// stable, for one of more than m/(2t²) acts like that, with the node's mass m and the frame's time
    /// t: 288 N/m for a particle at 240 frames a second. Negative or non-finite values are ignored, and
    /// nodes that do not exist or are held fast are not pulled.
    Pull {
        /// The node.
        node: u32,
        /// The point, in metres.
        target: [f32; 3],
        /// The spring's stiffness, in newtons per metre; usually 50 to 200 for a particle.
        stiffness: f32,
    },
    /// Lets go of what was pulled.
    Release,
    /// Switches the pull of gravity off (`true`) or on.
    Weightless(bool),
    /// Where the device is that moves a tool; what is no tool ignores it.
    Device(DeviceSample),
    /// A tool switch: a tool becomes another instrument; what is no tool ignores it.
    TakeUp(Instrument),
    /// Takes the object out of the environment for good.
    Remove,
    /// A message of the application's own making, or one of those of the engine's behaviours, as [`Grasp`] or [`Cut`].
    ///
    /// [`Grasp`]: crate::behavior::Grasp
    /// [`Cut`]: crate::behavior::tissue::Cut
    Custom(Box<dyn Custom>),
}

/// A message under way.
#[derive(Debug)]
pub struct Letter {
    /// The frame in whose update it is to be processed.
    pub due: u64,
    /// Whom it is for.
    pub to: ObjectId,
    /// Who sent it; [`ObjectId::HOST`] if it came from outside.
    pub from: ObjectId,
    /// What it says.
    pub message: Message,
}

/// A message of the application's own making: the paper's base class with its *processMessage*
/// callback.
pub trait Custom: Any + fmt::Debug + Send + Sync {
    /// Changes the object as the message says. Its number and group, and whether it is solitary, stay what they
    /// were, also if another object is put in its place; what is scenery stays grouped with scenery.
    fn process(&self, object: &mut Object);
}
