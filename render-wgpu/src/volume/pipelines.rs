//! The pipelines of volumes and their shadows.

use wgpu::{
    BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType,
    BufferBindingType, ColorTargetState, CompareFunction, DepthStencilState, Device, Face,
    FilterMode, FragmentState, MultisampleState, PipelineLayoutDescriptor, PrimitiveState,
    RenderPipeline, RenderPipelineDescriptor, Sampler, SamplerBindingType, SamplerDescriptor,
    ShaderModule, ShaderModuleDescriptor, ShaderSource, ShaderStages, TextureSampleType,
    TextureViewDimension, VertexState,
};

use crate::surface::{Layouts, SHADOW};
use crate::target::{DEPTH, Format};

/// The sides of the box that are turned away from the viewer: they are counter-clockwise from inside.
const FAR_SIDES: PrimitiveState = PrimitiveState {
    topology: wgpu::PrimitiveTopology::TriangleList,
    strip_index_format: None,
    front_face: wgpu::FrontFace::Ccw,
    cull_mode: Some(Face::Back),
    unclipped_depth: false,
    polygon_mode: wgpu::PolygonMode::Fill,
    conservative: false,
};

/// The pipelines of volumes and their shadows, and what is bound to them.
pub(super) struct Pipelines {
    pub(super) volumes: RenderPipeline,
    pub(super) shadows: RenderPipeline,
    /// Of a volume's numbers and textures.
    pub(super) layout: BindGroupLayout,
    /// Densities are interpolated, and outside as at the nearest side.
    pub(super) sampler: Sampler,
}

impl Pipelines {
    pub(super) fn new(device: &Device, layouts: &Layouts, format: Format) -> Self {
        let shader = device.create_shader_module(ShaderModuleDescriptor {
            label: Some("volume"),
            source: ShaderSource::Wgsl(
                concat!(
                    include_str!("../shaders/common.wgsl"),
                    include_str!("../shaders/volume.wgsl")
                )
                .into(),
            ),
        });
        let layout = volume_layout(device);
        let sampler = device.create_sampler(&SamplerDescriptor {
            label: Some("densities"),
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            ..Default::default()
        });
        Self {
            volumes: volumes(device, [&layouts.lit, &layout], &shader, format),
            shadows: shadows(device, [&layouts.globals, &layout], &shader),
            layout,
            sampler,
        }
    }
}

fn volume_layout(device: &Device) -> BindGroupLayout {
    let entry =
        |binding, visibility, ty| BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let numbers = BindingType::Buffer {
        ty: BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let texture = BindingType::Texture {
        sample_type: TextureSampleType::Float { filterable: true },
        view_dimension: TextureViewDimension::D3,
        multisampled: false,
    };
    let sampler = BindingType::Sampler(SamplerBindingType::Filtering);
    device.create_bind_group_layout(&BindGroupLayoutDescriptor {
        label: Some("volume"),
        entries: &[
            entry(0, ShaderStages::VERTEX_FRAGMENT, numbers),
            entry(1, ShaderStages::VERTEX_FRAGMENT, texture),
            entry(2, ShaderStages::FRAGMENT, texture),
            entry(3, ShaderStages::FRAGMENT, sampler),
        ],
    })
}

fn volumes(
    device: &Device,
    groups: [&BindGroupLayout; 2],
    shader: &ShaderModule,
    format: Format,
) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("volumes"),
        bind_group_layouts: &groups.map(Some),
        immediate_size: 0,
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("volumes"),
        layout: Some(&layout),
        vertex: VertexState {
            module: shader,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: FAR_SIDES,
        depth_stencil: Some(DEPTH),
        multisample: MultisampleState { count: format.samples, ..Default::default() },
        fragment: Some(FragmentState {
            module: shader,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(ColorTargetState::from(format.color))],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn shadows(
    device: &Device,
    groups: [&BindGroupLayout; 2],
    shader: &ShaderModule,
) -> RenderPipeline {
    let layout = device.create_pipeline_layout(&PipelineLayoutDescriptor {
        label: Some("shadows of volumes"),
        bind_group_layouts: &groups.map(Some),
        immediate_size: 0,
    });
    device.create_render_pipeline(&RenderPipelineDescriptor {
        label: Some("shadows of volumes"),
        layout: Some(&layout),
        vertex: VertexState {
            module: shader,
            entry_point: Some("caster_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: FAR_SIDES,
        depth_stencil: Some(DepthStencilState {
            format: SHADOW,
            depth_write_enabled: Some(true),
            depth_compare: Some(CompareFunction::Less),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: MultisampleState::default(),
        fragment: Some(FragmentState {
            module: shader,
            entry_point: Some("caster"),
            compilation_options: Default::default(),
            targets: &[],
        }),
        multiview_mask: None,
        cache: None,
    })
}
