//! The pipelines of surfaces and their shadows.

use wgpu::{
    ColorTargetState, CompareFunction, DepthBiasState, DepthStencilState, Device, Face,
    FragmentState, MultisampleState, PipelineLayoutDescriptor, PrimitiveState, PrimitiveTopology,
    RenderPipeline, RenderPipelineDescriptor, ShaderModule, ShaderModuleDescriptor, ShaderSource,
    TextureFormat, VertexAttribute, VertexBufferLayout, VertexState, VertexStepMode,
    vertex_attr_array,
};

use super::layouts::Layouts;
use super::make::Instance;
use crate::target::{DEPTH, Format};

/// The format of the shadow map.
pub(crate) const SHADOW: TextureFormat = TextureFormat::Depth32Float;

const ATTRIBUTES: [VertexAttribute; 7] = vertex_attr_array![
    0 => Float32x4, 1 => Float32x3, 2 => Uint32, 3 => Float32x4, 4 => Uint32, 5 => Uint32, 6 => Float32x3
];

/// One list of bodies.
pub(crate) const INSTANCES: VertexBufferLayout<'static> = VertexBufferLayout {
    array_stride: size_of::<Instance>() as u64,
    step_mode: VertexStepMode::Instance,
    attributes: &ATTRIBUTES,
};

/// The pipelines of surfaces and their shadows.
pub(super) struct Pipelines {
    /// Of closed surfaces, whose inside is never seen.
    pub(super) closed: RenderPipeline,
    /// Of surfaces whose inside may be seen.
    pub(super) open: RenderPipeline,
    pub(super) edges: RenderPipeline,
    pub(super) shadows: RenderPipeline,
}

impl Pipelines {
    pub(super) fn new(device: &Device, layouts: &Layouts, format: Format) -> Self {
        let shader = device.create_shader_module(ShaderModuleDescriptor {
            label: Some("surface"),
            source: ShaderSource::Wgsl(
                concat!(
                    include_str!("../shaders/common.wgsl"),
                    include_str!("../shaders/surface.wgsl")
                )
                .into(),
            ),
        });
        let triangles = |cull_mode| PrimitiveState { cull_mode, ..PrimitiveState::default() };
        let lines =
            PrimitiveState { topology: PrimitiveTopology::LineList, ..PrimitiveState::default() };
        let drawn = |label, primitive, entry| {
            drawn(device, layouts, &shader, format, Shape { label, primitive, entry })
        };
        Self {
            closed: drawn("closed surfaces", triangles(Some(Face::Back)), "fragment"),
            open: drawn("open surfaces", triangles(None), "fragment"),
            edges: drawn("edges", lines, "edge"),
            shadows: shadows(device, layouts, &shader),
        }
    }
}

struct Shape<'a> {
    label: &'a str,
    primitive: PrimitiveState,
    entry: &'a str,
}

fn drawn(
    device: &Device,
    layouts: &Layouts,
    shader: &ShaderModule,
    format: Format,
    shape: Shape<'_>,
) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some(shape.label),
        bind_group_layouts: &[Some(&layouts.lit), Some(&layouts.list), Some(&layouts.list)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some(shape.label),
        layout: Some(&layout),
        vertex: VertexState {
            module: shader,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[Some(INSTANCES)],
        },
        primitive: shape.primitive,
        depth_stencil: Some(DEPTH),
        multisample: MultisampleState { count: format.samples, ..Default::default() },
        fragment: Some(FragmentState {
            module: shader,
            entry_point: Some(shape.entry),
            compilation_options: Default::default(),
            targets: &[Some(ColorTargetState::from(format.color))],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn shadows(device: &Device, layouts: &Layouts, shader: &ShaderModule) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("shadows"),
        bind_group_layouts: &[Some(&layouts.globals), Some(&layouts.list)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("shadows"),
        layout: Some(&layout),
        vertex: VertexState {
            module: shader,
            entry_point: Some("caster"),
            compilation_options: Default::default(),
            buffers: &[Some(INSTANCES)],
        },
        primitive: PrimitiveState::default(),
        depth_stencil: Some(DepthStencilState {
            format: SHADOW,
            depth_write_enabled: Some(true),
            depth_compare: Some(CompareFunction::Less),
            stencil: Default::default(),
            // Slanted surfaces are pushed back, so that they do not shade themselves.
            bias: DepthBiasState { constant: 2, slope_scale: 2.0, clamp: 0.0 },
        }),
        multisample: MultisampleState::default(),
        fragment: None,
        multiview_mask: None,
        cache: None,
    })
}
