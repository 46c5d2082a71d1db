//! Particles under gravity come to rest in a pile.

mod common;

use std::sync::Arc;

use common::{particles, run};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, Executor, PipelineExecutor};
use dualframe_sim::object::ObjectId;
use dualframe_sim::pool::Pool;
use glam::Vec3;

fn centers(executor: &PipelineExecutor) -> Vec<Vec3> {
    let mut centers: Vec<(ObjectId, Vec3)> = Vec::new();
    executor.visit(&mut |object| {
        assert_eq!(object.quarantined(), None);
        if object.geometry.as_mesh().is_some() {
            centers.push((object.id(), object.center()));
        }
    });
    centers.sort_unstable_by_key(|&(id, _)| id);
    centers.into_iter().map(|(_, center)| center).collect()
}

/// The mean way of the centres over so many frames, in metres.
fn mean_motion(executor: &mut PipelineExecutor, frames: u64) -> f32 {
    let before = centers(executor);
    run(executor, frames);
    let after = centers(executor);
    let ways = before.iter().zip(&after).map(|(a, b)| a.distance(*b));
    ways.sum::<f32>() / before.len() as f32
}

fn least_distance(centers: &[Vec3]) -> f32 {
    let pairs =
        centers.iter().enumerate().flat_map(|(i, a)| centers[..i].iter().map(|b| a.distance(*b)));
    pairs.fold(f32::INFINITY, f32::min)
}

#[test]
fn three_hundred_settle_and_stay_finite_for_twenty_thousand_frames() {
    // On the pipeline: serially it would take minutes, and the bits are the same.
    let (scene, pool) = (particles(300, true, true), Arc::new(Pool::new(2, false)));
    let mut executor = PipelineExecutor::new(scene, Grain::Spatial, Entry::AfterUpdate, pool)
        .expect("the scene is allowed");
    run(&mut executor, 1_500);
    let settling = mean_motion(&mut executor, 100);
    assert!(settling < 2e-3, "they move {settling} m in 100 frames");
    run(&mut executor, 20_000 - 1_700);
    let motion = mean_motion(&mut executor, 100);
    assert_eq!(executor.frame(), 20_000);
    assert!(motion < 1e-4, "they move {motion} m in 100 frames");
    // At rest particles of 0.1 m touch at 0.2 to 0.26 m.
    let centers = centers(&executor);
    assert!(least_distance(&centers) > 0.18, "{} m", least_distance(&centers));
    let height = centers.iter().map(|center| center.y).sum::<f32>() / 300.0 + 1.2;
    assert!((0.15..0.4).contains(&height), "the pile's mean height is {height} m");
}
