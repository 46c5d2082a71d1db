//! Where the picture is taken from.

use std::f32::consts::{FRAC_PI_2, TAU};

use dualframe_sim::geometry::Bounds;
use glam::camera::rh::proj::directx::perspective_infinite_reverse;
use glam::camera::rh::view::look_at_mat4;
use glam::{Mat4, Vec2, Vec3, Vec4};

/// The angle of view over the picture's shorter side, in radians; usually 0.7 (40°).
const FIELD_OF_VIEW: f32 = 0.7;
/// The least distance of what is drawn, as a part of the distance to the target; usually 0.01.
const NEAR: f32 = 0.01;
/// How far the camera may tilt, in radians; a little less than straight up and down, where its own up
/// would be undefined.
const STEEPEST: f32 = FRAC_PI_2 - 0.01;

/// A camera that looks at a point from around it. +y is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// What it looks at, in metres.
    pub target: Vec3,
    /// Its distance from there, in metres.
    pub distance: f32,
    /// How far it has gone round the target, in radians: 0 is on the side of +z, a quarter turn on that
    /// of +x.
    pub yaw: f32,
    /// How far it is above the target, in radians.
    pub pitch: f32,
}

impl Camera {
    /// A camera that sees all of `bounds` from the front and a little above, whatever the picture's shape.
    #[must_use]
    pub fn around(bounds: &Bounds) -> Self {
        let radius = 0.5 * (bounds.max - bounds.min).length().max(1e-3);
        Self {
            target: bounds.center(),
            // The ball around them touches what is seen at its sides, not at its middle.
            distance: radius / (0.5 * FIELD_OF_VIEW).sin(),
            yaw: 0.5,
            pitch: 0.3,
        }
    }

    /// Where it is, in metres.
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        self.target + self.outward() * self.distance
    }

    /// From the target towards the camera, of unit length.
    fn outward(&self) -> Vec3 {
        let (sin_yaw, cos_yaw) = self.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        Vec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw)
    }

    /// The camera's right and up, of unit length.
    #[must_use]
    pub fn axes(&self) -> (Vec3, Vec3) {
        let outward = self.outward();
        let right = Vec3::Y.cross(outward).normalize();
        (right, outward.cross(right))
    }

    /// From places in the world to clip space, whose depth is 1 at the nearest and 0 at infinity, for
    /// a picture so many times as wide as high.
    #[must_use]
    pub fn view_projection(&self, aspect: f32) -> Mat4 {
        let view = look_at_mat4(self.eye(), self.target, Vec3::Y);
        let near = NEAR * self.distance;
        let angle = 2.0 * slopes(aspect).y.atan();
        perspective_infinite_reverse(angle, aspect, near) * view
    }

    /// Goes round the target by angles in radians.
    pub fn orbit(&mut self, yaw: f32, pitch: f32) {
        self.yaw = (self.yaw + yaw) % TAU;
        self.pitch = (self.pitch + pitch).clamp(-STEEPEST, STEEPEST);
    }

    /// Moves sideways, so that what is at the target's distance moves by so much of the height of a picture
    /// so many times as wide as high.
    pub fn pan(&mut self, by: Vec2, aspect: f32) {
        let (right, up) = self.axes();
        let height = 2.0 * self.distance * slopes(aspect).y;
        self.target -= (right * by.x + up * by.y) * height;
    }

    /// Changes the distance by a factor.
    pub fn zoom(&mut self, factor: f32) {
        self.distance = (self.distance * factor).clamp(1e-3, 1e4);
    }

    /// The direction in which `point` of a picture so many times as wide as high is seen from the
    /// [`Camera::eye`], of unit length. Points go from (−1, −1) at the lower left to (1, 1).
    #[must_use]
    pub fn direction(&self, point: Vec2, aspect: f32) -> Vec3 {
        self.ray(point, aspect).normalize()
    }

    /// The place seen at `point` of a picture so many times as wide as high, at the depth of
    /// `anchor`. Points go from (−1, −1) at the lower left to (1, 1).
    #[must_use]
    pub fn unproject(&self, point: Vec2, aspect: f32, anchor: Vec3) -> Vec3 {
        let depth = (anchor - self.eye()).dot(-self.outward());
        self.eye() + self.ray(point, aspect) * depth
    }

    /// From the eye to what is seen at a point, a metre deep.
    fn ray(&self, point: Vec2, aspect: f32) -> Vec3 {
        let (right, up) = self.axes();
        let slopes = slopes(aspect);
        right * (point.x * slopes.x) + up * (point.y * slopes.y) - self.outward()
    }
}

/// How far to the right and up one sees, at the picture's sides and a metre deep, in metres.
fn slopes(aspect: f32) -> Vec2 {
    let shorter = (0.5 * FIELD_OF_VIEW).tan();
    Vec2::new(aspect.max(1.0), aspect.recip().max(1.0)) * shorter
}

/// What a camera can see, for culling by boxes (§5.6).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frustum([Vec4; 5]);

impl Frustum {
    /// What is seen through a projection without a farthest distance.
    pub(crate) fn new(view_projection: &Mat4) -> Self {
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| view_projection.row(row));
        Self([w + x, w - x, w + y, w - y, w - z])
    }

    /// Whether some of a box may be seen; `false` only if none is.
    pub(crate) fn may_see(&self, bounds: &Bounds) -> bool {
        self.0.iter().all(|plane| {
            let normal = plane.truncate();
            // The box's corner farthest along the plane's normal.
            let corner = Vec3::select(normal.cmpge(Vec3::ZERO), bounds.max, bounds.min);
            normal.dot(corner) + plane.w >= 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::around(&Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) })
    }

    fn around(place: Vec3) -> Bounds {
        Bounds { min: place - Vec3::splat(0.1), max: place + Vec3::splat(0.1) }
    }

    #[test]
    fn culls_what_is_behind_and_beside() {
        let camera = camera();
        let frustum = Frustum::new(&camera.view_projection(1.5));
        let (right, up) = camera.axes();
        assert!(frustum.may_see(&around(camera.target)));
        assert!(frustum.may_see(&Bounds::ALL));
        let behind = camera.eye() + (camera.eye() - camera.target);
        for far in [behind, camera.target + right * 50.0, camera.target - up * 50.0] {
            assert!(!frustum.may_see(&around(far)), "{far}");
        }
    }

    #[test]
    fn all_that_it_is_around_is_seen() {
        let boxes = [Vec3::ONE, Vec3::new(0.05, 2.0, 0.05), Vec3::new(2.0, 0.05, 0.3)];
        for (half, aspect) in
            boxes.into_iter().flat_map(|half| [0.4, 1.0, 2.5].map(|by| (half, by)))
        {
            let camera = Camera::around(&Bounds { min: -half, max: half });
            let mut widest = 0.0_f32;
            for corner in 0..8 {
                let sign = |axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
                let corner = half * Vec3::new(sign(0), sign(1), sign(2));
                let seen = camera.view_projection(aspect).project_point3(corner).truncate().abs();
                widest = widest.max(seen.max_element());
            }
            assert!(widest <= 1.0 && widest > 0.35, "{half}, {aspect}: {widest}");
        }
    }

    #[test]
    fn unprojects_what_it_projects() {
        let camera = camera();
        let place = Vec3::new(0.3, -0.2, 0.4);
        for aspect in [0.5, 1.5] {
            let clip = camera.view_projection(aspect).project_point3(place);
            let back = camera.unproject(clip.truncate(), aspect, place);
            assert!(back.distance(place) < 1e-4, "{back}");
            let direction = camera.direction(clip.truncate(), aspect);
            let there = camera.eye() + direction * camera.eye().distance(place);
            assert!(there.distance(place) < 1e-4, "{there}");
        }
    }

    #[test]
    fn panning_moves_the_picture_with_the_hand() {
        for aspect in [0.5, 1.0, 2.0] {
            let mut camera = camera();
            let target = camera.target;
            camera.pan(Vec2::new(0.25, 0.0), aspect);
            // Clip space is two units wide.
            let moved = camera.view_projection(aspect).project_point3(target);
            assert!((moved.x * aspect - 0.5).abs() < 1e-4 && moved.y.abs() < 1e-4, "{moved}");
        }
    }
}
