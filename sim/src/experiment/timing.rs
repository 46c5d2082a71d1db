//! Contenders timed one after the other in rounds, so that all meet the same phases of the machine.

use std::ops::RangeInclusive;
use std::thread;
use std::time::Duration;

use super::calibrator::Phase;
use super::error::ExperimentError;
use super::machine::Machine;
use super::statistics::Quartiles;

/// How long to wait after a contender whose threads may go on spinning for a while: 30 ms, more than
/// the parallel frameworks' threads spin before they sleep.
const AFTER_SPINNING: Duration = Duration::from_millis(30);

/// Rounds that are run at most for each that is to be good; usually 4: on a shared machine about every second one is.
const MOST_FOR_A_GOOD_ROUND: usize = 4;

/// So many good rounds, if up to four times as many rounds have them: what is asked for where time matters less than
/// what is measured. On a machine on which no round can be good no more than are wanted.
#[must_use]
pub fn until_good(rounds: usize, machine: &Machine) -> RangeInclusive<usize> {
    let most = if machine.has_two_cores() { MOST_FOR_A_GOOD_ROUND } else { 1 };
    rounds..=rounds.saturating_mul(most)
}

/// Something that is timed, and what it fails with.
pub struct Contender<'a, E = ExperimentError> {
    /// What it is called.
    pub label: String,
    /// Whether its threads may go on spinning after a run.
    pub spins: bool,
    /// Runs it once and says how many seconds the timed part took.
    pub run: Box<dyn FnMut() -> Result<f64, E> + 'a>,
}

/// One round: every contender once.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Seconds, for each contender.
    pub seconds: Vec<f64>,
    /// The worse of the phases before and after.
    pub phase: Phase,
}

/// Which rounds a result is taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounds {
    /// All of them.
    All,
    /// Those that are not marked.
    Good,
}

/// The rounds of a set of contenders.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    labels: Vec<String>,
    rounds: Vec<Round>,
    /// [`Phase::usual_ping_pong`] of all phases, in nanoseconds: a round's is the worse of two.
    usual_ping_pong: f64,
}

impl Series {
    /// Times the contenders in rounds: as many as `rounds` begins with, and on until as many are good, but no more than
    /// it ends with. Each begins with another contender, and every other goes backwards, so that none always comes
    /// after the same one. `phase` measures the machine's present phase, `done` is told after each run.
    ///
    /// # Errors
    /// Whatever a contender fails with.
    pub fn measure<E>(
        contenders: &mut [Contender<'_, E>],
        rounds: RangeInclusive<usize>,
        phase: &mut dyn FnMut() -> Phase,
        done: &mut dyn FnMut(),
    ) -> Result<Self, E> {
        let (wanted, most) = rounds.into_inner();
        let labels = contenders.iter().map(|contender| contender.label.clone()).collect();
        let count = contenders.len();
        let mut phases = vec![phase()];
        let mut series = Self { labels, rounds: Vec::new(), usual_ping_pong: f64::INFINITY };
        while series.rounds.len() < most && series.rounds.len() - series.marked() < wanted {
            let round = series.rounds.len();
            let mut seconds = vec![0.0; count];
            for turn in 0..count {
                let turn = if round.is_multiple_of(2) { turn } else { count - turn };
                let index = (round + turn) % count;
                let contender = &mut contenders[index];
                seconds[index] = (contender.run)()?;
                if contender.spins {
                    thread::sleep(AFTER_SPINNING);
                }
                done();
            }
            let (before, after) = (phases[round], phase());
            series.rounds.push(Round { seconds, phase: before.worse(after) });
            phases.push(after);
            series.usual_ping_pong = Phase::usual_ping_pong(&phases);
        }
        Ok(series)
    }

    /// The contenders' labels.
    #[must_use]
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The rounds, in the order in which they were run.
    #[must_use]
    pub fn rounds(&self) -> &[Round] {
        &self.rounds
    }

    /// For each round, whether it fell into a bad phase.
    #[must_use]
    pub fn marks(&self) -> Vec<bool> {
        self.rounds.iter().map(|round| round.phase.is_bad(self.usual_ping_pong)).collect()
    }

    /// The number of rounds that fell into a bad phase.
    #[must_use]
    pub fn marked(&self) -> usize {
        self.marks().into_iter().filter(|&bad| bad).count()
    }

    /// The good rounds, or all if none is good.
    #[must_use]
    pub fn best_rounds(&self) -> Rounds {
        if self.marked() < self.rounds.len() { Rounds::Good } else { Rounds::All }
    }

    /// The quartiles of what `value` makes of each round's seconds; nothing if there are no such rounds.
    #[must_use]
    pub fn quartiles(&self, which: Rounds, value: impl Fn(&[f64]) -> f64) -> Option<Quartiles> {
        let rounds = self.rounds.iter().zip(self.marks());
        let chosen = rounds.filter(|(_, bad)| which == Rounds::All || !bad);
        Quartiles::of(chosen.map(|(round, _)| value(&round.seconds)))
    }

    /// The quartiles of a contender's seconds.
    #[must_use]
    pub fn seconds(&self, which: Rounds, contender: usize) -> Option<Quartiles> {
        self.quartiles(which, |seconds| seconds[contender])
    }

    /// The quartiles of the rounds' ratios of `slow`'s seconds to `fast`'s.
    #[must_use]
    pub fn ratio(&self, which: Rounds, slow: usize, fast: usize) -> Option<Quartiles> {
        self.quartiles(which, |seconds| seconds[slow] / seconds[fast])
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    const GOOD: Phase = Phase { gain: 2.0, ping_pong: 100.0 };

    fn contender<'a>(label: &'a str, order: &'a RefCell<String>) -> Contender<'a> {
        let mut runs = 0.0;
        Contender {
            label: label.to_owned(),
            spins: false,
            run: Box::new(move || {
                order.borrow_mut().push_str(label);
                runs += 1.0;
                Ok(if label == "a" { runs } else { 2.0 * runs })
            }),
        }
    }

    fn series(phases: &[Phase]) -> (Series, String) {
        rounds_in(4..=4, phases)
    }

    fn rounds_in(rounds: RangeInclusive<usize>, phases: &[Phase]) -> (Series, String) {
        let order = RefCell::default();
        let mut contenders = ["a", "b", "c"].map(|label| contender(label, &order));
        let mut phases = phases.iter().copied();
        let mut next = || phases.next().unwrap_or(GOOD);
        let series = Series::measure(&mut contenders, rounds, &mut next, &mut || ());
        drop(contenders);
        (series.expect("no contender fails"), order.into_inner())
    }

    #[test]
    fn the_order_rotates() {
        let (series, order) = series(&[]);
        assert_eq!(order, "abcbaccabacb");
        assert_eq!(series.rounds()[3].seconds, [4.0, 8.0, 8.0]);
        assert_eq!(series.marked(), 0);
        let seconds = series.seconds(Rounds::All, 0).expect("there are rounds");
        assert_eq!((seconds.lower, seconds.median, seconds.upper), (1.75, 2.5, 3.25));
        assert_eq!(series.ratio(Rounds::Good, 1, 0).map(|ratio| ratio.median), Some(2.0));
    }

    #[test]
    fn a_bad_calibrator_marks_rounds() {
        let lost_core = Phase { gain: 1.2, ..GOOD };
        // A bad phase counts towards the rounds on both of its sides.
        let (series, _) = series(&[GOOD, lost_core, GOOD, GOOD, GOOD]);
        assert_eq!(series.marks(), [true, true, false, false]);
        assert_eq!(series.rounds().len(), 4, "marked rounds are kept");
        assert_eq!(series.seconds(Rounds::Good, 0).map(|seconds| seconds.median), Some(3.5));
        assert_eq!(series.seconds(Rounds::All, 0).map(|seconds| seconds.median), Some(2.5));
    }

    #[test]
    fn slow_communication_marks_rounds() {
        let slow = Phase { ping_pong: 301.0, ..GOOD };
        let (series, _) = series(&[GOOD, GOOD, slow, slow, slow]);
        assert_eq!(series.marks(), [false, true, true, true]);
    }

    #[test]
    fn a_round_between_two_bad_phases_is_no_yardstick() {
        let slow = Phase { ping_pong: 301.0, ..GOOD };
        let (series, _) = series(&[GOOD, slow, GOOD, slow, GOOD]);
        assert_eq!(series.marks(), [true; 4], "the best phase is half of no round");
    }

    #[test]
    fn nothing_but_bad_rounds() {
        let (series, _) = series(&[Phase { gain: 1.0, ..GOOD }; 5]);
        assert_eq!(series.marked(), 4);
        assert_eq!(series.best_rounds(), Rounds::All);
        assert_eq!(series.seconds(Rounds::Good, 0), None);
    }

    #[test]
    fn on_until_enough_rounds_are_good() {
        let lost_core = Phase { gain: 1.2, ..GOOD };
        let phases = [GOOD, lost_core, lost_core, GOOD, GOOD, GOOD];
        let (series, _) = rounds_in(2..=9, &phases);
        assert_eq!(series.marks(), [true, true, true, false, false]);
        let (series, _) = rounds_in(2..=4, &phases);
        assert_eq!(series.marks(), [true, true, true, false], "no more than four");
    }

    #[test]
    fn no_good_round_is_waited_for_in_vain() {
        let on = |cores| Machine { threads: 2, cores: Some(cores), ..Machine::this() };
        assert_eq!(until_good(15, &on(2)), 15..=60);
        assert_eq!(until_good(15, &on(1)), 15..=15);
    }

    #[test]
    fn failures_are_passed_on() {
        let fail = || Err(ExperimentError::Quarantined { run: "a".to_owned(), objects: 1 });
        let mut contenders =
            [Contender { label: "a".to_owned(), spins: true, run: Box::new(fail) }];
        assert!(Series::measure(&mut contenders, 1..=1, &mut || GOOD, &mut || ()).is_err());
    }
}
