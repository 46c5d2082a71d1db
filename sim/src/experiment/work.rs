//! Work of a known amount, which touches no memory.

use std::hint::black_box;
use std::time::Instant;

/// What [`spin`] may begin with: any number but 0, for which every step would be the same.
pub(super) const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// Takes so many steps from a state to the one that it returns, each of which needs the one before (xorshift, Marsaglia
/// 2003). So does the first one of a further call with that state; a core begins what needs nothing of it meanwhile.
pub(super) fn spin(steps: u64, mut state: u64) -> u64 {
    for _ in 0..steps {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
    }
    black_box(state)
}

/// Numbers that [`divide`] works on, enough of them that none waits for the one before.
const NUMBERS: usize = 32;

/// Takes so many steps that keep the units for division and square roots busy, as the kernels do. Two threads that the
/// machine has put on one core get hardly more of it done than one; of [`spin`], whose steps wait for each other,
/// they would get twice as much done even there.
pub(super) fn divide(steps: u64) {
    let mut numbers = black_box([1.0_f32; NUMBERS]);
    for _ in 0..steps {
        for number in &mut numbers {
            *number = 2.0 / (1.0 + *number).sqrt();
        }
    }
    black_box(numbers);
}

/// Steps of such work that one thread takes in a second.
pub(super) fn steps_per_second(work: fn(u64)) -> f64 {
    const STEPS: u64 = 300_000;
    let best = (0..5).map(|_| seconds_of(work, STEPS)).fold(f64::INFINITY, f64::min);
    STEPS as f64 / best
}

/// Seconds that so many steps of it take now.
pub(super) fn seconds_of(work: fn(u64), steps: u64) -> f64 {
    let began = Instant::now();
    work(steps);
    began.elapsed().as_secs_f64()
}
