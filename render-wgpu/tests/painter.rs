//! Frames that are not drawn, and bodies without a surface.

use std::sync::Arc;

use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::behavior::Fixed;
use dualframe_sim::geometry::{Bounds, Geometry, Mesh, Topology};
use dualframe_sim::object::{Drawing, Group, Object, ObjectId};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::ParticleScene;
use glam::Vec3;
use wgpu::PollType;

const SIZE: (u32, u32) = (320, 240);

/// Sees a cube of 2 m around the origin.
fn offscreen() -> Offscreen {
    let focus = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
    let gpu = Gpu::new(None).expect("these tests need a graphics adapter; one in software will do");
    Offscreen::new(gpu, Look::room(focus, Quality::Fast), SIZE).expect("a small picture")
}

/// The bytes that the device has in use.
fn in_use(offscreen: &Offscreen) -> u64 {
    let device = &offscreen.painter.gpu().device;
    device.poll(PollType::wait_indefinitely()).expect("the device works");
    device.generate_allocator_report().expect("Vulkan tells").total_allocated_bytes
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn frames_that_are_not_drawn_leave_nothing() {
    let mut offscreen = offscreen();
    let particles = ParticleScene::new(40).build().expect("few particles").objects;
    // As much room is taken for a frame as the last one needed that was drawn.
    particles.iter().for_each(|object| offscreen.draw(object));
    offscreen.swap(0);
    let mut after = |frames: usize| {
        for _ in 0..frames {
            particles.iter().for_each(|object| offscreen.draw(object));
            offscreen.painter.discard();
        }
        in_use(&offscreen)
    };
    let (few, many) = (after(10), after(100));
    assert!(many <= few, "{few} bytes, then {many}");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_mesh_without_triangles_is_not_drawn() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mut offscreen = offscreen();
    offscreen.swap(0);
    let empty = offscreen.picture().expect("the device works");
    for drawing in [Drawing::Surface, Drawing::Edges] {
        let topology = Topology::new(&corners, Vec::new(), &[[0, 1]], false).expect("an edge");
        let mesh = Mesh::new(Arc::new(topology), &corners, &[0.01; 3], 0.01).expect("a mesh");
        let mut object = Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), Fixed);
        object.drawing = drawing;
        offscreen.draw(&object);
        offscreen.swap(1);
        assert_eq!(offscreen.picture().as_ref(), Ok(&empty), "{drawing:?}");
    }
}
