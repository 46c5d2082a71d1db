//! A tool as each of its instruments.

use std::sync::Mutex;

use dualframe_sim::behavior::tissue::{Material, Pin, Tissue};
use dualframe_sim::behavior::{Bone, Felt, Fixed, Instrument, Tool, Workpieces};
use dualframe_sim::device::DeviceSample;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::Geometry;
use dualframe_sim::interaction::{BurrForce, BurrInBone, InteractionPair, Rules};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{Scene, bone_piece};
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;
use parry3d::math::Pose;

const TIME_STEP: f32 = 1.0 / 60.0;
const TOOL: ObjectId = ObjectId(0);
const OTHER: ObjectId = ObjectId(1);

/// A tool at a place, upright, and another object that it can work on.
fn manager(other: Object, at: Vec3, workpieces: Workpieces) -> VeManager {
    manager_of(vec![other], at, workpieces)
}

/// The same with several others.
fn manager_of(mut objects: Vec<Object>, at: Vec3, workpieces: Workpieces) -> VeManager {
    let (rigid, tool) = Tool::new(Instrument::Forceps, DeviceSample::at(at), workpieces);
    objects.push(Object::new(TOOL, Group(0), Geometry::Rigid(rigid), tool));
    let mut rules = Rules::new();
    let pair = InteractionPair { detection: Box::new(BurrInBone), response: Box::new(BurrForce) };
    rules.model(Group(0), Group(1), pair).expect("the groups exist");
    let (gravity, simd) = (Vec3::ZERO, Simd::detect());
    let stages = Stages { rules, time_step: TIME_STEP, gravity, callback_budget: None, simd };
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    VeManager::new(Scene::new(objects, stages), settings).expect("they are numbered")
}

fn run(manager: &mut VeManager, frames: u64) {
    manager.run(frames, &mut NullRenderer::new(), &mut |_| {}).expect("no table is full");
}

fn move_to(manager: &VeManager, position: Vec3, pressed: bool) {
    let sample = DeviceSample { buttons: u32::from(pressed), ..DeviceSample::at(position) };
    manager.mailbox().post(TOOL, Message::Device(sample));
}

fn take_up(manager: &VeManager, instrument: Instrument) {
    manager.mailbox().post(TOOL, Message::TakeUp(instrument));
}

/// Reads something off an object.
fn read<T>(manager: &VeManager, id: ObjectId, read: impl Fn(&Object) -> T) -> T {
    let found = Mutex::new(None);
    manager.visit(&mut |object| {
        if object.id() == id {
            *found.lock().expect("nobody panicked") = Some(read(object));
        }
    });
    found.into_inner().expect("nobody panicked").expect("the object is there")
}

fn tip(manager: &VeManager) -> Vec3 {
    read(manager, TOOL, |tool| tool.geometry.as_rigid().expect("a tool").pose.translation)
}

/// The middle of the bone piece's outer surface, and its thickness, in metres.
const OUTER: Vec3 = Vec3::new(0.032, 0.032, 0.044);
const THICKNESS: f32 = 0.007;

fn bone() -> (Object, Workpieces) {
    (bone_of(OTHER), Workpieces { bone: vec![OTHER], ..Workpieces::default() })
}

fn bone_of(id: ObjectId) -> Object {
    let volume = bone_piece(128, Pose::IDENTITY).expect("128 voxels are allowed");
    Object::new(id, Group(1), Geometry::Volume(volume), Bone::new())
}

/// What has been drilled away of a bone.
fn removed(manager: &VeManager, id: ObjectId) -> u64 {
    read(manager, id, |bone| {
        let behavior: &dyn std::any::Any = &*bone.behavior;
        behavior.downcast_ref::<Bone>().expect("bone").removed()
    })
}

#[test]
fn a_perforator_stops_at_the_inner_table() {
    let (bone, workpieces) = bone();
    let mut manager = manager(bone, OUTER + Vec3::Z * 0.005, workpieces);
    take_up(&manager, Instrument::Perforator);
    // The hand leans on it and would go on for centimetres.
    move_to(&manager, OUTER - Vec3::Z * 0.03, true);
    let mut seconds = 0;
    let turns = |manager: &VeManager| {
        read(manager, TOOL, |tool| Tool::of(tool).expect("a tool").work().turns)
    };
    run(&mut manager, 60);
    assert!(turns(&manager), "it turns when it is pressed on bone");
    while turns(&manager) {
        run(&mut manager, 60);
        seconds += 1;
        assert!(seconds < 60, "it drills for a minute");
    }
    let past = OUTER.z - THICKNESS - tip(&manager).z;
    assert!(
        (-0.0015..0.001).contains(&past),
        "it is {past} m past the inner table after {seconds} s"
    );
    // It stays there, and lets nothing be taken away.
    let before = removed(&manager, OTHER);
    run(&mut manager, 120);
    let later = OUTER.z - THICKNESS - tip(&manager).z;
    assert!(later < 0.001, "it is {later} m past the inner table after two seconds more");
    assert!(removed(&manager, OTHER) - before < 255 * 8, "it went on drilling");
    // Without the button nothing turns, in bone or in air.
    move_to(&manager, OUTER + Vec3::Z * 0.02, false);
    run(&mut manager, 120);
    assert!(!turns(&manager));
    assert!(tip(&manager).distance(OUTER + Vec3::Z * 0.02) < 1e-4);
}

#[test]
fn a_perforator_that_was_released_has_to_engage_anew() {
    let (bone, workpieces) = bone();
    let mut manager = manager(bone, OUTER + Vec3::Z * 0.005, workpieces);
    let turns = |manager: &VeManager| {
        read(manager, TOOL, |tool| Tool::of(tool).expect("a tool").work().turns)
    };
    take_up(&manager, Instrument::Perforator);
    move_to(&manager, OUTER - Vec3::Z * 0.03, true);
    run(&mut manager, 60);
    assert!(turns(&manager), "it turns when it is pressed on bone");
    let in_air = OUTER + Vec3::Z * 0.02;
    move_to(&manager, in_air, false);
    run(&mut manager, 120);
    move_to(&manager, in_air, true);
    for frame in 0..10 {
        run(&mut manager, 1);
        assert!(!turns(&manager), "it turns in the air, frame {frame}");
    }
}

#[test]
fn a_perforator_that_is_taken_up_again_has_to_engage_anew() {
    let (bone, workpieces) = bone();
    let mut manager = manager(bone, OUTER + Vec3::Z * 0.005, workpieces);
    let turns = |manager: &VeManager| {
        read(manager, TOOL, |tool| Tool::of(tool).expect("a tool").work().turns)
    };
    take_up(&manager, Instrument::Perforator);
    move_to(&manager, OUTER - Vec3::Z * 0.03, true);
    run(&mut manager, 60);
    assert!(turns(&manager), "it turns when it is pressed on bone");
    // The button stays pressed.
    take_up(&manager, Instrument::Scalpel);
    move_to(&manager, OUTER + Vec3::Z * 0.02, true);
    run(&mut manager, 120);
    take_up(&manager, Instrument::Perforator);
    for frame in 0..10 {
        run(&mut manager, 1);
        assert!(!turns(&manager), "it turns in the air, frame {frame}");
    }
}

#[test]
fn a_burr_drills_only_while_it_is_pressed() {
    let (bone, workpieces) = bone();
    let mut manager = manager(bone, OUTER + Vec3::Z * 0.005, workpieces);
    take_up(&manager, Instrument::Burr);
    let digest = |manager: &VeManager| {
        read(manager, OTHER, |bone| bone.geometry.as_volume().expect("bone").digest())
    };
    let whole = digest(&manager);
    move_to(&manager, OUTER - Vec3::Z * 0.004, false);
    run(&mut manager, 60);
    assert_eq!(digest(&manager), whole);
    let depth = OUTER.z - tip(&manager).z;
    assert!((0.0..0.001_5).contains(&depth), "it lies on the bone, {depth} m deep");
    move_to(&manager, OUTER - Vec3::Z * 0.004, true);
    run(&mut manager, 120);
    assert_ne!(digest(&manager), whole);
    assert!(OUTER.z - tip(&manager).z > 0.003);
}

#[test]
fn two_bones_under_one_bit_share_what_it_presses() {
    let drilled = |bones: &[ObjectId]| -> u64 {
        let workpieces = Workpieces { bone: bones.to_vec(), ..Workpieces::default() };
        let objects = bones.iter().copied().map(bone_of).collect();
        let mut manager = manager_of(objects, OUTER + Vec3::Z * 0.005, workpieces);
        take_up(&manager, Instrument::Burr);
        move_to(&manager, OUTER - Vec3::Z * 0.004, true);
        run(&mut manager, 60);
        bones.iter().map(|&bone| removed(&manager, bone)).sum()
    };
    let (alone, both) = (drilled(&[OTHER]), drilled(&[OTHER, ObjectId(2)]));
    // Twice as much if the hand pressed as hard on each of them.
    assert!(alone > 0 && both.abs_diff(alone) < alone / 4, "{both}, and {alone} of one");
}

/// A bit that turned does not turn on, or drill, as another instrument that is not pressed.
#[test]
fn a_switch_stops_the_bit() {
    let (bone, workpieces) = bone();
    let mut manager = manager(bone, OUTER + Vec3::Z * 0.005, workpieces);
    take_up(&manager, Instrument::Burr);
    move_to(&manager, OUTER - Vec3::Z * 0.004, true);
    run(&mut manager, 40);
    let before = removed(&manager, OTHER);
    assert!(before > 0);
    let felt = |manager: &VeManager| {
        read(manager, TOOL, |tool| Tool::of(tool).expect("a tool").work().bone)
    };
    assert!(felt(&manager).length() > 1.0);
    take_up(&manager, Instrument::Craniotome);
    move_to(&manager, OUTER - Vec3::Z * 0.004, false);
    // What was told before the switch is still done, but not felt.
    run(&mut manager, 1);
    assert_eq!(felt(&manager), Vec3::ZERO);
    let told = removed(&manager, OTHER);
    run(&mut manager, 10);
    assert_eq!(removed(&manager, OTHER), told);
}

/// A square patch of tissue at z = 0, 60 mm a side, pinned along its border.
fn patch() -> (Object, Workpieces) {
    const SIDE: u32 = 13;
    let place = |x: u32, y: u32| Vec3::new(x as f32, y as f32, 0.0) * 0.005;
    let node = |x: u32, y: u32| y * SIDE + x;
    let rest: Vec<_> = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| place(x, y))).collect();
    let squares = (0..SIDE - 1).flat_map(|y| (0..SIDE - 1).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [node(x, y), node(x + 1, y), node(x, y + 1), node(x + 1, y + 1)];
        [[a, b, d], [a, d, c]]
    });
    let material = Material {
        stiffness: 1_000.0,
        bending: 10.0,
        to_center: 0.0,
        damping: 5.0,
        area_density: 5.0,
    };
    let is_border =
        |node: u32| [node % SIDE, node / SIDE].iter().any(|&at| at == 0 || at == SIDE - 1);
    let pins = (0..SIDE * SIDE).filter(|&node| is_border(node)).map(|node| Pin {
        node,
        point: rest[node as usize],
        stiffness: 1_000.0,
        strength: f32::INFINITY,
    });
    let (mesh, tissue) =
        Tissue::new(&rest, triangles.collect(), material, 0.002, 16).expect("a sound patch");
    let tissue = tissue.with_pins(pins.collect()).expect("pins of its own nodes");
    let patch = Object::new(OTHER, Group(2), Geometry::Mesh(mesh), tissue);
    (patch, Workpieces { tissue: vec![OTHER], ..Workpieces::default() })
}

const MIDDLE: Vec3 = Vec3::new(0.03, 0.03, 0.0);

#[test]
fn a_scalpel_cuts_only_while_it_is_pressed() {
    for pressed in [false, true] {
        let (patch, workpieces) = patch();
        let deep = Vec3::Z * -0.004;
        let mut manager = manager(patch, MIDDLE + Vec3::new(-0.013, 0.001, 0.0) + deep, workpieces);
        take_up(&manager, Instrument::Scalpel);
        let nodes = |manager: &VeManager| {
            read(manager, OTHER, |patch| patch.geometry.as_mesh().expect("tissue").positions.len())
        };
        let whole = nodes(&manager);
        for step in 0..40 {
            let along = Vec3::new(-0.013 + 0.000_65 * step as f32, 0.001, 0.0);
            move_to(&manager, MIDDLE + along + deep, pressed);
            run(&mut manager, 1);
        }
        run(&mut manager, 4);
        assert_eq!(nodes(&manager) > whole, pressed);
    }
}

#[test]
fn a_scalpel_that_is_pressed_anew_begins_a_new_cut() {
    let (patch, workpieces) = patch();
    let deep = Vec3::Z * -0.004;
    let mut manager = manager(patch, MIDDLE + Vec3::new(-0.013, 0.001, 0.0) + deep, workpieces);
    take_up(&manager, Instrument::Scalpel);
    let within = |manager: &VeManager, way: f32| {
        read(manager, OTHER, |patch| {
            let rest = Tissue::of(patch).expect("tissue").rest();
            rest.iter().filter(|node| (node.x - MIDDLE.x).abs() < way).count()
        })
    };
    let [all, middle] = [1.0, 0.003].map(|way| within(&manager, way));
    for step in 0..40 {
        let along = -0.013 + 0.000_65 * step as f32;
        let is_between = along.abs() < 0.006;
        move_to(&manager, MIDDLE + Vec3::new(along, 0.001, 0.0) + deep, !is_between);
        run(&mut manager, 1);
    }
    run(&mut manager, 4);
    assert!(within(&manager, 1.0) > all, "nothing is cut");
    assert_eq!(within(&manager, 0.003), middle, "what is between the cuts is parted");
}

#[test]
fn forceps_hold_until_they_open_and_are_put_away() {
    for opens in [true, false] {
        let (patch, workpieces) = patch();
        let mut manager = manager(patch, MIDDLE, workpieces);
        move_to(&manager, MIDDLE, true);
        run(&mut manager, 3);
        let height = |manager: &VeManager| {
            read(manager, OTHER, |patch| {
                let mesh = patch.geometry.as_mesh().expect("tissue");
                mesh.positions.get(6 * 13 + 6).expect("the middle node").z
            })
        };
        for step in 1..=60 {
            move_to(&manager, MIDDLE + Vec3::Z * (0.000_15 * step as f32), true);
            run(&mut manager, 1);
        }
        let lifted = height(&manager);
        assert!(lifted > 0.004, "lifted by {lifted} m");
        let held = |manager: &VeManager| {
            read(manager, TOOL, |tool| Tool::of(tool).expect("a tool").work().held.length())
        };
        assert!(held(&manager) > 0.1, "{} N", held(&manager));
        if opens {
            move_to(&manager, MIDDLE + Vec3::Z * 0.009, false);
        } else {
            take_up(&manager, Instrument::Burr);
        }
        // Open forceps still held in the frame before; another instrument never did.
        run(&mut manager, 1);
        assert_eq!(held(&manager) > 0.0, opens);
        for _ in 0..239 {
            run(&mut manager, 1);
            assert_eq!(held(&manager), 0.0);
        }
        let left = height(&manager);
        assert!(left < 0.1 * lifted, "{left} m are left of {lifted} m");
    }
}

#[test]
fn an_elevator_frees_what_it_scrapes() {
    let (patch, workpieces) = patch();
    let mut manager = manager(patch, Vec3::ZERO, workpieces);
    take_up(&manager, Instrument::Elevator);
    let pins = |manager: &VeManager| {
        read(manager, OTHER, |patch| Tissue::of(patch).expect("tissue").pins().len())
    };
    let all = pins(&manager);
    move_to(&manager, Vec3::ZERO, false);
    run(&mut manager, 5);
    assert_eq!(pins(&manager), all);
    move_to(&manager, Vec3::ZERO, true);
    run(&mut manager, 5);
    assert_eq!(pins(&manager), all - 3);
}

#[test]
fn poses_that_are_no_numbers_are_ignored() {
    let (bone, workpieces) = bone();
    let mut manager = manager(bone, Vec3::ZERO, workpieces);
    move_to(&manager, Vec3::new(f32::NAN, 0.0, 0.0), true);
    run(&mut manager, 3);
    assert_eq!(tip(&manager), Vec3::ZERO);
    assert!(manager.quarantined().is_empty());
}

/// A block's copies for a renderer are used again for whoever comes to be in its place.
#[test]
fn a_copy_for_renderers_is_no_tool_once_it_is_of_something_else() {
    let (rigid, tool) =
        Tool::new(Instrument::Forceps, DeviceSample::at(Vec3::ZERO), Workpieces::default());
    let bare = Object::new(OTHER, Group(0), Geometry::Rigid(rigid.clone()), Fixed);
    let tool = Object::new(TOOL, Group(0), Geometry::Rigid(rigid), tool);
    let mut copy = bare.snapshot();
    assert!(Tool::of(&copy).is_none());
    tool.snapshot_into(&mut copy);
    assert!(Tool::of(&copy).is_some());
    bare.snapshot_into(&mut copy);
    assert!(Tool::of(&copy).is_none());
}

#[test]
fn what_tells_no_numbers_is_not_felt() {
    let (patch, workpieces) = patch();
    let mut manager = manager(patch, MIDDLE, workpieces);
    move_to(&manager, MIDDLE, true);
    run(&mut manager, 3);
    move_to(&manager, MIDDLE + Vec3::Z * 0.003, true);
    run(&mut manager, 3);
    let felt = Felt { held: Vec3::NAN, cuts: false };
    manager.mailbox().post(TOOL, Message::Custom(Box::new(felt)));
    run(&mut manager, 1);
    let held = read(&manager, TOOL, |tool| Tool::of(tool).expect("a tool").work().held);
    assert!(held.length() > 1e-3, "{held} N");
}
