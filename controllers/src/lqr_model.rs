//! The model that the `lqr` regulates: a quadrotor about hover, its motors' lag included.
//!
//! The 20 states are deviations from hover, in axes that turn with the heading. They are position and
//! velocity (level x, y and z up), rotation vector and angular rate of the body, the rotors' wrench and its
//! rate. Inputs: the demanded wrench. About hover a nose-down pitch accelerates along x and a roll to the
//! right, which is negative, along −y: v′ = (g·θ_y, −g·θ_x, T/m), θ′ = ω, ω′ = J⁻¹·τ (the thesis's eq. 3.12
//! and 3.17, linearised), and the wrench follows its demand as `motor_lag` says. The Hummingbird's motors (15
//! rad/s) are as slow as the attitude loop is fast, so a regulator that left them out would not be stable.
//! The step from tick to tick is exact for a demand that is held: the exponential of both matrices in one.

use crate::lqr_gains::LqrGains;
use crate::motor_lag;
use nalgebra::{SMatrix, SVector};
use vehicles::Vehicle;

/// States of the model.
pub const STATES: usize = 20;
/// Its inputs: thrust, and torque about body x, y and z.
pub const INPUTS: usize = 4;

/// Both in one.
const BOTH: usize = STATES + INPUTS;

/// Indices of the parts of the state.
pub const VELOCITY: usize = 3;
/// The rotation vector.
pub const ROTATION: usize = 6;
/// The angular rate.
pub const RATE: usize = 9;
/// The wrench that the rotors make.
pub const MADE: usize = 12;
/// Its rate of change.
pub const MADE_RATE: usize = 16;

/// One period: x ← transition·x + input·u.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Factor of the state.
    pub transition: SMatrix<f64, STATES, STATES>,
    /// Factor of a held demand.
    pub input: SMatrix<f64, STATES, INPUTS>,
}

/// The step of `vehicle` over `period_s`; `None` where its inertia has no inverse.
pub fn step(vehicle: &Vehicle, period_s: f64) -> Option<Step> {
    let inverse_inertia = vehicle.inertia_kg_m2.try_inverse()?;
    let (lag, lag_input) = motor_lag::continuous(&vehicle.motor);
    let mut both = SMatrix::<f64, BOTH, BOTH>::zeros();
    for axis in 0..3 {
        both[(axis, VELOCITY + axis)] = 1.0;
        both[(ROTATION + axis, RATE + axis)] = 1.0;
    }
    both[(VELOCITY, ROTATION + 1)] = vehicle.gravity_m_s2;
    both[(VELOCITY + 1, ROTATION)] = -vehicle.gravity_m_s2;
    both[(VELOCITY + 2, MADE)] = vehicle.mass_kg.recip();
    both.fixed_view_mut::<3, 3>(RATE, MADE + 1).copy_from(&inverse_inertia);
    for part in 0..INPUTS {
        let (made, rate, asked) = (MADE + part, MADE_RATE + part, STATES + part);
        both[(made, made)] = lag.m11;
        both[(made, rate)] = lag.m12;
        both[(rate, made)] = lag.m21;
        both[(rate, rate)] = lag.m22;
        both[(made, asked)] = lag_input.x;
        both[(rate, asked)] = lag_input.y;
    }
    let step = (both * period_s).exp();
    Some(Step {
        transition: step.fixed_view::<STATES, STATES>(0, 0).into(),
        input: step.fixed_view::<STATES, INPUTS>(0, STATES).into(),
    })
}

/// The weights of states and inputs: inverse squares of the stated deviations; the wrench made costs nothing.
pub fn weights(gains: &LqrGains) -> (SMatrix<f64, STATES, STATES>, SMatrix<f64, INPUTS, INPUTS>) {
    let (tilt, tilt_rate, torque) = (gains.tilt_rad, gains.tilt_rate_rad_s, gains.tilt_torque_N_m);
    let mut states = [f64::INFINITY; STATES];
    states[..VELOCITY].fill(gains.position_m);
    states[VELOCITY..ROTATION].fill(gains.velocity_m_s);
    states[ROTATION..RATE].copy_from_slice(&[tilt, tilt, gains.yaw_rad]);
    states[RATE..MADE].copy_from_slice(&[tilt_rate, tilt_rate, gains.yaw_rate_rad_s]);
    let inputs = [gains.thrust_N, torque, torque, gains.yaw_torque_N_m];
    (inverse_squares(states), inverse_squares(inputs))
}

fn inverse_squares<const N: usize>(deviations: [f64; N]) -> SMatrix<f64, N, N> {
    SMatrix::from_diagonal(&SVector::from(deviations.map(|deviation| (deviation * deviation).recip())))
}
