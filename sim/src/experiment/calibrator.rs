//! What the machine gives at the moment, measured beside each round.
//!
//! Other programs on a shared machine take time from some rounds and not from others. Two threads that
//! share nothing show lost cores, and two that are halves of one; a ping-pong between two threads shows slow
//! communication, which the first do not notice.

use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::statistics::Quartiles;
use super::work::{divide, seconds_of, steps_per_second};

/// Seconds of one repetition of the busy threads; usually 0.002, long against the time it takes to
/// start them together and short against a round.
const BUSY: f64 = 0.002;
/// Repetitions, alone and together.
const REPETITIONS: usize = 5;
/// Round trips whose mean is one value of the ping-pong; the median of such values counts.
const TRIPS: u32 = 50;
/// Values of the ping-pong, if time allows.
const BATCHES: usize = 20;
/// After so long no further batch of the ping-pong begins: on a single core each trip is a switch of threads.
const PATIENCE: Duration = Duration::from_millis(20);
/// Tells the partner of a ping-pong to stop.
const STOP: u32 = u32::MAX;

/// What two threads can do at the moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// How much more two independent busy threads get done than one; ideally 2.
    pub gain: f64,
    /// Nanoseconds for a word to go from one thread to another.
    pub ping_pong: f64,
}

impl Phase {
    /// The gain below which a round is marked.
    pub const LEAST_GAIN: f64 = 1.9;
    /// How many times the [usual](Self::usual_ping_pong) ping-pong a round's may be.
    pub const WORST_PING_PONG: f64 = 3.0;

    /// The worse of two, in both respects.
    #[must_use]
    pub fn worse(self, other: Self) -> Self {
        Self { gain: self.gain.min(other.gain), ping_pong: self.ping_pong.max(other.ping_pong) }
    }

    /// What a ping-pong usually takes, in nanoseconds: the lower quartile of those of phases that gain enough.
    /// The best of all would be that of two threads which the machine has put on one core: several times faster
    /// than between two cores, and with less gained, mostly seen in the phase itself.
    #[must_use]
    pub fn usual_ping_pong(phases: &[Self]) -> f64 {
        let gaining = phases.iter().filter(|phase| phase.gain >= Self::LEAST_GAIN);
        Quartiles::of(gaining.map(|phase| phase.ping_pong)).map_or(f64::INFINITY, |all| all.lower)
    }

    /// Whether a round in this phase is to be marked, if a ping-pong usually takes so many nanoseconds.
    #[must_use]
    pub fn is_bad(self, usual_ping_pong: f64) -> bool {
        self.gain < Self::LEAST_GAIN || self.ping_pong > Self::WORST_PING_PONG * usual_ping_pong
    }
}

/// Measures phases.
#[derive(Clone, Copy, Debug)]
pub struct Calibrator {
    steps: u64,
}

impl Default for Calibrator {
    /// A calibrator for this machine.
    fn default() -> Self {
        Self { steps: (steps_per_second(divide) * BUSY) as u64 }
    }
}

impl Calibrator {
    /// Measures the present phase, in about 30 ms; on a single core in some tenths of a second.
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase { gain: self.gain(), ping_pong: ping_pong() * 1e9 }
    }

    fn gain(&self) -> f64 {
        // The fastest: what one thread does when nothing disturbs it.
        let alone =
            (0..REPETITIONS).map(|_| seconds_of(divide, self.steps)).fold(f64::INFINITY, f64::min);
        let ready = AtomicUsize::new(0);
        let repeat = || -> Vec<[Instant; 2]> {
            let once = |repetition| {
                let came = Instant::now();
                // Relaxed: nothing is handed over.
                ready.fetch_add(1, Ordering::Relaxed);
                while ready.load(Ordering::Relaxed) < 2 * (repetition + 1) {
                    thread::yield_now();
                }
                divide(self.steps);
                [came, Instant::now()]
            };
            (0..REPETITIONS).map(once).collect()
        };
        let both = thread::scope(|scope| {
            let other = thread::Builder::new().spawn_scoped(scope, repeat).ok()?;
            let own = repeat();
            Some((own, other.join().ok()?))
        });
        // Without a second thread nothing is gained.
        let Some((own, other)) = both else { return 0.0 };
        // The mean, so that one repetition without a core shows.
        let took: f64 = own.iter().zip(&other).map(|(&own, &other)| together(own, other)).sum();
        2.0 * alone * REPETITIONS as f64 / took
    }
}

/// Seconds from when both had come to when both were done: not each one's own, for two that take turns on one
/// core are as fast by their own clocks as two on cores of their own.
fn together(one: [Instant; 2], other: [Instant; 2]) -> f64 {
    let [came, done] = [0, 1].map(|end| one[end].max(other[end]));
    done.duration_since(came).as_secs_f64()
}

/// Seconds for a word to go from one thread to another.
fn ping_pong() -> f64 {
    let ball = AtomicU32::new(0);
    thread::scope(|scope| {
        if thread::Builder::new().spawn_scoped(scope, || answer(&ball)).is_err() {
            return f64::INFINITY;
        }
        let began = Instant::now();
        let mut batches = Vec::with_capacity(BATCHES);
        let mut turn = 0;
        while batches.len() < BATCHES && (batches.is_empty() || began.elapsed() < PATIENCE) {
            let began = Instant::now();
            for _ in 0..TRIPS {
                // Relaxed: nothing but the ball itself is handed over.
                ball.store(turn + 1, Ordering::Relaxed);
                turn += 2;
                while ball.load(Ordering::Relaxed) != turn {
                    std::hint::spin_loop();
                }
            }
            batches.push(began.elapsed().as_secs_f64() / f64::from(2 * TRIPS));
        }
        ball.store(STOP, Ordering::Relaxed);
        Quartiles::of(batches).map_or(f64::INFINITY, |times| times.median)
    })
}

/// Returns every odd ball as the next even one.
fn answer(ball: &AtomicU32) {
    loop {
        // Relaxed: as above.
        match ball.load(Ordering::Relaxed) {
            STOP => return,
            odd if odd % 2 == 1 => ball.store(odd + 1, Ordering::Relaxed),
            _ => std::hint::spin_loop(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_is_measured() {
        let phase = Calibrator::default().phase();
        assert!(phase.gain > 0.0 && phase.gain.is_finite(), "{phase:?}");
        assert!(phase.ping_pong > 0.0 && phase.ping_pong.is_finite(), "{phase:?}");
    }

    #[test]
    fn taking_turns_is_not_working_together() {
        let at = |began: Instant| move |millis| began + Duration::from_millis(millis);
        let at = at(Instant::now());
        let spans = |spans: [[u64; 2]; 2]| together(spans[0].map(at), spans[1].map(at));
        assert_eq!(spans([[0, 3], [1, 3]]), 0.002, "on two cores, when the second one came");
        assert_eq!(spans([[0, 3], [1, 5]]), 0.004, "on one core, one after the other");
    }

    #[test]
    fn two_threads_on_one_core_are_no_yardstick() {
        let apart = [55.0, 56.0, 57.0, 58.0, 60.0].map(|ping_pong| Phase { gain: 1.95, ping_pong });
        let together = [1.8, 1.3, 0.9].map(|gain| Phase { gain, ping_pong: 15.0 });
        // Put there between the one measurement and the other.
        let unnoticed = [Phase { gain: 1.95, ping_pong: 15.0 }];
        let usual = Phase::usual_ping_pong(&[&apart[..], &together, &unnoticed].concat());
        assert!((55.0..58.0).contains(&usual), "{usual} ns");
        assert_eq!(Phase::usual_ping_pong(&together), f64::INFINITY);
    }

    #[test]
    fn bad_phases() {
        let good = Phase { gain: 1.95, ping_pong: 100.0 };
        assert!(!good.is_bad(100.0));
        assert!(Phase { gain: 1.89, ..good }.is_bad(100.0));
        assert!(Phase { ping_pong: 301.0, ..good }.is_bad(100.0));
        let worse = good.worse(Phase { gain: 1.5, ping_pong: 50.0 });
        assert_eq!(worse, Phase { gain: 1.5, ping_pong: 100.0 });
    }
}
