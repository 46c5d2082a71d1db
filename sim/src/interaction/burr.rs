//! Bits in bone.

use glam::Vec3;

use super::contact::Contact;
use super::impulses::Impulses;
use super::piece::free_piece;
use super::touches::{Touch, Touches};
use super::{Detection, Response};
use crate::behavior::drill::{Bit, FRICTION, Overlap, Reaction};
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
/// elastic, how stiff that is, and what its tip bears. The bone is told the opposite of the whole, on its
/// centre of mass.
///
/// A free piece ([`Piece`]) is told less. It weighs some grams, and a frame's impulse of a hand that presses the
/// bit would move it by centimetres; what bears that in truth, a table or another hand, is not known here. So
/// it yields as far as frees it of the bit, and the tool feels it as if it was held.
///
/// [`Piece`]: crate::behavior::piece::Piece
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
        let share = borne(bodies[1], &burr.bit, touches, time_step);
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
            let stiffness = normal * (burr.bit.elastic_stiffness(touch.depth) * time_step);
            tool.add(Reaction::STIFFNESS, stiffness.to_array());
            bone.add(Contact::BODY, (-whole * share).to_array());
        }
    }
}

/// The share of a bit's impulse that bone takes: all of it, or for a free piece one implicit step's, with twice the
/// stiffness, since what an impulse does shows a frame later. So it goes at most a third of the depth in that
/// frame, and all of it in the next ones.
fn borne(bone: &Object, bit: &Bit, touches: &Touches, time_step: f32) -> f32 {
    let Some((piece, _)) = free_piece(bone) else { return 1.0 };
    let balls = touches.list().iter().filter(|touch| touch.nodes[0] == Contact::BODY);
    let stiffness: f32 = balls.map(|touch| bit.elastic_stiffness(touch.depth)).sum();
    1.0 / (1.0 + 2.0 * stiffness * time_step * time_step * piece.body().inverse_mass())
}

#[cfg(test)]
mod tests {
    use parry3d::math::Pose;
    use parry3d::shape::SharedShape;

    use super::*;
    use crate::behavior::drill::Burr;
    use crate::behavior::piece::Piece;
    use crate::behavior::{Behavior, Bone, Fixed, Input};
    use crate::geometry::{Geometry, Rigid, Volume};
    use crate::interaction::{Member, Segment};
    use crate::object::{Group, ObjectId};

    const TIME: f32 = 1.0 / 60.0;

    struct Tool(Burr);

    impl Behavior for Tool {
        fn update(&mut self, _geometry: &mut Geometry, _input: &mut Input<'_>) {}

        fn burr(&self, _geometry: &Geometry) -> Option<Burr> {
            Some(self.0)
        }
    }

    fn shape() -> Geometry {
        Geometry::Rigid(Rigid::new(SharedShape::ball(3e-3), Pose::IDENTITY))
    }

    fn bone() -> Object {
        let full = |voxel: [u32; 3]| if voxel[2] < 20 { 255 } else { 0 };
        let volume = Volume::from_fn([40; 3], Vec3::splat(5e-4), Pose::IDENTITY, full);
        let volume = Geometry::Volume(volume.expect("it is small"));
        Object::new(ObjectId(1), Group(1), volume, Bone::new())
    }

    /// What a bit 1 mm deep in flat bone does to the tool and to the bone.
    fn respond(tool: Object) -> [Impulses; 2] {
        respond_on(tool, bone())
    }

    fn respond_on(tool: Object, bone: Object) -> [Impulses; 2] {
        let mut touches = Touches::default();
        BurrInBone.detect(&tool, &bone, &mut touches);
        let mut impulses: [Impulses; 2] = Default::default();
        let [first, second] = &mut impulses;
        BurrForce.respond([&tool, &bone], &touches, TIME, [first, second]);
        impulses
    }

    fn tool(bit: Bit, axis: Vec3, spin: f32) -> Object {
        let center = Vec3::new(0.01, 0.01, 0.01 + bit.radius - 1e-3);
        let burr = Burr { bit, center, axis, spin, side: None };
        Object::new(ObjectId(0), Group(0), shape(), Tool(burr))
    }

    fn reaction(impulses: &mut Impulses) -> Reaction {
        let someone = bone();
        let segment = impulses.segment([Member { object: &someone, place: 0 }; 2]);
        Reaction::new(segment.into_iter().flat_map(Segment::contacts), TIME)
    }

    #[test]
    fn tool_and_bone_push_each_other_and_the_tool_is_told_more() {
        let [mut on_tool, mut on_bone] = respond(tool(Bit::BURR, Vec3::X, 3e3));
        let felt = reaction(&mut on_tool);
        let expected = Bit::BURR.elastic_force(1e-3);
        assert!((felt.load() / expected - 1.0).abs() < 0.1, "{felt:?}");
        assert!(felt.normal().expect("it touches").z > 0.999);
        let [less, more] = [0.99e-3, 1.01e-3].map(|depth| Bit::BURR.elastic_force(depth));
        let expected = (more - less) / 2e-5;
        assert!((felt.normal_stiffness() / expected - 1.0).abs() < 0.05, "{felt:?}");
        // The lowest point of a bit that turns about +x moves to +y, and is dragged back.
        let drag = felt.force - felt.elastic;
        assert!((drag.y + FRICTION * felt.load()).abs() < 1e-3, "{drag}");
        assert_eq!(felt.tip, 0.0);
        let back = reaction(&mut on_bone);
        assert!((back.force + felt.force).length() < 1e-5);
        assert_eq!(back.elastic, Vec3::ZERO);
    }

    /// A light piece goes a third of the depth in a frame, for its force rises by the power of 3/2 of that.
    #[test]
    fn a_free_piece_goes_a_third_of_the_way() {
        let mut piece = bone();
        let behavior = Piece::new(piece.geometry.as_volume().expect("bone")).loose();
        let lightness = behavior.body().inverse_mass();
        piece.behavior = Box::new(behavior);
        let [_, mut on_piece] = respond_on(tool(Bit::BURR, Vec3::X, 0.0), piece);
        let way = reaction(&mut on_piece).force.length() * lightness * TIME * TIME;
        assert!((0.30e-3..0.34e-3).contains(&way), "{way} m of 1 mm");
    }

    #[test]
    fn a_bit_that_turns_the_other_way_is_dragged_the_other_way() {
        let [forth, back] = [3e3, -3e3].map(|spin| {
            let [mut on_tool, _] = respond(tool(Bit::BURR, Vec3::X, spin));
            reaction(&mut on_tool)
        });
        assert_eq!(forth.elastic, back.elastic);
        let drags = [forth, back].map(|felt| felt.force - felt.elastic);
        assert!((drags[0] + drags[1]).length() < 1e-5, "{drags:?}");
        assert!(drags[1].y > 0.1, "{drags:?}");
    }

    #[test]
    fn a_tip_alone_has_no_friction_and_bears_the_load() {
        let [mut on_tool, _] = respond(tool(Bit::PERFORATOR, Vec3::Z, 105.0));
        let felt = reaction(&mut on_tool);
        assert!((felt.force - felt.elastic).length() < 1e-3 * felt.load());
        let share = felt.tip / felt.load();
        assert!((0.5..1.0).contains(&share), "{share}");
    }

    #[test]
    fn what_does_not_turn_has_no_drag_and_what_is_no_drill_no_contact() {
        let [mut still, _] = respond(tool(Bit::BURR, Vec3::X, 0.0));
        let still = reaction(&mut still);
        assert_eq!(still.force, still.elastic);
        let other = Object::new(ObjectId(0), Group(0), shape(), Fixed);
        let [mut none, mut on_bone] = respond(other);
        assert_eq!(reaction(&mut none), Reaction::default());
        assert_eq!(reaction(&mut on_bone), Reaction::default());
    }
}
