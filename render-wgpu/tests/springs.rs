//! Springs integrated by a graphics device, against those integrated by the processor.
#![forbid(unsafe_code)]

use std::any::Any;
use std::sync::Arc;

use dualframe_render_wgpu::auxiliary::Auxiliary;
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_render_wgpu::springs::GpuMassSpring;
use dualframe_sim::behavior::MassSpring;
use dualframe_sim::executor::{Entry, ExecutorKind};
use dualframe_sim::geometry::{Geometry, Mesh, Topology, edges, icosphere};
use dualframe_sim::interaction::Rules;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::{ParticleScene, Scene};
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;

/// By how much a particle's node may be elsewhere after 240 frames, in metres: a ten-thousandth of its
/// radius.
const TOLERANCE: f32 = 1e-5;

fn offscreen(scene: &ParticleScene) -> Offscreen {
    let gpu = Gpu::new(None).expect("a graphics adapter");
    let look = Look::room(scene.room());
    Offscreen::new(gpu, look, Quality::Fast, (64, 48)).expect("64 by 48 pixels")
}

/// The scene, with the springs of those objects that are chosen on the device.
fn on_device(mut scene: Scene, auxiliary: &Auxiliary, chosen: impl Fn(u32) -> bool) -> Scene {
    for object in scene.objects.iter_mut().filter(|object| chosen(object.id().0)) {
        let behavior: &dyn Any = &*object.behavior;
        if let Some(springs) = behavior.downcast_ref::<MassSpring>() {
            let springs = GpuMassSpring::new(springs.clone(), auxiliary.clone());
            object.behavior = Box::new(springs);
        }
    }
    scene
}

/// Every particle is out of shape, so that it vibrates.
fn vibrating(settings: ParticleScene) -> Scene {
    let mut scene = settings.build().expect("a valid scene");
    for object in &mut scene.objects {
        if let Some(mesh) = object.geometry.as_mesh_mut() {
            let center = mesh.center();
            for node in 0..mesh.positions.len() {
                let position = mesh.positions.get(node).expect("a node");
                let way = position - center;
                mesh.positions.set(node, center + way * Vec3::new(1.2, 0.9, 1.0));
            }
            object.refit();
        }
    }
    scene
}

fn manager(scene: Scene, executor: ExecutorKind, threads: usize) -> VeManager {
    let settings = Settings { executor, threads, entry: Entry::AfterUpdate, ..Settings::default() };
    VeManager::new(scene, settings).expect("valid settings")
}

fn run(manager: &mut VeManager, frames: u64, renderer: &mut dyn Renderer) {
    manager.run(frames, renderer, &mut |_| {}).expect("tables are large enough");
}

/// Every node's position and velocity, by objects.
fn nodes(manager: &VeManager) -> Vec<(Vec3, Vec3)> {
    let mut bodies = Vec::new();
    manager.visit(&mut |object| {
        assert_eq!(object.quarantined(), None);
        if let Some(mesh) = object.geometry.as_mesh() {
            let nodes: Vec<_> = mesh.positions.iter().zip(mesh.velocities.iter()).collect();
            bodies.push((object.id(), nodes));
        }
    });
    bodies.sort_unstable_by_key(|(id, _)| *id);
    bodies.into_iter().flat_map(|(_, nodes)| nodes).collect()
}

fn farthest(a: &VeManager, b: &VeManager) -> f32 {
    let (a, b) = (nodes(a), nodes(b));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|((a, _), (b, _))| a.distance(*b)).fold(0.0, f32::max)
}

/// The frames that the device integrated, of each object that it may.
fn frames_by_device(manager: &VeManager) -> Vec<u64> {
    let mut frames = Vec::new();
    manager.visit(&mut |object| {
        let behavior: &dyn Any = &*object.behavior;
        frames.extend(behavior.downcast_ref().map(GpuMassSpring::frames_by_device));
    });
    frames
}

/// A sphere of 42 nodes whose faces are divided `times` times, at the origin.
fn sphere(times: u32, to_center: bool, masses: impl Fn(usize) -> f32) -> Mesh {
    let (mut nodes, mut triangles) = icosphere(0.1);
    for _ in 0..times {
        let sides = edges(&triangles);
        let first = nodes.len() as u32;
        let middle = |&[a, b]: &[u32; 2]| (nodes[a as usize] + nodes[b as usize]).normalize() * 0.1;
        let middles: Vec<_> = sides.iter().map(middle).collect();
        nodes.extend(middles);
        let between = |a: u32, b: u32| {
            first + sides.binary_search(&[a.min(b), a.max(b)]).expect("a side") as u32
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [between(a, b), between(b, c), between(c, a)];
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    let sides = edges(&triangles);
    let topology = Topology::new(&nodes, triangles, &sides, to_center).expect("a topology");
    let masses: Vec<_> = (0..nodes.len()).map(masses).collect();
    let pressed: Vec<_> = nodes.iter().map(|node| node * Vec3::new(1.2, 0.8, 1.0)).collect();
    Mesh::new(Arc::new(topology), &pressed, &masses, 0.01).expect("a mesh")
}

/// A body by itself.
fn alone(mesh: Mesh, springs: MassSpring, gravity: Vec3) -> Scene {
    let body = Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), springs);
    let stages = Stages {
        rules: Rules::new(),
        time_step: ParticleScene::TIME_STEP,
        gravity,
        callback_budget: None,
        simd: Simd::detect(),
    };
    Scene::new(vec![body], stages)
}

#[test]
fn without_a_device_the_processor_integrates_and_the_next_frame_is_predicted() {
    let springs = || MassSpring::new(60.0, 0.02, 3).expect("valid springs");
    let scene = || alone(sphere(0, true, |_| 0.01), springs(), Vec3::NEG_Y);
    let mut plain = manager(scene(), ExecutorKind::Serial, 1);
    let scene = on_device(scene(), &Auxiliary::unserved(), |_| true);
    let mut split = manager(scene, ExecutorKind::Serial, 1);
    run(&mut split, 1, &mut NullRenderer::new());
    let mut before = nodes(&plain);
    for frame in 1..240 {
        run(&mut plain, 1, &mut NullRenderer::new());
        run(&mut split, 1, &mut NullRenderer::new());
        let now = nodes(&plain);
        let expected = before.iter().zip(&now).map(|((_, earlier), (place, velocity))| {
            let gained = velocity - earlier;
            (place + (velocity + gained) * ParticleScene::TIME_STEP, *velocity)
        });
        assert_eq!(nodes(&split), expected.collect::<Vec<_>>(), "frame {frame}");
        before = now;
    }
    assert_eq!(frames_by_device(&split), [0]);
}

#[test]
fn contacts_do_not_throw_bodies_about() {
    let settings = ParticleScene { gravity: true, ..ParticleScene::new(30) };
    let scene = settings.build().expect("a valid scene");
    let scene = on_device(scene, &Auxiliary::unserved(), |id| id % 3 > 0);
    let mut manager = manager(scene, ExecutorKind::Serial, 1);
    let energy = |manager: &VeManager| -> f32 {
        nodes(manager).iter().map(|(_, velocity)| 0.5 * 0.01 * velocity.length_squared()).sum()
    };
    run(&mut manager, 60, &mut NullRenderer::new());
    let falling = energy(&manager);
    run(&mut manager, 540, &mut NullRenderer::new());
    let lying = energy(&manager);
    assert!(lying < 0.05 * falling, "{lying} J of {falling} J are left");
}

#[test]
fn an_impulse_from_outside_is_kept() {
    let springs = || MassSpring::new(60.0, 0.0, 2).expect("valid springs");
    let scene = alone(sphere(0, true, |_| 0.01), springs(), Vec3::ZERO);
    let scene = on_device(scene, &Auxiliary::unserved(), |_| true);
    let mut manager = manager(scene, ExecutorKind::Serial, 1);
    run(&mut manager, 5, &mut NullRenderer::new());
    let impulse = [0.0, 0.042, 0.0];
    manager.mailbox().post(ObjectId(0), Message::Impulse { node: 7, impulse });
    run(&mut manager, 5, &mut NullRenderer::new());
    let momentum: Vec3 = nodes(&manager).iter().map(|(_, velocity)| 0.01 * velocity).sum();
    assert!(momentum.distance(Vec3::from_array(impulse)) < 1e-6, "{momentum}");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_vibrating_falling_touching_particle_is_the_same_within_the_tolerance() {
    for seed in 1..=3 {
        let settings = ParticleScene { gravity: true, seed, ..ParticleScene::new(1) };
        let mut renderer = offscreen(&settings);
        let scene = |auxiliary| on_device(vibrating(settings), auxiliary, |_| true);
        let auxiliary = renderer.painter.auxiliary();
        let mut device = manager(scene(&auxiliary), ExecutorKind::Serial, 1);
        let mut processor = manager(scene(&Auxiliary::unserved()), ExecutorKind::Serial, 1);
        let mut touched = 0;
        // The springs of a frame are integrated between its update and the next.
        for frames in [2, 9, 230] {
            run(&mut device, frames, &mut renderer);
            let count = |record: &dualframe_sim::executor::FrameRecord| record.pairs.collisions;
            processor
                .run(frames, &mut NullRenderer::new(), &mut |record| touched += count(record))
                .expect("tables are large enough");
            let error = farthest(&device, &processor);
            println!("seed {seed}, {frames} more frames: {error:e} m");
            assert!(error < TOLERANCE, "{error} m");
        }
        assert!(touched > 0, "it never touched a wall");
        assert_eq!(frames_by_device(&device), [240]);
        assert_eq!(renderer.painter.failure(), None);
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn bodies_of_any_size_and_make() {
    let settings = ParticleScene::new(1);
    // 2,562 nodes, ten to an invocation; without springs to the centre; with nodes held fast.
    let made: [(&str, Mesh); 4] = [
        ("small", sphere(0, true, |_| 0.01)),
        ("large", sphere(3, true, |_| 0.01)),
        ("hollow", sphere(1, false, |_| 0.01)),
        ("held", sphere(1, true, |node| if node % 10 == 0 { 0.0 } else { 0.01 })),
    ];
    for (name, mesh) in made {
        for (damping, substeps) in [(0.0, 3), (0.02, 3), (0.02, 4)] {
            let springs = MassSpring::new(60.0, damping, substeps).expect("valid springs");
            let mut renderer = offscreen(&settings);
            let auxiliary = renderer.painter.auxiliary();
            let scene = |auxiliary| {
                let scene = alone(mesh.clone(), springs.clone(), Vec3::NEG_Y);
                on_device(scene, auxiliary, |_| true)
            };
            let mut device = manager(scene(&auxiliary), ExecutorKind::Serial, 1);
            let mut processor = manager(scene(&Auxiliary::unserved()), ExecutorKind::Serial, 1);
            run(&mut device, 25, &mut renderer);
            run(&mut processor, 25, &mut NullRenderer::new());
            let error = farthest(&device, &processor);
            println!("{name}, damping {damping}, {substeps} substeps: {error:e} m");
            assert!(error < TOLERANCE, "{name}: {error} m");
            assert_eq!(frames_by_device(&device), [24], "{name}");
        }
    }
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn momentum_is_kept() {
    let settings = ParticleScene::new(1);
    let mut renderer = offscreen(&settings);
    let springs = MassSpring::new(60.0, 0.02, 4).expect("valid springs");
    let mut mesh = sphere(1, true, |node| 0.005 + 0.0001 * node as f32);
    for node in 0..mesh.velocities.len() {
        let position = mesh.positions.get(node).expect("a node");
        mesh.velocities.set(node, Vec3::new(0.2, -0.1, 0.3) + Vec3::Z.cross(position) * 2.0);
    }
    let masses = mesh.masses().to_vec();
    let scene =
        on_device(alone(mesh, springs, Vec3::ZERO), &renderer.painter.auxiliary(), |_| true);
    let mut manager = manager(scene, ExecutorKind::Serial, 1);
    let momenta = |manager: &VeManager| {
        let nodes = nodes(manager);
        let momentum = |(mass, (_, velocity)): (&f32, &(Vec3, Vec3))| *mass * *velocity;
        let linear: Vec3 = masses.iter().zip(&nodes).map(momentum).sum();
        let turn = |all: (&f32, &(Vec3, Vec3))| all.1.0.cross(momentum(all));
        let angular: Vec3 = masses.iter().zip(&nodes).map(turn).sum();
        (linear, angular)
    };
    let (linear, angular) = momenta(&manager);
    run(&mut manager, 241, &mut renderer);
    let (linear_then, angular_then) = momenta(&manager);
    println!("{linear} -> {linear_then}, {angular} -> {angular_then}");
    assert!(linear.distance(linear_then) < 1e-5 * linear.length());
    // Of a moment when positions are predicted.
    assert!(angular.distance(angular_then) < 1e-3 * angular.length());
    assert_eq!(frames_by_device(&manager), [240]);
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_mixed_environment_has_the_same_bits_for_any_number_of_threads() {
    // More units than the queue holds at once.
    const OBJECTS: usize = 300;
    const FRAMES: u64 = 6;
    let settings = ParticleScene { gravity: true, ..ParticleScene::new(OBJECTS) };
    let mut hashes = Vec::new();
    for (executor, threads) in [
        (ExecutorKind::Serial, 1),
        (ExecutorKind::Pipeline, 1),
        (ExecutorKind::Pipeline, 2),
        (ExecutorKind::Pipeline, 3),
        (ExecutorKind::Pipeline, 4),
        (ExecutorKind::Static, 2),
    ] {
        let mut renderer = offscreen(&settings);
        if threads == 2 {
            // Whether anybody sees them is the same to them.
            renderer.painter.camera.target += Vec3::splat(1e4);
        }
        let auxiliary = renderer.painter.auxiliary();
        let scene = on_device(vibrating(settings), &auxiliary, |id| id % 8 > 0);
        let mut manager = manager(scene, executor, threads);
        run(&mut manager, FRAMES, &mut renderer);
        assert!(
            nodes(&manager).iter().all(|(place, speed)| place.is_finite() && speed.is_finite())
        );
        assert_eq!(frames_by_device(&manager), [FRAMES - 1; OBJECTS - OBJECTS.div_ceil(8)]);
        assert_eq!(renderer.painter.failure(), None);
        hashes.push(manager.state_hash());
    }
    assert!(hashes.iter().all(|&hash| hash == hashes[0]), "{hashes:x?}");
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn what_is_drawn_from_a_copy_is_left_to_the_processor() {
    let settings = ParticleScene { gravity: true, ..ParticleScene::new(20) };
    let mut renderer = offscreen(&settings);
    let auxiliary = renderer.painter.auxiliary();
    let scene = |auxiliary| on_device(vibrating(settings), auxiliary, |_| true);
    let mut copied = manager(scene(&auxiliary), ExecutorKind::RayonOverlapped, 2);
    let mut processor = manager(scene(&Auxiliary::unserved()), ExecutorKind::Serial, 1);
    run(&mut copied, 40, &mut renderer);
    run(&mut processor, 40, &mut NullRenderer::new());
    assert_eq!(frames_by_device(&copied), [0; 20]);
    assert_eq!(copied.state_hash(), processor.state_hash());
    assert_eq!(renderer.painter.failure(), None);
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn a_device_that_fails_leaves_the_springs_to_the_processor() {
    let settings = ParticleScene { gravity: true, ..ParticleScene::new(4) };
    let mut renderer = offscreen(&settings);
    let auxiliary = renderer.painter.auxiliary();
    let scene = |auxiliary| on_device(vibrating(settings), auxiliary, |_| true);
    let mut device = manager(scene(&auxiliary), ExecutorKind::Pipeline, 2);
    let mut processor = manager(scene(&Auxiliary::unserved()), ExecutorKind::Serial, 1);
    run(&mut device, 10, &mut renderer);
    renderer.painter.gpu().device.destroy();
    run(&mut device, 10, &mut renderer);
    run(&mut processor, 20, &mut NullRenderer::new());
    assert!(renderer.painter.failure().is_some());
    assert!(frames_by_device(&device).iter().all(|frames| (9..=10).contains(frames)));
    let error = farthest(&device, &processor);
    assert!(error < TOLERANCE, "{error} m");
}
