//! The overlay's charts.

use std::time::Duration;

use dualframe_sim::executor::Stage;
use dualframe_sim::timeline::Span;
use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Shape, Stroke, Ui, vec2};

use super::stats::{SHOWN_FRAMES, Stats};

/// A chart's width, in points.
const WIDTH: f32 = 300.0;
/// The frame-time chart's height, in points.
const HEIGHT: f32 = 48.0;
/// A worker's height in the timeline, in points.
const TRACK: f32 = 12.0;
/// Where a track begins, behind the worker's number, in points.
const MARGIN: f32 = 18.0;

const STAGES: [(Stage, &str, Color32); 4] = [
    (Stage::BroadPhase, "broad phase", Color32::from_rgb(240, 200, 80)),
    (Stage::Interaction, "interaction", Color32::from_rgb(225, 95, 75)),
    (Stage::Update, "update", Color32::from_rgb(85, 150, 235)),
    (Stage::Render, "render", Color32::from_rgb(110, 200, 120)),
];

/// The times of the last frames, the newest at the right.
pub(super) fn frame_times(ui: &mut Ui, stats: &Stats) {
    let (response, painter) = ui.allocate_painter(vec2(WIDTH, HEIGHT), Sense::hover());
    let area = response.rect;
    painter.rect_filled(area, 2.0, Color32::from_black_alpha(120));
    let [median, most, _] = stats.percentiles();
    // Single long frames may leave the chart; all others do not.
    let top = (1.3 * most).max(2.0 * median).max(0.1);
    let count = stats.times().len();
    let place = |index: usize, time: f32| {
        let right = (SHOWN_FRAMES - count + index) as f32 / (SHOWN_FRAMES - 1) as f32;
        let up = (time / top).min(1.0);
        Pos2::new(area.left() + right * area.width(), area.bottom() - up * area.height())
    };
    let points = stats.times().enumerate().map(|(index, time)| place(index, time)).collect();
    painter.add(Shape::line(points, Stroke::new(1.0, Color32::LIGHT_GREEN)));
    for (time, color) in [(median, Color32::GRAY), (most, Color32::from_rgb(200, 120, 60))] {
        let height = place(0, time).y;
        painter.hline(area.x_range(), height, Stroke::new(1.0, color.gamma_multiply(0.6)));
    }
    let font = FontId::proportional(10.0);
    let text = format!("{top:.1} ms");
    painter.text(area.left_top(), Align2::LEFT_TOP, text, font, Color32::GRAY);
}

/// Which colour is which stage.
pub(super) fn timeline_key(ui: &mut Ui) {
    ui.horizontal(|ui| {
        for (_, name, color) in STAGES {
            let (response, painter) = ui.allocate_painter(vec2(8.0, 8.0), Sense::hover());
            painter.rect_filled(response.rect, 1.0, color);
            ui.small(name);
        }
    });
}

/// What one worker did: even frames in full colours, odd ones darker.
pub(super) fn track(ui: &mut Ui, worker: usize, spans: &[Span], begin: Duration, end: Duration) {
    let (response, painter) = ui.allocate_painter(vec2(WIDTH, TRACK), Sense::hover());
    let area = response.rect;
    let font = FontId::monospace(10.0);
    let number = worker.to_string();
    painter.text(area.left_center(), Align2::LEFT_CENTER, number, font, Color32::GRAY);
    let track = Rect::from_min_max(Pos2::new(area.left() + MARGIN, area.top()), area.max);
    painter.rect_filled(track, 0.0, Color32::from_black_alpha(120));
    let shown = (end - begin).as_secs_f32().max(1e-6);
    let across = |time: Duration| {
        let share = time.saturating_sub(begin).as_secs_f32() / shown;
        track.left() + share.min(1.0) * track.width()
    };
    for span in spans {
        let (left, right) = (across(span.begin()), across(span.end()));
        let bar = Rect::from_x_y_ranges(left..=right.max(left + 0.4), track.y_range());
        painter.rect_filled(bar, 0.0, color(span));
    }
}

fn color(span: &Span) -> Color32 {
    let (_, _, color) = STAGES[span.stage() as usize];
    if span.frame().is_multiple_of(2) { color } else { color.gamma_multiply(0.55) }
}
