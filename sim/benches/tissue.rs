//! What soft tissue costs: a frame of a patch, by spring and substep, and a frame in which it is cut.
//!
//! `cargo bench -p dualframe-sim --bench tissue`

use std::time::Instant;

use dualframe_sim::behavior::tissue::{Cut, Material, Pin, Tissue};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Executor, SerialExecutor};
use dualframe_sim::geometry::{Blade, Geometry};
use dualframe_sim::interaction::Rules;
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;

/// The length of an edge, in metres.
const EDGE: f32 = 5e-3;
const SUBSTEPS: u32 = 16;
const ROUNDS: usize = 25;
const FRAMES: u64 = 20;

/// A patch of scalp of `side` nodes a side in z = 0, pinned at one side, and the number of its springs.
fn patch(side: usize) -> (Object, usize) {
    let place = |index: usize| {
        let (column, row) = (index % side, index / side);
        Vec3::new(column as f32 + 0.5 * (row % 2) as f32, row as f32 * 0.866_025_4, 0.0) * EDGE
    };
    let rest: Vec<Vec3> = (0..side * side).map(place).collect();
    let mut triangles = Vec::new();
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            let at = |c: usize, r: usize| ((row + r) * side + column + c) as u32;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            let odd = row % 2 == 1;
            triangles.extend(if odd { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] });
        }
    }
    let inner = 3 * triangles.len();
    let material = Material {
        stiffness: 4_330.0,
        bending: 80.0,
        to_center: 0.0,
        damping: 2.0,
        area_density: 5.0,
    };
    let (mesh, tissue) =
        Tissue::new(&rest, triangles, material, 1e-3, SUBSTEPS).expect("a valid patch");
    let (stiffness, strength) = (1e4, f32::INFINITY);
    let pin = |node: usize| Pin { node: node as u32, point: rest[node], stiffness, strength };
    let tissue = tissue.with_pins((0..side).map(pin).collect()).expect("its own nodes");
    let edges = mesh.topology().springs().len();
    // An edge inside has two triangles and one spring that resists bending.
    let springs = edges + (inner - edges);
    (Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), tissue), springs)
}

fn executor(object: Object, simd: Simd) -> SerialExecutor {
    let (time_step, gravity) = (1.0 / 60.0, Vec3::NEG_Z * 9.81);
    let stages = Stages { rules: Rules::new(), time_step, gravity, callback_budget: None, simd };
    SerialExecutor::new(Scene::new(vec![object], stages), Grain::Spatial).expect("one object")
}

/// The time of some frames, in seconds.
fn seconds(executor: &mut SerialExecutor, frames: u64) -> f64 {
    let began = Instant::now();
    executor.advance(frames, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
    began.elapsed().as_secs_f64()
}

fn main() {
    for side in [15, 21, 28] {
        for simd in Simd::available() {
            let (object, springs) = patch(side);
            let mut executor = executor(object, simd);
            let least = (0..ROUNDS)
                .map(|_| seconds(&mut executor, FRAMES) / FRAMES as f64)
                .fold(f64::INFINITY, f64::min);
            let each = 1e9 * least / (springs as f64 * f64::from(SUBSTEPS));
            println!(
                "{:>7}: {:>4} nodes, {springs} springs: {:>7.1} µs a frame, {each:.2} ns a spring and substep",
                simd.instructions().name(),
                side * side,
                1e6 * least,
            );
        }
    }
    let mut executor = executor(patch(28).0, Simd::detect());
    let whole = seconds(&mut executor, FRAMES) / FRAMES as f64;
    let blade = |x: f32| Blade { tip: Vec3::new(x, 0.06, -0.1), heel: Vec3::new(x, 0.06, 0.1) };
    let (mut most, mut total) = (0.0_f64, 0.0);
    let frames = 100_u16;
    for frame in 0..frames {
        let at = |frame: u16| blade(0.01 + 1e-3 * f32::from(frame));
        let cut = Cut { by: ObjectId(1), before: at(frame), now: at(frame + 1) };
        executor.mailbox().post(ObjectId(0), Message::Custom(Box::new(cut)));
        let extra = seconds(&mut executor, 1) - whole;
        (most, total) = (most.max(extra), total + extra);
    }
    println!(
        "a frame of 1 mm of cut in 784 nodes takes {:.1} µs more, {:.1} µs at most",
        1e6 * total / f64::from(frames),
        1e6 * most
    );
}
