//! The window through which measurement and model are both seen: a cubic B-spline.
//!
//! An equation of motion is compared in its weak form: both of its sides are averaged with the same smooth
//! window w. Derivatives of measurements go over to the window, so that no measurement is differentiated by
//! itself (integration by parts; the modulating functions of Shinbrot, Trans. ASME 79, 1957, in the B-spline
//! form of Preisig and Rippin, Computers & Chemical Engineering 17(1), 1993). On the grid the window is four
//! boxes folded with each other, and the differences below are exact. The second difference of a position is
//! the acceleration, averaged by the stencil 1/12, 10/12, 1/12 (Numerov). The central difference of a rate is
//! its derivative, averaged by 1/6, 4/6, 1/6 (Simpson). The model's side gets the same stencils.

/// Weights of instants around a knot, which stands at the middle.
#[derive(Debug, Clone, PartialEq)]
pub struct Window(Vec<f64>);

impl Window {
    /// A cubic B-spline of four boxes of `box_steps` grid steps each; its sum is 1.
    pub fn b_spline(box_steps: usize) -> Self {
        let unit = vec![1.0 / box_steps as f64; box_steps];
        let mut weights = vec![1.0];
        for _ in 0..4 {
            weights = folded(&weights, &unit);
        }
        Self(weights)
    }

    /// This window behind a symmetric stencil of three.
    pub fn behind(&self, stencil: [f64; 3]) -> Self {
        Self(folded(&self.0, &stencil))
    }

    /// Returns the number of instants that it covers on each side of its knot.
    pub fn reach(&self) -> usize {
        self.0.len() / 2
    }

    /// The weighted sum of `values` around `knot`.
    pub fn over<const N: usize>(&self, values: &[[f64; N]], knot: usize) -> [f64; N] {
        let mut sum = [0.0; N];
        let first = knot - self.reach();
        for (weight, value) in self.0.iter().zip(&values[first..]) {
            for (sum, value) in sum.iter_mut().zip(value) {
                *sum += weight * value;
            }
        }
        sum
    }
}

/// The stencil of a second difference of values at `step_s`.
pub fn second_difference(step_s: f64) -> [f64; 3] {
    let part = 1.0 / (step_s * step_s);
    [part, -2.0 * part, part]
}

/// The stencil of a central difference of values at `step_s`. The order is that of a convolution's.
pub fn central_difference(step_s: f64) -> [f64; 3] {
    let part = 0.5 / step_s;
    [-part, 0.0, part]
}

/// Stencil by which a second difference averages an acceleration.
pub const NUMEROV: [f64; 3] = [1.0 / 12.0, 10.0 / 12.0, 1.0 / 12.0];
/// Stencil by which a central difference averages a derivative.
pub const SIMPSON: [f64; 3] = [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0];

fn folded(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; a.len() + b.len() - 1];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            sum[i + j] += a * b;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.005;

    fn at(value: impl Fn(f64) -> f64) -> Vec<[f64; 1]> {
        (0..100).map(|i| [value(f64::from(i) * STEP_S)]).collect()
    }

    #[test]
    fn it_is_symmetric_and_sums_to_one() {
        let Window(weights) = Window::b_spline(5);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(weights.iter().zip(weights.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-15));
        assert_eq!(weights.len(), 17);
    }

    #[test]
    fn both_sides_agree_to_the_fourth_order() {
        let window = Window::b_spline(4);
        let (w, knot) = (20.0_f64, 50);
        let second = window.behind(second_difference(STEP_S)).over(&at(|t| libm::sin(w * t)), knot)[0];
        let model = window.behind(NUMEROV).over(&at(|t| -w * w * libm::sin(w * t)), knot)[0];
        assert!((second - model).abs() < 1e-4 * model.abs(), "{second} {model}");
        let first = window.behind(central_difference(STEP_S)).over(&at(|t| libm::sin(w * t)), knot)[0];
        let model = window.behind(SIMPSON).over(&at(|t| w * libm::cos(w * t)), knot)[0];
        assert!((first - model).abs() < 1e-4 * model.abs(), "{first} {model}");
    }

    #[test]
    fn a_constant_has_no_derivative() {
        let window = Window::b_spline(6);
        assert!(window.behind(second_difference(STEP_S)).over(&at(|_| 1e3), 50)[0].abs() < 1e-5);
        assert!(window.behind(central_difference(STEP_S)).over(&at(|_| 1e3), 50)[0].abs() < 1e-8);
    }
}
