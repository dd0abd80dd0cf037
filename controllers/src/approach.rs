//! Speed of the approach to a wall: from the distance still to go to a velocity.
//!
//! Near the end the velocity is proportional to the distance, v = k·e; further away it is that from which the
//! deceleration a stops in time, v = √(2a·(e − a/2k²)). The two meet at e = a/k² with the same slope, so that
//! the acceleration that braking takes, −v·dv/de, has no step there.
use diagnostics::unit::{ACCELERATION, PER_SECOND};

gains! {
    /// The curve: slope and deceleration above zero.
    pub struct Approach of file {
        /// k, 1/s.
        slope_1_s: f64 = file.limit("slope", PER_SECOND),
        /// a, m/s².
        deceleration_m_s2: f64 = file.limit("deceleration", ACCELERATION),
    }
}

impl Approach {
    /// The velocity towards a place that is `distance_m` away; away from it where that is negative.
    pub fn speed_m_s(&self, distance_m: f64) -> f64 {
        let (k, a, away_m) = (self.slope_1_s, self.deceleration_m_s2, distance_m.abs());
        let speed_m_s =
            if away_m < a / (k * k) { k * away_m } else { (2.0 * a * (away_m - 0.5 * a / (k * k))).sqrt() };
        speed_m_s.copysign(distance_m)
    }

    /// The distance at which the velocity is `speed_m_s`.
    pub fn distance_m(&self, speed_m_s: f64) -> f64 {
        let (k, a, v) = (self.slope_1_s, self.deceleration_m_s2, speed_m_s);
        if v < a / k { v / k } else { v * v / (2.0 * a) + 0.5 * a / (k * k) }
    }

    /// The rate of change of [`Self::speed_m_s`] while the distance shrinks by `closing_m_s`: the acceleration
    /// of a vehicle that follows the curve.
    pub fn acceleration_m_s2(&self, distance_m: f64, closing_m_s: f64) -> f64 {
        let (k, a, away_m) = (self.slope_1_s, self.deceleration_m_s2, distance_m.abs());
        let slope_1_s = if away_m < a / (k * k) { k } else { a / self.speed_m_s(away_m) };
        -slope_1_s * closing_m_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CURVE: Approach = Approach { slope_1_s: 0.9, deceleration_m_s2: 0.7 };

    #[test]
    fn speed_and_distance_are_inverses_on_both_branches() {
        for distance_m in [0.0, 0.1, 0.7 / 0.81, 1.0, 4.65] {
            assert!((CURVE.distance_m(CURVE.speed_m_s(distance_m)) - distance_m).abs() < 1e-12);
            assert_eq!(CURVE.speed_m_s(-distance_m), -CURVE.speed_m_s(distance_m));
        }
    }

    #[test]
    fn the_branches_meet_with_the_same_speed_and_slope() {
        let corner_m = 0.7 / 0.81;
        let (before_m, after_m) = (corner_m - 1e-9, corner_m + 1e-9);
        assert!((CURVE.speed_m_s(before_m) - CURVE.speed_m_s(after_m)).abs() < 1e-8);
        let [before, after] = [before_m, after_m].map(|at_m| CURVE.acceleration_m_s2(at_m, 1.0));
        assert!((before - after).abs() < 1e-6);
    }

    #[test]
    fn following_the_curve_takes_no_more_than_its_deceleration() {
        for distance_m in [0.01, 0.5, 0.9, 2.0, 4.0] {
            let speed_m_s = CURVE.speed_m_s(distance_m);
            let braking_m_s2 = -CURVE.acceleration_m_s2(distance_m, speed_m_s);
            assert!(braking_m_s2 > 0.0 && braking_m_s2 < CURVE.deceleration_m_s2 + 1e-12);
        }
    }
}
