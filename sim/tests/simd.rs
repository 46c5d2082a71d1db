//! The same bits from every set of vector instructions that the machine has.

mod common;

use std::sync::Arc;

use common::{Reference, particles, run, serial};
use dualframe_sim::behavior::MassSpring;
use dualframe_sim::geometry::{Geometry, Mesh, Topology};
use dualframe_sim::object::{Group, Object, ObjectId};
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
        (Instructions::Avx512, is_x86_feature_detected!("avx512f")),
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
        let mut scene = particles(60, true, true);
        scene.stages.simd = simd;
        run(&mut serial(scene), 120)
    });
    let states: Vec<_> = states.collect();
    assert!(states[0].0.iter().any(|count| count.collisions > 100), "nothing was tested");
    assert!(states.iter().all(|state| *state == states[0]), "{states:?}");
}

/// A body with random springs; some nodes are held, some have no spring.
fn body(seed: u64) -> Object {
    let mut random = Random(seed);
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
    let mass = |random: &mut Random| if random.below(8) == 0 { 0.0 } else { 1.0 };
    let masses: Vec<f32> = (0..nodes).map(|_| mass(&mut random) * 0.3).collect();
    let stretched: Vec<Vec3> = positions.iter().map(|p| *p * 1.1 + random.vector()).collect();
    let mut mesh = Mesh::new(Arc::new(topology), &stretched, &masses, 0.1).expect("a mass each");
    for node in 0..nodes {
        mesh.velocities.set(node, random.vector());
    }
    let damping = if random.below(2) == 0 { 0.0 } else { 0.01 };
    let springs = MassSpring::new(1.0, damping, 1 + random.below(4) as u32).expect("allowed");
    let springs = springs.with_center_stiffness(2.0).expect("allowed");
    Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), springs)
}

/// The bits of a body's state after some frames.
fn state(seed: u64, simd: Simd) -> Vec<u32> {
    let gravity = Vec3::new(0.1, -9.81, 0.3);
    let stages = Stages { simd, gravity, ..common::no_rules() };
    let mut reference = Reference::new(Scene { objects: vec![body(seed)], stages }, 1);
    for _ in 0..5 {
        reference.step();
    }
    let object = &reference.blocks[0].objects()[0];
    assert_eq!(object.quarantined(), None, "seed {seed}");
    let mesh = object.geometry.as_mesh().expect("a body");
    let vectors = mesh.positions.iter().chain(mesh.velocities.iter());
    vectors.flat_map(|vector| vector.to_array().map(f32::to_bits)).collect()
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
