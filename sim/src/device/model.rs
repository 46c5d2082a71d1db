//! The local model of a contact: what the pipeline tells the haptic loop (§6.3, Eq. 1).

use glam::{DMat3, DVec3, Mat3, Vec3};
use thiserror::Error;

use super::DeviceDescription;
use super::stiffness::principal;

/// Below this, in newtons per metre, a direction counts as without stiffness: it stores no energy.
/// Usually 1: a hundredth of the softest tissue that a hand can feel.
const LEAST_STIFFNESS: f64 = 1.0;

/// A contact to first order (Eq. 1): `F(P) = f(P_N) + ∇f(P_N)·(P − P_N)`.
///
/// The pipeline computes it from the tool's state in some frame and delivers it at its own rate; the
/// haptic loop evaluates it at every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalModel {
    /// f(P_N), in newtons.
    pub force: Vec3,
    /// The torque at P_N, in newton metres. Eq. 1 has no gradient for it.
    pub torque: Vec3,
    /// ∇f(P_N), in newtons per metre: usually negative semidefinite, −K along the normal of a contact.
    pub gradient: Mat3,
    /// P_N: where the tool was, in metres.
    pub position: Vec3,
    /// When it was there, in seconds on the haptic clock: the `time` of the tool's state.
    pub time: f64,
    /// The outward normal of a contact that only pushes, of unit length: where Eq. 1 would pull inward
    /// along it, there is no force. So a model may already hold before the tool touches, with the
    /// negative force that Eq. 1 gives for the gap. None for tissue that is held and pulls both ways.
    pub normal: Option<Vec3>,
    /// Beside a contact that only pushes, the force at P_N of what pulls both ways, in newtons.
    pub pull: Vec3,
    /// Its gradient, in newtons per metre.
    pub pull_gradient: Mat3,
}

/// A local model that is no model.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum ModelError {
    /// A number in it is not finite.
    #[error("a local model with a number that is not finite")]
    NonFinite,
}

impl LocalModel {
    /// No contact anywhere near.
    pub const FREE: Self = Self {
        force: Vec3::ZERO,
        torque: Vec3::ZERO,
        gradient: Mat3::ZERO,
        position: Vec3::ZERO,
        time: 0.0,
        normal: None,
        pull: Vec3::ZERO,
        pull_gradient: Mat3::ZERO,
    };

    /// The model itself if every number in it is finite.
    ///
    /// # Errors
    /// [`ModelError::NonFinite`] if one is not.
    pub fn checked(self) -> Result<Self, ModelError> {
        let normal = self.normal.unwrap_or_default();
        let vectors = [self.force, self.torque, self.position, normal, self.pull];
        let finite = vectors.iter().all(|vector| vector.is_finite())
            && self.gradient.is_finite()
            && self.pull_gradient.is_finite()
            && self.time.is_finite();
        if finite { Ok(self) } else { Err(ModelError::NonFinite) }
    }

    /// The same beside something that pulls both ways, of which `other` is a model without a normal; as old as the older
    /// one.
    #[must_use]
    pub fn beside(self, other: &Self) -> Self {
        let pull = self.pull + other.force_at(self.position);
        let pull_gradient = self.pull_gradient + other.gradient + other.pull_gradient;
        Self { pull, pull_gradient, time: self.time.min(other.time), ..self }
    }

    /// The model's force at a place, in newtons: Eq. 1, and nothing where a contact would pull.
    #[must_use]
    pub fn force_at(&self, position: Vec3) -> Vec3 {
        let [contact, pull] = self.forces_at(position);
        contact + pull
    }

    /// The contact's force, and that of what pulls beside it.
    fn forces_at(&self, position: Vec3) -> [Vec3; 2] {
        let way = position - self.position;
        let force = self.force + self.gradient * way;
        let pulls = self.normal.is_some_and(|normal| force.dot(normal) <= 0.0);
        let contact = if pulls { Vec3::ZERO } else { force };
        [contact, self.pull + self.pull_gradient * way]
    }
}

/// The projection on a direction of unit length.
pub(crate) fn along(normal: Vec3) -> Mat3 {
    Mat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z)
}

/// A local model within what a device can show: symmetric, no direction stiffer than the device allows,
/// none with a stiffness that pushes away (which would be unstable by itself), no force beyond the
/// device's. A contact that is too stiff is softer, and stays in its place. With it, the energy that it
/// stores.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounded {
    model: LocalModel,
    /// The pseudo-inverses of the contact's stiffness, and of that of what pulls, in metres per newton.
    compliances: [DMat3; 2],
    max_force: f32,
}

impl Bounded {
    pub(super) fn new(model: LocalModel, device: &DeviceDescription) -> Self {
        let most = f64::from(device.max_stiffness);
        let pull = Spring::new(model.pull, model.pull_gradient, most);
        // Both act at once, and together are not to be too stiff.
        let contact = Spring::new(model.force, model.gradient, most - pull.stiffest);
        Self {
            model: LocalModel {
                force: contact.force,
                gradient: contact.gradient,
                pull: pull.force,
                pull_gradient: pull.gradient,
                ..model
            },
            compliances: [contact.compliance, pull.compliance],
            max_force: device.max_force,
        }
    }

    pub(super) fn model(&self) -> &LocalModel {
        &self.model
    }

    /// In newtons; at most the device's greatest force. A force beyond all numbers is none.
    pub(super) fn force_at(&self, position: Vec3) -> Vec3 {
        let force = self.model.force_at(position);
        if force.is_finite() { force.clamp_length_max(self.max_force) } else { Vec3::ZERO }
    }

    /// The energy stored at a place, in joules: fᵀK⁻¹f/2 for the force f of Eq. 1. Where the force is
    /// held at the device's greatest, S, only what that force gives back: of a spring, S/K·(|f| − S/2).
    pub(super) fn energy_at(&self, position: Vec3) -> f64 {
        let forces = self.model.forces_at(position).map(|force| force.as_dvec3());
        let springs = forces.into_iter().zip(&self.compliances);
        let elastic: f64 = springs.map(|(f, &compliance)| 0.5 * f.dot(compliance * f)).sum();
        let share = f64::from(self.max_force) / (forces[0] + forces[1]).length();
        if share < 1.0 { elastic * share * (2.0 - share) } else { elastic }
    }
}

/// A force and its gradient within bounds.
struct Spring {
    force: Vec3,
    gradient: Mat3,
    compliance: DMat3,
    /// The greatest stiffness along any direction, in newtons per metre.
    stiffest: f64,
}

impl Spring {
    fn new(force: Vec3, gradient: Mat3, most: f64) -> Self {
        // In this order, since the sum of the greatest numbers is not finite.
        let symmetric = gradient * 0.5 + gradient.transpose() * 0.5;
        let (values, vectors) = principal(symmetric.as_dmat3());
        let stiffness = (-values).clamp(DVec3::ZERO, DVec3::splat(most));
        let inverse = |k: f64| if k < LEAST_STIFFNESS { 0.0 } else { 1.0 / k };
        let of = |diagonal: DVec3| vectors * DMat3::from_diagonal(diagonal) * vectors.transpose();
        // A contact that is shown softer begins where it did.
        let shown = of((-values).map(|k| if k > most { most / k } else { 1.0 }));
        Self {
            force: (shown * force.as_dvec3()).as_vec3(),
            gradient: -of(stiffness).as_mat3(),
            compliance: of(stiffness.map(inverse)),
            stiffest: stiffness.max_element(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::operator::SimulatedDevice;

    fn wall(stiffness: f32) -> LocalModel {
        LocalModel {
            force: Vec3::new(0.0, stiffness * 1e-3, 0.0),
            gradient: Mat3::from_diagonal(Vec3::new(0.0, -stiffness, 0.0)),
            normal: Some(Vec3::Y),
            ..LocalModel::FREE
        }
    }

    #[test]
    fn pushes_and_never_pulls() {
        let model = wall(1_000.0);
        assert_eq!(model.force_at(Vec3::ZERO), Vec3::Y);
        assert_eq!(model.force_at(Vec3::new(0.3, -1e-3, 0.0)), Vec3::Y * 2.0);
        assert_eq!(model.force_at(Vec3::Y * 2e-3), Vec3::ZERO);
        let held = LocalModel { normal: None, ..model };
        assert_eq!(held.force_at(Vec3::Y * 2e-3), -Vec3::Y);
    }

    /// Tissue that is held pulls on where the contact beside it has ended, and both have their energy.
    #[test]
    fn a_pull_beside_a_contact() {
        let held = LocalModel {
            force: Vec3::new(0.5, -0.3, 0.0),
            gradient: Mat3::from_diagonal(Vec3::splat(-100.0)),
            position: Vec3::Y * 1e-3,
            ..LocalModel::FREE
        };
        let both = LocalModel { time: 2.0, ..wall(1_000.0) };
        let both = both.beside(&LocalModel { time: 1.5, ..held });
        assert_eq!(both.time, 1.5);
        for model in [both, *Bounded::new(both, &SimulatedDevice::DESCRIPTION).model()] {
            let force = model.force_at(Vec3::ZERO);
            assert!(force.abs_diff_eq(Vec3::new(0.5, 0.8, 0.0), 1e-5), "{force} inside");
            let force = model.force_at(Vec3::Y * 3e-3);
            assert!(force.abs_diff_eq(Vec3::new(0.5, -0.5, 0.0), 1e-5), "{force} outside");
        }
        // However often something was put beside what is beside the contact.
        let beside = wall(1_000.0).beside(&LocalModel::FREE.beside(&held));
        for place in [Vec3::ZERO, Vec3::new(2e-3, -1e-3, 3e-3)] {
            assert!(beside.force_at(place).abs_diff_eq(both.force_at(place), 1e-5), "{place}");
        }
        let device = SimulatedDevice::DESCRIPTION;
        let energy = |model| Bounded::new(model, &device).energy_at(Vec3::ZERO);
        assert!((energy(both) - energy(wall(1_000.0)) - energy(held)).abs() < 1e-9);
        let stiff = Bounded::new(wall(1e5).beside(&held), &device);
        let gradient = stiff.model().gradient + stiff.model().pull_gradient;
        assert!((gradient.y_axis.y + device.max_stiffness).abs() < 0.1, "{gradient}");
    }

    #[test]
    fn bounded_by_the_device() {
        let device = SimulatedDevice::DESCRIPTION;
        let skew = Mat3::from_cols(Vec3::Y, -Vec3::X, Vec3::ZERO) * 50.0;
        let gradient = Mat3::from_diagonal(Vec3::new(100.0, -1e6, -300.0)) + skew;
        let bounded = Bounded::new(LocalModel { gradient, ..LocalModel::FREE }, &device);
        let expected = Mat3::from_diagonal(Vec3::new(0.0, -device.max_stiffness, -300.0));
        assert!(bounded.model.gradient.abs_diff_eq(expected, 0.1), "{}", bounded.model.gradient);
        let far = bounded.force_at(Vec3::new(0.0, -1.0, 0.0));
        assert!((far.length() - device.max_force).abs() < 1e-3);
    }

    /// A wall that is stiffer than the device begins where it is, and gives way more.
    #[test]
    fn a_softer_wall_is_in_the_same_place() {
        let device = SimulatedDevice::DESCRIPTION;
        let bounded = Bounded::new(wall(3.0 * device.max_stiffness), &device);
        let force = |height: f32| bounded.force_at(Vec3::Y * height).y;
        assert!((force(0.0) - 5.0).abs() < 1e-3, "{} N at 1 mm", force(0.0));
        assert!(force(0.99e-3) > 0.0 && force(1.01e-3) == 0.0);
    }

    /// The stored energy is the work of the force on the way out.
    #[test]
    fn energy_is_the_work_that_comes_back() {
        let bounded = Bounded::new(wall(2_000.0), &SimulatedDevice::DESCRIPTION);
        for depth in [0.5e-3, 4e-3, 20e-3] {
            let steps = 20_000;
            let depth: f64 = depth;
            let at = |step: f64| Vec3::Y * (1e-3 - depth * (1.0 - step / f64::from(steps))) as f32;
            let force = |step: i32| f64::from(bounded.force_at(at(f64::from(step) + 0.5)).y);
            let work = (0..steps).map(|step| force(step) * depth / f64::from(steps)).sum::<f64>();
            let stored = bounded.energy_at(at(0.0));
            assert!((work - stored).abs() < 1e-3 * stored, "{work} of {stored} J at {depth} m");
        }
    }

    /// Of numbers that a model may have, as great as they may be, none makes a force that is no number.
    #[test]
    fn the_greatest_numbers_make_forces() {
        let free = LocalModel::FREE;
        let skew = Mat3::from_cols(Vec3::Y * -2e38, Vec3::X * -2e38, Vec3::ZERO);
        let great = Vec3::splat(f32::MAX);
        let models = [
            LocalModel { gradient: skew, normal: Some(Vec3::Y), ..free },
            LocalModel { pull_gradient: skew, force: Vec3::Y, ..free },
            LocalModel { force: great, pull: great, torque: great, ..free },
            LocalModel { position: great, ..wall(1_000.0) },
            LocalModel { normal: Some(great), force: -great, ..wall(f32::MAX) },
        ];
        for model in models {
            let bounded =
                Bounded::new(model.checked().expect("finite"), &SimulatedDevice::DESCRIPTION);
            for place in [Vec3::ZERO, Vec3::splat(0.1), Vec3::splat(-0.1)] {
                assert!(bounded.force_at(place).is_finite(), "{model:?} at {place}");
            }
        }
    }

    #[test]
    fn not_a_number_is_refused() {
        let broken = LocalModel { force: Vec3::NAN, ..LocalModel::FREE };
        assert_eq!(broken.checked(), Err(ModelError::NonFinite));
        assert_eq!(LocalModel::FREE.checked(), Ok(LocalModel::FREE));
    }
}
