//! The place on the earth at which the world's origin lies, and the direction of its axes: by default x points east and y north.

use bus::messages::{Quaternion, StateEstimate};
use diagnostics::parameter::within;
use nalgebra::{UnitQuaternion, Vector3};

/// Metres of a degree of latitude on a sphere of the earth's mean radius, 6 371 008.8 m (IUGG).
const M_PER_DEGREE: f64 = 6_371_008.8 * std::f64::consts::PI / 180.0;
/// Azimuth of an x axis that points east.
const EAST_DEG: f64 = 90.0;

/// Latitude, longitude and altitude of the world's origin, by default the home position of PX4's simulations, in Zurich, and
/// the direction of its x axis.
///
/// ```
/// let origin = autopilots::origin::Origin::default();
/// let [longitude_deg, latitude_deg, altitude_m] = origin.place([0.0, 111.195, 2.0]);
/// assert!((latitude_deg - origin.latitude_deg - 1e-3).abs() < 1e-8, "north is along y");
/// assert_eq!((longitude_deg, altitude_m), (origin.longitude_deg, origin.altitude_m + 2.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, bus::Parameters)]
#[parameters(default)]
pub struct Origin {
    /// Latitude, north.
    #[parameter(default = 47.397_742, check = within(-89.0..=89.0, "-89 to 89: at the poles there is no east"))]
    pub latitude_deg: f64,
    /// Longitude, east.
    #[parameter(default = 8.545_594, check = within(-180.0..=180.0, "-180 to 180"))]
    pub longitude_deg: f64,
    /// Altitude above the sea.
    #[parameter(default = 488.0, check = within(-10_000.0..=10_000.0, "-10 000 to 10 000"))]
    pub altitude_m: f64,
    /// Direction of the world's x axis, clockwise from north: 90 is east, 0 is north.
    #[parameter(default = 90.0, check = within(-360.0..=360.0, "-360 to 360"))]
    pub x_azimuth_deg: f64,
}

impl Origin {
    /// `estimate` with position, velocity and attitude in axes east, north, up. Its standard deviations stay as they are.
    #[must_use]
    pub fn east_north_up(&self, estimate: &StateEstimate) -> StateEstimate {
        let Quaternion { x, y, z, w } = estimate.attitude;
        let attitude = self.turn().map_or(estimate.attitude, |turn| {
            let turned = turn.quaternion() * nalgebra::Quaternion::new(w, x, y, z);
            Quaternion { x: turned.i, y: turned.j, z: turned.k, w: turned.w }
        });
        let position = self.turned(estimate.position.into()).into();
        let velocity = self.turned(estimate.velocity.into()).into();
        StateEstimate { position, velocity, attitude, ..*estimate }
    }

    /// A vector of the world in axes east, north, up.
    #[must_use]
    pub fn turned(&self, vector_W: [f64; 3]) -> [f64; 3] {
        self.turn().map_or(vector_W, |turn| (turn * Vector3::from(vector_W)).into())
    }

    /// The turn from the world's axes to east, north, up; `None` if they are that.
    fn turn(&self) -> Option<UnitQuaternion<f64>> {
        let to_east_deg = (EAST_DEG - self.x_azimuth_deg).rem_euclid(360.0);
        let turn = || UnitQuaternion::from_axis_angle(&Vector3::z_axis(), to_east_deg.to_radians());
        (to_east_deg != 0.0).then(turn)
    }

    /// Longitude and latitude in degrees and altitude in metres of a position from the origin, in metres: on a sphere, about
    /// the origin.
    #[must_use]
    pub fn place(&self, position_m: [f64; 3]) -> [f64; 3] {
        let [east_m, north_m, up_m] = position_m;
        let parallel = M_PER_DEGREE * libm::cos(self.latitude_deg.to_radians());
        [
            self.longitude_deg + east_m / parallel,
            self.latitude_deg + north_m / M_PER_DEGREE,
            self.altitude_m + up_m,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axes;

    fn near(found: &[f64], expected: &[f64]) {
        let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12);
        assert!(is_near && found.len() == expected.len(), "{found:?}, expected {expected:?}");
    }

    /// A motion, its nose turned to the left by an angle.
    fn motion(yaw_deg: f64) -> StateEstimate {
        let (z, w) = libm::sincos(yaw_deg.to_radians() / 2.0);
        let attitude = Quaternion { x: 0.0, y: 0.0, z, w };
        let (position, velocity) = ([1.0, 2.0, 3.0].into(), [4.0, 5.0, 6.0].into());
        StateEstimate { position, velocity, attitude, ..StateEstimate::default() }
    }

    #[test]
    fn east_north_up_is_left_as_it_is() {
        let found = Origin::default().east_north_up(&motion(30.0));
        let given = motion(30.0);
        assert_eq!(
            (found.position, found.velocity, found.attitude),
            (given.position, given.velocity, given.attitude)
        );
    }

    #[test]
    fn north_west_up_has_its_signs() {
        let origin = Origin { x_azimuth_deg: 0.0, ..Origin::default() };
        let found = origin.east_north_up(&motion(0.0));
        near(&<[f64; 3]>::from(found.position), &[-2.0, 1.0, 3.0]);
        near(&<[f64; 3]>::from(found.velocity), &[-5.0, 4.0, 6.0]);
        near(&axes::north_east_down(found.position), &[1.0, -2.0, -3.0]);
        // The nose points north, then west; a firmware turns to the right.
        near(&axes::attitude(found.attitude), &[1.0, 0.0, 0.0, 0.0]);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        near(&axes::attitude(origin.east_north_up(&motion(90.0)).attitude), &[half, 0.0, 0.0, -half]);
        let [longitude_deg, latitude_deg, _] = origin.place(origin.turned([100.0, 0.0, 0.0]));
        assert!(latitude_deg > origin.latitude_deg && (longitude_deg - origin.longitude_deg).abs() < 1e-9);
    }

    #[test]
    fn any_other_axes_are_turned_by_their_azimuth() {
        let south = Origin { x_azimuth_deg: 180.0, ..Origin::default() };
        near(&south.turned([1.0, 2.0, 3.0]), &[2.0, -1.0, 3.0]);
        let north_east = Origin { x_azimuth_deg: 45.0, ..Origin::default() };
        let half = std::f64::consts::FRAC_1_SQRT_2;
        near(&north_east.turned([1.0, 0.0, 0.0]), &[half, half, 0.0]);
    }
}
