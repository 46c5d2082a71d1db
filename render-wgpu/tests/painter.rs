//! Frames that are not drawn, bodies without a surface, and several questions at once.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Coloring, Look, Quality};
use dualframe_render_wgpu::pick::{Pick, Picked};
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::behavior::Fixed;
use dualframe_sim::geometry::{Bounds, Geometry, Mesh, Rigid, Topology};
use dualframe_sim::object::{Drawing, Group, Object, ObjectId};
use dualframe_sim::render::Renderer;
use dualframe_sim::scene::ParticleScene;
use glam::{Vec2, Vec3};
use parry3d::math::Pose;
use parry3d::shape::{HeightField, HeightFieldCellStatus, SharedShape};
use parry3d::utils::Array2;
use wgpu::PollType;

const SIZE: (u32, u32) = (320, 240);
const RADIUS: f32 = 0.1;

/// Sees a cube of 2 m around the origin.
fn offscreen() -> Offscreen {
    let focus = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
    let gpu = Gpu::new(None).expect("these tests need a graphics adapter; one in software will do");
    Offscreen::new(gpu, Look::room(focus), Quality::Fast, SIZE).expect("a small picture")
}

fn ball(id: u32, place: Vec3) -> Object {
    let shape = SharedShape::ball(RADIUS);
    let rigid = Rigid::new(shape, Pose::from_translation(place));
    Object::new(ObjectId(id), Group(0), Geometry::Rigid(rigid), Fixed)
}

/// Bytes that the device's allocator may take for itself between two looks; usually some tens. Of ninety frames that were
/// left it has two million.
const ALLOCATORS_OWN: u64 = 10_000;

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
    assert!(many < few + ALLOCATORS_OWN, "{few} bytes, then {many}");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn shapes_that_nobody_has_any_more_leave_nothing() {
    let mut offscreen = offscreen();
    let mut after = |frames: usize| {
        for _ in 0..frames {
            // Another shape each time.
            offscreen.draw(&ball(0, Vec3::ZERO));
            offscreen.swap(0);
        }
        in_use(&offscreen)
    };
    let (few, many) = (after(10), after(100));
    assert!(many < few + ALLOCATORS_OWN, "{few} bytes, then {many}");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn what_is_hidden_or_has_no_surface_is_not_in_a_picture() {
    let mut offscreen = offscreen();
    offscreen.painter.look.room = false;
    let mut with = |object: &Object| {
        offscreen.painter.add(object);
        offscreen.swap(0);
        assert!(offscreen.painter.failure().is_none());
        offscreen.picture().expect("the device works").pixels
    };
    let mut hidden = ball(0, Vec3::ZERO);
    hidden.drawing = Drawing::Hidden;
    let mut field = HeightField::new(Array2::repeat(3, 3, 0.0), Vec3::ONE);
    for cell in [[0, 0], [0, 1], [1, 0], [1, 1]] {
        field.set_cell_status(cell[0], cell[1], HeightFieldCellStatus::CELL_REMOVED);
    }
    let rigid = Rigid::new(SharedShape::new(field), Pose::IDENTITY);
    let removed = Object::new(ObjectId(0), Group(0), Geometry::Rigid(rigid), Fixed);
    let nothing = with(&hidden);
    assert!(with(&ball(0, Vec3::ZERO)) != nothing, "a ball is to be seen");
    assert!(with(&removed) == nothing, "no cell is left");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn pictures_follow_the_size() {
    let mut offscreen = offscreen();
    for (width, height) in [SIZE, (100, 70), (400, 300)] {
        offscreen.painter.resize(width, height).expect("a small picture");
        offscreen.draw(&ball(0, Vec3::ZERO));
        offscreen.swap(0);
        let picture = offscreen.picture().expect("the device works");
        assert_eq!((picture.width, picture.height), (width, height));
    }
}

/// The colour of a place in the last frame's picture.
fn color_at(offscreen: &Offscreen, place: Vec3) -> [u8; 3] {
    let picture = offscreen.picture().expect("the device works");
    let aspect = picture.width as f32 / picture.height as f32;
    let clip = offscreen.painter.camera.view_projection(aspect).project_point3(place);
    let [x, y] =
        [(0.5 + 0.5 * clip.x) * picture.width as f32, (0.5 - 0.5 * clip.y) * picture.height as f32];
    let (pixels, _) = picture.pixels.as_chunks::<4>();
    let [r, g, b, _] = pixels[y as usize * picture.width as usize + x as usize];
    [r, g, b]
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_rigid_shape_has_a_speed() {
    let mut offscreen = offscreen();
    offscreen.painter.look.coloring = Coloring::Speed;
    let mut at = |speed: f32| {
        let mut object = ball(0, Vec3::ZERO);
        object.geometry.as_rigid_mut().expect("a ball").velocity = Vec3::X * speed;
        offscreen.draw(&object);
        offscreen.swap(0);
        color_at(&offscreen, Vec3::ZERO)
    };
    let (rest, slow, fast) = (at(0.0), at(1.0), at(3.0));
    assert!(rest.into_iter().all(|channel| channel < 80), "{rest:?}");
    assert!(slow[0] > 120 && slow[2] < 80, "not red: {slow:?}");
    assert!(fast.into_iter().all(|channel| channel > 120), "not white: {fast:?}");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn beyond_the_lights_reach_there_are_only_shadows_of_what_is_within_it() {
    let mut offscreen = offscreen();
    offscreen.painter.look = Look { room: false, light: Vec3::Y, ..offscreen.painter.look };
    offscreen.painter.camera.pitch = 1.4;
    // A flat box below a ball; the light's reach ends at a depth of 1 m.
    let mut seen = |depth: f32| {
        let shape = SharedShape::cuboid(0.8, 0.01, 0.8);
        let pose = Pose::from_translation(Vec3::NEG_Y * depth);
        let geometry = Geometry::Rigid(Rigid::new(shape, pose));
        offscreen.draw(&Object::new(ObjectId(0), Group(0), geometry, Fixed));
        offscreen.draw(&ball(1, Vec3::X * 0.5));
        offscreen.swap(0);
        [0.0, 0.5].map(|x| color_at(&offscreen, Vec3::new(x, -depth, 0.0)))
    };
    let differ = |a: [u8; 3], b: [u8; 3]| a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > 20);
    let ([lit, shaded], [lit_below, shaded_below]) = (seen(0.9), seen(1.5));
    assert!(differ(lit, shaded), "the ball throws no shadow");
    assert!(!differ(lit, lit_below), "{lit:?} within, {lit_below:?} below");
    assert!(!differ(shaded, shaded_below), "{shaded:?} within, {shaded_below:?} below");
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

/// Asks what is at a place of the next frame.
fn ask(offscreen: &Offscreen, place: Vec3) -> Receiver<Option<Picked>> {
    let (answer, answered) = channel();
    let aspect = SIZE.0 as f32 / SIZE.1 as f32;
    let point = offscreen.painter.camera.view_projection(aspect).project_point3(place);
    let pick = Pick::new(Vec2::new(point.x, point.y), answer);
    offscreen.painter.auxiliary().submit(Box::new(pick)).expect("there is room");
    answered
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn every_question_has_its_own_answer() {
    let places = [Vec3::new(-0.5, 0.2, 0.3), Vec3::new(0.6, -0.1, 0.1), Vec3::new(0.0, 0.5, -0.4)];
    let balls: Vec<_> = (0..).zip(places).map(|(id, place)| ball(id, place)).collect();
    let mut offscreen = offscreen();
    let frame = |offscreen: &mut Offscreen| {
        balls.iter().for_each(|object| offscreen.draw(object));
        offscreen.swap(0);
    };
    let answers = places.map(|place| ask(&offscreen, place));
    let beside = ask(&offscreen, Vec3::new(-0.5, -0.5, 0.3));
    // They wait for a frame, and the answers for the next one, which is seen from elsewhere.
    frame(&mut offscreen);
    frame(&mut offscreen);
    offscreen.painter.camera.orbit(1.0, 0.3);
    offscreen.painter.camera.zoom(1.5);
    frame(&mut offscreen);
    for ((id, place), answer) in (0..).zip(places).zip(&answers) {
        let picked = answer.try_recv().expect("an answer").expect("a ball is there");
        assert_eq!(picked.object, ObjectId(id));
        let off = picked.place.distance(place) - RADIUS;
        assert!(off.abs() < 0.05 * RADIUS, "ball {id}: {off} m off its surface");
    }
    assert_eq!(beside.try_recv(), Ok(None));
}
