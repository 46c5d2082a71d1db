//! What a bit takes away.

use std::hash::Hasher;

use glam::Vec3;

use super::{Burr, FRICTION};
use crate::geometry::Volume;
use crate::message::Custom;
use crate::mix::mix;
use crate::object::Object;

/// Newton steps for the share that takes away what the work is enough for; usually 8. Each is exact up to
/// the next voxel that is empty.
const STEPS: usize = 8;

/// A message from a tool to bone: the bit is pressed on it, turning, for this frame.
///
/// Friction does the work µ·F·v in a second, for the load F and the mean speed v of the bit's surface where
/// bone is; each cubic metre of full bone takes the bit's specific energy. So what is taken away follows
/// load, speed and time, and not how often it is told; and a voxel twice as dense stands twice as long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Erode {
    /// The bit where it was when the load was felt.
    pub burr: Burr,
    /// How hard it was pressed on the bone, in newtons.
    pub load: f32,
}

impl Custom for Erode {
    fn process(&self, object: &mut Object) {
        if let Some(erosions) = object.behavior.erosions() {
            erosions.add(*self);
        }
    }
}

/// What a frame's bits are to take away from a volume, and what all have taken so far.
///
/// Bits of one frame do not see each other: how much each takes follows from the bone as it was before, and
/// the amounts are subtracted then, which gives the same in any order.
#[derive(Clone, Debug, Default)]
pub struct Erosions {
    waiting: Vec<Erode>,
    cuts: Vec<Cut>,
    supply: Vec<Supply>,
    removed: u64,
}

/// What one ball of a bit takes away.
#[derive(Clone, Copy, Debug)]
struct Cut {
    burr: Burr,
    center: Vec3,
    /// What a bit could take in all, of 255.
    bone: f32,
    /// Where its voxels end among all that were looked at.
    end: usize,
    /// The share that is taken of what lies within the ball, where the surface has the rim's speed.
    share: f32,
}

/// What a voxel has for a bit.
#[derive(Clone, Copy, Debug)]
struct Supply {
    /// The most that can be taken, of 255.
    most: f32,
    /// What a whole share would take, of 255.
    whole: f32,
    /// The speed of the bit's surface, as a share of the rim's.
    speed: f32,
}

impl Erosions {
    /// None.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Puts one down for the next [`Erosions::apply`]; one that is not finite, or without load or spin, takes
    /// nothing away.
    pub fn add(&mut self, erode: Erode) {
        let Erode { burr, load } = erode;
        let finite = burr.center.is_finite() && burr.axis.is_finite() && burr.spin.is_finite();
        if finite && load > 0.0 && load.is_finite() && burr.spin != 0.0 {
            self.waiting.push(erode);
        }
    }

    /// What was taken away so far; 255 are a full voxel.
    #[must_use]
    pub fn removed(&self) -> u64 {
        self.removed
    }

    /// Takes away what was put down, for `time` seconds of work, and says how much; 255 are a full voxel.
    ///
    /// Densities are whole numbers. What is left over of each voxel's amount is made up for in later
    /// frames without remembering it: amounts are rounded up or down by a sequence of the frame's number
    /// that is uniform for each voxel (the multiples of the golden ratio, from where the voxel's number
    /// says), so that over many frames their sum is right to a unit or two.
    pub fn apply(&mut self, volume: &mut Volume, frame: u64, time: f32) -> u64 {
        let Self { waiting, cuts, supply, removed } = self;
        for erode in waiting.drain(..) {
            plan(volume, &erode, time, supply, cuts);
        }
        let mut now = 0;
        for Cut { burr, center, share, .. } in cuts.drain(..) {
            let axis = volume.turned_back(burr.axis);
            now += volume.remove(center, burr.bit.radius, |voxel| {
                let part = (share * burr.relative_speed(axis, voxel.offset)).min(1.0);
                rounded(part * voxel.overlap * 255.0, voxel.index, frame)
            });
        }
        *removed += now;
        now
    }

    /// Adds what it remembers to a state hash.
    pub fn hash_state(&self, hasher: &mut dyn Hasher) {
        hasher.write(&self.removed.to_le_bytes());
    }
}

/// Says what each ball of a bit takes; the load is shared out by the bone that they can reach.
fn plan(volume: &Volume, erode: &Erode, time: f32, supply: &mut Vec<Supply>, cuts: &mut Vec<Cut>) {
    let Erode { burr, load } = *erode;
    let first = cuts.len();
    supply.clear();
    for center in burr.balls() {
        let start = supply.len();
        look(volume, &burr, center, supply);
        let bone = supply[start..].iter().map(|voxel| voxel.most).sum();
        cuts.push(Cut { burr, center, bone, end: supply.len(), share: 0.0 });
    }
    let all: f32 = cuts[first..].iter().map(|cut| cut.bone).sum();
    let mut start = 0;
    for cut in &mut cuts[first..] {
        let voxels = &supply[start..cut.end];
        start = cut.end;
        if cut.bone > 0.0 {
            let moved: f32 = voxels.iter().map(|voxel| voxel.most * voxel.speed).sum();
            let speed = burr.bit.radius * burr.spin.abs() * moved / cut.bone;
            let work = FRICTION * load * (cut.bone / all) * speed * time;
            let wanted = work / burr.bit.specific_energy / volume.voxel_volume() * 255.0;
            cut.share = share(voxels, wanted);
        }
    }
}

/// The voxels with bone that a ball of the bit overlaps.
fn look(volume: &Volume, burr: &Burr, center: Vec3, supply: &mut Vec<Supply>) {
    let axis = volume.turned_back(burr.axis);
    volume.visit(center, burr.bit.radius, |voxel| {
        if voxel.density > 0 {
            let speed = burr.relative_speed(axis, voxel.offset);
            let within = voxel.overlap * 255.0;
            let most = within.min(f32::from(voxel.density));
            supply.push(Supply { most, whole: within * speed, speed });
        }
    });
}

/// The share that takes as much as is wanted, or all there is: Newton's method from 0 on a sum of
/// pieces of straight lines that bend down only, so that it never takes more.
fn share(voxels: &[Supply], wanted: f32) -> f32 {
    let mut share = 0.0;
    for _ in 0..STEPS {
        let (mut taken, mut slope) = (0.0, 0.0);
        for voxel in voxels {
            let part = share * voxel.whole;
            taken += part.min(voxel.most);
            slope += if part < voxel.most { voxel.whole } else { 0.0 };
        }
        if slope == 0.0 {
            // All that there is; a share above the slowest speed's inverse takes no more.
            return 1.0 / Burr::TIP_SPEED;
        }
        share += (wanted - taken).max(0.0) / slope;
    }
    share
}

/// An amount as a whole number, up or down in turns.
fn rounded(amount: f32, [x, y, z]: [u32; 3], frame: u64) -> u8 {
    let number = u64::from(z) << 42 | u64::from(y) << 21 | u64::from(x);
    let golden = (frame as u32).wrapping_mul(0x9e37_79b9);
    let turn = (mix(number) as u32).wrapping_add(golden) >> 8;
    (amount + turn as f32 / (1_u32 << 24) as f32) as u8
}
