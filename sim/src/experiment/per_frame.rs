//! Collisions and speed-up of each frame (§7.2.2): Fig. 15.

use super::error::ExperimentError;
use super::figure::{Chart, Figure, Line, drawn};
use super::load::RenderLoad;
use super::outcome::{Outcome, marked};
use super::race::{Race, Runner};
use super::scalability::named;
use super::speedup::speed_up;
use super::statistics::{Quartiles, variance};
use super::subject::Subject;
use super::table::Table;
use super::timing::Rounds;
use super::{Laboratory, Report};
use crate::scene::ParticleScene;

/// What was seen of the frames.
struct Frames {
    outcome: Outcome,
    collisions: Vec<u64>,
    /// Median speed-ups over the rounds, for each number of threads and frame.
    speed_ups: Vec<(usize, Vec<f64>)>,
}

pub(super) fn run(laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
    let frames = measure(laboratory)?;
    let mut rounds = Outcome::rounds_table("per-frame-rounds");
    frames.outcome.add_rounds(&mut rounds);
    let tables = vec![frames.table(), frames.summary(), rounds];
    let figures = vec![frames.collision_figure()?, frames.speed_up_figure()?];
    Ok(Report { tables, figures, shown: None })
}

fn measure(laboratory: &mut Laboratory<'_>) -> Result<Frames, ExperimentError> {
    let plan = laboratory.plan;
    let sweep = &plan.per_frame;
    let objects = sweep.objects[0];
    let scene = ParticleScene { seed: plan.seed, gravity: true, ..ParticleScene::new(objects) };
    let (frames, rounds) = (sweep.frames, sweep.rounds);
    // The first frames matter here: they hold most collisions.
    let subject = Subject::Particles(scene);
    let race =
        Race { subject, load: RenderLoad::Null, warm_up: 0, frames, rounds: rounds..=rounds };
    let runners: Vec<Runner> = plan.threads.iter().copied().map(Runner::pipeline).collect();
    let mut collisions = vec![0; frames as usize];
    let mut times = vec![Vec::with_capacity(frames as usize * rounds); runners.len()];
    let outcome = laboratory.race_observed(race, &runners, &mut |runner, record, took| {
        collisions[record.frame as usize] = record.pairs.collisions;
        times[runner].push(took.as_secs_f64());
    })?;
    let speed_ups = plan.threads.iter().enumerate();
    let speed_ups = speed_ups
        .map(|(runner, &threads)| (threads, by_frame(&outcome, &times[0], &times[runner])))
        .collect();
    Ok(Frames { outcome, collisions, speed_ups })
}

/// The median speed-up of each frame, over the rounds that the outcome rests on. Times are of round
/// after round.
fn by_frame(outcome: &Outcome, one_thread: &[f64], threads: &[f64]) -> Vec<f64> {
    let frames = outcome.race.frames as usize;
    let good = outcome.series.best_rounds() == Rounds::Good;
    let marks = outcome.series.marks();
    let median = |frame: usize| {
        let rounds = marks.iter().enumerate().filter(|&(_, &bad)| !(good && bad));
        let places = rounds.map(|(round, _)| round * frames + frame);
        Quartiles::of(places.map(|place| speed_up(one_thread[place], threads[place])))
    };
    (0..frames).filter_map(median).map(|quartiles| quartiles.median).collect()
}

impl Frames {
    fn table(&self) -> Table {
        let names: Vec<String> =
            self.speed_ups.iter().map(|(threads, _)| format!("s_p_{threads}")).collect();
        let mut header = vec!["frame", "collisions"];
        header.extend(names.iter().map(String::as_str));
        let mut table = Table::new("per-frame", &header);
        for (frame, collisions) in self.collisions.iter().enumerate() {
            let mut row = vec![(frame + 1).to_string(), collisions.to_string()];
            row.extend(self.speed_ups.iter().map(|(_, values)| format!("{:.4}", values[frame])));
            table.rows.push(row);
        }
        table
    }

    fn summary(&self) -> Table {
        let header = ["threads", "s_p_lower", "s_p_median", "s_p_upper", "s_p_max", "s_p_variance"];
        let mut table = Table::new("per-frame-summary", &header);
        for (threads, values) in &self.speed_ups {
            let Some(quartiles) = Quartiles::of(values.iter().copied()) else { continue };
            let most = values.iter().copied().fold(0.0, f64::max);
            let numbers =
                [quartiles.lower, quartiles.median, quartiles.upper, most, variance(values)];
            let mut row = vec![threads.to_string()];
            row.extend(numbers.map(|number| format!("{number:.5}")));
            table.rows.push(row);
        }
        table
    }

    fn collision_figure(&self) -> Result<Figure, ExperimentError> {
        // The first frame is number 1, as everywhere.
        let counts = || (1..).zip(&self.collisions);
        let points = counts().map(|(frame, &count)| (f64::from(frame), count as f64)).collect();
        let (busiest, most) = counts().max_by_key(|&(_, count)| count).unwrap_or((0, &0));
        let (calmest, fewest) = counts().min_by_key(|&(_, count)| count).unwrap_or((0, &0));
        Chart {
            name: "fig15-collisions",
            title: format!("Collisions of each frame, {} objects", self.outcome.race.subject.objects()),
            x_label: "frame",
            y_label: "collisions",
            finding: format!("The most are {most}, in frame {busiest}; the fewest {fewest}, in frame {calmest}."),
            paper: "1,646 at first, down to 160 as particles part, up to 1,056 as they pile up (§8.2).",
            ..Chart::default()
        }
        .lines(vec![Line { points, ..Line::default() }])
    }

    fn speed_up_figure(&self) -> Result<Figure, ExperimentError> {
        let counts: Vec<usize> = self.speed_ups.iter().map(|&(threads, _)| threads).collect();
        let counts: Vec<usize> = drawn(&counts).collect();
        let shown = self.speed_ups.iter().filter(|(threads, _)| counts.contains(threads));
        let lines = shown.enumerate().map(|(color, (threads, values))| Line {
            label: named(*threads),
            points: (1..).map(f64::from).zip(values.iter().copied()).collect(),
            color,
            ..Line::default()
        });
        let finding = self.speed_ups.iter().skip(1).filter_map(|(threads, values)| {
            let median = Quartiles::of(values.iter().copied())?.median;
            let (name, variance) = (named(*threads), variance(values));
            Some(format!("{name}: median {median:.2}, variance over the frames {variance:.4}. "))
        });
        Chart {
            name: "fig15-speed-up",
            title: "Speed-up of each frame over one thread".to_owned(),
            x_label: "frame",
            y_label: "speed-up S_p = T_1 / T_p",
            finding: finding.collect::<String>()
                + "A frame's is the median over rounds, which varies less than one round's. "
                + &marked([&self.outcome]),
            paper: "Level, whatever the number of collisions; variance 0.001 to 0.08 with 2 to 6 \
                    threads (§8.2).",
            ..Chart::default()
        }
        .lines(lines.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::tests::outcome;

    #[test]
    fn a_frames_speed_up_is_the_median_over_good_rounds() {
        let seconds = [1, 2].map(|threads| (Runner::pipeline(threads), 1.0));
        // Two rounds of two frames, the last one marked.
        let outcome = outcome(2, &seconds, &[2.0, 2.0, 1.0]);
        let (one, two) = ([4.0, 6.0, 9.0, 9.0], [2.0, 2.0, 1.0, 1.0]);
        let speed_up = by_frame(&outcome, &one, &two);
        assert_eq!(speed_up, [2.0, 3.0]);
        let speed_ups = vec![(1, by_frame(&outcome, &one, &one)), (2, speed_up)];
        let frames = Frames { outcome, collisions: vec![7, 5], speed_ups };
        assert_eq!(
            frames.table().rows,
            [["1", "7", "1.0000", "2.0000"], ["2", "5", "1.0000", "3.0000"]]
        );
        let summary = frames.summary();
        assert_eq!(summary.rows[1], ["2", "2.25000", "2.50000", "2.75000", "3.00000", "0.25000"]);
    }

    #[test]
    fn where_all_rounds_are_marked_all_count() {
        let seconds = [1, 2].map(|threads| (Runner::pipeline(threads), 1.0));
        let outcome = outcome(1, &seconds, &[1.0; 3]);
        assert_eq!(by_frame(&outcome, &[4.0, 6.0], &[2.0, 2.0]), [2.5]);
    }
}
