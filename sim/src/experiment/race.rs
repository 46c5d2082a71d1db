//! Runs of one environment, timed against each other.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::ops::RangeInclusive;
use std::panic::resume_unwind;
use std::thread;
use std::time::{Duration, Instant};

use super::calibrator::Phase;
use super::error::ExperimentError;
use super::load::RenderLoad;
use super::outcome::Outcome;
use super::subject::Subject;
use super::timing::{Contender, Series};
use crate::blocking::FRAMES_PER_BLOCKING;
use crate::executor::{ExecutorError, ExecutorKind, FrameRecord};
use crate::manager::VeManager;

/// Frames before the clock starts; usually 64: then caches are warm, and blocks are formed anew, for the first time
/// with what updates take known to who goes by it.
pub const WARM_UP: u64 = FRAMES_PER_BLOCKING;

/// An executor that takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Runner {
    /// What drives the stages.
    pub executor: ExecutorKind,
    /// Threads, the calling one included; besides the calling one for rayon's executors.
    pub threads: usize,
}

impl Runner {
    /// The serial executor.
    pub const SERIAL: Self = Self { executor: ExecutorKind::Serial, threads: 1 };

    /// The pipeline with so many threads.
    #[must_use]
    pub fn pipeline(threads: usize) -> Self {
        Self { executor: ExecutorKind::Pipeline, threads }
    }

    /// Every executor but the serial one, with so many threads; the pipeline comes first.
    pub fn parallel(threads: usize) -> impl Iterator<Item = Self> {
        let all = ExecutorKind::ALL.iter();
        let parallel = all.filter(|&&executor| executor != ExecutorKind::Serial);
        parallel.map(move |&executor| Self { executor, threads })
    }

    /// What it is called: the executor and its threads.
    #[must_use]
    pub fn label(self) -> String {
        format!("{} × {}", self.executor.name(), self.threads)
    }

    /// Whether its threads may go on spinning after a run. The pipeline's have ended by then.
    #[must_use]
    pub fn spins(self) -> bool {
        !matches!(self.executor, ExecutorKind::Serial | ExecutorKind::Pipeline)
    }
}

/// What is run, and for how long.
#[derive(Clone, Debug)]
pub struct Race {
    /// The environment, and what is done in it.
    pub subject: Subject,
    /// What rendering costs.
    pub load: RenderLoad,
    /// Frames before the clock starts; usually [`WARM_UP`].
    pub warm_up: u64,
    /// Frames that are timed.
    pub frames: u64,
    /// How many rounds are run: at least so many, and on until as many are good, but no more than it ends with.
    pub rounds: RangeInclusive<usize>,
}

impl fmt::Display for Race {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { subject, load, frames, .. } = self;
        write!(f, "{subject}, render {}, {frames} frames", load.name())
    }
}

/// What a race tells while it goes on.
pub(super) type OnFrame<'a> = dyn FnMut(usize, &FrameRecord, Duration) + Send + 'a;

impl Race {
    /// Which frames are timed, the first of all being 1, and what of them hands do not move in; in words.
    pub(super) fn timed(&self) -> String {
        let (script, first) = (self.subject.script_frames(), self.warm_up + 1);
        let last = self.warm_up + self.frames;
        match script {
            0 => format!("Frames {first} to {last}"),
            _ if last <= script => {
                format!("Frames {first} to {last} of the {script} in which the hands move")
            }
            _ => format!("Frames {first} to {last}; the hands move up to frame {script}"),
        }
    }

    /// Times the runners against each other, and the serial one without rendering, too, where it renders: then it is known
    /// what share that is in the same rounds. `phase` measures the machine's present phase, `done` is told after each
    /// run.
    ///
    /// # Errors
    /// The environment cannot be built or run, an object was quarantined, or the runs did not all end
    /// in the same state.
    pub fn run(
        &self,
        runners: &[Runner],
        phase: &mut dyn FnMut() -> Phase,
        done: &mut dyn FnMut(),
    ) -> Result<Outcome, ExperimentError> {
        self.observed(runners, phase, done, &mut |_, _, _| ())
    }

    /// As [`Race::run`]; `on_frame` is told of each timed frame the runner, the frame and its time
    /// from swap to swap.
    pub(super) fn observed(
        &self,
        runners: &[Runner],
        phase: &mut dyn FnMut() -> Phase,
        done: &mut dyn FnMut(),
        on_frame: &mut OnFrame<'_>,
    ) -> Result<Outcome, ExperimentError> {
        let expected = Cell::new(None);
        let on_frame = RefCell::new(on_frame);
        let bare = Self { load: RenderLoad::Null, ..self.clone() };
        let contender = |(index, &runner): (usize, &Runner)| {
            let (expected, on_frame) = (&expected, &on_frame);
            let run = move || {
                let on_frame = &mut **on_frame.borrow_mut();
                self.once(runner, expected, &mut |record, took| on_frame(index, record, took))
            };
            Contender { label: runner.label(), spins: runner.spins(), run: Box::new(run) }
        };
        let mut contenders: Vec<Contender<'_>> =
            runners.iter().enumerate().map(contender).collect();
        let renders = self.load != RenderLoad::Null && runners.contains(&Runner::SERIAL);
        let without_rendering = renders.then_some(contenders.len());
        if renders {
            let run = || bare.once(Runner::SERIAL, &expected, &mut |_, _| ());
            let label = "serial, not rendering".to_owned();
            contenders.push(Contender { label, spins: false, run: Box::new(run) });
        }
        let series = Series::measure(&mut contenders, self.rounds.clone(), phase, done)?;
        drop(contenders);
        Ok(Outcome { race: self.clone(), runners: runners.to_vec(), series, without_rendering })
    }

    /// Seconds of one run.
    ///
    /// # Errors
    /// The environment cannot be built or run, or an object was quarantined.
    pub fn seconds(&self, runner: Runner) -> Result<f64, ExperimentError> {
        self.once(runner, &Cell::new(None), &mut |_, _| ())
    }

    /// How much more so many threads get done than one if each runs the serial executor on an
    /// environment of its own, without anything in common: what this machine would give an executor that
    /// costs nothing.
    ///
    /// # Errors
    /// As [`Race::seconds`].
    pub fn independent_gain(&self, threads: usize) -> Result<f64, ExperimentError> {
        let alone = self.seconds(Runner::SERIAL)?;
        let together = thread::scope(|scope| {
            let run = || {
                let thread = thread::Builder::new();
                let run = thread.spawn_scoped(scope, || self.seconds(Runner::SERIAL));
                run.map_err(ExecutorError::Spawn)
            };
            let runs: Vec<_> = (0..threads).map(|_| run()).collect::<Result<_, _>>()?;
            let join = |run: thread::ScopedJoinHandle<'_, _>| {
                run.join().unwrap_or_else(|panic| resume_unwind(panic))
            };
            runs.into_iter().map(join).sum::<Result<f64, ExperimentError>>()
        })?;
        Ok(threads as f64 * threads as f64 * alone / together)
    }

    /// Seconds of one run, which must end in the expected state, if one is known.
    fn once(
        &self,
        runner: Runner,
        expected: &Cell<Option<u64>>,
        on_frame: &mut (dyn FnMut(&FrameRecord, Duration) + Send),
    ) -> Result<f64, ExperimentError> {
        let mut session = self.subject.start(runner)?;
        let mut renderer = self.load.renderer();
        session.run(self.warm_up, &mut *renderer, &mut |_| ())?;
        let began = Instant::now();
        let mut last = began;
        session.run(self.frames, &mut *renderer, &mut |record| {
            on_frame(record, record.swapped - last);
            last = record.swapped;
        })?;
        let seconds = began.elapsed().as_secs_f64();
        check(&session.manager, runner, expected)?;
        Ok(seconds)
    }
}

/// Whether a run did the same as those before.
fn check(
    manager: &VeManager,
    runner: Runner,
    expected: &Cell<Option<u64>>,
) -> Result<(), ExperimentError> {
    let run = || runner.label();
    let objects = manager.quarantined().len();
    if objects > 0 {
        return Err(ExperimentError::Quarantined { run: run(), objects });
    }
    let hash = manager.state_hash();
    match expected.replace(Some(hash)) {
        Some(expected) if expected != hash => {
            Err(ExperimentError::Differs { run: run(), hash, expected })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::load::StandIn;
    use crate::experiment::timing::Rounds;
    use crate::scene::ParticleScene;

    const GOOD: Phase = Phase { gain: 2.0, ping_pong: 100.0 };

    #[test]
    fn every_runner_runs_every_round() {
        let subject = Subject::Particles(ParticleScene::new(4));
        let race = Race { subject, load: RenderLoad::Null, warm_up: 2, frames: 3, rounds: 2..=2 };
        let runners: Vec<Runner> =
            std::iter::once(Runner::SERIAL).chain(Runner::parallel(2)).collect();
        let mut runs = 0;
        let mut frames = vec![Vec::new(); runners.len()];
        let mut on_frame =
            |runner: usize, record: &FrameRecord, _| frames[runner].push(record.frame);
        let outcome = race
            .observed(&runners, &mut || GOOD, &mut || runs += 1, &mut on_frame)
            .expect("a valid race");
        assert_eq!(runs, 2 * ExecutorKind::ALL.len());
        assert_eq!(outcome.series.labels()[..2], ["serial × 1", "pipeline × 2"]);
        assert!(frames.iter().all(|frames| *frames == [2, 3, 4, 2, 3, 4]), "{frames:?}");
    }

    #[test]
    fn what_rendering_takes_is_timed_beside_it() {
        let subject = Subject::Particles(ParticleScene::new(4));
        let load = RenderLoad::StandIn(StandIn::of(1));
        let race = Race { subject, load, warm_up: 0, frames: 1, rounds: 1..=1 };
        let run =
            |runners: &[Runner]| race.run(runners, &mut || GOOD, &mut || ()).expect("it runs");
        let outcome = run(&[Runner::SERIAL, Runner::pipeline(1)]);
        assert_eq!(outcome.without_rendering, Some(2));
        assert_eq!(outcome.series.labels()[2], "serial, not rendering");
        assert!(outcome.render_share(Rounds::All).is_some());
        let outcome = run(&[Runner::pipeline(1)]);
        assert_eq!((outcome.without_rendering, outcome.series.labels().len()), (None, 1));
    }

    #[test]
    fn another_state_is_an_error() {
        let subject = Subject::Particles(ParticleScene::new(2));
        let race = Race { subject, load: RenderLoad::Null, warm_up: 0, frames: 1, rounds: 1..=1 };
        let other = Cell::new(Some(0));
        let error = race.once(Runner::SERIAL, &other, &mut |_, _| ()).err();
        assert!(matches!(error, Some(ExperimentError::Differs { expected: 0, .. })), "{error:?}");
    }
}
