//! Points in space that nodes are held to: pins, and the grips of tools.

use std::hash::Hasher;

use glam::Vec3;

use crate::geometry::Birth;
use crate::object::ObjectId;
use crate::simd::Quad;

/// A node that is held to a point in space: where tissue has grown onto bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin {
    /// The node.
    pub node: u32,
    /// The point, in metres.
    pub point: Vec3,
    /// In newtons per metre; usually 100 to 10,000, and infinite for a node that is not to move. As
    /// with the springs of a [`Material`](super::Material), more than 1/(h² w) is no stiffer.
    pub stiffness: f32,
    /// The greatest force, in newtons, beyond which the pin tears off for good; usually 0.1 to 10, and
    /// infinite for one that never does.
    pub strength: f32,
}

/// The grip of a tool.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grip {
    pub(super) by: ObjectId,
    /// Where the tool was at the end of the last frame, in metres.
    pub(super) from: Vec3,
    /// Where it is at the end of this one.
    pub(super) to: Vec3,
    /// In newtons per metre.
    pub(super) stiffness: f32,
    /// In newtons.
    pub(super) strength: f32,
    /// The nodes held, and where they are from the tool.
    pub(super) nodes: Vec<(u32, Vec3)>,
    /// The mean force on the tool over the last frame, in newtons.
    pub(super) force: Vec3,
}

/// A node held to a point, for one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    node: u32,
    target: Quad,
    /// How far the target moves in a substep.
    step: Quad,
    /// 1/(w + 1/(k h²)), in kilograms.
    gain: f32,
    /// The greatest impulse in a substep times its time, in kilogram metres: the strength times h².
    most: f32,
    /// What all substeps' impulses times their time come to.
    sum: Quad,
    /// Substeps in which it would have taken more than `most`.
    beyond: u32,
}

impl Anchor {
    /// Corrects the node's position.
    #[inline(always)]
    pub(super) fn correct(&mut self, positions: &mut [Quad]) {
        let position = &mut positions[self.node as usize];
        let mut impulse = [0.0; 4];
        for axis in 0..3 {
            self.target[axis] += self.step[axis];
            impulse[axis] = (self.target[axis] - position[axis]) * self.gain;
        }
        let square = impulse[0] * impulse[0] + impulse[1] * impulse[1] + impulse[2] * impulse[2];
        if square > self.most * self.most {
            let share = self.most / square.sqrt();
            impulse = impulse.map(|component| component * share);
            self.beyond += 1;
        }
        let inverse_mass = position[3];
        for axis in 0..4 {
            self.sum[axis] += impulse[axis];
            position[axis] += impulse[axis] * inverse_mass;
        }
    }
}

/// All that holds a body's nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct Anchors {
    pub(super) pins: Vec<Pin>,
    /// By their tools' numbers.
    pub(super) grips: Vec<Grip>,
    /// The frame's: the pins', then the grips'.
    pub(super) list: Vec<Anchor>,
}

impl Anchors {
    pub(super) fn grip(&self, by: ObjectId) -> Option<&Grip> {
        self.grips.iter().find(|grip| grip.by == by)
    }

    pub(super) fn grip_mut(&mut self, by: ObjectId) -> Option<&mut Grip> {
        self.grips.iter_mut().find(|grip| grip.by == by)
    }

    /// Lets a tool take hold, and let go of what it held.
    pub(super) fn take(&mut self, grip: Grip) {
        self.let_go(grip.by);
        let place = self.grips.partition_point(|other| other.by < grip.by);
        self.grips.insert(place, grip);
    }

    pub(super) fn let_go(&mut self, by: ObjectId) {
        self.grips.retain(|grip| grip.by != by);
    }

    /// Makes the frame's list, for `substeps` of so much `time` and nodes of these inverse masses, whose positions
    /// count from `origin`.
    pub(super) fn begin(&mut self, inverse_masses: &[f32], origin: Vec3, time: f32, substeps: u32) {
        let anchor = |node: u32, [from, to]: [Vec3; 2], stiffness: f32, strength: f32| {
            let inverse_mass = inverse_masses[node as usize];
            let compliance = 1.0 / (stiffness * time * time);
            Anchor {
                node,
                target: (from - origin).extend(0.0).to_array(),
                step: ((to - from) / substeps as f32).extend(0.0).to_array(),
                // What is held fast already needs no anchor, and gives way to none.
                gain: if inverse_mass > 0.0 { 1.0 / (inverse_mass + compliance) } else { 0.0 },
                most: strength * (time * time),
                sum: [0.0; 4],
                beyond: 0,
            }
        };
        self.list.clear();
        self.list.extend(
            self.pins.iter().map(|p| anchor(p.node, [p.point; 2], p.stiffness, p.strength)),
        );
        for Grip { from, to, stiffness, strength, nodes, .. } in &self.grips {
            let held = nodes.iter().map(|&(node, offset)| {
                anchor(node, [from + offset, to + offset], *stiffness, *strength)
            });
            self.list.extend(held);
        }
    }

    /// Draws the conclusions: what was at its greatest force for more than half of the frame gives
    /// way, and the tools feel what they held.
    pub(super) fn end(&mut self, time: f32, substeps: u32) {
        let mut list = self.list.iter();
        let holds = |anchor: Option<&Anchor>| anchor.is_some_and(|a| 2 * a.beyond <= substeps);
        self.pins.retain(|_| holds(list.next()));
        let to_force = 1.0 / (time * time * substeps as f32);
        for grip in &mut self.grips {
            let mut sum = Vec3::ZERO;
            grip.nodes.retain(|_| {
                let anchor = list.next();
                sum += anchor.map_or(Vec3::ZERO, |a| Vec3::new(a.sum[0], a.sum[1], a.sum[2]));
                holds(anchor)
            });
            grip.force = sum * -to_force;
            grip.from = grip.to;
        }
    }

    /// Hands on to nodes that a cut has made what held the nodes they come from, if all were held.
    pub(super) fn inherit(&mut self, first: u32, births: &[Birth]) {
        for (node, birth) in (first..).zip(births) {
            let (parents, shares) = parents(birth);
            let held: Option<Vec<Pin>> = parents
                .iter()
                .map(|&p| self.pins.iter().find(|pin| pin.node == p).copied())
                .collect();
            if let Some(held) = held {
                let mix = |of: fn(&Pin) -> f32| {
                    // An infinite value times 0 would be no number.
                    let all = held.iter().zip(&shares).filter(|(_, share)| **share > 0.0);
                    all.map(|(pin, share)| of(pin) * share).sum()
                };
                let point = held.iter().zip(&shares).map(|(pin, &share)| pin.point * share).sum();
                let stiffness = mix(|pin| pin.stiffness);
                self.pins.push(Pin { node, point, stiffness, strength: mix(|pin| pin.strength) });
            }
            for grip in &mut self.grips {
                let offset =
                    |&p: &u32| grip.nodes.iter().find(|held| held.0 == p).map(|held| held.1);
                let held: Option<Vec<Vec3>> = parents.iter().map(offset).collect();
                if let Some(held) = held {
                    let offset = held.iter().zip(&shares).map(|(&offset, &share)| offset * share);
                    grip.nodes.push((node, offset.sum()));
                }
            }
        }
    }

    pub(super) fn hash_state(&self, hasher: &mut dyn Hasher) {
        for &Pin { node, point, stiffness, strength } in &self.pins {
            hasher.write(&node.to_le_bytes());
            write(hasher, &[point.x, point.y, point.z, stiffness, strength]);
        }
        for Grip { by, from, to, stiffness, strength, nodes, force } in &self.grips {
            hasher.write(&by.0.to_le_bytes());
            for vector in [from, to, force] {
                write(hasher, &vector.to_array());
            }
            write(hasher, &[*stiffness, *strength]);
            for (node, offset) in nodes {
                hasher.write(&node.to_le_bytes());
                write(hasher, &offset.to_array());
            }
        }
    }
}

fn write(hasher: &mut dyn Hasher, numbers: &[f32]) {
    numbers.iter().for_each(|number| hasher.write(&number.to_le_bytes()));
}

/// The nodes that a new one comes from, and their shares in it.
fn parents(birth: &Birth) -> (Vec<u32>, Vec<f32>) {
    match *birth {
        Birth::Between(nodes, share) => (nodes.to_vec(), vec![1.0 - share, share]),
        Birth::Inside(nodes, shares) => (nodes.to_vec(), shares.to_vec()),
        Birth::Copy(node) => (vec![node], vec![1.0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was at its greatest force for half of a frame holds, and for more than half does not.
    #[test]
    fn gives_way_after_half_a_frame() {
        for (beyond, held) in [(0, 1), (8, 1), (9, 0), (16, 0)] {
            let pin = Pin { node: 0, point: Vec3::ZERO, stiffness: 100.0, strength: 1.0 };
            let mut anchors = Anchors { pins: vec![pin], ..Anchors::default() };
            anchors.begin(&[1.0], Vec3::ZERO, 0.001, 16);
            anchors.list[0].beyond = beyond;
            anchors.end(0.001, 16);
            assert_eq!(anchors.pins.len(), held, "beyond it in {beyond} substeps of 16");
        }
    }
}
