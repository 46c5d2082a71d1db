//! The behaviour manager of an object (Fig. 2): how it changes from frame to frame.

mod abreast;
pub(crate) mod batch;
mod bone;
pub mod drill;
mod felt;
mod fixed;
mod grasp;
mod instrument;
mod mass_spring;
pub mod piece;
mod pull;
mod received;
mod scripted;
#[allow(unsafe_code)]
mod spring_kernel;
mod spring_law;
pub mod tissue;
mod tool;
mod workspace;

use std::any::Any;
use std::hash::Hasher;

use glam::Vec3;

use self::drill::{Burr, Erosions};
use crate::geometry::{Geometry, Mesh};
use crate::interaction::{Contact, Segment};
use crate::message::Message;
use crate::object::ObjectId;
use crate::simd::Simd;

pub use bone::Bone;
pub use felt::Felt;
pub use fixed::Fixed;
pub use grasp::{Grasp, Hold, LetGo};
pub use instrument::Instrument;
pub use mass_spring::{MassSpring, MassSpringError};
pub use scripted::{Keyframe, ScriptError, Scripted};
pub use spring_kernel::Springs;
pub use tissue::Tissue;
pub use tool::{Tool, Work, Workpieces};
pub use workspace::Workspace;
pub(crate) use workspace::{CONTACTS_PER_OBJECT, Room, SpringWork};

/// How an object changes from frame to frame.
///
/// # Threads of a callback's own
///
/// A callback of this trait, of [`Detection`], [`Response`] or [`Custom`], is called by one thread. It may have others
/// help, if what comes of it does not depend on who does what. Those of [`std::thread::scope`] do with any executor.
///
/// Rayon's do with some. The pipeline's hired threads are those of a Rayon pool that has no others, and usually all of
/// them are at work: a callback's parallel iterators and `rayon::join` are done there by the thread that begins them, and
/// what is given to `rayon::spawn` waits until the run is over, so that a callback which waits for it never returns. In a
/// pool of one's own, by [`ThreadPool::install`], that pool's threads do it all. With Rayon's own executors a callback
/// must not wait for Rayon at all, not even so: see [`RayonExecutor`].
///
/// [`Detection`]: crate::interaction::Detection
/// [`Response`]: crate::interaction::Response
/// [`Custom`]: crate::message::Custom
/// [`ThreadPool::install`]: rayon::ThreadPool::install
/// [`RayonExecutor`]: crate::executor::RayonExecutor
pub trait Behavior: Any + Send + Sync {
    /// Advances the geometry by one frame.
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>);

    /// Processes one of the engine's messages that concerns the behaviour; by default it is ignored.
    fn process(&mut self, _message: &Message) {}

    /// Whether the object is scenery: it is never updated, and told of no contacts. The same as long as the behaviour
    /// is: it is asked when the object is made or taken over by an executor, and not again.
    fn is_fixed(&self) -> bool {
        false
    }

    /// Makes the behaviour of a snapshot what a renderer may ask of this one; by default it may ask nothing, and a
    /// [`Fixed`] says that. What it was may be of an earlier frame, or of another object. A panic here ends the run: a
    /// picture is not an update, of which an object could be excluded.
    fn show_in(&self, snapshot: &mut Box<dyn Behavior>) {
        *snapshot = Box::new(Fixed);
    }

    /// The bit that a tool is drilling with, if it is a drill; by default it is none.
    fn burr(&self, _geometry: &Geometry) -> Option<Burr> {
        None
    }

    /// Where bits put down what they take away, if this is bone; by default it is none.
    fn erosions(&mut self) -> Option<&mut Erosions> {
        None
    }

    /// Adds what this behaviour remembers from frame to frame to the state hash.
    fn hash_state(&self, _hasher: &mut dyn Hasher) {}
}

/// What an update is given.
pub struct Input<'a> {
    /// The frame being computed.
    pub frame: u64,
    /// The time from one frame to the next, in seconds.
    pub time_step: f32,
    /// The acceleration of gravity, in metres per second squared.
    pub gravity: Vec3,
    pub(crate) simd: Simd,
    pub(crate) object: ObjectId,
    pub(crate) received: &'a [Segment<'a>],
    pub(crate) springs: &'a mut SpringWork,
    pub(crate) post: &'a mut dyn FnMut(ObjectId, ObjectId, Message),
}

impl Input<'_> {
    /// The number of the object itself: the sender of what it posts, and the tool that a [`Grasp`], [`Hold`], [`LetGo`]
    /// or [`Cut`](tissue::Cut) of its own is by.
    #[must_use]
    pub fn object(&self) -> ObjectId {
        self.object
    }

    /// What this frame's interactions did to the object, ordered by the other object's number.
    pub fn contacts(&self) -> impl Iterator<Item = Contact> + '_ {
        self.received.iter().flat_map(|segment| segment.contacts())
    }

    /// Gives a deformable surface the impulses of [`Input::contacts`], at the node that each is at or as a whole.
    pub(super) fn apply_contacts(&self, mesh: &mut Mesh) {
        for contact in self.contacts() {
            let impulse = Vec3::from_array(contact.impulse);
            match contact.node {
                Contact::BODY => mesh.apply_body_impulse(impulse),
                node => mesh.apply_impulse(node, impulse),
            }
        }
    }

    /// Sends a message to another object, which processes it before its update of the next frame. A
    /// message to an object that does not exist, or that is quarantined by then, is lost.
    pub fn post(&mut self, to: ObjectId, message: Message) {
        (self.post)(self.object, to, message);
    }
}
