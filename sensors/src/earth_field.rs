//! The earth's magnetic field in the world, whose x axis points to geographic north where magnetometers are used.

use nalgebra::Vector3;

/// Magnetic flux density in Krailling near Munich, where the Hummingbird was made, T: 48.09° N, 11.41° E, 550 m, at the
/// beginning of 2025, from the World Magnetic Model 2025 (NOAA NCEI and BGS).
pub const FIELD_T: f64 = 48.709e-6;
/// Inclination of the field there, below the horizon, degrees.
pub const INCLINATION_DEG: f64 = 64.33;
/// Declination there: angle of magnetic north east of geographic north, degrees.
pub const DECLINATION_DEG: f64 = 4.11;

/// The field in the world: x north, y west, z up. An eastern declination turns it clockwise seen from above.
pub fn vector_W_T(field_T: f64, inclination_deg: f64, declination_deg: f64) -> Vector3<f64> {
    let (down, level) = libm::sincos(inclination_deg.to_radians());
    let (east, north) = libm::sincos(declination_deg.to_radians());
    field_T * Vector3::new(level * north, -level * east, -down)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_has_the_components_of_the_model() {
        // North, east and down as the World Magnetic Model states them beside the angles, in nT.
        let expected = Vector3::new(21_044.6, -1_511.7, -43_902.2) * 1e-9;
        assert!((vector_W_T(FIELD_T, INCLINATION_DEG, DECLINATION_DEG) - expected).norm() < 1e-8);
    }

    #[test]
    fn declination_turns_the_level_part_clockwise_and_leaves_the_rest() {
        let at = |declination_deg| vector_W_T(FIELD_T, INCLINATION_DEG, declination_deg);
        let (north, east) = (at(0.0), at(90.0));
        assert_eq!(north.y, 0.0);
        assert!(north.x > 0.0 && (east.y + north.x).abs() < 1e-18 && east.x.abs() < 1e-18);
        assert_eq!(north.z, east.z);
    }
}
