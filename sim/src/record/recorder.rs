//! Recording.

use std::io::Write;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::chunk::{ChunkWriter, Kind};
use super::event::{Control, Stop, Totals};
use super::flaw::RecordError;
use super::header::Header;
use super::journal::Journal;
use super::wire::Encoder;
use super::{CHECKPOINT_FRAMES, MAX_PAYLOAD, frames_to_checkpoint};
use crate::executor::OnFrame;
use crate::executor::on_panic::OnPanic;
use crate::manager::VeManager;
use crate::object::ObjectId;
use crate::render::Renderer;
use crate::state::object_hash;

/// How long what was recorded may wait to be written; usually 1 s. It is looked at after every run and every
/// [`CHECKPOINT_FRAMES`] of it: a crash costs so much more.
const MOST_WAITING: Duration = Duration::from_secs(1);
/// Bytes that are written at once even if they have not waited; usually 256 KiB.
const MANY_BYTES: usize = 1 << 18;

/// Records a session: whoever runs the environment runs it by [`Recorder::run`] instead, and tells of
/// what else is done between runs. Messages from outside are taken down where they leave the mailbox,
/// whoever posts them.
///
/// The environment may be taken out and go on in another executor meanwhile; its mailbox goes with it.
/// Of [custom messages](crate::message::Message::Custom) that come from outside [`Grasp`], [`Hold`], [`LetGo`],
/// [`Cut`] and [`Scrape`] are recorded; any other, as one of the application's own making, cannot be, and ends the
/// recording. Those that objects send each other need no recording, nor does anything else that follows from what is
/// recorded.
/// Changes of rules are not recorded, and an environment with a callback budget is not repeatable.
///
/// After an error, and if it is dropped, it records no longer, and the environment goes on as it would
/// have; what was written is a recording that is cut off. Only where threads could not be had
/// ([`ExecutorError::can_go_on`](crate::executor::ExecutorError::can_go_on)) does it go on.
///
/// [`Grasp`]: crate::behavior::Grasp
/// [`Hold`]: crate::behavior::Hold
/// [`LetGo`]: crate::behavior::LetGo
/// [`Cut`]: crate::behavior::tissue::Cut
/// [`Scrape`]: crate::behavior::tissue::Scrape
pub struct Recorder<W: Write> {
    writer: ChunkWriter<W>,
    journal: Arc<Mutex<Journal>>,
    /// When something was written.
    written: Instant,
    /// The last checkpoint.
    hashes: Vec<(ObjectId, u64)>,
    checked: Option<u64>,
}

impl<W: Write> Recorder<W> {
    /// Begins to record an environment that is at its start, and built as `header` says.
    ///
    /// # Errors
    /// The environment is not before frame 0, or recorded already; the header cannot be written, or takes more than a
    /// chunk's 16 MiB.
    pub fn begin(write: W, header: &Header, manager: &VeManager) -> Result<Self, RecordError> {
        let frame = manager.frame();
        if frame > 0 {
            return Err(RecordError::Begun { frame });
        }
        let mut bytes = Vec::new();
        header.encode(&mut Encoder(&mut bytes));
        if bytes.len() > MAX_PAYLOAD {
            return Err(RecordError::Full { frame });
        }
        let journal = Arc::new(Mutex::new(Journal::new()));
        // Nothing is written where another recorder may be writing.
        if !manager.mailbox().record(&journal) {
            return Err(RecordError::Recorded);
        }
        let mut writer = ChunkWriter::new(write)?;
        writer.write(Kind::Header, &bytes)?;
        let written = Instant::now();
        let mut recorder = Self { writer, journal, written, hashes: Vec::new(), checked: None };
        recorder.checkpoint(manager)?;
        recorder.write(manager)?;
        Ok(recorder)
    }

    /// Advances by `frames` frames, with a checkpoint before every frame whose number is a multiple of
    /// [`CHECKPOINT_FRAMES`], and writes what was recorded.
    ///
    /// # Errors
    /// The executor cannot go on, or what was recorded cannot be written, or frames were run without the recorder, so
    /// that the last checkpoint is more than [`CHECKPOINT_FRAMES`] ago; or what came from outside between two checkpoints
    /// takes more than a chunk's 16 MiB, some 900,000 impulses: a host that posts so much had better run fewer frames at
    /// a time, after which what is recorded is written. Frames may be left to do then: [`VeManager::frame`] says how far
    /// it came.
    ///
    /// # Panics
    /// As [`VeManager::run`]; nothing is recorded any more then.
    pub fn run(
        &mut self,
        manager: &mut VeManager,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), RecordError> {
        let end = manager.frame().saturating_add(frames);
        let journal = Arc::clone(&self.journal);
        // What a panic leaves could not be repeated, as what an error does.
        let _guard = OnPanic::new(|| journal.lock().unwrap_or_else(PoisonError::into_inner).end());
        loop {
            let frame = manager.frame();
            let piece = frames_to_checkpoint(frame).min(end - frame);
            let run = manager.run(piece, renderer, on_frame);
            if run.as_ref().is_err_and(|error| !error.can_go_on()) {
                self.lock().end();
            }
            run?;
            if frames_to_checkpoint(manager.frame()) == CHECKPOINT_FRAMES {
                self.checkpoint(manager)?;
            }
            self.lock().check()?;
            if self.written.elapsed() > MOST_WAITING || self.lock().len() > MANY_BYTES {
                self.write(manager)?;
            }
            if manager.frame() >= end {
                return Ok(());
            }
        }
    }

    /// Changes a number that all stages share, before the next frame.
    ///
    /// # Errors
    /// The recording has failed before; the change is made all the same.
    pub fn control(
        &mut self,
        manager: &mut VeManager,
        control: Control,
    ) -> Result<(), RecordError> {
        control.apply(manager);
        self.stop(manager.frame(), &Stop::Control(control))
    }

    /// Objects are added before the next frame, as `spec` says to whoever replays it: it must say all
    /// that does not follow from the environment's state.
    ///
    /// # Errors
    /// The recording has failed before, or the bytes are too many.
    pub fn objects(&mut self, manager: &VeManager, spec: &[u8]) -> Result<(), RecordError> {
        // The state is another one.
        self.checked = None;
        self.stop(manager.frame(), &Stop::Objects(spec.to_owned()))
    }

    /// Takes down the hash of every object as it is before the next frame, unless that was done already.
    ///
    /// # Errors
    /// The recording has failed before.
    pub fn checkpoint(&mut self, manager: &VeManager) -> Result<(), RecordError> {
        let frame = manager.frame();
        if self.checked == Some(frame) {
            return Ok(());
        }
        let mut hashes = std::mem::take(&mut self.hashes);
        hash_objects(manager, &mut hashes);
        let list = hashes.iter().map(|&(_, hash)| hash).collect();
        self.hashes = hashes;
        self.checked = Some(frame);
        self.stop(frame, &Stop::Checkpoint(list))
    }

    /// Ends the recording with a checkpoint; says how much was recorded.
    ///
    /// # Errors
    /// It has failed before, or cannot be written.
    pub fn finish(mut self, manager: &VeManager) -> Result<(W, Totals), RecordError> {
        self.checkpoint(manager)?;
        self.write(manager)?;
        let totals = self.lock().totals();
        let mut bytes = Vec::new();
        totals.encode(&mut Encoder(&mut bytes));
        self.writer.write(Kind::End, &bytes)?;
        Ok((self.writer.into_inner(), totals))
    }

    fn stop(&mut self, frame: u64, stop: &Stop) -> Result<(), RecordError> {
        let mut journal = self.lock();
        journal.stop(frame, stop);
        journal.check()
    }

    /// Writes what was recorded so far, which [`Recorder::run`] does about once a second.
    ///
    /// # Errors
    /// The recording has failed before, or cannot be written, or frames were run without the recorder, as in [`Recorder::run`].
    pub fn write(&mut self, manager: &VeManager) -> Result<(), RecordError> {
        let mut journal = self.journal.lock().unwrap_or_else(PoisonError::into_inner);
        journal.check()?;
        let written = match journal.close(manager.frame()) {
            Ok(payload) => self.writer.write(Kind::Events, payload).map_err(RecordError::from),
            Err(disorder) => Err(disorder.into()),
        };
        if written.is_err() {
            journal.end();
            return written;
        }
        journal.clear();
        self.written = Instant::now();
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Journal> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The hash of every object, in the order of their numbers.
pub(super) fn hash_objects(manager: &VeManager, hashes: &mut Vec<(ObjectId, u64)>) {
    hashes.clear();
    manager.visit(&mut |object| hashes.push((object.id(), object_hash(object))));
    hashes.sort_unstable();
}
