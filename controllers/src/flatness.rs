//! The attitude and rates at which a quadrotor follows a thrust that changes: differential flatness.
//!
//! A quadrotor pushes along its own z only, so the direction of the thrust fixes body z, and the yaw the rest.
//! Differentiating that twice gives the angular velocity and acceleration (D. Mellinger and V. Kumar, "Minimum snap
//! trajectory generation and control for quadrotors", ICRA 2011, section III). Yaw is that of the z-y-x
//! sequence, so body x lies in the vertical plane of the heading. x_B ∥ y_C × z_B with y_C level and left of
//! the heading, as in M. Faessler, A. Franchi and D. Scaramuzza, "Differential flatness of quadrotor dynamics
//! subject to rotor drag", RA-L 2018. The yaw's own acceleration is taken as zero.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// The least rise of a thrust that sets an attitude, which would be undefined in a free fall. Tuned, no source: a tenth
/// of gravity.
pub const RISE_MIN_M_S2: f64 = 1.0;

/// A vector in the world that changes with time, with its first two derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moving {
    /// Now.
    pub value: Vector3<f64>,
    /// Its rate of change.
    pub first: Vector3<f64>,
    /// The rate of change of that.
    pub second: Vector3<f64>,
}

/// An attitude that changes with time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Body to world.
    pub attitude_WB: UnitQuaternion<f64>,
    /// Angular velocity in the target's own axes, rad/s.
    pub angular_velocity_B_rad_s: Vector3<f64>,
    /// Angular acceleration in the target's own axes, rad/s².
    pub angular_acceleration_B_rad_s2: Vector3<f64>,
}

/// The attitude at which body z points along `thrust_W` with the heading `yaw_rad`. `thrust_W` must point upwards.
pub fn target(thrust_W: &Moving, yaw_rad: f64, yaw_rate_rad_s: f64) -> Target {
    let z = thrust_W.direction();
    let x = left_of_heading(yaw_rad, yaw_rate_rad_s).cross(&z).direction();
    let y = z.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x.value, y.value, z.value]));
    Target {
        attitude_WB: UnitQuaternion::from_rotation_matrix(&rotation),
        // R' = R·[Ω]× read component by component, and once more differentiated.
        angular_velocity_B_rad_s: Vector3::new(
            z.value.dot(&y.first),
            x.value.dot(&z.first),
            y.value.dot(&x.first),
        ),
        angular_acceleration_B_rad_s2: Vector3::new(
            z.first.dot(&y.first) + z.value.dot(&y.second),
            x.first.dot(&z.first) + x.value.dot(&z.second),
            y.first.dot(&x.first) + y.value.dot(&x.second),
        ),
    }
}

/// The level axis to the left of the heading.
fn left_of_heading(yaw_rad: f64, rate_rad_s: f64) -> Moving {
    let (sin, cos) = libm::sincos(yaw_rad);
    let value = Vector3::new(-sin, cos, 0.0);
    let first = Vector3::new(-cos, -sin, 0.0) * rate_rad_s;
    Moving { value, first, second: -value * rate_rad_s * rate_rad_s }
}

impl Moving {
    /// The thrust for each unit of mass that makes this acceleration against gravity. It points up by at least
    /// [`RISE_MIN_M_S2`].
    pub fn against(mut self, gravity_m_s2: f64) -> Self {
        self.value.z = (self.value.z + gravity_m_s2).max(RISE_MIN_M_S2);
        self
    }

    /// The unit vector along it.
    fn direction(&self) -> Self {
        let length = self.value.norm();
        let unit = self.value / length;
        let growth = unit.dot(&self.first);
        let unit_first = (self.first - unit * growth) / length;
        let growth_first = unit_first.dot(&self.first) + unit.dot(&self.second);
        let unit_second = (self.second - unit * growth_first - unit_first * (2.0 * growth)) / length;
        Self { value: unit, first: unit_first, second: unit_second }
    }

    fn cross(&self, other: &Self) -> Self {
        Self {
            value: self.value.cross(&other.value),
            first: self.first.cross(&other.value) + self.value.cross(&other.first),
            second: self.second.cross(&other.value)
                + self.first.cross(&other.first) * 2.0
                + self.value.cross(&other.second),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thrust that swings about the vertical, with exact derivatives.
    fn swinging(time_s: f64) -> Moving {
        let (sin, cos) = libm::sincos(1.3 * time_s);
        let (sin_2, cos_2) = libm::sincos(2.6 * time_s);
        Moving {
            value: Vector3::new(3.0 * sin, -4.0 * sin_2, 9.81 + cos),
            first: Vector3::new(3.9 * cos, -10.4 * cos_2, -1.3 * sin),
            second: Vector3::new(-5.07 * sin, 27.04 * sin_2, -1.69 * cos),
        }
    }

    fn at(time_s: f64) -> Target {
        target(&swinging(time_s), 0.7 * time_s, 0.7)
    }

    #[test]
    fn body_z_is_along_the_thrust_and_the_yaw_is_that_of_the_z_y_x_sequence() {
        for step in 0..50 {
            let time_s = 0.1 * f64::from(step);
            let attitude_WB = at(time_s).attitude_WB;
            let z_B = attitude_WB * Vector3::z();
            assert!((z_B - swinging(time_s).value.normalize()).norm() < 1e-12);
            let (_, _, yaw_rad) = attitude_WB.euler_angles();
            assert!(crate::angle::wrap_rad(yaw_rad - 0.7 * time_s).abs() < 1e-12);
        }
    }

    #[test]
    fn rates_and_accelerations_are_the_derivatives_of_the_attitude() {
        let span_s = 1e-5;
        for step in 0..50 {
            let time_s = 0.1 * f64::from(step);
            let (before, now, after) = (at(time_s - span_s), at(time_s), at(time_s + span_s));
            let turned = before.attitude_WB.rotation_to(&after.attitude_WB);
            // Half way the axes are those of now.
            let rate_B = before.attitude_WB.inverse() * (turned.scaled_axis() / (2.0 * span_s));
            let rate_B = now.attitude_WB.inverse() * (before.attitude_WB * rate_B);
            assert!((rate_B - now.angular_velocity_B_rad_s).norm() < 1e-6, "{rate_B} at {time_s}");
            let acceleration_B =
                (after.angular_velocity_B_rad_s - before.angular_velocity_B_rad_s) / (2.0 * span_s);
            assert!((acceleration_B - now.angular_acceleration_B_rad_s2).norm() < 1e-6, "at {time_s}");
        }
    }
}
