//! Angles that come back to themselves after a turn.

use std::f64::consts::{PI, TAU};

/// `angle_rad` less whole turns, from −π up to but not including π.
pub fn wrap_rad(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_way_round_is_taken() {
        assert!((wrap_rad(3.0 - -3.0) - (6.0 - TAU)).abs() < 1e-12);
        assert!((wrap_rad(-7.0) - (TAU - 7.0)).abs() < 1e-12);
        assert_eq!(wrap_rad(0.0), 0.0);
    }
}
