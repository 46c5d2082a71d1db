//! Contact with a surface by a proxy: the pipeline's side of the force.
//!
//! The proxy is the god-object of C. B. Zilles, J. K. Salisbury, "A constraint-based god-object method
//! for haptic display", IROS 1995, on an implicit surface, as K. Salisbury, C. Tarr, "Haptic rendering
//! of surfaces defined by implicit functions", ASME 1997: where the tool is outside it is the tool; where
//! the tool is inside it stays on the surface, at the place nearest to the tool. So the force points out
//! on the side on which the tool came in, also from a thin wall, however deep it is at first; only a tool that is in
//! front of the wall in one frame and behind it in the next was never inside.
//!
//! Near the surface the proxy is on it already, and its model holds for the gap: however late the
//! model comes, the haptic loop knows where contact begins.

use glam::Vec3;

use super::link::ToolState;
use super::model::{LocalModel, along};

/// Newton steps onto the surface, and tangential moves, for each time the proxy follows. Usually 8: a tool
/// that moved 5 mm along a skull of 7 cm radius is followed to 1 µm in 3.
const STEPS: usize = 8;
/// Halvings of the way of a tool that came from afar. Usually 16: of 0.1 m to 2 µm.
const HALVINGS: usize = 16;
/// The proxy is on the surface within this distance, in metres. Usually 1 µm: 2 mN at 2 kN/m.
const TOLERANCE: f32 = 1e-6;
/// How far from the surface a tool may be for a model of the gap, in metres. Usually 0.02: at 0.5 m/s
/// it is not reached within two frames of 1/60 s.
pub(super) const REACH: f32 = 0.02;

/// A closed or an endless surface: positive outside, negative inside.
pub trait Surface {
    /// The distance to the surface, in metres, or a field that is about it near the surface, and its
    /// gradient, which points outward and need not be of unit length. Where the surface is out of reach, the
    /// distance is infinite, negative inside, and the gradient 0.
    fn distance(&self, point: Vec3) -> (f32, Vec3);
}

/// The stiffness with which a surface is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactStiffness(f32);

impl ContactStiffness {
    /// Bone: 2,000 N/m. Desktop devices of 3 to 12 N show 1,000 to 5,000, and walls above 1,000 to 2,000
    /// pass for hard (J. K. Salisbury et al., "Haptic rendering: programming touch interaction with
    /// virtual objects", I3D 1995).
    pub const BONE: Self = Self(2_000.0);

    /// So many newtons per metre; a negative number, or none, is 0.
    #[must_use]
    pub fn new(newtons_per_metre: f32) -> Self {
        Self(newtons_per_metre.max(0.0))
    }

    /// In newtons per metre.
    #[must_use]
    pub fn newtons_per_metre(self) -> f32 {
        self.0
    }
}

/// The point that stands for the tool on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proxy {
    position: Vec3,
    /// Outward, of unit length, when the tool is near the surface or inside.
    normal: Option<Vec3>,
    touches: bool,
}

impl Proxy {
    /// A proxy at the tool, which must be outside.
    #[must_use]
    pub fn new(tool: Vec3) -> Self {
        Self { position: tool, normal: None, touches: false }
    }

    /// Where it is, in metres: on the surface, or at the tool where that is far from any.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Whether the tool is inside.
    #[must_use]
    pub fn touches(&self) -> bool {
        self.touches
    }

    /// `place` itself, or where the surface holds a tool that touches it and wants to be there: no deeper
    /// than the proxy.
    #[must_use]
    pub fn held_out(&self, place: Vec3) -> Vec3 {
        let Some(normal) = self.normal.filter(|_| self.touches) else { return place };
        place + normal * (self.position - place).dot(normal).max(0.0)
    }

    /// The tool is at `tool` now.
    pub fn follow(&mut self, tool: Vec3, surface: &impl Surface) {
        let (distance, _) = surface.distance(tool);
        let freed = self.normal.is_none_or(|normal| (tool - self.position).dot(normal) > 0.0);
        self.touches = if self.touches { !(freed && distance > 0.0) } else { distance < 0.0 };
        if !self.touches {
            self.position = tool;
            self.normal = None;
            if distance < REACH && !self.settle(surface) {
                *self = Self::new(tool);
            }
            return;
        }
        if self.normal.is_none() {
            self.enter(tool, surface);
        }
        for _ in 0..STEPS {
            let before = self.position;
            // Along the surface towards the tool, then back onto it.
            let normal = self.normal.unwrap_or_default();
            let way = tool - self.position;
            self.position += way - normal * way.dot(normal);
            if !self.settle(surface) {
                // What it lay on is gone.
                *self = Self::new(tool);
                return;
            }
            if self.position.distance(before) < TOLERANCE {
                break;
            }
        }
    }

    /// Goes to where the tool came in: the surface near the proxy, or else where that is crossed on the way from there
    /// to a tool that came from afar, deeper than a gradient is known.
    fn enter(&mut self, tool: Vec3, surface: &impl Surface) {
        if self.settle(surface) && self.normal.is_some() {
            return;
        }
        let (mut outer, mut inner) = (self.position, tool);
        // A proxy deep inside came from nowhere.
        if surface.distance(outer).0 > 0.0 {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (outer + inner);
                if surface.distance(middle).0 > 0.0 { outer = middle } else { inner = middle }
            }
            self.position = outer;
            self.settle(surface);
        }
    }

    /// Goes onto the surface along the gradient, by Newton's method. Whether there is any near.
    fn settle(&mut self, surface: &impl Surface) -> bool {
        for _ in 0..STEPS {
            let (distance, gradient) = surface.distance(self.position);
            // Deep inside no gradient is known, either, and what was found before holds on.
            let Some(normal) = gradient.try_normalize() else { return distance < REACH };
            self.normal = Some(normal);
            self.position -= gradient * (distance / gradient.length_squared());
            if distance.abs() < TOLERANCE {
                break;
            }
        }
        true
    }

    /// The contact's local model for a tool, which the proxy has followed there: `K·(proxy − tool)`, with
    /// the gradient `−K·n·nᵀ` of a contact without friction. Far from the surface, no contact.
    #[must_use]
    pub fn model(&self, tool: &ToolState, stiffness: ContactStiffness) -> LocalModel {
        let (position, time) = (tool.sample.position, tool.time);
        let Some(normal) = self.normal else {
            return LocalModel { position, time, ..LocalModel::FREE };
        };
        let ContactStiffness(stiffness) = stiffness;
        LocalModel {
            force: (self.position - position) * stiffness,
            gradient: along(normal) * -stiffness,
            position,
            time,
            normal: Some(normal),
            ..LocalModel::FREE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::DeviceSample;
    use crate::device::link::HapticLink;

    const RADIUS: f32 = 0.07;

    /// A sphere, one of which no gradient is known deeper than 1.5 mm and farther off than the reach, as of voxels, a
    /// wall of 2 mm in the plane y = 0, or nothing.
    enum Body {
        Sphere,
        Voxels,
        Wall,
        Nothing,
    }

    impl Surface for Body {
        fn distance(&self, point: Vec3) -> (f32, Vec3) {
            match self {
                Self::Sphere => (point.length() - RADIUS, point.normalize_or_zero()),
                Self::Voxels => match Self::Sphere.distance(point) {
                    (distance, _) if distance < -1.5e-3 => (f32::NEG_INFINITY, Vec3::ZERO),
                    (distance, _) if distance > REACH => (f32::INFINITY, Vec3::ZERO),
                    near => near,
                },
                Self::Wall => (point.y.abs() - 1e-3, Vec3::Y * point.y.signum()),
                Self::Nothing => (f32::INFINITY, Vec3::ZERO),
            }
        }
    }

    /// A tool 3 mm deep, on its way round: the proxy stays on the surface, right above it.
    #[test]
    fn stays_on_the_surface() {
        let mut proxy = Proxy::new(Vec3::Y * 0.1);
        for step in 0..200 {
            let angle = step as f32 * 0.05;
            let outward = Vec3::new(angle.sin(), angle.cos(), 0.2).normalize();
            let tool = outward * (RADIUS - 3e-3);
            proxy.follow(tool, &Body::Sphere);
            assert!(proxy.touches());
            let off = proxy.position().length() - RADIUS;
            assert!(off.abs() < 2.0 * TOLERANCE, "{off} m off");
            let away = proxy.position().distance(outward * RADIUS);
            assert!(away < 10.0 * TOLERANCE, "{away} m from the nearest point, step {step}");
        }
        let out = proxy.position() * 2.0;
        proxy.follow(out, &Body::Sphere);
        assert!(!proxy.touches());
        assert_eq!(proxy.position(), out);
    }

    /// A tool that is deeper than a gradient is known as soon as it is felt is held out where it came in: from the
    /// tip of a drill that is in bone itself, and from far off between two frames.
    #[test]
    fn a_tool_that_is_deep_at_once_is_held_out() {
        let outward = Vec3::new(0.6, 0.8, 0.0);
        for from in [-0.6e-3, 1e-3, REACH, 0.05] {
            for depth in [1e-3, 2.6e-3, 8e-3] {
                let mut proxy = Proxy::new(outward * (RADIUS + from));
                proxy.follow(outward * (RADIUS - depth), &Body::Voxels);
                let off = proxy.position().distance(outward * RADIUS);
                assert!(proxy.touches() && off < 1e-5, "{off} m off, {depth} m deep from {from}");
            }
        }
        let mut proxy = Proxy::new(Vec3::ZERO);
        proxy.follow(outward * 0.01, &Body::Voxels);
        assert_eq!(proxy.normal, None, "it came from nowhere");
    }

    /// A tool that was pressed through a thin wall is pushed back to where it came from.
    #[test]
    fn keeps_its_side_of_a_thin_wall() {
        let mut proxy = Proxy::new(Vec3::Y * 0.01);
        for y in [5e-3, 0.5e-3, -0.5e-3, -5e-3] {
            proxy.follow(Vec3::new(0.0, y, 0.0), &Body::Wall);
        }
        assert!(proxy.touches());
        assert!(proxy.position().abs_diff_eq(Vec3::Y * 1e-3, 1e-6), "{}", proxy.position());
        proxy.follow(Vec3::Y * 2e-3, &Body::Wall);
        assert!(!proxy.touches());
    }

    /// Bone that is taken away from under a tool holds it no longer.
    #[test]
    fn lets_go_of_what_is_gone() {
        let mut link = HapticLink::new();
        let (_, mut end) = link.split();
        for depth in [0.5e-3, 3e-3, 30e-3] {
            let mut proxy = Proxy::new(Vec3::Y * 0.1);
            proxy.follow(Vec3::Y * (RADIUS - depth), &Body::Sphere);
            assert!(proxy.touches());
            let sample = DeviceSample::at(Vec3::Y * (RADIUS - 2.0 * depth));
            proxy.follow(sample.position, &Body::Nothing);
            assert_eq!(proxy, Proxy::new(sample.position), "{depth} m deep");
            let tool = ToolState { sample, ..end.tool() };
            let model = proxy.model(&tool, ContactStiffness::BONE);
            assert_eq!(model.force_at(sample.position), Vec3::ZERO);
            assert_eq!(proxy.held_out(Vec3::ZERO), Vec3::ZERO);
            proxy.follow(Vec3::Y * (RADIUS - depth), &Body::Sphere);
            assert!(proxy.touches(), "it is felt again");
        }
    }

    #[test]
    fn model_of_a_contact_and_of_a_gap() {
        let mut link = HapticLink::new();
        let (_, mut end) = link.split();
        let mut proxy = Proxy::new(Vec3::Y);
        for (height, force) in [(3e-3, 0.0), (-1e-3, 2.0)] {
            let sample = DeviceSample::at(Vec3::Y * (RADIUS + height));
            let tool = ToolState { sample, time: 3.0, ..end.tool() };
            proxy.follow(sample.position, &Body::Sphere);
            let model = proxy.model(&tool, ContactStiffness::BONE);
            assert_eq!((model.time, model.position), (3.0, sample.position));
            let pushed = model.force_at(sample.position);
            assert!(pushed.abs_diff_eq(Vec3::Y * force, 5e-3), "{pushed} at {height} m");
            let deep = model.force_at(Vec3::Y * (RADIUS - 1e-3));
            assert!(deep.abs_diff_eq(Vec3::Y * 2.0, 5e-3), "{deep} from {height} m");
        }
    }
}
