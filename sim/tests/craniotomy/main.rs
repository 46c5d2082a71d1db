//! The craniotomy on the synthetic head: what each step does, and that every executor does the same.
#![cfg(feature = "image")]
#![forbid(unsafe_code)]

mod score;

use std::any::Any;
use std::sync::{Arc, OnceLock};

use dualframe_sim::behavior::piece::Piece;
use dualframe_sim::behavior::{Bone, Instrument, Tissue, Tool};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::Geometry;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::craniotomy::{
    FIRST_STRUCTURE, LOOK_FRAMES, Operation, Report, SKULL, Step, TOOLS, build,
};
use dualframe_sim::scene::head::{Form, Head};
use glam::Vec3;

/// The head, built once: it takes a second.
fn head() -> Arc<Head> {
    static HEAD: OnceLock<Arc<Head>> = OnceLock::new();
    Arc::clone(HEAD.get_or_init(|| Arc::new(Head::synthetic().expect("the synthetic head"))))
}

/// An operation under way.
struct Theatre {
    manager: VeManager,
    operation: Operation<'static>,
    settings: Settings,
    freed: Vec<u64>,
}

impl Theatre {
    fn new(step: Step, executor: ExecutorKind, threads: usize) -> Self {
        let settings =
            Settings { executor, threads, grain: Grain::Pairwise, ..Settings::default() };
        let scene = build(&head()).expect("a sound scene");
        let manager = VeManager::new(scene, settings).expect("few threads");
        Self { manager, operation: Operation::new(head(), Some(step)), settings, freed: Vec::new() }
    }

    /// Operates for so many frames.
    fn run(mut self, frames: u64) -> Self {
        while self.manager.frame() < frames {
            let batch = LOOK_FRAMES - self.manager.frame() % LOOK_FRAMES;
            let batch = batch.min(frames - self.manager.frame());
            let mailbox = self.manager.mailbox();
            let mut renderer = NullRenderer::new();
            let (hands, mut watch) = self.operation.parts(&mut renderer);
            let mut on_frame = |record: &dualframe_sim::executor::FrameRecord| {
                hands.swapped(record.frame, &mailbox);
            };
            self.manager.run(batch, &mut watch, &mut on_frame).expect("no table is full");
            let settings = self.settings;
            let mut is_another = false;
            let look = self.operation.look(self.manager, |scene| {
                is_another = true;
                VeManager::new(scene, settings)
            });
            let (manager, freed) = look.expect("few threads");
            assert_eq!(is_another, freed > 0, "a look alone stops nobody");
            self.manager = manager;
            self.freed.extend(std::iter::repeat_n(self.manager.frame(), freed));
        }
        assert!(self.manager.quarantined().is_empty());
        self
    }

    fn report(&self) -> Report {
        self.operation.report(|see| self.manager.visit(see))
    }

    fn read<T>(&self, id: ObjectId, mut read: impl FnMut(&Object) -> T) -> T {
        let mut found = None;
        self.manager.visit(&mut |object| {
            if object.id() == id {
                found = Some(read(object));
            }
        });
        found.expect("the object is there")
    }
}

/// The frames before the retraction's end in which the scalp is drawn aside, and a few more.
const DRAWING: u64 = 160;
/// The operative scalp is the first structure.
const SCALP: ObjectId = FIRST_STRUCTURE;
const PIECE: ObjectId = ObjectId(SKULL.0 + 1);

/// How far nodes are apart that were one before it was cut, the farthest first, in metres.
fn gaps(scalp: &Object) -> Vec<f32> {
    let (mesh, tissue) =
        (scalp.geometry.as_mesh().expect("tissue"), Tissue::of(scalp).expect("tissue"));
    let rest = tissue.rest();
    let bits = |node: usize| rest[node].to_array().map(f32::to_bits);
    let mut nodes: Vec<usize> = (0..rest.len()).collect();
    nodes.sort_by_key(|&node| bits(node));
    let twins = nodes.chunk_by(|&a, &b| bits(a) == bits(b)).filter(|twins| twins.len() > 1);
    let place = |node: usize| mesh.positions.get(node).expect("a node");
    let mut gaps: Vec<f32> = twins.map(|twins| place(twins[0]).distance(place(twins[1]))).collect();
    gaps.sort_by(|a, b| b.total_cmp(a));
    gaps
}

fn mass(object: &Object) -> f64 {
    let masses = object.geometry.as_mesh().expect("tissue").masses();
    masses.iter().map(|&mass| f64::from(mass)).sum()
}

/// How many of its nodes are held.
fn pins(scalp: &Object) -> usize {
    Tissue::of(scalp).expect("tissue").pins().len()
}

#[test]
fn thirty_objects() {
    let scene = build(&head()).expect("a sound scene");
    assert_eq!(scene.objects.len(), 30);
    let count = |is: fn(&Object) -> bool| scene.objects.iter().filter(|object| is(object)).count();
    assert_eq!(count(|object| Tool::of(object).is_some()), 2);
    assert_eq!(count(|object| Tissue::of(object).is_some()), 27);
    assert_eq!(count(|object| matches!(object.geometry, Geometry::Volume(_))), 1);
    assert!(TOOLS.iter().all(|&tool| Tool::of(&scene.objects[tool.0 as usize]).is_some()));
    assert!(scene.objects[SKULL.0 as usize].geometry.as_volume().is_some());
    assert_eq!(head().structures[0].form, Form::Sheet);
    let rests = Theatre::new(Step::Incision, ExecutorKind::Serial, 1);
    let before: Vec<Vec3> = (0..30).map(|id| rests.read(ObjectId(id), Object::center)).collect();
    // Nothing is in anybody's hands for the first half second, and nothing falls apart.
    let rests = rests.run(30);
    for id in FIRST_STRUCTURE.0..SKULL.0 {
        let moved = rests.read(ObjectId(id), Object::center).distance(before[id as usize]);
        assert!(moved < 0.003, "object {id} has moved by {moved} m");
    }
}

/// From the incision to the lifted flap, in one run: each step's script is the beginning of the next one's.
#[test]
fn an_operation() {
    let frames = |step| Operation::new(head(), Some(step)).frames();
    let theatre = Theatre::new(Step::Flap, ExecutorKind::Pipeline, 2);
    let before = theatre.read(SCALP, mass);
    let theatre = theatre.run(frames(Step::Incision));
    the_incision_gapes(&theatre, before);
    let before = theatre.read(SCALP, pins);
    let theatre = theatre.run(frames(Step::Retraction) - DRAWING);
    the_flap_is_scraped_off(&theatre, before);
    let theatre = theatre.run(frames(Step::Retraction));
    the_bone_is_bare(&theatre);
    let theatre = theatre.run(frames(Step::BurrHole));
    the_burr_hole_is_through(&theatre);
    let end = frames(Step::All);
    the_flap_is_lifted(&theatre.run(end));
}

/// The edges part by at least 1.5 mm by themselves; the scalp's mass stays what it was.
fn the_incision_gapes(theatre: &Theatre, before: f64) {
    let after = theatre.read(SCALP, mass);
    assert!((after / before - 1.0).abs() < 1e-5, "{before} kg became {after} kg");
    let gaps = theatre.read(SCALP, gaps);
    assert!(gaps.len() > 12, "{} nodes were parted along 90 mm", gaps.len());
    let half = gaps[gaps.len() / 2];
    assert!(half > 0.001_5, "half of the edges are less than {half} m apart: {gaps:?}");
}

/// Before it is drawn aside, it is free: tissue that is drawn would tear off by itself in the end.
fn the_flap_is_scraped_off(theatre: &Theatre, before: usize) {
    let left = theatre.read(SCALP, pins);
    assert!(left + 40 < before, "{left} of {before} nodes are still held");
}

/// Drawn aside, the flap leaves a wound at least 15 mm wide, and both tools hold scalp.
fn the_bone_is_bare(theatre: &Theatre) {
    let gaps = theatre.read(SCALP, gaps);
    assert!(gaps[0] > 0.015, "the widest gap is {} m", gaps[0]);
    let held =
        |tool| theatre.read(SCALP, |scalp| Tissue::of(scalp).expect("tissue").held_nodes(tool));
    let held = TOOLS.map(held);
    assert!(held.iter().all(|&nodes| nodes > 0), "the tools hold {held:?} nodes");
}

/// The perforator stopped by itself within 1 mm of the inner table, and the hole is through.
fn the_burr_hole_is_through(theatre: &Theatre) {
    let entry = head().plan.burr_hole;
    let plunge = theatre.report().plunge;
    assert!(plunge < 0.001, "the perforator came {plunge} m past the inner table");
    let open = theatre.read(SKULL, |skull| {
        let volume = skull.geometry.as_volume().expect("bone");
        let depths = (0..=14).map(|step| step as f32 * 0.5e-3);
        let along = depths.filter(|&depth| depth < entry.thickness);
        along.map(|depth| volume.density_at(entry.point + entry.inward * depth)).fold(0.0, f32::max)
    });
    assert!(open < 0.5, "there is still bone of density {open} in the hole");
    let turns = theatre.read(TOOLS[0], |tool| Tool::of(tool).expect("a tool").work().turns);
    assert!(!turns && theatre.freed.is_empty());
}

/// The flap came free once, as an object of its own, and no bone was lost or made on the way.
fn the_flap_is_lifted(theatre: &Theatre) {
    let head = head();
    assert_eq!(theatre.freed.len(), 1, "freed before frames {:?}", theatre.freed);
    let lifted = theatre.read(PIECE, |piece| {
        let behavior: &dyn Any = &*piece.behavior;
        assert!(!behavior.downcast_ref::<Piece>().expect("a piece").is_seated());
        (piece.center() - head.plan.middle.point).dot(-head.plan.middle.inward)
    });
    assert!(lifted > 0.02, "the flap is {lifted} m above its place");
    let full = |id: ObjectId| {
        theatre.read(id, |object| {
            let densities = object.geometry.as_volume().expect("bone").densities();
            densities.map(u64::from).sum::<u64>()
        })
    };
    let removed = |id: ObjectId| {
        theatre.read(id, |object| {
            let behavior: &dyn Any = &*object.behavior;
            let bone = behavior.downcast_ref::<Bone>().map(Bone::removed);
            bone.or(behavior.downcast_ref::<Piece>().map(Piece::removed)).expect("bone")
        })
    };
    let before: u64 = head.skull.densities().map(u64::from).sum();
    let after = full(SKULL) + full(PIECE) + removed(SKULL) + removed(PIECE);
    assert_eq!(after, before);
    assert!(full(PIECE) > 255 * 8 * 5_000, "the flap is less than 5 cm³");
    as_planned(&theatre.report());
}

/// Hands that follow the plan are where it says.
fn as_planned(report: &Report) {
    let margin = report.margin.expect("the flap has an edge");
    assert!(margin.mean < 0.000_5 && margin.greatest < 0.001_5, "{margin:?}");
    assert!(margin.cut > 0.95, "{margin:?}");
    let hole = report.burr_hole.expect("a hole was drilled");
    assert!(hole.error < 0.001 && hole.angle < 0.01, "{hole:?}");
    assert!(report.bone_outside_plan < 5e-9, "{} m³", report.bone_outside_plan);
    assert_eq!(report.dural_tears, 0);
}

#[test]
fn every_executor_does_the_same() {
    // To the middle of the incision.
    let hash = |executor, threads| {
        let theatre = Theatre::new(Step::Incision, executor, threads).run(150);
        theatre.manager.state_hash()
    };
    let expected = hash(ExecutorKind::Serial, 1);
    for &executor in ExecutorKind::ALL {
        for threads in [1, 2, 4] {
            let found = hash(executor, threads);
            assert_eq!(found, expected, "{} on {threads} threads", executor.name());
        }
    }
}

#[test]
fn nobody_moves_the_hands_without_a_step() {
    let mut operation = Operation::new(head(), None);
    assert_eq!(operation.frames(), 0);
    let mut manager = Theatre::new(Step::All, ExecutorKind::Serial, 1).manager;
    let mailbox = manager.mailbox();
    let mut renderer = NullRenderer::new();
    let (hands, mut watch) = operation.parts(&mut renderer);
    manager
        .run(10, &mut watch, &mut |record| hands.swapped(record.frame, &mailbox))
        .expect("no table is full");
    let mut instruments = Vec::new();
    manager.visit(&mut |object| instruments.extend(Tool::of(object).map(Tool::instrument)));
    assert_eq!(instruments, [Instrument::Forceps; 2]);
}
