//! The mouse as the tool in one of two hands.

use std::sync::Arc;

use dualframe_sim::behavior::{Instrument, Tool};
use dualframe_sim::device::DeviceSample;
use dualframe_sim::device::link::ToolState;
use dualframe_sim::device::mouse::MouseInput;
use dualframe_sim::mailbox::Mailbox;
use dualframe_sim::message::Message;
use dualframe_sim::object::Object;
use dualframe_sim::scene::craniotomy::{Report, TOOLS};
use dualframe_sim::scene::head::{Entry, Head};
use egui::{Color32, Ui};
use glam::Vec3;

use super::held::{Goal, Held};
use super::panel;
use crate::app::haptics::Each;
use crate::app::window::controls::Controls;
use crate::app::window::hand::{Aim, Hand, Marks};

/// How far one looks for what is under the mouse, in metres.
const SIGHT: f32 = 2.0;

/// The planned incision's colour: that of a surgeon's pen.
const INCISION: Color32 = Color32::from_rgb(110, 60, 190);
/// The planned craniotomy's colour.
const CRANIOTOMY: Color32 = Color32::from_rgb(40, 150, 90);
/// Half the length of the cross on the planned burr hole, in metres; usually 5 mm.
const BURR_HOLE: f32 = 0.005;

/// The devices that the hands hold.
pub(super) struct Devices<'c> {
    /// Where they are at the beginning, in metres.
    pub(super) places: Each<Vec3>,
    pub(super) inputs: Each<MouseInput<'c>>,
    /// How their loops are scheduled.
    pub(super) priority: String,
    /// What their loops last said, where they are linked.
    pub(super) states: Each<Option<ToolState>>,
}

/// The two hands, one of which the mouse leads.
pub(in crate::app) struct ToolGrip<'c> {
    head: Arc<Head>,
    pub(super) devices: Devices<'c>,
    pub(super) hands: Each<Held>,
    /// The hand that the mouse leads.
    pub(super) active: usize,
    /// From where, and in which direction, one looks for what is under the mouse.
    sight: Option<(Vec3, Vec3)>,
    /// How far that is, in this frame.
    distance: Option<f32>,
    /// Whether no script moves the hands.
    pub(super) is_free: bool,
    pub(super) score: Report,
    /// What was chosen for each hand, and not yet told.
    chosen: Each<Option<Instrument>>,
    /// Whether the plan is shown.
    pub(super) is_planned: bool,
}

impl<'c> ToolGrip<'c> {
    pub(super) fn new(head: Arc<Head>, devices: Devices<'c>, is_free: bool) -> Self {
        Self {
            head,
            devices,
            hands: Default::default(),
            active: 0,
            sight: None,
            distance: None,
            is_free,
            score: Report::default(),
            chosen: Default::default(),
            is_planned: is_free,
        }
    }

    fn held(&mut self) -> &mut Held {
        &mut self.hands[self.active]
    }

    /// Takes up what was chosen.
    fn take_up(&mut self, mailbox: &Mailbox) {
        for ((chosen, held), tool) in self.chosen.iter_mut().zip(&mut self.hands).zip(TOOLS) {
            if let Some(instrument) = chosen.take()
                && held.take_up(instrument)
            {
                mailbox.post(tool, Message::TakeUp(instrument));
            }
        }
    }

    /// What the other hand holds stays held.
    pub(super) fn change_hands(&mut self) {
        self.held().leave();
        self.active = 1 - self.active;
    }

    /// What the hand that the mouse leads is to take up.
    pub(super) fn choose(&mut self, instrument: Instrument) {
        self.chosen[self.active] = Some(instrument);
    }
}

impl Hand for ToolGrip<'_> {
    const HELP: &'static str = "left: use the instrument · 1 to 7: take up another · x: other hand, \
                                what is held stays held";

    fn forget(&mut self) {
        self.hands = Default::default();
        (self.active, self.chosen) = (0, Default::default());
        for (input, &place) in self.devices.inputs.iter_mut().zip(&self.devices.places) {
            input.set(DeviceSample::at(place));
        }
    }

    fn leave(&mut self) {
        // Nobody leads it from now on: it stays where it is, and is used no longer.
        let sample = self.held().abandon();
        sample.into_iter().for_each(|sample| self.devices.inputs[self.active].set(sample));
    }

    fn press(&mut self, aim: &Aim<'_>) {
        if self.is_free {
            self.held().press(|anchor| aim.at_depth_of(anchor));
        }
    }

    fn release(&mut self, _aim: &Aim<'_>) {
        self.held().release();
    }

    fn is_busy(&self) -> bool {
        self.is_free && self.hands[self.active].is_pressed()
    }

    fn wheel(&mut self, lines: f32) {
        self.held().lift(lines);
    }

    fn key(&mut self, key: char) {
        let number = key.to_digit(10).and_then(|digit| digit.checked_sub(1));
        let named = number.and_then(|number| Instrument::ALL.get(number as usize));
        match named {
            Some(&instrument) => self.choose(instrument),
            None if key == 'x' => self.change_hands(),
            None => {}
        }
    }

    fn see(&mut self, object: &Object) {
        let hand = TOOLS.iter().position(|&tool| tool == object.id());
        let tool = Tool::of(object).zip(object.geometry.as_rigid());
        if let (Some(hand), Some(tool)) = (hand, tool) {
            let sample = self.hands[hand].note(tool, self.is_free);
            sample.into_iter().for_each(|sample| self.devices.inputs[hand].set(sample));
        } else if let Some((eye, direction)) = self.sight {
            let nearest = self.distance.unwrap_or(SIGHT);
            self.distance = object.geometry.cast(eye, direction, nearest).or(self.distance);
        }
    }

    fn follow(&mut self, aim: &Aim<'_>, has_time_passed: bool) {
        let (eye, direction) = self.sight.replace(aim.ray()).unwrap_or_default();
        let under = self.distance.take().map(|distance| eye + direction * distance);
        if !(self.is_free && has_time_passed) {
            return;
        }
        self.take_up(aim.mailbox);
        let Self { head, devices, hands, active, .. } = self;
        let inner = |place: Vec3| head.inner_at(place);
        let right = aim.painter.camera.axes().0;
        let sides = [right, -right];
        for (hand, held) in hands.iter_mut().enumerate() {
            // The other hand goes aside, unless it holds something.
            let under = if hand == *active { under } else { Some(devices.places[hand]) };
            let drawn = |anchor| aim.at_depth_of(anchor);
            let goal = Goal { under, side: sides[hand], inner: &inner, drawn: &drawn };
            let sample = held.next(&goal);
            sample.into_iter().for_each(|sample| devices.inputs[hand].set(sample));
        }
    }

    fn mark(&self, marks: &Marks<'_>) {
        if !self.is_planned {
            return;
        }
        let plan = &self.head.plan;
        let incision = plan.incision.iter().copied().zip(plan.incision_normals.iter().copied());
        marks.line(incision, INCISION);
        let on_bone = |entry: &Entry| (entry.point, -entry.inward);
        let around = plan.craniotomy.iter().chain(plan.craniotomy.first());
        marks.line(around.map(on_bone), CRANIOTOMY);
        let Entry { point, inward, .. } = plan.burr_hole;
        let across = inward.any_orthonormal_vector();
        for arm in [across, inward.cross(across)].map(|arm| arm * BURR_HOLE) {
            marks
                .line([point - arm, point + arm].into_iter().map(|end| (end, -inward)), CRANIOTOMY);
        }
    }

    fn panel(&mut self, ui: &mut Ui, controls: &mut Controls) {
        panel::show(ui, self, controls);
    }
}
