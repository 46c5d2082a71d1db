//! Following the blade's path over the surface.

use glam::DVec3;

use super::Sweep;
use super::surface::CutSurface;

/// How far beyond its ends a blade cuts, as a share of its length: as much as rounding may take from it.
const BEYOND: f64 = 1e-6;
/// The least sine of the angle between a blade and its way that is cutting; less is stabbing. Usually
/// 0.01.
const LEAST_SINE: f64 = 0.01;
/// The least way of a blade that is cutting, in metres; less is standing still. Usually 1 nm.
const LEAST_WAY: f64 = 1e-9;
/// How far behind the front the next border may be, in metres: the sides of a cut that has not opened
/// lie on each other up to rounding. Usually 1 µm.
const BEHIND: f64 = 1e-6;

/// The blade's path over the surface in one frame, as a straight way.
struct Path {
    sweep: Sweep,
    from: DVec3,
    to: DVec3,
    /// Along the blade.
    axis: DVec3,
}

/// Where a path crosses an edge.
struct Crossing {
    ends: [u32; 2],
    /// The share of the way from the first end.
    share: f64,
    /// The share of the path's way.
    time: f64,
}

impl CutSurface {
    /// Cuts where the blade has been, going on from the front of its cut, if it has one. The new
    /// front, if the blade is still in the surface.
    pub(crate) fn cut(&mut self, sweep: Sweep, front: Option<u32>) -> Option<u32> {
        let near = front.map(|front| self.position(front));
        let before = self.hit(&sweep.before, near);
        let now = self.hit(&sweep.now, before.map(|hit| hit.point).or(near));
        let along = match (before, now, near) {
            (Some(hit), ..) | (None, Some(hit), _) => hit.along,
            (None, None, Some(near)) => foot(&sweep, near),
            (None, None, None) => 0.5,
        };
        // A blade that has left the surface over its border goes on at the same height.
        let from = before.map(|hit| hit.point).or(near).unwrap_or(sweep.before.at(along));
        let to = now.map_or(sweep.now.at(along), |hit| hit.point);
        let axis = 0.5 * (sweep.before.at(1.0) - sweep.before.at(0.0))
            + 0.5 * (sweep.now.at(1.0) - sweep.now.at(0.0));
        let path = Path { sweep, from, to, axis };
        if !path.is_cutting() {
            return front.filter(|_| now.is_some());
        }
        let start = front.or_else(|| before.map(|hit| self.node_in(hit.triangle, hit.shares)));
        let end = self.follow(&path, start);
        self.separate();
        end.filter(|_| now.is_some())
    }

    /// Cuts along the path, from a node or else from the border. Where it ends: a node with the path's
    /// end among the triangles around it, or nowhere.
    fn follow(&mut self, path: &Path, start: Option<u32>) -> Option<u32> {
        // When the path was last at an edge. The front may be beside the path, at the end of that edge.
        let mut reached = 0.0;
        let mut front = match start {
            Some(front) => front,
            None => self.enter(path, &mut reached, &[])?,
        };
        // Several pieces may have a node in one place, where cuts crossed that have not opened: those from which
        // nothing lies ahead.
        let mut been = Vec::new();
        // No path crosses an edge twice, and no frame makes many new ones; this is so that it ends
        // whatever the surface looks like.
        for _ in 0..4 * self.triangles.len() {
            let next = self.next(path, front, reached).or_else(|| self.next_from_here(path, front));
            if let Some(Crossing { ends, share, time }) = next {
                let node = self.node_on(ends, share);
                self.slit([front, node]);
                (front, reached) = (node, time.max(reached));
            } else if self.ends_around(path, front) {
                return Some(front);
            } else {
                been.push(front);
                front = self.enter(path, &mut reached, &been)?;
            }
        }
        Some(front)
    }

    /// The sides opposite a node of the triangles around it.
    fn sides_around(&self, node: u32) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.fan(node).map(move |triangle| self.opposite(triangle, node))
    }

    /// Where the path leaves the fan of a node that it came to at a time.
    fn next(&self, path: &Path, front: u32, reached: f64) -> Option<Crossing> {
        let ahead = |crossing: &Crossing| {
            crossing.time > reached
                && crossing.time <= 1.0
                && path.reaches(self.point(crossing), crossing.time)
        };
        self.first(path, path.from, self.sides_around(front), ahead)
    }

    /// Where the straight way from a node to the path's end leaves the node's fan: for a front that the
    /// path has lost, when tissue has moved.
    fn next_from_here(&self, path: &Path, front: u32) -> Option<Crossing> {
        let here = self.position(front);
        let way = path.across(path.to - here);
        let ahead = |crossing: &Crossing| {
            let point = self.point(crossing);
            let along = (point - here).dot(way);
            along > 0.0 && along <= way.length_squared() && path.reaches(point, crossing.time)
        };
        self.first(path, here, self.sides_around(front), ahead)
    }

    /// Where the path comes to the border after a time, which becomes that of coming there, and at none of the nodes
    /// where it has been: the node there.
    fn enter(&mut self, path: &Path, reached: &mut f64, been: &[u32]) -> Option<u32> {
        let sides = self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let sides = sides.filter(|ends| !ends.iter().any(|end| been.contains(end)));
        let earliest = (*reached - BEHIND / path.across(path.to - path.from).length()).max(0.0);
        let ahead = |crossing: &Crossing| {
            (earliest..=1.0).contains(&crossing.time)
                && path.reaches(self.point(crossing), crossing.time)
                && self.count(crossing.ends) == 1
        };
        let Crossing { ends, share, time } = self.first(path, path.from, sides, ahead)?;
        *reached = reached.max(time);
        Some(self.node_on(ends, share))
    }

    /// The first of the sides' crossings with the path's plane through a point that will do.
    fn first(
        &self,
        path: &Path,
        through: DVec3,
        sides: impl Iterator<Item = [u32; 2]>,
        will_do: impl Fn(&Crossing) -> bool,
    ) -> Option<Crossing> {
        let normal = (path.to - through).cross(path.axis);
        let mut first: Option<Crossing> = None;
        for ends in sides {
            let [p, q] = ends.map(|node| (self.position(node) - through).dot(normal));
            // A node in the plane counts as on one side of it, so that one edge there is crossed.
            if (p >= 0.0) == (q >= 0.0) {
                continue;
            }
            let mut crossing = Crossing { ends, share: p / (p - q), time: 0.0 };
            crossing.time = path.time(self.point(&crossing));
            let earlier = first.as_ref().is_none_or(|first| crossing.time < first.time);
            if earlier && will_do(&crossing) {
                first = Some(crossing);
            }
        }
        first
    }

    fn point(&self, crossing: &Crossing) -> DVec3 {
        let [p, q] = crossing.ends.map(|node| self.position(node));
        p + (q - p) * crossing.share
    }

    /// Whether the path, which crosses no more edges of a node's fan, ends within that fan; it would
    /// cross one if it were longer, unless the node is at a border and nothing lies ahead.
    fn ends_around(&self, path: &Path, front: u32) -> bool {
        let here = self.position(front);
        let way = path.across(path.to - here);
        let ahead = |crossing: &Crossing| (self.point(crossing) - here).dot(way) > 0.0;
        let sides = self.sides_around(front);
        way.length() <= LEAST_WAY || self.first(path, here, sides, ahead).is_some()
    }
}

impl Path {
    /// Whether the blade goes sideways at all.
    fn is_cutting(&self) -> bool {
        let way = self.to - self.from;
        let sine = way.cross(self.axis).length();
        way.length() > LEAST_WAY && sine > LEAST_SINE * way.length() * self.axis.length()
    }

    /// What of a way is not along the blade: by that a leaning blade comes to a point at a time, whatever the point's
    /// height.
    fn across(&self, way: DVec3) -> DVec3 {
        way - self.axis * (way.dot(self.axis) / self.axis.length_squared())
    }

    /// When the blade passes a point, as a share of its way.
    fn time(&self, point: DVec3) -> f64 {
        let way = self.across(self.to - self.from);
        (point - self.from).dot(way) / way.length_squared()
    }

    /// Whether a point that the blade passes at a time is between its tip and its heel.
    fn reaches(&self, point: DVec3, time: f64) -> bool {
        let time = time.clamp(0.0, 1.0);
        let [tip, heel] = [0.0, 1.0].map(|end| {
            let (before, now) = (self.sweep.before.at(end), self.sweep.now.at(end));
            before + (now - before) * time
        });
        let along = (point - tip).dot(heel - tip) / (heel - tip).length_squared();
        (-BEYOND..=1.0 + BEYOND).contains(&along)
    }
}

/// The share of the way from the tip to the heel, before the sweep, that is nearest to a point.
fn foot(sweep: &Sweep, point: DVec3) -> f64 {
    let (tip, heel) = (sweep.before.at(0.0), sweep.before.at(1.0));
    ((point - tip).dot(heel - tip) / (heel - tip).length_squared()).clamp(0.0, 1.0)
}
