//! Statistics of repeated measurements.

/// The median; the mean of the two middle values where their number is even. `None` of nothing.
/// NaN sorts above all numbers.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}

/// A median, and an interval that holds the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The median of what was measured.
    pub median: f64,
    /// The interval's ends, which are two of the values measured; both the median of one value.
    pub interval: (f64, f64),
    /// The probability that such an interval holds the true median, whatever the distribution.
    pub confidence: f64,
    /// How many values.
    pub count: usize,
}

/// The confidence that [`estimate`] is after.
pub const CONFIDENCE: f64 = 0.95;

/// The median, and the narrowest interval between two of the values, as many from the one end as
/// from the other, that holds the median of the distribution with a confidence of at least
/// [`CONFIDENCE`]; where there are too few values for that (fewer than six), the interval of all of
/// them, which holds it with the confidence that is given. `None` of nothing.
///
/// Exact for independent values of any continuous distribution: the number of values below its
/// median is binomial with probability ½.
pub fn estimate(values: impl IntoIterator<Item = f64>) -> Option<Estimate> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    // The chance that the median lies below the value at place `from`, from 0: at most `from` of
    // the values lie below the median.
    let mut chance = 0.5_f64.powi(i32::try_from(n).unwrap_or(i32::MAX));
    let mut below = chance;
    let mut from = 0;
    let mut confidence = 1.0 - 2.0 * below;
    while 2 * (from + 1) < n {
        chance *= (n - from) as f64 / (from + 1) as f64;
        below += chance;
        if 1.0 - 2.0 * below < CONFIDENCE {
            break;
        }
        from += 1;
        confidence = 1.0 - 2.0 * below;
    }
    Some(Estimate {
        median: median(values.iter().copied())?,
        interval: (values[from], values[n - 1 - from]),
        confidence: confidence.max(0.0),
        count: n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_lies_in_the_middle_whatever_the_order() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0, 100.0, 2.0]), Some(3.0));
        assert_eq!(median([5.0]), Some(5.0));
        assert_eq!(median([]), None);
    }

    #[test]
    fn the_interval_of_the_median_is_that_of_the_tables() {
        // Ranks of the 95 % interval and their confidence, as tables of the sign test have them.
        for (n, low, high, confidence) in [
            (1, 1, 1, 0.0),
            (2, 1, 2, 0.5),
            (5, 1, 5, 0.9375),
            (6, 1, 6, 0.96875),
            (7, 1, 7, 0.984_375),
            (9, 2, 8, 0.9609),
            (15, 4, 12, 0.9648),
            (20, 6, 15, 0.9586),
            (25, 8, 18, 0.9567),
        ] {
            let found = estimate((1..=n).rev().map(f64::from)).unwrap();
            assert_eq!(found.interval, (f64::from(low), f64::from(high)), "{n}");
            assert!(
                (found.confidence - confidence).abs() < 1e-4,
                "{n}: {found:?}"
            );
            assert_eq!(found.median, f64::from(n + 1) / 2.0);
        }
        assert_eq!(estimate([]), None);
    }

    #[test]
    fn the_interval_holds_the_median_as_often_as_it_says() {
        // Skewed values: the square of uniform ones, whose median is a quarter.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        };
        let rounds = 20_000;
        for n in [3, 7, 12] {
            let mut held = 0;
            let mut confidence = 0.0;
            for _ in 0..rounds {
                let found = estimate((0..n).map(|_| uniform().powi(2))).unwrap();
                confidence = found.confidence;
                held += u32::from(found.interval.0 <= 0.25 && 0.25 <= found.interval.1);
            }
            let share = f64::from(held) / f64::from(rounds);
            assert!(
                (share - confidence).abs() < 0.01,
                "{n}: {share} for {confidence}"
            );
        }
    }
}
