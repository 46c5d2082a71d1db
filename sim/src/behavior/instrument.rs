//! The instruments of a craniotomy.

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
}
