//! The acceleration that the model does not explain: drag, wind, an error of mass or thrust.
//!
//! A Luenberger observer (K. J. Åström and R. M. Murray, "Feedback Systems", section 8.2) estimates the
//! velocity: v̂′ = a + d̂ + 2ω·(v − v̂) and d̂′ = ω²·(v − v̂). a is the acceleration by the foreseen thrust
//! of the rotors at the estimated attitude. Both of its poles lie at ω. Where the model holds, d̂ stays zero
//! however the vehicle is steered, so it takes nothing from the margins of the loop that it serves. Against
//! the disturbance it does an integrator's work without an integrator's overshoot.

use crate::control::MotionEstimate;
use diagnostics::unit::ACCELERATION;
use nalgebra::Vector3;

gains! {
    /// The observer's one number and its limit.
    pub struct Observer of file {
        /// ω, rad/s.
        bandwidth_rad_s: f64 = file.bandwidth("bandwidth"),
        /// The most that it believes along an axis of the world, m/s².
        acceleration_max_m_s2: f64 = file.limit("acceleration_max", ACCELERATION),
    }
}

/// State of the observer.
#[derive(Debug, Clone, Copy, PartialEq, Default, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ObserverState")]
pub struct ObserverState {
    /// −d̂: the acceleration that answers the disturbance, as an integrator's would.
    #[field(unit = "m/s^2", frame = "world")]
    pub answer: [f64; 3],
    /// Velocity that was foreseen for now, against which disturbances show.
    #[field(unit = "m/s", frame = "world")]
    pub velocity_foreseen: [f64; 3],
}

/// Estimate of the observer, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// d̂.
    pub acceleration_W_m_s2: Vector3<f64>,
    /// Its rate of change.
    pub jerk_W_m_s3: Vector3<f64>,
}

impl Observer {
    /// The disturbance now, where the model explains `model_W_m_s2`; advances the state by one period.
    pub fn step(
        &self,
        state: &mut ObserverState,
        motion: &MotionEstimate,
        model_W_m_s2: &Vector3<f64>,
        period_s: f64,
    ) -> Disturbance {
        let (omega, max_m_s2) = (self.bandwidth_rad_s, self.acceleration_max_m_s2);
        let before_W_m_s = Vector3::from(state.velocity_foreseen);
        let missed_W_m_s = motion.velocity_W_m_s - before_W_m_s;
        let free_W_m_s2 = missed_W_m_s * (omega * omega * period_s) - Vector3::from(state.answer);
        let acceleration_W_m_s2 = free_W_m_s2.map(|along| along.clamp(-max_m_s2, max_m_s2));
        let slope_W_m_s2 = model_W_m_s2 + acceleration_W_m_s2 + missed_W_m_s * (2.0 * omega);
        state.answer = (-acceleration_W_m_s2).into();
        state.velocity_foreseen = (before_W_m_s + slope_W_m_s2 * period_s).into();
        // At its limit it does not move.
        let jerk_W_m_s3 = (missed_W_m_s * (omega * omega))
            .zip_map(&acceleration_W_m_s2, |along, held| if held.abs() < max_m_s2 { along } else { 0.0 });
        Disturbance { acceleration_W_m_s2, jerk_W_m_s3 }
    }
}

impl ObserverState {
    /// An observer that begins at this motion, without a disturbance.
    pub fn at(motion: &MotionEstimate) -> Self {
        Self { answer: [0.0; 3], velocity_foreseen: motion.velocity_W_m_s.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    const OBSERVER: Observer = Observer { bandwidth_rad_s: 5.0, acceleration_max_m_s2: 3.0 };

    fn moving(velocity_W_m_s: Vector3<f64>) -> MotionEstimate {
        let zero = Vector3::zeros();
        let attitude_WB = UnitQuaternion::identity();
        MotionEstimate { position_W_m: zero, velocity_W_m_s, attitude_WB, angular_velocity_B_rad_s: zero }
    }

    /// Returns the estimate after `time_s` of `true_W_m_s2`, with 1 m/s² along x by the model.
    fn believed(true_W_m_s2: Vector3<f64>, time_s: f64) -> Vector3<f64> {
        let mut velocity_W_m_s = Vector3::zeros();
        let mut state = ObserverState::at(&moving(velocity_W_m_s));
        let mut believed = Vector3::zeros();
        for _ in 0..(time_s * 1e3) as usize {
            believed =
                OBSERVER.step(&mut state, &moving(velocity_W_m_s), &Vector3::x(), 1e-3).acceleration_W_m_s2;
            velocity_W_m_s += true_W_m_s2 * 1e-3;
        }
        believed
    }

    #[test]
    fn what_the_model_explains_is_no_disturbance_and_what_it_does_not_is_found() {
        assert!(believed(Vector3::x(), 1.0).norm() < 1e-12);
        let found = believed(Vector3::new(1.0, 0.5, -0.2), 3.0);
        assert!((found - Vector3::new(0.0, 0.5, -0.2)).norm() < 1e-3, "{found}");
    }

    /// The answer to a step of a system with both poles at ω: 1 − (1 + ω·t)·e^(−ω·t).
    #[test]
    fn a_step_is_found_with_the_stated_bandwidth() {
        let part = believed(Vector3::new(1.0, 1.0, 0.0), 0.3).y;
        assert!((part - (1.0 - 2.5 * libm::exp(-1.5))).abs() < 5e-3, "{part}");
    }

    #[test]
    fn it_believes_no_more_than_its_limit() {
        assert_eq!(believed(Vector3::new(1.0, 50.0, 0.0), 2.0).y, 3.0);
    }
}
