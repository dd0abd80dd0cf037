//! Rolling resistance of the vehicle's disc: without it, a vehicle on its rim would roll until it meets something.

use super::solver::{Body, Unilateral, join, part};
use super::world::{DISC, Near};
use nalgebra::{Matrix3, Vector3};

/// Distance ahead of the contact at which the ground carries a rolling disc, against the disc's radius. A bicycle's tyre has 0.002 to
/// 0.005; a rim of propeller guards is rougher. Tuned, no source.
const LEAD: f64 = 0.02;

/// Reduces the spin of a disc of this radius, across each contact, by the rolling resistance of its normal
/// impulse in the step before; at most to zero. The impulses are those that `constraints` start from.
pub(super) fn resist(near: &[Near], constraints: &[Unilateral], bodies: &mut [Body], radius_m: f64) {
    for (near, constraint) in near.iter().zip(constraints) {
        if near.part != DISC || constraint.impulse_N_s <= 0.0 {
            continue;
        }
        let [first, second] = near.bodies;
        let spin_W_rad_s = part(&bodies[second].twist)[1] - part(&bodies[first].twist)[1];
        let rolls_W_rad_s = spin_W_rad_s - near.normal_W * near.normal_W.dot(&spin_W_rad_s);
        let Some(axis_W) = rolls_W_rad_s.try_normalize(0.0) else { continue };
        let yields =
            |body: usize| -> Matrix3<f64> { bodies[body].mobility.fixed_view::<3, 3>(3, 3).into_owned() };
        let stops_N_m_s = rolls_W_rad_s.norm() / axis_W.dot(&((yields(first) + yields(second)) * axis_W));
        let resists_N_m_s = (LEAD * radius_m * constraint.impulse_N_s).min(stops_N_m_s);
        for (body, sign) in [(first, 1.0), (second, -1.0)] {
            let change = bodies[body].mobility * join(&Vector3::zeros(), &(axis_W * (sign * resists_N_m_s)));
            bodies[body].twist += change;
        }
    }
}
