//! A hand, a bit and bone in a loop, as frames run it.

use glam::Vec3;
use parry3d::math::Pose;

use super::*;
use crate::geometry::Volume;
use crate::scene::bone_piece;

const TIME: f32 = 1.0 / 60.0;

/// A drill in a hand over bone.
struct Bench {
    volume: Volume,
    erosions: Erosions,
    feed: Feed,
    burr: Burr,
    frame: u64,
    waiting: Option<Erode>,
    reaction: Reaction,
    approach: Approach,
}

impl Bench {
    fn new(volume: Volume, bit: Bit, tip: Vec3, spin: f32, strength: f32) -> Self {
        let step = 0.5 * volume.spacing().min_element();
        let resistance = if bit == Bit::PERFORATOR { 3e3 } else { Feed::RESISTANCE };
        let feed = Feed::new(strength, resistance, 0.5 * bit.radius, step).expect("valid");
        let center = tip + Vec3::Z * bit.radius;
        Self {
            volume,
            erosions: Erosions::new(),
            feed,
            burr: Burr { bit, center, axis: Vec3::Z, spin, side: None },
            frame: 0,
            waiting: None,
            reaction: Reaction::default(),
            approach: Approach::default(),
        }
    }

    /// What `BurrInBone` and `BurrForce` tell a tool.
    fn react(&self) -> Reaction {
        let mut reaction = Reaction::default();
        for center in self.burr.balls() {
            let overlap = Overlap::new(&self.volume, &self.burr, center);
            let Some(normal) = overlap.normal else { continue };
            let force = self.burr.bit.elastic_force(overlap.depth);
            reaction.elastic += normal * force;
            reaction.stiffness += normal * self.burr.bit.elastic_stiffness(overlap.depth);
            reaction.force += normal * force
                + self.burr.axis.cross(normal) * (FRICTION * force * self.burr.spin.signum());
            reaction.tip += self.burr.bit.elastic_force(overlap.tip_depth);
        }
        reaction
    }

    /// A frame: contacts, the bone's update, the tool's update.
    fn step(&mut self, intended: Vec3) -> u64 {
        self.reaction = self.react();
        if let Some(erode) = self.waiting.take() {
            self.erosions.add(erode);
        }
        let removed = self.erosions.apply(&mut self.volume, self.frame, TIME);
        self.approach.follow(&self.burr, self.reaction.normal());
        self.waiting = Some(Erode { burr: self.burr, load: self.feed.load(&self.reaction) });
        self.burr.center = self.feed.next(self.burr.center, intended, &self.reaction, TIME);
        self.burr.side = self.approach.side(self.burr.center);
        self.frame += 1;
        removed
    }

    fn tip(&self) -> Vec3 {
        self.burr.center - Vec3::Z * self.burr.bit.radius
    }
}

/// The highest point of a bone piece, and how thick it is.
const TOP: Vec3 = Vec3::new(0.032, 0.032, 0.044);
const THICKNESS: f32 = 7e-3;
/// The radius of its outer surface.
const CURVATURE: f32 = 0.085;

/// Bar: a perforator under a constant push stops within 1 mm of the inner table's far side.
#[test]
fn a_perforator_stops_where_the_bone_ends() {
    let bone = bone_piece(128, Pose::IDENTITY).expect("128 voxels");
    for (x, y) in [(0.0_f32, 0.0_f32), (3.1e-3, 1.7e-3), (-4.3e-3, 2.2e-3), (1.3e-3, -6e-3)] {
        let down = CURVATURE - (CURVATURE * CURVATURE - x * x - y * y).sqrt();
        let top = TOP + Vec3::new(x, y, -down);
        let axis = (top - TOP + Vec3::Z * CURVATURE).normalize();
        let mut bench = Bench::new(bone.clone(), Bit::PERFORATOR, top, 0.0, Perforator::PUSH);
        bench.burr.axis = axis;
        bench.burr.center = top + axis * (Bit::PERFORATOR.radius + 2e-3);
        let depth = |bench: &Bench| (top - bench.burr.center).dot(axis) + Bit::PERFORATOR.radius;
        let (mut clutch, mut deepest) = (Perforator::new(), f32::MIN);
        let (mut started, mut stopped) = (false, None);
        for frame in 0..1_500 {
            bench.step(top - axis * 0.05);
            bench.burr.spin = clutch.turn(bench.reaction.tip);
            if clutch.is_engaged() {
                assert_eq!(stopped, None, "it engages again in frame {frame}");
                started = true;
            } else if started {
                stopped.get_or_insert(frame);
            }
            if started {
                deepest = deepest.max(depth(&bench));
            }
        }
        let past = deepest - THICKNESS;
        assert!((0.0..1e-3).contains(&past), "{past} m past the inner table at {x}, {y}");
        assert!(stopped.is_some());
    }
}

/// Full bone of 20 mm up to z = 15 mm, of so many 255ths.
fn block(density: u8) -> Volume {
    let full = |voxel: [u32; 3]| if voxel[2] < 30 { density } else { 0 };
    Volume::from_fn([40; 3], Vec3::splat(5e-4), Pose::IDENTITY, full).expect("it is small")
}

const SURFACE: Vec3 = Vec3::new(0.01, 0.01, 0.015);

#[test]
fn a_constant_push_settles_without_oscillation() {
    for push in [5.0, 10.0, 20.0] {
        let tip = SURFACE + Vec3::Z * 1e-3;
        let mut bench = Bench::new(block(255), Bit::BURR, tip, 0.0, push);
        let mut depth = bench.tip().z;
        let mut steps = Vec::new();
        for _ in 0..120 {
            bench.step(SURFACE - Vec3::Z * 0.01);
            steps.push(depth - bench.tip().z);
            depth = bench.tip().z;
        }
        let back = steps.iter().copied().fold(0.0, f32::min);
        // It meets the bone by a free step, and comes back from that at most once.
        let meets = steps.iter().position(|&step| step < 0.0).unwrap_or(0);
        let later = &steps[meets + 1..];
        let turns = later.windows(2).filter(|pair| pair[0] * pair[1] < -1e-14).count();
        assert!(turns <= 1, "{turns} turns, {back} m back: {later:?}");
        assert!(steps[119].abs() < 1e-7, "{} m in the last frame", steps[119]);
        assert!((bench.reaction.elastic.z - push).abs() < 0.02 * push, "{:?}", bench.reaction);
        assert!((bench.tip() - SURFACE).truncate().length() < 1e-4, "{}", bench.tip());
    }
}

/// A thin bit as a tool moves it, upright and at rest, its lowest ball at a place in bone.
fn thin(bit: Bit, volume: Volume, center: Vec3) -> Bench {
    let mut bench = Bench::new(volume, bit, center - Vec3::Z * bit.radius, 0.0, 10.0);
    let feed = Feed::new(10.0, Feed::RESISTANCE, bit.radius, 2.5e-4);
    bench.feed = feed.expect("all are positive");
    bench
}

/// Many of its balls press on an edge at once, from wherever they come.
#[test]
fn a_rod_settles_on_an_edge_without_oscillation() {
    let edge = |[x, _, z]: [u32; 3]| if x >= 20 && (6..20).contains(&z) { 255 } else { 0 };
    let bone = Volume::from_fn([40; 3], Vec3::splat(5e-4), Pose::IDENTITY, edge);
    let bone = bone.expect("it is small");
    for number in 0..24 {
        let gap = Bit::CRANIOTOME.radius + 5e-5 * number as f32;
        let mut bench = thin(Bit::CRANIOTOME, bone.clone(), Vec3::new(0.01 - gap, 0.01, 2e-3));
        for _ in 0..200 {
            bench.step(Vec3::new(0.02, 0.01, 2e-3));
        }
        let before = bench.burr.center;
        bench.step(Vec3::new(0.02, 0.01, 2e-3));
        let moved = (bench.burr.center - before).length();
        assert!(moved < 1e-6, "{moved} m in the last frame after {gap} m");
        assert!((bench.reaction.load() - 10.0).abs() < 0.1, "{:?}", bench.reaction);
    }
}

/// A bit that is pressed past the middle of a thin wall stays on its side, however far it is led along it.
#[test]
fn a_thin_wall_holds_a_bit_that_slides_along_it() {
    let wall = |[_, _, z]: [u32; 3]| if z == 20 { 255 } else { 0 };
    let bone = Volume::from_fn([110, 20, 40], Vec3::splat(5e-4), Pose::IDENTITY, wall);
    let middle = Vec3::new(5e-3, 5e-3, 20.5 * 5e-4);
    let ball = Bit { length: 0.0, ..Bit::CRANIOTOME };
    let mut bench = thin(ball, bone.expect("it is small"), middle + Vec3::Z * 2e-3);
    let hand = middle - Vec3::Z * 1e-3;
    for _ in 0..60 {
        bench.step(hand);
    }
    for frame in 0..240 {
        bench.step(hand + Vec3::X * (0.01 * TIME * frame as f32));
        let (force, deep) = (bench.reaction.elastic.z, middle.z - bench.burr.center.z);
        assert!(deep > 1e-5, "{deep} m past the middle in frame {frame}");
        assert!(force > 1.0, "{force} N in frame {frame}");
    }
    assert!(bench.burr.center.x - middle.x > 0.03, "{}", bench.burr.center);
}

/// What a bit touches on the other side of a slot pushes it back, though it touched this side just before.
#[test]
fn the_other_wall_of_a_slot_is_no_way_through() {
    let walls = |[x, _, _]: [u32; 3]| if (18..22).contains(&x) { 0 } else { 255 };
    let bone = Volume::from_fn([40; 3], Vec3::splat(5e-4), Pose::IDENTITY, walls);
    let bone = bone.expect("it is small");
    for speed in [0.01, 0.02, 0.05, 1.0] {
        let middle = Vec3::new(0.01, 0.01, 5e-3);
        let mut bench = thin(Bit::CRANIOTOME, bone.clone(), middle);
        for _ in 0..60 {
            bench.step(middle - Vec3::X * 4e-3);
        }
        let mut pressed = 0.0;
        for frame in 0..200 {
            let way = (-4e-3 + speed * TIME * frame as f32).min(4e-3);
            bench.step(middle + Vec3::X * way);
            let across = bench.burr.center.x - middle.x;
            assert!(across < 1.2e-3, "{across} m across in frame {frame} at {speed} m/s");
            if frame >= 180 {
                // It trembles between walls that are nearer to each other than it is wide.
                let force = bench.reaction.elastic.x;
                assert!((0.0..2e-4).contains(&across), "{across} m across in frame {frame}");
                assert!((-33.0..0.0).contains(&force), "{force} N in frame {frame}");
                pressed += force / 20.0;
            }
        }
        assert!((-20.0..-5.0).contains(&pressed), "{pressed} N on the other wall");
    }
}

#[test]
fn in_contact_no_frame_moves_by_more_than_half_a_voxel() {
    let mut bench = Bench::new(block(255), Bit::BURR, SURFACE - Vec3::Z * 2e-4, 3_000.0, 20.0);
    for frame in 0..300 {
        let before = bench.burr.center;
        let aside = Vec3::X * 5e-3 * if frame / 60 % 2 == 0 { 1.0 } else { -1.0 };
        bench.step(SURFACE + aside - Vec3::Z * 5e-3);
        let moved = bench.burr.center - before;
        if let Some(normal) = bench.reaction.normal() {
            let moved = (moved - normal * moved.dot(normal).max(0.0)).length();
            assert!(moved <= 2.51e-4, "{moved} m in {frame}");
        }
    }
    // And out of it there is no limit but that of free steps.
    let before = bench.burr.center;
    bench.step(SURFACE + Vec3::Z * 0.05);
    assert!(bench.burr.center.z - before.z > 1e-3);
}

/// The work µ·F·v of a second over the specific energy, for the mean speed v.
#[test]
fn a_burr_goes_deeper_at_the_rate_of_removal() {
    let depth_after = |density, frames| {
        let mut bench = Bench::new(block(density), Bit::BURR, SURFACE, 3_000.0, 10.0);
        for _ in 0..40 {
            bench.step(SURFACE - Vec3::Z * 0.05);
        }
        let (start, removed) = (bench.tip().z, bench.erosions.removed());
        for _ in 0..frames {
            bench.step(SURFACE - Vec3::Z * 0.05);
        }
        let voxels = (bench.erosions.removed() - removed) as f32 / 255.0;
        (start - bench.tip().z, voxels * bench.volume.voxel_volume())
    };
    let (depth, volume) = depth_after(255, 120);
    // Between the speeds at the tip and at the rim, and near what the bit's description says.
    let rate = volume / 2.0;
    assert!((30e-9..80e-9).contains(&rate), "{rate} m³/s");
    // A hole of the burr's own width, once it is half in.
    let hole = std::f32::consts::PI * Bit::BURR.radius.powi(2) * depth;
    assert!((0.8..1.25).contains(&(volume / hole)), "{volume} m³ for {depth} m");
    let (soft, _) = depth_after(100, 30);
    let (hard, _) = depth_after(255, 30);
    assert!(soft > 1.5 * hard, "{soft} m in soft bone, {hard} m in hard");
}

#[test]
fn what_is_removed_follows_load_and_time_and_not_the_number_of_calls() {
    let removed = |calls: u32, load: f32, spin: f32| {
        let (mut volume, mut erosions) = (block(255), Erosions::new());
        let center = SURFACE + Vec3::Z * 2e-3;
        let axis = Vec3::new(0.6, 0.0, 0.8);
        let burr = Burr { bit: Bit::BURR, center, axis, spin, side: None };
        for call in 0..calls {
            erosions.add(Erode { burr, load });
            erosions.apply(&mut volume, u64::from(call), 0.02 / calls as f32);
        }
        let missing: u64 = volume.densities().map(u64::from).sum();
        assert_eq!(erosions.removed(), 40 * 40 * 30 * 255 - missing);
        erosions.removed() as f32
    };
    let once = removed(1, 10.0, 3_000.0);
    assert!(once > 1_500.0, "{once}");
    for calls in [2, 5, 20, 100, 1_000] {
        let share = removed(calls, 10.0, 3_000.0) / once;
        assert!((share - 1.0).abs() < 0.03, "{calls} calls: {share}");
    }
    for (load, spin) in [(5.0, 3_000.0), (10.0, -1_500.0)] {
        let share = removed(10, load, spin) / once;
        assert!((share - 0.5).abs() < 0.02, "{share} at {load} N, {spin}/s");
    }
    for (load, spin) in [(0.0, 3e3), (10.0, 0.0), (f32::NAN, 3e3), (-1.0, 3e3), (1.0, f32::NAN)] {
        assert_eq!(removed(3, load, spin), 0.0);
    }
    // More than there is.
    assert!(removed(1, 1e9, 3e3) < 2.5 * removed(1, 100.0, 3e3));
}

#[test]
fn two_bits_of_one_frame_may_come_in_any_order() {
    let bone = bone_piece(96, Pose::IDENTITY).expect("96 voxels");
    let top = TOP - Vec3::Z * 1e-3;
    let burr = |bit, aside: Vec3, spin| Erode {
        burr: Burr { bit, center: top + aside, axis: Vec3::Z, spin, side: None },
        load: 9.0,
    };
    let bits = [
        burr(Bit::BURR, Vec3::ZERO, 3e3),
        burr(Bit::PERFORATOR, Vec3::new(2e-3, 1e-3, 3e-3), 1e2),
        burr(Bit::CRANIOTOME, Vec3::new(-1e-3, 0.0, -4e-3), 5e3),
    ];
    let drilled = |order: [usize; 3]| {
        let (mut volume, mut erosions) = (bone.clone(), Erosions::new());
        for frame in 0..20 {
            order.iter().for_each(|&bit| erosions.add(bits[bit]));
            erosions.apply(&mut volume, frame, TIME);
        }
        (volume.digest(), erosions.removed())
    };
    let expected = drilled([0, 1, 2]);
    assert!(expected.1 > 10_000);
    for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        assert_eq!(drilled(order), expected);
    }
}

#[test]
fn a_rod_has_its_balls_along_the_axis() {
    let burr = Burr { bit: Bit::CRANIOTOME, center: Vec3::X, axis: Vec3::Y, spin: 1.0, side: None };
    let balls: Vec<Vec3> = burr.balls().collect();
    assert_eq!(balls.len(), 9);
    assert_eq!(balls[0], Vec3::X);
    assert!((balls[8] - Vec3::new(1.0, Bit::CRANIOTOME.length, 0.0)).length() < 1e-7);
    let ball = Burr { bit: Bit::BURR, ..burr };
    assert_eq!(ball.balls().collect::<Vec<_>>(), [Vec3::X]);
}

#[test]
fn a_hand_that_cannot_be() {
    for values in [[0.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, 1.0], [1.0, 1.0, f32::NAN, 1.0]] {
        let [strength, resistance, free, contact] = values;
        assert!(Feed::new(strength, resistance, free, contact).is_err(), "{values:?}");
    }
    let error = Feed::new(1.0, 1.0, 1.0, f32::INFINITY).expect_err("an endless step");
    assert_eq!(error.what, "a step in contact");
}

/// What a bit with so much load (newtons) takes away in so many frames of 1 ms where there is bone all around it, in
/// 255ths of a voxel.
fn removed_within(bit: Bit, load: f32, frames: u64) -> f32 {
    let (mut volume, mut erosions) = (block(255), Erosions::new());
    let burr =
        Burr { bit, center: Vec3::new(5e-3, 0.01, 8e-3), axis: Vec3::X, spin: 3e3, side: None };
    for frame in 0..frames {
        erosions.add(Erode { burr, load });
        erosions.apply(&mut volume, frame, 1e-3);
    }
    erosions.removed() as f32
}

/// One hand presses all balls of a rod together: they do the work of one.
#[test]
fn the_balls_of_a_rod_share_its_load() {
    let ball = removed_within(Bit { length: 0.0, ..Bit::CRANIOTOME }, 10.0, 20);
    let rod = removed_within(Bit::CRANIOTOME, 10.0, 20);
    assert!(ball > 500.0 && (rod / ball - 1.0).abs() < 0.1, "{rod} by a rod, {ball} by a ball");
}

/// Also near the axis, where a bit is slow, there is an end to the bone.
#[test]
fn a_load_beyond_measure_takes_all_there_is_in_reach() {
    let bit = Bit::BURR;
    let ball = 4.0 / 3.0 * std::f32::consts::PI * bit.radius.powi(3) / block(255).voxel_volume();
    let share = removed_within(bit, 1e9, 1) / (255.0 * ball);
    assert!((share - 1.0).abs() < 0.02, "{share}");
}
