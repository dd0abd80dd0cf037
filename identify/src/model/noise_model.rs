//! The noise of an equation's residual: autoregressive, so that slow noise, and noise that windows share, is weighed
//! correctly.
//!
//! A vehicle is flown by feedback: the controller answers a slow disturbance, so that command and disturbance
//! are correlated. Least squares that takes the residual for white then finds too little torque gain. The
//! direct method is consistent with the right noise model only (Forssell and Ljung, Automatica 35, 1999;
//! Ljung, System Identification, 2nd ed., section 13.4). So each component of each equation is whitened by an
//! autoregressive model of its own residual. Fits and judgements compare its innovations: generalised least
//! squares.

/// Orders that are tried.
const ORDER_MAX: usize = 16;

/// The autoregressive noise of one component, over knots at equal distances.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseModel {
    /// By order: the coefficients of the best predictor from so many samples before, and the variance of its error.
    predictors: Vec<(Vec<f64>, f64)>,
}

impl NoiseModel {
    /// White noise.
    pub fn white(variance: f64) -> Self {
        Self { predictors: vec![(Vec::new(), variance)] }
    }

    /// The model of noise with these autocovariances over `count` samples: Levinson's recursion, with the order that
    /// Schwarz's criterion (Annals of Statistics 6, 1978) finds best.
    pub fn of_autocovariance(autocovariance: &[f64], count: usize) -> Self {
        let mut model = Self::white(autocovariance.first().copied().unwrap_or(0.0));
        if model.innovation_variance() <= 0.0 {
            return model;
        }
        let penalty = libm::log(count.max(2) as f64) / count.max(1) as f64;
        let criterion = |variance: f64, order: usize| libm::log(variance) + order as f64 * penalty;
        let (mut best, mut least) = (0, criterion(model.innovation_variance(), 0));
        for order in 1..autocovariance.len().min(ORDER_MAX + 1) {
            let (before, variance) = &model.predictors[order - 1];
            let explained: f64 =
                before.iter().enumerate().map(|(i, a)| a * autocovariance[order - 1 - i]).sum();
            let reflection = (autocovariance[order] - explained) / variance;
            let left = variance * (1.0 - reflection * reflection);
            if left <= 0.0 || !left.is_finite() {
                break;
            }
            let mut coefficients: Vec<f64> =
                (0..before.len()).map(|i| before[i] - reflection * before[before.len() - 1 - i]).collect();
            coefficients.push(reflection);
            model.predictors.push((coefficients, left));
            if criterion(left, order) < least {
                (best, least) = (order, criterion(left, order));
            }
        }
        model.predictors.truncate(best + 1);
        model
    }

    /// The variance of the part that cannot be predicted from the samples before.
    pub fn innovation_variance(&self) -> f64 {
        self.predictors[self.predictors.len() - 1].1
    }

    /// One over the variance of an innovation; zero where there is nothing to weigh.
    pub fn weight(&self) -> f64 {
        let variance = self.innovation_variance();
        if variance > 0.0 { 1.0 / variance } else { 0.0 }
    }

    /// The best prediction of the `count` samples that follow the samples `past`.
    pub fn forecast(&self, past: &[f64], count: usize) -> Vec<f64> {
        let order = (self.predictors.len() - 1).min(past.len());
        let (coefficients, _) = &self.predictors[order];
        let mut rows = past[past.len() - order..].to_vec();
        for _ in 0..count {
            let next = coefficients.iter().zip(rows.iter().rev()).map(|(a, row)| a * row).sum();
            rows.push(next);
        }
        rows.split_off(order)
    }

    /// Puts the innovations in place of every `width`th of `rows`, which follow each other without a gap. The first of
    /// them have fewer before them: theirs are scaled to the variance of the others.
    pub fn whiten(&self, rows: &mut [f64], width: usize) {
        let last = self.predictors.len() - 1;
        if last == 0 {
            return;
        }
        for at in (0..rows.len().div_ceil(width)).rev() {
            let (coefficients, variance) = &self.predictors[at.min(last)];
            let predicted: f64 =
                coefficients.iter().enumerate().map(|(i, a)| a * rows[(at - 1 - i) * width]).sum();
            let scale = (self.innovation_variance() / variance).sqrt();
            rows[at * width] = scale * (rows[at * width] - predicted);
        }
    }
}

/// Sums of products of samples that are apart by 0, 1, … knots, for the autocovariance.
#[derive(Debug, Clone)]
pub struct Products {
    sums: Vec<f64>,
    count: usize,
}

impl Default for Products {
    fn default() -> Self {
        Self { sums: vec![0.0; ORDER_MAX + 1], count: 0 }
    }
}

impl Products {
    /// Adds a stretch without a gap.
    pub fn add(&mut self, column: &[f64]) {
        self.count += column.len();
        for (lag, sum) in self.sums.iter_mut().enumerate() {
            *sum += column.iter().zip(column.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
        }
    }

    /// Adds white noise of this sum of squares.
    pub fn add_white(&mut self, squares: f64) {
        self.sums[0] += squares;
    }

    /// White noise with these products.
    pub fn white(&self) -> NoiseModel {
        NoiseModel::white(self.sums[0] / self.count.max(1) as f64)
    }

    /// The noise with these products.
    pub fn model(&self) -> NoiseModel {
        let part = 1.0 / self.count.max(1) as f64;
        let autocovariance: Vec<f64> = self.sums.iter().map(|sum| sum * part).collect();
        NoiseModel::of_autocovariance(&autocovariance, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::statistics::autocorrelation;

    fn second_order(count: usize) -> Vec<f64> {
        let mut random = component::random::stream(5, "noise");
        let mut course = vec![0.0; 2];
        for at in 2..count {
            course.push(1.5 * course[at - 1] - 0.7 * course[at - 2] + component::random::normal(&mut random));
        }
        course
    }

    #[test]
    fn the_coefficients_of_a_known_process_are_found_and_its_innovations_are_white() {
        let mut course = second_order(20_000);
        let mut products = Products::default();
        products.add(&course);
        let model = products.model();
        let (coefficients, variance) = &model.predictors[2];
        assert!((coefficients[0] - 1.5).abs() < 0.02 && (coefficients[1] + 0.7).abs() < 0.02);
        assert!((variance - 1.0).abs() < 0.03, "{variance}");
        model.whiten(&mut course, 1);
        let correlations = autocorrelation(&course, 10);
        assert!(correlations[1..].iter().all(|number| number.abs() < 0.025), "{correlations:?}");
    }

    #[test]
    fn white_noise_stays_as_it_is() {
        let mut random = component::random::stream(6, "noise");
        let course: Vec<f64> = (0..5000).map(|_| component::random::normal(&mut random)).collect();
        let mut products = Products::default();
        products.add(&course);
        let mut whitened = course.clone();
        products.model().whiten(&mut whitened, 1);
        assert_eq!(whitened, course);
    }

    #[test]
    fn the_first_samples_of_a_stretch_count_as_much_as_the_others() {
        let mut products = Products::default();
        products.add(&second_order(20_000));
        let model = products.model();
        let mut squares = 0.0;
        for start in 0..4000 {
            let mut stretch = second_order(4300)[start + 100..start + 103].to_vec();
            if start % 40 == 0 {
                model.whiten(&mut stretch, 1);
                squares += stretch[0] * stretch[0] / 100.0;
            }
        }
        assert!((0.6..1.5).contains(&squares), "{squares}");
    }
}
