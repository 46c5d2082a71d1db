//! Work of a known amount, which touches no memory.

use std::hint::black_box;
use std::time::Instant;

/// Takes so many steps, each of which needs the one before (xorshift, Marsaglia 2003).
pub(super) fn spin(steps: u64) {
    let mut state = black_box(0x9e37_79b9_7f4a_7c15_u64);
    for _ in 0..steps {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
    }
    black_box(state);
}

/// Steps of [`spin`] that one thread takes in a second.
pub(super) fn steps_per_second() -> f64 {
    const STEPS: u64 = 1_000_000;
    let best = (0..5).map(|_| seconds_of(STEPS)).fold(f64::INFINITY, f64::min);
    STEPS as f64 / best
}

/// Seconds that so many steps take now.
pub(super) fn seconds_of(steps: u64) -> f64 {
    let began = Instant::now();
    spin(steps);
    began.elapsed().as_secs_f64()
}
