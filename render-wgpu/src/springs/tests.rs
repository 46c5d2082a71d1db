use dualframe_sim::behavior::Springs;
use dualframe_sim::geometry::{Mesh, Topology};
use glam::Vec3;

use super::*;

/// A body of two nodes at the ends of a spring.
fn body() -> Mesh {
    let nodes = [Vec3::ZERO, Vec3::X];
    let topology = Topology::new(&nodes, Vec::new(), &[[0, 1]], false).expect("a topology");
    Mesh::new(Arc::new(topology), &nodes, &[1.0, 2.0], 0.1).expect("a mesh")
}

/// A slot into which `mesh` was put.
fn slot(mesh: &Mesh) -> Slot {
    let mut slot = Slot::default();
    let (stiffness, time) = (1.0, 0.01);
    let center_stiffness = 0.0;
    let gravity = [0.0; 3];
    let springs = Springs { damping: 0.0, stiffness, center_stiffness, gravity, time, substeps: 1 };
    slot.put(mesh, springs);
    slot
}

/// Two nodes' positions and velocities, all of them `value`.
fn outcome(value: f32) -> Vec<u8> {
    [value.to_ne_bytes(); 12].concat()
}

#[test]
fn an_outcome_counts_once_and_only_if_it_was_handed_over() {
    let mut mesh = body();
    let mut slot = slot(&mesh);
    assert!(!slot.hand_over(), "nothing is integrated yet");
    slot.receive(1, &outcome(3.0));
    assert!(!slot.take(&mut mesh), "it was not handed over");
    assert!(slot.hand_over());
    assert!(slot.take(&mut mesh));
    assert_eq!(mesh.positions.get(1), Some(Vec3::splat(3.0)));
    assert!(!slot.take(&mut mesh), "it was taken");
    slot.receive(1, &outcome(4.0));
    assert!(!slot.hand_over(), "the update took the last one");
}

#[test]
fn an_outcome_counts_for_its_own_turn_only() {
    let mut mesh = body();
    let mut slot = slot(&mesh);
    slot.receive(1, &outcome(3.0));
    assert!(slot.hand_over());
    let springs = slot.task.as_ref().expect("a task").springs;
    slot.put(&mesh, springs);
    assert!(!slot.hand_over() && !slot.take(&mut mesh), "the last turn's is stale");
    slot.receive(1, &outcome(3.0));
    assert!(!slot.hand_over(), "it comes too late");
    slot.receive(2, &outcome(5.0));
    assert!(slot.hand_over() && slot.take(&mut mesh));
}

#[test]
fn an_outcome_of_another_length_does_not_count() {
    let mesh = body();
    let mut slot = slot(&mesh);
    slot.receive(1, &outcome(3.0)[4..]);
    assert!(!slot.hand_over());
}

#[test]
fn what_somebody_changed_stays_changed() {
    let mut mesh = body();
    let slot = slot(&mesh);
    mesh.positions.add(0, Vec3::Y);
    let predicted: Vec<f32> = numbers(&mesh).flatten().copied().collect();
    assert!(!slot.restore(&mut mesh, &predicted));
    assert_eq!(mesh.positions, body().positions);
    mesh.positions.add(0, Vec3::Y);
    mesh.velocities.add(1, Vec3::Z);
    assert!(slot.restore(&mut mesh, &predicted));
    assert_eq!(mesh.positions, body().positions);
    assert_eq!(mesh.velocities.get(1), Some(Vec3::Z));
}

#[test]
fn another_body_is_known_as_such() {
    let mesh = body();
    let slot = slot(&mesh);
    assert!(slot.is_of(&mesh));
    assert!(!slot.is_of(&body()), "another topology");
    let nodes = [Vec3::ZERO, Vec3::X];
    let heavier = Mesh::new(Arc::clone(mesh.topology()), &nodes, &[1.0, 3.0], 0.1);
    assert!(!slot.is_of(&heavier.expect("a mesh")), "another mass");
}
