//! What a tool feels of a frame's contacts.

use glam::Vec3;

use crate::interaction::Contact;

/// The forces on a tool in a frame, in newtons.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reaction {
    /// All of them together, in the world's axes.
    pub force: Vec3,
    /// The part that bone presses back with, without friction.
    pub elastic: Vec3,
    /// The axial load on the bit's tip: that which the bone under the tip would bear alone.
    pub tip: f32,
    /// What `elastic` grows by as the bit goes deeper, in newtons per metre, along the bone's outward normals: as
    /// in a flat half-space, and so too little where a ball has bone on two sides.
    pub stiffness: Vec3,
}

impl Reaction {
    /// The node number of a contact that tells a tool what bone presses back with. It is a part of what
    /// the contact with [`Contact::BODY`] says, and not to be added to it.
    pub const ELASTIC: u32 = 0;
    /// The node number of a contact that tells a tool the load on its tip, along its axis; likewise.
    pub const TIP: u32 = 1;
    /// The node number of a contact that tells a tool how stiff bone is under it: what the elastic impulse
    /// would grow by in a metre, as it goes in the first micrometres; likewise.
    pub const STIFFNESS: u32 = 2;

    /// What a frame's contacts say of a rigid tool; `time_step` is the frame's, in seconds.
    #[must_use]
    pub fn new(contacts: impl Iterator<Item = Contact>, time_step: f32) -> Self {
        let mut reaction = Self::default();
        for contact in contacts {
            let force = Vec3::from_array(contact.impulse) / time_step;
            match contact.node {
                Contact::BODY => reaction.force += force,
                Self::ELASTIC => reaction.elastic += force,
                Self::TIP => reaction.tip += force.length(),
                Self::STIFFNESS => reaction.stiffness += force,
                _ => {}
            }
        }
        reaction
    }

    /// The outward normal of the bone that is touched, of unit length.
    #[must_use]
    pub fn normal(&self) -> Option<Vec3> {
        self.elastic.try_normalize()
    }

    /// How hard bone and bit press on each other.
    #[must_use]
    pub fn load(&self) -> f32 {
        self.elastic.length()
    }

    /// How stiff the bone is along its normal, in newtons per metre; 0 where nothing is touched.
    #[must_use]
    pub fn normal_stiffness(&self) -> f32 {
        self.normal().map_or(0.0, |normal| self.stiffness.dot(normal).max(0.0))
    }
}
