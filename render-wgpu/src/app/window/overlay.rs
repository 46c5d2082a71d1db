//! The overlay's contents: figures, charts and controls.

use std::time::Duration;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Coloring;
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::timeline::{Span, Timeline};
use egui::{Checkbox, ComboBox, Grid, LayerId, Slider, Ui};

use super::charts;
use super::controls::Controls;
use super::hand::{Hand, Marks};
use super::stats::Stats;

/// How far back the timeline goes; usually 50 ms, some ten frames.
const SHOWN_TIME: Duration = Duration::from_millis(50);

/// The overlay, apart from how it is drawn.
pub(super) struct Overlay {
    spans: Vec<Span>,
}

impl Overlay {
    pub(super) fn new() -> Self {
        Self { spans: Vec::new() }
    }

    /// Lays the overlay out and takes what was changed into `controls`.
    pub(super) fn show<H: Hand>(
        &mut self,
        ui: &mut Ui,
        (controls, hand): (&mut Controls, &mut H),
        camera: &Camera,
        stats: &Stats,
        timeline: &Timeline,
    ) {
        if !controls.is_shown {
            return;
        }
        hand.mark(&Marks::new(ui.ctx().layer_painter(LayerId::background()), camera));
        egui::Window::new("dualframe")
            .default_pos([12.0, 12.0])
            .default_width(300.0)
            .resizable(false)
            // Where the window is lower than this is, or its pixels are small.
            .vscroll(true)
            .show(ui.ctx(), |ui| {
                figures(ui, stats);
                charts::frame_times(ui, stats);
                self.timeline(ui, timeline);
                ui.separator();
                run_controls(ui, controls);
                ui.separator();
                hand.panel(ui, controls);
                ui.separator();
                executor_controls(ui, controls);
                ui.separator();
                ui.small(H::HELP);
                ui.small("right: look round · middle: move · wheel: closer");
                ui.small("space: pause · n: next frame · home: look again · h: hide");
            });
    }

    fn timeline(&mut self, ui: &mut Ui, timeline: &Timeline) {
        let end = timeline.now();
        let begin = end.saturating_sub(SHOWN_TIME);
        charts::timeline_key(ui);
        for worker in 0..timeline.workers() {
            self.spans.clear();
            timeline.copy_since(worker, begin, &mut self.spans);
            // Workers that have left show nothing.
            if !self.spans.is_empty() || worker == 0 {
                charts::track(ui, worker, &self.spans, begin, end);
            }
        }
    }
}

fn figures(ui: &mut Ui, stats: &Stats) {
    let [median, most, longest] = stats.percentiles();
    ui.heading(format!("{:.0} frames/s", stats.rate()));
    ui.label(format!("ms a frame: median {median:.2}, 99 % {most:.1}, longest {longest:.1}"));
    let (collisions, candidates) = (stats.pairs.collisions, stats.pairs.candidates);
    ui.label(format!("frame {}: {collisions} collisions of {candidates} candidates", stats.frame));
}

fn run_controls(ui: &mut Ui, controls: &mut Controls) {
    ui.horizontal(|ui| {
        let text = if controls.is_paused { "Go on" } else { "Pause" };
        if ui.button(text).clicked() {
            controls.is_paused = !controls.is_paused;
        }
        if ui.add_enabled(controls.is_paused, egui::Button::new("Next frame")).clicked() {
            controls.steps += 1;
        }
        ui.add(Checkbox::new(&mut controls.is_real_time, "real time"));
    });
    ui.horizontal(|ui| {
        ui.label("colour");
        for coloring in Coloring::ALL {
            ui.selectable_value(&mut controls.coloring, coloring, coloring.name());
        }
    });
}

fn executor_controls(ui: &mut Ui, controls: &mut Controls) {
    Grid::new("executor").num_columns(2).show(ui, |ui| {
        ui.label("executor");
        ComboBox::from_id_salt("executor").selected_text(controls.executor.name()).show_ui(
            ui,
            |ui| {
                for &kind in ExecutorKind::ALL {
                    ui.selectable_value(&mut controls.executor, kind, kind.name());
                }
            },
        );
        ui.end_row();
        ui.label("workers");
        let workers = Slider::new(&mut controls.threads, 1..=controls.most_threads);
        ui.add_enabled(controls.executor != ExecutorKind::Serial, workers);
        ui.end_row();
        ui.label("frames in flight");
        ui.add_enabled_ui(controls.executor == ExecutorKind::Pipeline, |ui| {
            ui.horizontal(|ui| {
                ui.selectable_value(&mut controls.frames_in_flight, 1, "1");
                ui.selectable_value(&mut controls.frames_in_flight, 2, "2");
            });
        });
        ui.end_row();
    });
}
