//! A free piece of bone on bone.

use std::any::Any;

use glam::{Mat3, Vec3};

use super::bone_nodes::in_bone;
use super::contact::Contact;
use super::impulses::Impulses;
use super::touches::{Touch, Touches};
use super::{Detection, Response};
use crate::behavior::piece::{MOST_SAMPLES, Piece};
use crate::geometry::Volume;
use crate::object::Object;

/// Finds where a free piece of bone touches other bone, or is about to within a frame. The pair's first
/// object is the piece ([`Piece`]), the second a volume.
///
/// The piece is looked at by points on its surface, each of which reaches half a voxel towards the bone, and goes along
/// with it for a frame in steps of a voxel; a touch's node is the point's number, its depth less than 0 by
/// how far it has to go yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceInBone {
    /// How far it looks ahead, in seconds: the time of a frame.
    pub time_step: f32,
}

impl Detection for PieceInBone {
    fn detect(&self, first: &Object, second: &Object, touches: &mut Touches) {
        let Some((piece, own)) = free_piece(first) else { return };
        let Some(bone) = second.geometry.as_volume() else { return };
        let center = piece.body().center(own);
        let spin = piece.body().angular_velocity(own);
        let reach = 0.5 * own.spacing().min_element();
        for (number, &sample) in piece.samples().iter().enumerate() {
            let place = own.to_world(sample);
            // A point that was drilled away stands for nothing any more.
            if own.density_at(place) <= 0.25 {
                continue;
            }
            let way = (piece.body().velocity + spin.cross(place - center)) * self.time_step;
            let towards = bone.gradient_at(place).normalize_or_zero() * reach;
            let Some((gap, normal)) = way_to(bone, place, way + towards) else { continue };
            let nodes = [number as u32, Contact::BODY];
            touches.push(Touch { nodes, normal: normal.to_array(), depth: reach - gap });
        }
    }
}

/// How far from the surface a point is along its normal, where it is inside already or comes to it on its
/// way, and the normal.
fn way_to(bone: &Volume, place: Vec3, way: Vec3) -> Option<(f32, Vec3)> {
    let step = bone.spacing().min_element();
    // As an integer, what is not a number becomes 0.
    let steps = ((way.length() / step).ceil() as u32).min(MOST_STEPS);
    let inside = |share: f32| bone.density_at(place + way * share) >= 0.5;
    let share = |number: u32| number as f32 / steps.max(1) as f32;
    let first = (0..=steps).map(share).find(|&share| inside(share))?;
    let (mut outer, mut inner) = (first - share(1).min(first), first);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (outer + inner);
        if inside(middle) { inner = middle } else { outer = middle }
    }
    let point = place + way * inner;
    let (depth, normal) = in_bone(bone, point)?;
    Some(((place - point).dot(normal) - depth, normal))
}

/// Steps of a way, each of a voxel at most unless the way is longer; usually 1,024: at 240 frames a second and voxels of
/// 0.5 mm a piece of 120 m/s. What is faster may pass through thin bone, and takes no longer for it.
const MOST_STEPS: u32 = 1_024;

/// Halvings of the last step, for the surface; usually 5: to a sixtieth of a voxel.
const HALVINGS: usize = 5;

/// A piece that is not in its place, and its volume.
pub(super) fn free_piece(object: &Object) -> Option<(&Piece, &Volume)> {
    let behavior: &dyn Any = &*object.behavior;
    let piece = behavior.downcast_ref::<Piece>().filter(|piece| !piece.is_seated())?;
    Some((piece, object.geometry.as_volume()?))
}

/// Holds a piece off bone that stands still: impulses that let none of its points go farther in, with
/// Coulomb's friction and without rebound; a point that is inside already is let out slowly.
///
/// They are found by sequential impulses (E. Catto, "Iterative dynamics with temporal coherence", GDC 2005) from the
/// velocity that the piece has with what gravity and hands will do to it. Each bone finds them as if it were the only
/// one: a piece that lies on two is held off twice, and may be thrown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PieceOnBone {
    /// The coefficient of friction; usually 0.4. What is negative or no number is none.
    pub friction: f32,
}

/// Rounds over all points; usually 12.
const ROUNDS: usize = 12;
/// The share of its depth by which a point comes out in a frame; usually 0.2.
const COME_OUT: f32 = 0.2;
/// The depth that is let be, in metres; usually 20 µm, so that what lies still keeps touching.
const LET_BE: f32 = 2e-5;
/// How fast a point comes out at most, in metres per second; usually 0.05.
const FASTEST_OUT: f32 = 0.05;

impl Response for PieceOnBone {
    fn respond(
        &self,
        bodies: [&Object; 2],
        touches: &Touches,
        time_step: f32,
        [on_piece, on_bone]: [&mut Impulses; 2],
    ) {
        let Some((piece, volume)) = free_piece(bodies[0]) else { return };
        let mut motion = Motion::new(piece, volume);
        let center = piece.body().center(volume);
        let mut points = [Point::default(); MOST_SAMPLES];
        let points = &mut points[..touches.list().len().min(MOST_SAMPLES)];
        for (point, touch) in points.iter_mut().zip(touches.list()) {
            let Some(&sample) = piece.samples().get(touch.nodes[0] as usize) else { continue };
            *point = Point::new(touch, volume.to_world(sample) - center, &motion, time_step);
        }
        for _ in 0..ROUNDS {
            points.iter_mut().for_each(|point| point.push(&mut motion, self.friction));
        }
        for (point, touch) in points.iter().zip(touches.list()) {
            let impulse = point.normal * point.pressed + point.rubbed;
            if impulse != Vec3::ZERO {
                on_piece.add(touch.nodes[0], impulse.to_array());
                on_bone.add(Contact::BODY, (-impulse).to_array());
            }
        }
    }
}

/// How the piece moves with the impulses found so far.
struct Motion {
    velocity: Vec3,
    spin: Vec3,
    inverse_mass: f32,
    inverse_inertia: Mat3,
}

impl Motion {
    fn new(piece: &Piece, volume: &Volume) -> Self {
        let body = piece.body();
        Self {
            velocity: body.velocity,
            spin: body.angular_velocity(volume),
            inverse_mass: body.inverse_mass(),
            inverse_inertia: body.inverse_inertia(volume),
        }
    }

    fn at(&self, place: Vec3) -> Vec3 {
        self.velocity + self.spin.cross(place)
    }

    fn push(&mut self, impulse: Vec3, place: Vec3) {
        self.velocity += impulse * self.inverse_mass;
        self.spin += self.inverse_inertia * place.cross(impulse);
    }

    /// The mass that answers an impulse along a unit vector at a place, in kilograms.
    fn mass(&self, place: Vec3, along: Vec3) -> f32 {
        let arm = place.cross(along);
        let answer = self.inverse_mass + arm.dot(self.inverse_inertia * arm);
        if answer > 0.0 { 1.0 / answer } else { 0.0 }
    }
}

/// A point of the piece that touches bone.
#[derive(Clone, Copy, Debug, Default)]
struct Point {
    /// From the centre of mass, in metres.
    place: Vec3,
    normal: Vec3,
    mass: f32,
    /// The least velocity along the normal that it may have, in metres per second.
    least: f32,
    /// The impulse along the normal, in newton seconds.
    pressed: f32,
    /// That of friction.
    rubbed: Vec3,
}

impl Point {
    fn new(touch: &Touch, place: Vec3, motion: &Motion, time_step: f32) -> Self {
        let normal = Vec3::from_array(touch.normal);
        let least = if touch.depth < 0.0 {
            touch.depth / time_step
        } else {
            (COME_OUT * (touch.depth - LET_BE).max(0.0) / time_step).min(FASTEST_OUT)
        };
        let mass = motion.mass(place, normal);
        Self { place, normal, mass, least, ..Self::default() }
    }

    fn push(&mut self, motion: &mut Motion, friction: f32) {
        let off = motion.at(self.place).dot(self.normal) - self.least;
        let pressed = (self.pressed - self.mass * off).max(0.0);
        motion.push(self.normal * (pressed - self.pressed), self.place);
        self.pressed = pressed;
        let velocity = motion.at(self.place);
        let slip = velocity - self.normal * velocity.dot(self.normal);
        // A piece that stands on its edge turns far more easily than it is pushed down.
        let mass = motion.mass(self.place, slip.normalize_or_zero());
        let rubbed = (self.rubbed - slip * mass).clamp_length_max(friction.max(0.0) * self.pressed);
        motion.push(rubbed - self.rubbed, self.place);
        self.rubbed = rubbed;
    }
}

#[cfg(test)]
mod tests {
    use parry3d::math::Pose;

    use super::*;
    use crate::behavior::Fixed;
    use crate::geometry::Geometry;
    use crate::object::{Group, ObjectId};

    /// A plate of 60 mm and 20 g that slips while it stands on its edge is held, not kicked: along the bone a quarter
    /// of the mass answers that does from above.
    #[test]
    fn a_plate_on_its_edge_is_held_by_friction() {
        let (mass, length) = (0.02_f32, 0.06_f32);
        let inertia = mass * length * length / 12.0;
        let (velocity, spin) = (Vec3::new(1e-3, -0.04, 0.0), Vec3::ZERO);
        let inverse_inertia = Mat3::from_diagonal(Vec3::splat(1.0 / inertia));
        let mut motion = Motion { velocity, spin, inverse_mass: 1.0 / mass, inverse_inertia };
        let touch = Touch { nodes: [0, Contact::BODY], normal: [0.0, 1.0, 0.0], depth: 0.0 };
        let mut edge = Point::new(&touch, Vec3::NEG_Y * (0.5 * length), &motion, 1.0 / 60.0);
        for _ in 0..ROUNDS {
            edge.push(&mut motion, 0.4);
        }
        let left = motion.at(edge.place);
        assert!(left.length() < 1e-6, "{left} m/s, {edge:?}");
    }

    /// Full bone below z = 5 mm, of voxels of 0.5 mm.
    fn slab() -> Volume {
        let full = |voxel: [u32; 3]| if voxel[2] < 10 { 255 } else { 0 };
        let slab = Volume::from_fn([20; 3], Vec3::splat(5e-4), Pose::IDENTITY, full);
        slab.expect("it is small")
    }

    #[test]
    fn a_gap_is_the_way_to_the_surface_from_either_side() {
        for (height, way) in [(2e-3, 4e-3), (4e-4, 1e-3), (-1e-4, 0.0), (-5e-5, 1e-3)] {
            let place = Vec3::new(5e-3, 5e-3, 5e-3 + height);
            let (gap, normal) = way_to(&slab(), place, Vec3::NEG_Z * way).expect("it is met");
            assert!((gap - height).abs() < 5e-5, "{gap} m, not {height} m");
            assert!(normal.distance(Vec3::Z) < 1e-3, "{normal}");
        }
        let above = Vec3::new(5e-3, 5e-3, 7e-3);
        assert_eq!(way_to(&slab(), above, Vec3::NEG_Z * 1e-3), None, "not in this frame");
    }

    #[test]
    fn a_point_may_come_as_near_as_it_is_and_comes_out_slowly() {
        let (inverse_mass, inverse_inertia) = (1.0, Mat3::IDENTITY);
        let (velocity, spin) = (Vec3::ZERO, Vec3::ZERO);
        let motion = Motion { velocity, spin, inverse_mass, inverse_inertia };
        // 1 mm away; what is let be; a fifth of 1 mm in a frame; and no more than so fast.
        for (depth, least) in [(-1e-3, -0.06), (1e-5, 0.0), (1.02e-3, 0.012), (0.01, FASTEST_OUT)] {
            let touch = Touch { nodes: [0, Contact::BODY], normal: [0.0, 0.0, 1.0], depth };
            let point = Point::new(&touch, Vec3::ZERO, &motion, 1.0 / 60.0);
            assert!((point.least - least).abs() < 1e-5, "{} m/s at {depth} m", point.least);
        }
    }

    /// Points that a bit has taken away touch nothing any more.
    #[test]
    fn what_was_drilled_away_touches_nothing() {
        let cube = Volume::from_fn([10; 3], Vec3::splat(5e-4), Pose::IDENTITY, |_| 255);
        let mut cube = cube.expect("it is small");
        cube.pose = Pose::from_translation(Vec3::new(2e-3, 2e-3, 4.6e-3));
        let piece = Piece::new(&cube).loose();
        let bone = Object::new(ObjectId(1), Group(1), Geometry::Volume(slab()), Fixed);
        let count = |volume: Volume| {
            let volume = Geometry::Volume(volume);
            let first = Object::new(ObjectId(0), Group(0), volume, piece.clone());
            let mut touches = Touches::default();
            PieceInBone { time_step: 1.0 / 60.0 }.detect(&first, &bone, &mut touches);
            touches.list().len()
        };
        assert!(count(cube.clone()) > 10);
        cube.remove(cube.center(), 0.02, |voxel| voxel.share(1.0));
        assert_eq!(count(cube), 0);
    }

    /// Voxel by voxel it would take minutes.
    #[test]
    fn a_way_without_end_is_followed_in_no_time() {
        let spacing = 5e-4;
        let bone = Volume::new([8; 3], Vec3::splat(spacing), Pose::IDENTITY, &[0; 512]);
        let bone = bone.expect("it is small");
        for length in [1e9, f32::MAX, f32::INFINITY, f32::NAN] {
            assert_eq!(way_to(&bone, Vec3::ZERO, Vec3::X * length), None, "{length}");
        }
    }
}
