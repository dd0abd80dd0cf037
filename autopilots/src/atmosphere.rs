//! The standard atmosphere below 11 km (ISO 2533), for simulated barometers.

/// Pressure at sea level, Pa, its decrease by height, 1/m, and the exponent.
const PRESSURE: (f64, f64, f64) = (101_325.0, 2.255_77e-5, 5.255_88);
/// Temperature at sea level, degrees Celsius, and its decrease by height, 1/m.
const TEMPERATURE: (f64, f64) = (15.0, 6.5e-3);

/// Altitudes at which it holds, m: from the lowest that the standard has to the tropopause.
const ALTITUDES_M: (f64, f64) = (-2000.0, 11_000.0);

/// Pressure at an altitude above the sea, Pa; beyond the altitudes at which the standard holds, that at the nearest of them.
#[must_use]
pub fn pressure_Pa(altitude_m: f64) -> f64 {
    let (sea_level_Pa, by_height_1_m, exponent) = PRESSURE;
    let altitude_m = altitude_m.clamp(ALTITUDES_M.0, ALTITUDES_M.1);
    sea_level_Pa * libm::pow(1.0 - by_height_1_m * altitude_m, exponent)
}

/// Temperature at an altitude above the sea, degrees Celsius.
#[must_use]
pub fn temperature_degC(altitude_m: f64) -> f64 {
    let (sea_level_degC, by_height_degC_m) = TEMPERATURE;
    sea_level_degC - by_height_degC_m * altitude_m.clamp(ALTITUDES_M.0, ALTITUDES_M.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ISO 2533: 95.46 kPa and 11.75 degrees at 500 m.
    #[test]
    fn the_standards_table_is_met() {
        assert!((pressure_Pa(500.0) - 95_461.0).abs() < 5.0, "{}", pressure_Pa(500.0));
        assert!((temperature_degC(500.0) - 11.75).abs() < 1e-9);
        assert_eq!(pressure_Pa(60_000.0), pressure_Pa(11_000.0), "no power of a negative number");
    }
}
