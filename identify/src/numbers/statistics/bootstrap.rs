//! The interval of a mean whose samples are correlated, by resampling blocks.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

use super::correlation::mean;

/// Settings of the resampling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bootstrap {
    /// Samples a block: longer than the samples remember; 1 for independent samples.
    pub block: usize,
    /// Number of resampled series.
    pub resamples: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// Share of intervals that shall hold the mean, such as 0.95.
    pub level: f64,
}

/// A mean with its interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct MeanInterval {
    /// The mean of the samples.
    pub mean: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The mean of `values` with its percentile interval under the circular block bootstrap.
///
/// Blocks that start anywhere, and go on at the start where the samples end, are strung together to a series
/// of the same length. The method is that of Politis and Romano, "A circular block-resampling procedure for
/// stationary data" (1992). It follows Künsch, "The jackknife and the bootstrap for general stationary
/// observations", Annals of Statistics 17 (1989). NaN where there are no samples.
///
/// ```
/// use identify::statistics::{Bootstrap, block_bootstrap_mean};
///
/// let how = Bootstrap { block: 1, resamples: 1000, seed: 1, level: 0.95 };
/// let found = block_bootstrap_mean(&[1.0, 2.0, 3.0], &how);
/// assert!(found.mean == 2.0 && found.low < 2.0 && found.high > 2.0);
/// ```
///
/// # Panics
///
/// If `how.block` or `how.resamples` is 0.
#[must_use]
pub fn block_bootstrap_mean(values: &[f64], how: &Bootstrap) -> MeanInterval {
    assert!(how.block > 0 && how.resamples > 0, "a block and a resample at least");
    let mean = mean(values);
    if values.is_empty() {
        return MeanInterval { mean, low: mean, high: mean };
    }
    let mut draws = ChaCha8Rng::seed_from_u64(how.seed);
    let mut means: Vec<f64> = (0..how.resamples).map(|_| resampled(values, how.block, &mut draws)).collect();
    means.sort_by(f64::total_cmp);
    let tail = 0.5 - 0.5 * how.level;
    MeanInterval { mean, low: quantile(&means, tail), high: quantile(&means, 1.0 - tail) }
}

/// The mean of one resampled series.
fn resampled(values: &[f64], block: usize, draws: &mut ChaCha8Rng) -> f64 {
    let n = values.len();
    let mut sum = 0.0;
    let mut drawn = 0;
    while drawn < n {
        let start = (draws.next_u64() % n as u64) as usize;
        let length = block.min(n - drawn);
        sum += (start..start + length).map(|index| values[index % n]).sum::<f64>();
        drawn += length;
    }
    sum / n as f64
}

/// The quantile of sorted values, linear between them (type 7 of Hyndman and Fan 1996, NumPy's default).
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (sorted[above] - sorted[below]) * (place - below as f64)
}
