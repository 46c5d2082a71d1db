//! A piece of bone that came free: a rigid body that can be lifted out, drilled, and put back.

mod body;
mod hands;
mod samples;

use std::hash::Hasher;

use glam::Vec3;
use parry3d::math::Pose;

use self::hands::Hands;
use super::drill::Erosions;
use super::{Behavior, Felt, Input};
use crate::geometry::{Geometry, Volume};
use crate::interaction::Contact;
use crate::message::Message;
use crate::object::ObjectId;

pub use body::{BONE_DENSITY, Body};
pub(crate) use samples::MOST_SAMPLES;

/// The force that it takes to lift a piece out of its place, in newtons; usually 3: the dura sticks to it.
const SEAT_FORCE: f32 = 3.0;
/// How far from its place a piece may be let go to find back into it, in metres; usually 2 mm, a
/// craniotome's cut.
const SEAT_REACH: f32 = 2e-3;
/// How far turned, as the cosine of half the angle; usually 0.996: 10°.
const SEAT_COSINE: f32 = 0.996;
/// How fast a moving piece is slowed down, and a turning one, per second; usually 0.05 and 1.
const DAMPING: [f32; 2] = [0.05, 1.0];

/// The behaviour of a free piece of bone: a rigid body with the mass and the inertia of its densities.
///
/// It lies still in the place where it was made until tools pull at it with more than 3 N; let go of within
/// 2 mm and 10° of there, it lies there again.
///
/// A frame moves it by the velocity that contacts with other bone have left, and then adds what gravity, bits
/// that press on it and the tools that hold it will do in the next one. It is slowed down as by air
/// and fluid: each second takes 5 % of its velocity and 63 % of its spin. So what contacts of the next frame see is
/// where it is about to go: they stop it before it is there, and on bone it rests without sinking in.
#[derive(Clone, Debug)]
pub struct Piece {
    body: Body,
    /// Points on its surface, in the volume's own axes, in metres.
    samples: Vec<Vec3>,
    /// The pose in its place, if it has one.
    seat: Option<Pose>,
    seated: bool,
    hands: Hands,
    erosions: Erosions,
}

impl Piece {
    /// A piece in its place.
    #[must_use]
    pub fn new(volume: &Volume) -> Self {
        let body = Body::new(volume);
        Self {
            samples: samples::samples(volume, body.middle),
            body,
            seat: Some(volume.pose),
            seated: true,
            hands: Hands::default(),
            erosions: Erosions::new(),
        }
    }

    /// The same piece without a place of its own: free to move.
    #[must_use]
    pub fn loose(self) -> Self {
        Self { seat: None, seated: false, ..self }
    }

    /// The same piece turning with so much angular momentum, in kg·m²/s, in the world's axes.
    #[must_use]
    pub fn spinning(mut self, angular_momentum: Vec3) -> Self {
        self.body.angular_momentum = angular_momentum;
        self
    }

    /// The pose in its place, if it has one.
    #[must_use]
    pub fn seat(&self) -> Option<Pose> {
        self.seat
    }

    /// Whether it lies in its place.
    #[must_use]
    pub fn is_seated(&self) -> bool {
        self.seated
    }

    /// Its mass and its motion in the coming frame as far as nothing is in the way.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// What was taken away by bits since it came free; 255 are a full voxel.
    #[must_use]
    pub fn removed(&self) -> u64 {
        self.erosions.removed()
    }

    /// The tools that hold it, in ascending order.
    pub fn holders(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.hands.holders()
    }

    /// Points on its surface in the volume's own axes, in metres. A contact's node is the number of one.
    #[must_use]
    pub fn samples(&self) -> &[Vec3] {
        &self.samples
    }

    /// What a frame's contact with bone did to it; those of its whole body are others.
    fn receive(&mut self, contact: Contact, volume: &Volume) {
        if let Some(&sample) = self.samples.get(contact.node as usize) {
            let at = volume.turned(sample - self.body.middle);
            self.body.push(Vec3::from_array(contact.impulse), at);
        }
    }

    /// The pose to go back to, if it was let go of near enough to its place.
    fn finds_back(&self, volume: &Volume) -> Option<Pose> {
        let seat = self.seat.filter(|_| self.holders().next().is_none())?;
        let place = Volume::turned_by(&seat, self.body.middle) + seat.translation;
        let away = self.body.center(volume).distance(place);
        let (a, b) = (seat.rotation.to_array(), volume.pose.rotation.to_array());
        let cosine = (0..4).map(|i| a[i] * b[i]).sum::<f32>().abs();
        (away < SEAT_REACH && cosine > SEAT_COSINE).then_some(seat)
    }

    /// Lays it into its place.
    fn sit(&mut self, volume: &mut Volume, seat: Pose) {
        self.seated = true;
        self.body.velocity = Vec3::ZERO;
        self.body.angular_momentum = Vec3::ZERO;
        volume.pose = seat;
        volume.velocity = Vec3::ZERO;
    }
}

impl Behavior for Piece {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let Some(volume) = geometry.as_volume_mut() else { return };
        let time = input.time_step;
        if self.erosions.apply(volume, input.frame, time) > 0 {
            self.body.weigh(volume);
            if self.body.mass == 0.0 {
                // Nothing is left to hold.
                self.hands = Hands::default();
            }
        }
        let was_seated = self.seated;
        if self.seated {
            self.seated = self.hands.force(volume).length() <= SEAT_FORCE;
        } else {
            for contact in input.contacts() {
                self.receive(contact, volume);
            }
            self.body.advance(volume, time);
            if let Some(seat) = self.finds_back(volume) {
                self.sit(volume, seat);
            }
        }
        if !self.seated && self.body.mass > 0.0 {
            let [along, around] = DAMPING.map(|rate| 1.0 / (1.0 + rate * time));
            self.body.velocity = self.body.velocity * along + input.gravity * time;
            self.body.angular_momentum *= around;
            // One that lay in its place was pressed as what does not move.
            let is_pressed = |contact: &Contact| !was_seated && contact.node == Contact::BODY;
            for contact in input.contacts().filter(is_pressed) {
                self.body.push(Vec3::from_array(contact.impulse), Vec3::ZERO);
            }
            self.hands.pull(&mut self.body, volume, time);
        }
        for (by, held) in self.hands.felt(volume) {
            input.post(by, Message::Custom(Box::new(Felt { held, cuts: false })));
        }
        volume.margin = if self.seated { 0.0 } else { self.body.fastest(volume) * time };
    }

    fn erosions(&mut self) -> Option<&mut Erosions> {
        Some(&mut self.erosions)
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write(&[u8::from(self.seated)]);
        self.body.hash_state(hasher);
        self.hands.hash_state(hasher);
        self.erosions.hash_state(hasher);
    }
}
