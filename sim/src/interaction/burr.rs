//! Bits in bone.

use glam::Vec3;

use super::contact::Contact;
use super::impulses::Impulses;
use super::touches::{Touch, Touches};
use super::{Detection, Response};
use crate::behavior::drill::{FRICTION, Overlap, Reaction};
use crate::object::Object;

/// Finds how deep a tool's bit is in bone. The pair's first object is the tool, the second a volume; a
/// tool without a bit ([`Behavior::burr`]) touches nothing.
///
/// There is a touch of the whole bodies for each ball of the bit, with the depth in a flat half-space of
/// full bone that would give the same force, and for a bit with a tip one of the tool's
/// [`Reaction::TIP`] along its axis.
///
/// [`Behavior::burr`]: crate::behavior::Behavior::burr
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BurrInBone;

impl Detection for BurrInBone {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let burr = first.behavior.burr(&first.geometry);
        let (Some(burr), Some(volume)) = (burr, second.geometry.as_volume()) else { return };
        for center in burr.balls() {
            let overlap = Overlap::new(volume, &burr, center);
            let Some(normal) = overlap.normal else { continue };
            let nodes = [Contact::BODY; 2];
            touches.push(Touch { nodes, normal: normal.to_array(), depth: overlap.depth });
            if overlap.tip_depth > 0.0 {
                let nodes = [Reaction::TIP, Contact::BODY];
                let normal = burr.axis.to_array();
                touches.push(Touch { nodes, normal, depth: overlap.tip_depth });
            }
        }
    }
}

/// The force of bone on a tool's bit: elastic along the normal, and Coulomb's friction against the way the
/// bit's surface moves, for a place of contact that is small beside the ball. It has no friction along
/// the axis, and none where the tip alone touches: there the surface turns on the spot.
///
/// The tool is told the whole as the impulse on its body, and by the nodes of [`Reaction`] what of it is
/// elastic and what its tip bears. The bone is told the opposite of the whole, on its centre of mass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BurrForce;

impl Response for BurrForce {
    fn respond(
        &self,
        bodies: [&Object; 2],
        touches: &Touches,
        time_step: f32,
        [tool, bone]: [&mut Impulses; 2],
    ) {
        let Some(burr) = bodies[0].behavior.burr(&bodies[0].geometry) else { return };
        for touch in touches.list() {
            let normal = Vec3::from_array(touch.normal);
            let force = burr.bit.elastic_force(touch.depth);
            let elastic = normal * (force * time_step);
            if touch.nodes[0] == Reaction::TIP {
                tool.add(Reaction::TIP, elastic.to_array());
                continue;
            }
            // The surface at −normal moves along axis × −normal.
            let turns = if burr.spin == 0.0 { 0.0 } else { burr.spin.signum() };
            let drag = burr.axis.cross(normal) * (turns * FRICTION * force * time_step);
            let whole = elastic + drag;
            tool.add(Contact::BODY, whole.to_array());
            tool.add(Reaction::ELASTIC, elastic.to_array());
            bone.add(Contact::BODY, (-whole).to_array());
        }
    }
}
