//! The VE: 64 discs in a square room that push each other apart, and letters that come from
//! interrupt handlers. Every machine compiles this very file.
//!
//! # Why the state is the same on every machine and in every run
//!
//! Motion follows from the core's promise alone (interactions in pair order) and from arithmetic
//! that is exact to the bit everywhere: sums, products and quotients of `f32`, no square roots, no
//! functions of a mathematics library.
//!
//! An interrupt comes when it comes, so the frame in which a letter is read differs from run to
//! run. What must not differ is that every letter is read once, and each sender's in the order
//! posted. So letters do not steer motion: each disc keeps, for each sender, a hash that
//! depends on their order, and returns an error if one is missing, doubled or out of turn. A letter
//! that never came would change the final hash; so would one that was read in another's place. For
//! the hash to be that of *all* letters, the last frames wait for them ([`crate::mail`]).

use core::fmt;

use dualframe_core::contacts::Contacts;
use dualframe_core::environment::{Environment, Pair};
use dualframe_core::error::{SetupError, StillRunning, TableFull};
use dualframe_core::frame::Frame;
use dualframe_core::inbox::From as Sender;
use dualframe_core::inputs::Inputs;
use dualframe_core::unit::UnitId;

use crate::mail::{SENDERS, letter};

/// Discs in the room; a unit each.
pub(crate) const DISCS: usize = 64;
/// Frames of a run.
pub(crate) const FRAMES: u32 = 1000;

/// Length of the room's sides, in metres.
const SIDE: f32 = 8.0;
/// Discs closer than this push each other, in metres: twice their radius.
const REACH: f32 = 0.9;
/// Acceleration by which two discs part for each metre between their centres, in 1/s²: the most, when
/// they lie on each other.
const STIFFNESS: f32 = 200.0;
/// Duration of a frame, in seconds.
const STEP: f32 = 0.01;

/// A disc, and what it has been sent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Disc {
    /// Centre, in metres.
    place: [f32; 2],
    /// In metres a second.
    velocity: [f32; 2],
    read: [Read; SENDERS],
}

/// What a disc has read of one sender's letters.
#[derive(Clone, Copy, Debug)]
struct Read {
    letters: u32,
    hash: Hash,
}

/// FNV-1a, word by word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Hash(pub(crate) u64);

impl Hash {
    pub(crate) const EMPTY: Self = Self(0xcbf2_9ce4_8422_2325);

    pub(crate) fn add(&mut self, word: u64) {
        self.0 = (self.0 ^ word).wrapping_mul(0x100_0000_01b3);
    }
}

/// What may go wrong in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// A table is full.
    Full(TableFull),
    /// A disc was to read another letter of this sender's.
    OutOfTurn(UnitId, Sender),
    /// The pipeline does not fit its memory.
    Setup(SetupError),
    /// The run was to start a second time.
    Started,
}

impl From<TableFull> for Fault {
    fn from(full: TableFull) -> Self {
        Self::Full(full)
    }
}

impl From<SetupError> for Fault {
    fn from(error: SetupError) -> Self {
        Self::Setup(error)
    }
}

impl From<StillRunning> for Fault {
    fn from(_: StillRunning) -> Self {
        Self::Started
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Full(full) => full.fmt(f),
            Self::OutOfTurn(unit, from) => {
                let Sender { sender, sequence } = from;
                write!(f, "{unit} got letter {sequence} of sender {sender} out of turn")
            }
            Self::Setup(error) => error.fmt(f),
            Self::Started => f.write_str("the run has started already"),
        }
    }
}

impl Disc {
    /// A disc at rest in a corner: memory for [`Disc::start`].
    pub(crate) const UNPLACED: Self = Self {
        place: [0.0; 2],
        velocity: [0.0; 2],
        read: [Read { letters: 0, hash: Hash::EMPTY }; SENDERS],
    };

    /// The disc of this index as the run begins: on a grid, at a velocity of its own.
    pub(crate) fn start(index: usize) -> Self {
        let mut bits = Hash::EMPTY;
        bits.add(index as u64);
        // A signed byte, as metres a second: up to 4.
        let speed = |shift: u32| (bits.0 >> shift) as i8 as f32 / 32.0;
        let place = [index % 8, index / 8].map(|at| at as f32 + 0.5);
        Self { place, velocity: [speed(24), speed(40)], ..Self::UNPLACED }
    }

    /// Whether the squares around two discs overlap.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let near = |axis: usize| (self.place[axis] - other.place[axis]).abs() < REACH;
        near(0) && near(1)
    }

    /// The acceleration of `self` away from `other`, in m/s²; none beyond their reach. The other's
    /// is its negative.
    pub(crate) fn push(&self, other: &Self) -> Option<[f32; 2]> {
        let [x, y] = [0, 1].map(|axis| self.place[axis] - other.place[axis]);
        let overlap = 1.0 - (x * x + y * y) / (REACH * REACH);
        (overlap > 0.0).then(|| [x, y].map(|distance| STIFFNESS * overlap * distance))
    }

    /// One frame of motion under the sum of `pushes`, in m/s²; walls are elastic.
    pub(crate) fn advance(&mut self, pushes: impl Iterator<Item = [f32; 2]>) {
        let mut push = [0.0; 2];
        pushes.for_each(|one| push = [push[0] + one[0], push[1] + one[1]]);
        for ((place, velocity), push) in self.place.iter_mut().zip(&mut self.velocity).zip(push) {
            *velocity += push * STEP;
            let leaves = if *velocity < 0.0 { *place < 0.0 } else { *place > SIDE };
            if leaves {
                *velocity = -*velocity;
            }
            *place += *velocity * STEP;
        }
    }

    /// Reads a letter, which must be the sender's next one to this disc.
    pub(crate) fn read(&mut self, unit: UnitId, from: Sender, reading: u32) -> Result<(), Fault> {
        let out_of_turn = Fault::OutOfTurn(unit, from);
        let read = self.read.get_mut(from.sender as usize).ok_or(out_of_turn)?;
        if letter(from.sender, from.sequence) != (unit, reading)
            || from.sequence / DISCS as u32 != read.letters
        {
            return Err(out_of_turn);
        }
        read.letters += 1;
        read.hash.add(u64::from(reading));
        Ok(())
    }

    /// Letters read so far.
    pub(crate) fn letters(&self) -> u32 {
        self.read.iter().map(|read| read.letters).sum()
    }

    /// A hash of the disc's motion, and with `mail` of what it has read.
    pub(crate) fn digest(&self, mail: bool) -> Hash {
        let mut hash = Hash::EMPTY;
        let motion = self.place.into_iter().chain(self.velocity);
        motion.for_each(|number| hash.add(u64::from(number.to_bits())));
        if mail {
            self.read.iter().for_each(|read| hash.add(read.hash.0));
        }
        hash
    }
}

/// What the run is judged by; the render token carries it along.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Picture {
    discs: [Hash; DISCS],
    /// Frames shown.
    pub(crate) frames: u32,
    /// Letters read up to the frame shown last.
    pub(crate) letters: u32,
    /// Frames in which letters were read.
    pub(crate) frames_with_letters: u32,
    /// Letters read up to the frame that is being rendered.
    reading: u32,
    /// Of every disc's motion in every frame, and of all letters in the last.
    pub(crate) hash: Hash,
}

impl Picture {
    pub(crate) const EMPTY: Self = Self {
        discs: [Hash::EMPTY; DISCS],
        frames: 0,
        letters: 0,
        frames_with_letters: 0,
        reading: 0,
        hash: Hash::EMPTY,
    };

    /// Draws one disc.
    pub(crate) fn draw(&mut self, index: usize, disc: &Disc) {
        self.discs[index] = disc.digest(self.frames + 1 == FRAMES);
        self.reading += disc.letters();
    }

    /// Shows what was drawn.
    pub(crate) fn show(&mut self) {
        self.discs.iter().for_each(|disc| self.hash.add(disc.0));
        self.frames += 1;
        self.frames_with_letters += u32::from(self.reading != self.letters);
        self.letters = ::core::mem::take(&mut self.reading);
    }
}

/// The callbacks.
pub(crate) struct Room;

impl Environment for Room {
    type Object = Disc;
    type Interaction = ();
    type Contact = [f32; 2];
    type Message = u32;
    type Renderer = Picture;
    type Error = Fault;

    fn broad_phase(&self, a: &Disc, b: &Disc) -> bool {
        a.is_near(b)
    }

    fn interact(
        &self,
        _: Pair,
        a: &Disc,
        b: &Disc,
        (): &mut (),
        contacts: &mut Contacts<'_, '_, [f32; 2]>,
    ) -> Result<(), Fault> {
        if let Some(push) = a.push(b) {
            contacts.push(&[push])?;
        }
        Ok(())
    }

    fn update(
        &self,
        unit: UnitId,
        _: Frame,
        disc: &mut Disc,
        inputs: &mut Inputs<'_, '_, Self>,
    ) -> Result<(), Fault> {
        // A push is that of the lower number.
        disc.advance(inputs.interactions().flat_map(|met| {
            let sign = if unit < met.other { 1.0 } else { -1.0 };
            met.contacts.flatten().map(move |push| push.map(|axis| sign * axis))
        }));
        while let Some((from, reading)) = inputs.next_letter() {
            disc.read(unit, from, reading)?;
        }
        Ok(())
    }

    fn render(
        &self,
        unit: UnitId,
        _: Frame,
        disc: &Disc,
        picture: &mut Picture,
    ) -> Result<(), Fault> {
        picture.draw(unit.index(), disc);
        Ok(())
    }

    fn swap(&self, _: Frame, picture: &mut Picture) -> Result<(), Fault> {
        picture.show();
        Ok(())
    }
}
