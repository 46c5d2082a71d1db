//! Physics against analytic values and conservation laws.

mod common;

use std::any::Any;
use std::sync::Arc;

use common::{no_rules, particles, run, serial};
use dualframe_sim::behavior::MassSpring;
use dualframe_sim::executor::{Executor, SerialExecutor};
use dualframe_sim::geometry::{Geometry, Mesh, Topology};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::scene::Scene;
use glam::{DVec3, Vec3};

fn advance(executor: &mut SerialExecutor, frames: u64) {
    run(executor, frames);
}

fn each_mesh(executor: &SerialExecutor, mut visit: impl FnMut(&Mesh)) {
    executor.visit(&mut |object| {
        if let Geometry::Mesh(mesh) = &object.geometry {
            visit(mesh);
        }
    });
}

/// Two nodes of 1 kg, 1 m apart, and a spring; stretched, let go. The time step, in seconds, is a
/// whole frame's.
fn pair_of_nodes(stiffness: f32, time_step: f32, substeps: u32) -> Scene {
    let at_rest = [Vec3::ZERO, Vec3::X];
    let topology = Topology::new(&at_rest, Vec::new(), &[[0, 1]], false).expect("two nodes");
    let stretched = [Vec3::ZERO, Vec3::X * 1.125];
    let mesh = Mesh::new(Arc::new(topology), &stretched, &[1.0, 1.0], 0.0).expect("two masses");
    let behavior = MassSpring::new(stiffness, 0.0, substeps).expect("a stiffness");
    let object = Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), behavior);
    let mut stages = no_rules();
    stages.time_step = time_step;
    Scene::new(vec![object], stages)
}

/// The measured period of the pair, in seconds: over `periods` of them, from upward crossings of the
/// rest length, interpolated between steps.
fn period(stiffness: f32, time_step: f32, periods: usize) -> f64 {
    let mut executor = serial(pair_of_nodes(stiffness, time_step, 1));
    let mut crossings = Vec::new();
    let mut before = 0.125;
    while crossings.len() <= periods {
        advance(&mut executor, 1);
        let mut excess = 0.0;
        each_mesh(&executor, |mesh| {
            let ends: Vec<Vec3> = mesh.positions.iter().collect();
            excess = f64::from(ends[1].x - ends[0].x) - 1.0;
        });
        if before < 0.0 && excess >= 0.0 {
            let frame = executor.frame() as f64 - excess / (excess - before);
            crossings.push(frame * f64::from(time_step));
        }
        before = excess;
    }
    (crossings[periods] - crossings[0]) / periods as f64
}

/// Two masses m on a spring k swing with the angular frequency √(2k/m).
fn analytic_period(stiffness: f32) -> f64 {
    std::f64::consts::TAU / (2.0 * f64::from(stiffness)).sqrt()
}

#[test]
fn spring_pair_has_the_analytic_period() {
    let error = (period(50.0, 1.0 / 240.0, 20) / analytic_period(50.0) - 1.0).abs();
    assert!(error < 1e-3, "{error}");
}

#[test]
fn period_converges_at_second_order() {
    let error = |time_step: f32| 1.0 - period(50.0, time_step, 40) / analytic_period(50.0);
    let (coarse, fine) = (error(1.0 / 32.0), error(1.0 / 64.0));
    // The period of symplectic Euler is 2h/asin(ωh/2) half swings: shorter by (ωh)²/24.
    let expected = (10.0_f64 / 32.0).powi(2) / 24.0;
    assert!((coarse / expected - 1.0).abs() < 0.05, "{coarse}, expected {expected}");
    assert!((coarse / fine - 4.0).abs() < 0.2, "{coarse} / {fine}");
}

#[test]
fn an_irregular_body_at_rest_stays_there() {
    // A star and a tail: nodes of one to five springs, and two without any.
    let at = |index: usize| Vec3::new(index as f32, (index * index % 5) as f32, 1.0);
    let nodes: Vec<Vec3> = (0..9).map(at).collect();
    let edges = [[0, 1], [0, 2], [0, 3], [0, 4], [0, 5], [5, 6]];
    let topology = Topology::new(&nodes, Vec::new(), &edges, false).expect("nodes exist");
    let mesh = Mesh::new(Arc::new(topology), &nodes, &[1.0; 9], 0.0).expect("nine masses");
    let behavior = MassSpring::new(50.0, 1.0, 3).expect("a stiffness");
    let object = Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), behavior);
    let mut executor = serial(Scene::new(vec![object], no_rules()));
    run(&mut executor, 50);
    each_mesh(&executor, |mesh| {
        let ways = mesh.positions.iter().zip(&nodes).map(|(now, then)| now.distance(*then));
        assert!(ways.fold(0.0, f32::max) < 1e-4);
    });
}

#[test]
fn held_nodes_do_not_move() {
    let nodes = [Vec3::ZERO, Vec3::X];
    let topology = Topology::new(&nodes, Vec::new(), &[[0, 1]], false).expect("two nodes");
    let mesh = Mesh::new(Arc::new(topology), &nodes, &[0.0, 2.0], 0.0).expect("two masses");
    let behavior = MassSpring::new(50.0, 1.0, 1).expect("a stiffness");
    let object = Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), behavior);
    let mut stages = no_rules();
    stages.gravity = Vec3::NEG_Y * 9.81;
    let mut executor = serial(Scene::new(vec![object], stages));
    run(&mut executor, 1);
    // In the first frame the spring is at rest: the other node falls freely.
    each_mesh(&executor, |mesh| {
        let speed = mesh.velocities.get(1).expect("a node").y;
        assert!((speed + 9.81 / 240.0).abs() < 1e-6, "{speed} m/s");
    });
    run(&mut executor, 49);
    each_mesh(&executor, |mesh| {
        assert_eq!(mesh.positions.get(0), Some(Vec3::ZERO));
        assert!(mesh.positions.get(1).expect("a node").y < -0.1);
    });
}

/// Linear and angular momentum, and the sums of the magnitudes of their parts.
fn momentum(executor: &SerialExecutor) -> ([DVec3; 2], [f64; 2]) {
    let (mut sums, mut sizes) = ([DVec3::ZERO; 2], [0.0; 2]);
    each_mesh(executor, |mesh| {
        let nodes = mesh.positions.iter().zip(mesh.velocities.iter()).zip(mesh.masses());
        for ((position, velocity), &mass) in nodes {
            let linear = velocity.as_dvec3() * f64::from(mass);
            let angular = position.as_dvec3().cross(linear);
            for (index, part) in [linear, angular].into_iter().enumerate() {
                sums[index] += part;
                sizes[index] += part.length();
            }
        }
    });
    (sums, sizes)
}

fn momentum_is_kept(damping: bool) {
    // Without walls; towards each other, so that they do collide.
    let mut scene = particles(30, false, damping);
    scene.objects.truncate(30);
    for object in &mut scene.objects {
        if let Geometry::Mesh(mesh) = &mut object.geometry {
            let inwards = mesh.positions.get(0).expect("a node") * -2.0;
            let own = mesh.velocities.get(0).expect("a node");
            mesh.set_velocity(own * 0.3 + inwards);
        }
    }
    let mut executor = serial(scene);
    let (before, sizes) = momentum(&executor);
    let mut collisions = 0;
    for _ in 0..8 {
        let (counts, _, _) = run(&mut executor, 100);
        collisions += counts.iter().map(|count| count.collisions).sum::<u64>();
        let (now, _) = momentum(&executor);
        for index in 0..2 {
            let error = (now[index] - before[index]).length() / sizes[index];
            assert!(error < 1e-5, "{} momentum: {error}", ["linear", "angular"][index]);
        }
    }
    assert!(collisions > 1_000, "{collisions} collisions");
}

#[test]
fn momentum_of_free_particles_without_damping() {
    momentum_is_kept(false);
}

#[test]
fn momentum_of_free_particles_with_damping() {
    momentum_is_kept(true);
}

/// The kinetic and the elastic energy of all bodies, in joules.
fn energy_of_bodies(executor: &SerialExecutor) -> f64 {
    let mut energy = 0.0;
    executor.visit(&mut |object| {
        let Some(mesh) = object.geometry.as_mesh() else { return };
        let behavior: &dyn Any = &*object.behavior;
        let springs = behavior.downcast_ref::<MassSpring>().expect("particles are mass–spring");
        energy += springs.elastic_energy(mesh);
        for (velocity, &mass) in mesh.velocities.iter().zip(mesh.masses()) {
            energy += 0.5 * f64::from(mass) * velocity.as_dvec3().length_squared();
        }
    });
    energy
}

/// The energy of the particle scene's contacts, in joules.
fn energy_of_contacts(executor: &SerialExecutor) -> f64 {
    let (mut meshes, mut walls) = (Vec::new(), Vec::new());
    executor.visit(&mut |object| match &object.geometry {
        Geometry::Mesh(mesh) => meshes.push(mesh.clone()),
        Geometry::Rigid(rigid) => walls.extend(rigid.plane()),
        Geometry::Volume(_) => {}
    });
    // The scene's stiffnesses and reaches: node and wall, node and node, core and core.
    let stored = |stiffness: f64, reach: f64, distance: f32| {
        0.5 * stiffness * (reach - f64::from(distance)).max(0.0).powi(2)
    };
    let mut energy = 0.0;
    for (index, a) in meshes.iter().enumerate() {
        for node in a.positions.iter() {
            let to_wall = walls.iter().map(|&(point, normal)| (node - point).dot(normal));
            energy += to_wall.map(|distance| stored(200.0, 0.03, distance)).sum::<f64>();
        }
        for b in &meshes[..index] {
            energy += stored(2_000.0, 0.2, a.center().distance(b.center()));
            for node in a.positions.iter().filter(|node| node.distance(b.center()) < 0.3) {
                let others = b.positions.iter().map(|other| node.distance(other));
                energy += others.map(|distance| stored(120.0, 0.06, distance)).sum::<f64>();
            }
        }
    }
    energy
}

#[test]
fn energy_of_a_closed_room_without_damping_is_bounded() {
    let mut executor = serial(particles(20, false, false));
    let energy =
        |executor: &SerialExecutor| energy_of_bodies(executor) + energy_of_contacts(executor);
    let (before, mut collisions) = (energy(&executor), 0);
    for _ in 0..200 {
        let (counts, ..) = run(&mut executor, 40);
        collisions += counts.iter().map(|count| count.collisions).sum::<u64>();
        let error = energy(&executor) / before - 1.0;
        assert!(error.abs() < 0.05, "{error} of {before} J");
    }
    assert!(collisions > 1_000, "{collisions} collisions");
}
