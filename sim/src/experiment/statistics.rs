//! Medians and quartiles.

/// The quartiles of some values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quartiles {
    /// A quarter of the values are below.
    pub lower: f64,
    /// Half of the values are below.
    pub median: f64,
    /// A quarter of the values are above.
    pub upper: f64,
}

impl Quartiles {
    /// Of values in any order, by linear interpolation between the nearest two (type 7 of Hyndman and
    /// Fan 1996); nothing of no values.
    #[must_use]
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = |share: f64| {
            let place = share * last as f64;
            let below = place as usize;
            let above = (below + 1).min(last);
            sorted[below] + (sorted[above] - sorted[below]) * place.fract()
        };
        Some(Self { lower: at(0.25), median: at(0.5), upper: at(0.75) })
    }
}

/// The variance of some values, that of a whole population; 0 of no values.
#[must_use]
pub fn variance(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count
}

/// A value with so many decimals that it is not above the given one: what "at least" may be said of.
pub(super) fn rounded_down(value: f64, decimals: i32) -> f64 {
    let scale = 10.0_f64.powi(decimals);
    (value * scale).floor() / scale
}

/// A value with so many decimals that it is not below the given one: what "at most" may be said of.
pub(super) fn rounded_up(value: f64, decimals: i32) -> f64 {
    -rounded_down(-value, decimals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_stay_bounds() {
        assert_eq!(
            [0.8896, 0.889, -0.8896].map(|value| rounded_down(value, 3)),
            [0.889, 0.889, -0.89]
        );
        assert_eq!([0.141, 0.1, -0.141].map(|value| rounded_up(value, 1)), [0.2, 0.1, -0.1]);
    }

    #[test]
    fn quartiles() {
        assert_eq!(Quartiles::of([]), None);
        let one = Quartiles { lower: 3.0, median: 3.0, upper: 3.0 };
        assert_eq!(Quartiles::of([3.0]), Some(one));
        let odd = Quartiles { lower: 2.0, median: 3.0, upper: 4.0 };
        assert_eq!(Quartiles::of([5.0, 1.0, 4.0, 2.0, 3.0]), Some(odd));
        let even = Quartiles { lower: 1.75, median: 2.5, upper: 3.25 };
        assert_eq!(Quartiles::of([4.0, 1.0, 3.0, 2.0]), Some(even));
    }

    #[test]
    fn variances() {
        assert_eq!(variance(&[]), 0.0);
        assert_eq!(variance(&[2.0, 2.0]), 0.0);
        assert_eq!(variance(&[1.0, 3.0]), 1.0);
    }
}
