//! Sessions recorded, and replayed bit for bit by any executor and number of threads.
//!
//! Frames follow from the scene and from what comes from outside: messages, changes of numbers that all
//! stages share, objects that are added. A [`Recorder`] takes these down, with the frame that each belongs
//! to, and every [`CHECKPOINT_FRAMES`] frames the hash of every object; a [`Replay`] gives them to another
//! run of the same scene, checks the hashes, and says where the two part and in which objects.
//!
//! ```
//! use dualframe_sim::manager::{Settings, VeManager};
//! use dualframe_sim::message::Message;
//! use dualframe_sim::object::ObjectId;
//! use dualframe_sim::record::{Header, Recorder, Replay, Step};
//! use dualframe_sim::render::NullRenderer;
//! use dualframe_sim::scene::ParticleScene;
//!
//! // 100 frames of ten particles, of which somebody pushes one.
//! let particles = ParticleScene::new(10);
//! let mut manager = VeManager::new(particles.build()?, Settings::default())?;
//! let mut recorder = Recorder::begin(Vec::new(), &Header::of(&particles), &manager)?;
//! manager.mailbox().post(ObjectId(3), Message::Impulse { node: 0, impulse: [1e-3, 0.0, 0.0] });
//! recorder.run(&mut manager, 100, &mut NullRenderer::new(), &mut |_| ())?;
//! let (file, _) = recorder.finish(&manager)?;
//! let recorded = manager.state_hash();
//!
//! // The same once more, on one thread.
//! let mut replay = Replay::new(&file[..])?;
//! let mut scene = replay.header().scene::<ParticleScene>()?.build()?;
//! replay.begin(&mut scene);
//! let mut manager = VeManager::new(scene, Settings { threads: 1, ..Settings::default() })?;
//! // At each step a checkpoint has agreed, or 1,000 frames are done.
//! while replay.advance(&mut manager, 1_000, &mut NullRenderer::new(), &mut |_| ())? != Step::Over {}
//! assert_eq!((replay.letters(), manager.state_hash()), (1, recorded));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The format
//!
//! All is little-endian and the same on every machine. *number* is LEB128, in as few bytes as it needs;
//! *bytes* and *text* are a number, their length, and so many bytes; *float* is four bytes.
//!
//! A file is the 8 bytes of the magic (as PNG's: it shows whether a line end was translated), the version in 4 bytes, and chunks
//! up to the end:
//!
//! | bytes | of a chunk |
//! |---|---|
//! | 1 | kind: `H` header, first and once; `E` events; `Z` end, last and once |
//! | 1 | 1 if the content is packed by deflate (without zlib's header), as it is where that is shorter; else 0 |
//! | 4 | length of the content as stored, in bytes, at most 16 MiB |
//! | 4 | length of the content unpacked, in bytes, at most 16 MiB |
//! | 4 | CRC-32 of the chunk but this field, begun with the CRC-32 of the chunk before (the first with 0) |
//! | | the content |
//!
//! - Header: text, the engine's version; text, the scene's kind, both of at most 64 bytes; bytes, the scene as its
//!   [`SceneSpec`] writes it.
//! - Events: 8 bytes, F: all that came from outside for the frames before frame F is in this chunk or
//!   before; then [events](Event) until the content ends. An event is a byte, its kind; a number, by how
//!   many frames it is later than the one before of its sort (messages, or all others), or than the F of
//!   the chunk before if that is later; and
//!   - 0, message: number, the object; the [message](#messages);
//!   - 1, gravity: 3 floats; 2, time step: float;
//!   - 3, objects added: bytes;
//!   - 4, checkpoint: number, how many objects; 8 bytes each, their hashes. The state's hash follows. Nothing, and
//!     no F, is more than 60 frames after the last one, or 61 if it is a message; the last F has one.
//! - End: numbers, of frames, messages, controls, additions and checkpoints.
//!
//! ## Messages
//!
//! A byte, the kind, and
//! - 0, impulse: number, the node; 3 floats;
//! - 1, stiffness: 2 floats; 2, damping: float;
//! - 3, pull: number, the node; 3 floats, the target; float, the stiffness; 4, release;
//! - 5, weightless: byte, 0 or 1;
//! - 6, device: 7 floats, position and orientation; number, the buttons; 7, take up: byte, the instrument;
//! - 8, remove;
//! - 9, [`Grasp`]: number, the tool; 3 floats, the point; 3 floats, radius, stiffness and strength;
//! - 10, [`Hold`]: number, the tool; 3 floats; 11, [`LetGo`]: number, the tool;
//! - 12, [`Cut`]: number, the tool; 12 floats, tip and heel before and now;
//! - 13, [`Scrape`]: 4 floats, middle and radius.
//!
//! A chunk with a kind that is not known is not whole: so kinds are added without another version.
//!
//! A chunk is written about once a second. A file that is cut off or altered is whole up to its first chunk that is not,
//! and plays until the F of the last one that is.
//!
//! [`Grasp`]: crate::behavior::Grasp
//! [`Hold`]: crate::behavior::Hold
//! [`LetGo`]: crate::behavior::LetGo
//! [`Cut`]: crate::behavior::tissue::Cut
//! [`Scrape`]: crate::behavior::tissue::Scrape

mod chunk;
mod event;
mod flaw;
mod header;
mod journal;
mod message;
mod reader;
mod recorder;
mod replay;
pub mod wire;

pub use event::{Control, Event, Stop, Totals};
pub use flaw::{
    Difference, Disorder, Flaw, ObjectDifference, Place, ReadError, RecordError, ReplayError,
};
pub use header::{Header, SceneSpec};
pub(crate) use journal::Journal;
pub use reader::Reader;
pub use recorder::Recorder;
pub use replay::{Replay, Step};

/// Frames from one checkpoint to the next; usually 60.
pub const CHECKPOINT_FRAMES: u64 = 60;
/// The version of the format.
pub const VERSION: u32 = 1;
/// How a recording begins.
const MAGIC: [u8; 8] = *b"\x89DFR\r\n\x1a\n";
/// The most bytes of a chunk's content, and of what is done before one frame; usually 16 MiB.
const MAX_PAYLOAD: usize = 1 << 24;
/// The most messages from outside that are due in one frame; usually 1,048,576.
const MAX_LETTERS: usize = 1 << 20;

/// Frames from the one before which an environment is to its next checkpoint, at least 1.
#[must_use]
pub fn frames_to_checkpoint(frame: u64) -> u64 {
    CHECKPOINT_FRAMES - frame % CHECKPOINT_FRAMES
}

#[cfg(test)]
mod tests;
