//! An instrument in a hand, and where the mouse leads it.

use dualframe_sim::behavior::{Instrument, Tool, Work};
use dualframe_sim::device::DeviceSample;
use dualframe_sim::geometry::Rigid;
use dualframe_sim::scene::craniotomy::TIME_STEP;
use glam::{Quat, Vec3};

/// How fast a hand goes at most, in metres per second; usually 0.5.
const FASTEST: f32 = 0.5;
/// How fast a hand goes with a drill, in metres per second; usually 0.07, about as fast as the drill
/// follows.
const FASTEST_DRILLING: f32 = 0.07;
/// How far above what is under the mouse an instrument is that is not used, in metres; usually 1 mm.
const HOVER: f32 = 0.001;
/// How far an instrument is lifted that goes elsewhere, in metres; usually 12 mm.
const CLEARANCE: f32 = 0.012;
/// The way for which it is lifted, in metres; usually 6 mm.
const ELSEWHERE: f32 = 0.006;
/// How deep below the skin's surface a scalpel cuts, in metres; usually 4 mm, of a scalp of 5 mm.
const DEEP: f32 = 0.004;
/// How far into the bone a burr is led, in metres: the farther, the stronger it is pushed. Usually 3 mm.
const PUSHED: f32 = 0.003;
/// How far into the bone a perforator is led, in metres; usually 30 mm: one leans on it.
const LEANT: f32 = 0.03;
/// How far beyond the inner table a craniotome's foot runs, in metres; usually 2 mm.
const BEYOND: f32 = 0.002;
/// How far what is held is lifted by a line of the wheel, in metres; usually 2 mm.
const LIFT: f32 = 0.002;
/// How much an instrument that holds or scrapes leans to its hand's side; usually 0.6, the tangent of 31°.
const LEANING: f32 = 0.6;

/// What the button does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Button {
    /// It is up.
    Up,
    /// It is down. Where it went down: the anchor, which is drawn with the mouse, and how far from the mouse
    /// it is.
    Down { anchor: Vec3, offset: Vec3 },
    /// It was left down, by the mouse that went to the other hand or by a script.
    Left,
}

/// An instrument in a hand.
pub(super) struct Held {
    pub(super) instrument: Instrument,
    /// What it does at the moment.
    pub(super) work: Work,
    button: Button,
    /// What the device says; none until the tool was seen.
    sample: Option<DeviceSample>,
}

impl Default for Held {
    fn default() -> Self {
        let (instrument, work) = (Instrument::Forceps, Work::default());
        Self { instrument, work, button: Button::Up, sample: None }
    }
}

/// Where the mouse leads an instrument.
pub(super) struct Goal<'a> {
    /// The place under the mouse, if anything is there.
    pub(super) under: Option<Vec3>,
    /// To the hand's side, of unit length.
    pub(super) side: Vec3,
    /// How far from the head's middle the inner table is in the direction of a place.
    pub(super) inner: &'a dyn Fn(Vec3) -> f32,
    /// The place under the mouse at the depth of another.
    pub(super) drawn: &'a dyn Fn(Vec3) -> Vec3,
}

impl Held {
    /// Notes what the tool is and does. A hand that is not free is as the tool is: what its device says
    /// then.
    pub(super) fn note(
        &mut self,
        (tool, rigid): (&Tool, &Rigid),
        is_free: bool,
    ) -> Option<DeviceSample> {
        self.work = tool.work();
        if is_free && self.sample.is_some() {
            return None;
        }
        self.instrument = tool.instrument();
        self.button = if tool.is_pressed() { Button::Left } else { Button::Up };
        let (position, orientation) = (rigid.pose.translation, rigid.pose.rotation);
        self.sample =
            Some(DeviceSample { position, orientation, buttons: u32::from(self.is_used()) });
        self.sample
    }

    pub(super) fn is_pressed(&self) -> bool {
        matches!(self.button, Button::Down { .. })
    }

    /// Whether it holds, cuts or drills.
    pub(super) fn is_used(&self) -> bool {
        self.button != Button::Up
    }

    /// The button goes down. `drawn` says where the mouse is at the depth of a place.
    pub(super) fn press(&mut self, drawn: impl Fn(Vec3) -> Vec3) {
        let Some(sample) = self.sample else { return };
        let anchor = sample.position;
        // What was held by the hand that was left is drawn on from where it is; what is new is under the mouse.
        let is_new = self.button == Button::Up;
        let offset = if is_new { Vec3::ZERO } else { anchor - drawn(anchor) };
        self.button = Button::Down { anchor, offset };
    }

    pub(super) fn release(&mut self) {
        if self.is_pressed() {
            self.button = Button::Up;
        }
    }

    /// The mouse has gone for good, its button up; what the device says then.
    pub(super) fn abandon(&mut self) -> Option<DeviceSample> {
        let buttons = u32::from(self.is_used());
        self.sample = self.sample.map(|sample| DeviceSample { buttons, ..sample });
        self.sample
    }

    /// The mouse goes to the other hand.
    pub(super) fn leave(&mut self) {
        if self.is_pressed() {
            self.button = Button::Left;
        }
    }

    /// Whether it is another one.
    pub(super) fn take_up(&mut self, instrument: Instrument) -> bool {
        let is_other = instrument != self.instrument;
        if is_other {
            self.instrument = instrument;
            self.button = Button::Up;
        }
        is_other
    }

    /// What is held is lifted by so many lines of the wheel.
    pub(super) fn lift(&mut self, lines: f32) {
        if let (Button::Down { offset, .. }, Some(sample)) = (&mut self.button, self.sample) {
            *offset += outward(sample.position) * (LIFT * lines);
        }
    }

    /// What the device says next, if it is something else.
    pub(super) fn next(&mut self, goal: &Goal<'_>) -> Option<DeviceSample> {
        let before = self.sample?;
        let here = before.position;
        let wanted = match self.button {
            Button::Left => here,
            Button::Down { anchor, offset } => self.used(goal, anchor, offset).unwrap_or(here),
            Button::Up => goal.under.map_or(here, |place| hovering(here, place)),
        };
        let fastest = if self.is_drill() { FASTEST_DRILLING } else { FASTEST };
        let position = here + (wanted - here).clamp_length_max(fastest * TIME_STEP);
        let orientation = match self.button {
            Button::Left => before.orientation,
            _ => Quat::from_rotation_arc(Vec3::Z, self.handle(position, goal.side)),
        };
        let buttons = u32::from(self.is_used());
        let sample = DeviceSample { position, orientation, buttons };
        self.sample = Some(sample);
        (sample != before).then_some(sample)
    }

    /// Where the tip goes of an instrument that is used.
    fn used(&self, goal: &Goal<'_>, anchor: Vec3, offset: Vec3) -> Option<Vec3> {
        let below = |depth: f32| goal.under.map(|place| place - outward(place) * depth);
        match self.instrument {
            Instrument::Scalpel => below(DEEP),
            Instrument::Elevator => below(0.0),
            Instrument::Burr => below(PUSHED),
            Instrument::Forceps | Instrument::Hook => Some((goal.drawn)(anchor) + offset),
            // It bores where it was set down.
            Instrument::Perforator => Some(anchor - outward(anchor) * LEANT),
            // Its foot keeps to the inner table.
            Instrument::Craniotome => {
                let place = (goal.drawn)(anchor);
                Some(outward(place) * ((goal.inner)(place) - BEYOND))
            }
        }
    }

    /// The direction of the handle.
    fn handle(&self, tip: Vec3, side: Vec3) -> Vec3 {
        let is_upright = self.is_drill() || self.instrument == Instrument::Scalpel;
        let leaning = if is_upright { 0.0 } else { LEANING };
        (outward(tip) + side * leaning).normalize_or(Vec3::Z)
    }

    fn is_drill(&self) -> bool {
        use Instrument::{Burr, Craniotome, Perforator};
        matches!(self.instrument, Perforator | Burr | Craniotome)
    }
}

/// Where an instrument goes that is not used: to what is under the mouse, and if that is elsewhere, up
/// first.
fn hovering(here: Vec3, under: Vec3) -> Vec3 {
    let out = outward(under);
    let target = under + out * HOVER;
    let way = (target - here).reject_from_normalized(out).length();
    let height = (here - target).dot(out);
    match way > ELSEWHERE {
        true if height < 0.9 * CLEARANCE => here + out * CLEARANCE,
        true => target + out * CLEARANCE,
        false => target,
    }
}

/// Out of the head, whose middle is the origin.
fn outward(place: Vec3) -> Vec3 {
    place.normalize_or(Vec3::Y)
}

#[cfg(test)]
mod tests {
    use dualframe_sim::behavior::Workpieces;

    use super::*;

    const SKIN: Vec3 = Vec3::new(0.0, 0.1, 0.0);

    fn goal(under: Vec3) -> Goal<'static> {
        Goal {
            under: Some(under),
            side: Vec3::X,
            inner: &|_| 0.09,
            // A camera that looks down on a plane.
            drawn: &|anchor| anchor + Vec3::X * 0.01,
        }
    }

    fn held(instrument: Instrument, tip: Vec3) -> Held {
        Held { instrument, sample: Some(DeviceSample::at(tip)), ..Held::default() }
    }

    /// Where a hand comes to in a while.
    fn settle(held: &mut Held, goal: &Goal<'_>) -> DeviceSample {
        for _ in 0..500 {
            held.next(goal);
        }
        held.sample.expect("it was seen")
    }

    #[test]
    fn an_idle_instrument_hovers_under_the_mouse() {
        let mut held = held(Instrument::Scalpel, Vec3::new(0.03, 0.12, 0.0));
        let sample = settle(&mut held, &goal(SKIN));
        assert!(sample.position.distance(SKIN + Vec3::Y * HOVER) < 1e-4, "{sample:?}");
        assert_eq!(sample.buttons, 0);
        assert_eq!(held.next(&goal(SKIN)), None, "what stands still is not told");
    }

    #[test]
    fn an_instrument_goes_up_before_it_goes_elsewhere() {
        let mut held = held(Instrument::Craniotome, Vec3::new(0.0, 0.09, 0.0));
        let elsewhere = goal(Vec3::new(0.05, 0.0866, 0.0));
        for _ in 0..400 {
            let before = held.sample.expect("it was seen").position;
            let Some(sample) = held.next(&elsewhere) else { break };
            let step = sample.position - before;
            let sideways = step.reject_from_normalized(outward(before)).length();
            let is_deep = before.length() < 0.1;
            assert!(!is_deep || sideways < 0.6 * step.length(), "{before} {step}");
        }
        let end = held.sample.expect("it was seen").position;
        assert!(end.distance(Vec3::new(0.05, 0.0866, 0.0)) < 0.0011, "{end}");
    }

    #[test]
    fn used_instruments_go_where_they_work() {
        let expected = [
            (Instrument::Scalpel, SKIN - Vec3::Y * DEEP),
            (Instrument::Elevator, SKIN),
            (Instrument::Forceps, SKIN + Vec3::new(0.01, HOVER, 0.0)),
            (Instrument::Perforator, SKIN + Vec3::Y * (HOVER - LEANT)),
            (Instrument::Burr, SKIN - Vec3::Y * PUSHED),
            (Instrument::Craniotome, Vec3::new(0.01, 0.1 + HOVER, 0.0).normalize() * 0.088),
        ];
        for (instrument, place) in expected {
            let mut held = held(instrument, SKIN + Vec3::Y * HOVER);
            held.press(|anchor| anchor);
            let sample = settle(&mut held, &goal(SKIN));
            assert!(sample.position.distance(place) < 1e-4, "{instrument:?}: {sample:?}");
            assert_eq!(sample.buttons, 1);
        }
    }

    #[test]
    fn what_a_hand_holds_stays_held_when_the_mouse_leaves_it() {
        let mut held = held(Instrument::Hook, SKIN);
        held.press(|anchor| anchor);
        settle(&mut held, &goal(SKIN));
        held.leave();
        let left = held.sample;
        held.release();
        assert_eq!(held.next(&goal(Vec3::X)), None);
        assert_eq!(held.sample, left);
        // Back again, it is drawn on from where it is, and let go.
        held.press(|anchor| anchor + Vec3::X * 0.01);
        assert_eq!(held.next(&goal(SKIN)), None);
        held.release();
        let buttons = held.next(&goal(SKIN)).expect("it opens").buttons;
        assert_eq!(buttons, 0);
    }

    #[test]
    fn what_a_hand_uses_is_used_no_longer_when_the_mouse_goes_for_good() {
        let mut held = held(Instrument::Burr, SKIN);
        held.press(|anchor| anchor);
        let pressed = settle(&mut held, &goal(SKIN));
        held.release();
        let left = DeviceSample { buttons: 0, ..pressed };
        assert_eq!((pressed.buttons, held.abandon()), (1, Some(left)));
        // The tool hears of it two frames later.
        let (rigid, tool) = Tool::new(Instrument::Burr, pressed, Workpieces::default());
        assert!(tool.is_pressed());
        assert_eq!((held.note((&tool, &rigid), true), held.sample), (None, Some(left)));
    }

    #[test]
    fn the_wheel_lifts_what_is_held() {
        let mut held = held(Instrument::Forceps, SKIN);
        held.press(|anchor| anchor);
        let before = settle(&mut held, &goal(SKIN)).position;
        held.lift(3.0);
        let after = settle(&mut held, &goal(SKIN)).position;
        assert!(((after - before).dot(outward(before)) - 3.0 * LIFT).abs() < 1e-4);
    }
}
