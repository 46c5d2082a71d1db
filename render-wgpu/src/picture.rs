//! A finished picture, and how it comes from the device.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use wgpu::{
    Buffer, BufferDescriptor, BufferUsages, COPY_BYTES_PER_ROW_ALIGNMENT, Extent3d, MapMode,
    PollType, TexelCopyBufferInfo, TexelCopyBufferLayout, Texture, TextureFormat,
};

use crate::error::GraphicsError;
use crate::gpu::Gpu;

/// Bytes of a pixel.
const PIXEL: u32 = 4;

/// A picture, row by row from the top, four bytes a pixel: red, green, blue (sRGB) and opacity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Its width, in pixels.
    pub width: u32,
    /// Its height, in pixels.
    pub height: u32,
    /// Its pixels.
    pub pixels: Vec<u8>,
}

impl Picture {
    /// Writes it as PNG.
    ///
    /// # Errors
    /// What the writer says.
    pub fn write_png(&self, writer: impl Write) -> io::Result<()> {
        let mut encoder = png::Encoder::new(writer, self.width, self.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.pixels)?;
        Ok(writer.finish()?)
    }

    /// Writes it to a file, as PNG.
    ///
    /// # Errors
    /// What the file system says.
    pub fn save(&self, path: &Path) -> io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        self.write_png(&mut file)?;
        file.flush()
    }
}

/// Reads a texture of one of the formats Rgba8 and Bgra8, linear or sRGB, that can be copied from, after
/// everything submitted so far.
///
/// # Errors
/// The device failed.
pub fn read_texture(gpu: &Gpu, texture: &Texture) -> Result<Picture, GraphicsError> {
    let Gpu { device, queue, .. } = gpu;
    let (width, height) = (texture.width(), texture.height());
    let stride = (width * PIXEL).next_multiple_of(COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("picture"),
        size: u64::from(stride) * u64::from(height),
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(stride),
        rows_per_image: Some(height),
    };
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        TexelCopyBufferInfo { buffer: &buffer, layout },
        Extent3d { width, height, depth_or_array_layers: 1 },
    );
    queue.submit([encoder.finish()]);
    let bytes = read_buffer(gpu, &buffer).map_err(|error| gpu.failure().unwrap_or(error))?;
    let rows = bytes.chunks(stride as usize);
    let mut pixels: Vec<u8> =
        rows.flat_map(|padded| &padded[..(width * PIXEL) as usize]).copied().collect();
    if matches!(texture.format(), TextureFormat::Bgra8Unorm | TextureFormat::Bgra8UnormSrgb) {
        pixels.chunks_exact_mut(PIXEL as usize).for_each(|pixel| pixel.swap(0, 2));
    }
    Ok(Picture { width, height, pixels })
}

/// Waits for what was submitted, and reads a buffer.
fn read_buffer(gpu: &Gpu, buffer: &Buffer) -> Result<Vec<u8>, GraphicsError> {
    let lost = |reason: String| GraphicsError::Lost { reason };
    let (told, told_out) = std::sync::mpsc::channel();
    buffer.map_async(MapMode::Read, .., move |mapped| {
        // Nobody listens any more only if this function has failed.
        let _ = told.send(mapped);
    });
    gpu.poll(PollType::wait_indefinitely())?;
    match told_out.try_recv() {
        Ok(Ok(())) => {
            let bytes = match buffer.get_mapped_range(..) {
                Ok(mapped) => mapped.to_vec(),
                Err(error) => return Err(lost(error.to_string())),
            };
            buffer.unmap();
            Ok(bytes)
        }
        Ok(Err(error)) => Err(lost(error.to_string())),
        Err(_) => Err(lost("it gave no answer".to_owned())),
    }
}
