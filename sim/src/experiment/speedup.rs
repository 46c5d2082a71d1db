//! Equations 2 and 4 of the paper (§7.2). All times are in seconds. Equation 3, S_s = T_s / T_p, the speed-up over
//! a serial implementation, is the ratio of two contenders of a [`Series`](super::timing::Series).

/// Equation 2, S_p = T_1 / T_p: the speed-up over one thread.
#[must_use]
pub fn speed_up(one_thread: f64, threads: f64) -> f64 {
    one_thread / threads
}

/// Equation 4, E_p = S_p / p: the efficiency of p threads.
#[must_use]
pub fn efficiency(speed_up: f64, threads: usize) -> f64 {
    speed_up / threads as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations() {
        assert_eq!(speed_up(6.0, 1.5), 4.0);
        assert_eq!(efficiency(4.5, 6), 0.75);
    }
}
