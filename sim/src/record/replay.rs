//! Replaying.

use std::collections::VecDeque;
use std::io::Read;

use super::MAX_LETTERS;
use super::event::{Event, Stop};
use super::flaw::{Difference, ObjectDifference, ReadError, ReplayError};
use super::header::Header;
use super::reader::Reader;
use super::recorder::hash_objects;
use crate::executor::OnFrame;
use crate::manager::VeManager;
use crate::message::{Letter, Message};
use crate::object::ObjectId;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::state::StateHash;

/// The most frames that are run at once; usually 60.
const MOST_FRAMES: u64 = super::CHECKPOINT_FRAMES;
/// Bytes of stops that are read ahead, beyond those that must be; usually 16 MiB.
const MANY_BYTES: usize = super::MAX_PAYLOAD;

/// Replays a recording, in any executor: each message is processed in the frame in which it was, and
/// what was done between runs is done before the same frames.
///
/// The environment is built as the [header](Replay::header) says, given to [`Replay::begin`] and then
/// to a manager, which [`Replay::advance`] advances. Nothing else may be posted or changed meanwhile; the
/// environment may go on in another executor at any time.
pub struct Replay<R> {
    reader: Reader<R>,
    letters: VecDeque<(u64, ObjectId, Message)>,
    stops: VecDeque<(u64, Stop)>,
    stop_bytes: usize,
    /// The next frame.
    frame: u64,
    state: State,
    /// Messages of the frames that are done.
    played: u64,
    /// Those that were posted for the next frame and for the one after it.
    posted: [u64; 2],
    checkpoints: u64,
    hashes: Vec<(ObjectId, u64)>,
}

/// What is left to read.
enum State {
    /// Events.
    More,
    /// Nothing.
    Done,
    /// Nothing that is whole.
    Failed(Option<ReadError>),
}

/// Why a replay stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// As many frames are done as were asked for.
    Advanced,
    /// A checkpoint agrees.
    Agrees {
        /// Frames done.
        frame: u64,
    },
    /// Objects are to be added now, as these bytes of the recording host's own say.
    Objects(Vec<u8>),
    /// The recording is over.
    Over,
}

impl<R: Read> Replay<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// It is no recording, or of another version, or its header is damaged.
    pub fn new(read: R) -> Result<Self, ReadError> {
        Ok(Self {
            reader: Reader::new(read)?,
            letters: VecDeque::new(),
            stops: VecDeque::new(),
            stop_bytes: 0,
            frame: 0,
            state: State::More,
            played: 0,
            posted: [0; 2],
            checkpoints: 0,
            hashes: Vec::new(),
        })
    }

    /// What it is a recording of.
    #[must_use]
    pub fn header(&self) -> &Header {
        self.reader.header()
    }

    /// Messages from outside that were played: those processed in frames that are done.
    #[must_use]
    pub fn letters(&self) -> u64 {
        self.played
    }

    /// Checkpoints that agreed.
    #[must_use]
    pub fn checkpoints(&self) -> u64 {
        self.checkpoints
    }

    /// Puts the messages of the first two frames, which nothing could post in time, into the mail of the
    /// environment at its start.
    pub fn begin(&mut self, scene: &mut Scene) {
        self.read_ahead(1, 1);
        while let Some((due, to, message)) = self.letters.pop_front_if(|(due, ..)| *due < 2) {
            scene.mail.push(Letter { due, to, from: ObjectId::HOST, message });
            self.posted[due as usize] += 1;
        }
    }

    /// Advances by up to `most` frames, up to the next checkpoint, addition of objects or end.
    ///
    /// # Errors
    /// The state at a checkpoint is another than was recorded, or the executor could not go on, or the
    /// recording is damaged here: what is whole of it was played. The replay is over then.
    pub fn advance(
        &mut self,
        manager: &mut VeManager,
        most: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<Step, ReplayError> {
        let mut left = most;
        loop {
            let found = manager.frame();
            if found != self.frame {
                return Err(ReplayError::Elsewhere { expected: self.frame, found });
            }
            let known = self.read_ahead(found + 2, found + 1 + left.min(MOST_FRAMES));
            if let Some((_, stop)) = self.stops.pop_front_if(|(frame, _)| *frame == found) {
                match self.stop(manager, stop)? {
                    Some(step) => return Ok(step),
                    None => continue,
                }
            }
            let next = self.stops.front().map_or(u64::MAX, |&(frame, _)| frame);
            let frames = known.min(next).saturating_sub(found).min(left);
            if left == 0 {
                return Ok(Step::Advanced);
            }
            if frames == 0 {
                return self.over();
            }
            self.run(manager, frames, renderer, on_frame)?;
            left -= frames;
        }
    }

    /// Runs so many frames, for which all messages are there.
    fn run(
        &mut self,
        manager: &mut VeManager,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ReplayError> {
        let (mailbox, letters) = (manager.mailbox(), &mut self.letters);
        let (played, posted) = (&mut self.played, &mut self.posted);
        manager.run(frames, renderer, &mut |record| {
            on_frame(record);
            let due = record.frame + 2;
            *played += posted[0];
            *posted = [posted[1], 0];
            while let Some((_, to, message)) = letters.pop_front_if(|(next, ..)| *next <= due) {
                mailbox.post(to, message);
                posted[1] += 1;
            }
        })?;
        self.frame += frames;
        Ok(())
    }

    fn stop(&mut self, manager: &mut VeManager, stop: Stop) -> Result<Option<Step>, ReplayError> {
        self.stop_bytes -= bytes_of(&stop);
        match stop {
            Stop::Control(control) => control.apply(manager),
            Stop::Objects(spec) => return Ok(Some(Step::Objects(spec))),
            Stop::Checkpoint(expected) => {
                self.compare(manager, &expected)?;
                self.checkpoints += 1;
                return Ok(Some(Step::Agrees { frame: self.frame }));
            }
        }
        Ok(None)
    }

    fn compare(&mut self, manager: &VeManager, expected: &[u64]) -> Result<(), Difference> {
        hash_objects(manager, &mut self.hashes);
        let found = &self.hashes;
        let numbered = |(number, &hash): (usize, &u64)| (ObjectId(number as u32), hash);
        let state_of_expected: StateHash = expected.iter().enumerate().map(numbered).collect();
        let state_of_found: StateHash = found.iter().copied().collect();
        let count = expected.len().max(found.len());
        let both = |number: usize| ObjectDifference {
            object: ObjectId(number as u32),
            expected: expected.get(number).copied(),
            found: found.get(number).map(|&(_, hash)| hash),
        };
        let objects: Vec<_> =
            (0..count).map(both).filter(|both| both.expected != both.found).collect();
        if objects.is_empty() {
            return Ok(());
        }
        Err(Difference {
            frame: self.frame,
            expected: state_of_expected.finish(),
            found: state_of_found.finish(),
            objects,
        })
    }

    fn over(&mut self) -> Result<Step, ReplayError> {
        match &mut self.state {
            State::Failed(error) => error.take().map_or(Ok(Step::Over), |error| Err(error.into())),
            _ => Ok(Step::Over),
        }
    }

    /// Reads until all messages due in the frame `needed` are there, and, if they are not too many, those
    /// due until the frame `wanted`; gives the number of frames that can be run with what is there.
    fn read_ahead(&mut self, needed: u64, wanted: u64) -> u64 {
        while matches!(self.state, State::More) {
            let known = self.reader.known();
            let is_much = self.letters.len() > MAX_LETTERS || self.stop_bytes > MANY_BYTES;
            if known > wanted || (known > needed && is_much) {
                // Messages of the last one run are due two frames later.
                return known - 2;
            }
            match self.reader.next() {
                Some(Ok(Event::Letter { due, to, message })) => {
                    self.letters.push_back((due, to, message));
                }
                Some(Ok(Event::Stop { frame, stop })) => {
                    self.stop_bytes += bytes_of(&stop);
                    self.stops.push_back((frame, stop));
                }
                Some(Err(error)) => self.state = State::Failed(Some(error)),
                None => self.state = State::Done,
            }
        }
        self.reader.frames()
    }
}

/// The memory that a stop takes, about.
fn bytes_of(stop: &Stop) -> usize {
    match stop {
        Stop::Control(_) => size_of::<Stop>(),
        Stop::Objects(spec) => size_of::<Stop>() + spec.len(),
        Stop::Checkpoint(hashes) => size_of::<Stop>() + 8 * hashes.len(),
    }
}
