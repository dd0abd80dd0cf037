//! The motors' lag as a control law sees it: the rotors' answer to a demand, foreseen, and a demand that hurries
//! them.
//!
//! Near hover every component of the wrench follows its demand as a rotor's speed follows its command:
//! w″ = ω_n²·(u − w) − 2ζ·ω_n·w′ for a motor of second order, w′ = (u − w)/τ for one of first (the vehicle file's
//! `[motor]`). No sensor measures rotor speeds, so w is foreseen from the demands. With w and w′ at hand the
//! demand is u = w + [ω_f²·(v − w) − 2ζ_f·ω_f·w′ + 2ζ·ω_n·w′]/ω_n². It makes w follow the wanted v as a motor
//! of ω_f and ζ_f would: the poles of the lag are placed anew (K. J. Åström and R. M. Murray, "Feedback
//! Systems", section 7.2, state feedback). The foreseen w follows what the allocation could make of the
//! demand, so saturation winds nothing up.

use crate::allocation::RotorWrench;
use diagnostics::unit::PURE_NUMBER;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use vehicles::MotorModel;

/// The lag at one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorLag {
    model: MotorModel,
    /// Takes a component and its rate over one period.
    transition: Matrix2<f64>,
    /// Addition by a demand of one, held over the period.
    input: Vector2<f64>,
}

gains! {
    /// Wanted lag: its poles as placed anew.
    pub struct LagTarget of file {
        /// ω_f, rad/s.
        natural_frequency_rad_s: f64 = file.bandwidth("natural_frequency"),
        /// ζ_f.
        damping_ratio: f64 = file.limit("damping_ratio", PURE_NUMBER),
    }
}

/// The wrench that the rotors are foreseen to make, and its rate of change.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Made {
    /// The wrench, N and N·m.
    pub wrench: RotorWrench,
    /// Its rate of change, N/s and N·m/s.
    pub rate: RotorWrench,
}

impl MotorLag {
    /// The lag of motors that behave as `model`, over steps of `period_s`.
    pub fn new(model: MotorModel, period_s: f64) -> Self {
        let (dynamics_1_s, input_1_s) = continuous(&model);
        let mut held = Matrix3::zeros();
        held.fixed_view_mut::<2, 2>(0, 0).copy_from(&dynamics_1_s);
        held.fixed_view_mut::<2, 1>(0, 2).copy_from(&input_1_s);
        // The exponential of both in one matrix is the exact step under an input that is held.
        let step = (held * period_s).exp();
        Self {
            model,
            transition: step.fixed_view::<2, 2>(0, 0).into(),
            input: step.fixed_view::<2, 1>(0, 2).into(),
        }
    }

    /// Returns the rotors' wrench one period after `made` under the demand `asked`.
    pub fn advance(&self, made: &Made, asked: &RotorWrench) -> Made {
        let step = |value: f64, rate: f64, asked: f64| {
            let next = self.transition * Vector2::new(value, rate) + self.input * asked;
            (next.x, next.y)
        };
        let (now, rate) = (&made.wrench, &made.rate);
        let thrust = step(now.thrust_N, rate.thrust_N, asked.thrust_N);
        let torques: [(f64, f64); 3] =
            std::array::from_fn(|i| step(now.torque_B_N_m[i], rate.torque_B_N_m[i], asked.torque_B_N_m[i]));
        let wrench =
            |thrust_N, torque: [f64; 3]| RotorWrench { thrust_N, torque_B_N_m: Vector3::from(torque) };
        Made { wrench: wrench(thrust.0, torques.map(|t| t.0)), rate: wrench(thrust.1, torques.map(|t| t.1)) }
    }

    /// The demand with which the rotors go towards `wanted` as motors of `target` would.
    pub fn hurried(&self, target: &LagTarget, made: &Made, wanted: &RotorWrench) -> RotorWrench {
        let (now, rate) = (&made.wrench, &made.rate);
        let hurry = |now: f64, rate: f64, wanted: f64| self.hurry(target, now, rate, wanted);
        let torque = |i: usize| hurry(now.torque_B_N_m[i], rate.torque_B_N_m[i], wanted.torque_B_N_m[i]);
        RotorWrench {
            thrust_N: hurry(now.thrust_N, rate.thrust_N, wanted.thrust_N),
            torque_B_N_m: Vector3::new(torque(0), torque(1), torque(2)),
        }
    }

    /// Returns the time by which the wrench lags a demand that rises evenly, s: 2ζ/ω_n, or τ.
    pub fn delay_s(&self) -> f64 {
        match self.model {
            MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zn } => 2.0 * zn / wn,
            MotorModel::FirstOrder { time_constant_s } => time_constant_s,
        }
    }

    fn hurry(&self, target: &LagTarget, now: f64, rate: f64, wanted: f64) -> f64 {
        let (wf, zf) = (target.natural_frequency_rad_s, target.damping_ratio);
        match self.model {
            MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zn } => {
                let (brake, motor_brake) = (2.0 * zf * wf * rate, 2.0 * zn * wn * rate);
                now + (wf * wf * (wanted - now) - brake + motor_brake) / (wn * wn)
            }
            // One pole, placed where the pair's slow behaviour is: a lag of 2ζ_f/ω_f.
            MotorModel::FirstOrder { time_constant_s } => {
                now + time_constant_s * wf / (2.0 * zf) * (wanted - now)
            }
        }
    }
}

/// Rate of change of (w, w′) from itself and from the demand. A lag of first order has no w′ of its own: the second
/// state then only fades.
pub fn continuous(model: &MotorModel) -> (Matrix2<f64>, Vector2<f64>) {
    match *model {
        MotorModel::SecondOrder { natural_frequency_rad_s: wn, damping_ratio: zeta } => {
            (Matrix2::new(0.0, 1.0, -wn * wn, -2.0 * zeta * wn), Vector2::new(0.0, wn * wn))
        }
        MotorModel::FirstOrder { time_constant_s: tau } => {
            (Matrix2::new(-1.0 / tau, 0.0, 0.0, -1.0 / tau), Vector2::new(1.0 / tau, 0.0))
        }
    }
}

impl Made {
    /// Rotors that have settled at `wrench`.
    pub fn settled(wrench: RotorWrench) -> Self {
        Self { wrench, rate: RotorWrench::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: MotorModel =
        MotorModel::SecondOrder { natural_frequency_rad_s: 15.0756, damping_ratio: 0.603 };
    const FIRST: MotorModel = MotorModel::FirstOrder { time_constant_s: 0.05 };
    const TARGET: LagTarget = LagTarget { natural_frequency_rad_s: 50.0, damping_ratio: 0.7 };

    fn thrust(thrust_N: f64) -> RotorWrench {
        RotorWrench { thrust_N, ..RotorWrench::default() }
    }

    /// The thrust after `time_s` from rest, by the closed form of a lag of second order.
    fn step_response(wn: f64, zeta: f64, time_s: f64) -> f64 {
        let (sigma, wd) = (zeta * wn, wn * (1.0 - zeta * zeta).sqrt());
        1.0 - libm::exp(-sigma * time_s) * (libm::cos(wd * time_s) + sigma / wd * libm::sin(wd * time_s))
    }

    #[test]
    fn a_step_is_followed_as_the_closed_form_says() {
        let lag = MotorLag::new(SECOND, 1e-3);
        let made = (0..100).fold(Made::default(), |made, _| lag.advance(&made, &thrust(1.0)));
        assert!((made.wrench.thrust_N - step_response(15.0756, 0.603, 0.1)).abs() < 1e-12);
        let lag = MotorLag::new(FIRST, 1e-3);
        let made = (0..100).fold(Made::default(), |made, _| lag.advance(&made, &thrust(1.0)));
        assert!((made.wrench.thrust_N - (1.0 - libm::exp(-2.0))).abs() < 1e-12);
    }

    #[test]
    fn a_hurried_lag_answers_as_its_target_would() {
        for model in [SECOND, FIRST] {
            let lag = MotorLag::new(model, 1e-5);
            let mut made = Made::default();
            for _ in 0..3000 {
                made = lag.advance(&made, &lag.hurried(&TARGET, &made, &thrust(1.0)));
            }
            let expected = match model {
                SECOND => step_response(50.0, 0.7, 0.03),
                _ => 1.0 - libm::exp(-0.03 / 0.028_f64),
            };
            assert!((made.wrench.thrust_N - expected).abs() < 1e-3, "{model:?}: {made:?}");
        }
    }
}
