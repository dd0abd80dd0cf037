//! Response of a motor 1 / (a2 s^2 + a1 s + 1) to a unit step of its command.

/// Damping this near to 1 counts as 1, where the formulas on both sides lose digits.
const NEAR_CRITICAL: f64 = 1e-8;

/// A motor as its transfer function; with a2 = 0 it is of first order with the time constant a1. The thesis gives
/// its motor in this form (section 4.2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// a1, in s.
    pub a1_s: f64,
    /// a2, in s^2.
    pub a2_s2: f64,
}

impl Lag {
    /// w_n = 1 / sqrt(a2).
    pub fn natural_frequency_rad_s(self) -> f64 {
        self.a2_s2.sqrt().recip()
    }

    /// zeta = a1 / (2 sqrt(a2)).
    pub fn damping_ratio(self) -> f64 {
        0.5 * self.a1_s / self.a2_s2.sqrt()
    }

    /// The speed `t_s` after a step from 0 to 1 that found the motor at rest.
    pub fn step(self, t_s: f64) -> f64 {
        let Self { a1_s: a1, a2_s2: a2 } = self;
        if t_s <= 0.0 {
            return 0.0;
        }
        if a2 <= 0.0 {
            return -libm::expm1(-t_s / a1);
        }
        let discriminant = a1 * a1 - 4.0 * a2;
        let decay = 0.5 * a1 / a2;
        if discriminant.abs() < NEAR_CRITICAL * a1 * a1 {
            return 1.0 - libm::exp(-decay * t_s) * (1.0 + decay * t_s);
        }
        if discriminant < 0.0 {
            let omega = 0.5 * (-discriminant).sqrt() / a2;
            let (sin, cos) = libm::sincos(omega * t_s);
            return 1.0 - libm::exp(-decay * t_s) * (cos + decay / omega * sin);
        }
        let (slow, fast) = self.real_roots(discriminant.sqrt());
        1.0 + (fast * libm::exp(slow * t_s) - slow * libm::exp(fast * t_s)) / (slow - fast)
    }

    /// The matrix that takes the distance from a constant command, and the rate of it, over `t_s`.
    pub fn transition(self, t_s: f64) -> [[f64; 2]; 2] {
        let Self { a1_s: a1, a2_s2: a2 } = self;
        if a2 <= 0.0 {
            return [[libm::exp(-t_s / a1), 0.0], [0.0, 0.0]];
        }
        let discriminant = a1 * a1 - 4.0 * a2;
        let decay = 0.5 * a1 / a2;
        if discriminant > NEAR_CRITICAL * a1 * a1 {
            let (slow, fast) = self.real_roots(discriminant.sqrt());
            let (of_slow, of_fast) = (libm::exp(slow * t_s), libm::exp(fast * t_s));
            let part = 1.0 / (slow - fast);
            return [
                [part * (slow * of_fast - fast * of_slow), part * (of_slow - of_fast)],
                [part * slow * fast * (of_fast - of_slow), part * (slow * of_slow - fast * of_fast)],
            ];
        }
        // cos(w t) and sin(w t) / w, of which the latter is t where w is 0.
        let omega = 0.5 * (-discriminant).max(0.0).sqrt() / a2;
        let (sin, cos) = libm::sincos(omega * t_s);
        let sine = if omega * t_s > NEAR_CRITICAL { sin / omega } else { t_s };
        let fall = libm::exp(-decay * t_s);
        [[fall * (cos + decay * sine), fall * sine], [-fall * sine / a2, fall * (cos - decay * sine)]]
    }

    /// The slow and the fast root of an overdamped motor; the slow one by its conjugate, which keeps its digits where
    /// a2 is small.
    fn real_roots(self, root: f64) -> (f64, f64) {
        (-2.0 / (self.a1_s + root), -0.5 * (self.a1_s + root) / self.a2_s2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same step by the fourth-order Runge-Kutta method.
    fn integrated(lag: Lag, end_s: f64) -> f64 {
        let rate = |[w, v]: [f64; 2]| [v, (1.0 - w - lag.a1_s * v) / lag.a2_s2];
        let steps = 20_000;
        let h = end_s / f64::from(steps);
        let ahead = |x: [f64; 2], k: [f64; 2], part: f64| [x[0] + part * h * k[0], x[1] + part * h * k[1]];
        let mut x = [0.0, 0.0];
        for _ in 0..steps {
            let k1 = rate(x);
            let k2 = rate(ahead(x, k1, 0.5));
            let k3 = rate(ahead(x, k2, 0.5));
            let k4 = rate(ahead(x, k3, 1.0));
            let sum = [0, 1].map(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0);
            x = ahead(x, sum, 1.0);
        }
        x[0]
    }

    #[test]
    fn the_closed_form_is_the_differential_equation() {
        for (wn, zeta) in [(15.1, 0.6), (40.0, 1.0), (40.0, 1.0 + 1e-10), (60.0, 1.8), (90.0, 0.2)] {
            let lag = Lag { a1_s: 2.0 * zeta / wn, a2_s2: 1.0 / (wn * wn) };
            for t in [0.01, 0.05, 0.3] {
                assert!((lag.step(t) - integrated(lag, t)).abs() < 1e-8, "{wn} {zeta} {t}");
            }
        }
    }

    #[test]
    fn transitions_follow_the_step_and_each_other() {
        for (wn, zeta) in [(15.1, 0.6), (40.0, 1.0), (40.0, 1.0 + 1e-10), (60.0, 1.8)] {
            let lag = Lag { a1_s: 2.0 * zeta / wn, a2_s2: 1.0 / (wn * wn) };
            let ([first, second], both) = ([0.013, 0.04].map(|t| lag.transition(t)), lag.transition(0.053));
            let entry = |row: usize, column: usize| -> f64 {
                (0..2).map(|k| second[row][k] * first[k][column]).sum()
            };
            for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let (product, at_once) = (entry(row, column), both[row][column]);
                assert!((product - at_once).abs() < 1e-9 * (1.0 + at_once.abs()), "{wn} {zeta}");
            }
            // From rest a step of 1 leaves the distance 1 - y.
            assert!((1.0 - both[0][0] - lag.step(0.053)).abs() < 1e-9, "{wn} {zeta}");
        }
        let first = Lag { a1_s: 0.04, a2_s2: 0.0 };
        assert!((1.0 - first.transition(0.03)[0][0] - first.step(0.03)).abs() < 1e-15);
    }

    #[test]
    fn a_small_second_coefficient_comes_near_the_first_order() {
        let first = Lag { a1_s: 0.04, a2_s2: 0.0 };
        let second = Lag { a1_s: 0.04, a2_s2: 1e-12 };
        assert!((first.step(0.03) - second.step(0.03)).abs() < 1e-8);
        assert_eq!(first.step(-1.0), 0.0);
    }
}
