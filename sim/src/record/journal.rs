//! What is to be written next.

use crate::message::{Custom, Message};
use crate::object::ObjectId;

use super::MAX_PAYLOAD;
use super::event::{Order, Stop, Totals, encode_letter};
use super::flaw::{Disorder, RecordError};
use super::wire::Encoder;

/// The bytes at the beginning of a chunk of events that say how many frames it goes up to.
pub(super) const FRAMES: usize = 8;
/// Bytes that can be taken down before memory has to grow; usually 64 KiB, for a second of some devices.
const USUAL_BYTES: usize = 1 << 16;
/// Characters of a message that cannot be recorded, in the error that names it.
const SHOWN: usize = 80;

/// Takes down what the mailbox gives out, and what happens between runs, until it is written.
#[derive(Debug)]
pub(crate) struct Journal {
    /// The next chunk of events.
    payload: Vec<u8>,
    order: Order,
    totals: Totals,
    /// Whether nothing is taken down any more, and why, until that is told.
    is_over: bool,
    fault: Option<RecordError>,
}

impl Journal {
    pub(super) fn new() -> Self {
        let mut payload = Vec::with_capacity(USUAL_BYTES);
        payload.resize(FRAMES, 0);
        Self {
            payload,
            order: Order::default(),
            totals: Totals::default(),
            is_over: false,
            fault: None,
        }
    }

    /// Messages were taken out of the mailbox, to be processed in the frame `due`.
    pub(crate) fn taken(&mut self, due: u64, letters: &[(ObjectId, Message)]) {
        for (to, message) in letters {
            self.note(due, |journal| journal.letter(due, *to, message));
        }
    }

    /// Something happens between two runs.
    pub(super) fn stop(&mut self, frame: u64, stop: &Stop) {
        self.note(frame, |journal| {
            let before = journal.payload.len();
            stop.encode(journal.order.later(frame), &mut Encoder(&mut journal.payload));
            journal.order.stop(frame, stop, journal.payload.len() - before)?;
            journal.totals.stop(stop);
            Ok(())
        });
    }

    fn letter(&mut self, due: u64, to: ObjectId, message: &Message) -> Result<(), RecordError> {
        let later = self.order.due_later(due);
        let custom = |custom: &dyn Custom| {
            let message = format!("{custom:?}").chars().take(SHOWN).collect();
            RecordError::Custom { to, due, message }
        };
        encode_letter(later, to, message, &mut Encoder(&mut self.payload)).map_err(custom)?;
        self.order.letter(due)?;
        self.totals.letters += 1;
        Ok(())
    }

    /// Takes something down, whole or not at all.
    fn note(&mut self, frame: u64, note: impl FnOnce(&mut Self) -> Result<(), RecordError>) {
        if self.is_over {
            return;
        }
        let before = self.payload.len();
        let mut noted = note(self);
        if noted.is_ok() && self.payload.len() > MAX_PAYLOAD {
            noted = Err(RecordError::Full { frame });
        }
        if let Err(fault) = noted {
            self.payload.truncate(before);
            (self.fault, self.is_over) = (Some(fault), true);
        }
    }

    /// Bytes that wait to be written.
    pub(super) fn len(&self) -> usize {
        self.payload.len()
    }

    /// Sees that everything was taken down.
    pub(super) fn check(&mut self) -> Result<(), RecordError> {
        match (self.is_over, self.fault.take()) {
            (false, _) => Ok(()),
            (true, fault) => Err(fault.unwrap_or(RecordError::Over)),
        }
    }

    /// Takes nothing down any more.
    pub(super) fn end(&mut self) {
        self.is_over = true;
    }

    /// What is to be written after so many frames; [`Journal::clear`] begins the next chunk.
    pub(super) fn close(&mut self, frames: u64) -> Result<&[u8], Disorder> {
        self.order.close(frames)?;
        self.totals.frames = frames;
        if let Some(first) = self.payload.first_chunk_mut::<FRAMES>() {
            *first = frames.to_le_bytes();
        }
        Ok(&self.payload)
    }

    pub(super) fn clear(&mut self) {
        self.payload.truncate(FRAMES);
    }

    pub(super) fn totals(&self) -> Totals {
        self.totals
    }
}
