//! A renderer of one's own: on a device that its host has, and with a look at what was drawn.

use std::sync::mpsc::{Sender, channel};

use dualframe_render_wgpu::auxiliary::{Context, GpuUnit};
use dualframe_render_wgpu::error::GraphicsError;
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::picture::Picture;
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_render_wgpu::wgpu::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoder, DeviceDescriptor, Instance,
    InstanceDescriptor, Limits, PowerPreference, RequestAdapterOptions, TexelCopyBufferInfo,
    TexelCopyBufferLayout,
};
use dualframe_sim::behavior::Fixed;
use dualframe_sim::geometry::{Bounds, Geometry, Rigid, Volume};
use dualframe_sim::object::{Group, Object, ObjectId, VisualProperties};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::ParticleScene;
use glam::Vec3;
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

/// A row is 256 bytes, as copies to buffers want it.
const SIZE: (u32, u32) = (64, 48);

fn offscreen(gpu: Gpu, quality: Quality) -> Offscreen {
    let focus = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
    Offscreen::new(gpu, Look::room(focus), quality, SIZE).expect("a small picture")
}

fn draw(offscreen: &mut Offscreen, color: [f32; 4]) -> Picture {
    let shape = SharedShape::ball(0.5);
    let geometry = Geometry::Rigid(Rigid::new(shape, Pose::IDENTITY));
    let mut ball = Object::new(ObjectId(0), Group(0), geometry, Fixed);
    ball.visual = VisualProperties { color };
    offscreen.draw(&ball);
    let particles = ParticleScene::new(8).build().expect("few particles").objects;
    particles.iter().for_each(|object| offscreen.draw(object));
    let pose = Pose::from_translation(Vec3::X * 0.7);
    let bone = Volume::from_fn([16; 3], Vec3::splat(0.02), pose, |_| 255).expect("a small volume");
    offscreen.draw(&Object::new(ObjectId(9), Group(0), Geometry::Volume(bone), Fixed));
    offscreen.swap(0);
    offscreen.picture().expect("the device works")
}

/// A host's device with the least limits that there may be.
fn of_a_host() -> Gpu {
    let instance = Instance::new(InstanceDescriptor::new_without_display_handle_from_env());
    // Where there are several, the one that `Gpu::new` takes.
    let power_preference = PowerPreference::from_env().unwrap_or(PowerPreference::HighPerformance);
    let options = RequestAdapterOptions { power_preference, ..Default::default() };
    let request = instance.request_adapter(&options);
    let adapter = pollster::block_on(request).expect("there is a graphics adapter");
    let required_limits = Limits::downlevel_defaults();
    let wanted = DeviceDescriptor { required_limits, ..Default::default() };
    let requested = pollster::block_on(adapter.request_device(&wanted));
    let (device, queue) = requested.expect("the adapter allows it");
    Gpu::from_device(adapter, device, queue).expect("it may do what is needed")
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_device_that_the_host_has_already_draws_the_same() {
    for quality in [Quality::Fast, Quality::Fine] {
        let mut own = offscreen(Gpu::new(None).expect("there is a graphics adapter"), quality);
        let mut hosts = offscreen(of_a_host(), quality);
        let color = [0.8, 0.1, 0.1, 1.0];
        assert_eq!(draw(&mut hosts, color), draw(&mut own, color));
        assert_eq!(hosts.painter.gpu().device.limits(), Limits::downlevel_defaults());
        assert_eq!(hosts.painter.failure(), None);
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn all_is_opaque() {
    let mut offscreen = offscreen(of_a_host(), Quality::Fast);
    let opaque = draw(&mut offscreen, [0.8, 0.1, 0.1, 1.0]);
    assert_eq!(draw(&mut offscreen, [0.8, 0.1, 0.1, 0.2]), opaque);
    let (pixels, _) = opaque.pixels.as_chunks::<4>();
    assert!(pixels.iter().all(|&[.., opacity]| opacity == 255));
}

/// Copies the picture of the next frame.
struct Copied(Sender<(Picture, bool)>);

impl GpuUnit for Copied {
    fn needs_frame(&self) -> bool {
        true
    }

    fn encode(&mut self, context: &Context<'_>, encoder: &mut CommandEncoder) -> Option<Buffer> {
        let texture = context.picture?.texture();
        let (width, height) = context.size;
        let buffer = context.gpu.device.create_buffer(&BufferDescriptor {
            label: Some("copied"),
            size: u64::from(4 * width * height),
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * width),
            rows_per_image: Some(height),
        };
        let to = TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
        Some(buffer)
    }

    fn finish(self: Box<Self>, context: &Context<'_>, results: Result<&[u8], GraphicsError>) {
        let (width, height) = context.size;
        let pixels = results.expect("the device works").to_vec();
        let copied = (Picture { width, height, pixels }, context.picture.is_some());
        self.0.send(copied).expect("it is waited for");
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_unit_sees_the_picture_that_was_drawn() {
    for quality in [Quality::Fast, Quality::Fine] {
        let gpu = Gpu::new(None).expect("there is a graphics adapter");
        let mut offscreen = offscreen(gpu, quality);
        let (copy, copied) = channel();
        let unit = Box::new(Copied(copy));
        offscreen.painter.auxiliary().submit(unit).expect("the queue is empty");
        let red = draw(&mut offscreen, [0.8, 0.1, 0.1, 1.0]);
        let blue = draw(&mut offscreen, [0.1, 0.1, 0.8, 1.0]);
        assert_ne!(red, blue);
        assert_eq!(copied.try_recv(), Ok((red, false)), "of the next frame, and not afterwards");
    }
}
