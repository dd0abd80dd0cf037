//! The thesis's free flight (§5.5, States 1 to 5): a tilt by the distance to the wall ahead, and nothing else.
//!
//! "The pitch angle command is the function of the distance to the wall […] and decreases as it got closer to the wall."
//! The thesis does not give the function; here it is the simplest. The tilt is full as long as the distance
//! still to go is `fall_m` or more. Below, it falls in proportion to that distance, to zero. No loop is
//! closed over the velocity, so that without drag it rises all the way to the reference distance.

use diagnostics::unit::LENGTH;

gains! {
    /// Fall of the tilt with the distance.
    pub struct FreeFlight of file {
        /// The distance still to go over which it falls from the full one to none, m.
        fall_m: f64 = file.limit("fall", LENGTH),
    }
}

impl FreeFlight {
    /// The acceleration that the tilt at `to_go_m` makes at constant height, where the full tilt is `full_rad`, m/s².
    pub(crate) fn acceleration_m_s2(&self, to_go_m: f64, full_rad: f64, gravity_m_s2: f64) -> f64 {
        gravity_m_s2 * libm::tan(full_rad * (to_go_m / self.fall_m).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tilt_falls_with_the_distance_from_the_full_one_to_none() {
        let flight = FreeFlight { fall_m: 4.0 };
        let tilt_rad = |to_go_m| libm::atan(flight.acceleration_m_s2(to_go_m, 0.02, 9.81) / 9.81);
        for (to_go_m, expected_rad) in
            [(9.0, 0.02), (4.0, 0.02), (2.0, 0.01), (1.0, 0.005), (0.0, 0.0), (-1.0, 0.0)]
        {
            assert!((tilt_rad(to_go_m) - expected_rad).abs() < 1e-12, "{to_go_m} m");
        }
    }
}
