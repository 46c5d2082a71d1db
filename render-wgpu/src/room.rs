//! The room that bodies are in.

use wgpu::{
    BindGroup, ColorTargetState, Device, Face, FragmentState, MultisampleState,
    PipelineLayoutDescriptor, PrimitiveState, RenderPass, RenderPipeline, RenderPipelineDescriptor,
    ShaderModuleDescriptor, ShaderSource, VertexState,
};

use crate::surface::Layouts;
use crate::target::{DEPTH, Format};

/// Two triangles on each of six sides.
const CORNERS: u32 = 36;

/// Draws the sides of a room that face the viewer.
pub(crate) struct Room(RenderPipeline);

impl Room {
    pub(crate) fn new(device: &Device, layouts: &Layouts, format: Format) -> Self {
        let shader = device.create_shader_module(ShaderModuleDescriptor {
            label: Some("room"),
            source: ShaderSource::Wgsl(
                concat!(include_str!("shaders/common.wgsl"), include_str!("shaders/room.wgsl"))
                    .into(),
            ),
        });
        let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
            label: Some("room"),
            bind_group_layouts: &[Some(&layouts.lit)],
            immediate_size: 0,
        });
        Self(device.create_render_pipeline(&RenderPipelineDescriptor {
            label: Some("room"),
            layout: Some(&layout),
            vertex: VertexState {
                module: &shader,
                entry_point: Some("vertex"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: PrimitiveState { cull_mode: Some(Face::Back), ..Default::default() },
            depth_stencil: Some(DEPTH),
            multisample: MultisampleState { count: format.samples, ..Default::default() },
            fragment: Some(FragmentState {
                module: &shader,
                entry_point: Some("fragment"),
                compilation_options: Default::default(),
                targets: &[Some(ColorTargetState::from(format.color))],
            }),
            multiview_mask: None,
            cache: None,
        }))
    }

    pub(crate) fn paint(&self, pass: &mut RenderPass<'_>, lit: &BindGroup) {
        pass.set_pipeline(&self.0);
        pass.set_bind_group(0, lit, &[]);
        pass.draw(0..CORNERS, 0..1);
    }
}
