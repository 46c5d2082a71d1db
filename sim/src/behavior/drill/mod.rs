//! Drilling: a spinning bit, the force of bone on it, and what it takes away.
//!
//! After M. Agus, A. Giachetti, E. Gobbetti, G. Zanetti, A. Zorcolo, "Real-time haptic and visual
//! simulation of bone dissection", Presence 12 (2003) 110: force and erosion follow from integrals over
//! the voxels that the bit overlaps. Here voxels are filled to a part, and so the force has no steps.
//!
//! | room | what it does |
//! |---|---|
//! | [`Overlap`] | the integrals, and the force that they give |
//! | [`Erode`], [`Erosions`] | what a bit takes away: a message, and what bone does with it |
//! | [`Perforator`] | the clutch that stops where the bone ends |
//! | [`Reaction`], [`Feed`] | what a tool feels, and how it goes on from there |
//! | [`Approach`] | from which side it came |
//! | [`Coupling`] | what the hand feels of it |
//!
//! A tool shows its bit by [`Behavior::burr`]; [`BurrInBone`] and [`BurrForce`] turn it into contacts, which
//! the tool's update reads as a [`Reaction`]. It then posts an [`Erode`] to the bone and moves by its
//! [`Feed`].
//!
//! [`Behavior::burr`]: super::Behavior::burr
//! [`BurrInBone`]: crate::interaction::BurrInBone
//! [`BurrForce`]: crate::interaction::BurrForce

mod approach;
mod erosion;
mod feed;
mod overlap;
mod perforator;
mod reaction;

use glam::Vec3;

pub use approach::{Approach, Side};
pub use erosion::{Erode, Erosions};
pub use feed::{Coupling, Feed, FeedError};
pub use overlap::{Overlap, half_space_depth};
pub use perforator::Perforator;
pub use reaction::Reaction;

/// The coefficient of friction of a spinning bit on bone; usually 0.2.
pub const FRICTION: f32 = 0.2;

/// A kind of bit: one ball, or balls side by side along the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bit {
    /// Of each ball, in metres.
    pub radius: f32,
    /// From the middle of the first ball to that of the last, in metres; 0 for one ball.
    pub length: f32,
    /// Of the part around the axis whose axial load is told by itself, in metres; 0 for none.
    pub tip_radius: f32,
    /// The elastic constant C1 of bone under it, in pascals: `F = C1·R²·(h/R)^1.5`. Usually about 10⁷: Hertz's
    /// law with bone's own modulus of 15 GPa would be a thousand times stiffer, but neither a hand nor
    /// voxels of 0.5 mm could tell its depths.
    pub stiffness: f32,
    /// The energy that it takes to cut bone away, in joules per cubic metre; 10⁷ to 10⁹, the less the
    /// thicker the chips.
    pub specific_energy: f32,
}

impl Bit {
    /// A round burr of 6 mm. Its stiffness is calibrated so that 10 N press it 0.57 mm in, and 20 N
    /// 0.91 mm; its specific energy so that at 30,000 rpm and 10 N it takes away about 60 mm³ a second and
    /// so goes about 2 mm a second deeper.
    pub const BURR: Self = Self {
        radius: 3e-3,
        length: 0.0,
        tip_radius: 0.0,
        stiffness: 1.33e7,
        specific_energy: 2e8,
    };
    /// A craniotome's bit: a rod of 2.4 mm, which reaches through the skull.
    pub const CRANIOTOME: Self = Self { radius: 1.2e-3, length: 9.6e-3, ..Self::BURR };
    /// A perforator of 11 mm. Its stiffness is calibrated so that 30 N press it 0.5 mm in. Its blades
    /// cut thick chips: at 1,000 rpm and 30 N it goes through a skull of 7 mm in about 5 s (calibrated).
    pub const PERFORATOR: Self = Self {
        radius: 5.5e-3,
        length: 0.0,
        tip_radius: 2.5e-3,
        stiffness: 4e7,
        specific_energy: 2.5e7,
    };

    /// The elastic force of bone on one of its balls so many metres deep in it, in newtons.
    #[must_use]
    pub fn elastic_force(&self, depth: f32) -> f32 {
        let share = (depth / self.radius).max(0.0);
        self.stiffness * self.radius * self.radius * share * share.sqrt()
    }

    /// What that force grows by as the ball goes deeper, in newtons per metre.
    #[must_use]
    pub fn elastic_stiffness(&self, depth: f32) -> f32 {
        let share = (depth / self.radius).max(0.0);
        1.5 * self.stiffness * self.radius * share.sqrt()
    }

    /// Its balls: one for every radius of length, and one.
    #[must_use]
    pub fn balls(&self) -> u32 {
        // As an integer, what is not a number becomes 0.
        1 + (self.length / self.radius).round().clamp(0.0, 255.0) as u32
    }
}

/// A bit at a place, turning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burr {
    /// What bit it is.
    pub bit: Bit,
    /// The middle of the first ball, which is the farthest from the hand, in metres.
    pub center: Vec3,
    /// Its axis, of unit length, from the first ball towards the hand.
    pub axis: Vec3,
    /// How fast it turns about its axis, by the right-hand rule, in radians per second; 0 for one that
    /// stands still. Usually 105 (a perforator, 1,000 rpm) to 7,900 (75,000 rpm).
    pub spin: f32,
    /// The side of the bone that it is on: [`Approach::side`]. A bit that is pressed into a thin wall beyond the
    /// wall's middle is still pushed back to this side, and not out through the other.
    pub side: Option<Side>,
}

impl Burr {
    /// The middles of its balls, in metres, from the tip on.
    pub fn balls(&self) -> impl Iterator<Item = Vec3> + use<> {
        let (first, axis, balls) = (self.center, self.axis, self.bit.balls());
        let step = self.bit.length / (balls - 1).max(1) as f32;
        (0..balls).map(move |ball| first + axis * (step * ball as f32))
    }

    /// The share of the rim's speed with which a bit cuts at its very tip, where the surface itself does
    /// not move; usually 0.25. Flutes meet there, and a real bit does not leave a needle standing.
    pub const TIP_SPEED: f32 = 0.25;

    /// The speed of the surface as a share of the rim's, in a direction from a ball's middle: the sine
    /// of the angle to the axis, of unit length, but no less than [`Burr::TIP_SPEED`].
    fn relative_speed(&self, axis: Vec3, direction: Vec3) -> f32 {
        let sine = direction.cross(axis).length() / direction.length();
        // In the very middle it is not a number, which gives way to the other.
        sine.max(Self::TIP_SPEED)
    }
}

#[cfg(test)]
mod tests;
