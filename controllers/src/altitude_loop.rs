//! The altitude PID that `pid` and all laws with the cascade's inner loops share: height to thrust.
#![allow(non_snake_case, reason = "a trailing _N is the newton")]

use crate::controller::{ControllerState, within};
use crate::gains_file;
use crate::pid_gains::LoopGains;
use crate::pid_law::{Measurement, PidVehicle};
use vehicles::VehicleError;
use vehicles::reader::Section;
use vehicles::units::{ACCELERATION, VELOCITY};

/// The least cosine of the tilt that is compensated: beyond 60° more thrust would push sideways rather
/// than up. Tuned, no source.
const TILT_COSINE_MIN: f64 = 0.5;

/// Gains and limits of the altitude loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AltitudeGains {
    /// Error of height (m) and rate of climb (m/s) to vertical acceleration (m/s²).
    pub loop_gains: LoopGains,
    /// The integrator rests while the vehicle climbs or sinks faster than this, m/s. Without it a step of
    /// 0.5 m leaves the integrator a surplus that takes Kp/Ki to decay; a limit on the error instead would
    /// lock it out when the weight is far off.
    pub integral_climb_max_m_s: f64,
    /// The most that the integrator may ask for, m/s².
    pub integral_max_m_s2: f64,
}

impl AltitudeGains {
    /// The table `altitude` of a gains file.
    pub(crate) fn read(section: &Section<'_, '_>) -> Result<Self, VehicleError> {
        let gains = Self {
            loop_gains: LoopGains::read(section)?,
            integral_climb_max_m_s: gains_file::limit(section, "integral_climb_max", VELOCITY)?,
            integral_max_m_s2: gains_file::gain(section, "integral_max", ACCELERATION)?,
        };
        section.finish()?;
        Ok(gains)
    }
}

/// The loop at one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AltitudeLoop<'a> {
    /// Gains and limits.
    pub gains: AltitudeGains,
    /// The vehicle that is flown.
    pub vehicle: &'a PidVehicle,
    /// Time between two steps, s.
    pub period_s: f64,
}

impl AltitudeLoop<'_> {
    /// Thrust = m·(g + a) / (cos φ·cos θ): eq. 3.19 with its denominator corrected, where a is the
    /// acceleration that the loop asks for. `integral_m_s2` advances by one period.
    #[must_use]
    pub fn thrust_N(&self, integral_m_s2: &mut f64, altitude_set_m: f64, measured: &Measurement) -> f64 {
        let error_m = altitude_set_m - measured.altitude_m;
        let advanced_m_s2 = self.advanced_m_s2(*integral_m_s2, error_m, measured.climb_rate_m_s);
        let acceleration_m_s2 = self.gains.loop_gains.demand(error_m, advanced_m_s2, measured.climb_rate_m_s);
        let wanted_N =
            self.vehicle.mass_kg * (self.vehicle.gravity_m_s2 + acceleration_m_s2) / tilt_cosine(measured);
        let thrust_N = wanted_N.clamp(self.vehicle.thrust_min_N, self.vehicle.thrust_max_N);
        // Against wind-up: at a limit the integrator may only come back from it.
        if (wanted_N - thrust_N) * error_m <= 0.0 {
            *integral_m_s2 = advanced_m_s2;
        }
        thrust_N
    }

    /// What the integrator asks for after a take-over: what the predecessor's asked for, or, where only its last
    /// thrust is known, what it takes to ask for that.
    #[must_use]
    pub fn taken_over_m_s2(
        &self,
        memory: &ControllerState,
        thrust_N: f64,
        altitude_set_m: f64,
        measured: &Measurement,
    ) -> f64 {
        let max_m_s2 = self.gains.integral_max_m_s2;
        memory.handed_lift_m_s2(max_m_s2).unwrap_or_else(|| {
            let still = Self { period_s: 0.0, ..*self };
            let missing_N = thrust_N - still.thrust_N(&mut 0.0, altitude_set_m, measured);
            within(missing_N * tilt_cosine(measured) / self.vehicle.mass_kg, max_m_s2)
        })
    }

    fn advanced_m_s2(&self, before_m_s2: f64, error_m: f64, climb_rate_m_s: f64) -> f64 {
        if climb_rate_m_s.abs() > self.gains.integral_climb_max_m_s {
            return before_m_s2;
        }
        let max_m_s2 = self.gains.integral_max_m_s2;
        self.gains.loop_gains.integrate(before_m_s2, error_m, self.period_s, max_m_s2)
    }
}

/// The cosine of the angle between body z and world z, not below [`TILT_COSINE_MIN`].
fn tilt_cosine(measured: &Measurement) -> f64 {
    (libm::cos(measured.roll_rad) * libm::cos(measured.pitch_rad)).max(TILT_COSINE_MIN)
}
