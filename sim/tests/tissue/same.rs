//! The same bits however tissue is run, and hashes that show all of it.

use dualframe_sim::behavior::tissue::{Cut, Scrape, Tissue};
use dualframe_sim::behavior::{Grasp, Hold, Input, LetGo};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Executor, ExecutorKind};
use dualframe_sim::geometry::Geometry;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::ObjectId;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::Scene;
use glam::Vec3;

use crate::common::{Acting, point, run};
use crate::patch::*;

/// Three patches that a tool and the host do everything to.
fn operation() -> Scene {
    let mut objects = Vec::new();
    for id in 0..3 {
        let (mesh, tissue) = drum(9 + id as usize, 8 + 4 * id);
        objects.push(object(id, mesh, tissue));
    }
    let tool = |_: &mut Geometry, input: &mut Input<'_>| {
        let frame = input.frame as f32;
        let mut post = |to: u32, message: Box<dyn Custom>| {
            input.post(ObjectId(to), Message::Custom(message));
        };
        let at = |frame: f32| blade(5e-4 * frame, 0.013 + 2e-4 * frame);
        for patch in 0..2 {
            post(patch, Box::new(Cut { by: TOOL, before: at(frame), now: at(frame + 1.0) }));
        }
        let point = Vec3::new(0.02, 0.02, 0.0);
        if frame == 3.0 {
            let (stiffness, strength) = (300.0, 0.5);
            post(2, Box::new(Grasp { by: TOOL, point, radius: 7e-3, stiffness, strength }));
        }
        post(2, Box::new(Hold { by: TOOL, position: point + Vec3::Z * (4e-4 * frame) }));
        if frame == 50.0 {
            post(2, Box::new(LetGo { by: TOOL }));
            post(0, Box::new(Scrape { center: Vec3::ZERO, radius: 0.02 }));
        }
    };
    objects.push(point(3, Acting(tool)));
    scene(objects, Vec3::NEG_Z * GRAVITY)
}

#[test]
fn the_same_bits_for_every_executor_while_cuts_are_made() {
    let hashes = |executor: ExecutorKind, threads: usize, grain: Grain| {
        let settings = Settings { executor, threads, grain, ..Settings::default() };
        let mut manager = VeManager::new(operation(), settings).expect("a small scene");
        let mailbox = manager.mailbox();
        let mut hashes = Vec::new();
        for round in 0..4_u16 {
            // From outside too: a second blade, across the first one's cut.
            let at = |x: f32| blade(0.01 + x, 0.05 - 3.0 * x);
            let x = 4e-3 * f32::from(round);
            let cut = Cut { by: ObjectId::HOST, before: at(x), now: at(x + 4e-3) };
            mailbox.post(ObjectId(0), Message::Custom(Box::new(cut)));
            manager.run(20, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
            hashes.push(manager.state_hash());
        }
        assert_eq!(manager.quarantined(), []);
        let mut nodes = Vec::new();
        manager.visit(&mut |object| {
            nodes.extend(Tissue::of(object).map(|tissue| (object.id().0, tissue.rest().len())));
        });
        nodes.sort_unstable();
        (hashes, nodes)
    };
    let expected = hashes(ExecutorKind::Serial, 1, Grain::Spatial);
    assert!(expected.1[0].1 > 90 && expected.1[1].1 > 110, "cuts were made: {:?}", expected.1);
    for &executor in ExecutorKind::ALL {
        for threads in 1..=3 {
            for grain in [Grain::Spatial, Grain::Pairwise] {
                let result = hashes(executor, threads, grain);
                assert_eq!(result, expected, "{executor:?}, {threads} threads, {grain:?}");
            }
        }
    }
}

#[test]
fn a_hash_shows_everything_that_is_remembered() {
    let hash_of = |told: Option<Message>| {
        let (mesh, tissue) = drum(7, 8);
        let mut executor = alone(mesh, tissue, Vec3::ZERO);
        told.into_iter().for_each(|told| executor.mailbox().post(PATCH, told));
        run(&mut executor, 1).1
    };
    let hash = |told: Option<Box<dyn Custom>>| hash_of(told.map(Message::Custom));
    // None of these moves a node within the frame.
    let far = Vec3::X;
    let (stiffness, strength) = (1.0, 1.0);
    let held = Grasp { by: TOOL, point: far, radius: 0.0, stiffness, strength };
    let other = Grasp { by: ObjectId(98), ..held };
    let plain = hash(None);
    let all = [plain, hash(Some(Box::new(held))), hash(Some(Box::new(other)))];
    assert!(all[0] != all[1] && all[1] != all[2] && all[0] != all[2]);
    assert_eq!(plain, hash(None));
    let pinless = Scrape { center: lattice(7, EDGE).0[0] * 1.15, radius: 1e-6 };
    assert_ne!(hash(Some(Box::new(pinless))), plain);
    // Without gravity it weighs nothing either way.
    assert_ne!(hash_of(Some(Message::Weightless(true))), plain);
}
