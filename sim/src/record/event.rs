//! What is recorded, and the order that it comes in.

use glam::Vec3;

use super::flaw::Disorder;
use super::wire::{Decoder, Encoder, Malformed};
use super::{CHECKPOINT_FRAMES, MAX_LETTERS, MAX_PAYLOAD, message};
use crate::manager::VeManager;
use crate::message::{Custom, Message};
use crate::object::ObjectId;

/// Something that came from outside, or is to be checked.
///
/// Messages come in the order in which they were taken out of the mailbox, the others in the order of
/// their frames. What is noted between two runs, before frame f, comes after all messages that were taken
/// until frame f − 1 was swapped, which are due in frame f + 1 at the latest, and before all that were
/// taken later, which are due in frame f at the earliest.
#[derive(Debug)]
pub enum Event {
    /// A message from outside.
    Letter {
        /// The frame in whose update it is processed.
        due: u64,
        /// Whom it is for.
        to: ObjectId,
        /// What it says.
        message: Message,
    },
    /// Something between two runs.
    Stop {
        /// The frame before which it is.
        frame: u64,
        /// What it is.
        stop: Stop,
    },
}

/// Something between two runs.
#[derive(Clone, Debug, PartialEq)]
pub enum Stop {
    /// A number that all stages share was changed.
    Control(Control),
    /// Objects were added, as these bytes of the host's own say.
    Objects(Vec<u8>),
    /// The hash of each object, in the order of their numbers.
    Checkpoint(Vec<u64>),
}

/// A change of a number that all stages share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// The acceleration of gravity, in metres per second squared.
    Gravity(Vec3),
    /// The time from one frame to the next, in seconds; greater than 0 and finite.
    TimeStep(f32),
}

impl Control {
    /// Makes the change.
    pub fn apply(self, manager: &mut VeManager) {
        manager.change(&mut |stages| match self {
            Self::Gravity(gravity) => stages.gravity = gravity,
            Self::TimeStep(time_step) => stages.time_step = time_step,
        });
    }
}

const LETTER: u8 = 0;
const GRAVITY: u8 = 1;
const TIME_STEP: u8 = 2;
const OBJECTS: u8 = 3;
const CHECKPOINT: u8 = 4;

impl Stop {
    /// Writes it, as noted `later` frames after the last one.
    pub(super) fn encode(&self, later: u64, to: &mut Encoder<'_>) {
        match self {
            Self::Control(Control::Gravity(gravity)) => {
                to.byte(GRAVITY);
                to.number(later);
                to.floats(gravity.to_array());
            }
            Self::Control(Control::TimeStep(time_step)) => {
                to.byte(TIME_STEP);
                to.number(later);
                to.float(*time_step);
            }
            Self::Objects(spec) => {
                to.byte(OBJECTS);
                to.number(later);
                to.bytes(spec);
            }
            Self::Checkpoint(hashes) => {
                to.byte(CHECKPOINT);
                to.number(later);
                to.wides(hashes);
            }
        }
    }

    fn decode(kind: u8, from: &mut Decoder<'_>) -> Result<Self, Malformed> {
        Ok(match kind {
            GRAVITY => Self::Control(Control::Gravity(from.vector()?)),
            TIME_STEP => Self::Control(Control::TimeStep(from.float()?)),
            OBJECTS => Self::Objects(from.bytes()?.to_owned()),
            CHECKPOINT => Self::Checkpoint(from.wides()?),
            value => return Err(Malformed::Value { what: "an event's kind", value: value.into() }),
        })
    }
}

/// Writes a message, due `later` frames after the last one.
pub(super) fn encode_letter<'m>(
    later: u64,
    object: ObjectId,
    message: &'m Message,
    to: &mut Encoder<'_>,
) -> Result<(), &'m dyn Custom> {
    to.byte(LETTER);
    to.number(later);
    to.number(object.0.into());
    message::encode(message, to)
}

/// Reads the next event. Frames are counted from where the order stands.
pub(super) fn decode(from: &mut Decoder<'_>, order: &Order) -> Result<Event, Malformed> {
    let kind = from.byte()?;
    let later = from.number()?;
    let overflow = Malformed::Value { what: "a frame", value: later };
    if kind == LETTER {
        let due = order.due.checked_add(later).ok_or(overflow)?;
        let to = ObjectId(from.small("an object")?);
        return Ok(Event::Letter { due, to, message: message::decode(from)? });
    }
    let frame = order.stop.checked_add(later).ok_or(overflow)?;
    Ok(Event::Stop { frame, stop: Stop::decode(kind, from)? })
}

/// How far a recording has come, and what may come next.
#[derive(Clone, Debug, Default)]
pub(super) struct Order {
    /// Frames that were swapped when the last chunk was closed: all messages due in them are known.
    frames: u64,
    /// The frame in which the last message is due.
    due: u64,
    /// Messages due in that frame.
    letters: usize,
    /// The frame before which the last stop was.
    stop: u64,
    /// Bytes of the stops before that frame.
    stop_bytes: usize,
    /// The frame before which the last checkpoint was.
    checkpoint: Option<u64>,
}

impl Order {
    /// Frames that all is known of.
    pub(super) fn frames(&self) -> u64 {
        self.frames
    }

    /// The frame before which all messages are known.
    pub(super) fn known(&self) -> u64 {
        self.due.max(self.stop)
    }

    /// How much later than the last message one is due.
    pub(super) fn due_later(&self, due: u64) -> u64 {
        due.saturating_sub(self.due)
    }

    /// How much later than the last stop something is.
    pub(super) fn later(&self, frame: u64) -> u64 {
        frame.saturating_sub(self.stop)
    }

    /// A message is due in a frame.
    pub(super) fn letter(&mut self, due: u64) -> Result<(), Disorder> {
        if due < self.due.max(self.stop) {
            return Err(Disorder::Letter { due, after: self.due.max(self.stop) });
        }
        // The last that was taken before the next checkpoint is due in the frame after it.
        self.checked_until(due, CHECKPOINT_FRAMES + 1)?;
        self.letters = if due == self.due { self.letters + 1 } else { 1 };
        self.due = due;
        match self.letters <= MAX_LETTERS {
            true => Ok(()),
            false => Err(Disorder::Letters { due }),
        }
    }

    /// Something that takes so many bytes is noted before a frame.
    pub(super) fn stop(&mut self, frame: u64, stop: &Stop, bytes: usize) -> Result<(), Disorder> {
        if frame < self.stop.max(self.due.saturating_sub(1)) {
            return Err(Disorder::Stop { frame, after: self.stop, due: self.due });
        }
        self.checked_until(frame, CHECKPOINT_FRAMES)?;
        self.stop_bytes = if frame == self.stop { self.stop_bytes + bytes } else { bytes };
        self.stop = frame;
        if matches!(stop, Stop::Checkpoint(_)) {
            self.checkpoint = Some(frame);
        }
        match self.stop_bytes <= MAX_PAYLOAD {
            true => Ok(()),
            false => Err(Disorder::Stops { frame }),
        }
    }

    /// A chunk is closed after so many frames.
    pub(super) fn close(&mut self, frames: u64) -> Result<(), Disorder> {
        let least = self.frames.max(self.stop).max(self.due.saturating_sub(1));
        if frames < least {
            return Err(Disorder::Frames { frames, least });
        }
        self.checked_until(frames, CHECKPOINT_FRAMES)?;
        self.frames = frames;
        if self.due < frames {
            (self.due, self.letters) = (frames, 0);
        }
        if self.stop < frames {
            (self.stop, self.stop_bytes) = (frames, 0);
        }
        Ok(())
    }

    /// The recording is over.
    pub(super) fn end(&self) -> Result<(), Disorder> {
        match self.checkpoint == Some(self.frames) {
            true => Ok(()),
            false => Err(self.unchecked(self.frames)),
        }
    }

    /// Sees that something is at most `most` frames after a checkpoint: so a file can tell of no more frames than it
    /// has checkpoints for.
    fn checked_until(&self, frames: u64, most: u64) -> Result<(), Disorder> {
        match frames.saturating_sub(self.checkpoint.unwrap_or(0)) <= most {
            true => Ok(()),
            false => Err(self.unchecked(frames)),
        }
    }

    fn unchecked(&self, frames: u64) -> Disorder {
        Disorder::Unchecked { frames, checked: self.checkpoint }
    }
}

/// How much was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Frames.
    pub frames: u64,
    /// Messages from outside.
    pub letters: u64,
    /// Changes of numbers that all stages share.
    pub controls: u64,
    /// How often objects were added.
    pub additions: u64,
    /// Checkpoints.
    pub checkpoints: u64,
}

impl Totals {
    /// Counts what is between two runs.
    pub(super) fn stop(&mut self, stop: &Stop) {
        *match stop {
            Stop::Control(_) => &mut self.controls,
            Stop::Objects(_) => &mut self.additions,
            Stop::Checkpoint(_) => &mut self.checkpoints,
        } += 1;
    }

    pub(super) fn encode(&self, to: &mut Encoder<'_>) {
        let Self { frames, letters, controls, additions, checkpoints } = *self;
        let numbers = [frames, letters, controls, additions, checkpoints];
        numbers.into_iter().for_each(|number| to.number(number));
    }

    pub(super) fn decode(mut from: Decoder<'_>) -> Result<Self, Malformed> {
        let totals = Self {
            frames: from.number()?,
            letters: from.number()?,
            controls: from.number()?,
            additions: from.number()?,
            checkpoints: from.number()?,
        };
        from.finish()?;
        Ok(totals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Also where the frames that have passed, and not a letter, say that another frame's come.
    #[test]
    fn letters_are_counted_frame_by_frame() {
        let mut order = Order::default();
        let fill = |order: &mut Order, due| (0..MAX_LETTERS).try_for_each(|_| order.letter(due));
        assert_eq!(fill(&mut order, 1), Ok(()));
        assert_eq!(order.close(2), Ok(()));
        assert_eq!(fill(&mut order, 2), Ok(()));
        assert_eq!(order.letter(2), Err(Disorder::Letters { due: 2 }));
    }
}
