//! What stands in for a graphics device while executors are compared.

use std::ops::RangeInclusive;

use super::calibrator::Phase;
use super::error::ExperimentError;
use super::race::{Race, Runner, WARM_UP};
use super::subject::Subject;
use super::timing::Rounds;
use super::work::{SEED, spin, steps_per_second};
use crate::object::Object;
use crate::render::{NullRenderer, Renderer};

/// The share of a serial frame's work that the stand-in is to make of rendering; usually 0.15. What it came to is
/// [`Outcome::render_share`](super::outcome::Outcome::render_share).
pub const RENDER_SHARE: f64 = 0.15;
/// Runs from which the share is calibrated.
const RUNS: usize = 5;

/// What rendering costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderLoad {
    /// [`NullRenderer`]: next to nothing.
    Null,
    /// [`StandIn`].
    StandIn(StandIn),
}

impl RenderLoad {
    /// What it is called in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::StandIn(_) => "stand-in",
        }
    }

    /// The renderer of a run.
    #[must_use]
    pub fn renderer(self) -> Box<dyn Renderer> {
        match self {
            Self::Null => Box::new(NullRenderer::new()),
            Self::StandIn(stand_in) => Box::new(stand_in),
        }
    }
}

/// A renderer that works for an equal while on each object and has nothing to show for it. The work is
/// a number of steps, so that a draw reads no clock, each of which needs the one before: a core would else do those of
/// some objects at once, in half the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StandIn {
    /// In each draw.
    steps: u64,
    /// Where the last draw's steps have led.
    state: u64,
}

impl StandIn {
    /// A stand-in that makes rendering [`RENDER_SHARE`] of a subject's serial frame, in the first `frames`, one at least,
    /// after [`WARM_UP`]: later ones may take longer or shorter. It is corrected once, by what it comes to in a race of so
    /// many rounds; `phase` measures the machine's present phase, `done` is told after each run.
    ///
    /// # Errors
    /// The environment cannot be built or run.
    pub fn calibrated(
        subject: &Subject,
        frames: u64,
        rounds: RangeInclusive<usize>,
        phase: &mut dyn FnMut() -> Phase,
        done: &mut dyn FnMut(),
    ) -> Result<Self, ExperimentError> {
        let frames = frames.max(1);
        let race = |steps| {
            let (subject, load) = (subject.clone(), RenderLoad::StandIn(Self::of(steps)));
            Race { subject, load, warm_up: WARM_UP, frames, rounds: rounds.clone() }
        };
        let mut frame_steps = f64::INFINITY;
        let steps_per_second = || steps_per_second(|steps| _ = spin(steps, SEED));
        let mut before = steps_per_second();
        for _ in 0..RUNS {
            let seconds = race(0).seconds(Runner::SERIAL)? / frames as f64;
            let after = steps_per_second();
            // The speed beside the run, for a machine that is slow for a while is slow in both; the higher of two, and
            // the fewest steps, for what disturbs spinning or a run alone slows it.
            frame_steps = frame_steps.min(seconds * before.max(after));
            before = after;
            done();
        }
        let steps = steps_of_a_draw(frame_steps, subject.objects());
        // Some of them are done beside what comes before or after, and the fewest are few.
        let outcome = race(steps).run(&[Runner::SERIAL], phase, done)?;
        let came_to = outcome.render_share(Rounds::Good).unwrap_or(f64::NAN);
        Ok(Self::of(corrected(steps, came_to)))
    }

    /// Runs that calibrating one in so many rounds takes: in each the serial version runs with and without it.
    pub(super) fn runs_to_calibrate(rounds: usize) -> usize {
        RUNS + 2 * rounds
    }

    /// One that takes so many steps in each draw.
    pub(super) fn of(steps: u64) -> Self {
        Self { steps, state: SEED }
    }
}

impl Renderer for StandIn {
    fn draw(&mut self, _: &Object) {
        self.state = spin(self.steps, self.state);
    }

    fn swap(&mut self, _: u64) {}
}

/// The steps that rendering takes for each of so many objects where the rest of a frame takes as long as `frame_steps`.
fn steps_of_a_draw(frame_steps: f64, objects: usize) -> u64 {
    (frame_steps * RENDER_SHARE / (1.0 - RENDER_SHARE) / objects as f64) as u64
}

/// Steps that make [`RENDER_SHARE`] where so many came to another share: half as many at least and twice as many at most,
/// for what asks for more has been disturbed, and as many where the share is not between none and all.
fn corrected(steps: u64, came_to: f64) -> u64 {
    if !(came_to > 0.0 && came_to < 1.0) {
        return steps;
    }
    let odds = |share: f64| share / (1.0 - share);
    let factor = odds(RENDER_SHARE) / odds(came_to);
    (steps as f64 * factor.clamp(0.5, 2.0)).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ParticleScene;

    #[test]
    fn a_calibrated_stand_in_works() {
        let subject = Subject::Particles(ParticleScene::new(5));
        let (mut phase, mut runs) = (|| Phase { gain: 2.0, ping_pong: 100.0 }, 0);
        let stand_in = StandIn::calibrated(&subject, 5, 1..=1, &mut phase, &mut || runs += 1);
        assert!(stand_in.expect("a valid scene").steps > 0);
        assert_eq!(runs, StandIn::runs_to_calibrate(1));
    }

    /// Else a core begins the next draw before it is done with this one, and rendering takes less than it is to take.
    #[test]
    fn a_draw_goes_on_from_the_one_before() {
        let scene = ParticleScene::new(2).build().expect("a valid scene");
        let mut stand_in = StandIn::of(3);
        scene.objects.iter().take(2).for_each(|object| stand_in.draw(object));
        assert_eq!(stand_in.state, spin(6, SEED));
    }

    #[test]
    fn a_share_is_corrected_as_far_as_it_can_be_true() {
        let share = |steps: u64| steps as f64 / (steps as f64 + 5_600.0);
        let steps = corrected(900, share(900));
        assert!((share(steps) - RENDER_SHARE).abs() < 1e-4, "{steps}");
        let disturbed = [-0.1, 0.0, 0.001, 0.9, 1.0, f64::NAN];
        assert_eq!(disturbed.map(|share| corrected(100, share)), [100, 100, 200, 50, 100, 100]);
    }

    #[test]
    fn a_stand_in_has_its_share_of_all_steps() {
        for objects in [1, 30, 1_000] {
            let (frame, drawing) = (1e9, (objects as u64 * steps_of_a_draw(1e9, objects)) as f64);
            let share = drawing / (frame + drawing);
            assert!((share - RENDER_SHARE).abs() < 1e-5, "{share} with {objects} objects");
        }
    }
}
