//! What a race came to, and the rows it makes in the tables.

use super::load::RenderLoad;
use super::race::{Race, Runner};
use super::speedup::efficiency;
use super::statistics::Quartiles;
use super::table::Table;
use super::timing::{Rounds, Series};

/// The columns of [`Outcome::add_rounds`].
const ROUND_COLUMNS: [&str; 10] = [
    "objects",
    "load",
    "executor",
    "threads",
    "round",
    "seconds",
    "frames_per_second",
    "gain",
    "ping_pong_ns",
    "marked",
];

/// The columns of [`Outcome::add_summary`].
const SUMMARY_COLUMNS: [&str; 20] = [
    "objects",
    "load",
    "render_share",
    "first_frame",
    "last_frame",
    "executor",
    "threads",
    "which_rounds",
    "rounds",
    "seconds_lower",
    "seconds_median",
    "seconds_upper",
    "frames_per_second",
    "s_s_lower",
    "s_s_median",
    "s_s_upper",
    "s_p_lower",
    "s_p_median",
    "s_p_upper",
    "e_p",
];

/// A race that was run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What was run.
    pub race: Race,
    /// Who took part.
    pub runners: Vec<Runner>,
    /// The times, with a contender for each runner, in their order, and perhaps one more.
    pub series: Series,
    /// The contender that is the serial version without rendering, where that is timed beside it.
    pub without_rendering: Option<usize>,
}

impl Outcome {
    /// A table for every round of every runner.
    #[must_use]
    pub fn rounds_table(name: &'static str) -> Table {
        Table::new(name, &ROUND_COLUMNS)
    }

    /// A table for what the rounds come to.
    #[must_use]
    pub fn summary_table(name: &'static str) -> Table {
        Table::new(name, &SUMMARY_COLUMNS)
    }

    /// A runner's quartiles of frames per second.
    #[must_use]
    pub fn throughput(&self, which: Rounds, runner: Runner) -> Option<Quartiles> {
        let index = self.index(runner)?;
        self.series.quartiles(which, |seconds| self.race.frames as f64 / seconds[index])
    }

    /// The quartiles of the rounds' speed-ups of a runner over another.
    #[must_use]
    pub fn speed_up(&self, which: Rounds, runner: Runner, over: Runner) -> Option<Quartiles> {
        self.series.ratio(which, self.index(over)?, self.index(runner)?)
    }

    /// The runner's median speed-up over another in the good rounds, or in all if none is good.
    #[must_use]
    pub fn median_speed_up(&self, runner: Runner, over: Runner) -> Option<f64> {
        Some(self.speed_up(self.series.best_rounds(), runner, over)?.median)
    }

    /// What share of the serial version's work rendering is: 0 where nothing is rendered, or the median of these rounds,
    /// in each of which it is timed with and without; of all where none is good.
    #[must_use]
    pub fn render_share(&self, which: Rounds) -> Option<f64> {
        if self.race.load == RenderLoad::Null {
            return Some(0.0);
        }
        let which = match which {
            Rounds::All => Rounds::All,
            Rounds::Good => self.series.best_rounds(),
        };
        let (with, without) = (self.index(Runner::SERIAL)?, self.without_rendering?);
        Some(1.0 - self.series.ratio(which, without, with)?.median)
    }

    /// Adds a row for each runner and round, and for the serial version without rendering, whose load is `none`.
    pub fn add_rounds(&self, table: &mut Table) {
        let Race { subject, load, frames, .. } = &self.race;
        let runners =
            self.runners.iter().enumerate().map(|(index, runner)| (index, load.name(), runner));
        let without = self.without_rendering.map(|index| (index, "none", &Runner::SERIAL));
        let contenders: Vec<_> = runners.chain(without).collect();
        for (number, (round, bad)) in
            self.series.rounds().iter().zip(self.series.marks()).enumerate()
        {
            for &(index, load, runner) in &contenders {
                let seconds = round.seconds[index];
                table.push(&[
                    &subject.objects(),
                    &load,
                    &runner.executor.name(),
                    &runner.threads,
                    &number,
                    &format_args!("{seconds:.6}"),
                    &format_args!("{:.2}", *frames as f64 / seconds),
                    &format_args!("{:.3}", round.phase.gain),
                    &format_args!("{:.1}", round.phase.ping_pong),
                    &u8::from(bad),
                ]);
            }
        }
    }

    /// Adds two rows for each runner: over all rounds, and over the good ones if there are any.
    pub fn add_summary(&self, table: &mut Table) {
        let all = self.series.rounds().len();
        let good = all - self.series.marked();
        for (which, name, count) in [(Rounds::All, "all", all), (Rounds::Good, "good", good)] {
            let share = self.render_share(which);
            for &runner in &self.runners {
                self.add_summary_row(table, share, runner, (which, name, count));
            }
        }
    }

    fn add_summary_row(
        &self,
        table: &mut Table,
        share: Option<f64>,
        runner: Runner,
        (which, name, count): (Rounds, &str, usize),
    ) {
        let seconds = self.index(runner).and_then(|index| self.series.seconds(which, index));
        let Some((seconds, throughput)) = seconds.zip(self.throughput(which, runner)) else {
            return;
        };
        let one = Runner { threads: 1, ..runner };
        let (s_s, s_p) =
            (self.speed_up(which, runner, Runner::SERIAL), self.speed_up(which, runner, one));
        let cell =
            |value: Option<f64>| value.map(|value| format!("{value:.4}")).unwrap_or_default();
        table.push(&[
            &self.race.subject.objects(),
            &self.race.load.name(),
            &cell(share),
            &(self.race.warm_up + 1),
            &(self.race.warm_up + self.race.frames),
            &runner.executor.name(),
            &runner.threads,
            &name,
            &count,
            &format_args!("{:.6}", seconds.lower),
            &format_args!("{:.6}", seconds.median),
            &format_args!("{:.6}", seconds.upper),
            &format_args!("{:.2}", throughput.median),
            &cell(s_s.map(|ratio| ratio.lower)),
            &cell(s_s.map(|ratio| ratio.median)),
            &cell(s_s.map(|ratio| ratio.upper)),
            &cell(s_p.map(|ratio| ratio.lower)),
            &cell(s_p.map(|ratio| ratio.median)),
            &cell(s_p.map(|ratio| ratio.upper)),
            &cell(s_p.map(|ratio| efficiency(ratio.median, runner.threads))),
        ]);
    }

    fn index(&self, runner: Runner) -> Option<usize> {
        self.runners.iter().position(|&other| other == runner)
    }
}

/// How many rounds of some races were marked, in words.
pub(super) fn marked<'a>(outcomes: impl IntoIterator<Item = &'a Outcome>) -> String {
    let (mut all, mut left_out, mut shown) = (0, 0, 0);
    for Outcome { series, .. } in outcomes {
        all += series.rounds().len();
        match series.best_rounds() {
            Rounds::Good => left_out += series.marked(),
            Rounds::All => shown += series.marked(),
        }
    }
    in_words(all, left_out, shown)
}

/// Of `all` rounds so many were marked and left out, and so many marked and shown, for want of others.
fn in_words(all: usize, left_out: usize, shown: usize) -> String {
    let bad = left_out + shown;
    match (left_out, shown) {
        (0, 0) => format!("None of the {all} rounds was marked."),
        _ if shown == all => format!("All {all} rounds were marked; they are shown."),
        (_, 0) => {
            format!("{bad} of {all} rounds were marked and are not in the figure.")
        }
        _ => format!(
            "{bad} of {all} rounds were marked; {shown} of them are in the figure, where \
             there are no others."
        ),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::experiment::calibrator::Phase;
    use crate::experiment::error::ExperimentError;
    use crate::experiment::load::StandIn;
    use crate::experiment::subject::Subject;
    use crate::experiment::timing::Contender;
    use crate::scene::ParticleScene;

    /// The outcome of a race of so many frames in which each runner takes these seconds in every round, in these
    /// phases before and after each.
    pub(in super::super) fn outcome(
        frames: u64,
        seconds: &[(Runner, f64)],
        gains: &[f64],
    ) -> Outcome {
        let seconds: Vec<_> = seconds.iter().map(|&(runner, each)| (runner, vec![each])).collect();
        outcome_by_rounds(frames, &seconds, gains)
    }

    /// The same where each runner takes these seconds in round after round, and then again.
    fn outcome_by_rounds(frames: u64, seconds: &[(Runner, Vec<f64>)], gains: &[f64]) -> Outcome {
        let subject = Subject::Particles(ParticleScene::new(4));
        let rounds = gains.len() - 1..=gains.len() - 1;
        let (load, warm_up) = (RenderLoad::Null, 0);
        let contender = |(runner, seconds): &(Runner, Vec<f64>)| {
            let (label, mut seconds) = (runner.label(), seconds.clone().into_iter().cycle());
            let run = move || Ok::<_, ExperimentError>(seconds.next().expect("some"));
            Contender { label, spins: false, run: Box::new(run) }
        };
        let mut contenders: Vec<_> = seconds.iter().map(contender).collect();
        let mut gains = gains.iter();
        let mut phase = || Phase { gain: *gains.next().expect("a phase"), ping_pong: 100.0 };
        let series = Series::measure(&mut contenders, rounds.clone(), &mut phase, &mut || ());
        Outcome {
            race: Race { subject, load, warm_up, frames, rounds },
            runners: seconds.iter().map(|&(runner, _)| runner).collect(),
            series: series.expect("nothing fails"),
            without_rendering: None,
        }
    }

    #[test]
    fn speed_ups_are_of_the_faster_over_the_slower() {
        let [one, two] = [1, 2].map(Runner::pipeline);
        let seconds = [(Runner::SERIAL, 6.0), (one, 4.0), (two, 2.5)];
        let outcome = outcome(100, &seconds, &[2.0; 4]);
        let median = |quartiles: Option<Quartiles>| quartiles.map(|quartiles| quartiles.median);
        assert_eq!(median(outcome.speed_up(Rounds::Good, two, one)), Some(1.6));
        assert_eq!(outcome.median_speed_up(two, Runner::SERIAL), Some(2.4));
        assert_eq!(outcome.median_speed_up(Runner::pipeline(3), one), None);
        assert_eq!(median(outcome.throughput(Rounds::All, two)), Some(40.0));
        let mut table = Outcome::rounds_table("rounds");
        outcome.add_rounds(&mut table);
        let third = ["4", "null", "pipeline", "2", "0", "2.500000", "40.00", "2.000", "100.0", "0"];
        assert_eq!(table.rows[2], third);
        let mut table = Outcome::summary_table("summary");
        outcome.add_summary(&mut table);
        let row = &table.rows[2];
        assert_eq!(row[..9], ["4", "null", "0.0000", "1", "100", "pipeline", "2", "all", "3"]);
        assert_eq!(row[9..13], ["2.500000", "2.500000", "2.500000", "40.00"]);
        let ratios = ["2.4000", "2.4000", "2.4000", "1.6000", "1.6000", "1.6000", "0.8000"];
        assert_eq!(row[13..], ratios, "S_s, S_p and E_p");
    }

    /// With rendering, where the serial version takes these seconds in round after round, and those without it; the last
    /// round is marked.
    fn with_rendering(with: [f64; 3], without: [f64; 3]) -> Outcome {
        let times = [(Runner::SERIAL, with.to_vec()), (Runner::pipeline(1), without.to_vec())];
        let mut outcome = outcome_by_rounds(12, &times, &[2.0, 2.0, 2.0, 1.0]);
        outcome.race.load = RenderLoad::StandIn(StandIn::of(1));
        outcome.runners.pop();
        Outcome { without_rendering: Some(1), ..outcome }
    }

    #[test]
    fn the_share_of_rendering_is_of_each_round() {
        // From round to round the machine is twice as fast.
        let outcome = with_rendering([8.0, 4.0, 2.0], [6.0, 3.0, 1.0]);
        assert_eq!(outcome.render_share(Rounds::Good), Some(0.25));
        let outcome = with_rendering([8.0, 4.0, 2.0], [6.0, 2.0, 1.0]);
        assert_eq!(outcome.render_share(Rounds::All), Some(0.5));
        let unknown = Outcome { without_rendering: None, ..outcome };
        assert_eq!(unknown.render_share(Rounds::Good), None);
    }

    #[test]
    fn a_row_is_of_its_own_rounds() {
        let outcome = with_rendering([4.0, 6.0, 12.0], [3.0, 3.0, 6.0]);
        let mut table = Outcome::rounds_table("rounds");
        outcome.add_rounds(&mut table);
        let seen = |row: usize| [1, 2, 4, 5].map(|column| table.rows[row][column].as_str());
        assert_eq!(seen(2), ["stand-in", "serial", "1", "6.000000"]);
        assert_eq!(seen(3), ["none", "serial", "1", "3.000000"]);
        let mut table = Outcome::summary_table("summary");
        outcome.add_summary(&mut table);
        let seen = |row: usize| [2, 7, 10, 12].map(|column| table.rows[row][column].as_str());
        assert_eq!(seen(0), ["0.5000", "all", "6.000000", "2.00"]);
        // The median of 3 and 2; by the median of seconds it would be 2.4.
        assert_eq!(seen(1), ["0.3750", "good", "5.000000", "2.50"]);
    }

    #[test]
    fn marked_rounds_are_counted_as_they_are_shown() {
        let seconds = [(Runner::SERIAL, 1.0)];
        let some = outcome(1, &seconds, &[2.0, 2.0, 1.0]);
        let all = outcome(1, &seconds, &[1.0, 1.0]);
        assert_eq!(marked([&some]), in_words(2, 1, 0));
        assert_eq!(marked([&some, &all]), in_words(3, 1, 1));
    }

    #[test]
    fn what_is_left_out_is_said() {
        assert_eq!(in_words(20, 0, 0), "None of the 20 rounds was marked.");
        let left_out = "5 of 20 rounds were marked and are not in the figure.";
        assert_eq!(in_words(20, 5, 0), left_out);
        assert_eq!(in_words(20, 0, 20), "All 20 rounds were marked; they are shown.");
        let mixed =
            "8 of 20 rounds were marked; 5 of them are in the figure, where there are no others.";
        assert_eq!(in_words(20, 3, 5), mixed);
    }
}
