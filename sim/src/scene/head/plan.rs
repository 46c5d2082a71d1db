//! Where the operation takes place.

use glam::Vec3;

use super::anatomy::site;
use super::frame::{FRONT, UP};
use super::layers::Layers;
use super::radial::tangents;
use super::structures::resampled;
use crate::geometry::Volume;

/// The length of the incision, in metres; usually 90 mm.
const INCISION: f32 = 0.09;
/// The distance of its points, in metres; usually 3 mm.
const INCISION_STEP: f32 = 0.003;
/// The control points of the incision's curve, in metres to the front and upwards from the middle of
/// the operation: an arc around it that is open to the front and below, where the flap's vessels come
/// from.
const INCISION_CURVE: [[f32; 2]; 3] = [[0.032, 0.026], [-0.040, 0.040], [-0.024, -0.036]];
/// Half the opening's length and height, and the radius of its corners, in metres; usually 25, 20 and
/// 14 mm.
const OPENING: [f32; 3] = [0.025, 0.020, 0.014];
/// The middle of the opening, in metres to the front and upwards.
const OPENING_MIDDLE: [f32; 2] = [0.004, -0.002];
/// The distance of the opening's points, in metres; usually 2 mm.
const OPENING_STEP: f32 = 0.002;
/// How far from the incision forceps take hold, in metres; usually 6 mm.
const BITE: f32 = 0.006;
/// How far the flap and the scalp around it are drawn aside, in metres; usually 35 and 12 mm.
const DRAWN: [f32; 2] = [0.035, 0.012];
/// How high the flap is lifted off the skull, in metres; usually 20 mm.
const LIFTED: f32 = 0.02;
/// The widest gap in a bone that is still one, in metres; usually 4 mm.
const GAP: f32 = 0.004;

/// A place on the skull from which a tool goes in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// On the outer table, in metres.
    pub point: Vec3,
    /// Perpendicular to the outer table, into the head; of unit length.
    pub inward: Vec3,
    /// From there to the inner table along `inward`, in metres.
    pub thickness: f32,
}

/// How scalp is drawn aside at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Where the forceps or the hook takes hold, on the skin, in metres.
    pub from: Vec3,
    /// Where it is drawn, in metres.
    pub to: Vec3,
}

/// The operation's plan: a craniotomy at the right temple.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The incision on the skin, about 90 mm long, in points 3 mm apart; metres. It is an arc that is
    /// open to the patient's front and below: the flap's side.
    pub incision: Vec<Vec3>,
    /// The skin's normals there, outwards, of unit length.
    pub incision_normals: Vec<Vec3>,
    /// How the flap is lifted and drawn to the front and below, from the incision's upper end to its
    /// lower one: 3 places.
    pub flap: Vec<Pull>,
    /// How the scalp on the incision's other side is drawn away from it: 2 places.
    pub margin: Vec<Pull>,
    /// The burr hole: the first of `craniotomy`.
    pub burr_hole: Entry,
    /// The outline of the bone flap, about 50 mm × 40 mm with round corners, in points 2 mm apart:
    /// closed, without the first point a second time, counter-clockwise as seen from outside.
    pub craniotomy: Vec<Entry>,
    /// The middle of the bone flap, on the outer table.
    pub middle: Entry,
}

impl Plan {
    pub(super) fn new(layers: &Layers, skull: &Volume) -> Self {
        let chart = Chart::new(layers);
        let incision = incision(layers, &chart);
        let incision_normals = incision.iter().map(|&point| chart.normal(point, true)).collect();
        let (flap, margin) = pulls(layers, &chart, &incision);
        let craniotomy: Vec<Entry> =
            outline(&chart).into_iter().map(|point| chart.entry(skull, point)).collect();
        let [front, up] = OPENING_MIDDLE;
        let middle = chart.entry(skull, chart.on_skull(front, up));
        let burr_hole = craniotomy.first().copied().unwrap_or(middle);
        Self { incision, incision_normals, flap, margin, burr_hole, craniotomy, middle }
    }
}

/// The skull's surface around the middle of the operation, flattened.
struct Chart<'a> {
    layers: &'a Layers,
    front: Vec3,
    up: Vec3,
}

impl<'a> Chart<'a> {
    fn new(layers: &'a Layers) -> Self {
        let out = site();
        let front = (FRONT - out * FRONT.dot(out)).normalize();
        let across = out.cross(front);
        let up = if across.dot(UP) < 0.0 { -across } else { across };
        Self { layers, front, up }
    }

    /// The direction of what is so many metres to the front and upwards on the skull.
    fn direction(&self, front: f32, up: f32) -> Vec3 {
        let radius = self.layers.outer.at(site());
        (site() * radius + self.front * front + self.up * up).normalize()
    }

    fn on_skull(&self, front: f32, up: f32) -> Vec3 {
        let direction = self.direction(front, up);
        direction * self.layers.outer.at(direction)
    }

    /// The outward normal of the skin, or of the outer table, over or under a place.
    fn normal(&self, point: Vec3, skin: bool) -> Vec3 {
        const STEP: f32 = 0.08;
        let map = if skin { &self.layers.skin } else { &self.layers.outer };
        let out = point.normalize();
        let [x, y] = tangents(out).map(|tangent| {
            let [to, from] = [STEP, -STEP].map(|step| {
                let direction = (out + tangent * step).normalize();
                direction * map.at(direction)
            });
            to - from
        });
        let normal = x.cross(y).normalize_or(out);
        if normal.dot(out) < 0.0 { -normal } else { normal }
    }

    /// Where a tool above a place on the outer table enters the bone; by the layers where the volume has
    /// none.
    fn entry(&self, skull: &Volume, point: Vec3) -> Entry {
        const ABOVE: f32 = 0.004;
        const DEPTH: f32 = 0.03;
        const STEP: f32 = 0.000_1;
        let inward = -self.normal(point, false);
        let start = point - inward * ABOVE;
        let (mut entry, mut exit, mut before) = (None, 0.0, 0.0);
        for step in 0..(DEPTH / STEP) as u32 {
            let depth = step as f32 * STEP;
            let density = skull.density_at(start + inward * depth);
            if density >= 0.5 {
                entry.get_or_insert(depth);
            } else if before >= 0.5 {
                exit = depth;
            } else if entry.is_some() && depth - exit > GAP && exit > 0.0 {
                break;
            }
            before = density;
        }
        match entry {
            Some(entry) if exit > entry => {
                Entry { point: start + inward * entry, inward, thickness: exit - entry }
            }
            _ => {
                let thickness = self.layers.outer.at(point) - self.layers.inner.at(point);
                Entry { point, inward, thickness }
            }
        }
    }
}

/// The middle [`INCISION`] of the arc, on the skin.
fn incision(layers: &Layers, chart: &Chart<'_>) -> Vec<Vec3> {
    const PARTS: usize = 200;
    let arc = (0..=PARTS).map(|part| {
        let [a, b, c] = INCISION_CURVE;
        let t = part as f32 / PARTS as f32;
        let at = |axis: usize| {
            let s = 1.0 - t;
            s * s * a[axis] + 2.0 * s * t * b[axis] + t * t * c[axis]
        };
        let direction = chart.direction(at(0), at(1));
        direction * layers.skin.at(direction)
    });
    let arc: Vec<Vec3> = arc.collect();
    let lengths: Vec<f32> = arc
        .windows(2)
        .scan(0.0, |sum, pair| {
            *sum += pair[0].distance(pair[1]);
            Some(*sum)
        })
        .collect();
    let over = 0.5 * (lengths.last().copied().unwrap_or(0.0) - INCISION);
    let within = arc.iter().skip(1).zip(&lengths);
    let within = within.filter(|&(_, &length)| length >= over && length <= over + INCISION);
    resampled(&within.map(|(&point, _)| point).collect::<Vec<_>>(), INCISION_STEP)
}

/// How the flap, and the margin around it, are drawn aside.
fn pulls(layers: &Layers, chart: &Chart<'_>, incision: &[Vec3]) -> (Vec<Pull>, Vec<Pull>) {
    let (Some(&first), Some(&last)) = (incision.first(), incision.last()) else {
        return (Vec::new(), Vec::new());
    };
    let middle = incision[incision.len() / 2];
    let base = (first + last) * 0.5;
    let towards_base = (base - middle).normalize_or(chart.front);
    let pull = |share: f32, side: f32, drawn: f32, lifted: f32| {
        let at = incision[(share * (incision.len() - 1) as f32) as usize];
        let beside = at + towards_base * (side * BITE);
        let from = beside.normalize() * layers.skin.at(beside);
        let target = from + towards_base * (side * drawn);
        let to = target.normalize() * (layers.skin.at(target) + lifted);
        Pull { from, to }
    };
    let flap = [0.25, 0.5, 0.75].map(|share| pull(share, 1.0, DRAWN[0], LIFTED));
    let margin = [0.35, 0.65].map(|share| pull(share, -1.0, DRAWN[1], 0.0));
    (flap.to_vec(), margin.to_vec())
}

/// The outline of the opening on the outer table: sides and round corners, from the middle of the upper
/// back corner, where the bone is thick.
fn outline(chart: &Chart<'_>) -> Vec<Vec3> {
    const PARTS: usize = 16;
    let [long, high, round] = OPENING;
    let [front, up] = OPENING_MIDDLE;
    // Corners in turn, each a quarter circle (2t, 1 − t²)/(1 + t²), whose ends the sides join.
    let quarter = (0..=PARTS).map(|part| {
        let t = part as f32 / PARTS as f32;
        let scale = round / (1.0 + t * t);
        [2.0 * t * scale, (1.0 - t * t) * scale]
    });
    let quarter: Vec<[f32; 2]> = quarter.collect();
    let [inner_long, inner_high] = [long - round, high - round];
    // From up to the back, to below, to the front.
    let turns: [[f32; 4]; 4] = [
        [-1.0, 0.0, 0.0, 1.0],
        [0.0, -1.0, -1.0, 0.0],
        [1.0, 0.0, 0.0, -1.0],
        [0.0, 1.0, 1.0, 0.0],
    ];
    let corners = [[-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [1.0, 1.0]];
    let mut points = Vec::new();
    for ([a, b, c, d], [x, y]) in turns.into_iter().zip(corners) {
        for [u, v] in &quarter {
            let [x, y] = [x * inner_long + a * u + b * v, y * inner_high + c * u + d * v];
            points.push(chart.on_skull(front + x, up + y));
        }
    }
    points.rotate_left(PARTS / 2);
    points.extend(points.first().copied());
    let mut points = resampled(&points, OPENING_STEP);
    points.pop();
    // Seen from outside, the front lies to the right of up or to the left of it, by side.
    if chart.front.cross(chart.up).dot(site()) < 0.0 {
        points[1..].reverse();
    }
    points
}
