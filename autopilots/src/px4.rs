//! PX4's software in the loop, SITL, by its simulator's MAVLink interface (`SimulatorMavlink.cpp` and the start-up script
//! `init.d-posix/rcS` of PX4; read in several versions, not flown).
//!
//! PX4 connects to the simulator by TCP. A message of the sensors sets its clock, and each one is answered with the motors' outputs,
//! so that it is in lockstep by itself. While it boots, messages are sent without waiting for long; from then on, each answer is
//! waited for.
//!
//! Axes of its messages: body forward, right, down; world north, east, down. The world's x is east, its y north
//! ([`crate::origin`]).

mod airframe;
mod field;
mod folder;
mod mavlink;
mod messages;

use crate::autopilot::{Autopilot, Sensed, Throttles};
use crate::connection::Connection;
use crate::origin::Origin;
use crate::process::Scratch;
use crate::rest::{Rest, imu_at_rest};
use crate::settings;
use bus::component::Info;
use bus::context::NodeContext;
use bus::messages::{RC_CHANNELS_MAX, RcChannels, StateEstimate};
use diagnostics::ParameterError;
use diagnostics::parameter::{positive_up_to, refuse};
use field::MagneticField;
use folder::Folder;
use mavlink::{Kind, Reader, add_frame};
use messages::{
    HIL_ACTUATOR_CONTROLS, HIL_GPS, HIL_SENSOR, HIL_STATE_QUATERNION, INERTIAL_FIELDS, MAGNETIC_FIELDS,
    Outputs, PRESSURE_FIELDS, RC_CHANNELS, Sample,
};
use serde::Deserialize;
use std::net::{Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::time::Duration;
use vehicles::Vehicle;

/// Time between two messages of the sensors: PX4's start-up script sets its own rate for simulators to 250 Hz (`IMU_INTEG_RATE`),
/// and a firmware that drops samples of a faster sensor (`IMU_GYRO_RATEMAX`) would leave messages without an answer.
const SENSOR_PERIOD_NS: u64 = 4_000_000;
const SENSOR_PERIOD_US: u64 = SENSOR_PERIOD_NS / 1000;
/// The first time of its clock, us: not 0, which PX4 takes for a clock that is not set. Some versions count from there on, so that
/// the times in their answers are behind by this, which is less than half of a period.
const FIRST_TIME_US: u64 = 1000;
/// Messages of the sensors for each one of satellite navigation (10 Hz), the remote control (50 Hz), the compass and the barometer.
const GPS_EVERY: u64 = 25;
const CHANNELS_EVERY: u64 = 5;
const MAGNETIC_EVERY: u64 = 4;
const PRESSURE_EVERY: u64 = 5;
/// Messages of the sensors after which all of these begin anew.
const ALL_EVERY: u64 = 100;
/// Host time that an answer may take while PX4 boots: it may not answer at all.
const BOOT_PACE: Duration = Duration::from_millis(20);
/// Messages in a row that are answered once PX4 has booted: one second of its time.
const IN_STEP: u64 = 250;
/// Part of the rest with the arming switch on, s: motors stand still for 1 s after it is armed (`COM_SPOOLUP_TIME`).
const ARMED_S: f64 = 4.0;
/// Longest host time that a start may take, s.
const BOOT_TIMEOUT_MAX_S: f64 = 3600.0;
/// Port of the instance 0, and the instances that are tried. A user's own firmwares have the first ones.
const FIRST_PORT: u16 = 4560;
const INSTANCES: std::ops::Range<u16> = 100..200;
/// Path for the start-up script: first the folder with the program, from the one in which it runs. A relative path, since one with a
/// colon could not be searched.
const PATH: &str = "..:/usr/local/bin:/usr/bin:/bin";
/// The airframe of the start-up script: a quadrotor that no simulator is started for. The vehicle's parameters replace its geometry.
const MODEL: &str = "none_iris";

/// Parameters of the firmware.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The vehicle that it flies.
    vehicle: PathBuf,
    /// PX4's program for SITL.
    firmware: PathBuf,
    /// File of its parameters.
    configuration: Option<PathBuf>,
    /// Channel whose switch arms, counted from 1, where the firmware is to be armed at tick 0; none where the pilot arms.
    armed_by_channel: Option<usize>,
    /// Simulated time before tick 0 in which its estimator settles, s.
    #[serde(default = "rest_s")]
    rest_s: f64,
    /// Host time that an answer may take, in s.
    #[serde(default = "settings::reply_timeout_s")]
    reply_timeout_s: f64,
    /// Host time in which it connects, and in which its modules then start, in s.
    #[serde(default = "boot_timeout_s")]
    boot_timeout_s: f64,
    /// Airframe of its start-up script.
    #[serde(default = "model")]
    model: String,
    /// Place on the earth of the world's origin.
    #[serde(default)]
    origin: Origin,
    /// Magnetic field of the earth at the origin.
    #[serde(default)]
    magnetic_field: MagneticField,
}

/// The estimator aligns its attitude within seconds, and its start-up script lets it use a GPS soon after that.
fn rest_s() -> f64 {
    20.0
}

/// The start-up script runs a few hundred commands, each a process.
fn boot_timeout_s() -> f64 {
    60.0
}

fn model() -> String {
    MODEL.to_owned()
}

/// PX4 as the manifest has it.
#[derive(Debug)]
pub struct Px4 {
    vehicle: Vehicle,
    firmware: Vec<u8>,
    /// Path from which the program was read: its build has the start-up script.
    source: PathBuf,
    /// Commands that set its parameters.
    parameters: String,
    /// Exchanges for each message of the sensors.
    every: u64,
    rest: Rest,
    reply_timeout: Duration,
    boot_timeout: Duration,
    model: String,
    origin: Origin,
    magnetic_field: MagneticField,
}

/// The firmware that runs.
#[derive(Debug)]
pub struct Link {
    connection: Connection,
    reader: Reader,
    /// Exchanges since tick 0, or since the rest began.
    exchanges: u64,
    /// Messages of the sensors sent.
    sent: u64,
    /// Sequence number of the next message.
    sequence: u8,
    is_armed: bool,
    /// Outputs by rotor of the last answer.
    throttles: Throttles,
}

impl Autopilot for Px4 {
    const INFO: Info =
        Info::new("px4", "PX4's SITL, in lockstep: a process of its own that flies the vehicle");
    type Parameters = Parameters;
    type Link = Link;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { vehicle, firmware, configuration, armed_by_channel, rest_s, .. } = parameters;
        let vehicle = settings::vehicle(context, &vehicle)?;
        let program = settings::program(context, &firmware, "PX4's SITL, build/px4_sitl_default/bin/px4")?;
        // A message of the bus has fewer channels than MAVLink's.
        settings::check_arming(armed_by_channel, messages::CHANNELS.min(RC_CHANNELS_MAX))?;
        settings::check_rest(rest_s, ARMED_S, armed_by_channel)?;
        positive_up_to("boot_timeout_s", parameters.boot_timeout_s, BOOT_TIMEOUT_MAX_S, "s")?;
        parameters.origin.check()?;
        parameters.magnetic_field.check()?;
        let period_ns = context.tick_ns * u64::from(context.period_ticks);
        refuse(!SENSOR_PERIOD_NS.is_multiple_of(period_ns), "period_ticks", || {
            let period_s = context.period_s();
            format!(
                "the period is {period_s} s, expected one of which 4 ms is a multiple: PX4 senses every 4 ms"
            )
        })?;
        let configured = settings::configuration(context, configuration.as_deref())?;
        let script = airframe::script(&configured, &vehicle)
            .map_err(|reason| ParameterError::conflict("configuration", reason))?;
        Ok(Self {
            vehicle,
            firmware: program,
            source: firmware,
            parameters: script,
            every: SENSOR_PERIOD_NS / period_ns,
            rest: Rest { time_s: rest_s, armed_s: ARMED_S, armed_by_channel, period_s: context.period_s() },
            reply_timeout: settings::reply_timeout(parameters.reply_timeout_s)?,
            boot_timeout: Duration::from_secs_f64(parameters.boot_timeout_s),
            model: parameters.model,
            origin: parameters.origin,
            magnetic_field: parameters.magnetic_field,
        })
    }

    fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    fn boot(&self) -> Result<Link, String> {
        let connection = self.start()?;
        let reader = Reader::new(HIL_ACTUATOR_CONTROLS);
        let throttles = Throttles::filled(self.vehicle.rotors.len(), 0.0);
        let mut link =
            Link { connection, reader, exchanges: 0, sent: 0, sequence: 0, is_armed: false, throttles };
        self.await_modules(&mut link)?;
        self.rest.of(self, &mut link)?;
        link.exchanges = 0;
        // An armed firmware may keep its motors at 0.
        if link.is_armed || self.rest.armed_by_channel.is_none() {
            return Ok(link);
        }
        let words = "it is not armed at tick 0 under `armed_by_channel` and the configuration";
        Err(link.connection.firmware().complaint(words))
    }

    fn exchange(&self, link: &mut Link, sensed: &Sensed<'_>) -> Result<Throttles, String> {
        let is_due = link.exchanges.is_multiple_of(self.every);
        link.exchanges += 1;
        if is_due && !self.sense(link, sensed, self.reply_timeout)? {
            return Err(self.silence(link));
        }
        Ok(link.throttles)
    }
}

impl Px4 {
    /// The firmware, connected.
    fn start(&self) -> Result<Connection, String> {
        let scratch = Scratch::new("px4")?;
        let folder = Folder::fill(&scratch, &self.firmware, &self.source, &self.parameters)?;
        let (instance, listener) = listener()?;
        let mut command = scratch.command(&folder.program)?;
        command.current_dir(&folder.root).env("PATH", PATH).env("PX4_SIM_MODEL", &self.model);
        command.args(["-d", "-i", &instance.to_string(), "-w"]).arg(&folder.root).arg(&folder.etc);
        Connection::start(scratch, command, listener, self.boot_timeout, self.reply_timeout)
    }

    /// Lets the firmware sense a level ground until its modules have started: until it has answered for a while.
    fn await_modules(&self, link: &mut Link) -> Result<(), String> {
        let (imu, estimate, rc) =
            (imu_at_rest(&self.vehicle), StateEstimate::default(), RcChannels::default());
        let sensed = Sensed { time_s: 0.0, imu: &imu, estimate: &estimate, rc: &rc };
        let mut silent = self.boot_timeout.as_micros().div_ceil(BOOT_PACE.as_micros());
        let mut answered = 0;
        while silent > 0 {
            if self.sense(link, &sensed, BOOT_PACE)? {
                answered += 1;
            } else {
                (answered, silent) = (0, silent - 1);
            }
            // So the rest begins with the same messages, however long the start took.
            if answered >= IN_STEP && link.sent.is_multiple_of(ALL_EVERY) {
                return Ok(());
            }
        }
        let seconds = self.boot_timeout.as_secs_f64();
        let words =
            format!("it has connected and not answered each message of the sensors within {seconds} s");
        Err(link.connection.firmware().complaint(&words))
    }

    /// Sends a tick's messages, and waits for the answer; false if there is none within `limit`.
    fn sense(&self, link: &mut Link, sensed: &Sensed<'_>, limit: Duration) -> Result<bool, String> {
        let time_us = FIRST_TIME_US + link.sent * SENSOR_PERIOD_US;
        let bytes = self.messages(link, time_us, sensed);
        link.sent += 1;
        link.connection.send(&bytes)?;
        let reader = &mut link.reader;
        let outputs = link.connection.receive(limit, |bytes| answer(reader, bytes, time_us))?;
        let Some(outputs) = outputs else { return Ok(false) };
        link.is_armed = outputs.is_armed;
        link.throttles =
            self.throttles(&outputs).map_err(|words| link.connection.firmware().complaint(&words))?;
        Ok(true)
    }

    /// Messages of a tick. That of the sensors is the last one: it sets the clock, and is answered.
    fn messages(&self, link: &mut Link, time_us: u64, sensed: &Sensed<'_>) -> Vec<u8> {
        let Link { sent, sequence, .. } = link;
        let estimate = sensed.estimate;
        let field_B_T = self.magnetic_field.vector_B_T(estimate.attitude);
        let sample =
            Sample { time_us, sensed, place: self.origin.place(estimate.position.into()), field_B_T };
        let mut bytes = Vec::new();
        let mut add = |kind: Kind, payload: &[u8]| {
            add_frame(&mut bytes, kind, *sequence, payload);
            *sequence = sequence.wrapping_add(1);
        };
        if sent.is_multiple_of(GPS_EVERY) {
            add(HIL_GPS, &sample.gps());
        }
        if sent.is_multiple_of(CHANNELS_EVERY) {
            add(RC_CHANNELS, &sample.channels());
        }
        add(HIL_STATE_QUATERNION, &sample.state());
        let magnetic = if sent.is_multiple_of(MAGNETIC_EVERY) { MAGNETIC_FIELDS } else { 0 };
        let pressure = if sent.is_multiple_of(PRESSURE_EVERY) { PRESSURE_FIELDS } else { 0 };
        add(HIL_SENSOR, &sample.sensor(INERTIAL_FIELDS | magnetic | pressure));
        bytes
    }

    /// Outputs by rotor.
    fn throttles(&self, outputs: &Outputs) -> Result<Throttles, String> {
        let motors = &outputs.motors[..self.vehicle.rotors.len()];
        if motors.iter().any(|motor| !motor.is_finite()) {
            return Err(format!("it sends the motor outputs {motors:?}"));
        }
        Ok(Throttles::from_fn(motors.len(), |rotor| f64::from(motors[rotor]).max(0.0)))
    }

    /// A firmware that runs and has not answered.
    fn silence(&self, link: &Link) -> String {
        let firmware = link.connection.firmware();
        match link.reader.wrong {
            0 => firmware.silence(self.reply_timeout),
            wrong => firmware.complaint(&format!(
                "px4 runs and gave no answer for {} s; {wrong} of its messages had a wrong checksum",
                self.reply_timeout.as_secs_f64()
            )),
        }
    }
}

/// Outputs in `bytes` that answer the sensors of `time_us`; those of earlier times are dropped.
fn answer(reader: &mut Reader, bytes: &mut Vec<u8>, time_us: u64) -> Result<Option<Outputs>, String> {
    while let Some(payload) = reader.next(bytes) {
        let outputs = Outputs::read(&payload);
        if !outputs.is_lockstep {
            return Err("it was built without lockstep (ENABLE_LOCKSTEP_SCHEDULER), expected a SITL with it"
                .to_owned());
        }
        if outputs.time_us + SENSOR_PERIOD_US / 2 >= time_us {
            return Ok(Some(outputs));
        }
    }
    Ok(None)
}

/// A free instance, and the listener at its port, which keeps others from taking it.
fn listener() -> Result<(u16, TcpListener), String> {
    let bound = |instance| TcpListener::bind((Ipv4Addr::LOCALHOST, FIRST_PORT + instance)).ok();
    let free = INSTANCES.into_iter().find_map(|instance| Some((instance, bound(instance)?)));
    free.ok_or_else(|| {
        let (first, last) = (FIRST_PORT + INSTANCES.start, FIRST_PORT + INSTANCES.end - 1);
        format!("no port for px4: {first} to {last} are in use")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hummingbird() -> Px4 {
        Px4 {
            vehicle: Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap(),
            firmware: Vec::new(),
            source: PathBuf::new(),
            parameters: String::new(),
            every: 4,
            rest: Rest { time_s: 20.0, armed_s: ARMED_S, armed_by_channel: None, period_s: 1e-3 },
            reply_timeout: Duration::from_secs(1),
            boot_timeout: Duration::from_secs(1),
            model: model(),
            origin: Origin::default(),
            magnetic_field: MagneticField::default(),
        }
    }

    /// A message of outputs at a time.
    fn message(time_us: u64, flags: u8) -> Vec<u8> {
        let mut payload = vec![0; HIL_ACTUATOR_CONTROLS.length];
        payload[..8].copy_from_slice(&time_us.to_le_bytes());
        payload[8] = flags;
        let mut bytes = Vec::new();
        add_frame(&mut bytes, HIL_ACTUATOR_CONTROLS, 0, &payload);
        bytes
    }

    #[test]
    fn an_answer_is_that_of_the_time_with_either_beginning_of_the_clock() {
        let mut reader = Reader::new(HIL_ACTUATOR_CONTROLS);
        for begins_us in [0, FIRST_TIME_US] {
            let of = |sent: u64| FIRST_TIME_US + sent * SENSOR_PERIOD_US;
            let mut bytes = [message(of(6) - begins_us, 1), message(of(7) - begins_us, 1)].concat();
            let found = answer(&mut reader, &mut bytes, of(7)).unwrap().unwrap();
            assert_eq!(found.time_us, of(7) - begins_us);
            assert_eq!(answer(&mut reader, &mut bytes, of(7)), Ok(None));
        }
        let error = answer(&mut reader, &mut message(1000, 0), 1000).unwrap_err();
        assert!(error.contains("without lockstep"), "{error}");
    }

    #[test]
    fn motors_are_the_rotors_in_order_and_none_is_no_number() {
        let mut motors = [0.0; messages::MOTORS];
        motors[..4].copy_from_slice(&[0.25, 0.5, -0.1, 1.0]);
        let outputs = Outputs { time_us: 0, is_lockstep: true, is_armed: true, motors };
        assert_eq!(hummingbird().throttles(&outputs).unwrap(), [0.25, 0.5, 0.0, 1.0]);
        motors[3] = f32::NAN;
        assert!(hummingbird().throttles(&Outputs { motors, ..outputs }).unwrap_err().contains("NaN"));
    }

    #[test]
    fn instances_are_different() {
        let [(first, _held), (second, _)] = [listener().unwrap(), listener().unwrap()];
        assert!(first != second && INSTANCES.contains(&first), "{first} {second}");
    }
}
