//! Springs per nanosecond of the update kernel, for every set of vector instructions that the machine
//! has, beside a ceiling: the springs' arithmetic with lanes across sixteen bodies, without an engine. It comes
//! to the same positions but for rounding, which is looked at first; it lacks gravity, masses of single nodes,
//! dashpots, boxes and checks.
//!
//! The kernel is seen in three uses: a block of bodies that all make many substeps; many blocks, one after the
//! other, of bodies that make 1 to 10 as the particles do, with dashpots, which count as springs; and one body
//! alone.
//!
//! `cargo bench -p dualframe-sim --bench kernels`

mod ceiling;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use ceiling::Ceiling;
use dualframe_sim::behavior::{MassSpring, Workspace};
use dualframe_sim::block::Block;
use dualframe_sim::geometry::{Geometry, ICOSPHERE_NODES, Mesh, Topology, edges, icosphere};
use dualframe_sim::interaction::Rules;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;

/// Bodies of a block that all make many substeps.
const BODIES: usize = 16;
/// Bodies of one of several blocks: as many as blocks of particles have.
const MIXED_BODIES: usize = 64;
/// So many that the rest of an update (boxes, checks) does not show.
const SUBSTEPS: u32 = 100;
/// Blocks of bodies that make few substeps: as some 300 particles fill.
const BLOCKS: usize = 5;
/// Frames of them, of which all but the first find them in a cache, as in a scene.
const FRAMES: u64 = 4;
/// In newton seconds per metre.
const DAMPING: f32 = 0.02;
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

/// A way to use the kernel.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    /// A block whose bodies all make [`SUBSTEPS`] in one frame.
    Equal,
    /// [`BLOCKS`] whose bodies make 1 to 10 a frame, and are damped.
    Mixed,
    /// One body that makes [`SUBSTEPS`] in one frame.
    Alone,
}

impl Use {
    const ALL: [Self; 3] = [Self::Equal, Self::Mixed, Self::Alone];

    fn name(self) -> &'static str {
        match self {
            Self::Equal => "equal",
            Self::Mixed => "mixed",
            Self::Alone => "alone",
        }
    }

    fn bodies(self) -> usize {
        match self {
            Self::Equal => BODIES,
            Self::Mixed => MIXED_BODIES,
            Self::Alone => 1,
        }
    }

    fn blocks(self) -> usize {
        if self == Self::Mixed { BLOCKS } else { 1 }
    }

    fn frames(self) -> u64 {
        if self == Self::Mixed { FRAMES } else { 1 }
    }

    fn damping(self) -> f32 {
        if self == Self::Mixed { DAMPING } else { 0.0 }
    }

    /// Of the body number `index`.
    fn substeps(self, index: usize) -> u32 {
        if self == Self::Mixed { 1 + (index as u32 * 7) % 10 } else { SUBSTEPS }
    }

    /// Springs and dashpots computed for each spring of a body.
    fn work(self) -> u64 {
        let dashpots = u32::from(self.damping() > 0.0);
        let steps = (0..self.bodies()).map(|index| self.substeps(index) + dashpots);
        steps.map(u64::from).sum::<u64>() * self.blocks() as u64 * self.frames()
    }
}

fn block(topology: &Arc<Topology>, case: Use) -> Block {
    let object = |index| {
        let masses = [0.01; ICOSPHERE_NODES];
        let mesh = Mesh::new(Arc::clone(topology), &positions(), &masses, 0.03);
        let springs = MassSpring::new(STIFFNESS, case.damping(), case.substeps(index));
        let geometry = Geometry::Mesh(mesh.expect("an icosphere"));
        Object::new(ObjectId(index as u32), Group(0), geometry, springs.expect("a stiffness"))
    };
    Block::new((0..case.bodies()).map(object).collect())
}

fn stages(simd: Simd, case: Use) -> Stages {
    Stages {
        rules: Rules::new(),
        time_step: STEP * block_substeps(case) as f32,
        gravity: Vec3::ZERO,
        callback_budget: None,
        simd,
    }
}

fn update(stages: &Stages, frame: u64, block: &mut Block, workspace: &mut Workspace) {
    let nobody = |_| std::iter::empty();
    stages.update(frame, block, std::iter::empty(), workspace, nobody, &mut |_, _, _| {});
}

/// Something that integrates bodies.
struct Entrant {
    simd: Simd,
    /// `None` for the ceiling.
    case: Option<Use>,
    advance: Box<dyn FnMut()>,
    /// Springs and dashpots computed for each spring of a body.
    work: u64,
    nanoseconds: Vec<f64>,
}

/// For each set of instructions the ceiling, then the uses.
fn entrants(topology: &Arc<Topology>) -> Vec<Entrant> {
    let mut entrants: Vec<Entrant> = Vec::new();
    for simd in Simd::available() {
        let mut ceiling = Ceiling::new(topology, &positions(), STIFFNESS, STEP, SUBSTEPS);
        let advance = Box::new(move || ceiling.advance(simd.instructions()));
        let work = BODIES as u64 * u64::from(SUBSTEPS);
        entrants.push(Entrant { simd, case: None, advance, work, nanoseconds: Vec::new() });
        for case in Use::ALL {
            let mut blocks: Vec<Block> =
                (0..case.blocks()).map(|_| block(topology, case)).collect();
            let (stages, mut workspace) = (stages(simd, case), Workspace::default());
            let advance = Box::new(move || {
                for frame in 0..case.frames() {
                    for block in black_box(&mut blocks) {
                        update(&stages, frame, block, &mut workspace);
                    }
                }
            });
            let (case, work) = (Some(case), case.work());
            entrants.push(Entrant { simd, case, advance, work, nanoseconds: Vec::new() });
        }
    }
    entrants
}

/// The most substeps of a body.
fn block_substeps(case: Use) -> u32 {
    (0..case.bodies()).map(|index| case.substeps(index)).max().unwrap_or(1)
}

/// Sees that kernel and ceiling move a body alike.
fn compare(topology: &Arc<Topology>) {
    for simd in Simd::available() {
        let mut ceiling = Ceiling::new(topology, &positions(), STIFFNESS, STEP, SUBSTEPS);
        ceiling.advance(simd.instructions());
        let mut body = block(topology, Use::Alone);
        update(&stages(simd, Use::Alone), 0, &mut body, &mut Workspace::default());
        let mesh = body.objects()[0].geometry.as_mesh().expect("an icosphere");
        let (mut moved, mut apart) = (0.0_f32, 0.0_f32);
        for ((own, its), before) in mesh.positions.iter().zip(ceiling.positions()).zip(positions())
        {
            moved = moved.max(own.distance(before));
            apart = apart.max(own.distance(its));
        }
        assert!(moved > 1e-3 && apart < 1e-3 * moved, "{moved} m, {apart} m apart");
    }
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
    compare(&topology);
    let mut entrants = entrants(&topology);
    for _ in 0..rounds {
        for entrant in &mut entrants {
            let start = Instant::now();
            (entrant.advance)();
            entrant.nanoseconds.push(start.elapsed().as_nanos() as f64);
        }
    }
    let springs = topology.spring_count() as f64;
    println!(
        "instructions  use    springs/ns  ceiling  ratio (medians of {rounds} interleaved rounds)"
    );
    for entrants in entrants.chunk_by(|a, b| a.simd == b.simd) {
        let Some((ceiling, uses)) = entrants.split_first() else { continue };
        let speed =
            |entrant: &Entrant, nanoseconds: f64| springs * entrant.work as f64 / nanoseconds;
        for entrant in uses {
            let both = entrant.nanoseconds.iter().zip(&ceiling.nanoseconds);
            let ratios = both.map(|(&own, &its)| speed(entrant, own) / speed(ceiling, its));
            println!(
                "{:12}  {:5}  {:10.2}  {:7.2}  {:5.2}",
                entrant.simd.instructions().name(),
                entrant.case.map_or("", Use::name),
                speed(entrant, median(&entrant.nanoseconds)),
                speed(ceiling, median(&ceiling.nanoseconds)),
                median(&ratios.collect::<Vec<_>>())
            );
        }
    }
}
