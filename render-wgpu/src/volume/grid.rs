//! What the device holds of a volume.

use bytemuck::{Pod, Zeroable};
use dualframe_sim::geometry::{BRICK_SIDE, BRICK_VOXELS, Brick, Volume};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, BufferDescriptor,
    BufferUsages, Device, Extent3d, Origin3d, Queue, TexelCopyBufferLayout, Texture,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
};

use super::cells::{CELL, Cells};
use super::pipelines::Pipelines;
use crate::error::GraphicsError;

/// One number of 255 a voxel, which shaders read as 0 to 1 and interpolate.
const FORMAT: TextureFormat = TextureFormat::R8Unorm;

/// What shaders read; the layout of `Grid` in `volume.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Numbers {
    rotation: [f32; 4],
    place: [f32; 3],
    step: f32,
    spacing: [f32; 3],
    cell: f32,
    color: [f32; 4],
}

/// What the device holds of a volume.
pub(super) struct Grid {
    dims: [u32; 3],
    /// The revision of the volume that the device has; 0 for none.
    revision: u64,
    /// That of each of its bricks; 0 for none, which is empty.
    bricks: Vec<u64>,
    densities: Texture,
    /// The greatest density in each cell.
    peaks: Texture,
    cells: Cells,
    /// A row of bricks in rows of voxels.
    staged: Vec<u8>,
    numbers: Buffer,
    pub(super) bound: BindGroup,
    /// The frame in which it was drawn last.
    pub(super) used: u64,
}

impl Grid {
    pub(super) fn new(
        device: &Device,
        pipelines: &Pipelines,
        volume: &Volume,
    ) -> Result<Self, GraphicsError> {
        let (dims, most) = (volume.dims(), device.limits().max_texture_dimension_3d);
        if dims.iter().any(|&dim| dim > most) {
            return Err(GraphicsError::Volume { dims, most });
        }
        let cells = Cells::new(dims);
        let densities = texture(device, "densities", dims);
        let peaks = texture(device, "peaks", cells.counts);
        let numbers = device.create_buffer(&BufferDescriptor {
            label: Some("volume"),
            size: size_of::<Numbers>() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let views = [&densities, &peaks].map(|texture| texture.create_view(&Default::default()));
        let bound = device.create_bind_group(&BindGroupDescriptor {
            label: Some("volume"),
            layout: &pipelines.layout,
            entries: &[
                BindGroupEntry { binding: 0, resource: numbers.as_entire_binding() },
                BindGroupEntry { binding: 1, resource: BindingResource::TextureView(&views[0]) },
                BindGroupEntry { binding: 2, resource: BindingResource::TextureView(&views[1]) },
                BindGroupEntry {
                    binding: 3,
                    resource: BindingResource::Sampler(&pipelines.sampler),
                },
            ],
        });
        let counts = volume.brick_counts().map(|count| count as usize);
        let staged = vec![0; counts[0] * BRICK_VOXELS];
        let bricks = vec![0; counts.iter().product()];
        let (revision, used) = (0, 0);
        Ok(Self { dims, revision, bricks, densities, peaks, cells, staged, numbers, bound, used })
    }

    /// Whether a volume is of its size.
    pub(super) fn fits(&self, volume: &Volume) -> bool {
        self.dims == volume.dims()
    }

    /// Sends what differs of a volume that fits from what the device has.
    pub(super) fn upload(&mut self, queue: &Queue, volume: &Volume, color: [f32; 4], step: f32) {
        let numbers = Numbers {
            rotation: volume.pose.rotation.to_array(),
            place: volume.pose.translation.to_array(),
            step,
            spacing: volume.spacing().to_array(),
            cell: CELL as f32,
            color,
        };
        queue.write_buffer(&self.numbers, 0, bytemuck::bytes_of(&numbers));
        if self.revision == volume.revision() {
            return;
        }
        let mut held = std::mem::take(&mut self.bricks);
        let news = volume.bricks().zip(&mut held).filter_map(|(brick, held)| {
            let before = std::mem::replace(held, brick.revision);
            // What the device has of nothing is empty already.
            let is_there = before == brick.revision || before == 0 && brick.is_empty();
            (!is_there).then_some(brick)
        });
        let mut bricks = news.peekable();
        let mut begin = None;
        while let Some(brick) = bricks.next() {
            self.stage(&brick);
            self.cells.take(&brick);
            // Bricks in a row are sent by one call: each is a buffer of the device's own.
            let first = *begin.get_or_insert(brick.first());
            let [x, y, z] = brick.place();
            if bricks.peek().is_none_or(|next| next.place() != [x + 1, y, z]) {
                self.send_row(queue, first, brick);
                begin = None;
            }
        }
        drop(bricks);
        self.bricks = held;
        self.cells.refresh();
        self.send_peaks(queue);
        self.revision = volume.revision();
    }

    /// Puts a brick into its place in a row of bricks.
    fn stage(&mut self, brick: &Brick<'_>) {
        let wide = self.dims[0].div_ceil(BRICK_SIDE) as usize;
        let (rows, _) = self.staged.as_chunks_mut::<{ BRICK_SIDE as usize }>();
        let (from, _) = brick.densities.as_chunks::<{ BRICK_SIDE as usize }>();
        for (to, from) in rows.iter_mut().skip(brick.place()[0] as usize).step_by(wide).zip(from) {
            *to = *from;
        }
    }

    /// Sends the bricks from that of the voxel `first` to `last`.
    fn send_row(&self, queue: &Queue, first: [u32; 3], last: Brick<'_>) {
        let [x, y, z] = first;
        let [wide, height, depth] = last.size();
        let width = last.first()[0] + wide - x;
        let layout = TexelCopyBufferLayout {
            offset: u64::from(x),
            bytes_per_row: Some(self.dims[0].next_multiple_of(BRICK_SIDE)),
            rows_per_image: Some(BRICK_SIDE),
        };
        let mut to = self.densities.as_image_copy();
        to.origin = Origin3d { x, y, z };
        queue.write_texture(to, &self.staged, layout, extent([width, height, depth]));
    }

    fn send_peaks(&self, queue: &Queue) {
        let Cells { counts, peaks, .. } = &self.cells;
        let layout = TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(counts[0]),
            rows_per_image: Some(counts[1]),
        };
        queue.write_texture(self.peaks.as_image_copy(), peaks, layout, extent(*counts));
    }
}

fn texture(device: &Device, label: &str, dims: [u32; 3]) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: extent(dims),
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format: FORMAT,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

fn extent([width, height, depth_or_array_layers]: [u32; 3]) -> Extent3d {
    Extent3d { width, height, depth_or_array_layers }
}
