//! Springs per nanosecond of the update kernel, for every set of vector instructions that the machine
//! has, beside a ceiling: the same arithmetic with lanes across sixteen bodies, without an engine.
//!
//! `cargo bench -p dualframe-sim --bench kernels`

mod ceiling;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use ceiling::Ceiling;
use dualframe_sim::behavior::MassSpring;
use dualframe_sim::block::Block;
use dualframe_sim::geometry::{Geometry, ICOSPHERE_NODES, Mesh, Topology, edges, icosphere};
use dualframe_sim::interaction::Rules;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;

/// Bodies of a block.
const BODIES: usize = 16;
/// So many that the rest of an update (boxes, checks) does not show.
const SUBSTEPS: u32 = 100;
/// In newtons per metre.
const STIFFNESS: f32 = 60.0;
/// The time of a substep, in seconds.
const STEP: f32 = 1e-4;

fn topology() -> Arc<Topology> {
    let (nodes, triangles) = icosphere(0.1);
    let edges = edges(&triangles);
    Arc::new(Topology::new(&nodes, triangles, &edges, true).expect("an icosphere"))
}

/// Positions stretched a little, so that the springs have something to do.
fn positions() -> Vec<Vec3> {
    icosphere(0.1).0.into_iter().map(|node| node * Vec3::new(1.05, 1.0, 0.97)).collect()
}

fn block(topology: &Arc<Topology>) -> Block {
    let object = |index| {
        let masses = [0.01; ICOSPHERE_NODES];
        let mesh = Mesh::new(Arc::clone(topology), &positions(), &masses, 0.03);
        let springs = MassSpring::new(STIFFNESS, 0.0, SUBSTEPS).expect("a stiffness");
        let geometry = Geometry::Mesh(mesh.expect("an icosphere"));
        Object::new(ObjectId(index as u32), Group(0), geometry, springs)
    };
    Block::new((0..BODIES).map(object).collect())
}

/// Something that integrates [`SUBSTEPS`] of [`BODIES`] bodies.
struct Entrant {
    name: &'static str,
    advance: Box<dyn FnMut()>,
    /// The ceiling it is measured against, by its place.
    ceiling: Option<usize>,
    nanoseconds: Vec<f64>,
}

fn entrants(topology: &Arc<Topology>) -> Vec<Entrant> {
    let mut entrants: Vec<Entrant> = Vec::new();
    for simd in Simd::available() {
        let name = simd.instructions().name();
        let mut ceiling = Ceiling::new(topology, &positions(), STIFFNESS, STEP, SUBSTEPS);
        entrants.push(Entrant {
            name,
            advance: Box::new(move || ceiling.advance(simd.instructions())),
            ceiling: None,
            nanoseconds: Vec::new(),
        });
        let stages = Stages {
            rules: Rules::new(),
            time_step: STEP * SUBSTEPS as f32,
            gravity: Vec3::ZERO,
            callback_budget: None,
            simd,
        };
        let mut block = block(topology);
        entrants.push(Entrant {
            name,
            advance: Box::new(move || {
                stages.update(0, black_box(&mut block), std::iter::empty(), &mut |_, _, _| {});
            }),
            ceiling: Some(entrants.len() - 1),
            nanoseconds: Vec::new(),
        });
    }
    entrants
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn main() {
    // Cargo passes `--test` where benches are only to be tried.
    let rounds = if std::env::args().any(|arg| arg == "--test") { 1 } else { 301 };
    let topology = topology();
    let mut entrants = entrants(&topology);
    for _ in 0..rounds {
        for entrant in &mut entrants {
            let start = Instant::now();
            (entrant.advance)();
            entrant.nanoseconds.push(start.elapsed().as_nanos() as f64);
        }
    }
    let springs = (topology.spring_count() * BODIES) as f64 * f64::from(SUBSTEPS);
    println!("instructions  springs/ns  ceiling  ratio (medians of {rounds} interleaved rounds)");
    for entrant in &entrants {
        let Some(ceiling) = entrant.ceiling.map(|place| &entrants[place]) else { continue };
        let ratios = entrant.nanoseconds.iter().zip(&ceiling.nanoseconds);
        let ratios: Vec<f64> = ratios.map(|(own, ceiling)| ceiling / own).collect();
        println!(
            "{:12}  {:10.2}  {:7.2}  {:5.2}",
            entrant.name,
            springs / median(&entrant.nanoseconds),
            springs / median(&ceiling.nanoseconds),
            median(&ratios)
        );
    }
}
