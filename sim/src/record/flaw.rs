//! What can be wrong with a recording, with making one and with replaying it.

use std::fmt;
use std::io;

use thiserror::Error;

use super::event::Totals;
use super::wire::Malformed;
use super::{MAX_LETTERS, MAX_PAYLOAD, VERSION};
use crate::executor::ExecutorError;
use crate::object::ObjectId;

/// Why a session is no longer recorded. What was written before is a recording that is cut off.
#[derive(Debug, Error)]
pub enum RecordError {
    /// It cannot be written.
    #[error("the recording cannot be written")]
    Write(#[from] io::Error),
    /// It has failed before.
    #[error("the session is no longer recorded")]
    Over,
    /// The environment is not at its start.
    #[error("a recording begins before frame 0, and the environment is before frame {frame}")]
    Begun {
        /// The next frame.
        frame: u64,
    },
    /// The environment is being recorded already.
    #[error("the environment is being recorded already")]
    Recorded,
    /// A custom message came from outside that a recording has no form for, as one of the application's own making:
    /// nobody could read it.
    #[error("a message from outside to {to}, due in frame {due}, cannot be recorded: {message}")]
    Custom {
        /// Whom it was for.
        to: ObjectId,
        /// The frame in which it was due.
        due: u64,
        /// What it was, for people.
        message: String,
    },
    /// More came from outside than a recording can hold.
    #[error(transparent)]
    Disorder(#[from] Disorder),
    /// More than a chunk can hold came between two times of writing.
    #[error("more than {MAX_PAYLOAD} bytes are to be recorded at once, in frame {frame}")]
    Full {
        /// The frame.
        frame: u64,
    },
    /// The executor could not go on.
    #[error(transparent)]
    Executor(#[from] ExecutorError),
}

/// What was recorded is too much for a frame, or not in order.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum Disorder {
    /// A message comes too late.
    #[error("a message due in frame {due} comes after what is of frame {after}")]
    Letter {
        /// The frame in which it is due.
        due: u64,
        /// The earliest frame in which it could be.
        after: u64,
    },
    /// Too many messages are due in one frame.
    #[error("more than {MAX_LETTERS} messages are due in frame {due}")]
    Letters {
        /// The frame.
        due: u64,
    },
    /// A stop comes too late.
    #[error(
        "what is before frame {frame} comes after what is before frame {after} and messages due in \
         frame {due}"
    )]
    Stop {
        /// The frame before which it is.
        frame: u64,
        /// That of the stop before.
        after: u64,
        /// The frame in which the last message is due.
        due: u64,
    },
    /// Too much was noted before one frame.
    #[error("what was done before frame {frame} takes more than {MAX_PAYLOAD} bytes")]
    Stops {
        /// The frame.
        frame: u64,
    },
    /// A part of the recording is of fewer frames than it tells of.
    #[error("a part that is said to go up to {frames} frames goes up to {least}")]
    Frames {
        /// The number of frames.
        frames: u64,
        /// The least that it can be.
        least: u64,
    },
    /// More frames than a checkpoint apart are not checked, or the last ones are not.
    #[error("of {frames} frames the last checkpoint is {}", told(.checked))]
    Unchecked {
        /// The number of frames that are told of.
        frames: u64,
        /// Those before the last checkpoint, if there is one.
        checked: Option<u64>,
    },
}

fn told(checked: &Option<u64>) -> String {
    checked.map_or("missing".to_owned(), |frames| format!("after {frames}"))
}

/// What is wrong with a recording, and where.
#[derive(Debug, Error)]
#[error("{flaw}; {place}")]
pub struct ReadError {
    /// Where.
    pub place: Place,
    /// What.
    pub flaw: Flaw,
}

/// A place in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The chunk, counted from 0, the header.
    pub chunk: u64,
    /// Where it begins, in bytes from the file's beginning.
    pub offset: u64,
    /// The frames before it that are whole, and can be played.
    pub frames: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { chunk, offset, frames } = self;
        write!(f, "in chunk {chunk} at byte {offset}, after {frames} whole frames")
    }
}

/// What is wrong with a recording.
#[derive(Debug, Error)]
pub enum Flaw {
    /// The system does not read it.
    #[error("it cannot be read: {0}")]
    Read(io::Error),
    /// It is something else.
    #[error("it is no recording")]
    Magic,
    /// It is of a version that is not known.
    #[error("it is of version {found}, and only version {VERSION} is read")]
    Version {
        /// Its version.
        found: u32,
    },
    /// It ends too early.
    #[error("it is cut off")]
    CutOff,
    /// It goes on after its end.
    #[error("it goes on after its end")]
    Trailing,
    /// A chunk is of a kind that does not belong there.
    #[error("a chunk of kind {found} is where one of {expected} should be")]
    Kind {
        /// Its kind.
        found: u8,
        /// What could be there.
        expected: &'static str,
    },
    /// A chunk is longer than any is written.
    #[error("a chunk of {length} bytes is longer than {MAX_PAYLOAD}, or than its packing allows")]
    Length {
        /// Its length, in bytes.
        length: u64,
    },
    /// A chunk is not as it was written.
    #[error("it is damaged: the checksum is {found:08x} and should be {expected:08x}")]
    Checksum {
        /// As written.
        expected: u32,
        /// Of what is there.
        found: u32,
    },
    /// A chunk's compressed data are damaged.
    #[error("a chunk cannot be unpacked")]
    Packing,
    /// A chunk's content is not what it should be.
    #[error(transparent)]
    Malformed(#[from] Malformed),
    /// What is told is not in order, or too much.
    #[error(transparent)]
    Disorder(#[from] Disorder),
    /// The end tells of another number of things than there were.
    #[error("the end tells of {told:?}, and there were {found:?}")]
    Totals {
        /// As written.
        told: Box<Totals>,
        /// As read.
        found: Box<Totals>,
    },
}

/// Why a replay ended before the recording did.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// The recording is damaged; what is whole of it was played.
    #[error(transparent)]
    Recording(#[from] ReadError),
    /// The replayed state is another.
    #[error(transparent)]
    Differs(#[from] Difference),
    /// The executor could not go on.
    #[error(transparent)]
    Executor(#[from] ExecutorError),
    /// The environment is not where the replay is.
    #[error("the environment is before frame {found}, and the replay before frame {expected}")]
    Elsewhere {
        /// The replay's next frame.
        expected: u64,
        /// The environment's.
        found: u64,
    },
}

/// A replayed state that is not the recorded one.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub struct Difference {
    /// The first checkpoint at which they differ: so many frames were done.
    pub frame: u64,
    /// The hash of the recorded state.
    pub expected: u64,
    /// The hash of the replayed state.
    pub found: u64,
    /// The objects that differ, by number; at least one.
    pub objects: Vec<ObjectDifference>,
}

/// An object whose replayed state is not the recorded one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectDifference {
    /// The object.
    pub object: ObjectId,
    /// Its hash as recorded, if it was there.
    pub expected: Option<u64>,
    /// Its hash in the replay, if it is there.
    pub found: Option<u64>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { frame, expected, found, objects } = self;
        write!(
            f,
            "after {frame} frames the state is {found:016x}, and {expected:016x} was recorded: "
        )?;
        let hash = |hash: Option<u64>| match hash {
            Some(hash) => format!("{hash:016x}"),
            None => "not there".to_owned(),
        };
        if let Some(first) = objects.first() {
            let (found, expected) = (hash(first.found), hash(first.expected));
            write!(f, "{} is {found} and was {expected}", first.object)?;
        }
        match objects.len() {
            0 | 1 => Ok(()),
            count => write!(f, ", and {} more differ", count - 1),
        }
    }
}
