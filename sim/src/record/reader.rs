//! Reading a recording, event by event.

use std::io::Read;

use super::chunk::{ChunkReader, Kind};
use super::event::{Event, Order, Totals, decode};
use super::flaw::{Flaw, Place, ReadError};
use super::header::Header;
use super::journal::FRAMES;
use super::wire::{Decoder, Malformed};

/// A recording, as its events in their order.
///
/// A recording is not trusted: lengths are held against limits before memory is taken, and no more of it
/// is held than a chunk. After an error there are no more events; those before it are as they were
/// recorded, as far as [`Reader::frames`] goes.
pub struct Reader<R> {
    chunks: ChunkReader<R>,
    header: Header,
    /// The chunk's content, and how much of it was read.
    payload: Vec<u8>,
    place: usize,
    /// The frames that the chunk goes up to.
    frames: u64,
    order: Order,
    totals: Totals,
    /// Whether the end was read, or nothing can be read any more.
    is_over: bool,
}

impl<R: Read> Reader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// It is no recording, or of another version, or its header is damaged.
    pub fn new(read: R) -> Result<Self, ReadError> {
        let mut chunks = ChunkReader::new(read);
        let mut payload = Vec::new();
        let read = |chunks: &mut ChunkReader<R>, payload: &mut Vec<u8>| {
            chunks.start()?;
            expect(chunks.next(payload)?, &[Kind::Header], "the header (72)")?;
            Ok(Header::decode(Decoder(payload))?)
        };
        let header = read(&mut chunks, &mut payload).map_err(|flaw| {
            let place = Place { chunk: chunks.chunk, offset: chunks.offset, frames: 0 };
            ReadError { place, flaw }
        })?;
        chunks.accept();
        payload.clear();
        let (order, totals) = (Order::default(), Totals::default());
        Ok(Self { chunks, header, payload, place: 0, frames: 0, order, totals, is_over: false })
    }

    /// What it is a recording of.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The frames that are whole in what was read: all that came from outside for them is known.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.order.frames()
    }

    /// The frame before which all messages were read.
    pub(super) fn known(&self) -> u64 {
        self.order.known()
    }

    /// How much was read.
    #[must_use]
    pub fn totals(&self) -> Totals {
        Totals { frames: self.frames(), ..self.totals }
    }

    fn read(&mut self) -> Result<Option<Event>, Flaw> {
        loop {
            if self.place < self.payload.len() {
                return self.event().map(Some);
            }
            if !self.payload.is_empty() {
                self.order.close(self.frames)?;
                self.chunks.accept();
            }
            let kind = self.chunks.next(&mut self.payload)?;
            if expect(kind, &[Kind::Events, Kind::End], "events (69) and the end (90)")?
                == Kind::End
            {
                return self.end().map(|()| None);
            }
            let first = self.payload.first_chunk::<FRAMES>().ok_or(Malformed::Ended)?;
            self.frames = u64::from_le_bytes(*first);
            self.place = FRAMES;
        }
    }

    fn event(&mut self) -> Result<Event, Flaw> {
        let mut rest = Decoder(&self.payload[self.place..]);
        let event = decode(&mut rest, &self.order)?;
        let place = self.payload.len() - rest.0.len();
        match &event {
            Event::Letter { due, .. } => {
                self.order.letter(*due)?;
                self.totals.letters += 1;
            }
            Event::Stop { frame, stop } => {
                self.order.stop(*frame, stop, place - self.place)?;
                self.totals.stop(stop);
            }
        }
        self.place = place;
        Ok(event)
    }

    fn end(&mut self) -> Result<(), Flaw> {
        let told = Totals::decode(Decoder(&self.payload))?;
        let found = self.totals();
        if told != found {
            return Err(Flaw::Totals { told: Box::new(told), found: Box::new(found) });
        }
        self.order.end()?;
        self.chunks.finish()
    }
}

impl<R: Read> Iterator for Reader<R> {
    type Item = Result<Event, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            return None;
        }
        let read = self.read();
        self.is_over = !matches!(read, Ok(Some(_)));
        let place =
            Place { chunk: self.chunks.chunk, offset: self.chunks.offset, frames: self.frames() };
        read.map_err(|flaw| ReadError { place, flaw }).transpose()
    }
}

fn expect(found: u8, among: &[Kind], expected: &'static str) -> Result<Kind, Flaw> {
    let known = among.iter().find(|&&kind| kind as u8 == found);
    known.copied().ok_or(Flaw::Kind { found, expected })
}
