//! A law tried before a run, in `check`: numbers with which no vehicle can be held are found before it flies.
//!
//! The law is stepped at its own period on motions that any flight meets. Its demand has to be finite. The vehicle's
//! answer is not computed: that would be a flight.

use crate::airframe::ControlledVehicle;
use crate::bumpless::BumplessTransfer;
use crate::control::{ControlOutput, MotionEstimate};
use crate::controller_state::ControllerState;
use crate::law::Law;
use component::context::NodeContext;
use component::messages::{AttitudeEstimate, Reference, SetPoint, StateEstimate};
use component::{InputMemory, InputMessages};
use diagnostics::parameter::{ParameterError, refuse};
use diagnostics::{digits, nine_decimals};
use nalgebra::{UnitQuaternion, Vector3};

/// Steps on each motion: a filter that a step multiplies by 2 overflows before 1100 of them, and they take a
/// millisecond.
const STEPS: u32 = 1100;

/// A gain against a rate, times the period, at which the rate changes its sign and grows from step to step: of
/// w ← (1 − kT)·w, for any vehicle.
const DIVERGES: f64 = 2.0;

/// The same product from which on little is left of the phase margin: kT of 0.5 and the half period that a command is
/// held take 14° and more at the loop's own bandwidth.
const COARSE: f64 = 0.5;

/// Refuses numbers with which `law` diverges or asks for NaN; warns of a vehicle that cannot hover, and of a coarse
/// period.
///
/// # Errors
/// The failure, and the keys that may cause it.
pub(crate) fn check<L: Law>(
    law: &L,
    craft: &ControlledVehicle,
    run: &NodeContext<'_>,
) -> Result<(), ParameterError> {
    check_period(law.rate_gain_1_s(), run)?;
    warn_of_weight(craft, run);
    motions().iter().try_for_each(|motion| fly(law, craft, motion, run))
}

fn check_period(gain_1_s: f64, run: &NodeContext<'_>) -> Result<(), ParameterError> {
    let (product, hz) = (gain_1_s * run.period_s(), run.period_s().recip());
    let message = || {
        format!(
            "`gains` answer a body rate with {} 1/s, and the law computes {} times a second: their ratio is {product:.3}",
            digits(gain_1_s),
            digits(hz)
        )
    };
    refuse(product >= DIVERGES, "period_ticks", || {
        format!(
            "{}, expected below {DIVERGES}, from where on the rate grows from step to step; raise run.rate_hz, or lower \
             `period_ticks` or the gain",
            message()
        )
    })?;
    if product > COARSE {
        run.warn("gains", format!("{}, above {COARSE} little is left of the phase margin", message()));
    }
    Ok(())
}

fn warn_of_weight(craft: &ControlledVehicle, run: &NodeContext<'_>) {
    let (_, most_N) = craft.allocation.thrust_range_N(0.0);
    let weight_N = craft.vehicle.mass_kg * craft.vehicle.gravity_m_s2;
    if weight_N > most_N {
        let message = format!(
            "`vehicle` \"{}\" weighs {} N, and its rotors lift {} N at most: the law cannot hold it",
            craft.vehicle.name,
            digits(weight_N),
            digits(most_N)
        );
        run.warn("vehicle", message);
    }
}

/// At rest; tilted, turning and moving; on its back in a fall.
fn motions() -> [MotionEstimate; 3] {
    let motion = |speed_m_s: f64, tilt_rad: f64, rate_rad_s: f64| MotionEstimate {
        position_W_m: Vector3::new(0.1, -0.1, 1.0),
        velocity_W_m_s: Vector3::new(speed_m_s, -speed_m_s, speed_m_s),
        attitude_WB: UnitQuaternion::from_euler_angles(tilt_rad, -0.5 * tilt_rad, tilt_rad),
        angular_velocity_B_rad_s: Vector3::new(rate_rad_s, -rate_rad_s, rate_rad_s),
    };
    [motion(0.0, 0.0, 0.0), motion(2.0, 0.4, 1.0), motion(-20.0, 3.0, 10.0)]
}

/// Messages of a flight with `motion`: a set point, and a reference at rest at the origin. Other inputs that a law needs
/// are zero, and their attitudes level.
fn messages(motion: &MotionEstimate) -> InputMessages {
    let set_point = SetPoint { altitude: 1.5, roll: 0.1, pitch: -0.1, yaw: 0.5, ..SetPoint::default() };
    InputMessages::default()
        .with(&set_point)
        .with(&StateEstimate::from(motion))
        .with(&AttitudeEstimate::from(motion))
        .with(&Reference::default())
}

fn fly<L: Law>(
    law: &L,
    craft: &ControlledVehicle,
    motion: &MotionEstimate,
    run: &NodeContext<'_>,
) -> Result<(), ParameterError> {
    let mut memory = InputMemory::default();
    let inputs: L::Inputs<'_> = messages(motion).read(&mut memory);
    let transfer = BumplessTransfer::to::<L>(&craft.vehicle, run.period_s());
    let mut state = ControllerState::default();
    for step in 0..STEPS {
        let output = transfer.step(law, &mut state, &inputs, None);
        let speeds_rad_s = craft.allocation.allocate(&output.wrench).speeds_rad_s;
        let odd = output.not_finite().or_else(|| first_not_finite("a rotor speed", &speeds_rad_s));
        refuse(odd.is_some(), "gains", || {
            format!(
                "its numbers lead to {} after {} steps of {} s on a motion that any flight meets; `gains`, `vehicle` or \
                 run.rate_hz do not go together",
                odd.unwrap_or_default(),
                step + 1,
                nine_decimals(run.period_s())
            )
        })?;
    }
    Ok(())
}

impl ControlOutput {
    /// The first of the numbers asked for that is not finite, for a message.
    pub fn not_finite(&self) -> Option<String> {
        let (wrench, set) = (&self.wrench, &self.set_point);
        let asked: [(&str, &[f64]); 5] = [
            ("a thrust in N", &[wrench.thrust_N]),
            ("a torque in N*m", wrench.torque_B_N_m.as_slice()),
            ("a velocity set point in m/s", &self.velocity_m_s),
            ("an altitude set point in m", &[set.altitude_m]),
            ("an attitude set point in rad", &[set.roll_rad, set.pitch_rad, set.yaw_rad]),
        ];
        asked.into_iter().find_map(|(what, numbers)| first_not_finite(what, numbers))
    }
}

fn first_not_finite(what: &str, numbers: &[f64]) -> Option<String> {
    let found = numbers.iter().find(|number| !number.is_finite())?;
    Some(format!("{what} that is {found}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocation::RotorWrench;
    use crate::law::{FileParameters, LawContext, Predecessor};
    use crate::pid::{PidLaw, PidState};
    use crate::pid_gains::PidGains;
    use component::Info;
    use component::context::Warning;
    use component::messages::{Battery, Gps, PlantState, Quaternion};
    use std::path::Path;
    use vehicles::Vehicle;

    fn hummingbird(change: impl Fn(&mut Vehicle)) -> ControlledVehicle {
        let text = vehicles::reference::HUMMINGBIRD;
        let mut vehicle = Vehicle::parse(text, "hummingbird.toml").unwrap();
        change(&mut vehicle);
        ControlledVehicle::new(vehicle).unwrap()
    }

    fn checked(
        craft: &ControlledVehicle,
        gains: PidGains,
        tick_ns: u64,
    ) -> (Result<(), ParameterError>, Vec<Warning>) {
        let run = NodeContext::new("node", &[]).timed(tick_ns, 1, 1000);
        let law = PidLaw { gains, vehicle: craft.hover_model(), period_s: run.period_s() };
        let outcome = check(&law, craft, &run);
        (outcome, run.into_warnings())
    }

    #[test]
    fn a_law_that_a_rate_cannot_hold_is_refused_and_a_coarse_one_is_told() {
        let airframe = hummingbird(|_| {});
        assert_eq!(checked(&airframe, PidGains::default(), 1_000_000), (Ok(()), vec![]));
        let (outcome, warnings) = checked(&airframe, PidGains::default(), 100_000_000);
        assert!(
            outcome.is_ok() && warnings[0].message.contains("computes 10 times a second"),
            "{warnings:?}"
        );
        let message = checked(&airframe, PidGains::default(), 1_000_000_000).0.unwrap_err().to_string();
        assert!(message.contains("6 1/s") && message.contains("expected below 2"), "{message}");
    }

    #[test]
    fn a_vehicle_too_heavy_for_its_rotors_is_told_with_both_forces() {
        let (outcome, warnings) =
            checked(&hummingbird(|it| it.mass_kg = 480.0), PidGains::default(), 1_000_000);
        assert!(outcome.is_ok() && warnings[0].message.contains("weighs 4708.8 N"), "{warnings:?}");
    }

    #[test]
    fn gains_whose_products_overflow_are_refused_with_what_they_lead_to() {
        // No gains file says this: its bound lies far below.
        let mut gains = PidGains::default();
        gains.roll.proportional_1_s2 = f64::MAX;
        gains.roll.derivative_1_s = 0.0;
        let airframe = hummingbird(|it| it.inertia_kg_m2 *= 1e10);
        let message = checked(&airframe, gains, 1_000_000).0.unwrap_err().to_string();
        assert!(message.contains("lead to a torque in N*m that is"), "{message}");
    }

    /// Inputs that no other law has.
    #[derive(Debug, component::InputPorts)]
    struct BatteryInputs<'a> {
        battery: &'a Battery,
        gps: Option<&'a Gps>,
    }

    /// A law with ports of its own, which asks for 1 N for each volt.
    struct BatteryLaw;

    impl Law for BatteryLaw {
        const INFO: Info = Info::new("battery", "a law with ports of its own");
        type Parameters = FileParameters;
        type Inputs<'a> = BatteryInputs<'a>;
        type State = PidState;

        fn vehicle(parameters: &FileParameters) -> &Path {
            &parameters.vehicle
        }

        fn new(_: &FileParameters, _: &LawContext<'_>) -> Result<Self, ParameterError> {
            Ok(Self)
        }

        fn start(&self, _: Option<&Predecessor<'_, PidState>>, _: &BatteryInputs<'_>) -> PidState {
            PidState::default()
        }

        fn step(&self, _: &mut PidState, _: &RotorWrench, inputs: &BatteryInputs<'_>) -> ControlOutput {
            assert!(inputs.gps.is_none(), "no rehearsal has a receiver");
            let wrench = RotorWrench { thrust_N: inputs.battery.voltage, ..RotorWrench::default() };
            ControlOutput { wrench, ..ControlOutput::default() }
        }
    }

    #[test]
    fn a_law_with_ports_of_its_own_is_rehearsed_on_zeros_where_it_needs_a_message() {
        let run = NodeContext::new("node", &[]).timed(1_000_000, 1, 1000);
        assert_eq!(check(&BatteryLaw, &hummingbird(|_| {}), &run), Ok(()));
    }

    /// An input with an attitude that no other law has.
    #[derive(Debug, component::InputPorts)]
    struct TruthInputs<'a> {
        state: &'a PlantState,
    }

    /// A law that normalises the attitude of its input.
    struct TruthLaw;

    impl Law for TruthLaw {
        const INFO: Info = Info::new("truth", "a law that reads the true state");
        type Parameters = FileParameters;
        type Inputs<'a> = TruthInputs<'a>;
        type State = PidState;

        fn vehicle(parameters: &FileParameters) -> &Path {
            &parameters.vehicle
        }

        fn new(_: &FileParameters, _: &LawContext<'_>) -> Result<Self, ParameterError> {
            Ok(Self)
        }

        fn start(&self, _: Option<&Predecessor<'_, PidState>>, _: &TruthInputs<'_>) -> PidState {
            PidState::default()
        }

        fn step(&self, _: &mut PidState, _: &RotorWrench, inputs: &TruthInputs<'_>) -> ControlOutput {
            let Quaternion { x, y, z, w } = inputs.state.attitude;
            let thrust_N = w / (x * x + y * y + z * z + w * w);
            ControlOutput {
                wrench: RotorWrench { thrust_N, ..RotorWrench::default() },
                ..ControlOutput::default()
            }
        }
    }

    #[test]
    fn a_law_that_needs_an_attitude_is_rehearsed_on_a_level_one() {
        let run = NodeContext::new("node", &[]).timed(1_000_000, 1, 1000);
        assert_eq!(check(&TruthLaw, &hummingbird(|_| {}), &run), Ok(()));
    }
}
