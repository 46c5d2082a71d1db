//! Whatever a callback does harms its own object at most.

mod common;

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{Acting, executors, hash_without, no_rules, particles, point, run, serial, springs};
use dualframe_sim::behavior::{Fixed, Input};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, Executor, PipelineExecutor};
use dualframe_sim::geometry::{Geometry, Mesh, Rigid, Topology};
use dualframe_sim::interaction::{
    Detection, InteractionPair, NodeSpheres, Penalty, Rules, Touches,
};
use dualframe_sim::message::{Custom, Message};
use dualframe_sim::object::{FaultKind, Group, Object, ObjectId};
use dualframe_sim::pool::Pool;
use dualframe_sim::scene::Scene;
use glam::{Quat, Vec3};
use parry3d::bounding_volume::{Aabb, BoundingSphere};
use parry3d::mass_properties::MassProperties;
use parry3d::math::Pose;
use parry3d::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use parry3d::shape::{Ball, FeatureId, Shape, ShapeType, SharedShape, TypedShape};

/// More than have a block each.
const CROWD: usize = 100;
/// The particle that misbehaves, on its way to the crowd of the others.
const CULPRIT: ObjectId = ObjectId(CROWD as u32 - 1);
/// When it does: before it touches anybody.
const FATAL_FRAME: u64 = 7;
const FRAMES: u64 = 100;

/// Particles without walls; the culprit, apart from the others and flying at them, is itself but for
/// what `worst` does to it in the fatal frame.
fn crowd(worst: fn(&mut Geometry)) -> Scene {
    let mut scene = particles(CROWD, false, true);
    scene.objects.truncate(CROWD);
    let culprit = &mut scene.objects[CULPRIT.0 as usize];
    let mesh = culprit.geometry.as_mesh_mut().expect("a particle is a mesh");
    let away = Vec3::X * 0.9 - mesh.center();
    for node in 0..mesh.positions.len() {
        mesh.positions.add(node, away);
    }
    mesh.set_velocity(Vec3::X * -2.0);
    let mut inner = std::mem::replace(&mut culprit.behavior, Box::new(Fixed));
    culprit.behavior = Box::new(Acting(move |geometry: &mut Geometry, input: &mut Input<'_>| {
        inner.update(geometry, input);
        if input.frame == FATAL_FRAME {
            worst(geometry);
        }
    }));
    culprit.refit();
    scene
}

/// The others' state after a run in which the culprit never interacts.
fn hash_of_absence() -> u64 {
    let mut scene = crowd(|_| {});
    let culprit = scene.objects.pop().expect("the culprit is the last");
    scene.objects.push(culprit.solitary());
    let mut executor = serial(scene);
    run(&mut executor, FRAMES);
    hash_without(&executor, CULPRIT)
}

fn quarantined(executor: &dyn Executor) -> Vec<(ObjectId, FaultKind, u64)> {
    let mut list = Vec::new();
    executor.visit(&mut |object| {
        list.extend(object.quarantined().map(|fault| (object.id(), fault.kind, fault.frame)));
    });
    list.sort_unstable_by_key(|&(id, ..)| id);
    list
}

fn only_the_culprit_goes(worst: fn(&mut Geometry), kind: FaultKind) {
    let expected = hash_of_absence();
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for (name, mut executor) in executors(|| crowd(worst), grain, 2) {
            let (_, _, renderer) = run(&mut *executor, FRAMES);
            assert_eq!(quarantined(&*executor), [(CULPRIT, kind, FATAL_FRAME)], "{name}");
            assert_eq!(hash_without(&*executor, CULPRIT), expected, "{name}");
            assert_eq!(renderer.draws(), (CROWD as u64 - 1) * FRAMES + FATAL_FRAME, "{name}");
        }
    }
}

#[test]
fn the_culprit_would_have_touched_the_others() {
    let mut executor = serial(crowd(|_| {}));
    run(&mut executor, FRAMES);
    assert_ne!(hash_without(&executor, CULPRIT), hash_of_absence());
    assert_eq!(quarantined(&executor), []);
}

#[test]
fn a_panic() {
    only_the_culprit_goes(|_| panic!("on purpose"), FaultKind::Panicked);
}

/// A ball that no box can be had of.
#[derive(Clone)]
struct Boxless(Ball);

impl RayCast for Boxless {
    fn cast_local_ray_and_get_normal(
        &self,
        ray: &Ray,
        most: f32,
        solid: bool,
    ) -> Option<RayIntersection> {
        self.0.cast_local_ray_and_get_normal(ray, most, solid)
    }
}

impl PointQuery for Boxless {
    fn project_local_point(&self, point: Vec3, solid: bool) -> PointProjection {
        self.0.project_local_point(point, solid)
    }

    fn project_local_point_and_get_feature(&self, point: Vec3) -> (PointProjection, FeatureId) {
        self.0.project_local_point_and_get_feature(point)
    }
}

impl Shape for Boxless {
    fn compute_local_aabb(&self) -> Aabb {
        panic!("on purpose")
    }

    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.0.compute_local_bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    fn scale_dyn(&self, scale: Vec3, parts: u32) -> Option<Box<dyn Shape>> {
        self.0.scale_dyn(scale, parts)
    }

    fn mass_properties(&self, density: f32) -> MassProperties {
        self.0.mass_properties(density)
    }

    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }

    fn ccd_thickness(&self) -> f32 {
        self.0.ccd_thickness()
    }

    fn ccd_angular_thickness(&self) -> f32 {
        self.0.ccd_angular_thickness()
    }
}

fn boxless() -> Geometry {
    Geometry::Rigid(Rigid::new(SharedShape::new(Boxless(Ball::new(0.1))), Pose::IDENTITY))
}

/// A host's own shape is asked for its box after the update, and that may panic, too.
#[test]
fn a_shapes_panic() {
    only_the_culprit_goes(|geometry| *geometry = boxless(), FaultKind::Panicked);
}

/// Whoever takes over the objects, or forms blocks of them anew, asks for their boxes.
#[test]
fn a_shapes_panic_between_runs() {
    let from_the_start = || {
        let mut scene = crowd(|_| {});
        scene.objects[CULPRIT.0 as usize] = Object::new(CULPRIT, Group(0), boxless(), Fixed);
        scene
    };
    let in_a_run = || crowd(|geometry| *geometry = boxless());
    let scenes: [(&dyn Fn() -> Scene, u64); 2] = [(&from_the_start, 0), (&in_a_run, FATAL_FRAME)];
    for (scene, frame) in scenes {
        let expected = [(CULPRIT, FaultKind::Panicked, frame)];
        for (name, mut executor) in executors(scene, Grain::Spatial, 2) {
            run(&mut *executor, FATAL_FRAME + 1);
            let mut next = serial(executor.into_scene());
            run(&mut next, 1);
            assert_eq!(quarantined(&next), expected, "after {name}");
        }
        let pool = Arc::new(Pool::new(1, false));
        let (grain, entry) = (Grain::Spatial, Entry::default());
        let executor = PipelineExecutor::new(scene(), grain, entry, Arc::clone(&pool));
        let mut executor = executor.map_err(|refused| refused.to_string()).expect("a valid scene");
        run(&mut executor, FATAL_FRAME + 1);
        // More threads than blocks were formed for.
        pool.resize(8);
        run(&mut executor, 1);
        assert_eq!(quarantined(&executor), expected);
    }
}

#[test]
fn a_nan() {
    let worst = |geometry: &mut Geometry| {
        let mesh = geometry.as_mesh_mut().expect("a particle is a mesh");
        mesh.velocities.set(41, Vec3::new(0.0, f32::NAN, 0.0));
    };
    only_the_culprit_goes(worst, FaultKind::NonFinite);
}

#[test]
fn an_infinity() {
    let worst = |geometry: &mut Geometry| {
        let mesh = geometry.as_mesh_mut().expect("a particle is a mesh");
        mesh.positions.set(0, Vec3::INFINITY);
    };
    only_the_culprit_goes(worst, FaultKind::NonFinite);
}

/// Scenery that nothing changes is looked at all the same.
#[test]
fn scenery_that_was_nowhere_from_the_start() {
    let nowhere = Pose::from_translation(Vec3::new(0.0, f32::NAN, 0.0));
    let ball = Geometry::Rigid(Rigid::new(SharedShape::ball(0.1), nowhere));
    let scenery = Object::new(ObjectId(0), Group(0), ball, Fixed);
    let mut executor = serial(Scene::new(vec![scenery], no_rules()));
    run(&mut executor, 1);
    let kinds: Vec<FaultKind> = quarantined(&executor).iter().map(|entry| entry.1).collect();
    assert_eq!(kinds, [FaultKind::NonFinite]);
}

#[test]
fn told_to_leave() {
    let expected = hash_of_absence();
    for (name, mut executor) in executors(|| crowd(|_| {}), Grain::Spatial, 2) {
        run(&mut *executor, FATAL_FRAME);
        executor.mailbox().post(CULPRIT, Message::Remove);
        run(&mut *executor, FRAMES - FATAL_FRAME);
        let gone = [(CULPRIT, FaultKind::Removed, FATAL_FRAME)];
        assert_eq!(quarantined(&*executor), gone, "{name}");
        assert_eq!(hash_without(&*executor, CULPRIT), expected, "{name}");
    }
}

#[test]
fn an_update_over_budget() {
    let budget = Duration::from_millis(1);
    let slow = move |_: &mut Geometry, input: &mut Input<'_>| {
        let began = Instant::now();
        while input.frame == FATAL_FRAME && began.elapsed() <= budget {
            std::hint::spin_loop();
        }
    };
    let quarantined_with = |budget| {
        let mut stages = no_rules();
        stages.callback_budget = budget;
        let mut executor = serial(Scene::new(vec![point(0, Acting(slow))], stages));
        run(&mut executor, FATAL_FRAME + 1);
        quarantined(&executor)
    };
    // A busy machine may make an earlier update late, so the frame is not part of the claim.
    let kinds: Vec<FaultKind> =
        quarantined_with(Some(budget)).iter().map(|entry| entry.1).collect();
    assert_eq!(kinds, [FaultKind::OverBudget]);
    assert_eq!(quarantined_with(Some(Duration::from_secs(3_600))), []);
    assert_eq!(quarantined_with(None), []);
}

/// Springs that could wait for those of others have a budget of their own as well.
#[test]
fn a_body_on_springs_over_budget() {
    let quarantined_with = |budget| {
        let mut stages = no_rules();
        stages.callback_budget = Some(budget);
        let mut executor = serial(Scene::new(vec![point(0, springs(1.0))], stages));
        run(&mut executor, 1);
        quarantined(&executor).len()
    };
    assert_eq!(quarantined_with(Duration::ZERO), 1, "it takes some time");
    assert_eq!(quarantined_with(Duration::from_secs(3_600)), 0);
}

/// Panics for the pair of objects 0 and 1.
struct Fragile;

impl Detection for Fragile {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        assert!((first.id(), second.id()) != (ObjectId(0), ObjectId(1)), "on purpose");
        NodeSpheres::default().detect(first, second, touches);
    }
}

#[test]
fn a_panic_in_an_interaction_takes_both() {
    let scene = || {
        let mut rules = Rules::new();
        let response = Penalty::new(1.0, 0.0, 0.0).expect("a stiffness");
        let pair = InteractionPair { detection: Box::new(Fragile), response: Box::new(response) };
        rules.model(Group(0), Group(0), pair).expect("the first rule");
        let mut stages = no_rules();
        stages.rules = rules;
        Scene::new((0..3).map(|id| point(id, common::springs(1.0))).collect(), stages)
    };
    for (name, mut executor) in executors(scene, Grain::Spatial, 2) {
        let (counts, ..) = run(&mut *executor, 2);
        let both = [0, 1].map(|id| (ObjectId(id), FaultKind::Panicked, 0));
        assert_eq!(quarantined(&*executor), both, "{name}");
        let candidates: Vec<u64> = counts.iter().map(|count| count.candidates).collect();
        assert_eq!(candidates, [3, 0], "{name}");
    }
}

fn rest(_: &mut Geometry, _: &mut Input<'_>) {}

/// Puts an object like the receiver in its place.
#[derive(Debug)]
struct Revive;

impl Custom for Revive {
    fn process(&self, object: &mut Object) {
        let (id, group, geometry) = (object.id(), object.group(), object.geometry.clone());
        *object = Object::new(id, group, geometry, common::springs(1.0));
    }
}

#[test]
fn who_has_left_does_not_come_back() {
    for (name, mut executor) in executors(|| crowd(|_| {}), Grain::Spatial, 2) {
        for message in [Message::Remove, Message::Custom(Box::new(Revive))] {
            executor.mailbox().post(CULPRIT, message);
        }
        run(&mut *executor, 2);
        assert_eq!(quarantined(&*executor), [(CULPRIT, FaultKind::Removed, 0)], "{name}");
    }
}

#[test]
fn a_box_that_is_no_box_harms_nobody() {
    // Finite numbers of which no box can be made, and others that are not finite from the start.
    let mut huge = Pose::identity();
    huge.rotation = Quat::from_xyzw(1e30, 1e30, 1e30, 1e30);
    for pose in [huge, Pose::from_translation(Vec3::NAN), Pose::from_translation(Vec3::X * 3e38)] {
        let scene = |with: bool| {
            let mut scene = particles(CROWD, true, true);
            let rigid = Rigid::new(SharedShape::cuboid(1e38, 0.1, 0.1), pose);
            let id = ObjectId(scene.objects.len() as u32);
            let object = Object::new(id, Group(1), Geometry::Rigid(rigid), Acting(rest));
            scene.objects.push(if with { object } else { object.solitary() });
            scene
        };
        let mut alone = serial(scene(false));
        let expected = run(&mut alone, FRAMES).0;
        for grain in [Grain::Spatial, Grain::Pairwise] {
            for (name, mut executor) in executors(|| scene(true), grain, 2) {
                assert_eq!(run(&mut *executor, FRAMES).0, expected, "{name}, {grain:?}, {pose:?}");
                let gone = [(ObjectId(106), FaultKind::NonFinite, 0)];
                assert_eq!(quarantined(&*executor), gone, "{name}, {grain:?}, {pose:?}");
            }
        }
    }
}

/// Gives the receiver a geometry.
struct Fill(Geometry);

impl fmt::Debug for Fill {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Fill")
    }
}

impl Custom for Fill {
    fn process(&self, object: &mut Object) {
        object.geometry = self.0.clone();
    }
}

#[test]
fn an_empty_box_may_be_filled() {
    let scene = || {
        let mut scene = particles(3, true, true);
        let nothing = Topology::new(&[], Vec::new(), &[], false).expect("no nodes");
        let mesh = Mesh::new(Arc::new(nothing), &[], &[], 0.1).expect("no masses");
        let id = ObjectId(scene.objects.len() as u32);
        scene.objects.push(Object::new(id, Group(0), Geometry::Mesh(mesh), Acting(rest)));
        scene
    };
    let mut expected = None;
    for grain in [Grain::Spatial, Grain::Pairwise] {
        for (name, mut executor) in executors(scene, grain, 2) {
            let fill = Fill(scene().objects[0].geometry.clone());
            executor.mailbox().post(ObjectId(9), Message::Custom(Box::new(fill)));
            let (counts, ..) = run(&mut *executor, 3);
            assert!(counts[2].candidates > counts[0].candidates, "{name}, {grain:?}: {counts:?}");
            assert_eq!(
                expected.get_or_insert_with(|| counts.clone()),
                &counts,
                "{name}, {grain:?}"
            );
        }
    }
}
