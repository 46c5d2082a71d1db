//! The comparative study (§7.2.3): Figs. 16 to 18.

use super::error::ExperimentError;
use super::figure::{Chart, Figure, Line};
use super::load::{RENDER_SHARE, RenderLoad, StandIn};
use super::outcome::{Outcome, marked};
use super::plan::Plan;
use super::race::{Race, Runner, WARM_UP};
use super::subject::Subject;
use super::timing::Rounds;
use super::{Laboratory, Report};
use crate::executor::ExecutorKind;
use crate::scene::ParticleScene;

/// The figures' names, for the light and the heavy load: without and with rendering.
const NAMES: [[&str; 2]; 2] = [
    ["fig16-light-load", "fig16-light-load-rendering"],
    ["fig17-heavy-load", "fig17-heavy-load-rendering"],
];

/// What is to be known of the others.
const PEERS: &str = if cfg!(feature = "native-peers") {
    "rayon-overlapped renders on a thread more than the axis says. "
} else {
    "rayon-overlapped renders on a thread more than the axis says; OpenMP and oneTBB were not built in (feature \
     native-peers). "
};

/// Figs. 16 and 17.
pub(super) fn particles(laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
    let Plan { seed, threads, compare, .. } = laboratory.plan;
    let study = Study {
        tables: ["compare", "compare-rounds"],
        threads,
        frames: compare.frames,
        rounds: compare.rounds,
        note: "",
        paper: "The pipeline is the fastest, 8 to 28 % ahead of OpenMP and TBB with 2 to 6 threads \
                (§8.3).",
    };
    let scene = |&objects| ParticleScene { seed: *seed, ..ParticleScene::new(objects) };
    let subjects = compare.objects.iter().map(scene).map(Subject::Particles);
    study.run(laboratory, subjects.zip(NAMES))
}

/// Fig. 18.
pub(super) fn retraction(laboratory: &mut Laboratory<'_>) -> Result<Report, ExperimentError> {
    let plan = &laboratory.plan.retraction;
    let subject = Subject::retraction()?;
    let core = if plan.keeps_core {
        "One core is left free as for haptics, which do not run here; rayon-overlapped draws on it. "
    } else {
        "There are too few cores to leave one free as for haptics. "
    };
    let study = Study {
        tables: ["compare-craniotomy", "compare-craniotomy-rounds"],
        threads: &plan.threads,
        frames: plan.frames,
        rounds: plan.rounds,
        note: core,
        paper: "The pipeline is the fastest, 1.3 to 1.6 times as fast as OpenMP and TBB with 2 to 5 \
                threads; one core is kept for haptics, and the serial version runs at 99 frames per \
                second (§8.3, Fig. 18).",
    };
    study.run(laboratory, [(subject, ["fig18-retraction", "fig18-retraction-rendering"])])
}

/// What a title and a caption say of the share that rendering came to, which need not be the one that was meant.
fn rendering(share: f64) -> [String; 2] {
    let (share, wanted) = (100.0 * share, 100.0 * RENDER_SHARE);
    [
        format!(", rendering {share:.0} % of the work"),
        format!(
            "Rendering is {share:.1} % of the serial version's work, which is timed with and without in each round; \
             {wanted:.0} % are wanted. "
        ),
    ]
}

/// Runs of each subject with these numbers of threads: every executor's in each round, without and with rendering, beside
/// which the serial version is timed without once more, and those that rendering is calibrated by.
pub(super) fn runs(threads: &[usize], rounds: usize) -> usize {
    (2 * runners(threads).len() + 1) * rounds + StandIn::runs_to_calibrate(rounds)
}

/// The serial executor, and every other with each of these numbers of threads.
fn runners(threads: &[usize]) -> Vec<Runner> {
    let parallel = threads.iter().copied().flat_map(Runner::parallel);
    std::iter::once(Runner::SERIAL).chain(parallel).collect()
}

/// Subjects with which every executor is timed, and what is said of them.
struct Study<'a> {
    /// The names of the summary and of the table of rounds.
    tables: [&'static str; 2],
    threads: &'a [usize],
    frames: u64,
    rounds: usize,
    /// What is to be known of the figures besides what was found: nothing, or whole sentences.
    note: &'static str,
    paper: &'static str,
}

impl Study<'_> {
    /// Times subjects without and with rendering, for figures of such names.
    fn run(
        &self,
        laboratory: &mut Laboratory<'_>,
        subjects: impl IntoIterator<Item = (Subject, [&'static str; 2])>,
    ) -> Result<Report, ExperimentError> {
        let runners = runners(self.threads);
        let [summary, rounds] = self.tables;
        let mut summary = Outcome::summary_table(summary);
        let mut all_rounds = Outcome::rounds_table(rounds);
        let mut figures = Vec::new();
        for (subject, names) in subjects {
            let stand_in = laboratory.stand_in(&subject, self.frames, self.rounds)?;
            let mut race = |load| {
                let (subject, &Self { frames, rounds, .. }) = (subject.clone(), self);
                let rounds = rounds..=rounds;
                let race = Race { subject, load, warm_up: WARM_UP, frames, rounds };
                laboratory.race(race, &runners)
            };
            for (load, name) in
                [RenderLoad::Null, RenderLoad::StandIn(stand_in)].into_iter().zip(names)
            {
                let outcome = race(load)?;
                outcome.add_rounds(&mut all_rounds);
                outcome.add_summary(&mut summary);
                figures.push(self.figure(name, &outcome)?);
            }
        }
        Ok(Report { tables: vec![summary, all_rounds], figures, shown: None })
    }

    /// The figure of a race.
    fn figure(&self, name: &'static str, outcome: &Outcome) -> Result<Figure, ExperimentError> {
        let kinds = Runner::parallel(1).map(|runner| runner.executor);
        let lines = kinds.enumerate().map(|(color, executor)| Line {
            label: executor.name().to_owned(),
            points: self.points(outcome, executor),
            dashed: false,
            color,
        });
        let subject = match &outcome.race.subject {
            Subject::Particles(scene) => format!("{} objects", scene.objects),
            Subject::Retraction(_) => "automated retraction".to_owned(),
        };
        let share = match outcome.race.load {
            RenderLoad::Null => None,
            RenderLoad::StandIn(_) => outcome.render_share(Rounds::Good),
        };
        let [in_title, rendering] = share.map(rendering).unwrap_or_default();
        let frames = outcome.race.timed() + ". ";
        Chart {
            name,
            title: format!("Speed-up over serial, {subject}{in_title}"),
            x_label: "threads",
            y_label: "speed-up S_s = T_s / T_p",
            x_counts: true,
            finding: self.finding(outcome)
                + &rendering
                + self.note
                + &frames
                + PEERS
                + &marked([outcome]),
            paper: self.paper,
        }
        .lines(lines.collect())
    }

    fn points(&self, outcome: &Outcome, executor: ExecutorKind) -> Vec<(f64, f64)> {
        let point = |&threads: &usize| {
            let runner = Runner { executor, threads };
            Some((threads as f64, outcome.median_speed_up(runner, Runner::SERIAL)?))
        };
        self.threads.iter().filter_map(point).collect()
    }

    /// How the pipeline does with the most threads, against the serial version and the one of the others that it is
    /// least ahead of: not always the fastest in the figure, where each is held against the serial version.
    fn finding(&self, outcome: &Outcome) -> String {
        let threads = self.threads.iter().copied().max().unwrap_or(1);
        let pipeline = Runner::pipeline(threads);
        let others = Runner::parallel(threads).filter(|&runner| runner != pipeline);
        let ratio = |other: Runner| Some((other, outcome.median_speed_up(pipeline, other)?));
        let closest = others.filter_map(ratio).min_by(|(_, a), (_, b)| a.total_cmp(b));
        let serial = outcome.throughput(outcome.series.best_rounds(), Runner::SERIAL);
        let (Some((other, ratio)), Some(speed_up), Some(serial)) =
            (closest, outcome.median_speed_up(pipeline, Runner::SERIAL), serial)
        else {
            return String::new();
        };
        format!(
            "{} reaches {speed_up:.2} times the serial version's {:.0} frames per second and is {ratio:.3} \
             times as fast as {}, the one it is least ahead of, by the median of rounds. ",
            pipeline.label(),
            serial.median,
            other.label()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::outcome::tests::outcome;

    #[test]
    fn a_caption_says_whom_the_pipeline_is_least_ahead_of() {
        let study = Study {
            tables: ["compare", "compare-rounds"],
            threads: &[1, 2],
            frames: 100,
            rounds: 3,
            note: "",
            paper: "",
        };
        let took = |runner: &Runner| match (runner.executor, runner.threads) {
            (ExecutorKind::Serial, _) => 4.0,
            (ExecutorKind::Pipeline, 2) => 2.0,
            (ExecutorKind::Rayon, 2) => 2.25,
            _ => 3.0,
        };
        let runners = runners(&[1, 2]);
        let seconds: Vec<_> = runners.iter().map(|runner| (*runner, took(runner))).collect();
        let finding = study.finding(&outcome(100, &seconds, &[2.0; 4]));
        let expected = "pipeline × 2 reaches 2.00 times the serial version's 25 frames per second and is 1.125 times \
                        as fast as rayon × 2, the one it is least ahead of, by the median of rounds. ";
        assert_eq!(finding, expected);
    }

    #[test]
    fn the_share_of_rendering_that_is_said_is_the_one_reached() {
        let [title, caption] = rendering(0.7519);
        assert_eq!(title, ", rendering 75 % of the work");
        assert!(
            caption.starts_with("Rendering is 75.2 % of the serial version's work"),
            "{caption}"
        );
        assert!(caption.ends_with("; 15 % are wanted. "), "{caption}");
    }
}
