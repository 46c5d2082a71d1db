//! The message passing interface (§6.2).

use std::fmt;

use crate::object::{Object, ObjectId};

/// Something told to an object. It is processed immediately before the object's next update; what is
/// posted in frame f's updates is processed in frame f+1's, ordered by sender and then by the order
/// of posting.
#[derive(Debug)]
pub enum Message {
    /// Changes the velocity of one node. Nodes that do not exist are ignored.
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
    /// Switches the pull of gravity off (`true`) or on.
    Weightless(bool),
    /// Takes the object out of the environment for good.
    Remove,
    /// A message of the application's own making.
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
pub trait Custom: fmt::Debug + Send + Sync {
    /// Changes the object as the message says.
    fn process(&self, object: &mut Object);
}
