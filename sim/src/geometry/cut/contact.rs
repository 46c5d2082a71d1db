//! Where a blade crosses a surface.

use glam::DVec3;

use super::Blade;
use super::surface::CutSurface;

/// A place where a blade crosses a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub(super) triangle: usize,
    /// The shares of the triangle's corners in it.
    pub(super) shares: [f64; 3],
    /// In metres.
    pub(super) point: DVec3,
    /// The share of the way from the blade's tip to its heel.
    pub(super) along: f64,
}

impl CutSurface {
    /// Where the blade crosses the surface: nearest to a point or, without one, to the heel.
    pub(super) fn hit(&self, blade: &Blade, near: Option<DVec3>) -> Option<Hit> {
        let distance = |hit: &Hit| match near {
            Some(near) => (hit.point - near).length_squared(),
            None => 1.0 - hit.along,
        };
        let mut best: Option<(f64, Hit)> = None;
        for triangle in 0..self.triangles.len() {
            let Some(hit) = self.hit_triangle(triangle, blade) else { continue };
            let distance = distance(&hit);
            if best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, hit));
            }
        }
        best.map(|(_, hit)| hit)
    }

    /// By the volumes of the tetrahedra that the blade spans with the triangle's sides (Plücker's test).
    fn hit_triangle(&self, triangle: usize, blade: &Blade) -> Option<Hit> {
        let corners = self.triangles[triangle].map(|node| self.position(node));
        let (tip, heel) = (blade.tip.as_dvec3(), blade.heel.as_dvec3());
        let way = heel - tip;
        let [a, b, c] = corners.map(|corner| corner - tip);
        let volumes = [b.cross(c).dot(way), c.cross(a).dot(way), a.cross(b).dot(way)];
        let total = volumes[0] + volumes[1] + volumes[2];
        let inside = volumes.iter().all(|&volume| volume >= 0.0)
            || volumes.iter().all(|&volume| volume <= 0.0);
        if !inside || total == 0.0 {
            return None;
        }
        let shares = volumes.map(|volume| volume / total);
        let point = corners[0] * shares[0] + corners[1] * shares[1] + corners[2] * shares[2];
        let along = (point - tip).dot(way) / way.length_squared();
        (0.0..=1.0).contains(&along).then_some(Hit { triangle, shares, point, along })
    }
}
