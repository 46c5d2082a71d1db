//! What a host does to tissue as tools do, recorded and replayed.

use dualframe_sim::behavior::tissue::{Cut, Material, Pin, Scrape, Tissue};
use dualframe_sim::behavior::{Grasp, Hold, LetGo};
use dualframe_sim::executor::{ExecutorKind, OnFrame};
use dualframe_sim::geometry::{Blade, Geometry};
use dualframe_sim::interaction::Rules;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::record::wire::{Decoder, Encoder, Malformed};
use dualframe_sim::record::{Header, Recorder, Replay, SceneSpec, Step};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;

/// Nodes a side.
const SIDE: u32 = 8;
/// The length of an edge, in metres.
const EDGE: f32 = 5e-3;
const FRAMES: u64 = 130;

/// A flat patch, pinned along one side, that hangs.
struct Patch;

impl SceneSpec for Patch {
    const KIND: &'static str = "patch";

    fn encode(&self, _: &mut Encoder<'_>) {}

    fn decode(_: &mut Decoder<'_>) -> Result<Self, Malformed> {
        Ok(Self)
    }
}

impl Patch {
    fn build(&self) -> Scene {
        let numbers = || (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (column, row)));
        let rest: Vec<Vec3> = numbers().map(|(x, y)| place(x as f32, y as f32)).collect();
        let corner = |(column, row): (u32, u32)| row * SIDE + column;
        let squares = numbers().filter(|&(column, row)| column < SIDE - 1 && row < SIDE - 1);
        let triangles = squares.flat_map(|square| {
            let a = corner(square);
            [[a, a + 1, a + SIDE], [a + 1, a + SIDE + 1, a + SIDE]]
        });
        let (stiffness, bending, to_center, damping, area_density) = (4e3, 80.0, 0.0, 2.0, 5.0);
        let material = Material { stiffness, bending, to_center, damping, area_density };
        let (mesh, tissue) =
            Tissue::new(&rest, triangles.collect(), material, 1e-3, 4).expect("a valid patch");
        let pin = |node: u32| Pin {
            node,
            point: rest[node as usize],
            stiffness: f32::INFINITY,
            strength: f32::INFINITY,
        };
        let tissue = tissue.with_pins((0..SIDE).map(pin).collect()).expect("valid pins");
        let object = Object::new(ObjectId(0), Group(0), Geometry::Mesh(mesh), tissue);
        let (rules, gravity) = (Rules::new(), Vec3::NEG_Z * 9.81);
        let (time_step, simd) = (1.0 / 60.0, Simd::detect());
        let stages = Stages { rules, time_step, gravity, callback_budget: None, simd };
        Scene::new(vec![object], stages)
    }

    fn manage(scene: Scene, executor: ExecutorKind) -> VeManager {
        let settings = Settings { executor, threads: 2, ..Settings::default() };
        VeManager::new(scene, settings).expect("valid settings")
    }
}

/// A place of the patch at rest, counted in edges.
fn place(column: f32, row: f32) -> Vec3 {
    Vec3::new(column, row, 0.0) * EDGE
}

/// What is told before a frame, if anything.
fn told(frame: u64) -> Option<Message> {
    let by = ObjectId(99);
    let blade = |row: f32| Blade {
        tip: place(3.5, row) - Vec3::Z * 0.05,
        heel: place(3.5, row) + Vec3::Z * 0.05,
    };
    let custom: Box<dyn Custom> = match frame {
        0 => Box::new(Grasp {
            by,
            point: place(7.0, 7.0),
            radius: 0.02,
            stiffness: 300.0,
            strength: f32::INFINITY,
        }),
        1..40 => {
            let position = place(7.0, 7.0) + Vec3::Z * (1e-3 * frame as f32);
            Box::new(Hold { by, position })
        }
        40..60 => {
            let row = |frame: u64| 9.0 - 0.5 * (frame - 40) as f32;
            Box::new(Cut { by, before: blade(row(frame)), now: blade(row(frame + 1)) })
        }
        70 => Box::new(Scrape { center: place(0.0, 0.0), radius: 0.012 }),
        90 => Box::new(LetGo { by }),
        _ => return None,
    };
    Some(Message::Custom(custom))
}

#[test]
fn what_a_host_does_to_tissue_is_recorded() {
    let mut manager = Patch::manage(Patch.build(), ExecutorKind::Pipeline);
    let mut recorder =
        Recorder::begin(Vec::new(), &Header::of(&Patch), &manager).expect("it can be recorded");
    let mailbox = manager.mailbox();
    let mut posted = 0;
    let on_frame: &mut OnFrame<'_> = &mut |record| {
        if let Some(message) = told(record.frame) {
            mailbox.post(ObjectId(0), message);
            posted += 1;
        }
    };
    recorder
        .run(&mut manager, FRAMES, &mut NullRenderer::new(), on_frame)
        .expect("all of it can be recorded");
    let (file, totals) = recorder.finish(&manager).expect("it is written");
    assert_eq!((posted, totals.letters), (62, 62));
    assert!(manager.quarantined().is_empty());

    for executor in [ExecutorKind::Pipeline, ExecutorKind::Serial] {
        let mut replay = Replay::new(&file[..]).expect("a recording");
        let mut scene = replay.header().scene::<Patch>().expect("a patch").build();
        replay.begin(&mut scene);
        let mut played = Patch::manage(scene, executor);
        let mut advance =
            || replay.advance(&mut played, 1_000, &mut NullRenderer::new(), &mut |_| ());
        while advance().expect("it is the same") != Step::Over {}
        assert_eq!(replay.letters(), totals.letters);
        assert_eq!(played.state_hash(), manager.state_hash(), "{executor:?}");
    }
    assert!(nodes(&manager) > (SIDE * SIDE) as usize, "nothing was cut");
    // What is left out of the five is missed.
    for missing in [0..1, 1..40, 40..60, 70..71, 90..91] {
        let mut other = Patch::manage(Patch.build(), ExecutorKind::Serial);
        let mailbox = other.mailbox();
        let on_frame: &mut OnFrame<'_> = &mut |record| {
            let told = told(record.frame).filter(|_| !missing.contains(&record.frame));
            told.into_iter().for_each(|message| mailbox.post(ObjectId(0), message));
        };
        other.run(FRAMES, &mut NullRenderer::new(), on_frame).expect("it runs");
        assert_ne!(other.state_hash(), manager.state_hash(), "without {missing:?}");
    }
}

fn nodes(manager: &VeManager) -> usize {
    let mut nodes = 0;
    manager.visit(&mut |object| {
        nodes += object.geometry.as_mesh().map_or(0, |mesh| mesh.positions.len());
    });
    nodes
}
