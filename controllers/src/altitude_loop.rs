//! The altitude PID that `pid` and all laws with the cascade's inner loops share: height to thrust.

use crate::airframe::HoverModel;
use crate::control::{HoverMotion, Integrals, within};
use crate::law::Predecessor;
use diagnostics::unit::{ACCELERATION, PER_SECOND, PER_SECOND_2, PER_SECOND_3, VELOCITY};
use serde::{Deserialize, Serialize};

/// The least cosine of the tilt that is compensated: beyond 60° more thrust would push sideways rather
/// than up. Tuned, no source.
const TILT_COSINE_MIN: f64 = 0.5;

gains! {
    /// The gains of one loop, from an error to an acceleration (linear: m/s², angular: rad/s²).
    #[derive(Deserialize, Serialize)]
    #[serde(deny_unknown_fields)]
    pub struct LoopGains of file {
        /// Acceleration for each unit of error, 1/s².
        proportional_1_s2: f64 = file.gain("proportional", PER_SECOND_2),
        /// Acceleration for each unit of error held for one second, 1/s³.
        integral_1_s3: f64 = file.gain("integral", PER_SECOND_3),
        /// Acceleration against each unit of measured rate, 1/s.
        derivative_1_s: f64 = file.gain("derivative", PER_SECOND),
    }
}

impl LoopGains {
    /// The acceleration that the loop asks for.
    pub(crate) fn demand(&self, error: f64, integral: f64, rate: f64) -> f64 {
        self.proportional_1_s2 * error + integral - self.derivative_1_s * rate
    }

    /// The integrator's acceleration `period_s` on, kept within ±`max`.
    pub(crate) fn integrate(&self, before: f64, error: f64, period_s: f64, max: f64) -> f64 {
        (before + self.integral_1_s3 * error * period_s).clamp(-max, max)
    }
}

gains! {
    /// Gains and limits of the altitude loop.
    pub struct AltitudeGains of file {
        /// Error of height (m) and rate of climb (m/s) to vertical acceleration (m/s²).
        loop_gains: LoopGains = LoopGains::read(file),
        /// The integrator rests while the vehicle climbs or sinks faster than this, m/s. Without it a step of
        /// 0.5 m leaves the integrator a surplus that takes Kp/Ki to decay; a limit on the error instead would
        /// lock it out when the weight is far off.
        integral_climb_max_m_s: f64 = file.limit("integral_climb_max", VELOCITY),
        /// The most that the integrator may ask for, m/s².
        integral_max_m_s2: f64 = file.gain("integral_max", ACCELERATION),
    }
}

/// The loop at one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AltitudeLoop<'a> {
    /// Gains and limits.
    pub gains: AltitudeGains,
    /// The vehicle that is flown.
    pub vehicle: &'a HoverModel,
    /// Time between two steps, s.
    pub period_s: f64,
}

impl AltitudeLoop<'_> {
    /// Thrust = m·(g + a) / (cos φ·cos θ): eq. 3.19 with its denominator corrected, where a is the
    /// acceleration that the loop asks for. `integral_m_s2` advances by one period.
    pub fn thrust_N(&self, integral_m_s2: &mut f64, altitude_set_m: f64, measured: &HoverMotion) -> f64 {
        let error_m = altitude_set_m - measured.altitude_m;
        let advanced_m_s2 = self.advanced_m_s2(*integral_m_s2, error_m, measured.climb_rate_m_s);
        let acceleration_m_s2 = self.gains.loop_gains.demand(error_m, advanced_m_s2, measured.climb_rate_m_s);
        let wanted_N =
            self.vehicle.mass_kg * (self.vehicle.gravity_m_s2 + acceleration_m_s2) / tilt_cosine(measured);
        // Upside down, all thrust pushes down.
        let wanted_N = if is_upside_down(measured) { self.vehicle.thrust_min_N } else { wanted_N };
        let thrust_N = wanted_N.clamp(self.vehicle.thrust_min_N, self.vehicle.thrust_max_N);
        // Against wind-up: at a limit the integrator may only come back from it.
        if (wanted_N - thrust_N) * error_m <= 0.0 {
            *integral_m_s2 = advanced_m_s2;
        }
        thrust_N
    }

    /// Returns the integrals after another law: those of the other, where this law has a gain for them. If only its
    /// last thrust is known, the lift is chosen so that the loop asks for that thrust. `turn_gains` and
    /// `turn_max_rad_s2` are those of the law's own attitude loops.
    pub fn continued<S>(
        &self,
        from: &Predecessor<'_, S>,
        turn_gains: [f64; 3],
        turn_max_rad_s2: f64,
        altitude_set_m: f64,
        measured: &HoverMotion,
    ) -> Integrals {
        let max_m_s2 = self.gains.integral_max_m_s2;
        let lift = from.integrals.map_or_else(
            || within(self.missing_m_s2(from.wrench.thrust_N, altitude_set_m, measured), max_m_s2),
            |before| within(before.lift, max_m_s2),
        );
        let before = from.integrals.unwrap_or_default();
        // An integrator without gain would keep for ever what it was given.
        let turn = std::array::from_fn(|axis| {
            if turn_gains[axis] > 0.0 { within(before.turn[axis], turn_max_rad_s2) } else { 0.0 }
        });
        Integrals { lift, turn }
    }

    /// The acceleration that the loop lacks to ask for `thrust_N`.
    fn missing_m_s2(&self, thrust_N: f64, altitude_set_m: f64, measured: &HoverMotion) -> f64 {
        let still = Self { period_s: 0.0, ..*self };
        let missing_N = thrust_N - still.thrust_N(&mut 0.0, altitude_set_m, measured);
        missing_N * tilt_cosine(measured) / self.vehicle.mass_kg
    }

    fn advanced_m_s2(&self, before_m_s2: f64, error_m: f64, climb_rate_m_s: f64) -> f64 {
        if climb_rate_m_s.abs() > self.gains.integral_climb_max_m_s {
            return before_m_s2;
        }
        let max_m_s2 = self.gains.integral_max_m_s2;
        self.gains.loop_gains.integrate(before_m_s2, error_m, self.period_s, max_m_s2)
    }
}

/// True if body z points down.
fn is_upside_down(measured: &HoverMotion) -> bool {
    libm::cos(measured.roll_rad) * libm::cos(measured.pitch_rad) < 0.0
}

/// The cosine of the angle between body z and world z, not below [`TILT_COSINE_MIN`].
fn tilt_cosine(measured: &HoverMotion) -> f64 {
    (libm::cos(measured.roll_rad) * libm::cos(measured.pitch_rad)).max(TILT_COSINE_MIN)
}
