//! Pressure and height in the standard atmosphere.
//!
//! Below 11 km the temperature falls linearly. Hydrostatic balance of an ideal gas then gives p = p₀ (1 − L h
//! / T₀)^(g M / (R L)) (ISO 2533:1975, "Standard Atmosphere", §2.7).

/// Pressure at sea level, Pa (ISO 2533).
pub const SEA_LEVEL_PRESSURE_PA: f64 = 101_325.0;
/// Temperature at sea level, K (ISO 2533).
const TEMPERATURE_K: f64 = 288.15;
/// Fall of the temperature with height, K/m (ISO 2533).
const LAPSE_K_M: f64 = 6.5e-3;
/// g M / (R L): 9.80665 m/s² · 0.0289644 kg/mol / (8.31432 J/(mol K) · 0.0065 K/m) (ISO 2533).
const EXPONENT: f64 = 9.806_65 * 0.028_964_4 / (8.314_32 * LAPSE_K_M);

/// The pressure, Pa, `height_m` above where it is `ground_pressure_Pa`; zero above 44 km, where the formula ends.
pub fn pressure_Pa(height_m: f64, ground_pressure_Pa: f64) -> f64 {
    ground_pressure_Pa * libm::pow((1.0 - LAPSE_K_M * height_m / TEMPERATURE_K).max(0.0), EXPONENT)
}

/// The height, m, above where the pressure is `reference_pressure_Pa`, at which it is `pressure_Pa`.
pub fn height_m(pressure_Pa: f64, reference_pressure_Pa: f64) -> f64 {
    TEMPERATURE_K / LAPSE_K_M * (1.0 - libm::pow(pressure_Pa / reference_pressure_Pa, EXPONENT.recip()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pressures_are_those_of_the_standard_s_table() {
        // ISO 2533, table 5: hPa at 0, 1000, 5000 and 11000 m of geopotential height.
        for (at_m, expected_hPa) in [(0.0, 1013.25), (1000.0, 898.746), (5000.0, 540.199), (11000.0, 226.321)]
        {
            let found_hPa = pressure_Pa(at_m, SEA_LEVEL_PRESSURE_PA) / 100.0;
            assert!((found_hPa - expected_hPa).abs() < 2e-3, "{found_hPa} {expected_hPa}");
        }
    }

    #[test]
    fn height_is_the_inverse_of_pressure() {
        for at_m in [-400.0, -1.0, 0.0, 0.01, 1.5, 120.0, 3000.0, 10_000.0] {
            let found_m = height_m(pressure_Pa(at_m, 98_000.0), 98_000.0);
            assert!((found_m - at_m).abs() < 1e-8, "{found_m} {at_m}");
        }
    }

    #[test]
    fn beyond_the_end_of_the_formula_nothing_is_infinite() {
        assert_eq!(pressure_Pa(1e6, SEA_LEVEL_PRESSURE_PA), 0.0);
        assert!(height_m(0.0, SEA_LEVEL_PRESSURE_PA).is_finite());
    }
}
