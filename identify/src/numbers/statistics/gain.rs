//! Chance that a mean gain over blocks of time is zero.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Resamples: enough for the level of one among thirty candidates, tried beside four others.
const RESAMPLES: usize = 20_000;
/// After so many that lose, a chance is known well enough.
const LOSSES_ENOUGH: usize = 500;

/// Chance that the mean of `gains` is not above zero, by resampling them (one-sided percentile bootstrap, Efron 1979): of
/// gains so unequal, since a few blocks of violent flight hold most of them, a mean is far from normal.
pub fn chance_of_no_gain(gains: &[f64]) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(gains.len() as u64);
    let count = gains.len() as u64;
    let draw = |random: &mut ChaCha8Rng| gains[(((random.next_u64() >> 32) * count) >> 32) as usize];
    let (mut losses, mut drawn) = (0, 0);
    while drawn < RESAMPLES && losses < LOSSES_ENOUGH {
        losses += usize::from((0..count).map(|_| draw(&mut random)).sum::<f64>() <= 0.0);
        drawn += 1;
    }
    // A few blocks that agree prove no more than a few coins that fall alike.
    ((losses + 1) as f64 / (drawn + 1) as f64).max(0.5_f64.powi(gains.len().min(1000) as i32))
}
