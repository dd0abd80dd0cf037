//! Differences between simulated and measured states of a vehicle, which comparisons at the ends of windows sum up.
#![allow(non_snake_case, reason = "a trailing _W or _B names the frame a vector is written in")]

use crate::flight::Flight;

/// A quantity of a state that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateQuantity {
    /// Position in the world, by the length of the difference.
    Position,
    /// Velocity in the world, by the length of the difference.
    Velocity,
    /// Attitude, by the angle of the rotation between two.
    Attitude,
    /// Angular velocity in the body, by the length of the difference.
    Rates,
}

impl StateQuantity {
    /// All, in the order of reports.
    pub const ALL: [Self; 4] = [Self::Position, Self::Velocity, Self::Attitude, Self::Rates];

    /// True for attitude and rates, which torques change.
    #[must_use]
    pub fn is_turn(self) -> bool {
        matches!(self, Self::Attitude | Self::Rates)
    }

    /// The name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Attitude => "attitude",
            Self::Rates => "rates",
        }
    }

    /// The unit of its errors.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position => "m",
            Self::Velocity => "m/s",
            Self::Attitude => "deg",
            Self::Rates => "rad/s",
        }
    }

    /// True if `flight` shows it, by a measurement or by the change of one; an assumption does not count.
    #[must_use]
    pub fn is_measured(self, flight: &Flight) -> bool {
        // Without an attitude nobody knows where thrust points; one that was assumed is no measurement.
        let (has_attitude, is_measured) = (!flight.attitude.is_empty(), flight.assumed.is_empty());
        match self {
            Self::Position => has_attitude && !flight.position.is_empty(),
            Self::Velocity => has_attitude && (!flight.position.is_empty() || !flight.velocity.is_empty()),
            Self::Attitude => has_attitude && is_measured,
            Self::Rates => is_measured && (has_attitude || !flight.angular_velocity.is_empty()),
        }
    }
}

/// Angle between the body's z axis and the vertical, in degrees, at an attitude of length one in the order x, y, z, w.
///
/// ```
/// let (sine, cosine) = libm::sincos(15_f64.to_radians());
/// assert!((flights::state::tilt_deg(&[sine, 0.0, 0.0, cosine]) - 30.0).abs() < 1e-9);
/// ```
#[must_use]
pub fn tilt_deg([x, y, ..]: &[f64; 4]) -> f64 {
    libm::acos((1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0)).to_degrees()
}

/// Length of a vector.
#[must_use]
pub fn length(vector: &[f64; 3]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// The state of a vehicle at one moment.
#[derive(Debug, Clone, Copy)]
pub struct VehicleState {
    /// Position in W, in m.
    pub position_W_m: [f64; 3],
    /// Velocity in W, in m/s.
    pub velocity_W_m_s: [f64; 3],
    /// Quaternion of length one that takes vectors from B to W; the order of its parts is that of the state that it is
    /// compared with.
    pub attitude_WB: [f64; 4],
    /// Angular velocity in B, in rad/s.
    pub angular_velocity_B_rad_s: [f64; 3],
}

impl VehicleState {
    /// Returns its distance from `measured`, in the unit of `quantity`.
    ///
    /// ```
    /// # use flights::state::{StateQuantity, VehicleState};
    /// let measured = VehicleState {
    ///     position_W_m: [0.0, 0.0, 1.0],
    ///     velocity_W_m_s: [0.0; 3],
    ///     attitude_WB: [1.0, 0.0, 0.0, 0.0],
    ///     angular_velocity_B_rad_s: [0.0; 3],
    /// };
    /// let simulated = VehicleState { position_W_m: [0.3, 0.4, 1.0], ..measured };
    /// assert_eq!(simulated.error(&measured, StateQuantity::Position), 0.5);
    /// assert_eq!(simulated.error(&measured, StateQuantity::Attitude), 0.0);
    /// ```
    #[must_use]
    pub fn error(&self, measured: &Self, quantity: StateQuantity) -> f64 {
        match quantity {
            StateQuantity::Position => distance(&self.position_W_m, &measured.position_W_m),
            StateQuantity::Velocity => distance(&self.velocity_W_m_s, &measured.velocity_W_m_s),
            StateQuantity::Attitude => angle_deg(&self.attitude_WB, &measured.attitude_WB),
            StateQuantity::Rates => {
                distance(&self.angular_velocity_B_rad_s, &measured.angular_velocity_B_rad_s)
            }
        }
    }
}

fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// The angle of the rotation between two attitudes; exact for small ones too, which a cosine is not.
fn angle_deg(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let opposite = b.map(|part| -part);
    let (near, far) = (distance(a, b), distance(a, &opposite));
    // A quaternion and its opposite are the same attitude. `<=` is false of NaN, which stays NaN.
    let (near, far) = if near <= far { (near, far) } else { (far, near) };
    (4.0 * libm::atan2(near, far)).to_degrees()
}

/// The errors at the ends of windows, summed up.
///
/// ```
/// # use flights::state::{StateQuantity, VehicleState, WindowEndErrors};
/// let at = |height: f64| VehicleState {
///     position_W_m: [0.0, 0.0, height],
///     velocity_W_m_s: [0.0; 3],
///     attitude_WB: [1.0, 0.0, 0.0, 0.0],
///     angular_velocity_B_rad_s: [0.0; 3],
/// };
/// let mut errors = WindowEndErrors::default();
/// assert!(errors.rms(StateQuantity::Position).is_nan());
/// errors.add(&at(1.0), &at(4.0));
/// errors.add(&at(1.0), &at(5.0));
/// assert_eq!(errors.rms(StateQuantity::Position), 12.5_f64.sqrt());
/// ```
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct WindowEndErrors {
    squares: [f64; 4],
    windows: u32,
}

impl WindowEndErrors {
    /// Adds the end of a window.
    pub fn add(&mut self, simulated: &VehicleState, measured: &VehicleState) {
        for (sum, quantity) in self.squares.iter_mut().zip(StateQuantity::ALL) {
            let error = simulated.error(measured, quantity);
            *sum += error * error;
        }
        self.windows += 1;
    }

    /// Ends that were added.
    #[must_use]
    pub fn windows(&self) -> u32 {
        self.windows
    }

    /// Root mean square over the windows, in the quantity's unit; NaN of none.
    #[must_use]
    pub fn rms(&self, quantity: StateQuantity) -> f64 {
        (self.squares[quantity as usize] / f64::from(self.windows)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_lengths_and_angles() {
        let measured = VehicleState {
            position_W_m: [0.0, 0.0, 1.0],
            velocity_W_m_s: [0.0; 3],
            attitude_WB: [0.0, 0.0, 0.0, 1.0],
            angular_velocity_B_rad_s: [0.0; 3],
        };
        let mut simulated = VehicleState {
            position_W_m: [0.3, 0.4, 1.0],
            velocity_W_m_s: [0.0, 0.0, -2.0],
            // A turn by 60 degrees about z, with the other sign of its quaternion.
            attitude_WB: [0.0, 0.0, -0.5, -(0.75_f64.sqrt())],
            angular_velocity_B_rad_s: [0.1, 0.0, 0.0],
        };
        let found = StateQuantity::ALL.map(|quantity| simulated.error(&measured, quantity));
        for (found, expected) in found.into_iter().zip([0.5, 2.0, 60.0, 0.1]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        simulated.attitude_WB[0] = f64::NAN;
        assert!(simulated.error(&measured, StateQuantity::Attitude).is_nan());
    }

    #[test]
    fn a_small_angle_keeps_its_digits() {
        let half_rad = 1e-9_f64;
        let found = angle_deg(&[libm::cos(half_rad), libm::sin(half_rad), 0.0, 0.0], &[1.0, 0.0, 0.0, 0.0]);
        assert!((found / (2.0 * half_rad).to_degrees() - 1.0).abs() < 1e-9, "{found}");
    }
}
