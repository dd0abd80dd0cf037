//! One comparison of a simulated state with a measured one, at the ends of windows as they pass.

use super::figures::WindowFigures;
use super::signals::{Signal, Signals};
use crate::states::{FIELDS_OF_POSE, names_of_state};
use flights::state::{StateQuantity, VehicleState, WindowEndErrors};
use recorder::RecordingError;
use recorder::fields::TopicFields;
use runtime::manifest::Comparison;

/// A comparison and the errors so far.
#[derive(Debug)]
pub struct Windows {
    simulated: Vec<Signal>,
    measured: Vec<Signal>,
    window_ns: u64,
    errors: WindowEndErrors,
}

impl Windows {
    /// The comparison `compare`, of whose topics no sample has come yet.
    ///
    /// # Errors
    /// As `open` says.
    pub fn new(
        compare: &Comparison,
        signals: &mut Signals,
        open: &mut dyn FnMut(&str) -> Result<TopicFields, RecordingError>,
    ) -> Result<Self, RecordingError> {
        let mut state = |topic: &str| -> Result<Vec<Signal>, RecordingError> {
            names_of_state().take(FIELDS_OF_POSE).map(|field| signals.signal(topic, &field, open)).collect()
        };
        let (simulated, measured) = (state(&compare.simulated)?, state(&compare.measured)?);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a positive time of a run"
        )]
        let window_ns = (compare.window_s * 1e9).round() as u64;
        Ok(Self { simulated, measured, window_ns, errors: WindowEndErrors::default() })
    }

    /// Ends the tick at `time_ns`, all of whose samples `signals` has.
    pub fn end_tick(&mut self, signals: &Signals, time_ns: u64) {
        let is_end = time_ns > 0 && self.window_ns > 0 && time_ns.is_multiple_of(self.window_ns);
        if is_end
            && let Some(simulated) = state(signals, &self.simulated)
            && let Some(measured) = state(signals, &self.measured)
        {
            self.errors.add(&simulated, &measured);
        }
    }

    /// The errors so far.
    pub fn kept(&self) -> WindowEndErrors {
        self.errors.clone()
    }

    /// Goes on from the errors `kept`.
    pub fn go_on(&mut self, kept: WindowEndErrors) {
        self.errors = kept;
    }

    /// The errors of all windows.
    pub fn finish(&self) -> WindowFigures {
        let [position_rms_m, velocity_rms_m_s, attitude_rms_deg, _] =
            StateQuantity::ALL.map(|quantity| self.errors.rms(quantity));
        let windows = self.errors.windows();
        WindowFigures { windows, position_rms_m, velocity_rms_m_s, attitude_rms_deg }
    }
}

/// The state that was sent at the tick under way, its rates left out.
fn state(signals: &Signals, fields: &[Signal]) -> Option<VehicleState> {
    let mut values = [0.0; FIELDS_OF_POSE];
    for (value, field) in values.iter_mut().zip(fields) {
        *value = signals.fresh(*field)?.first().copied()?;
    }
    let [px, py, pz, vx, vy, vz, qx, qy, qz, qw] = values;
    Some(VehicleState {
        position_W_m: [px, py, pz],
        velocity_W_m_s: [vx, vy, vz],
        attitude_WB: [qx, qy, qz, qw],
        angular_velocity_B_rad_s: [0.0; 3],
    })
}
