//! Conversions from the units in which data sheets give noise to SI units.

/// The gravity by which data sheets convert g to m/s² (standard gravity, CGPM 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// An accelerometer's noise density in m/s²/√Hz from µg/√Hz.
#[must_use]
pub fn density_m_s2_sqrt_hz(density_ug_sqrt_hz: f64) -> f64 {
    density_ug_sqrt_hz * 1e-6 * STANDARD_GRAVITY_M_S2
}

/// A gyroscope's noise density in rad/s/√Hz from °/s/√Hz.
#[must_use]
pub fn density_rad_s_sqrt_hz(density_deg_s_sqrt_hz: f64) -> f64 {
    density_deg_s_sqrt_hz.to_radians()
}

/// A gyroscope's noise density in rad/s/√Hz from its angular random walk in °/√h.
///
/// The two name the same white noise: 1 h is 3600 s and 1 rad/√s is 1 rad/s/√Hz.
#[must_use]
pub fn density_from_random_walk_rad_s_sqrt_hz(random_walk_deg_sqrt_h: f64) -> f64 {
    random_walk_deg_sqrt_h.to_radians() / 60.0
}

/// An acceleration in m/s² from g.
#[must_use]
pub fn acceleration_m_s2(acceleration_g: f64) -> f64 {
    acceleration_g * STANDARD_GRAVITY_M_S2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_near(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-4, "expected {expected}, found {found}");
    }

    // The expected numbers were worked out by hand from data-sheet figures.
    #[test]
    fn data_sheet_figures_convert_to_si() {
        assert_near(density_m_s2_sqrt_hz(400.0), 3.922_66e-3);
        assert_near(density_rad_s_sqrt_hz(0.005), 8.726_65e-5);
        assert_near(density_from_random_walk_rad_s_sqrt_hz(0.66), 1.919_86e-4);
        assert_near(acceleration_m_s2(18.0), 176.5197);
    }
}
