//! What shaders are given: the layouts of bind groups, and bind groups of them.

use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindGroupLayout, BindGroupLayoutDescriptor,
    BindGroupLayoutEntry, BindingType, Buffer, BufferBindingType, Device, SamplerBindingType,
    ShaderStages, TextureSampleType, TextureViewDimension,
};

/// The layouts that surfaces, room and shadows share.
pub(crate) struct Layouts {
    /// The frame's numbers.
    pub(crate) globals: BindGroupLayout,
    /// The frame's numbers and its shadow map.
    pub(crate) lit: BindGroupLayout,
    /// One list that vertex shaders read.
    pub(crate) list: BindGroupLayout,
}

impl Layouts {
    pub(crate) fn new(device: &Device) -> Self {
        let globals = buffer(0, ShaderStages::VERTEX_FRAGMENT, BufferBindingType::Uniform);
        let map = BindGroupLayoutEntry {
            binding: 1,
            visibility: ShaderStages::FRAGMENT,
            ty: BindingType::Texture {
                sample_type: TextureSampleType::Depth,
                view_dimension: TextureViewDimension::D2,
                multisampled: false,
            },
            count: None,
        };
        let sampler = BindGroupLayoutEntry {
            binding: 2,
            visibility: ShaderStages::FRAGMENT,
            ty: BindingType::Sampler(SamplerBindingType::Comparison),
            count: None,
        };
        let read_only = BufferBindingType::Storage { read_only: true };
        let list = buffer(0, ShaderStages::VERTEX, read_only);
        let layout = |label, entries: &[BindGroupLayoutEntry]| {
            let descriptor = BindGroupLayoutDescriptor { label: Some(label), entries };
            device.create_bind_group_layout(&descriptor)
        };
        Self {
            globals: layout("globals", &[globals]),
            lit: layout("lit", &[globals, map, sampler]),
            list: layout("list", &[list]),
        }
    }

    /// A list as a bind group.
    pub(crate) fn list(&self, device: &Device, buffer: &Buffer) -> BindGroup {
        device.create_bind_group(&BindGroupDescriptor {
            label: Some("list"),
            layout: &self.list,
            entries: &[BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        })
    }
}

fn buffer(binding: u32, visibility: ShaderStages, ty: BufferBindingType) -> BindGroupLayoutEntry {
    let ty = BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    BindGroupLayoutEntry { binding, visibility, ty, count: None }
}
