//! Statistics of many flights: the pass rate's interval, quantiles, rank correlations.

use statrs::distribution::{Beta, ChiSquared, ContinuousCDF, StudentsT};

/// Interval of the probability to pass, from `passed` of `flights`. It holds the true one with at least the
/// probability `confidence` (Clopper and Pearson, Biometrika 26(4), 1934).
///
/// ```
/// use campaign::statistics::clopper_pearson;
/// // No failure in 100 flights: the upper limit is 1, the lower one the 100th root of 2.5 %.
/// let [low, high] = clopper_pearson(100, 100, 0.95);
/// assert!((low - 0.025_f64.powf(0.01)).abs() < 1e-9 && high == 1.0);
/// ```
#[must_use]
pub fn clopper_pearson(passed: u64, flights: u64, confidence: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - confidence);
    let (hits, misses) = (passed as f64, (flights - passed) as f64);
    let quantile = |a: f64, b: f64, at: f64| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(at));
    let low = if passed == 0 { 0.0 } else { quantile(hits, misses + 1.0, tail) };
    let high = if passed == flights { 1.0 } else { quantile(hits + 1.0, misses, 1.0 - tail) };
    [low, high]
}

/// Lower limit of a probability of which `passed` of `flights` are known, one-sided.
#[must_use]
pub fn lower_limit(passed: u64, flights: u64, confidence: f64) -> f64 {
    clopper_pearson(passed, flights, 2.0 * confidence - 1.0)[0]
}

/// Quantiles of `values` at each of `at`, interpolated between neighbours; empty without values.
///
/// ```
/// assert_eq!(campaign::statistics::quantiles(&[3.0, 1.0, 2.0], &[0.0, 0.5, 0.75]), [1.0, 2.0, 2.5]);
/// ```
#[must_use]
pub fn quantiles(values: &[f64], at: &[f64]) -> Vec<f64> {
    if values.is_empty() {
        return Vec::new();
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = (sorted.len() - 1) as f64;
    let one = |at: &f64| {
        let place = at * last;
        let (below, above) = (place.floor() as usize, place.ceil() as usize);
        sorted[below] + (place - place.floor()) * (sorted[above] - sorted[below])
    };
    at.iter().map(one).collect()
}

/// Spearman's rank correlation of pairs, and the chance of one as large without any relation (Student's t); `None` for
/// fewer than four pairs or a constant.
///
/// ```
/// let pairs: Vec<(f64, f64)> = (0..20).map(|k| (f64::from(k), f64::from(k * k))).collect();
/// let (rank, chance) = campaign::statistics::rank_correlation(&pairs).unwrap();
/// assert!((rank - 1.0).abs() < 1e-12 && chance < 1e-9);
/// ```
#[must_use]
pub fn rank_correlation(pairs: &[(f64, f64)]) -> Option<(f64, f64)> {
    if pairs.len() < 4 {
        return None;
    }
    let x = ranks(&pairs.iter().map(|pair| pair.0).collect::<Vec<_>>());
    let y = ranks(&pairs.iter().map(|pair| pair.1).collect::<Vec<_>>());
    let rank = correlation(&x, &y)?;
    let freedom = (pairs.len() - 2) as f64;
    let t = rank * (freedom / (1.0 - rank * rank).max(f64::EPSILON)).sqrt();
    let chance = StudentsT::new(0.0, 1.0, freedom).ok()?.sf(t.abs()) * 2.0;
    Some((rank, chance))
}

/// Chance of pass rates as different as those of `groups` if there is no relation (chi-square test of
/// independence). Each group has its number of flights and the number of those that passed. `None` for fewer
/// than two groups, and where a group is expected to have less than one flight that passes or fails: the
/// distribution is another one there.
///
/// ```
/// use campaign::statistics::independence;
/// // Two degrees of freedom: the chance of 10 is exp(-5).
/// let chance = independence(&[(20, 5), (20, 10), (20, 15)]).unwrap();
/// assert!((chance - 0.006_737_946_999).abs() < 1e-9);
/// assert_eq!(independence(&[(20, 20), (20, 20)]), None);
/// ```
#[must_use]
pub fn independence(groups: &[(u64, u64)]) -> Option<f64> {
    let flights: u64 = groups.iter().map(|group| group.0).sum();
    let passed: u64 = groups.iter().map(|group| group.1).sum();
    let rate = passed as f64 / flights.max(1) as f64;
    let is_thin = |group: &(u64, u64)| group.0 as f64 * rate.min(1.0 - rate) < 1.0;
    if groups.len() < 2 || groups.iter().any(is_thin) {
        return None;
    }
    let excess = |group: &(u64, u64)| {
        let surplus = group.1 as f64 - rate * group.0 as f64;
        surplus * surplus / (rate * (1.0 - rate) * group.0 as f64)
    };
    let sum: f64 = groups.iter().map(excess).sum();
    Some(ChiSquared::new((groups.len() - 1) as f64).ok()?.sf(sum))
}

/// Ranks from 1; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut below = 0;
    for equal in order.chunk_by(|a, b| values[*a].total_cmp(&values[*b]).is_eq()) {
        let mean = below as f64 + 0.5 * (equal.len() as f64 + 1.0);
        equal.iter().for_each(|index| ranks[*index] = mean);
        below += equal.len();
    }
    ranks
}

fn correlation(x: &[f64], y: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_x, mean_y) = (mean(x), mean(y));
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| of(x - mean_x, y - mean_y)).sum()
    };
    let (xx, yy, xy) = (sum(&|x, _| x * x), sum(&|_, y| y * y), sum(&|x, y| x * y));
    (xx > 0.0 && yy > 0.0).then(|| xy / (xx * yy).sqrt())
}

#[cfg(test)]
mod tests {
    use super::{clopper_pearson, independence, lower_limit, rank_correlation, ranks};

    #[test]
    fn the_interval_is_that_of_scipy() {
        // scipy.stats.binomtest(k, n).proportion_ci(0.95, method="exact"), SciPy 1.17.
        for (passed, flights, expected) in [
            (0, 10, [0.0, 0.308_497_107_8]),
            (5, 10, [0.187_086_028_4, 0.812_913_971_6]),
            (995, 1000, [0.988_370_529_4, 0.998_374_580_5]),
        ] {
            let found = clopper_pearson(passed, flights, 0.95);
            assert!(
                found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9),
                "{passed}/{flights}: {found:?}"
            );
        }
        // One-sided: 0.05^(1/300) for 300 of 300.
        assert!((lower_limit(300, 300, 0.95) - libm::pow(0.05, 1.0 / 300.0)).abs() < 1e-9);
    }

    #[test]
    fn pass_rates_that_differ_on_both_sides_are_not_chance() {
        // Four degrees of freedom: the chance of 100 is (1 + 50) exp(-50).
        let chance = independence(&[(20, 0), (20, 20), (20, 20), (20, 20), (20, 0)]).unwrap();
        assert!((chance / (51.0 * libm::exp(-50.0)) - 1.0).abs() < 1e-3, "{chance}");
        assert!(independence(&[(20, 12), (20, 11), (20, 13)]).unwrap() > 0.5);
        let too_few: [&[(u64, u64)]; 4] =
            [&[], &[(20, 10)], &[(20, 0), (20, 0)], &[(2, 1), (1, 0), (20, 10)]];
        for groups in too_few {
            assert_eq!(independence(groups), None, "{groups:?}");
        }
    }

    #[test]
    fn equal_values_share_a_rank_and_a_constant_has_no_correlation() {
        assert_eq!(ranks(&[2.0, 1.0, 2.0, 5.0]), [2.5, 1.0, 2.5, 4.0]);
        assert_eq!(rank_correlation(&[(1.0, 1.0), (2.0, 1.0), (3.0, 1.0), (4.0, 1.0)]), None);
        // scipy.stats.spearmanr([1,2,3,4,5],[5,6,7,8,7]).statistic = 0.8207826816681233
        let (rank, _) =
            rank_correlation(&[(1.0, 5.0), (2.0, 6.0), (3.0, 7.0), (4.0, 8.0), (5.0, 7.0)]).unwrap();
        assert!((rank - 0.820_782_681_668_123_3).abs() < 1e-12, "{rank}");
    }
}
