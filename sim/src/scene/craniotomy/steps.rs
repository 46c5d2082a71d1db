//! The steps of the operation, as what two hands do.

use glam::Vec3;

use super::script::{Script, Stroke};
use super::{TIME_STEP, TOOLS};
use crate::behavior::Instrument;
use crate::scene::head::{Entry, Head, Plan, Pull};

/// The hand that cuts and drills.
const RIGHT: usize = 0;
/// The one that holds aside.
const LEFT: usize = 1;
/// How fast a hand moves freely, in metres per second; usually 0.1.
const FREELY: f32 = 0.1;
/// How fast a scalpel cuts, in metres per second; usually 0.03.
const CUTTING: f32 = 0.03;
/// How deep its tip is below the skin's surface, in metres; usually 4 mm, of a scalp of 5 mm.
const DEEP: f32 = 0.004;
/// How fast tissue is drawn aside, in metres per second; usually 0.02.
const DRAWING: f32 = 0.02;
/// How fast an elevator scrapes, in metres per second; usually 0.05.
const SCRAPING: f32 = 0.05;
/// How far from the incision the flap is scraped off, in metres; usually 30 mm.
const SCRAPED: f32 = 0.03;
/// How far beyond the plan's bite tissue is held, in metres; usually 7 mm.
const FARTHER: f32 = 0.007;
/// How fast a craniotome is led, in metres per second; usually 0.003.
const SAWING: f32 = 0.003;
/// How far beyond the inner table a craniotome's tip is led, in metres; usually 2 mm.
const BEYOND: f32 = 0.002;
/// How far beyond the bone a hand on a perforator would go, in metres.
const LEANING: f32 = 0.03;
/// How long it leans at most, in frames; usually 15 s.
const LEANING_FRAMES: usize = 900;
/// From how far off the head instruments are led to it, in metres; usually 40 mm. Hands rest twice as far off.
const AWAY: f32 = 0.04;
/// How high the bone flap is lifted, in metres; usually 40 mm.
const LIFTED: f32 = 0.04;

/// How far the operation goes; each step follows those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// The scalp is cut.
    Incision,
    /// The scalp is scraped off the bone and drawn aside.
    Retraction,
    /// A burr hole is drilled.
    BurrHole,
    /// From the burr hole on a bone flap is cut out, and it is lifted.
    Flap,
    /// To the end: up to now the same as [`Step::Flap`].
    All,
}

impl Step {
    /// All of them, in the order of the operation.
    pub const ALL: [Self; 5] =
        [Self::Incision, Self::Retraction, Self::BurrHole, Self::Flap, Self::All];

    /// The name by which the program knows it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Incision => "incision",
            Self::Retraction => "retraction",
            Self::BurrHole => "burr-hole",
            Self::Flap => "flap",
            Self::All => "all",
        }
    }
}

/// What the hands do.
pub(super) fn script(head: &Head, step: Step) -> Script {
    let mut script = Script::new(TOOLS, TIME_STEP);
    rest(&mut script, &head.plan);
    incise(&mut script, &head.plan);
    if step >= Step::Retraction {
        retract(&mut script, head);
    }
    if step >= Step::BurrHole {
        drill(&mut script, &head.plan);
    }
    if step >= Step::Flap {
        saw(&mut script, &head.plan);
        lift(&mut script, &head.plan.middle);
    }
    script
}

/// A stroke without the button.
fn free(instrument: Instrument, axis: Vec3, path: Vec<Vec3>) -> Stroke {
    Stroke { instrument, axis, path, speed: FREELY, pressed: false }
}

/// Where a hand rests.
fn aside(plan: &Plan, hand: usize) -> Vec3 {
    let outward = -plan.middle.inward;
    let side = if hand == RIGHT { 1.0 } else { -1.0 };
    let aside = outward.cross(Vec3::Z).normalize_or(Vec3::X) * (side * 2.0 * AWAY);
    plan.middle.point + outward * (2.0 * AWAY) + aside
}

/// Both hands rest away from the head.
fn rest(script: &mut Script, plan: &Plan) {
    for hand in [RIGHT, LEFT] {
        let place = vec![aside(plan, hand)];
        script.stroke(hand, &free(Instrument::Forceps, -plan.middle.inward, place));
    }
    script.meet();
}

fn incise(script: &mut Script, plan: &Plan) {
    let points = || plan.incision.iter().zip(&plan.incision_normals);
    let below: Vec<Vec3> = points().map(|(&point, &normal)| point - normal * DEEP).collect();
    let (Some((&first, &axis)), Some((&last, &end))) = (points().next(), points().next_back())
    else {
        return;
    };
    let (Some(&start), Some(&stop)) = (below.first(), below.last()) else { return };
    script.stroke(RIGHT, &free(Instrument::Scalpel, axis, vec![first + axis * AWAY, start]));
    for (pair, &axis) in below.windows(2).zip(&plan.incision_normals) {
        let path = pair.to_vec();
        let cut =
            Stroke { instrument: Instrument::Scalpel, axis, path, speed: CUTTING, pressed: true };
        script.stroke(RIGHT, &cut);
    }
    let away = vec![stop, last + end * AWAY, aside(plan, RIGHT)];
    script.stroke(RIGHT, &free(Instrument::Scalpel, end, away));
    // The wound gapes.
    script.wait(RIGHT, 60);
    script.meet();
}

fn retract(script: &mut Script, head: &Head) {
    let plan = &head.plan;
    let (Some(flap), Some(margin)) = (plan.flap.get(1), plan.margin.first()) else { return };
    let on_skin = |place: Vec3| place.normalize_or_zero() * head.skin_at(place);
    // Farther from the wound than the instruments reach, so that they hold one lip and not both.
    let bite = |pull: &Pull| {
        let from = on_skin(pull.from + (pull.to - pull.from).normalize_or_zero() * FARTHER);
        Pull { from, ..*pull }
    };
    let (flap, margin) = (bite(flap), bite(margin));
    // The hook holds the flap while the elevator frees it: it would glide away.
    take(script, LEFT, Instrument::Hook, &flap);
    script.meet();
    let towards_base = (flap.to - flap.from).normalize_or_zero();
    let lines = plan.incision.chunks(3).filter_map(|chunk| chunk.first());
    for (number, &from) in lines.enumerate() {
        let steps =
            (0..=5).map(|step| on_skin(from + towards_base * (SCRAPED * step as f32 / 5.0)));
        let mut path: Vec<Vec3> = steps.collect();
        if number % 2 == 1 {
            path.reverse();
        }
        let (instrument, axis) = (Instrument::Elevator, -plan.middle.inward);
        script.stroke(RIGHT, &Stroke { instrument, axis, path, speed: SCRAPING, pressed: true });
    }
    take(script, RIGHT, Instrument::Forceps, &margin);
    script.meet();
    draw(script, LEFT, Instrument::Hook, &flap);
    draw(script, RIGHT, Instrument::Forceps, &margin);
    script.meet();
    script.wait(RIGHT, 30);
    script.meet();
}

/// Takes hold of tissue.
fn take(script: &mut Script, hand: usize, instrument: Instrument, pull: &Pull) {
    let axis = pull.from.normalize_or(Vec3::Y);
    script.stroke(hand, &free(instrument, axis, vec![pull.from + axis * AWAY, pull.from]));
    let path = vec![pull.from];
    script.stroke(hand, &Stroke { instrument, axis, path, speed: DRAWING, pressed: true });
}

/// Draws aside what is held.
fn draw(script: &mut Script, hand: usize, instrument: Instrument, pull: &Pull) {
    let axis = pull.from.normalize_or(Vec3::Y);
    let path = vec![pull.from, pull.to];
    script.stroke(hand, &Stroke { instrument, axis, path, speed: DRAWING, pressed: true });
}

fn drill(script: &mut Script, plan: &Plan) {
    let Entry { point, inward, thickness } = plan.burr_hole;
    let axis = -inward;
    let instrument = Instrument::Perforator;
    let above = point + axis * AWAY;
    script.stroke(RIGHT, &free(instrument, axis, vec![above, point]));
    let path = vec![point, point + inward * (thickness + LEANING)];
    script.stroke(RIGHT, &Stroke { instrument, axis, path, speed: FREELY, pressed: true });
    script.wait(RIGHT, LEANING_FRAMES);
    script.stroke(RIGHT, &free(instrument, axis, vec![point, above, aside(plan, RIGHT)]));
    script.meet();
}

/// Leads a craniotome from the burr hole once around.
fn saw(script: &mut Script, plan: &Plan) {
    let outline = &plan.craniotomy;
    let Some(first) = outline.first() else { return };
    let tip = |entry: &Entry| entry.point + entry.inward * (entry.thickness + BEYOND);
    let instrument = Instrument::Craniotome;
    let above = first.point - first.inward * AWAY;
    script.stroke(RIGHT, &free(instrument, -first.inward, vec![above, tip(first)]));
    let around = outline.iter().chain(&outline[..outline.len().min(2)]);
    let tips: Vec<(Vec3, Vec3)> = around.map(|entry| (tip(entry), -entry.inward)).collect();
    for pair in tips.windows(2) {
        let path = vec![pair[0].0, pair[1].0];
        let axis = pair[1].1;
        script.stroke(RIGHT, &Stroke { instrument, axis, path, speed: SAWING, pressed: true });
    }
    // The bit is behind the hand by as much as it takes to press it on.
    script.wait(RIGHT, 120);
    script.stroke(
        RIGHT,
        &free(instrument, -first.inward, vec![tip(first), above, aside(plan, RIGHT)]),
    );
    script.meet();
}

/// Lifts the bone flap.
fn lift(script: &mut Script, middle: &Entry) {
    let Entry { point, inward, .. } = *middle;
    let axis = -inward;
    let instrument = Instrument::Forceps;
    script.stroke(RIGHT, &free(instrument, axis, vec![point + axis * AWAY, point]));
    // Until the host has looked for freed bone.
    script.wait(RIGHT, 2 * super::LOOK_FRAMES as usize);
    let path = vec![point, point + axis * LIFTED];
    script.stroke(RIGHT, &Stroke { instrument, axis, path, speed: DRAWING, pressed: true });
    script.wait(RIGHT, 60);
    script.meet();
}
