//! A hash over the state of an environment, to tell whether two runs agree bit for bit.

use std::hash::Hasher;

use fnv::FnvHasher;
use glam::Vec3;
use parry3d::math::Pose;

use crate::geometry::{Geometry, Vectors};
use crate::object::{Object, ObjectId};

/// The hash (FNV-1a, 64 bits) over the states of all objects, taken in the order of their numbers
/// whatever order they come in.
///
/// An object's state is its positions, velocities and densities bit by bit, what its behaviour remembers, and
/// whether it is quarantined; of a quarantined object only that counts.
#[derive(Clone, Debug, Default)]
pub struct StateHash {
    hashes: Vec<(ObjectId, u64)>,
}

impl StateHash {
    /// Adds an object.
    pub fn add(&mut self, object: &Object) {
        self.hashes.push((object.id(), object_hash(object)));
    }

    /// The hash over all objects added.
    #[must_use]
    pub fn finish(mut self) -> u64 {
        self.hashes.sort_unstable();
        let mut hasher = FnvHasher::default();
        for (id, hash) in self.hashes {
            write(&mut hasher, id.0);
            hasher.write(&hash.to_le_bytes());
        }
        hasher.finish()
    }
}

/// Of objects whose hashes are known.
impl FromIterator<(ObjectId, u64)> for StateHash {
    fn from_iter<I: IntoIterator<Item = (ObjectId, u64)>>(hashes: I) -> Self {
        Self { hashes: hashes.into_iter().collect() }
    }
}

/// The hash over the state of one object.
#[must_use]
pub fn object_hash(object: &Object) -> u64 {
    let mut hasher = FnvHasher::default();
    if let Some(fault) = object.quarantined() {
        hasher.write(&[fault.kind as u8]);
        hasher.write(&fault.frame.to_le_bytes());
        return hasher.finish();
    }
    match &object.geometry {
        Geometry::Mesh(mesh) => {
            write_vectors(&mut hasher, &mesh.positions);
            write_vectors(&mut hasher, &mesh.velocities);
        }
        Geometry::Rigid(rigid) => {
            write_motion(&mut hasher, &rigid.pose, rigid.velocity);
        }
        Geometry::Volume(volume) => {
            volume.dims().into_iter().for_each(|dim| write(&mut hasher, dim));
            hasher.write(&volume.digest().to_le_bytes());
            write_motion(&mut hasher, &volume.pose, volume.velocity);
        }
    }
    object.behavior.hash_state(&mut hasher);
    hasher.finish()
}

fn write_motion(hasher: &mut FnvHasher, pose: &Pose, velocity: Vec3) {
    let turned = pose.rotation.to_array();
    let moved = pose.translation.to_array().into_iter();
    for value in moved.chain(turned).chain(velocity.to_array()) {
        write(hasher, value.to_bits());
    }
}

fn write_vectors(hasher: &mut FnvHasher, vectors: &Vectors) {
    for component in vectors.as_slices() {
        for value in component {
            write(hasher, value.to_bits());
        }
    }
}

/// Always little-endian, so that the hash is the same on every machine.
fn write(hasher: &mut FnvHasher, value: u32) {
    hasher.write(&value.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Message;
    use crate::scene::ParticleScene;

    fn hash<'a>(objects: impl IntoIterator<Item = &'a Object>) -> u64 {
        let mut hash = StateHash::default();
        objects.into_iter().for_each(|object| hash.add(object));
        hash.finish()
    }

    fn mesh(object: &mut Object) -> &mut crate::geometry::Mesh {
        object.geometry.as_mesh_mut().expect("a particle is a mesh")
    }

    #[test]
    fn every_part_of_the_state_counts_and_the_order_does_not() {
        let scene = || ParticleScene::new(2).build().expect("two particles are allowed").objects;
        let whole = hash(&scene());
        assert_eq!(hash(scene().iter().rev()), whole);
        let changes: [fn(&mut Object); 7] = [
            |object| mesh(object).positions.set(41, Vec3::ZERO),
            |object| mesh(object).velocities.add(0, Vec3::Z),
            |object| object.behavior.process(&Message::Weightless(true)),
            |object| object.behavior.process(&Message::Damping(0.5)),
            |object| {
                object.behavior.process(&Message::Pull {
                    node: 0,
                    target: [0.0; 3],
                    stiffness: 1.0,
                })
            },
            |object| object.process(&Message::Remove, 3),
            |object| object.process(&Message::Remove, 4),
        ];
        let mut seen = vec![whole];
        for (index, change) in changes.into_iter().enumerate() {
            let mut objects = scene();
            change(&mut objects[1]);
            let changed = hash(&objects);
            assert!(!seen.contains(&changed), "change {index}");
            seen.push(changed);
        }
        assert_ne!(hash(&scene()[..1]), hash(&scene()[1..2]));
    }
}
