//! The score beside what is known of cuts and holes that are put at known places.

use dualframe_sim::behavior::drill::{Bit, Burr, Erode};
use dualframe_sim::behavior::piece::Piece;
use dualframe_sim::behavior::{Behavior, Bone, Instrument, Tool};
use dualframe_sim::device::DeviceSample;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::geometry::{Geometry, Volume};
use dualframe_sim::message::Message;
use dualframe_sim::object::{Group, Object};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::craniotomy::{Operation, Report, SKULL, Step, TOOLS};
use dualframe_sim::scene::head::Entry;
use glam::{Quat, Vec3};
use parry3d::math::Pose;

use super::{PIECE, Theatre, head};

/// A skull under a bit that takes all away that it touches.
struct Carved {
    skull: Volume,
    bone: Bone,
}

impl Carved {
    fn new() -> Self {
        Self { skull: head().skull.clone(), bone: Bone::new() }
    }

    /// Takes away a rod of the bit's radius, through the bone.
    fn through(mut self, bit: Bit, entry: &Entry) -> Self {
        let Entry { point, inward, thickness } = *entry;
        let erosions = self.bone.erosions().expect("bone is drilled");
        let depth = thickness + 2.0 * bit.radius + 0.003;
        for step in 0..=(depth / 0.4e-3) as u64 {
            let center = point + inward * (step as f32 * 0.4e-3 - bit.radius - 1e-3);
            let bit = Bit { length: 0.0, ..bit };
            let burr = Burr { bit, center, axis: -inward, spin: 1e3, side: None };
            erosions.add(Erode { burr, load: 1e9 });
            erosions.apply(&mut self.skull, step, 1.0);
        }
        self
    }

    /// Cuts along places on the skull, which are near each other.
    fn along(self, path: &[Entry]) -> Self {
        path.iter().fold(self, |carved, entry| carved.through(Bit::CRANIOTOME, entry))
    }

    fn removed(&self) -> f64 {
        self.bone.removed_volume(&self.skull)
    }

    fn report(self) -> Report {
        let geometry = Geometry::Volume(self.skull);
        let object = Object::new(SKULL, Group(1), geometry, self.bone);
        Operation::new(head(), None).report(|see| see(&object))
    }
}

/// The plan's outline, so many metres farther out, in steps of 0.4 mm.
fn outline(out: f32) -> Vec<Entry> {
    let plan = &head().plan;
    let all = &plan.craniotomy;
    let corner = |number: usize| {
        let number = number % all.len();
        let way =
            all[(number + 1) % all.len()].point - all[(number + all.len() - 1) % all.len()].point;
        let outwards = way.cross(all[number].inward).normalize();
        let outwards = outwards * outwards.dot(all[number].point - plan.middle.point).signum();
        let point = all[number].point;
        // The skull is round.
        Entry { point: (point + outwards * out).normalize() * point.length(), ..all[number] }
    };
    let parts =
        (0..all.len()).flat_map(|number| (0..5).map(move |part| (number, part as f32 / 5.0)));
    let between = |(number, share): (usize, f32)| {
        let (from, to) = (corner(number), corner(number + 1));
        Entry { point: from.point.lerp(to.point, share), ..from }
    };
    parts.map(between).collect()
}

#[test]
fn what_was_not_drilled_has_no_margin() {
    let report = Carved::new().report();
    assert_eq!((report.margin, report.burr_hole), (None, None));
    assert_eq!(report.bone_outside_plan, 0.0);
}

/// Not near the burr hole, where more is planned than the cut.
#[test]
fn a_cut_beside_the_plan_is_as_far_beside_it() {
    let hole = head().plan.burr_hole.point;
    for out in [-0.002, 0.0, 0.002, 0.004_f32] {
        let far = |entry: &Entry| entry.point.distance(hole) > 0.007_5;
        let path: Vec<Entry> = outline(out).into_iter().filter(far).collect();
        let carved = Carved::new().along(&path);
        let removed = carved.removed();
        let report = carved.report();
        let margin = report.margin.expect("there is an edge");
        assert!((margin.mean - out.abs()).abs() < 1.5e-4, "{margin:?} for {out} m");
        assert!((margin.greatest - out.abs()).abs() < 5e-4, "{margin:?} for {out} m");
        assert!(margin.cut > 0.9, "{margin:?} for {out} m");
        // The cut is 2.4 mm wide, and the band around it 1 mm wider on each side.
        let share = report.bone_outside_plan / removed;
        let expected = f64::from((out.abs() - 0.001) / 0.002_4).clamp(0.0, 1.0);
        assert!((share - expected).abs() < 0.02, "{share} outside for {out} m");
    }
}

#[test]
fn a_part_of_the_outline() {
    let path = outline(0.002);
    let report = Carved::new().along(&path[path.len() / 4..path.len() / 2]).report();
    let margin = report.margin.expect("there is an edge");
    assert!((margin.mean - 0.002).abs() < 2e-4 && margin.greatest < 0.003, "{margin:?}");
    // The burr hole takes a few points of the outline away.
    assert!((0.24..0.32).contains(&margin.cut), "{margin:?}");
}

#[test]
fn a_hole_in_the_flap_is_outside_the_plan_and_no_margin() {
    let carved = Carved::new().through(Bit::PERFORATOR, &head().plan.middle);
    let removed = carved.removed();
    assert!(removed > 400e-9, "{removed} m³");
    let report = carved.report();
    assert_eq!(report.margin, None);
    assert!((report.bone_outside_plan / removed - 1.0).abs() < 1e-9);
    let planned = Carved::new().through(Bit::PERFORATOR, &head().plan.burr_hole);
    let removed = planned.removed();
    assert!(removed > 400e-9, "{removed} m³");
    let report = planned.report();
    assert_eq!(report.margin, None, "the burr hole makes its own edge");
    assert!(report.bone_outside_plan < 1e-3 * removed);
}

/// Bone that goes away with the flap is not removed: neither within the plan nor outside of it.
#[test]
fn the_flap_takes_nothing_out_of_the_plan() {
    let center = &head().plan.middle;
    // In the flap, and not planned.
    let hole = Carved::new().through(Bit::PERFORATOR, center).removed();
    let mut carved = Carved::new().along(&outline(0.0)).through(Bit::PERFORATOR, center);
    let middle = carved.skull.to_local(head().plan.middle.point) / carved.skull.spacing();
    let around = middle.to_array().map(|at| (at as u32).saturating_sub(70)..at as u32 + 70);
    let parts = carved.skull.parts(around);
    let flap = parts.iter().find(|part| !part.touches_border() && part.voxels() > 50_000);
    let flap = carved.skull.split_off(flap.expect("it is free")).expect("it is the skull's");
    let piece = Piece::new(&flap);
    let mut piece = Object::new(PIECE, Group(2), Geometry::Volume(flap), piece);
    let skull = Object::new(SKULL, Group(1), Geometry::Volume(carved.skull), carved.bone);
    let outside = |piece: &Object| {
        let operation = Operation::new(head(), None);
        operation.report(|see| [&skull, piece].into_iter().for_each(see)).bone_outside_plan
    };
    let before = outside(&piece);
    assert!((before / hole - 1.0).abs() < 0.05, "{before} m³, not {hole} m³");
    let volume = piece.geometry.as_volume_mut().expect("bone");
    volume.pose.translation += Vec3::splat(0.03);
    assert_eq!(outside(&piece), before);
}

/// What is drilled off a piece that came free is removed, as what is drilled off the skull.
#[test]
fn bone_of_pieces_counts() {
    let hole = &head().plan.burr_hole;
    let carved = Carved::new().through(Bit::CRANIOTOME, hole);
    let of_skull = carved.removed();
    let spacing = head().skull.spacing();
    let block = Volume::from_fn([20; 3], spacing, Pose::IDENTITY, |_| 255);
    let mut block = block.expect("it is small");
    let mut piece = Piece::new(&block).loose();
    let center = spacing * 10.0;
    let burr = Burr { bit: Bit::BURR, center, axis: Vec3::Z, spin: 1e3, side: None };
    let erosions = piece.erosions().expect("bone is drilled");
    erosions.add(Erode { burr, load: 1e9 });
    erosions.apply(&mut block, 0, 1.0);
    let of_piece = piece.removed() as f64 / 255.0 * f64::from(block.voxel_volume());
    assert!(of_skull > 10e-9 && of_piece > 10e-9, "{of_skull} m³, {of_piece} m³");
    let piece = Object::new(PIECE, Group(2), Geometry::Volume(block), piece);
    let skull = Object::new(SKULL, Group(1), Geometry::Volume(carved.skull), carved.bone);
    let operation = Operation::new(head(), None);
    let report = operation.report(|see| [&skull, &piece].into_iter().for_each(see));
    assert!((report.bone_removed - of_skull - of_piece).abs() < 1e-15, "{report:?}");
    assert!((report.bone_outside_plan - of_piece).abs() < 1e-15, "{report:?}");
}

/// Where a perforator starts that is led along `axis` to a place on the outer table.
fn perforated(place: Vec3, axis: Vec3) -> Report {
    let mut theatre = Theatre::new(Step::Incision, ExecutorKind::Serial, 1);
    let mut operation = Operation::new(head(), None);
    let mailbox = theatre.manager.mailbox();
    let orientation = Quat::from_rotation_arc(Vec3::Z, axis);
    let device = |position: Vec3, buttons| {
        mailbox.post(TOOLS[0], Message::Device(DeviceSample { position, orientation, buttons }));
    };
    let mut run = |frames| {
        let mut renderer = NullRenderer::new();
        let (_, mut watch) = operation.parts(&mut renderer);
        theatre.manager.run(frames, &mut watch, &mut |_| ()).expect("no table is full");
    };
    device(place + axis * 0.002, 0);
    run(4);
    mailbox.post(TOOLS[0], Message::TakeUp(Instrument::Perforator));
    device(place - axis * 0.003, 1);
    run(60);
    assert!(theatre.read(TOOLS[0], |tool| Tool::of(tool).expect("a tool").work().turns));
    operation.report(|see| theatre.manager.visit(see))
}

#[test]
fn a_burr_hole_aside() {
    let Entry { point, inward, .. } = head().plan.burr_hole;
    let report = perforated(point + inward.any_orthonormal_vector() * 0.003, -inward);
    let hole = report.burr_hole.expect("it drills");
    assert!((hole.error - 0.003).abs() < 2e-4 && hole.angle < 1e-3, "{hole:?}");
    assert_eq!((report.dural_tears, report.peak_dural_force), (0, 0.0));
    assert_eq!(report.margin, None);
}

#[test]
fn a_burr_hole_aslant() {
    let Entry { point, inward, .. } = head().plan.burr_hole;
    let turn = Quat::from_axis_angle(inward.any_orthonormal_vector(), 10_f32.to_radians());
    let hole = perforated(point, turn * -inward).burr_hole.expect("it drills");
    // The bit glides a little before it bites.
    assert!(hole.error < 5e-4, "{hole:?}");
    assert!((hole.angle.to_degrees() - 10.0).abs() < 0.1, "{hole:?}");
}

/// Seconds are seconds also while both hands drill.
#[test]
fn two_drills_in_the_air() {
    let mut theatre = Theatre::new(Step::Incision, ExecutorKind::Serial, 1);
    let mut operation = Operation::new(head(), None);
    let mailbox = theatre.manager.mailbox();
    for (tool, side) in TOOLS.into_iter().zip([0.1, -0.1]) {
        mailbox.post(tool, Message::TakeUp(Instrument::Burr));
        let sample = DeviceSample::at(Vec3::new(side, 0.3, 0.0));
        mailbox.post(tool, Message::Device(DeviceSample { buttons: 1, ..sample }));
    }
    let mut renderer = NullRenderer::new();
    let (_, mut watch) = operation.parts(&mut renderer);
    theatre.manager.run(30, &mut watch, &mut |_| ()).expect("no table is full");
    let report = operation.report(|see| theatre.manager.visit(see));
    let Report { seconds, drilling_seconds, air_seconds, .. } = report;
    assert!(drilling_seconds > 0.8 * seconds && drilling_seconds <= seconds, "{report:?}");
    assert_eq!(air_seconds, drilling_seconds);
}
