//! The same bits from every set of vector instructions that the machine has.

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::{Reference, particles, run, serial};
use dualframe_sim::behavior::{Behavior, MassSpring};
use dualframe_sim::geometry::{Geometry, Mesh, Topology, Vectors};
use dualframe_sim::message::Message;
use dualframe_sim::object::{FaultKind, Group, Object, ObjectId};
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::{Instructions, Simd};
use dualframe_sim::stages::Stages;
use glam::Vec3;

/// Numbers that repeat (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    /// From −1 to 1.
    fn component(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.component(), self.component(), self.component())
    }
}

fn available() -> Vec<Simd> {
    let available: Vec<Simd> = Simd::available().collect();
    let widths: Vec<_> = available.iter().map(|simd| simd.instructions()).collect();
    println!("this machine has {widths:?}");
    #[cfg(target_arch = "x86_64")]
    for (instructions, there) in [
        (Instructions::Avx2, is_x86_feature_detected!("avx2")),
        (
            Instructions::Avx512,
            is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl"),
        ),
    ] {
        assert_eq!(widths.contains(&instructions), there, "{instructions:?}");
    }
    assert_eq!(widths[0], Instructions::Scalar);
    assert_eq!(available.last(), Some(&Simd::detect()));
    available
}

#[test]
fn whole_scenes() {
    let states = available().into_iter().map(|simd| {
        let mut scene = particles(100, true, true);
        scene.stages.simd = simd;
        run(&mut serial(scene), 120)
    });
    let states: Vec<_> = states.collect();
    assert!(states[0].0.iter().any(|count| count.collisions > 100), "nothing was tested");
    assert!(states.iter().all(|state| *state == states[0]), "{states:?}");
}

/// Nodes with random springs, some without any, and where the nodes are.
fn make(random: &mut Random) -> (Arc<Topology>, Vec<Vec3>) {
    let nodes = 3 + random.below(198);
    let positions: Vec<Vec3> = (0..nodes).map(|_| random.vector()).collect();
    let mut edges = Vec::new();
    for _ in 0..random.below(4 * nodes) {
        let [a, b] = [random.below(nodes), random.below(nodes)];
        if a != b {
            edges.push([a as u32, b as u32]);
        }
    }
    let to_center = random.below(2) == 0;
    let topology = Topology::new(&positions, Vec::new(), &edges, to_center).expect("its own nodes");
    (Arc::new(topology), positions)
}

/// A body of that make, stretched, some nodes of it held.
fn body_of(
    (topology, positions): &(Arc<Topology>, Vec<Vec3>),
    id: u32,
    random: &mut Random,
) -> Object {
    let mass = |random: &mut Random| {
        if random.below(8) == 0 { 0.0 } else { 0.3 + random.vector().x / 8.0 }
    };
    let masses: Vec<f32> = positions.iter().map(|_| mass(random)).collect();
    let stretched: Vec<Vec3> = positions.iter().map(|p| *p * 1.1 + random.vector()).collect();
    let mesh = Mesh::new(Arc::clone(topology), &stretched, &masses, 0.1);
    let mut mesh = mesh.expect("a mass each");
    for node in 0..positions.len() {
        mesh.velocities.set(node, random.vector());
    }
    let damping = if random.below(2) == 0 { 0.0 } else { 0.01 + random.vector().x / 128.0 };
    let stiffness = 1.0 + random.vector().x / 8.0;
    let springs = MassSpring::new(stiffness, damping, 1 + random.below(10) as u32);
    let mut springs = springs.expect("allowed").with_center_stiffness(2.0).expect("allowed");
    springs.process(&Message::Weightless(random.below(4) == 0));
    Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh), springs)
}

fn body(seed: u64) -> Object {
    let mut random = Random(seed);
    let make = make(&mut random);
    body_of(&make, 0, &mut random)
}

/// The bits of a body's positions, velocities, box and middle.
fn bits(object: &Object) -> Vec<u32> {
    let mesh = object.geometry.as_mesh().expect("a body");
    let bounds = object.bounds();
    let extent = [bounds.min, bounds.max, object.center()];
    let vectors = mesh.positions.iter().chain(mesh.velocities.iter()).chain(extent);
    vectors.flat_map(|vector| vector.to_array().map(f32::to_bits)).collect()
}

fn stages(simd: Simd) -> Stages {
    Stages { simd, gravity: Vec3::new(0.1, -9.81, 0.3), ..common::no_rules() }
}

/// What becomes of objects in five frames, in blocks of so many; by their numbers.
fn outcome(objects: Vec<Object>, stages: Stages, size: usize) -> Vec<Object> {
    let mut reference = Reference::new(Scene::new(objects, stages), size);
    for _ in 0..5 {
        reference.step();
    }
    let objects = reference.blocks.iter().flat_map(|block| block.objects());
    let mut snapshots: Vec<Object> = objects.map(Object::snapshot).collect();
    snapshots.sort_unstable_by_key(Object::id);
    snapshots
}

/// The bits of a body's state after some frames.
fn state(seed: u64, simd: Simd) -> Vec<u32> {
    let objects = outcome(vec![body(seed)], stages(simd), 1);
    assert_eq!(objects[0].quarantined(), None, "seed {seed}");
    bits(&objects[0])
}

#[test]
fn random_bodies() {
    let (scalar, wider) = {
        let mut available = available();
        (available.remove(0), available)
    };
    let mut differ = false;
    for seed in 0..300 {
        let expected = state(seed, scalar);
        differ |= expected != state(seed + 1, scalar);
        for &simd in &wider {
            assert_eq!(state(seed, simd), expected, "seed {seed}, {:?}", simd.instructions());
        }
    }
    assert!(differ, "all bodies are alike");
}

/// Bodies of three makes by turns.
fn bodies(seed: u64, count: u32) -> Vec<Object> {
    let mut random = Random(seed);
    let makes = [make(&mut random), make(&mut random), make(&mut random)];
    (0..count).map(|id| body_of(&makes[id as usize % 3], id, &mut random)).collect()
}

#[test]
fn bodies_beside_others() {
    for seed in 0..20 {
        let expected = outcome(bodies(seed, 100), stages(Simd::detect()), 1);
        let expected: Vec<_> = expected.iter().map(bits).collect();
        assert_ne!(expected[0], expected[3], "all bodies are alike");
        for simd in available() {
            for size in [1, 7, 30, 100] {
                let objects = outcome(bodies(seed, 100), stages(simd), size);
                for (object, expected) in objects.iter().zip(&expected) {
                    assert_eq!(object.quarantined(), None);
                    let name = simd.instructions().name();
                    assert_eq!(bits(object), *expected, "{name}, {size} a block, seed {seed}");
                }
            }
        }
    }
}

#[test]
fn bodies_beside_others_far_away_and_fast() {
    // What dashpots to the centre would do to padding, which is at the origin, is beyond what numbers hold.
    for (place, speed) in [(1e19, 1e20), (1e17, 1e23), (1e10, 1e30), (1e-20, 1e-30), (1e30, 1e15)] {
        let thrown = || {
            let mut objects = bodies(3, 40);
            for object in &mut objects {
                let mesh = object.geometry.as_mesh_mut().expect("a body");
                for node in 0..mesh.positions.len() {
                    mesh.positions.add(node, Vec3::X * place);
                }
                mesh.set_velocity(Vec3::new(1.0, -0.5, 0.25) * speed);
            }
            objects
        };
        let state = |object: &Object| match object.quarantined() {
            Some(fault) => Err(fault),
            None => Ok(bits(object)),
        };
        let expected: Vec<_> =
            outcome(thrown(), stages(Simd::detect()), 1).iter().map(state).collect();
        for simd in available() {
            for size in [1, 40] {
                let objects = outcome(thrown(), stages(simd), size);
                let name = simd.instructions().name();
                assert!(
                    objects.iter().map(state).eq(expected.iter().cloned()),
                    "{name}, {size}, {place}"
                );
            }
        }
    }
}

/// A ring in a plane at a height of −0, too small, in which springs push along that plane.
fn ring(id: u32) -> Object {
    const NODES: u32 = 20;
    let angle = |node: u32| std::f32::consts::TAU * node as f32 / NODES as f32;
    let place = |node: u32| Vec3::new(angle(node).cos(), -0.0, angle(node).sin());
    let positions: Vec<Vec3> = (0..NODES).map(place).collect();
    let edges: Vec<[u32; 2]> = (0..NODES).map(|node| [node, (node + 1) % NODES]).collect();
    let topology = Topology::new(&positions, Vec::new(), &edges, true).expect("its own nodes");
    let smaller: Vec<Vec3> = positions.iter().map(|position| 0.9 * position).collect();
    let mesh = Mesh::new(Arc::new(topology), &smaller, &[0.1; NODES as usize], 0.1);
    let mut mesh = mesh.expect("a mass each");
    mesh.set_velocity(-Vec3::ZERO);
    let springs = MassSpring::new(1.0, 0.0, 1).expect("allowed");
    let springs = springs.with_center_stiffness(2.0).expect("allowed");
    Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh), springs)
}

/// A sum of nothing but zeros is +0 or −0, by where it begins and what else is added.
#[test]
fn flat_bodies_beside_others() {
    let rings = || {
        let one = ring(0);
        let mesh = one.geometry.as_mesh().expect("a body").clone();
        let like_it = |id| {
            let mut other = ring(id);
            // Only bodies of one topology are side by side.
            other.geometry = Geometry::Mesh(mesh.clone());
            other
        };
        (0..16).map(like_it).collect::<Vec<_>>()
    };
    let stages = |simd| Stages { gravity: -Vec3::ZERO, ..stages(simd) };
    let expected = outcome(rings(), stages(Simd::detect()), 1);
    for simd in available() {
        let objects = outcome(rings(), stages(simd), 16);
        let name = simd.instructions().name();
        assert!(objects.iter().map(bits).eq(expected.iter().map(bits)), "{name}");
    }
}

#[test]
fn bodies_without_nodes_beside_others() {
    let topology = Topology::new(&[], Vec::new(), &[], true).expect("no nodes");
    let mesh = Mesh::new(Arc::new(topology), &[], &[], 0.1).expect("no masses");
    let empty = |id| {
        let springs = MassSpring::new(1.0, 0.0, 1).expect("allowed");
        Object::new(ObjectId(id), Group(0), Geometry::Mesh(mesh.clone()), springs)
    };
    for simd in available() {
        for size in [1, 16] {
            let objects = outcome((0..16).map(empty).collect(), stages(simd), size);
            assert!(
                objects.iter().all(|object| object.quarantined().is_none()),
                "{simd:?}, {size}"
            );
        }
    }
}

#[test]
fn a_limit_on_time_changes_nothing_else() {
    let budget = Some(Duration::from_secs(3_600));
    let together = outcome(bodies(1, 60), stages(Simd::detect()), 60);
    let limited = Stages { callback_budget: budget, ..stages(Simd::detect()) };
    let limited = outcome(bodies(1, 60), limited, 60);
    assert!(together.iter().map(bits).eq(limited.iter().map(bits)));
}

#[test]
fn a_broken_body_harms_none_beside_it() {
    for simd in available() {
        let expected = outcome(bodies(2, 60), stages(simd), 60);
        for kind in [FaultKind::NonFinite, FaultKind::Panicked] {
            let mut objects = bodies(2, 60);
            let mesh = objects[30].geometry.as_mesh_mut().expect("a body");
            match kind {
                FaultKind::NonFinite => mesh.velocities.set(1, Vec3::new(0.0, f32::NAN, 0.0)),
                _ => mesh.positions = Vectors::zeros(1),
            }
            let objects = outcome(objects, stages(simd), 60);
            for (place, (object, expected)) in objects.iter().zip(&expected).enumerate() {
                let fault = object.quarantined().map(|fault| fault.kind);
                assert_eq!(fault, (place == 30).then_some(kind), "{place}");
                assert!(place == 30 || bits(object) == bits(expected), "{place}, {kind:?}");
            }
        }
    }
}

#[test]
fn what_the_machine_lacks_is_refused() {
    for instructions in Instructions::ALL {
        match Simd::new(instructions) {
            Ok(simd) => assert_eq!(simd.instructions(), instructions),
            Err(lacking) => {
                assert_eq!(lacking.asked, instructions);
                assert!(lacking.widest < instructions);
                assert!(lacking.to_string().contains(instructions.name()));
            }
        }
    }
}
