//! Scores of a model on data that were not fitted.

use serde::Serialize;

/// Level of confidence of the intervals.
pub const LEVEL: f64 = 0.95;

/// Errors of predictions.
///
/// ```
/// use identify::rotor::Score;
///
/// let score = Score::of(&[(1.0, 2.0), (5.0, 4.0)]).unwrap();
/// assert_eq!((score.rms, score.r_squared, score.segments), (1.0, 0.0, 2));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Root of the mean square error, in the unit of the prediction.
    pub rms: f64,
    /// The share of the variance that is predicted; 1 is all of it.
    pub r_squared: f64,
    /// Plateaus, steps or holds that were predicted.
    pub segments: usize,
}

impl Score {
    /// The score of pairs of a predicted and a measured value; `None` without any.
    pub fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let n = pairs.len() as f64;
        let mean = pairs.iter().map(|(_, measured)| measured).sum::<f64>() / n;
        let error: f64 = pairs.iter().map(|(predicted, measured)| (measured - predicted).powi(2)).sum();
        let variance: f64 = pairs.iter().map(|(_, measured)| (measured - mean).powi(2)).sum();
        (!pairs.is_empty()).then(|| Self {
            rms: (error / n).sqrt(),
            r_squared: 1.0 - error / variance,
            segments: pairs.len(),
        })
    }
}
