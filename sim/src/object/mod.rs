//! The 3D Object (§4.1, Fig. 2): a container into which visual properties, geometry, behaviour and a
//! way of drawing are plugged.

mod fault;
mod visual;

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use glam::Vec3;

use crate::behavior::{Behavior, Fixed};
use crate::cost::Cost;
use crate::geometry::{Bounds, Extent, Geometry};
use crate::message::Message;
use crate::simd::{Simd, prefetch, prefetch_to_write};

pub use fault::{Fault, FaultKind};
pub use visual::{Drawing, VisualProperties};

/// An object's number. The objects of an environment are numbered from 0 without gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectId(pub u32);

impl ObjectId {
    /// The sender of messages that come from outside the environment. No object has this number.
    pub const HOST: Self = Self(u32::MAX);
}

impl fmt::Display for ObjectId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "object {}", self.0)
    }
}

/// The kind of an object, by which the rule table says what interactions are modelled: 0 to 31; what is of a greater one
/// has no rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Group(pub u8);

impl Group {
    /// The number of groups there can be.
    pub const COUNT: usize = 32;
}

/// An element of the virtual environment.
pub struct Object {
    id: ObjectId,
    group: Group,
    solitary: bool,
    fixed: bool,
    quarantined: Option<Fault>,
    extent: Extent,
    /// What an update takes, as its share of its block's.
    cost: Cost,
    /// What it looks like.
    pub visual: VisualProperties,
    /// How it is drawn.
    pub drawing: Drawing,
    /// Its shape and place.
    pub geometry: Geometry,
    /// How it changes.
    pub behavior: Box<dyn Behavior>,
}

impl Object {
    /// An object that may interact and is drawn as a grey surface.
    #[must_use]
    pub fn new(
        id: ObjectId,
        group: Group,
        geometry: Geometry,
        behavior: impl Behavior + 'static,
    ) -> Self {
        let mut object = Self {
            id,
            group,
            solitary: false,
            fixed: behavior.is_fixed(),
            quarantined: None,
            extent: Extent::EMPTY,
            cost: Cost::default(),
            visual: VisualProperties::default(),
            drawing: Drawing::default(),
            geometry,
            behavior: Box::new(behavior),
        };
        object.refit();
        object
    }

    /// The same object without interactions: it goes straight to update and render (§5.1, §9).
    #[must_use]
    pub fn solitary(mut self) -> Self {
        self.solitary = true;
        self
    }

    /// Its number.
    #[must_use]
    pub fn id(&self) -> ObjectId {
        self.id
    }

    /// Its kind.
    #[must_use]
    pub fn group(&self) -> Group {
        self.group
    }

    /// Whether it takes part in no interaction.
    #[must_use]
    pub fn is_solitary(&self) -> bool {
        self.solitary
    }

    /// Whether it is scenery, which nothing moves.
    #[must_use]
    pub fn is_fixed(&self) -> bool {
        self.fixed
    }

    /// Why and when it was excluded, if it was.
    #[must_use]
    pub fn quarantined(&self) -> Option<Fault> {
        self.quarantined
    }

    /// Whether it is to be drawn: it is neither hidden nor excluded.
    #[must_use]
    pub fn is_drawn(&self) -> bool {
        self.quarantined.is_none() && self.drawing != Drawing::Hidden
    }

    /// The box around it after its last update; empty for an excluded object.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.extent.bounds
    }

    /// The middle of its geometry after its last update, in metres.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.extent.center
    }

    /// Whether its geometry was finite after its last update, or where an executor took over its scene.
    pub(crate) fn is_finite(&self) -> bool {
        self.extent.finite
    }

    /// What an update takes, in seconds, as its share of its block's last ones that were timed; 0 before
    /// the first.
    #[must_use]
    pub fn cost(&self) -> f32 {
        self.cost.seconds()
    }

    /// Notes what an update took.
    pub(crate) fn note_cost(&mut self, took: Duration) {
        self.cost.note(took);
    }

    /// The extent that interactions are to look at: empty for an object that has none.
    pub(crate) fn interaction_extent(&self) -> Extent {
        if self.solitary { Extent::EMPTY } else { self.extent }
    }

    /// Excludes it for good. The first fault counts.
    pub(crate) fn quarantine(&mut self, fault: Fault) {
        self.quarantined.get_or_insert(fault);
        self.extent.bounds = Bounds::EMPTY;
    }

    /// Fits box and centre to a geometry that was changed from outside, and takes the object for scenery or not by
    /// its behaviour. That is done where an executor takes over a scene; within an environment box and centre
    /// are fitted after every update. An object whose shape panics then is nowhere, and its next update excludes it; one
    /// whose behaviour does is nowhere until then. One that is excluded is left as it is.
    pub fn refit(&mut self) {
        if self.quarantined.is_some() {
            return;
        }
        let look = || (self.behavior.is_fixed(), self.geometry.extent(Simd::detect()));
        match catch_unwind(AssertUnwindSafe(look)) {
            Ok((fixed, extent)) => {
                self.fixed = fixed;
                self.fit(extent);
            }
            // The next update asks the shape again, and excludes the object in its frame.
            Err(_) => self.fit(Extent { finite: false, ..Extent::EMPTY }),
        }
    }

    fn fit(&mut self, extent: Extent) {
        if self.quarantined.is_none() {
            // In a union a box of no meaning would make others of those before it.
            let bounds = if extent.finite { extent.bounds } else { Bounds::EMPTY };
            self.extent = Extent { bounds, ..extent };
        }
    }

    /// Brings the box up to date, or excludes the object if its state is not finite.
    pub(crate) fn refresh(&mut self, frame: u64, simd: Simd) {
        self.settle(frame, self.geometry.extent(simd));
    }

    /// The same where its extent is known.
    pub(crate) fn settle(&mut self, frame: u64, extent: Extent) {
        if extent.finite {
            self.fit(extent);
        } else {
            self.quarantine(Fault { kind: FaultKind::NonFinite, frame });
        }
    }

    /// Asks for what an update reads and changes of it beside the object itself.
    #[inline]
    pub(crate) fn prefetch_parts(&self, simd: Simd) {
        prefetch(&*self.behavior);
        if let Some(mesh) = self.geometry.as_mesh() {
            for lines in mesh.lines() {
                prefetch_to_write(simd, lines);
            }
        }
    }

    /// Processes one message of its inbox (§6.2).
    pub(crate) fn process(&mut self, message: &Message, frame: u64) {
        match message {
            Message::Impulse { node, impulse } => {
                if let Some(mesh) = self.geometry.as_mesh_mut() {
                    mesh.apply_impulse(*node, Vec3::from_array(*impulse));
                }
            }
            Message::Remove => self.quarantine(Fault { kind: FaultKind::Removed, frame }),
            Message::Custom(custom) => custom.process(Replaceable::from(self).object),
            Message::Stiffness { .. }
            | Message::Damping(_)
            | Message::Pull { .. }
            | Message::Release
            | Message::Device(_)
            | Message::TakeUp(_)
            | Message::Weightless(_) => self.behavior.process(message),
        }
    }

    /// A copy of what a renderer sees; of the behaviour what that [shows](Behavior::show_in).
    #[must_use]
    pub fn snapshot(&self) -> Self {
        let mut behavior: Box<dyn Behavior> = Box::new(Fixed);
        self.behavior.show_in(&mut behavior);
        Self {
            id: self.id,
            group: self.group,
            solitary: self.solitary,
            fixed: self.fixed,
            quarantined: self.quarantined,
            extent: self.extent,
            cost: self.cost,
            visual: self.visual,
            drawing: self.drawing,
            geometry: self.geometry.clone(),
            behavior,
        }
    }

    /// Makes an earlier snapshot one of this object. Geometries allocate only if they are of different kinds or sizes,
    /// behaviours if they show something of their own, as tools do.
    pub fn snapshot_into(&self, snapshot: &mut Self) {
        snapshot.id = self.id;
        snapshot.group = self.group;
        snapshot.solitary = self.solitary;
        snapshot.fixed = self.fixed;
        snapshot.cost = self.cost;
        snapshot.quarantined = self.quarantined;
        snapshot.extent = self.extent;
        snapshot.visual = self.visual;
        snapshot.drawing = self.drawing;
        match (&self.geometry, &mut snapshot.geometry) {
            (Geometry::Mesh(from), Geometry::Mesh(to)) => to.copy_from(from),
            (Geometry::Volume(from), Geometry::Volume(to)) => to.copy_from(from),
            (from, to) => to.clone_from(from),
        }
        self.behavior.show_in(&mut snapshot.behavior);
    }
}

/// An object that another may be put in the place of, also by who panics then.
struct Replaceable<'o> {
    object: &'o mut Object,
    id: ObjectId,
    group: Group,
    solitary: bool,
}

impl<'o> From<&'o mut Object> for Replaceable<'o> {
    fn from(object: &'o mut Object) -> Self {
        let Object { id, group, solitary, .. } = *object;
        Self { object, id, group, solitary }
    }
}

impl Drop for Replaceable<'_> {
    fn drop(&mut self) {
        let object = &mut *self.object;
        // By these it is found, grouped and let past interactions.
        (object.id, object.group, object.solitary) = (self.id, self.group, self.solitary);
        object.fixed = object.behavior.is_fixed();
    }
}
