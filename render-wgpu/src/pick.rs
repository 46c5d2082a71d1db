//! Which object and node is under a pixel.

use std::sync::mpsc::Sender;

use bytemuck::{Pod, Zeroable};
use dualframe_sim::object::ObjectId;
use glam::{Mat4, Vec2, Vec3};
use wgpu::{
    BindGroup, Buffer, BufferDescriptor, BufferUsages, ColorTargetState, CommandEncoder, Device,
    Extent3d, FragmentState, LoadOp, MultisampleState, Operations, PipelineLayoutDescriptor,
    PrimitiveState, RenderPassColorAttachment, RenderPassDepthStencilAttachment,
    RenderPassDescriptor, RenderPipeline, RenderPipelineDescriptor, ShaderModuleDescriptor,
    ShaderSource, StoreOp, TexelCopyBufferInfo, TexelCopyBufferLayout, Texture, TextureFormat,
    TextureUsages, TextureView, VertexState,
};

use crate::auxiliary::{Context, GpuUnit};
use crate::error::GraphicsError;
use crate::globals::{self, Globals};
use crate::surface::{INSTANCES, Layouts};
use crate::target::{DEPTH, texture};

/// The object's number plus one, the node's number, and the depth.
const FORMAT: TextureFormat = TextureFormat::Rgba32Uint;

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// The object.
    pub object: ObjectId,
    /// A corner of the triangle there, by the node's number; of a shape that is not deformed, by its own.
    pub node: u32,
    /// The place, in metres.
    pub place: Vec3,
}

/// Asks what is under a pixel of the next frame. Only surfaces are found: volumes and what is drawn by its
/// edges are not there for it.
pub struct Pick {
    point: Vec2,
    answer: Sender<Option<Picked>>,
    /// Of the frame that was asked, once it is known: the next one may be seen from elsewhere.
    view_projection: Mat4,
}

impl Pick {
    /// `point` is the pixel's middle, from (−1, −1) at the lower left of the picture to (1, 1). The answer goes
    /// to `answer`: `None` if there is no object. Without an answer the device failed.
    #[must_use]
    pub fn new(point: Vec2, answer: Sender<Option<Picked>>) -> Self {
        Self { point, answer, view_projection: Mat4::IDENTITY }
    }
}

impl GpuUnit for Pick {
    fn needs_frame(&self) -> bool {
        true
    }

    fn encode(&mut self, context: &Context<'_>, encoder: &mut CommandEncoder) -> Option<Buffer> {
        self.view_projection = context.view.view_projection;
        Some(context.picker.encode(context, self.point, encoder))
    }

    fn finish(self: Box<Self>, _context: &Context<'_>, results: Result<&[u8], GraphicsError>) {
        let hit = results.ok().and_then(|bytes| bytes.get(..size_of::<Hit>()));
        let Some(hit) = hit.map(bytemuck::pod_read_unaligned::<Hit>) else { return };
        // Whoever asked may have gone.
        let _ = self.answer.send(hit.resolve(self.point, &self.view_projection));
    }
}

/// What the device finds under a pixel.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Hit {
    object_plus_one: u32,
    node: u32,
    depth: u32,
    unused: u32,
}

impl Hit {
    fn resolve(self, point: Vec2, view_projection: &Mat4) -> Option<Picked> {
        let object = self.object_plus_one.checked_sub(1)?;
        let clip = point.extend(f32::from_bits(self.depth));
        let place = view_projection.inverse().project_point3(clip);
        Some(Picked { object: ObjectId(object), node: self.node, place })
    }
}

/// Draws one pixel with the numbers of objects for colours.
pub(crate) struct Picker {
    pipeline: RenderPipeline,
    numbers: Buffer,
    globals: BindGroup,
    hit: Texture,
    hit_view: TextureView,
    depth: TextureView,
}

impl Picker {
    pub(crate) fn new(device: &Device, layouts: &Layouts) -> Self {
        let numbers = device.create_buffer(&BufferDescriptor {
            label: Some("picking"),
            size: Globals::SIZE,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let globals = globals::plain(device, layouts, &numbers);
        let pixel = |format, usage| texture(device, "picking", format, (1, 1), 1, usage);
        let hit = pixel(FORMAT, TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC);
        let depth = pixel(DEPTH.format, TextureUsages::RENDER_ATTACHMENT);
        Self {
            pipeline: pipeline(device, layouts),
            numbers,
            globals,
            hit_view: hit.create_view(&Default::default()),
            hit,
            depth: depth.create_view(&Default::default()),
        }
    }

    fn encode(&self, context: &Context<'_>, point: Vec2, encoder: &mut CommandEncoder) -> Buffer {
        // The pixel is all of the picture.
        let (width, height) = context.size;
        let scale = Vec2::new(width as f32, height as f32).extend(1.0);
        let crop = Mat4::from_scale(scale) * Mat4::from_translation(-point.extend(0.0));
        let view = context.view.seen_by(crop * context.view.view_projection);
        let numbers = view.numbers();
        // One for each: the queue's writes are all done before the first of several picks.
        let sent = context.gpu.device.create_buffer(&BufferDescriptor {
            label: Some("picking"),
            size: Globals::SIZE,
            usage: BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let bytes = bytemuck::cast_slice(numbers.as_words());
        context.gpu.queue.write_buffer(&sent, 0, bytes);
        encoder.copy_buffer_to_buffer(&sent, 0, &self.numbers, 0, Globals::SIZE);
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("picking"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &self.hit_view,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Clear(Default::default()), store: StoreOp::Store },
            })],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        context.surfaces.paint_with(&mut pass, &self.pipeline, &self.globals);
        drop(pass);
        let results = context.gpu.device.create_buffer(&BufferDescriptor {
            label: Some("picked"),
            size: size_of::<Hit>() as u64,
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            self.hit.as_image_copy(),
            TexelCopyBufferInfo { buffer: &results, layout: TexelCopyBufferLayout::default() },
            Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        );
        results
    }
}

fn pipeline(device: &Device, layouts: &Layouts) -> RenderPipeline {
    let shader = device.create_shader_module(ShaderModuleDescriptor {
        label: Some("picking"),
        source: ShaderSource::Wgsl(
            concat!(
                include_str!("shaders/common.wgsl"),
                include_str!("shaders/surface.wgsl"),
                include_str!("shaders/pick.wgsl")
            )
            .into(),
        ),
    });
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("picking"),
        bind_group_layouts: &[Some(&layouts.globals), Some(&layouts.list)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("picking"),
        layout: Some(&layout),
        vertex: VertexState {
            module: &shader,
            entry_point: Some("pick_vertex"),
            compilation_options: Default::default(),
            buffers: &[Some(INSTANCES)],
        },
        primitive: PrimitiveState::default(),
        depth_stencil: Some(DEPTH),
        multisample: MultisampleState::default(),
        fragment: Some(FragmentState {
            module: &shader,
            entry_point: Some("pick_fragment"),
            compilation_options: Default::default(),
            targets: &[Some(ColorTargetState::from(FORMAT))],
        }),
        multiview_mask: None,
        cache: None,
    })
}
