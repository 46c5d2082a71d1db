//! What voxel bone costs: a grid of the size of a head CT is built, drilled, read, and copied for a
//! renderer.
//!
//! `cargo bench -p dualframe-sim --bench volume`

use std::hint::black_box;
use std::time::Instant;

use dualframe_sim::geometry::Volume;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::scene::bone_piece;
use dualframe_sim::{behavior::Fixed, geometry::Geometry};
use glam::Vec3;
use parry3d::math::Pose;

/// Voxels of a head CT.
const DIMS: [u32; 3] = [512, 512, 300];
/// Distances between them, in metres.
const SPACING: Vec3 = Vec3::new(4.5e-4, 4.5e-4, 6e-4);
/// The radius of a burr, in metres.
const BURR: f32 = 3e-3;
const REPEATS: u32 = 31;

/// Calls that are timed together of what takes about as long as to read the clock.
const CALLS: u32 = 1_000;

/// The least time of some runs, in seconds.
fn seconds(repeats: u32, mut run: impl FnMut(u32)) -> f64 {
    let times = (0..repeats).map(|number| {
        let began = Instant::now();
        run(number);
        began.elapsed().as_secs_f64()
    });
    times.fold(f64::INFINITY, f64::min)
}

fn show(what: &str, seconds: f64) {
    println!("{what:<52} {:>12.3} µs", seconds * 1e6);
}

fn main() {
    let fill = |[x, y, z]: [u32; 3]| (x ^ y ^ z) as u8;
    let build = || Volume::from_fn(DIMS, SPACING, Pose::IDENTITY, fill).expect("a CT's size");
    let head = build();
    let built = seconds(5, |_| {
        black_box(build());
    });
    show("a head of 512 × 512 × 300 voxels is built", built);
    let piece = seconds(REPEATS, |_| {
        black_box(bone_piece(128, Pose::IDENTITY).expect("128 voxels are allowed"));
    });
    show("a piece of skull of 128³ voxels is built", piece);

    let mut object = Object::new(ObjectId(0), Group(0), Geometry::Volume(head), Fixed);
    let mut copy = object.snapshot();
    let head = object.geometry.as_volume().expect("a volume");
    let mut seen: Vec<u64> = head.bricks().map(|brick| brick.revision).collect();
    // A burr of 3 mm goes on by less than its radius, and each time a renderer's copy follows.
    let at = |number: u32| Vec3::new(0.11 + 4e-4 * number as f32, 0.1, 0.09);
    let (mut drilling, mut copying, mut telling) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    for number in 0..REPEATS {
        let volume = object.geometry.as_volume_mut().expect("a volume");
        let began = Instant::now();
        black_box(volume.remove(at(number), BURR, |voxel| voxel.share(0.3)));
        drilling = drilling.min(began.elapsed().as_secs_f64());
        let began = Instant::now();
        let changed =
            volume.bricks().zip(&mut seen).filter(|(brick, seen)| brick.revision != **seen);
        changed.for_each(|(brick, seen)| *seen = black_box(brick).revision);
        telling = telling.min(began.elapsed().as_secs_f64());
        let began = Instant::now();
        object.snapshot_into(&mut copy);
        copying = copying.min(began.elapsed().as_secs_f64());
    }
    show("a burr of 3 mm removes part of what it overlaps", drilling);
    show("the bricks that changed are found", telling);
    show("a copy follows", copying);

    let volume = object.geometry.as_volume().expect("a volume");
    let points: Vec<Vec3> = (0..CALLS).map(|call| at(call % REPEATS)).collect();
    let each = |read: &dyn Fn(Vec3)| {
        seconds(REPEATS, |_| points.iter().for_each(|&point| read(point))) / f64::from(CALLS)
    };
    let density = each(&|point| _ = black_box(volume.density_at(point)));
    show("the density at a point", density);
    let gradient = each(&|point| _ = black_box(volume.gradient_at(point)));
    show("the gradient at a point", gradient);
    let mut sum = 0.0;
    let visit = seconds(REPEATS, |number| {
        volume.visit(at(number), BURR, |voxel| sum += voxel.overlap * f32::from(voxel.density));
    });
    black_box(sum);
    show("what a burr of 3 mm overlaps is summed up", visit);
}
