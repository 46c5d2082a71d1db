//! How a hand moves a tool against bone.

use glam::Vec3;
use thiserror::Error;

use super::Reaction;

/// Why a feed cannot be built.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{what} is {value}; it must be finite and positive")]
pub struct FeedError {
    /// The name of the value.
    pub what: &'static str,
    /// The value.
    pub value: f32,
}

/// How a hand and a tool that bone holds back pull at each other: the spring by which a [`Feed`] pushes the
/// tool on, the virtual coupling of J. E. Colgate, M. C. Stanley, J. M. Brown, "Issues in the haptic
/// display of tool use", IROS 1995.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Of the spring, in newtons per metre: the strength at [`Feed::REACH`]; usually 5,000.
    pub stiffness: f32,
    /// The greatest force along the normal, and across it, in newtons; usually 10.
    pub strength: f32,
    /// The outward normal of the bone, of unit length. Out along it nothing is held.
    pub normal: Vec3,
}

impl Coupling {
    /// The force of a hand of this strength that is so far ahead of the tool (metres), in newtons: what is felt
    /// of the tool, and the opposite of what pushes it.
    #[must_use]
    pub fn force(&self, ahead: Vec3) -> Vec3 {
        let out = ahead.dot(self.normal);
        let pull = |way: Vec3| (way * self.stiffness).clamp_length_max(self.strength);
        -(pull(self.normal * out.min(0.0)) + pull(ahead - self.normal * out))
    }
}

/// A hand that pushes a tool towards a place as strongly as it can, by admittance: in contact it moves by
/// the force that is left over, divided by a resistance. So there is no stiff loop, and a frame of 1/60 s
/// will do: a bit settles without overshoot as long as the resistance, in N·s/m, is more than the time step
/// times the stiffness of contact and hand. Where these are stiffer, the resistance is that product: a step
/// of Newton's method towards the place where the forces are equal. Between walls that are nearer to each other than a
/// bit is wide, its contacts are stiffer than they tell, and it trembles by some tenths of a millimetre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feed {
    strength: f32,
    resistance: f32,
    free_step: f32,
    contact_step: f32,
}

impl Feed {
    /// The distance from which on a hand in contact pushes with all its strength, in metres; usually 2 mm.
    pub const REACH: f32 = 2e-3;

    /// A hand of at most `strength` newtons (usually 10 on a burr, 30 on a perforator) and a `resistance`
    /// in newton seconds per metre (usually [`Feed::RESISTANCE`]), that moves by at most `free_step`
    /// metres a frame (usually half the bit's radius, so that it meets the bone long before it is half
    /// inside) and in contact by `contact_step` (usually half a voxel).
    ///
    /// # Errors
    /// A value that is not finite and positive.
    pub fn new(
        strength: f32,
        resistance: f32,
        free_step: f32,
        contact_step: f32,
    ) -> Result<Self, FeedError> {
        for (what, value) in [
            ("a hand's strength", strength),
            ("a hand's resistance", resistance),
            ("a free step", free_step),
            ("a step in contact", contact_step),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FeedError { what, value });
            }
        }
        Ok(Self { strength, resistance, free_step, contact_step })
    }

    /// The usual resistance, in newton seconds per metre: 1,000. It holds a ball of 3 mm that is pressed
    /// by 20 N (33 kN/m at 0.9 mm) at 60 frames a second, and lets 10 N move a tool by 10 mm/s. A perforator
    /// pressed by 30 N is held by 3,000.
    pub const RESISTANCE: f32 = 1_000.0;

    /// Where a tool at `place` goes in a frame of `time_step` seconds if the hand wants it at `intended`
    /// (metres), after the contacts at `place` did to it what `reaction` says.
    ///
    /// Where no bone is touched it goes there, by a free step at most. In contact the way along the normal
    /// and across it count by themselves: into the bone, and across, the hand pushes with its strength, or
    /// less if it has less than [`Feed::REACH`] to go, and what the contact's force leaves of that moves the
    /// tool by a step in contact at most. Away from the bone it goes, or is pushed, by a free step at most.
    #[must_use]
    pub fn next(&self, place: Vec3, intended: Vec3, reaction: &Reaction, time_step: f32) -> Vec3 {
        let way = intended - place;
        let Some(coupling) = self.coupling(reaction) else {
            return place + way.clamp_length_max(self.free_step);
        };
        let normal = coupling.normal;
        let out = way.dot(normal);
        let across = way - normal * out;
        if out > 0.0 {
            let leave = normal * out.min(self.free_step);
            return place + leave + across.clamp_length_max(self.contact_step);
        }
        let force = reaction.force - coupling.force(way);
        let stiffness = reaction.normal_stiffness() + coupling.stiffness;
        let step = force * (time_step / self.resistance.max(stiffness * time_step));
        let back = step.dot(normal).max(0.0);
        let rest = (step - normal * back).clamp_length_max(self.contact_step);
        place + normal * back.min(self.free_step) + rest
    }

    /// What joins the hand with a tool that feels so; none where no bone is touched, for there the tool only
    /// comes after.
    #[must_use]
    pub fn coupling(&self, reaction: &Reaction) -> Option<Coupling> {
        let Self { strength, .. } = *self;
        let normal = reaction.normal()?;
        Some(Coupling { stiffness: self.stiffness(), strength, normal })
    }

    /// The stiffness of a [`Coupling`], in newtons per metre.
    #[must_use]
    pub fn stiffness(&self) -> f32 {
        self.strength / Self::REACH
    }

    /// How hard the hand presses the bit on the bone, in newtons: the load that the bone bears, but no
    /// more than the hand's strength, also in a frame in which the bit meets the bone deeper than that.
    #[must_use]
    pub fn load(&self, reaction: &Reaction) -> f32 {
        reaction.load().min(self.strength)
    }
}
