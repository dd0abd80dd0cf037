//! The earth's magnetic field at the world's origin, for the simulated compass.

use bus::messages::Quaternion;
use diagnostics::parameter::within;
use nalgebra::{UnitQuaternion, Vector3};

/// Strongest field that is meant, T: three times that of the earth.
const FIELD_MAX_T: f64 = 2e-4;

/// Magnetic field of the earth; by default that of the default origin at the beginning of 2025, from the World Magnetic Model 2025
/// (NOAA NCEI and BGS).
#[derive(Clone, Copy, Debug, PartialEq, bus::Parameters)]
#[parameters(default)]
pub struct MagneticField {
    /// Magnetic flux density.
    #[parameter(default = 48.318e-6, check = within(0.0..=FIELD_MAX_T, "0 to 2e-4"))]
    pub field_T: f64,
    /// Inclination below the horizon.
    #[parameter(default = 63.50, check = within(-90.0..=90.0, "-90 to 90"))]
    pub inclination_deg: f64,
    /// Declination: angle of magnetic north east of geographic north.
    #[parameter(default = 3.42, check = within(-180.0..=180.0, "-180 to 180"))]
    pub declination_deg: f64,
}

impl MagneticField {
    /// The field in the body at `attitude`: x forward, y left, z up, T.
    #[must_use]
    pub fn vector_B_T(&self, attitude: Quaternion) -> [f64; 3] {
        let (down, level) = libm::sincos(self.inclination_deg.to_radians());
        let (east, north) = libm::sincos(self.declination_deg.to_radians());
        let field_W_T = self.field_T * Vector3::new(level * east, level * north, -down);
        let Quaternion { x, y, z, w } = attitude;
        let attitude = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        attitude.inverse_transform_vector(&field_W_T).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_points_north_and_down_in_the_body() {
        let field = MagneticField { field_T: 5e-5, inclination_deg: 60.0, declination_deg: 0.0 };
        let near = |attitude: UnitQuaternion<f64>, expected_T: [f64; 3]| {
            let quaternion = Quaternion { x: attitude.i, y: attitude.j, z: attitude.k, w: attitude.w };
            let found_T = field.vector_B_T(quaternion);
            let is_near =
                found_T.iter().zip(expected_T).all(|(found, expected)| (found - expected).abs() < 1e-9);
            assert!(is_near, "{found_T:?}, expected {expected_T:?}");
        };
        let down_T = -5e-5 * libm::sin(60_f64.to_radians());
        let about = |axis, angle_deg: f64| UnitQuaternion::from_axis_angle(&axis, angle_deg.to_radians());
        // The nose points east, then north, then the left side points down.
        near(UnitQuaternion::identity(), [0.0, 2.5e-5, down_T]);
        near(about(Vector3::z_axis(), 90.0), [2.5e-5, 0.0, down_T]);
        near(about(Vector3::x_axis(), -90.0), [0.0, -down_T, 2.5e-5]);
        let east = MagneticField { declination_deg: 90.0, ..field }
            .vector_B_T(Quaternion { w: 1.0, ..Quaternion::default() });
        assert!((east[0] - 2.5e-5).abs() < 1e-9, "{east:?}: an eastern declination");
    }
}
