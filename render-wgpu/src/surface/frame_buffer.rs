//! All that is sent to the device for a frame, in one buffer.

use wgpu::{
    BindGroup, Buffer, BufferDescriptor, BufferSize, BufferUsages, CommandEncoder, Device, Queue,
    QueueWriteBufferView,
};

use super::layouts::Layouts;
use crate::error::GraphicsError;

/// Room for the frame's numbers at the beginning, in words; usually 128, a multiple of all alignments.
pub(crate) const GLOBALS: usize = 128;
/// The least size of the buffer, in words.
const LEAST: usize = 16_384;
/// The bytes of a word.
const WORD: usize = size_of::<f32>();

/// The frame's numbers, the bodies' positions and their instances, as words of four bytes.
///
/// They are written to where the device takes them from, without a copy in between, as far as there is room:
/// as many words as the last frame had. Frames differ little.
pub(super) struct FrameBuffer {
    direct: Option<QueueWriteBufferView>,
    /// The words in it.
    filled: usize,
    /// The words that come after them.
    rest: Vec<f32>,
    /// The words of the last frame.
    expected: usize,
    pub(super) buffer: Buffer,
    /// All of it as a list.
    pub(super) list: BindGroup,
}

impl FrameBuffer {
    pub(super) fn new(device: &Device, layouts: &Layouts) -> Self {
        let buffer = new_buffer(device, WORD * LEAST);
        let list = layouts.list(device, &buffer);
        Self { direct: None, filled: GLOBALS, rest: Vec::new(), expected: GLOBALS, buffer, list }
    }

    /// A frame begins.
    pub(super) fn begin(&mut self, queue: &Queue) {
        let room = ((WORD * self.expected) as u64).min(self.buffer.size());
        let room = BufferSize::new(room);
        self.direct = room.and_then(|room| queue.write_buffer_with(&self.buffer, 0, room));
        self.filled = GLOBALS;
        self.rest.clear();
    }

    /// The number of words so far.
    pub(super) fn len(&self) -> usize {
        self.filled + self.rest.len()
    }

    pub(super) fn extend(&mut self, words: &[f32]) {
        let bytes: &[u8] = bytemuck::cast_slice(words);
        let begin = WORD * self.filled;
        let end = begin + bytes.len();
        match &mut self.direct {
            Some(direct) if self.rest.is_empty() && end <= direct.len() => {
                direct.slice(begin..end).copy_from_slice(bytes);
                self.filled += words.len();
            }
            _ => self.rest.extend_from_slice(words),
        }
    }

    /// Sends everything, beginning with `numbers`; says whether the buffer is a new one.
    pub(super) fn upload(
        &mut self,
        (device, queue): (&Device, &Queue),
        encoder: &mut CommandEncoder,
        layouts: &Layouts,
        numbers: &[f32],
    ) -> Result<bool, GraphicsError> {
        let Some(mut direct) = self.direct.take() else {
            return Err(GraphicsError::Lost { reason: "it takes no data".to_owned() });
        };
        direct.slice(..WORD * numbers.len()).copy_from_slice(bytemuck::cast_slice(numbers));
        // What was written is sent.
        drop(direct);
        self.expected = self.len();
        let (sent, needed) = ((WORD * self.filled) as u64, (WORD * self.expected) as u64);
        let grows = needed > self.buffer.size();
        if grows {
            let limits = device.limits();
            let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
            if needed > most {
                return Err(GraphicsError::Frame { needed, most });
            }
            let larger = new_buffer(device, needed.next_power_of_two().min(most) as usize);
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &larger, 0, sent);
            self.list = layouts.list(device, &larger);
            self.buffer = larger;
        }
        if !self.rest.is_empty() {
            queue.write_buffer(&self.buffer, sent, bytemuck::cast_slice(&self.rest));
        }
        Ok(grows)
    }
}

fn new_buffer(device: &Device, size: usize) -> Buffer {
    let used = BufferUsages::UNIFORM | BufferUsages::STORAGE | BufferUsages::VERTEX;
    device.create_buffer(&BufferDescriptor {
        label: Some("frame"),
        size: size as u64,
        usage: used | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}
