//! A frame's numbers: camera, light, shadow map.

use std::num::NonZero;

use bytemuck::{Pod, Zeroable};
use dualframe_sim::geometry::Bounds;
use glam::camera::rh::proj::directx::orthographic;
use glam::camera::rh::view::look_to_mat4;
use glam::{Mat4, Vec3};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, BufferBinding,
    CompareFunction, Device, FilterMode, LoadOp, Operations, RenderPassDepthStencilAttachment,
    Sampler, SamplerDescriptor, StoreOp, TextureUsages, TextureView,
};

use crate::camera::{Camera, Frustum};
use crate::look::{Coloring, Look, Quality};
use crate::surface::{GLOBALS, Layouts, SHADOW};
use crate::target::texture;

/// What shaders read; the layout of `Globals` in `common.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Numbers {
    view_projection: [f32; 16],
    light_projection: [f32; 16],
    eye: [f32; 3],
    coloring: u32,
    light: [f32; 3],
    quality: u32,
    room_min: [f32; 3],
    has_room: u32,
    room_max: [f32; 3],
    shadow_texel: f32,
}

/// From where a frame is seen and lit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) camera: Camera,
    pub(crate) look: Look,
    quality: Quality,
    pub(crate) view_projection: Mat4,
    light_projection: Mat4,
    shadow_width: f32,
    frustum: Frustum,
    /// From an object to where its shadow falls at the farthest.
    throw: Vec3,
}

impl Numbers {
    pub(crate) fn as_words(&self) -> &[f32] {
        bytemuck::cast_slice(std::slice::from_ref(self))
    }
}

const _: () = assert!(size_of::<Numbers>() <= GLOBALS * size_of::<f32>());

impl View {
    pub(crate) fn new(camera: Camera, look: Look, quality: Quality, aspect: f32) -> Self {
        let view_projection = camera.view_projection(aspect);
        let (light_projection, shadow_width) = light_projection(&look);
        let size = (look.focus.max - look.focus.min).length();
        Self {
            camera,
            look,
            quality,
            view_projection,
            light_projection,
            shadow_width,
            frustum: Frustum::new(&view_projection),
            throw: toward_light(&look) * -size,
        }
    }

    /// Whether a box or its shadow may be in the picture.
    pub(crate) fn may_see(&self, bounds: &Bounds) -> bool {
        let shadow = Bounds { min: bounds.min + self.throw, max: bounds.max + self.throw };
        self.frustum.may_see(&bounds.union(&shadow))
    }

    /// This frame as another projection sees it.
    pub(crate) fn seen_by(&self, view_projection: Mat4) -> Self {
        Self { view_projection, ..*self }
    }

    /// What shaders read.
    pub(crate) fn numbers(&self) -> Numbers {
        let Look { focus, room, coloring, .. } = self.look;
        Numbers {
            view_projection: self.view_projection.to_cols_array(),
            light_projection: self.light_projection.to_cols_array(),
            eye: self.camera.eye().to_array(),
            coloring: match coloring {
                Coloring::Object => 0,
                Coloring::Strain => 1,
                Coloring::Speed => 2,
            },
            light: toward_light(&self.look).to_array(),
            quality: match self.quality {
                Quality::Fast => 0,
                Quality::Fine => 1,
            },
            room_min: focus.min.to_array(),
            has_room: u32::from(room),
            room_max: focus.max.to_array(),
            shadow_texel: self.shadow_width / self.quality.shadow_size() as f32,
        }
    }
}

fn toward_light(look: &Look) -> Vec3 {
    look.light.try_normalize().unwrap_or(Vec3::Y)
}

/// From places in the world to the shadow map, and the map's width in metres: as narrow as the focus
/// allows.
fn light_projection(look: &Look) -> (Mat4, f32) {
    let Bounds { min, max } = look.focus;
    let light = toward_light(look);
    let up = if light.x.abs() < 0.9 { Vec3::X } else { Vec3::Z };
    let view = look_to_mat4(look.focus.center(), -light, up);
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for corner in 0..8 {
        let at = |axis: usize| if corner >> axis & 1 == 0 { min[axis] } else { max[axis] };
        let seen = view.transform_point3(Vec3::new(at(0), at(1), at(2)));
        (low, high) = (low.min(seen), high.max(seen));
    }
    let projection = orthographic(low.x, high.x, low.y, high.y, -high.z, -low.z);
    (projection * view, (high.x - low.x).max(high.y - low.y))
}

/// The frame's numbers and its shadow map, as shaders are given them.
pub(crate) struct Globals {
    map: TextureView,
    sampler: Sampler,
    /// Without the shadow map, for drawing it.
    pub(crate) plain: BindGroup,
    pub(crate) lit: BindGroup,
}

impl Globals {
    /// The numbers' size, in bytes.
    pub(crate) const SIZE: u64 = size_of::<Numbers>() as u64;

    /// `numbers` is a buffer that begins with the frame's numbers.
    pub(crate) fn new(
        device: &Device,
        layouts: &Layouts,
        quality: Quality,
        numbers: &Buffer,
    ) -> Self {
        let size = (quality.shadow_size(), quality.shadow_size());
        let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
        let map = texture(device, "shadow map", SHADOW, size, 1, usage);
        let map = map.create_view(&Default::default());
        let sampler = device.create_sampler(&SamplerDescriptor {
            label: Some("shadow map"),
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            compare: Some(CompareFunction::LessEqual),
            ..Default::default()
        });
        let plain = plain(device, layouts, numbers);
        let lit = lit(device, layouts, numbers, (&map, &sampler));
        Self { map, sampler, plain, lit }
    }

    /// The numbers are in another buffer.
    pub(crate) fn rebind(&mut self, device: &Device, layouts: &Layouts, numbers: &Buffer) {
        self.plain = plain(device, layouts, numbers);
        self.lit = lit(device, layouts, numbers, (&self.map, &self.sampler));
    }

    /// The shadow map, to draw it.
    pub(crate) fn shadow_map(&self) -> RenderPassDepthStencilAttachment<'_> {
        let ops = Operations { load: LoadOp::Clear(1.0), store: StoreOp::Store };
        let view = &self.map;
        RenderPassDepthStencilAttachment { view, depth_ops: Some(ops), stencil_ops: None }
    }
}

/// The beginning of a buffer.
fn beginning(buffer: &Buffer) -> BindGroupEntry<'_> {
    let size = NonZero::new(Globals::SIZE);
    let resource = BindingResource::Buffer(BufferBinding { buffer, offset: 0, size });
    BindGroupEntry { binding: 0, resource }
}

pub(crate) fn plain(device: &Device, layouts: &Layouts, numbers: &Buffer) -> BindGroup {
    device.create_bind_group(&BindGroupDescriptor {
        label: Some("globals"),
        layout: &layouts.globals,
        entries: &[beginning(numbers)],
    })
}

fn lit(
    device: &Device,
    layouts: &Layouts,
    numbers: &Buffer,
    (map, sampler): (&TextureView, &Sampler),
) -> BindGroup {
    let map = BindGroupEntry { binding: 1, resource: BindingResource::TextureView(map) };
    let sampler = BindGroupEntry { binding: 2, resource: BindingResource::Sampler(sampler) };
    device.create_bind_group(&BindGroupDescriptor {
        label: Some("lit"),
        layout: &layouts.lit,
        entries: &[beginning(numbers), map, sampler],
    })
}
