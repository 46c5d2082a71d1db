//! All that is sent to the device for a frame, in one buffer and by one call.

use wgpu::{BindGroup, Buffer, BufferDescriptor, BufferUsages, Device, Queue};

use super::layouts::Layouts;
use crate::error::GraphicsError;

/// Room for the frame's numbers at the beginning, in words; usually 128, a multiple of all alignments.
pub(crate) const GLOBALS: usize = 128;
/// The least size of the buffer, in words.
const LEAST: usize = 16_384;

/// The frame's numbers, the bodies' positions and their instances, as words of four bytes.
pub(super) struct FrameBuffer {
    pub(super) words: Vec<f32>,
    pub(super) buffer: Buffer,
    /// All of it as a list.
    pub(super) list: BindGroup,
}

impl FrameBuffer {
    pub(super) fn new(device: &Device, layouts: &Layouts) -> Self {
        let buffer = new_buffer(device, size_of::<f32>() * LEAST);
        Self { words: vec![0.0; GLOBALS], list: layouts.list(device, &buffer), buffer }
    }

    pub(super) fn clear(&mut self) {
        self.words.truncate(GLOBALS);
    }

    /// Sends everything, beginning with `numbers`; says whether the buffer is a new one.
    pub(super) fn upload(
        &mut self,
        (device, queue): (&Device, &Queue),
        layouts: &Layouts,
        numbers: &[f32],
    ) -> Result<bool, GraphicsError> {
        self.words[..numbers.len()].copy_from_slice(numbers);
        let bytes: &[u8] = bytemuck::cast_slice(&self.words);
        let needed = bytes.len() as u64;
        let grows = needed > self.buffer.size();
        if grows {
            let limits = device.limits();
            let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
            if needed > most {
                return Err(GraphicsError::Frame { needed, most });
            }
            self.buffer = new_buffer(device, bytes.len().next_power_of_two().min(most as usize));
            self.list = layouts.list(device, &self.buffer);
        }
        queue.write_buffer(&self.buffer, 0, bytes);
        Ok(grows)
    }
}

fn new_buffer(device: &Device, size: usize) -> Buffer {
    let used = BufferUsages::UNIFORM | BufferUsages::STORAGE | BufferUsages::VERTEX;
    device.create_buffer(&BufferDescriptor {
        label: Some("frame"),
        size: size as u64,
        usage: used | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}
