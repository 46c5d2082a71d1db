//! Single interactions.

mod common;

use std::sync::Arc;

use common::{no_rules, point, springs};
use dualframe_sim::behavior::Scripted;
use dualframe_sim::behavior::{Fixed, Keyframe};
use dualframe_sim::block::Block;
use dualframe_sim::geometry::{Geometry, Mesh, Rigid, Topology};
use dualframe_sim::interaction::{
    Compliant, Contact, ContactBuffer, Detection, InteractionPair, NodeSpheres, NodesInShape,
    Penalty, Response, Scratch, Segment,
};
use dualframe_sim::object::{Group, Object, ObjectId};
use dualframe_sim::stages::{PairCount, Stages};
use glam::{Quat, Vec3};
use parry3d::math::Pose;
use parry3d::shape::SharedShape;

const POINTS: Group = Group(0);
const SHAPES: Group = Group(1);

/// Stages in which groups interact by the detection, with 100 N/m and 1 s a frame.
fn stages(first: Group, second: Group, detection: impl Detection + 'static) -> Stages {
    let response = Penalty::new(100.0, 0.0, 0.0).expect("a stiffness");
    responding(first, second, detection, response)
}

/// Stages in which groups interact by the detection and the response, with 1 s a frame.
fn responding(
    first: Group,
    second: Group,
    detection: impl Detection + 'static,
    response: impl Response + 'static,
) -> Stages {
    let mut stages = no_rules();
    stages.time_step = 1.0;
    let pair = InteractionPair { detection: Box::new(detection), response: Box::new(response) };
    stages.rules.model(first, second, pair).expect("the first rule");
    stages
}

/// Two nodes of 1 kg, 1 m apart along the x axis about the origin.
fn rod() -> Object {
    let ends = [Vec3::X * -0.5, Vec3::X * 0.5];
    let topology = Topology::new(&ends, Vec::new(), &[], false).expect("a topology");
    let mesh = Mesh::new(Arc::new(topology), &ends, &[1.0; 2], 0.1).expect("a mesh");
    Object::new(ObjectId(0), POINTS, Geometry::Mesh(mesh), springs(1.0))
}

/// A point with a contact sphere of 0.1 m.
fn point_at(id: u32, position: Vec3) -> Object {
    let mut object = point(id, springs(1.0));
    let mesh = object.geometry.as_mesh_mut().expect("a point is a mesh");
    mesh.positions.set(0, position);
    object.refit();
    object
}

fn tool(id: u32, shape: SharedShape, center: Vec3) -> Object {
    let still = Keyframe { frame: 0, position: center, rotation: Quat::IDENTITY };
    let path = Scripted::new(vec![still]).expect("a keyframe");
    let geometry = Geometry::Rigid(Rigid::new(shape, Pose::from_translation(center)));
    Object::new(ObjectId(id), SHAPES, geometry, path)
}

/// What an object is told.
type Told = (ObjectId, Contact);

/// What two objects are told, a list for each segment.
fn interact(stages: &Stages, a: Object, b: Object) -> (Vec<Vec<Told>>, PairCount) {
    let (a, b) = (Block::new(vec![a]), Block::new(vec![b]));
    let mut buffer = ContactBuffer::default();
    let count = stages.interact(&a, &b, &mut Scratch::new(), &mut buffer);
    let told = |segment: Segment<'_>| {
        let object = segment.object();
        segment.contacts().map(|contact| (object, contact)).collect()
    };
    (Segment::all(buffer.records()).map(told).collect(), count)
}

#[track_caller]
fn assert_impulse((told, contact): &Told, object: u32, node: u32, impulse: Vec3) {
    assert_eq!((*told, contact.node), (ObjectId(object), node));
    let error = (Vec3::from_array(contact.impulse) - impulse).length();
    assert!(error < 1e-4, "{contact:?}, expected {impulse}");
}

#[test]
fn spheres_push_each_other_apart() {
    let stages = stages(POINTS, POINTS, NodeSpheres::default());
    for (first, second) in [(0, 1), (1, 0)] {
        let at = |id: u32| point_at(id, Vec3::X * 0.15 * id as f32);
        let (segments, count) = interact(&stages, at(first), at(second));
        assert_eq!(count, PairCount { candidates: 1, collisions: 1 });
        // 0.05 m deep.
        assert_impulse(&segments[0][0], 0, 0, Vec3::X * -5.0);
        assert_impulse(&segments[1][0], 1, 0, Vec3::X * 5.0);
        assert_eq!(segments.iter().map(Vec::len).sum::<usize>(), 2);
    }
}

#[test]
fn boxes_and_spheres_may_overlap_without_contact() {
    let stages = stages(POINTS, POINTS, NodeSpheres::default());
    let mut counts = Vec::new();
    for place in [Vec3::Y * 0.15, Vec3::new(0.68, 0.15, 0.15), Vec3::X * 0.75] {
        let (segments, count) = interact(&stages, rod(), point_at(1, place));
        assert_eq!((segments.len(), count.collisions), (0, 0), "{place}");
        counts.push(count.candidates);
    }
    // Both overlap; the boxes at a corner, where the spheres do not; neither.
    assert_eq!(counts, [1, 0, 0]);
}

#[test]
fn cores_touch_as_whole_bodies() {
    let stages = stages(POINTS, POINTS, NodeSpheres { core_radius: 0.08 });
    let (segments, _) = interact(&stages, point_at(0, Vec3::ZERO), point_at(1, Vec3::X * 0.15));
    assert_impulse(&segments[0][0], 0, Contact::BODY, Vec3::X * -1.0);
    assert_impulse(&segments[1][0], 1, Contact::BODY, Vec3::X * 1.0);
}

#[test]
fn cores_have_a_stiffness_of_their_own() {
    let response =
        Penalty::new(100.0, 0.0, 0.0).and_then(|penalty| penalty.with_body_stiffness(300.0));
    let detection = NodeSpheres { core_radius: 0.08 };
    let stages = responding(POINTS, POINTS, detection, response.expect("two stiffnesses"));
    let (segments, _) = interact(&stages, point_at(0, Vec3::ZERO), point_at(1, Vec3::X * 0.15));
    // The cores are 0.01 m deep, the nodes 0.05 m.
    assert_impulse(&segments[0][0], 0, Contact::BODY, Vec3::X * -3.0);
    assert_impulse(&segments[0][1], 0, 0, Vec3::X * -5.0);
}

/// A rod of 2 kg and a point of 1 kg part by the depth of 10 mm within the frame of 1 s.
#[test]
fn cores_are_pushed_apart_by_an_implicit_spring_too() {
    let response = Compliant::contact(1e9, 0.0).expect("a stiffness");
    let stages = responding(POINTS, POINTS, NodeSpheres { core_radius: 0.08 }, response);
    let (segments, _) = interact(&stages, rod(), point_at(1, Vec3::Y * 0.15));
    let impulse = Vec3::Y * (0.01 / (1.0 / 2.0 + 1.0));
    assert_impulse(&segments[0][0], 0, Contact::BODY, -impulse);
    assert_impulse(&segments[1][0], 1, Contact::BODY, impulse);
}

/// As fast as a body is as a whole, which is its nodes' mean, 4 of the 10 mm are gone without help.
#[test]
fn cores_that_part_already_are_pushed_less() {
    let response = Compliant::contact(1e9, 0.0).expect("a stiffness");
    let stages = responding(POINTS, POINTS, NodeSpheres { core_radius: 0.08 }, response);
    let mut leaving = rod();
    leaving.geometry.as_mesh_mut().expect("a mesh").set_velocity(Vec3::Y * -0.004);
    let (segments, _) = interact(&stages, leaving, point_at(1, Vec3::Y * 0.15));
    let impulse = Vec3::Y * (0.006 / (1.0 / 2.0 + 1.0));
    assert_impulse(&segments[0][0], 0, Contact::BODY, -impulse);
}

#[test]
fn walls_push_and_are_told_nothing() {
    let stages = stages(POINTS, SHAPES, NodesInShape);
    for normal in [Vec3::Y, Vec3::new(0.6, 0.8, 0.0)] {
        let geometry = Geometry::Rigid(Rigid::wall(Vec3::ZERO, normal));
        let wall = Object::new(ObjectId(0), SHAPES, geometry, Fixed);
        let (segments, _) = interact(&stages, wall, point_at(1, normal * 0.04));
        assert_eq!(segments.len(), 1);
        assert_impulse(&segments[0][0], 1, 0, normal * 6.0);
    }
}

#[test]
fn shapes_are_tested_exactly_and_told_the_sum() {
    let stages = stages(POINTS, SHAPES, NodesInShape);
    let cube = || tool(0, SharedShape::cuboid(0.5, 0.5, 0.5), Vec3::ZERO);
    let cases = [
        // Outside a face, inside it, and at an edge, where a box test would find more.
        (Vec3::Y * 0.56, Some(Vec3::Y * 4.0)),
        (Vec3::Y * 0.48, Some(Vec3::Y * 12.0)),
        (Vec3::new(0.53, 0.54, 0.0), Some(Vec3::new(3.0, 4.0, 0.0))),
        (Vec3::new(0.58, 0.58, 0.0), None),
    ];
    for (position, expected) in cases {
        let (segments, count) = interact(&stages, cube(), point_at(1, position));
        assert_eq!(count.candidates, 1);
        let Some(impulse) = expected else {
            assert!(segments.is_empty());
            continue;
        };
        assert_impulse(&segments[0][0], 1, 0, impulse);
        assert_impulse(&segments[1][0], 0, Contact::BODY, -impulse);
    }
}

/// A ball on a rod, as an instrument is: within it the other part's surface is none.
#[test]
fn parts_of_a_shape_do_not_hide_each_other() {
    let stages = stages(POINTS, SHAPES, NodesInShape);
    let lollipop = || {
        let rod = SharedShape::capsule(Vec3::Z * 0.75, Vec3::Z * 3.25, 0.75);
        let ball = (Pose::from_translation(Vec3::Z), SharedShape::ball(1.0));
        let shape = SharedShape::compound(vec![ball, (Pose::IDENTITY, rod)]);
        let mut tool = tool(0, shape, Vec3::ZERO);
        tool.geometry.as_rigid_mut().expect("a tool").pose.rotation = Quat::from_rotation_x(0.3);
        tool.refit();
        tool
    };
    let turned = |place: Vec3| Quat::from_rotation_x(0.3) * place;
    // The ball's surface is at 1 m, the rod's, which is within the ball here, at 0.75 m.
    for (place, depth) in [(0.88, 0.22), (0.87, 0.23), (0.75, 0.35), (0.7, 0.4), (1.05, 0.05)] {
        let node = turned(Vec3::new(place, 0.0, 1.0));
        let (segments, _) = interact(&stages, lollipop(), point_at(1, node));
        assert_impulse(&segments[0][0], 1, 0, turned(Vec3::X) * (100.0 * depth));
    }
    // Where only the rod is.
    for (place, depth) in [(0.8, 0.05), (0.7, 0.15)] {
        let node = turned(Vec3::new(place, 0.0, 2.5));
        let (segments, _) = interact(&stages, lollipop(), point_at(1, node));
        assert_impulse(&segments[0][0], 1, 0, turned(Vec3::X) * (100.0 * depth));
    }
}

#[test]
fn damping_never_pulls_and_friction_only_stops() {
    let mut stages = stages(POINTS, SHAPES, NodesInShape);
    let response = Penalty::new(100.0, 50.0, 0.5).expect("positive values");
    stages.rules = dualframe_sim::interaction::Rules::new();
    let pair = InteractionPair { detection: Box::new(NodesInShape), response: Box::new(response) };
    stages.rules.model(POINTS, SHAPES, pair).expect("the first rule");
    let push = |velocity: Vec3| {
        let mut object = point_at(1, Vec3::Y * 0.05);
        object.geometry.as_mesh_mut().expect("a mesh").set_velocity(velocity);
        let geometry = Geometry::Rigid(Rigid::wall(Vec3::ZERO, Vec3::Y));
        let wall = Object::new(ObjectId(0), SHAPES, geometry, Fixed);
        Vec3::from_array(interact(&stages, object, wall).0[0][0].1.impulse)
    };
    // 5 N by depth; 50 N s/m against the speed; half of that sideways, but no more than 1 kg needs.
    let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-4, "{a} {b}");
    near(push(Vec3::ZERO), Vec3::Y * 5.0);
    near(push(Vec3::Y * -0.1), Vec3::Y * 10.0);
    near(push(Vec3::Y * 1.0), Vec3::ZERO);
    near(push(Vec3::X * 9.0), Vec3::new(-2.5, 5.0, 0.0));
    near(push(Vec3::X * 2.0), Vec3::new(-2.0, 5.0, 0.0));
}

#[test]
fn friction_stops_two_nodes_on_each_other() {
    let mut stages = stages(POINTS, POINTS, NodeSpheres::default());
    let (detection, response) = (NodeSpheres::default(), Penalty::new(100.0, 0.0, 0.5));
    let response = Box::new(response.expect("positive values"));
    stages.rules = dualframe_sim::interaction::Rules::new();
    let pair = InteractionPair { detection: Box::new(detection), response };
    stages.rules.model(POINTS, POINTS, pair).expect("the first rule");
    let mut passing = point_at(0, Vec3::Y * 0.15);
    passing.geometry.as_mesh_mut().expect("a mesh").set_velocity(Vec3::X * 0.2);
    let (told, _) = interact(&stages, passing, point_at(1, Vec3::ZERO));
    // 5 N by depth, which would bear 2.5 N s; half of 0.2 m/s for each of two nodes of 1 kg.
    let impulse = Vec3::new(-0.1, 5.0, 0.0);
    assert_impulse(&told[0][0], 0, 0, impulse);
    assert_impulse(&told[1][0], 1, 0, -impulse);
}
