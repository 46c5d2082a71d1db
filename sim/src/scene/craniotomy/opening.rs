//! How the opening in the skull came out, beside the plan.

use std::any::Any;

use glam::Vec3;

use super::freeing;
use crate::behavior::Bone;
use crate::behavior::drill::Bit;
use crate::behavior::piece::Piece;
use crate::geometry::{Bounds, Volume};
use crate::object::Object;
use crate::scene::head::{Entry, Head, Plan};

/// How far beside the planned cuts bone may be taken away, in metres; usually 1 mm.
pub(super) const TOLERANCE: f32 = 0.001;
/// How far above the outer table and below the inner one the planned cuts go, in metres; usually 3 mm.
const BEYOND: f32 = 0.003;
/// How far from the outline a cut's edge is looked for, in metres; usually 10 mm.
const REACH: f32 = 0.01;
/// The distance of these looks, in metres; usually 0.5 mm, a voxel.
const STEP: f32 = 0.000_5;
/// How deep in the bone it is looked for, as a share of its thickness; usually a quarter: the outer table.
const DEPTH: f32 = 0.25;
/// The density below which there never was bone to cut, of 1; usually a quarter.
const NO_BONE: f32 = 0.25;

/// How far the opening's edge is from where the plan has it.
///
/// The plan's outline is the middle of a craniotome's cut, so the planned edge is half a cut outside of it. The
/// edge is looked for at each of the outline's points, across the outline and within 10 mm of it, in the
/// outer table; not in the burr hole, which makes its own edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// The mean over the places where there is an edge, in metres.
    pub mean: f32,
    /// The greatest, in metres.
    pub greatest: f32,
    /// The share of the outline where there is an edge, from 0, exclusive, to 1.
    pub cut: f32,
}

/// What the plan takes away of the skull: a craniotome's cut along the outline and the burr hole, each
/// [`TOLERANCE`] wider on every side.
pub(super) struct Planned {
    voxels: Vec<[i32; 3]>,
    /// What they held before the operation; 255 are a full voxel.
    full: u64,
}

impl Planned {
    pub(super) fn new(head: &Head) -> Self {
        let Plan { craniotomy, burr_hole, .. } = &head.plan;
        let mut voxels = Vec::new();
        let next = craniotomy.iter().cycle().skip(1);
        for ends in craniotomy.iter().zip(next) {
            push_cut(&head.skull, ends, Bit::CRANIOTOME.radius + TOLERANCE, &mut voxels);
        }
        let hole = (burr_hole, burr_hole);
        push_cut(&head.skull, hole, Bit::PERFORATOR.radius + TOLERANCE, &mut voxels);
        voxels.sort_unstable();
        voxels.dedup();
        let mut planned = Self { voxels, full: 0 };
        planned.full = planned.left(&head.skull, [0; 3]);
        planned
    }

    /// What is left in a volume that begins at the skull's voxel `first`.
    fn left(&self, volume: &Volume, first: [i32; 3]) -> u64 {
        let own = |voxel: &[i32; 3]| [0, 1, 2].map(|axis| voxel[axis] - first[axis]);
        self.voxels.iter().map(|voxel| u64::from(volume.density(own(voxel)))).sum()
    }
}

/// Adds the voxels of a cut from one entry to another, so far to each side.
fn push_cut(skull: &Volume, (from, to): (&Entry, &Entry), reach: f32, voxels: &mut Vec<[i32; 3]>) {
    let depths = -BEYOND..=from.thickness.max(to.thickness) + BEYOND;
    let ends =
        [from, to].map(|end| [*depths.start(), *depths.end()].map(|z| end.point + end.inward * z));
    let bounds = Bounds::around(ends.into_iter().flatten());
    let [xs, ys, zs] = freeing::voxels(skull, &bounds.inflated(reach));
    // In the skull's own axes.
    let inward = skull.turned_back((from.inward + to.inward).normalize_or(from.inward));
    let [start, end] = [from, to].map(|end| skull.to_local(end.point));
    let across = |way: Vec3| way - inward * way.dot(inward);
    let length = across(end - start);
    // Ends may be equal.
    let per_length = length / length.length_squared().max(f32::MIN_POSITIVE);
    let rows = zs.flat_map(|z| ys.clone().map(move |y| (y, z)));
    for [x, y, z] in rows.flat_map(|(y, z)| xs.clone().map(move |x| [x, y, z])) {
        let middle = (Vec3::new(x as f32, y as f32, z as f32) + 0.5) * skull.spacing();
        let way = middle - start;
        let aside = across(way);
        let share = aside.dot(per_length).clamp(0.0, 1.0);
        let near = aside.distance_squared(length * share) <= reach * reach;
        if near && depths.contains(&way.dot(inward)) {
            voxels.push([x, y, z].map(|index| index as i32));
        }
    }
}

/// What became of the skull's bone.
pub(super) struct Opening<'a> {
    head: &'a Head,
    planned: &'a Planned,
    /// What was drilled away; 255 are a full voxel.
    removed: u64,
    /// What is left of what the plan takes away; likewise.
    left: u64,
    margin: Option<Margin>,
}

impl<'a> Opening<'a> {
    /// What is known before any bone was looked at.
    pub(super) fn new(head: &'a Head, planned: &'a Planned) -> Self {
        Self { head, planned, removed: 0, left: 0, margin: None }
    }

    /// Looks at an object; what is no bone is passed over.
    pub(super) fn see(&mut self, object: &Object) {
        let Some(volume) = object.geometry.as_volume() else { return };
        let behavior: &dyn Any = &*object.behavior;
        if let Some(bone) = behavior.downcast_ref::<Bone>() {
            self.removed += bone.removed();
            self.left += self.planned.left(volume, [0; 3]);
            self.margin = margin(self.head, volume);
        } else if let Some(piece) = behavior.downcast_ref::<Piece>() {
            self.removed += piece.removed();
            if let Some(seat) = piece.seat() {
                let skull = &self.head.skull;
                let first = (skull.to_local(seat.translation) / skull.spacing()).round();
                self.left += self.planned.left(volume, first.to_array().map(|at| at as i32));
            }
        }
    }

    pub(super) fn margin(&self) -> Option<Margin> {
        self.margin
    }

    /// The bone that was drilled away, in cubic metres of full bone.
    pub(super) fn removed(&self) -> f64 {
        self.volume(self.removed)
    }

    /// What of it was not planned; likewise.
    pub(super) fn outside(&self) -> f64 {
        let planned = self.planned.full.saturating_sub(self.left);
        self.volume(self.removed.saturating_sub(planned))
    }

    /// The volume of so much bone, in cubic metres; 255 are a full voxel.
    fn volume(&self, bone: u64) -> f64 {
        bone as f64 / 255.0 * f64::from(self.head.skull.voxel_volume())
    }
}

/// How far the edge of what is missing of the skull is from where the plan has it; none if there is no edge.
fn margin(head: &Head, skull: &Volume) -> Option<Margin> {
    let Plan { craniotomy, burr_hole, middle, .. } = &head.plan;
    let (mut sum, mut greatest, mut found, mut all) = (0.0, 0.0_f32, 0.0, 0.0);
    for (place, entry) in craniotomy.iter().enumerate() {
        let of_hole = Bit::PERFORATOR.radius + TOLERANCE;
        if entry.point.distance(burr_hole.point) < of_hole {
            continue;
        }
        all += 1.0;
        let count = craniotomy.len();
        let along =
            craniotomy[(place + 1) % count].point - craniotomy[(place + count - 1) % count].point;
        let across = along.cross(entry.inward).normalize_or_zero();
        let outwards = across * across.dot(entry.point - middle.point).signum();
        if let Some(error) = edge(&head.skull, skull, entry, outwards) {
            (sum, greatest, found) = (sum + error, greatest.max(error), found + 1.0);
        }
    }
    (found > 0.0).then(|| Margin { mean: sum / found, greatest, cut: found / all })
}

/// How far the edge that is nearest to the planned one is from it.
fn edge(intact: &Volume, skull: &Volume, entry: &Entry, outwards: Vec3) -> Option<f32> {
    let start = entry.point + entry.inward * (DEPTH * entry.thickness);
    // The share that is left of the bone so far outwards: along the skull, which is round.
    let left = |out: f32| {
        let place = (start + outwards * out).normalize() * start.length();
        let bone = intact.density_at(place);
        (bone >= NO_BONE).then(|| skull.density_at(place) / bone)
    };
    let steps = (REACH / STEP) as i32;
    let looks = (-steps..=steps).map(|step| step as f32 * STEP);
    let looks: Vec<(f32, f32)> = looks.filter_map(|out| Some((out, left(out)?))).collect();
    let edges = looks.windows(2).filter(|pair| pair[0].1 < 0.5 && pair[1].1 >= 0.5);
    let errors = edges.map(|pair| {
        let [(from, below), (to, above)] = [pair[0], pair[1]];
        let at = from + (to - from) * (0.5 - below) / (above - below);
        (at - Bit::CRANIOTOME.radius).abs()
    });
    errors.min_by(f32::total_cmp)
}
