//! What a ray meets: a person's look at a pixel, say.

use glam::Vec3;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::Triangle;

use super::{Bounds, Geometry, Mesh, Volume};
use crate::simd::Simd;

impl Geometry {
    /// How far a ray goes until it meets the surface, in metres; `None` if it does not within `reach`
    /// metres. Both sides of a deformable surface are met; a ray that begins inside of a rigid shape
    /// or of bone meets it at once. `direction` is of unit length.
    #[must_use]
    pub fn cast(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<f32> {
        let within = crossed(&self.extent(Simd::detect()).bounds, origin, direction, reach)?;
        match self {
            Self::Mesh(mesh) => cast_mesh(mesh, &Ray::new(origin, direction), reach),
            Self::Rigid(rigid) => {
                rigid.shape.cast_ray(&rigid.pose, &Ray::new(origin, direction), reach, true)
            }
            Self::Volume(volume) => {
                let [begin, end] = within;
                let way = volume.cast(origin + direction * begin, direction, end - begin)?;
                Some(begin + way)
            }
        }
    }
}

impl Volume {
    /// How far a ray goes until it is in bone, in metres; `None` if it is not within `reach` metres.
    /// `direction` is of unit length. Bone thinner than the distance between voxels may be missed.
    #[must_use]
    pub fn cast(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<f32> {
        let step = self.spacing().min_element();
        // Bone ends half a voxel beyond the grid; farther on there is nothing to look for.
        let bounds = self.bounds().inflated(self.spacing().max_element());
        let [begin, end] = crossed(&bounds, origin, direction, reach)?;
        let [first, last] = [(begin / step) as u32, (end / step).ceil() as u32];
        let mut before = self.density_at(origin + direction * (first as f32 * step));
        if before >= 0.5 {
            return Some(first as f32 * step);
        }
        for way in (first..last).map(|number| (number + 1) as f32 * step) {
            let density = self.density_at(origin + direction * way);
            if density >= 0.5 {
                let met = way - step * (density - 0.5) / (density - before);
                // The last step may go on beyond the end.
                return (met <= reach).then_some(met);
            }
            before = density;
        }
        None
    }
}

fn cast_mesh(mesh: &Mesh, ray: &Ray, reach: f32) -> Option<f32> {
    let corner = |node: u32| mesh.positions.get(node as usize).unwrap_or(Vec3::NAN);
    let triangles = mesh.topology().triangles().iter();
    let hits = triangles.filter_map(|nodes| {
        let [a, b, c] = nodes.map(corner);
        Triangle::new(a, b, c).cast_local_ray(ray, reach, false)
    });
    hits.min_by(f32::total_cmp)
}

/// Where a ray enters a box and where it leaves it, in metres along it; `None` if it misses the box or
/// does not come so far. Parry's own (`Aabb::clip_ray_parameters`) misses a box without end, as walls have.
fn crossed(bounds: &Bounds, origin: Vec3, direction: Vec3, reach: f32) -> Option<[f32; 2]> {
    let (mut begin, mut end) = (0.0, reach);
    for axis in 0..3 {
        let (min, max) = (bounds.min[axis], bounds.max[axis]);
        if direction[axis] == 0.0 {
            // In the plane of a side, its distance times infinity would be no number.
            if !(min..=max).contains(&origin[axis]) {
                return None;
            }
        } else {
            let inverse = 1.0 / direction[axis];
            let [to_min, to_max] = [min, max].map(|side| (side - origin[axis]) * inverse);
            begin = to_min.min(to_max).max(begin);
            end = to_min.max(to_max).min(end);
        }
    }
    (begin <= end).then_some([begin, end])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parry3d::math::Pose;
    use parry3d::shape::SharedShape;

    use super::*;
    use crate::geometry::{Rigid, Topology, icosphere};

    const RADIUS: f32 = 0.02;
    const CENTER: Vec3 = Vec3::new(0.1, 0.2, 0.3);

    /// The same ball as a surface, a rigid shape and bone.
    fn balls() -> [Geometry; 3] {
        let (nodes, triangles) = icosphere(RADIUS);
        let places: Vec<Vec3> = nodes.iter().map(|&node| CENTER + node).collect();
        let topology = Topology::new(&places, triangles, &[], false).expect("a sphere");
        let masses = vec![1.0; places.len()];
        let mesh = Mesh::new(Arc::new(topology), &places, &masses, 0.001).expect("a sphere");
        let rigid = Rigid::new(SharedShape::ball(RADIUS), Pose::from_translation(CENTER));
        let spacing = Vec3::splat(0.001);
        let corner = CENTER - Vec3::splat(0.025);
        let inside = |voxel: [u32; 3]| {
            let place = Vec3::from_array(voxel.map(|index| index as f32 + 0.5)) * 0.001;
            let depth = RADIUS - (place - Vec3::splat(0.025)).length();
            (255.0 * (depth / 0.001 + 0.5).clamp(0.0, 1.0)) as u8
        };
        let bone = Volume::from_fn([50; 3], spacing, Pose::from_translation(corner), inside);
        [Geometry::Mesh(mesh), Geometry::Rigid(rigid), Geometry::Volume(bone.expect("small"))]
    }

    #[test]
    fn rays_meet_what_they_point_at() {
        for ball in balls() {
            for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8)] {
                let origin = CENTER - direction * 0.5;
                let way = ball.cast(origin, direction, 1.0).expect("it points at the middle");
                // The surface of few triangles is inside of the ball by a tenth.
                assert!((0.4799..0.4835).contains(&way), "{way}");
                assert_eq!(ball.cast(origin, direction, 0.47), None);
                assert_eq!(ball.cast(origin, -direction, 1.0), None);
                let aside = direction.any_orthonormal_vector() * 0.021;
                assert_eq!(ball.cast(origin + aside, direction, 1.0), None);
            }
        }
    }

    #[test]
    fn a_ray_along_a_side_of_the_box_meets_what_is_there() {
        let places = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let topology = Topology::new(&places, triangles, &[], false).expect("a square");
        let mesh = Mesh::new(Arc::new(topology), &places, &[1.0; 4], 0.0).expect("a square");
        let square = Geometry::Mesh(mesh);
        for aside in [0.0, 1.0] {
            let hit = square.cast(Vec3::new(aside, 0.5, 1.0), Vec3::NEG_Z, 2.0);
            assert_eq!(hit, Some(1.0), "{aside}");
        }
        assert_eq!(square.cast(Vec3::new(-0.1, 0.5, 1.0), Vec3::NEG_Z, 2.0), None);
    }

    #[test]
    fn a_ray_into_bone_may_have_no_end() {
        let [_, _, bone] = balls();
        let volume = bone.as_volume().expect("bone");
        for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8)] {
            let origin = CENTER - direction * 0.5;
            let near = volume.cast(origin, direction, 0.5);
            assert_eq!(volume.cast(origin, direction, f32::INFINITY), near);
            assert!((near.expect("it points at the middle") - 0.48).abs() < 1e-3, "{near:?}");
            assert_eq!(volume.cast(origin, -direction, f32::INFINITY), None);
            assert_eq!(volume.cast(CENTER - direction * 1e30, direction, f32::INFINITY), None);
        }
    }

    /// Also where it would be met before the step that passes the end of the ray ends.
    #[test]
    fn bone_is_met_within_reach_only() {
        let [_, _, bone] = balls();
        let volume = bone.as_volume().expect("bone");
        for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8)] {
            for shift in [0.0, 3e-4, 5e-4, 8e-4] {
                let origin = CENTER - direction * (0.5 + shift);
                let way = volume.cast(origin, direction, 1.0).expect("it points at the middle");
                for gap in [1e-5, 3e-4, 9e-4] {
                    assert_eq!(volume.cast(origin, direction, way - gap), None, "{gap} m short");
                }
                assert_eq!(volume.cast(origin, direction, way + 1e-5), Some(way));
            }
        }
    }

    #[test]
    fn solids_are_met_from_inside_at_once() {
        let [surface, rigid, bone] = balls();
        let far = surface.cast(CENTER, Vec3::X, 1.0).expect("it is around the place");
        assert!((0.016..=RADIUS).contains(&far), "{far}");
        assert_eq!(rigid.cast(CENTER, Vec3::X, 1.0), Some(0.0));
        assert_eq!(bone.cast(CENTER, Vec3::X, 1.0), Some(0.0));
    }
}
