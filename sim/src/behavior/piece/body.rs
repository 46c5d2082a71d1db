//! A volume as a rigid body: its mass, and how it moves.

use std::hash::Hasher;

use glam::{DMat3, DVec3, Mat3, Quat, Vec3};

use crate::geometry::Volume;
use crate::geometry::rotation::unit;

/// The mass of full bone, in kilograms per cubic metre; usually 1,900: cortical bone.
pub const BONE_DENSITY: f64 = 1_900.0;

/// Mass and inertia of a volume's densities, and the motion of a rigid body that has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// In kilograms.
    pub mass: f32,
    /// The centre of mass in the volume's own axes, in metres.
    pub(super) middle: Vec3,
    /// The inverse of the inertia about it in the volume's own axes, in 1/(kg·m²).
    inverse_inertia: Mat3,
    /// The velocity of the centre of mass, in metres per second.
    pub velocity: Vec3,
    /// The angular momentum about it in the world's axes, in kg·m²/s.
    pub angular_momentum: Vec3,
}

impl Body {
    /// A body at rest. One without any bone has no mass, and moves like one of no inertia: not at all.
    pub(super) fn new(volume: &Volume) -> Self {
        let mut body = Self {
            mass: 0.0,
            middle: Vec3::ZERO,
            inverse_inertia: Mat3::ZERO,
            velocity: Vec3::ZERO,
            angular_momentum: Vec3::ZERO,
        };
        body.weigh(volume);
        body
    }

    /// Takes mass and inertia from the densities as they are now. What is left of it moves on as it did, as
    /// long as there is bone: with what is taken away goes its momentum.
    pub(super) fn weigh(&mut self, volume: &Volume) {
        let sums = Sums::new(volume);
        let spacing = volume.spacing().as_dvec3();
        let voxel = spacing.element_product() * BONE_DENSITY / 255.0;
        let mass = sums.whole as f64 * voxel;
        self.mass = mass as f32;
        if sums.whole == 0 {
            self.inverse_inertia = Mat3::ZERO;
            (self.velocity, self.angular_momentum) = (Vec3::ZERO, Vec3::ZERO);
            return;
        }
        // In voxels, from the middle of the first one; the second moments are those about the middle.
        let whole = sums.whole as f64;
        let mean = DVec3::from_array(sums.first.map(|sum| sum as f64)) / whole;
        let second = |a: usize, b: usize| {
            let about = sums.second[a][b] as f64 / whole - mean[a] * mean[b];
            let own = if a == b { 1.0 / 12.0 } else { 0.0 };
            (about + own) * spacing[a] * spacing[b] * mass
        };
        let square = DVec3::new(second(0, 0), second(1, 1), second(2, 2));
        let trace = square.element_sum();
        let (xy, xz, yz) = (second(0, 1), second(0, 2), second(1, 2));
        let inertia = DMat3::from_cols(
            DVec3::new(trace - square.x, -xy, -xz),
            DVec3::new(-xy, trace - square.y, -yz),
            DVec3::new(-xz, -yz, trace - square.z),
        );
        let middle = ((mean + 0.5) * spacing).as_vec3();
        let spin = self.angular_velocity(volume);
        self.velocity += spin.cross(volume.turned(middle - self.middle));
        self.angular_momentum = volume.turned(inertia.as_mat3() * volume.turned_back(spin));
        self.middle = middle;
        self.inverse_inertia = inertia.inverse().as_mat3();
    }

    /// Where the centre of mass is, in metres.
    #[must_use]
    pub fn center(&self, volume: &Volume) -> Vec3 {
        volume.to_world(self.middle)
    }

    /// The inverse of the inertia about the centre of mass, in the world's axes.
    pub(crate) fn inverse_inertia(&self, volume: &Volume) -> Mat3 {
        let column = |axis: Vec3| volume.turned(self.inverse_inertia * volume.turned_back(axis));
        Mat3::from_cols(column(Vec3::X), column(Vec3::Y), column(Vec3::Z))
    }

    /// 1 over the mass; 0 for a body that has none.
    pub(crate) fn inverse_mass(&self) -> f32 {
        if self.mass > 0.0 { 1.0 / self.mass } else { 0.0 }
    }

    /// The angular velocity, in radians per second.
    #[must_use]
    pub fn angular_velocity(&self, volume: &Volume) -> Vec3 {
        volume.turned(self.inverse_inertia * volume.turned_back(self.angular_momentum))
    }

    /// How fast any point of the volume moves at most, in metres per second.
    pub(super) fn fastest(&self, volume: &Volume) -> f32 {
        let spin = self.angular_velocity(volume).length();
        self.velocity.length() + spin * volume.extent().length()
    }

    /// Changes the motion by an impulse (newton seconds) at a place seen from the centre of mass (metres).
    pub(super) fn push(&mut self, impulse: Vec3, at: Vec3) {
        self.velocity += impulse * self.inverse_mass();
        self.angular_momentum += at.cross(impulse);
    }

    /// Moves the volume on by `time` seconds.
    pub(super) fn advance(&self, volume: &mut Volume, time: f32) {
        let center = self.center(volume) + self.velocity * time;
        let spin = self.angular_velocity(volume);
        volume.pose.rotation = turned_on(volume.pose.rotation, spin * time);
        // The volume turns about its centre of mass, and not about its corner.
        volume.pose.translation = center - volume.turned(self.middle);
        volume.velocity = self.velocity;
    }

    pub(super) fn hash_state(&self, hasher: &mut dyn Hasher) {
        for value in self.velocity.to_array().into_iter().chain(self.angular_momentum.to_array()) {
            hasher.write(&value.to_le_bytes());
        }
    }
}

/// A rotation turned on by a small angle about an axis, to second order, and of unit length. Component by
/// component: the quaternion type's own product differs between vector units.
fn turned_on(rotation: Quat, by: Vec3) -> Quat {
    let [x, y, z, w] = rotation.to_array();
    let half = by * 0.5;
    let axis = Vec3::new(x, y, z);
    // (half, 1 − |half|²/2) times the rotation.
    let real = 1.0 - 0.5 * half.length_squared();
    let imaginary = half * w + axis * real + half.cross(axis);
    unit([imaginary.x, imaginary.y, imaginary.z, real * w - half.dot(axis)])
}

/// Sums over the densities, as whole numbers, and so in any order the same: of the density times 1, the
/// place in voxels, and the products of two of its coordinates. For the greatest grid they are below 2⁶³.
#[derive(Default)]
struct Sums {
    whole: u64,
    first: [u64; 3],
    /// Those of two coordinates in ascending order.
    second: [[u64; 3]; 3],
}

impl Sums {
    fn new(volume: &Volume) -> Self {
        let mut sums = Self::default();
        let [_, high, deep] = volume.dims();
        for (z, y) in (0..deep).flat_map(|z| (0..high).map(move |y| (z, y))) {
            let mut row = [0_u64; 3];
            for (first, densities) in volume.row(y, z) {
                for (x, &density) in (u64::from(first)..).zip(densities) {
                    let density = u64::from(density);
                    row[0] += density;
                    row[1] += density * x;
                    row[2] += density * x * x;
                }
            }
            sums.add(row, [u64::from(y), u64::from(z)]);
        }
        sums
    }

    fn add(&mut self, [whole, x, xx]: [u64; 3], [y, z]: [u64; 2]) {
        self.whole += whole;
        let first = [x, whole * y, whole * z];
        let second = [[xx, x * y, x * z], [0, whole * y * y, whole * y * z], [0, 0, whole * z * z]];
        let sums = self.first.iter_mut().chain(self.second.as_flattened_mut());
        for (sum, part) in sums.zip(first.iter().chain(second.as_flattened())) {
            *sum += part;
        }
    }
}
