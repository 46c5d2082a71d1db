//! Figures, drawn by kuva.

use kuva::backend::raster::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::{BarPlot, LegendPosition, LinePlot, MarkerShape, ScatterPlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;

use super::error::ExperimentError;

/// Pixels of a PNG for one of the SVG's.
const SCALE: f32 = 2.0;
/// Width of a line, in pixels; usually 2.
const STROKE: f64 = 2.0;
/// Radius of a point, in pixels; usually 4.
const POINT: f64 = 4.0;
/// Colours that are told apart by most people (Okabe and Ito 2008), but yellow, which is pale.
const COLORS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"];

/// Which of so many numbers of threads a figure shows: all, or where colours would not tell them apart the powers of
/// two and the greatest.
pub(super) fn drawn(threads: &[usize]) -> impl Iterator<Item = usize> {
    let (are_few, greatest) = (threads.len() <= COLORS.len(), threads.iter().copied().max());
    let is_drawn = move |count: usize| count.is_power_of_two() || Some(count) == greatest;
    threads.iter().copied().filter(move |&count| are_few || is_drawn(count))
}

/// A drawn figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Its files' name, without ending.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// The drawing.
    pub svg: String,
    /// The same in pixels.
    pub png: Vec<u8>,
    /// What was found, in a sentence or two.
    pub finding: String,
    /// What the paper says of it, on its machine of six cores.
    pub paper: &'static str,
}

/// A line of a chart.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    /// Empty for a line that needs no legend.
    pub(super) label: String,
    pub(super) points: Vec<(f64, f64)>,
    pub(super) dashed: bool,
    /// Lines of the same number have the same colour.
    pub(super) color: usize,
}

/// What to draw.
#[derive(Clone, Debug, Default)]
pub(super) struct Chart {
    pub(super) name: &'static str,
    pub(super) title: String,
    pub(super) x_label: &'static str,
    pub(super) y_label: &'static str,
    /// Whether the x axis counts something small, one tick for each.
    pub(super) x_counts: bool,
    pub(super) finding: String,
    pub(super) paper: &'static str,
}

impl Chart {
    /// Draws lines; the y axis begins at 0.
    pub(super) fn lines(self, lines: Vec<Line>) -> Result<Figure, ExperimentError> {
        let highest = lines.iter().flat_map(|line| &line.points).map(|&(_, y)| y);
        let highest = highest.fold(0.0, f64::max);
        let plots = lines.into_iter().map(plot).collect();
        self.draw(plots, highest)
    }

    /// Draws a group of bars for each label; `series` names the bars of a group, which have no colours of their own
    /// where these would not tell them apart.
    pub(super) fn bars(
        self,
        series: &[String],
        groups: Vec<(String, Vec<f64>)>,
    ) -> Result<Figure, ExperimentError> {
        let highest = groups.iter().flat_map(|(_, bars)| bars).copied().fold(0.0, f64::max);
        let are_few = series.len() <= COLORS.len();
        let color = |place: usize| COLORS[if are_few { place } else { 0 }];
        let mut plot = BarPlot::new();
        for (label, bars) in groups {
            let bars = bars.into_iter().enumerate().map(|(place, bar)| (bar, color(place)));
            plot = plot.with_group(label, bars.collect::<Vec<_>>());
        }
        if are_few {
            plot = plot.with_legend(series.iter().map(String::as_str).collect());
        }
        self.draw(vec![plot.into()], highest)
    }

    fn draw(self, plots: Vec<Plot>, highest: f64) -> Result<Figure, ExperimentError> {
        let mut layout = Layout::auto_from_plots(&plots)
            .with_title(self.title.as_str())
            .with_title_size(16)
            .with_x_label(self.x_label)
            .with_y_label(self.y_label)
            .with_width(720.0)
            .with_height(420.0)
            .with_y_axis_min(0.0)
            .with_y_axis_max(if highest > 0.0 { highest * 1.05 } else { 1.0 })
            .with_legend_position(LegendPosition::OutsideRightTop);
        if self.x_counts {
            layout = layout.with_x_tick_step(1.0);
        }
        let scene = render_multiple(plots, layout);
        let png = RasterBackend::new().with_scale(SCALE).render_scene(&scene);
        let png = png.map_err(|reason| ExperimentError::Draw { figure: self.name, reason })?;
        let svg = shrinkable(&SvgBackend.render_scene(&scene), scene.width, scene.height);
        let Self { name, title, finding, paper, .. } = self;
        Ok(Figure { name, title, svg, png, finding, paper })
    }
}

/// An SVG of so many pixels that is drawn smaller where there are fewer, as on a narrow page, and not cut off.
fn shrinkable(svg: &str, width: f64, height: f64) -> String {
    svg.replacen("<svg ", &format!("<svg viewBox=\"0 0 {width} {height}\" "), 1)
}

fn plot(line: Line) -> Plot {
    if let [_] = line.points[..] {
        return point(line);
    }
    let color = COLORS[line.color % COLORS.len()];
    let mut plot =
        LinePlot::new().with_data(line.points).with_color(color).with_stroke_width(STROKE);
    if !line.label.is_empty() {
        plot = plot.with_legend(line.label);
    }
    match (line.dashed, line.color < COLORS.len()) {
        (true, _) => plot.with_dashed().into(),
        // The second one of this colour.
        (false, false) => plot.with_dotted().into(),
        (false, true) => plot.into(),
    }
}

/// A line of one point, of which a line would show nothing.
fn point(line: Line) -> Plot {
    let color = COLORS[line.color % COLORS.len()];
    let mut plot = ScatterPlot::new().with_data(line.points).with_color(color).with_size(POINT);
    if !line.label.is_empty() {
        plot = plot.with_legend(line.label);
    }
    // The second one of this colour.
    if line.color >= COLORS.len() {
        plot = plot.with_marker(MarkerShape::Triangle);
    }
    plot.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_numbers_of_threads_some_are_drawn() {
        let drawn = |cores: usize| drawn(&(1..=cores).collect::<Vec<_>>()).collect::<Vec<_>>();
        assert_eq!(drawn(6), [1, 2, 3, 4, 5, 6]);
        assert_eq!(drawn(12), [1, 2, 4, 8, 12]);
        assert_eq!(drawn(64), [1, 2, 4, 8, 16, 32, 64]);
    }

    #[test]
    fn bars_have_colors_of_their_own_or_one() {
        let figure = |workers: usize| {
            let names: Vec<String> =
                (0..workers).map(|worker| format!("worker {worker}")).collect();
            let groups = vec![("5".to_owned(), vec![1.0; workers])];
            Chart::default().bars(&names, groups).expect("bars are drawn").svg
        };
        let colors = |svg: &str| COLORS[1..].iter().filter(|color| svg.contains(**color)).count();
        let [few, many] = [COLORS.len(), COLORS.len() + 1].map(figure);
        assert!(
            colors(&few) >= COLORS.len() - 2 && few.contains("worker 6"),
            "black is the text's too"
        );
        assert!(colors(&many) <= 1 && many.contains(COLORS[0]) && !many.contains("worker"));
    }

    #[test]
    fn a_line_of_one_point_is_seen() {
        let line = |color| Line {
            label: "line".to_owned(),
            points: vec![(1.0, 1.0)],
            color,
            ..Line::default()
        };
        let svg = |color| {
            let figure = Chart::default().lines(vec![line(color)]);
            figure.expect("a point is drawn").svg
        };
        let [first, second] = [0, COLORS.len()].map(svg);
        for svg in [&first, &second] {
            let places = svg.matches(COLORS[0]).count();
            assert!(places >= 2, "{places}: in the legend and where the point is");
            assert!(!svg.contains("NaN"), "{svg}");
        }
        assert_ne!(first, second, "two of one colour are told apart");
    }

    #[test]
    fn a_page_may_shrink_a_figure() {
        let figure = Chart::default().lines(vec![Line::default()]).expect("it is drawn");
        let (head, _) = figure.svg.split_once('>').expect("a tag");
        let size = |name: &str| {
            let (_, rest) = head.split_once(&format!(" {name}=\"")).expect("it has a size");
            rest.split_once('"').expect("an end").0
        };
        let whole = format!("viewBox=\"0 0 {} {}\"", size("width"), size("height"));
        assert!(head.contains(&whole), "no {whole} in {head}");
    }

    #[test]
    fn more_lines_than_colors_are_told_apart() {
        let line = |color| Line { points: vec![(0.0, 0.0), (1.0, 1.0)], color, ..Line::default() };
        let figure = |color| Chart::default().lines(vec![line(color)]).expect("a line is drawn");
        let is_dotted = |color| figure(color).svg.contains("stroke-dasharray");
        for color in 0..COLORS.len() {
            assert!(!is_dotted(color) && is_dotted(color + COLORS.len()), "color {color}");
        }
    }
}
