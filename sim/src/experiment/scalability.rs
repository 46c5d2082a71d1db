//! Scalability (§7.2.1): Figs. 11 to 13.

use super::error::ExperimentError;
use super::figure::{Chart, Figure, Line, drawn};
use super::load::RenderLoad;
use super::outcome::{Outcome, marked};
use super::race::{Race, Runner, WARM_UP};
use super::speedup::efficiency;
use super::statistics::rounded_down;
use super::subject::Subject;
use super::{Laboratory, Report};
use crate::scene::ParticleScene;

pub(super) fn run(laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
    let plan = laboratory.plan;
    let sweep = &plan.scalability;
    let threads = plan.threads.iter().copied();
    let runners: Vec<Runner> =
        std::iter::once(Runner::SERIAL).chain(threads.map(Runner::pipeline)).collect();
    let mut outcomes = Vec::new();
    for &objects in &sweep.objects {
        let scene = ParticleScene { seed: plan.seed, ..ParticleScene::new(objects) };
        let (frames, rounds) = (sweep.frames, sweep.rounds..=sweep.rounds);
        let subject = Subject::Particles(scene);
        let race = Race { subject, load: RenderLoad::Null, warm_up: WARM_UP, frames, rounds };
        outcomes.push(laboratory.race(race, &runners)?);
    }
    let mut rounds = Outcome::rounds_table("scalability-rounds");
    let mut summary = Outcome::summary_table("scalability");
    for outcome in &outcomes {
        outcome.add_rounds(&mut rounds);
        outcome.add_summary(&mut summary);
    }
    let figures = vec![
        throughput(&outcomes, &plan.threads)?,
        speed_ups(&outcomes, &plan.threads)?,
        efficiencies(&outcomes, &plan.threads)?,
    ];
    Ok(Report { tables: vec![summary, rounds], figures, shown: None })
}

/// Which frames were timed, how often, and how many rounds were marked.
fn rounds(outcomes: &[Outcome]) -> String {
    let timed = outcomes.first().map(|Outcome { race, series, .. }| {
        format!("{}, {} rounds of each size. ", race.timed(), series.rounds().len())
    });
    timed.unwrap_or_default() + &marked(outcomes)
}

/// Fig. 11.
fn throughput(outcomes: &[Outcome], threads: &[usize]) -> Result<Figure, ExperimentError> {
    let throughput = |runner| {
        move |outcome: &Outcome| {
            outcome.throughput(outcome.series.best_rounds(), runner).map(|fps| fps.median)
        }
    };
    let mut lines = vec![Line {
        dashed: true,
        color: 6,
        ..line("serial", outcomes, throughput(Runner::SERIAL))
    }];
    lines.extend(drawn(threads).enumerate().map(|(color, count)| Line {
        color,
        ..line(&named(count), outcomes, throughput(Runner::pipeline(count)))
    }));
    let most = threads.iter().copied().max().unwrap_or(1);
    let reached = |outcome: Option<&Outcome>| {
        let outcome = outcome?;
        let fps = throughput(Runner::pipeline(most))(outcome)?;
        Some(format!("{fps:.0} frames per second with {} objects", outcome.race.subject.objects()))
    };
    let ends = [reached(outcomes.first()), reached(outcomes.last())];
    let ends: Vec<String> = ends.into_iter().flatten().collect();
    Chart {
        name: "fig11-throughput",
        title: "Throughput".to_owned(),
        x_label: "objects",
        y_label: "frames per second",
        finding: format!("{}: {}. {}", named(most), ends.join(", "), rounds(outcomes)),
        paper: "Each additional thread increases the throughput (Fig. 11).",
        ..Chart::default()
    }
    .lines(lines)
}

/// Fig. 12.
fn speed_ups(outcomes: &[Outcome], threads: &[usize]) -> Result<Figure, ExperimentError> {
    let ideal = |count: usize, color: usize| Line {
        // Where it is says whose it is.
        label: if color == 0 { "ideal".to_owned() } else { String::new() },
        points: outcomes
            .iter()
            .map(|outcome| (outcome.race.subject.objects() as f64, count as f64))
            .collect(),
        dashed: true,
        color,
    };
    let mut lines = Vec::new();
    for (color, count) in drawn(threads).enumerate() {
        lines.push(Line { color, ..line(&named(count), outcomes, speed_up(count)) });
        lines.push(ideal(count, color));
    }
    let most = threads.iter().copied().max().unwrap_or(1);
    let reached = outcomes.iter().filter_map(speed_up(most));
    let (least, greatest) = range(reached);
    Chart {
        name: "fig12-speed-up",
        title: "Speed-up over one thread".to_owned(),
        x_label: "objects",
        y_label: "speed-up S_p = T_1 / T_p",
        finding: format!(
            "With {} the speed-up is {least:.2} to {greatest:.2}. {}",
            named(most),
            rounds(outcomes)
        ),
        paper: "Near-linear; it drops by 0.2 to 0.6 % with each 100 further objects (§8.1).",
        ..Chart::default()
    }
    .lines(lines)
}

/// Fig. 13.
fn efficiencies(outcomes: &[Outcome], threads: &[usize]) -> Result<Figure, ExperimentError> {
    let efficiency = |count| {
        let speed_up = speed_up(count);
        move |outcome: &Outcome| speed_up(outcome).map(|speed_up| efficiency(speed_up, count))
    };
    let ideal = line("ideal", outcomes, |_| Some(1.0));
    let mut lines = vec![Line { dashed: true, color: 6, ..ideal }];
    lines.extend(
        drawn(threads).enumerate().map(|(color, count)| Line {
            color,
            ..line(&named(count), outcomes, efficiency(count))
        }),
    );
    let all = threads.iter().flat_map(|&count| outcomes.iter().filter_map(efficiency(count)));
    let (least, _) = range(all);
    Chart {
        name: "fig13-efficiency",
        title: "Thread efficiency".to_owned(),
        x_label: "objects",
        y_label: "efficiency E_p = S_p / p",
        finding: format!(
            "The efficiency is at least {:.3}. {}",
            rounded_down(least, 3),
            rounds(outcomes)
        ),
        paper: "Greater than 0.89 in all cases, up to 6 threads and 1,000 objects (§8.1, Fig. 13).",
        ..Chart::default()
    }
    .lines(lines)
}

/// A pipeline's median speed-up over one thread.
fn speed_up(threads: usize) -> impl Fn(&Outcome) -> Option<f64> + Copy {
    move |outcome| outcome.median_speed_up(Runner::pipeline(threads), Runner::pipeline(1))
}

/// A line over the numbers of objects.
fn line(label: &str, outcomes: &[Outcome], value: impl Fn(&Outcome) -> Option<f64>) -> Line {
    let point = |outcome: &Outcome| Some((outcome.race.subject.objects() as f64, value(outcome)?));
    let points = outcomes.iter().filter_map(point).collect();
    Line { label: label.to_owned(), points, ..Line::default() }
}

/// So many threads, in words.
pub(super) fn named(threads: usize) -> String {
    if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") }
}

/// The least and the greatest of some values.
pub(super) fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), value| {
        (least.min(value), greatest.max(value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::tests::outcome;

    #[test]
    fn findings_say_what_was_reached() {
        let seconds = [Runner::SERIAL, Runner::pipeline(1), Runner::pipeline(2)].into_iter();
        let seconds: Vec<_> = seconds.zip([6.0, 4.0, 2.5]).collect();
        let outcomes = [outcome(100, &seconds, &[2.0; 4])];
        let none = "Frames 1 to 100, 3 rounds of each size. None of the 3 rounds was marked.";
        let finding =
            |figure: Result<Figure, ExperimentError>| figure.expect("it is drawn").finding;
        let reached = "40 frames per second with 4 objects";
        let expected = format!("2 threads: {reached}, {reached}. {none}");
        assert_eq!(finding(throughput(&outcomes, &[1, 2])), expected);
        let expected = format!("With 2 threads the speed-up is 1.60 to 1.60. {none}");
        assert_eq!(finding(speed_ups(&outcomes, &[1, 2])), expected);
        let expected = format!("The efficiency is at least 0.800. {none}");
        assert_eq!(finding(efficiencies(&outcomes, &[1, 2])), expected);
    }

    #[test]
    fn the_least_efficiency_is_not_rounded_up() {
        let seconds = [(Runner::pipeline(1), 1.7792), (Runner::pipeline(2), 1.0)];
        let figure = efficiencies(&[outcome(100, &seconds, &[2.0; 4])], &[1, 2]);
        let finding = figure.expect("it is drawn").finding;
        assert!(finding.starts_with("The efficiency is at least 0.889. "), "{finding}");
    }
}
