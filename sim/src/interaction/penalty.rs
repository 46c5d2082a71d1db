//! Response by penalty forces.

use glam::Vec3;

use super::Response;
use super::contact::Contact;
use super::error::{ResponseError, check};
use super::impulses::Impulses;
use super::touches::{Touch, Touches};
use crate::geometry::Geometry;
use crate::object::Object;

/// Pushes touching objects apart along the contact's normal, by a spring and a dashpot, and never
/// pulls; where there is friction, it is Coulomb's, limited so that each touch stops its two ends on each other at most.
///
/// Where two bodies touch as wholes ([`Contact::BODY`] on both sides) only the spring acts, without damping and friction.
///
/// The force is that of the frame's beginning: with a node's mass m (kg) and the time step t (s) a single node leaves
/// at no more than 1.25 times the speed at which it came (computed for all depths at which it may first be found)
/// while stiffness · t² / m + damping · t / m is below 2, and at no more than that speed if the second of these is 0.3
/// or more; from 2 on it is thrown, at up to that sum less 1 times its speed.
///
/// Between nodes the force acts along the line of their centres on both alike, so without friction
/// linear and angular momentum are kept up to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty {
    stiffness: f32,
    damping: f32,
    friction: f32,
    body_stiffness: f32,
}

impl Penalty {
    /// A stiffness in newtons per metre of depth, a damping in newton seconds per metre, and a
    /// coefficient of friction.
    ///
    /// # Errors
    /// A value that is negative or not finite.
    pub fn new(stiffness: f32, damping: f32, friction: f32) -> Result<Self, ResponseError> {
        check("the stiffness", stiffness)?;
        check("the damping", damping)?;
        check("the friction", friction)?;
        Ok(Self { stiffness, damping, friction, body_stiffness: stiffness })
    }

    /// The same with another stiffness, in newtons per metre, where two bodies touch as a whole.
    ///
    /// # Errors
    /// A value that is negative or not finite.
    pub fn with_body_stiffness(mut self, stiffness: f32) -> Result<Self, ResponseError> {
        check("the stiffness of bodies", stiffness)?;
        self.body_stiffness = stiffness;
        Ok(self)
    }

    /// The impulse on the first object of a touch, in newton seconds.
    fn impulse(&self, bodies: [&Object; 2], touch: &Touch, time_step: f32) -> Vec3 {
        let normal = Vec3::from_array(touch.normal);
        if touch.nodes == [Contact::BODY; 2] {
            return normal * ((self.body_stiffness * touch.depth).max(0.0) * time_step);
        }
        let mut force = (self.stiffness * touch.depth).max(0.0);
        if self.damping == 0.0 && self.friction == 0.0 {
            return normal * (force * time_step);
        }
        let [first, second] = touch.nodes;
        let relative = velocity(bodies[0], first) - velocity(bodies[1], second);
        let apart = relative.dot(normal);
        force = (force - self.damping * apart).max(0.0);
        let push = normal * (force * time_step);
        let slip = relative - normal * apart;
        let speed = slip.length();
        if self.friction == 0.0 || speed == 0.0 {
            return push;
        }
        let masses = [mass(bodies[0], first), mass(bodies[1], second)];
        let (light, heavy) = (masses[0].min(masses[1]), masses[0].max(masses[1]));
        // Both ends take the impulse: by the reduced mass it stops them on each other.
        let reduced = if light.is_finite() { light / (1.0 + light / heavy) } else { light };
        let stopping = reduced * speed;
        let drag = (self.friction * force * time_step).min(stopping);
        push - slip * (drag / speed)
    }
}

impl Response for Penalty {
    fn respond(
        &self,
        bodies: [&Object; 2],
        touches: &Touches,
        time_step: f32,
        impulses: [&mut Impulses; 2],
    ) {
        let [first, second] = impulses;
        for touch in touches.list() {
            let impulse = self.impulse(bodies, touch, time_step);
            first.add(touch.nodes[0], impulse.to_array());
            second.add(touch.nodes[1], (-impulse).to_array());
        }
    }
}

fn velocity(object: &Object, node: u32) -> Vec3 {
    match &object.geometry {
        Geometry::Mesh(mesh) => mesh.velocities.get(node as usize).unwrap_or(Vec3::ZERO),
        Geometry::Rigid(rigid) => rigid.velocity,
        Geometry::Volume(volume) => volume.velocity,
    }
}

/// A node's mass, in kilograms; infinite for what no force of the environment moves.
fn mass(object: &Object, node: u32) -> f32 {
    let Some(mesh) = object.geometry.as_mesh() else { return f32::INFINITY };
    match mesh.masses().get(node as usize) {
        Some(&mass) if node != Contact::BODY && mass > 0.0 => mass,
        _ => f32::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use parry3d::math::Pose;
    use parry3d::shape::SharedShape;

    use super::*;
    use crate::behavior::Fixed;
    use crate::geometry::Rigid;
    use crate::object::{Group, ObjectId};

    #[test]
    fn what_is_only_near_is_not_pulled() {
        let bodies = [0, 1].map(|id| {
            let ball = Rigid::new(SharedShape::ball(0.1), Pose::IDENTITY);
            Object::new(ObjectId(id), Group(0), Geometry::Rigid(ball), Fixed)
        });
        let [first, second] = &bodies;
        for damping in [0.0, 1.0] {
            let penalty = Penalty::new(100.0, damping, 0.0).expect("positive values");
            for nodes in [[Contact::BODY; 2], [0, Contact::BODY]] {
                let near = Touch { nodes, normal: [1.0, 0.0, 0.0], depth: -1e-3 };
                assert_eq!(penalty.impulse([first, second], &near, 1.0), Vec3::ZERO);
            }
        }
    }
}
