//! What the overlay shows of an operation.

use dualframe_sim::behavior::Instrument;
use dualframe_sim::device::link::ToolState;
use dualframe_sim::scene::craniotomy::{Margin, Placement, Report};
use egui::{Checkbox, Grid, Ui};

use super::grip::ToolGrip;
use crate::app::window::controls::Controls;

/// The hands' names, in their order.
const HANDS: [&str; 2] = ["right", "left"];

pub(super) fn show(ui: &mut Ui, grip: &mut ToolGrip<'_>, controls: &mut Controls) {
    instruments(ui, grip);
    ui.separator();
    score(ui, &grip.score);
    ui.separator();
    haptics(ui, grip);
    ui.horizontal(|ui| {
        ui.add(Checkbox::new(&mut grip.is_planned, "show the plan"));
        if ui.button("Begin anew").clicked() {
            controls.restarts += 1;
        }
    });
}

fn instruments(ui: &mut Ui, grip: &mut ToolGrip<'_>) {
    if !grip.is_free {
        ui.label("a script operates");
    }
    Grid::new("hands").num_columns(2).show(ui, |ui| {
        for (hand, name) in HANDS.into_iter().enumerate() {
            if ui.selectable_label(hand == grip.active, name).clicked() && hand != grip.active {
                grip.change_hands();
            }
            let held = &grip.hands[hand];
            let force = held.work.force().length();
            let use_of_it = if held.is_used() { ", in use" } else { "" };
            ui.label(format!("{}{use_of_it}: {force:.1} N", held.instrument.name()));
            ui.end_row();
        }
    });
    ui.horizontal_wrapped(|ui| {
        for (number, instrument) in Instrument::ALL.into_iter().enumerate() {
            let is_held = grip.hands[grip.active].instrument == instrument;
            let name = format!("{} {}", number + 1, instrument.name());
            if ui.selectable_label(is_held, name).clicked() {
                grip.choose(instrument);
            }
        }
    });
}

fn score(ui: &mut Ui, score: &Report) {
    let millimetres = |length: f32| length * 1e3;
    Grid::new("score").num_columns(2).show(ui, |ui| {
        let mut line = |name: &str, value: String| {
            ui.label(name);
            ui.label(value);
            ui.end_row();
        };
        line("time", format!("{:.0} s", score.seconds));
        let (drilling, air) = (score.drilling_seconds, score.air_seconds);
        line("drilling", format!("{drilling:.1} s, {air:.1} s of it in air"));
        let (peak, p95) = (score.peak_force, score.force_p95);
        line("force on bone", format!("{peak:.1} N at most, 95 % below {p95:.2} N"));
        line("past the inner table", format!("{:.2} mm", millimetres(score.plunge)));
        let (tears, length) = (score.dural_tears, millimetres(score.dural_tear_length));
        line("dural tears", format!("{tears}, {length:.1} mm"));
        line("force on dura", format!("{:.2} N at most", score.peak_dural_force));
        if let Some(Placement { error, angle }) = score.burr_hole {
            let (error, angle) = (millimetres(error), angle.to_degrees());
            line("burr hole", format!("{error:.1} mm aside, {angle:.0}° oblique"));
        }
        if let Some(Margin { mean, greatest, cut }) = score.margin {
            let (mean, greatest, cut) = (millimetres(mean), millimetres(greatest), 100.0 * cut);
            line("margin", format!("off by {mean:.1} mm, at most {greatest:.1}; {cut:.0} % cut"));
        }
        line("bone outside the plan", format!("{:.0} mm³", score.bone_outside_plan * 1e9));
    });
}

fn haptics(ui: &mut Ui, grip: &ToolGrip<'_>) {
    ui.label(format!("haptic loops: {}", grip.devices.priority));
    let Some(state) = &grip.devices.states[grip.active] else { return };
    let ToolState { ticks, forces, wrench, .. } = state;
    let (late, latest) = (100.0 * ticks.late_share(), ticks.latest * 1e3);
    ui.label(format!("{} ticks, {late:.2} % late, at most {latest:.2} ms", ticks.due));
    let (force, age) = (wrench.force.length(), forces.age * 1e3);
    ui.label(format!("force {force:.2} N, {age:.0} ms old; {:.3} W", forces.power));
    let (error, step) = (forces.error_rms(), forces.largest_step);
    ui.label(format!("interpolated to {error:.2} N; steps of {step:.2} N at most"));
}
