//! A thrust stand: one rotor of a vehicle, bolted down, and what a force and torque sensor under its motor reads.
//!
//! The thesis turns its propeller alone on a cube at 3900 rpm (Fig 4.4), and plots thrust and torque against the speed
//! (Fig 4.3). Thrust and drag torque are those of [`rotor`](crate::rotor), the lag is that of the motor; of the vehicle
//! file's effects none acts, as nothing flies. The sensors read the truth, as the thesis states no error, or have white
//! noise: of the force, of the torque, and of the speed.

use crate::airworthy;
use crate::motor;
use crate::rotor::{drag_torque_N_m, thrust_N};
use crate::state::RotorState;
use component::context::{NodeContext, StepContext};
use component::messages::Time;
use component::random::{self, Stream, normal, stream};
use component::{Component, Info, Message, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, not_negative, refuse, require};
use std::f64::consts::PI;
use std::path::PathBuf;
use vehicles::{CommandMap, Vehicle};

/// Words of 32 bits of the random stream that are set aside for a tick: its three normal draws take six, and some more one
/// time in seventy.
const WORDS_PER_TICK: u128 = 1 << 10;

/// Parameters of the stand.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Number of the vehicle's rotor on the stand, from 1.
    #[parameter(default = 1, range = "1 to the number of rotors")]
    rotor: usize,
    /// List of changes of the commanded speed; it is 0 before the first.
    #[parameter(table = SpeedEntry, entry = "N", example = "[{ at_s = 0.0, to_rpm = 3900.0 }, { at_s = 5.0, over_s = 20.0, to_rpm = 8600.0 }]")]
    speeds: Vec<SpeedEntry>,
    /// Standard deviation of a reading of the force.
    #[parameter(default = 0.0, check = not_negative)]
    force_noise_N: f64,
    /// Standard deviation of a reading of the torque on the mount, from which the drag torque is computed.
    #[parameter(default = 0.0, check = not_negative)]
    torque_noise_N_m: f64,
    /// Standard deviation of a reading of the speed.
    #[parameter(default = 0.0, check = not_negative)]
    speed_noise_rad_s: f64,
}

/// Change of the commanded speed.
#[derive(Debug, Clone, Copy, component::Parameters)]
pub struct SpeedEntry {
    /// Start of the change; not before the change ahead of it is over.
    at_s: f64,
    /// Duration of the change; 0 for a step.
    #[parameter(default = 0.0)]
    over_s: f64,
    /// Speed after the change: 0, or one that the vehicle's motors can be asked for.
    #[parameter(unit = "rpm")]
    to_rpm: f64,
}

/// Readings of the stand's sensors.
#[derive(Clone, Copy, Debug, Default, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RotorLoad")]
pub struct RotorLoad {
    /// Simulation time.
    pub stamp: Time,
    /// The speed that the motor is asked for.
    #[field(unit = "rad/s")]
    pub rotor_speed_commanded: f64,
    /// Speed of the rotor, positive in its own sense of rotation.
    #[field(unit = "rad/s")]
    pub rotor_speed: f64,
    /// Thrust along the rotor's axis.
    #[field(unit = "N")]
    pub thrust: f64,
    /// Torque of the air on the rotor, against its rotation.
    #[field(unit = "N*m")]
    pub drag_torque: f64,
    /// Torque on what the motor is bolted to, about the axis that points up: the air's drag and what speeds the rotor up.
    #[field(unit = "N*m", frame = "body")]
    pub mount_torque: f64,
}

/// State of the component.
#[derive(Debug, Clone, Copy, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/PropellerStandState")]
pub struct StandState {
    /// Speed of the rotor.
    #[field(unit = "rad/s")]
    speed: f64,
    /// Its rate of change.
    #[field(unit = "rad/s^2")]
    acceleration: f64,
}

/// Outputs of the stand.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Speed, thrust and torques.
    pub load: RotorLoad,
}

/// The component `propeller-stand`.
///
/// ```
/// use plant::propeller_stand::PropellerStand;
/// use serde_json::json;
///
/// let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
/// let parameters = json!({ "vehicle": vehicle, "speeds": [{ "at_s": 0.0, "to_rpm": 3900.0 }] });
/// let mut stand = component::Harness::<PropellerStand>::from_json(&parameters).unwrap();
/// let load = (0..=3000).map(|_| stand.step(()).unwrap().load).last().unwrap();
/// assert!((load.thrust - 1.1588).abs() < 1e-3 && (load.drag_torque - 0.0408).abs() < 1e-4, "{load:?}");
/// assert!(load.mount_torque > 0.0, "the clockwise front rotor turns its mount counter-clockwise: {load:?}");
/// ```
#[derive(Debug)]
pub struct PropellerStand {
    vehicle: Vehicle,
    /// Its place among the vehicle's rotors.
    rotor: usize,
    profile: Vec<Leg>,
    dt_s: f64,
    noise: Noise,
}

/// White noise of the sensors. The noise of a tick follows from seed, name and tick: there is no state to hand over.
#[derive(Debug)]
struct Noise {
    /// Of the force, N, the torque, N·m, and the speed, rad/s.
    sigmas: [f64; 3],
    random: Stream,
}

impl Noise {
    /// Returns the noise of force, torque and speed at a tick. All three are always drawn, so that one's noise does
    /// not reshuffle the others'.
    fn at(&self, tick: u32) -> [f64; 3] {
        let mut random = random::at(&self.random, u128::from(tick) * WORDS_PER_TICK);
        self.sigmas.map(|sigma| sigma * normal(&mut random))
    }
}

/// A change of the commanded speed, in ticks.
#[derive(Debug, Clone, Copy)]
struct Leg {
    start_tick: f64,
    span_ticks: f64,
    to_rad_s: f64,
}

impl Component for PropellerStand {
    const INFO: Info =
        Info::new("propeller-stand", "one rotor of a vehicle file on a thrust stand: speed, thrust, torque");
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = StandState;

    fn new(parameters: Parameters, run: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { vehicle, rotor, speeds, force_noise_N, torque_noise_N_m, speed_noise_rad_s } =
            parameters;
        let sigmas = [force_noise_N, torque_noise_N_m, speed_noise_rad_s];
        let noise = Noise { sigmas, random: stream(run.seed, run.name) };
        let vehicle = Vehicle::load_from(&run.files, &vehicle);
        let vehicle = vehicle.map_err(|error| error.named_by("vehicle"));
        let ticks = run.period_ticks;
        let period = refuse(ticks != 1, "period_ticks", || {
            format!("`period_ticks` is {ticks}, expected 1: a stand runs at every tick; leave it out")
        });
        let (vehicle, ()) = ParameterError::both(vehicle, period)?;
        let is_there = (1..=vehicle.rotors.len()).contains(&rotor);
        let expected = format!("1 to {}, in the order of the vehicle file", vehicle.rotors.len());
        let number = require("rotor", rotor, is_there, expected);
        let dt_s = run.tick_s();
        airworthy::tell_unsourced(&vehicle, run);
        let steps = airworthy::check_steps(&vehicle, dt_s, run);
        let profile = profile(&speeds, &vehicle.command, dt_s);
        let (_, profile) = ParameterError::both(ParameterError::gather([number, steps]), profile)?;
        Ok(Self { vehicle, rotor: rotor - 1, profile, dt_s, noise })
    }

    fn initial(&self) -> StandState {
        StandState::default()
    }

    fn step(&self, context: &StepContext<'_>, (): (), state: &mut StandState) -> Result<Outputs, StepError> {
        let tick = context.tick();
        if let Some(before) = tick.checked_sub(1) {
            let target_rad_s = self.commanded_rad_s(before);
            let rotor = RotorState { speed_rad_s: state.speed, acceleration_rad_s2: state.acceleration };
            let moved = motor::moved(&self.vehicle.motor, &rotor, target_rad_s, self.dt_s);
            let moved = motor::settled(&self.vehicle.motor, &moved, target_rad_s);
            *state = StandState { speed: moved.speed_rad_s, acceleration: moved.acceleration_rad_s2 };
        }
        let truth = self.load(self.commanded_rad_s(tick), state);
        Ok(Outputs { load: self.read(&truth, tick) })
    }
}

impl PropellerStand {
    /// The speed that is asked for from `tick` to the next.
    fn commanded_rad_s(&self, tick: u32) -> f64 {
        self.profile.iter().fold(0.0, |from_rad_s, leg| {
            let since_ticks = f64::from(tick) - leg.start_tick;
            let share =
                if since_ticks < leg.span_ticks { since_ticks.max(0.0) / leg.span_ticks } else { 1.0 };
            if since_ticks < 0.0 { from_rad_s } else { from_rad_s * (1.0 - share) + leg.to_rad_s * share }
        })
    }

    fn load(&self, rotor_speed_commanded: f64, rotor: &StandState) -> RotorLoad {
        let place = &self.vehicle.rotors[self.rotor];
        let drag_torque = drag_torque_N_m(&self.vehicle, place, rotor.speed);
        let speeding_up_N_m = self.vehicle.rotor_inertia_kg_m2 * rotor.acceleration;
        RotorLoad {
            stamp: Time::default(),
            rotor_speed_commanded,
            rotor_speed: rotor.speed,
            thrust: thrust_N(&self.vehicle, rotor.speed),
            drag_torque,
            mount_torque: -place.spin * (drag_torque + speeding_up_N_m),
        }
    }
}

impl PropellerStand {
    /// Returns the sensors' reading of the truth at a tick.
    fn read(&self, truth: &RotorLoad, tick: u32) -> RotorLoad {
        let [force_N, torque_N_m, speed_rad_s] = self.noise.at(tick);
        let against_spin = -self.vehicle.rotors[self.rotor].spin;
        RotorLoad {
            rotor_speed: truth.rotor_speed + speed_rad_s,
            thrust: truth.thrust + force_N,
            drag_torque: truth.drag_torque + against_spin * torque_N_m,
            mount_torque: truth.mount_torque + torque_N_m,
            ..*truth
        }
    }
}

/// The changes of speed in ticks of `dt_s`, in their order.
fn profile(entries: &[SpeedEntry], map: &CommandMap, dt_s: f64) -> Result<Vec<Leg>, ParameterError> {
    refuse(entries.is_empty(), "speeds", || "`speeds` is empty: the rotor would never turn")?;
    let mut errors = Vec::new();
    let mut legs: Vec<Leg> = Vec::new();
    for (index, entry) in entries.iter().enumerate() {
        let leg = match leg(entry, map, dt_s) {
            Ok(leg) => leg,
            Err(error) => {
                errors.push(Err(error.within(&format!("speeds.{index}"))));
                continue;
            }
        };
        let is_behind = legs.last().is_none_or(|last| last.start_tick + last.span_ticks <= leg.start_tick);
        let key = format!("speeds.{index}.at_s");
        errors.push(require(&key, entry.at_s, is_behind, "when the change before is over"));
        legs.push(leg);
    }
    ParameterError::gather(errors).map(|_| legs)
}

fn leg(entry: &SpeedEntry, map: &CommandMap, dt_s: f64) -> Result<Leg, ParameterError> {
    let times = ParameterError::both(not_negative("at_s", entry.at_s), not_negative("over_s", entry.over_s));
    let to_rad_s = entry.to_rpm * PI / 30.0;
    // A millionth more, so that the ends of the range can be asked for although they were converted.
    let [least, most] = [map.speed_at_min_rad_s * (1.0 - 1e-6), map.speed_at_max_rad_s * (1.0 + 1e-6)];
    let [low_rpm, high_rpm] = [map.speed_at_min_rad_s, map.speed_at_max_rad_s].map(|speed| speed * 30.0 / PI);
    let expected = format!("0, or {low_rpm:.0} to {high_rpm:.0} rpm, which the motors can be asked for");
    let can_be_asked = to_rad_s == 0.0 || (least..=most).contains(&to_rad_s);
    ParameterError::both(times, require("to_rpm", entry.to_rpm, can_be_asked, expected))?;
    let ticks = |time_s: f64| (time_s / dt_s).round();
    Ok(Leg { start_tick: ticks(entry.at_s), span_ticks: ticks(entry.over_s), to_rad_s })
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Harness;
    use serde_json::{Value, json};

    /// Mean and standard deviation.
    fn spread(values: &[f64]) -> (f64, f64) {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt())
    }

    fn parameters(rotor: usize, speeds: &Value) -> Value {
        let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../vehicles/hummingbird.toml");
        json!({ "vehicle": vehicle, "rotor": rotor, "speeds": speeds })
    }

    fn stand(rotor: usize, speeds: &Value) -> Harness<PropellerStand> {
        Harness::from_json(&parameters(rotor, speeds)).unwrap()
    }

    fn refused(rotor: usize, speeds: &Value) -> String {
        Harness::<PropellerStand>::from_json(&parameters(rotor, speeds)).map(|_| ()).unwrap_err().to_string()
    }

    #[test]
    fn a_rotor_follows_its_command_with_the_motors_overshoot() {
        let mut stand = stand(1, &json!([{ "at_s": 0.1, "to_rpm": 3900.0 }]));
        let loads: Vec<RotorLoad> = (0..3000).map(|_| stand.step(()).unwrap().load).collect();
        assert!(loads[..=100].iter().all(|load| load.rotor_speed == 0.0 && load.thrust == 0.0));
        assert_eq!(
            (loads[99].rotor_speed_commanded, loads[100].rotor_speed_commanded),
            (0.0, 3900.0 * PI / 30.0)
        );
        // A second-order lag of damping 0.603 overshoots by exp(-pi zeta / sqrt(1 - zeta^2)), 9.3 %.
        let most = loads.iter().map(|load| load.rotor_speed).fold(0.0, f64::max);
        assert!((most / (3900.0 * PI / 30.0) - 1.0929).abs() < 1e-3, "{most}");
    }

    #[test]
    fn its_mount_turns_against_it_and_feels_it_speed_up() {
        let speeds = json!([{ "at_s": 0.0, "to_rpm": 3900.0 }]);
        for (rotor, sign) in [(1, 1.0), (2, -1.0)] {
            let mut stand = stand(rotor, &speeds);
            let loads: Vec<RotorLoad> = (0..3000).map(|_| stand.step(()).unwrap().load).collect();
            assert!((loads[2999].mount_torque - sign * loads[2999].drag_torque).abs() < 1e-9);
            assert!(sign * loads[50].mount_torque > loads[50].drag_torque + 1e-3, "{:?}", loads[50]);
        }
    }

    #[test]
    fn a_ramp_leads_evenly_from_one_speed_to_the_next() {
        let speeds =
            json!([{ "at_s": 0.0, "to_rpm": 1075.0 }, { "at_s": 1.0, "over_s": 2.0, "to_rpm": 8600.0 }]);
        let mut stand = stand(1, &speeds);
        let rpm: Vec<f64> =
            (0..4000).map(|_| stand.step(()).unwrap().load.rotor_speed_commanded * 30.0 / PI).collect();
        for (tick, expected) in [(0, 1075.0), (1000, 1075.0), (2000, 4837.5), (3000, 8600.0), (3999, 8600.0)]
        {
            assert!((rpm[tick] - expected).abs() < 1e-6, "{expected} at {tick}: {}", rpm[tick]);
        }
    }

    #[test]
    fn another_instance_goes_on_from_its_state() {
        let speeds = json!([{ "at_s": 0.0, "over_s": 0.05, "to_rpm": 3900.0 }]);
        Harness::require_transfer(|| stand(1, &speeds), |_| ());
    }

    fn noisy(noise: &Value) -> Vec<RotorLoad> {
        let mut parameters = parameters(1, &json!([{ "at_s": 0.0, "to_rpm": 3900.0 }]));
        parameters.as_object_mut().unwrap().extend(noise.as_object().cloned().unwrap());
        let mut stand = Harness::<PropellerStand>::from_json(&parameters).unwrap();
        (0..12_000).map(|_| stand.step(()).unwrap().load).collect()
    }

    #[test]
    fn the_sensors_have_their_own_noise_and_the_drag_is_the_torque_that_is_read() {
        let truth = noisy(&json!({}));
        let all = json!({ "force_noise_N": 0.02, "torque_noise_N_m": 3e-4, "speed_noise_rad_s": 0.5 });
        let read = noisy(&all);
        let off = |of: fn(&RotorLoad) -> f64| -> Vec<f64> {
            read.iter().zip(&truth).map(|(read, truth)| of(read) - of(truth)).collect()
        };
        let errors: [(Vec<f64>, f64); 3] = [
            (off(|load| load.thrust), 0.02),
            (off(|load| load.mount_torque), 3e-4),
            (off(|load| load.rotor_speed), 0.5),
        ];
        for (errors, sigma) in &errors {
            let (mean, found) = spread(errors);
            assert!(
                mean.abs() < 0.05 * sigma && (found / sigma - 1.0).abs() < 0.03,
                "{sigma}: {mean} {found}"
            );
            // White: of two ticks in a row nothing is common.
            let product: f64 = errors.windows(2).map(|pair| pair[0] * pair[1]).sum();
            assert!((product / errors.len() as f64).abs() < 0.05 * sigma * sigma);
        }
        // Rotor 1 turns clockwise: its mount feels the drag as it is.
        let drags = off(|load| load.drag_torque);
        assert!(drags.iter().zip(&errors[1].0).all(|(drag, mount)| (drag - mount).abs() < 1e-15));
        let force_alone = noisy(&json!({ "force_noise_N": 0.02 }));
        assert!(force_alone.iter().zip(&read).all(|(alone, read)| alone.thrust == read.thrust));
        assert!(force_alone.iter().zip(&truth).all(|(alone, truth)| alone.rotor_speed == truth.rotor_speed));
    }

    #[test]
    fn another_instance_goes_on_with_the_noise() {
        let mut parameters = parameters(1, &json!([{ "at_s": 0.0, "to_rpm": 3900.0 }]));
        parameters["force_noise_N"] = json!(0.02);
        Harness::require_transfer(|| Harness::<PropellerStand>::from_json(&parameters).unwrap(), |_| ());
    }

    #[test]
    fn noise_that_is_none_is_refused_with_its_key() {
        for key in ["force_noise_N", "torque_noise_N_m", "speed_noise_rad_s"] {
            let mut parameters = parameters(1, &json!([{ "at_s": 0.0, "to_rpm": 3900.0 }]));
            parameters[key] = json!(-0.1);
            let error =
                Harness::<PropellerStand>::from_json(&parameters).map(|_| ()).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains("0 or more"), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_asked_for_is_refused_with_its_key() {
        let step = |rpm: f64| json!([{ "at_s": 0.0, "to_rpm": rpm }]);
        for rpm in [1000.0, 8601.0, -3900.0] {
            let error = refused(1, &step(rpm));
            assert!(error.contains("`speeds.0.to_rpm`") && error.contains("1075 to 8600 rpm"), "{error}");
        }
        assert!(refused(5, &step(3900.0)).contains("`rotor`"));
        assert!(refused(1, &json!([])).contains("`speeds`"));
        let late =
            json!([{ "at_s": 0.0, "over_s": 2.0, "to_rpm": 2000.0 }, { "at_s": 1.0, "to_rpm": 3000.0 }]);
        assert!(refused(1, &late).contains("`speeds.1.at_s`"));
    }
}
