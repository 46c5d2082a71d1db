//! The side of the bone from which a bit came.

use glam::Vec3;

use super::Burr;

/// How far back the way of a bit is remembered, in its radii, along the normal and across it; usually 2: no wall in
/// which the two sides are both felt is thicker than the bit.
const MEMORY: f32 = 2.0;

/// The side of the bone that a bit touched in the frame before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// The bone's outward normal, of unit length.
    pub normal: Vec3,
    /// Whether the bit is farther in than where it came from: then no bone pushes it out on another side.
    pub is_inside: bool,
}

/// From which side a bit came into the bone that it touches, for [`Burr::side`].
///
/// In a thin wall the bone beyond the bit pushes it on, out through the other side, as soon as it is past the
/// middle; the same is felt of the opposite wall by a bit that a hand leads across a slot. What tells them
/// apart is the way: into the wall the bit has come against the push, across the slot along it. So a side
/// is held as long as the bit is farther in than where it last came from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approach {
    entry: Option<Entry>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    /// The bone's outward normal, of unit length.
    normal: Vec3,
    /// The outermost place of the bit on its way here, in metres.
    place: Vec3,
}

impl Approach {
    /// Notes which way the bone pushed a bit: of unit length, none where nothing touched it.
    pub fn follow(&mut self, burr: &Burr, normal: Option<Vec3>) {
        self.entry = normal.map(|normal| {
            let reach = MEMORY * burr.bit.radius;
            let way = burr.center - self.entry.map_or(burr.center, |entry| entry.place);
            let out = way.dot(normal);
            // Each by itself: a bit that slides along a wall stays as deep in it.
            let across = (way - normal * out).clamp_length_max(reach);
            Entry { normal, place: burr.center - across - normal * out.clamp(-reach, 0.0) }
        });
    }

    /// The side that a bit is on whose first ball is now at `center` (metres); none if it touched nothing.
    #[must_use]
    pub fn side(&self, center: Vec3) -> Option<Side> {
        let Entry { normal, place } = self.entry?;
        Some(Side { normal, is_inside: (center - place).dot(normal) <= 0.0 })
    }

    /// What it remembers: the normal, and a place in metres.
    pub(crate) fn state(&self) -> impl Iterator<Item = Vec3> + use<> {
        self.entry.into_iter().flat_map(|entry| [entry.normal, entry.place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::behavior::drill::Bit;

    /// The way back is remembered in and across to two radii each, and forgotten on the way out.
    #[test]
    fn remembers_where_a_bit_came_from() {
        let bit = Bit::BURR;
        let mut approach = Approach::default();
        let path = [
            ([0.0, 0.0], [0.0, 0.0]),
            ([0.5, -1.0], [0.0, 0.0]),
            ([9.0, -9.0], [7.0, -7.0]),
            ([9.0, -5.0], [7.0, -5.0]),
        ];
        for (to, from) in path {
            let [center, from] = [to, from].map(|[x, y]| Vec3::new(x, y, 0.0) * bit.radius);
            let burr = Burr { bit, center, axis: Vec3::Z, spin: 0.0, side: None };
            approach.follow(&burr, Some(Vec3::Y));
            let place = approach.state().last().expect("it touches bone");
            assert!(place.distance(from) < 1e-6, "{place}, not {from}");
        }
    }
}
