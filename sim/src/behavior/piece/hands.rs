//! How tools hold a piece.

use std::hash::Hasher;

use glam::{Mat3, Vec3};

use super::Piece;
use super::body::Body;
use crate::behavior::grasp::{Grasp, Hold, Holdable};
use crate::geometry::{Geometry, Volume};
use crate::object::ObjectId;

impl Holdable for Piece {
    fn take(&mut self, geometry: &Geometry, grasp: &Grasp) {
        let Some(volume) = geometry.as_volume().filter(|_| is_valid(grasp)) else { return };
        self.let_go(grasp.by);
        if let Some(hand) = Hand::new(grasp, volume) {
            self.hands.take(hand);
        }
    }

    fn hold(&mut self, hold: &Hold) {
        if let Some(hand) = self.hands.0.iter_mut().find(|hand| hand.by == hold.by) {
            hand.target = hold.position;
        }
    }

    fn let_go(&mut self, by: ObjectId) {
        self.hands.0.retain(|hand| hand.by != by);
    }
}

/// The tools that hold a piece, in the order of their numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Hands(Vec<Hand>);

/// A tool's hold: a spring of critical damping from a point of the piece to a place.
#[derive(Clone, Copy, Debug)]
struct Hand {
    by: ObjectId,
    /// The point held, in the volume's own axes, in metres.
    grip: Vec3,
    /// Where it is to be, in metres.
    target: Vec3,
    stiffness: f32,
    strength: f32,
}

/// Whether a grasp says what a piece can be held by.
fn is_valid(grasp: &Grasp) -> bool {
    let positive = |value: f32| value > 0.0 && value.is_finite();
    grasp.point.is_finite()
        && [grasp.radius, grasp.stiffness, grasp.strength].into_iter().all(positive)
}

impl Hand {
    /// A hold of bone, if there is some.
    fn new(grasp: &Grasp, volume: &Volume) -> Option<Self> {
        let Grasp { by, point: target, radius, stiffness, strength } = *grasp;
        let mut there = false;
        volume.visit(target, radius, |voxel| there |= voxel.density >= 128);
        there.then(|| Self { by, grip: volume.to_local(target), target, stiffness, strength })
    }

    /// The way from the point held to its place, in metres.
    fn way(&self, volume: &Volume) -> Vec3 {
        self.target - volume.to_world(self.grip)
    }

    /// Its force on a piece at rest, in newtons.
    fn force(&self, volume: &Volume) -> Vec3 {
        // In this order, since a way times any stiffness may have no finite length.
        self.way(volume).clamp_length_max(self.strength / self.stiffness) * self.stiffness
    }

    /// Pulls for a frame of `time` seconds, by one implicit step, which any stiffness bears: a soft constraint
    /// (E. Catto, "Soft constraints", GDC 2011).
    fn pull(&self, body: &mut Body, volume: &Volume, time: f32) {
        let at = volume.to_world(self.grip) - body.center(volume);
        let inertia = body.inverse_inertia(volume);
        let damping = 2.0 * (self.stiffness * body.mass).sqrt();
        let softness = 1.0 / (time * (damping + time * self.stiffness));
        let speed = body.velocity + body.angular_velocity(volume).cross(at);
        let wanted = self.way(volume) * (time * self.stiffness * softness);
        // The velocity at the point that an impulse along each axis gives.
        let answer = |axis: Vec3| {
            let along = axis * (body.inverse_mass() + softness);
            along + (inertia * at.cross(axis)).cross(at)
        };
        let answers = Mat3::from_cols(answer(Vec3::X), answer(Vec3::Y), answer(Vec3::Z));
        let impulse = answers.inverse() * (wanted - speed);
        body.push(impulse.clamp_length_max(self.strength * time), at);
    }
}

impl Hands {
    fn take(&mut self, hand: Hand) {
        let place = self.0.partition_point(|other| other.by < hand.by);
        self.0.insert(place, hand);
    }

    /// The tools, in ascending order.
    pub(super) fn holders(&self) -> impl Iterator<Item = ObjectId> + '_ {
        self.0.iter().map(|hand| hand.by)
    }

    /// Their force on a piece at rest, in newtons.
    pub(super) fn force(&self, volume: &Volume) -> Vec3 {
        self.0.iter().map(|hand| hand.force(volume)).sum()
    }

    /// What each feels of a piece at rest, in newtons.
    pub(super) fn felt(&self, volume: &Volume) -> impl Iterator<Item = (ObjectId, Vec3)> {
        self.0.iter().map(|hand| (hand.by, -hand.force(volume)))
    }

    /// Lets them pull for a frame of `time` seconds.
    pub(super) fn pull(&self, body: &mut Body, volume: &Volume, time: f32) {
        if body.mass > 0.0 {
            self.0.iter().for_each(|hand| hand.pull(body, volume, time));
        }
    }

    pub(super) fn hash_state(&self, hasher: &mut dyn Hasher) {
        for hand in &self.0 {
            hasher.write(&hand.by.0.to_le_bytes());
            let places = hand.grip.to_array().into_iter().chain(hand.target.to_array());
            for value in places.chain([hand.stiffness, hand.strength]) {
                hasher.write(&value.to_le_bytes());
            }
        }
    }
}
