//! Response by implicit springs: what holds and pushes light nodes over long frames.

use glam::Vec3;

use super::contact::Contact;
use super::error::{ResponseError, check};
use super::touches::{Touch, Touches};
use super::{Impulses, Response};
use crate::geometry::{Geometry, Mesh};
use crate::object::Object;

/// A spring and a dashpot along each touch's normal, one implicit step of a frame's length: with masses
/// m, M of the two nodes, or what answers for bodies touched as a whole, w = 1/m + 1/M, and the rate v at
/// which they part, the impulse is t·(k·d − (k·t + c)·v) / (1 + (k·t² + c·t)·w) for a depth d. So any
/// stiffness is stable for a node that has one such spring: a very stiff one brings its ends together within the frame,
/// and no further. It does not know what gravity g adds in the same frame: what rests or hangs is up to g·t² off, 2.7 mm
/// at 60 frames a second. Between two bodies that are both touched as wholes and of which neither is a mesh nothing says
/// what a force would move, and there is none.
///
/// The interactions of a frame are computed before its updates, so a frame of 1/60 s is far too long for
/// the explicit [`Penalty`](super::Penalty) on nodes of a fraction of a gram: it would have to be softer
/// than 1 N/m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliant {
    stiffness: f32,
    damping: f32,
    pulls: bool,
}

impl Compliant {
    /// Pushes bodies apart that reach into each other, and never pulls: so many newtons per metre of depth,
    /// and newton seconds per metre.
    ///
    /// # Errors
    /// A value that is negative or not finite.
    pub fn contact(stiffness: f32, damping: f32) -> Result<Self, ResponseError> {
        check("the stiffness", stiffness)?;
        check("the damping", damping)?;
        Ok(Self { stiffness, damping, pulls: false })
    }

    /// Holds links at their rest length, by pushing and by pulling.
    ///
    /// # Errors
    /// A value that is negative or not finite.
    pub fn link(stiffness: f32, damping: f32) -> Result<Self, ResponseError> {
        Ok(Self { pulls: true, ..Self::contact(stiffness, damping)? })
    }
}

impl Response for Compliant {
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
            if impulse == 0.0 {
                continue;
            }
            let [x, y, z] = touch.normal;
            first.add(touch.nodes[0], [x * impulse, y * impulse, z * impulse]);
            second.add(touch.nodes[1], [-x * impulse, -y * impulse, -z * impulse]);
        }
    }
}

impl Compliant {
    /// The impulse along the normal on the first object, in newton seconds.
    fn impulse(&self, bodies: [&Object; 2], touch: &Touch, time: f32) -> f32 {
        let [first, second] = [(bodies[0], touch.nodes[0]), (bodies[1], touch.nodes[1])]
            .map(|(object, node)| end(object, node));
        let weight = first.inverse_mass + second.inverse_mass;
        if weight == 0.0 {
            return 0.0;
        }
        let relative: [f32; 3] =
            std::array::from_fn(|axis| first.velocity[axis] - second.velocity[axis]);
        let [x, y, z] = touch.normal;
        let apart = relative[0] * x + relative[1] * y + relative[2] * z;
        let Self { stiffness, damping, pulls } = *self;
        let force = stiffness * touch.depth - (stiffness * time + damping) * apart;
        let force = if pulls { force } else { force.max(0.0) };
        time * force / (1.0 + (stiffness * time + damping) * time * weight)
    }
}

/// One end of a touch.
struct End {
    velocity: [f32; 3],
    /// 0 for what no force moves, in 1/kg.
    inverse_mass: f32,
}

fn end(object: &Object, node: u32) -> End {
    match &object.geometry {
        Geometry::Mesh(mesh) if node != Contact::BODY => node_end(mesh, node),
        Geometry::Mesh(mesh) => body_end(mesh),
        Geometry::Rigid(rigid) => held(rigid.velocity),
        Geometry::Volume(volume) => held(volume.velocity),
    }
}

/// A deformable body as a whole: its nodes' mean velocity, which impulses change of which each node has an equal share.
fn body_end(mesh: &Mesh) -> End {
    let nodes = mesh.positions.len().max(1) as f32;
    let all = (0..mesh.positions.len()).map(|node| node_end(mesh, node as u32));
    let sum = all.fold(held(Vec3::ZERO), |sum, end| End {
        velocity: std::array::from_fn(|axis| sum.velocity[axis] + end.velocity[axis]),
        inverse_mass: sum.inverse_mass + end.inverse_mass,
    });
    let velocity = sum.velocity.map(|component| component / nodes);
    End { velocity, inverse_mass: sum.inverse_mass / (nodes * nodes) }
}

/// What no force moves.
fn held(velocity: Vec3) -> End {
    End { velocity: velocity.to_array(), inverse_mass: 0.0 }
}

fn node_end(mesh: &Mesh, node: u32) -> End {
    let node = node as usize;
    let velocity = mesh.velocities.get(node).unwrap_or(Vec3::ZERO).to_array();
    let mass = mesh.masses().get(node).copied().unwrap_or(0.0);
    End { velocity, inverse_mass: if mass > 0.0 { 1.0 / mass } else { 0.0 } }
}
