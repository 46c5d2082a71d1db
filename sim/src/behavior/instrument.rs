//! The instruments of a craniotomy.

use glam::Vec3;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

use super::drill::Bit;

/// The length of a scalpel's edge, from the tip on, in metres; usually 0.02.
pub(super) const EDGE: f32 = 0.02;
/// The radius of the tips of instruments that touch tissue, in metres; usually 0.002.
const BLUNT: f32 = 0.002;
/// The length of a handle, for the eye, in metres; usually 0.12.
const HANDLE: f32 = 0.12;

/// What a tool is at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Instrument {
    /// A blade: its tip cuts soft tissue while it is pressed (button 0).
    Scalpel,
    /// A periosteal elevator: scrapes soft tissue off the bone while it is pressed.
    Elevator,
    /// Forceps: hold soft tissue, or a freed piece of bone, while they are closed (button 0).
    Forceps,
    /// A hook: holds soft tissue like forceps, with more force.
    Hook,
    /// A cranial perforator: drills a burr hole and stops by itself where the bone ends.
    Perforator,
    /// A round burr.
    Burr,
    /// A craniotome: a thin bit that cuts sideways, from a burr hole on, with a foot that keeps the dura
    /// away from it.
    Craniotome,
}

impl Instrument {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Scalpel,
        Self::Elevator,
        Self::Forceps,
        Self::Hook,
        Self::Perforator,
        Self::Burr,
        Self::Craniotome,
    ];

    /// Its name, for people.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalpel => "scalpel",
            Self::Elevator => "elevator",
            Self::Forceps => "forceps",
            Self::Hook => "hook",
            Self::Perforator => "perforator",
            Self::Burr => "burr",
            Self::Craniotome => "craniotome",
        }
    }

    /// The bit of an instrument that drills.
    pub(super) fn bit(self) -> Option<Bit> {
        match self {
            Self::Perforator => Some(Bit::PERFORATOR),
            Self::Burr => Some(Bit::BURR),
            Self::Craniotome => Some(Bit::CRANIOTOME),
            _ => None,
        }
    }

    /// What an instrument looks like, and touches tissue with.
    pub(super) fn shape(self) -> SharedShape {
        let ball =
            |radius: f32| (Pose::from_translation(Vec3::Z * radius), SharedShape::ball(radius));
        let rod = |from: f32, to: f32, radius: f32| {
            let rod =
                SharedShape::capsule(Vec3::Z * (from + radius), Vec3::Z * (to - radius), radius);
            (Pose::IDENTITY, rod)
        };
        let parts = match self {
            Self::Scalpel => vec![
                (
                    Pose::from_translation(Vec3::Z * (0.5 * EDGE)),
                    SharedShape::cuboid(3e-4, 2e-3, 0.5 * EDGE),
                ),
                rod(EDGE, HANDLE, 3e-3),
            ],
            Self::Elevator => vec![ball(BLUNT), rod(0.0, HANDLE, 1.5e-3)],
            Self::Forceps | Self::Hook => vec![ball(1.5e-3), rod(0.0, HANDLE, 1.2e-3)],
            Self::Perforator | Self::Burr | Self::Craniotome => {
                let bit = self.bit().unwrap_or(Bit::BURR);
                let end = bit.length + 2.0 * bit.radius;
                vec![ball(bit.radius), rod(0.0, end, bit.radius), rod(end, HANDLE, 6e-3)]
            }
        };
        SharedShape::compound(parts)
    }
}
