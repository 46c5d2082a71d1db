//! A scene of one's own, drawn without a window: a soft ball falls on a step and off it. Its colours say how far its
//! springs are stretched or pressed.
//!
//! `own_picture FOLDER` writes a picture of every 12th frame there.

use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Coloring, Look, Quality};
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::behavior::{Fixed, MassSpring};
use dualframe_sim::geometry::{Bounds, Geometry, Mesh, Rigid, Topology, edges, icosphere};
use dualframe_sim::interaction::{InteractionPair, NodesInShape, Penalty, Rules};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::{Group, Object, ObjectId, VisualProperties};
use dualframe_sim::scene::Scene;
use dualframe_sim::simd::Simd;
use dualframe_sim::stages::Stages;
use glam::Vec3;
use parry3d::{math::Pose, shape::SharedShape};

const SOFT: Group = Group(0);
const HARD: Group = Group(1);
const RADIUS: f32 = 0.1; // m
const NODE_MASS: f32 = 0.01; // kg
const STIFFNESS: f32 = 60.0; // N/m
const DAMPING: f32 = 0.02; // N s/m
const CORE: f32 = 300.0; // N/m, from each node to the middle
const STEP: Vec3 = Vec3::new(0.2, 0.05, 0.2); // m, half of its edges
const PICTURES: u64 = 8;
const FRAMES: u64 = 12; // from one picture to the next

fn soft_ball(id: ObjectId, center: Vec3) -> Result<Object, Box<dyn Error>> {
    let (nodes, triangles) = icosphere(RADIUS);
    let edges = edges(&triangles);
    let topology = Arc::new(Topology::new(&nodes, triangles, &edges, true)?);
    let masses = vec![NODE_MASS; nodes.len()];
    let nodes: Vec<Vec3> = nodes.into_iter().map(|node| center + node).collect();
    let mesh = Mesh::new(topology, &nodes, &masses, 0.0)?;
    let springs = MassSpring::new(STIFFNESS, DAMPING, 4)?.with_center_stiffness(CORE)?;
    Ok(Object::new(id, SOFT, Geometry::Mesh(mesh), springs))
}

fn scene() -> Result<Scene, Box<dyn Error>> {
    let cuboid = SharedShape::cuboid(STEP.x, STEP.y, STEP.z);
    let step = Rigid::new(cuboid, Pose::from_translation(Vec3::new(-0.15, STEP.y, 0.0)));
    let mut step = Object::new(ObjectId(1), HARD, Geometry::Rigid(step), Fixed);
    step.visual = VisualProperties { color: [0.15, 0.3, 0.5, 1.0] };
    let floor = Rigid::wall(Vec3::ZERO, Vec3::Y);
    let objects = vec![
        soft_ball(ObjectId(0), Vec3::new(0.03, 0.4, 0.0))?,
        step,
        Object::new(ObjectId(2), HARD, Geometry::Rigid(floor), Fixed),
    ];
    let (detection, response) = (Box::new(NodesInShape), Box::new(Penalty::new(200.0, 0.2, 0.3)?));
    let mut rules = Rules::new();
    rules.model(SOFT, HARD, InteractionPair { detection, response })?;
    let (time_step, gravity) = (1.0 / 240.0, Vec3::new(0.0, -9.81, 0.0));
    let stages = Stages { rules, time_step, gravity, callback_budget: None, simd: Simd::detect() };
    Ok(Scene::new(objects, stages))
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("own_picture FOLDER")?);
    fs::create_dir_all(&folder)?;
    let mut manager = VeManager::new(scene()?, Settings { threads: 2, ..Settings::default() })?;
    let room = Bounds { min: Vec3::new(-0.4, 0.0, -0.3), max: Vec3::new(0.3, 0.4, 0.3) };
    let look = Look { coloring: Coloring::Strain, ..Look::room(room) };
    let mut renderer = Offscreen::new(Gpu::new(None)?, look, Quality::Fine, (640, 360))?;
    for picture in 1..=PICTURES {
        manager.run(FRAMES, &mut renderer, &mut |_| ())?;
        renderer.picture()?.save(&folder.join(format!("{picture}.png")))?;
    }
    match manager.quarantined().first() {
        None => Ok(()),
        Some((id, fault)) => Err(format!("{id} was excluded: {fault:?}").into()),
    }
}
