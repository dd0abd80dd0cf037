//! PX4's software in the loop, SITL, by its simulator's MAVLink interface (`SimulatorMavlink.cpp` and the start-up script
//! `init.d-posix/rcS` of PX4; read at commit a70a5583).
//!
//! A message of the sensors sets PX4's clock, and PX4 answers it with the motors' outputs. Yet its threads
//! run in parallel, and its start-up script runs by the time of the host. Without help no two runs would
//! agree. So a library is preloaded (`lockstep.c`). It lets one thread run at a time, in an order that
//! depends on the messages alone. When all threads wait, it hands PX4 the messages of a step, and returns
//! what PX4 has sent by then. The firmware itself is as it was built.
//!
//! Axes of its messages: body forward, right, down; world north, east, down. The world's x is east, its y north
//! ([`crate::origin`]).

mod airframe;
mod field;
mod folder;
mod mavlink;
mod messages;

use crate::autopilot::{Autopilot, Sensed, Throttles};
use crate::origin::Origin;
use crate::parameter_lines;
use crate::process::Scratch;
use crate::rest::{Rest, imu_at_rest};
use crate::settings;
use crate::stream::Stream;
use bus::component::Info;
use bus::context::NodeContext;
use bus::messages::{RC_CHANNELS_MAX, RcChannels, StateEstimate};
use diagnostics::parameter::{finite, refuse, up_to};
use diagnostics::{ParameterError, nine_decimals};
use field::MagneticField;
use folder::Build;
use mavlink::{Kind, add_frame, frames};
use messages::{
    HIL_ACTUATOR_CONTROLS, HIL_GPS, HIL_SENSOR, HIL_STATE_QUATERNION, INERTIAL_FIELDS, MAGNETIC_FIELDS,
    Outputs, PRESSURE_FIELDS, RC_CHANNELS, Sample,
};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::PathBuf;
use std::time::Duration;
use vehicles::Vehicle;

/// The library that is preloaded.
const LOCKSTEP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/px4_lockstep.so"));
/// Time between two messages of the sensors: PX4's start-up script sets its own rate for simulators to 250 Hz (`IMU_INTEG_RATE`).
const SENSOR_PERIOD_NS: u64 = 4_000_000;
const SENSOR_PERIOD_US: u32 = 4000;
/// The first time of its clock, us: not 0, which PX4 takes for a clock that is not set.
const FIRST_TIME_US: u64 = 1000;
/// Messages of the sensors for each one of satellite navigation (10 Hz), the remote control (50 Hz), the compass and the barometer.
const GPS_EVERY: u64 = 25;
const CHANNELS_EVERY: u64 = 5;
const MAGNETIC_EVERY: u64 = 4;
const PRESSURE_EVERY: u64 = 5;
/// Messages of the sensors in which the start-up script has to end: two minutes of simulated time. It takes less than a second.
const START_UP_MAX: u64 = 30_000;
/// Messages of the sensors without motor outputs after which it flies no more: 0.1 s.
const STALE_MAX: u64 = 25;
/// Part of the rest with the arming switch on, s: motors stand still for 1 s after it is armed (`COM_SPOOLUP_TIME`).
const ARMED_S: f64 = 4.0;
/// Longest host time that a start may take, s.
const BOOT_TIMEOUT_MAX_S: f64 = 3600.0;
/// Port of the instance 0 for ground stations, and the instances that are tried. A user's own firmwares have the first ones.
const FIRST_PORT: u16 = 18570;
const INSTANCES: std::ops::Range<u16> = 100..200;
/// Path for the start-up script: first the folder with the program, from the one in which it runs. A relative path, since one with a
/// colon could not be searched.
const PATH: &str = "..:/usr/local/bin:/usr/bin:/bin";
/// The airframe of the start-up script: a quadrotor that no simulator is started for. The vehicle's parameters replace its geometry.
const MODEL: &str = "none_iris";
/// Most bytes of an answer.
const ANSWER_MAX: usize = 1 << 16;

/// Parameters of the firmware.
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// PX4's program for SITL, relative to the manifest.
    #[parameter(file = settings::FIRMWARE)]
    firmware: PathBuf,
    /// File of its parameters, relative to the manifest.
    configuration: Option<PathBuf>,
    /// Channel whose switch arms, counted from 1, where the firmware is to be armed at tick 0; none where the pilot arms.
    armed_by_channel: Option<usize>,
    /// Simulated time before tick 0 in which its estimator settles.
    ///
    /// The estimator aligns its attitude within seconds, and its start-up script lets it use a GPS soon after that.
    #[parameter(default = 20.0, check = up_to(settings::REST_MAX_S, "s"))]
    rest_s: f64,
    /// Host time that an answer may take.
    #[parameter(default = settings::reply_timeout_s(), check = up_to(settings::REPLY_TIMEOUT_MAX_S, "s"))]
    reply_timeout_s: f64,
    /// Host time that an answer may take while its start-up script runs.
    ///
    /// The start-up script runs a few hundred commands, each a process.
    #[parameter(default = 60.0, check = up_to(BOOT_TIMEOUT_MAX_S, "s"))]
    boot_timeout_s: f64,
    /// Airframe of its start-up script.
    #[parameter(default = MODEL.to_owned())]
    model: String,
    /// True if it sends to ground stations.
    #[parameter(default = false)]
    ground_station: bool,
    /// Place of the rest before tick 0.
    #[parameter(default = [0.0; 3], check = finite)]
    start_position_m: [f64; 3],
    /// Place on the earth of the world's origin.
    #[parameter(default = Origin::default(), shown = "the home of PX4's simulations, in Zurich", table = Origin)]
    origin: Origin,
    /// Magnetic field of the earth at the origin.
    #[parameter(default = MagneticField::default(), shown = "that of the default origin in 2025", table = MagneticField)]
    magnetic_field: MagneticField,
}

/// PX4 as the manifest has it.
#[derive(Debug)]
pub struct Px4 {
    vehicle: Vehicle,
    build: Build,
    /// Commands that set its parameters.
    parameters: String,
    /// Exchanges for each message of the sensors.
    every: u64,
    rest: Rest,
    reply_timeout: Duration,
    boot_timeout: Duration,
    model: String,
    has_ground_station: bool,
    start_position_m: [f64; 3],
    origin: Origin,
    magnetic_field: MagneticField,
}

/// The firmware that runs.
#[derive(Debug)]
pub struct Link {
    stream: Stream,
    /// Exchanges since tick 0, or since the rest began.
    exchanges: u64,
    /// Messages of the sensors sent.
    sent: u64,
    /// True if channels have come since the last message of the remote control.
    is_rc_new: bool,
    /// Sequence number of the next message.
    sequence: u8,
    /// Messages to send, and what came.
    messages: Vec<u8>,
    received: Vec<u8>,
    /// True before tick 0.
    is_at_rest: bool,
    /// True if the start-up script has ended.
    is_started: bool,
    is_armed: bool,
    /// Messages of the sensors since the last outputs.
    stale: u64,
    /// Outputs by rotor of the last answer.
    throttles: Throttles,
}

/// Head of what `lockstep.c` reads and writes.
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Head {
    /// Bytes that follow.
    length: u32,
    /// To PX4: length of the step, us. From PX4: 1 if the start-up script has ended.
    value: u32,
}

impl Autopilot for Px4 {
    const INFO: Info =
        Info::new("px4", "PX4's SITL, in lockstep: a process of its own that flies the vehicle");
    type Parameters = Parameters;
    type Link = Link;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { vehicle, firmware, configuration, armed_by_channel, rest_s, model, .. } = parameters;
        let period_ns = context.tick_ns * u64::from(context.period_ticks);
        let configured = settings::configuration(context, configuration.as_deref());
        let configured = configured.and_then(parameter_lines::checked);
        let checks = ParameterError::gather([
            // A message of the bus has fewer channels than MAVLink's.
            settings::check_arming(armed_by_channel, messages::CHANNELS.min(RC_CHANNELS_MAX)),
            settings::check_rest(rest_s, ARMED_S, armed_by_channel),
            check_period(context),
        ]);
        let build = Build::read(context, &firmware, &model);
        let rest = ParameterError::both(build, ParameterError::both(configured, checks));
        let (vehicle, (build, (configured, _))) =
            ParameterError::both(settings::vehicle(context, &vehicle), rest)?;
        let script = airframe::script(&configured, &vehicle)?;
        Ok(Self {
            vehicle,
            build,
            parameters: script,
            every: SENSOR_PERIOD_NS / period_ns,
            rest: Rest { time_s: rest_s, armed_s: ARMED_S, armed_by_channel, period_s: context.period_s() },
            reply_timeout: settings::reply_timeout(parameters.reply_timeout_s),
            boot_timeout: Duration::from_secs_f64(parameters.boot_timeout_s.max(1e-3)),
            model,
            has_ground_station: parameters.ground_station,
            start_position_m: parameters.start_position_m,
            origin: parameters.origin,
            magnetic_field: parameters.magnetic_field,
        })
    }

    fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    fn origin(&self) -> &Origin {
        &self.origin
    }

    fn boot(&self) -> Result<Link, String> {
        let mut link = Link {
            stream: self.start()?,
            exchanges: 0,
            sent: 0,
            is_rc_new: false,
            sequence: 0,
            messages: Vec::new(),
            received: Vec::new(),
            is_at_rest: true,
            is_started: false,
            is_armed: false,
            stale: 0,
            throttles: Throttles::filled(self.vehicle.rotors.len(), 0.0),
        };
        self.await_start(&mut link)?;
        if let Some(line) = refused(&link.stream.firmware().printed(), &self.parameters) {
            return Err(format!("the configuration has a parameter that PX4 refuses: {line}"));
        }
        link.stream.limit(self.reply_timeout)?;
        self.rest.of(self, &mut link)?;
        (link.exchanges, link.is_at_rest) = (0, false);
        // An armed firmware may keep its motors at 0.
        if link.is_armed || self.rest.armed_by_channel.is_none() {
            return Ok(link);
        }
        let words = "it is not armed at tick 0 under `armed_by_channel` and the configuration";
        Err(link.stream.firmware().complaint(words))
    }

    fn exchange(&self, link: &mut Link, sensed: &Sensed<'_>) -> Result<Throttles, String> {
        link.is_rc_new |= sensed.is_rc_new;
        let is_due = link.exchanges.is_multiple_of(self.every);
        link.exchanges += 1;
        if is_due {
            self.sense(link, sensed)?;
        }
        if link.stale < STALE_MAX {
            return Ok(link.throttles);
        }
        let words = "it has sent no motor outputs for 0.1 s of its time";
        Err(link.stream.firmware().complaint(words))
    }
}

/// Refuses a period at which the firmware cannot sense.
fn check_period(context: &NodeContext<'_>) -> Result<(), ParameterError> {
    let period_ns = context.tick_ns * u64::from(context.period_ticks);
    refuse(!SENSOR_PERIOD_NS.is_multiple_of(period_ns), "period_ticks", || {
        let period = nine_decimals(context.period_s());
        format!("the period is {period} s, expected one of which 4 ms is a multiple: PX4 senses every 4 ms")
    })
    .map_err(|error| error.advised("choose run.rate_hz and `period_ticks` for a period of 1, 2 or 4 ms"))
}

impl Px4 {
    /// The firmware.
    fn start(&self) -> Result<Stream, String> {
        let scratch = Scratch::new("px4")?;
        let folder = self.build.fill(&scratch, LOCKSTEP, &self.parameters, self.has_ground_station)?;
        let instance = if self.has_ground_station { instance()? } else { 0 };
        let mut command = scratch.command(&folder.program)?;
        command.current_dir(&folder.root).env("LD_PRELOAD", folder::PRELOADED);
        command.env("PATH", PATH).env("PX4_SIM_MODEL", &self.model);
        command.args(["-d", "-i", &instance.to_string(), "-w"]).arg(&folder.root).arg("../etc");
        Stream::start(scratch, command, self.boot_timeout)
    }

    /// Lets the firmware sense a level ground until its start-up script has ended and it sends outputs.
    fn await_start(&self, link: &mut Link) -> Result<(), String> {
        let (imu, rc) = (imu_at_rest(&self.vehicle), RcChannels::default());
        let estimate = self.origin.east_north_up(&StateEstimate::default());
        let sensed = Sensed { time_s: 0.0, imu: &imu, estimate: &estimate, rc: &rc, is_rc_new: true };
        self.receive(link)?;
        while link.sent < START_UP_MAX {
            link.is_rc_new = true;
            self.sense(link, &sensed)?;
            if link.is_started && link.stale == 0 {
                return Ok(());
            }
        }
        let seconds = START_UP_MAX * SENSOR_PERIOD_NS / 1_000_000_000;
        let words = if link.is_started {
            format!("it sends no motor outputs within {seconds} s of its time")
        } else {
            format!("its start-up script has not ended within {seconds} s of its time")
        };
        Err(link.stream.firmware().complaint(&words))
    }

    /// Sends a step's messages, and waits for the answer.
    fn sense(&self, link: &mut Link, sensed: &Sensed<'_>) -> Result<(), String> {
        let time_us = FIRST_TIME_US + link.sent * u64::from(SENSOR_PERIOD_US);
        self.write_messages(link, time_us, sensed);
        link.sent += 1;
        link.stale += 1;
        link.stream.send(&link.messages)?;
        self.receive(link)
    }

    /// Messages of a step. That of the sensors is the last one: it sets the clock.
    fn write_messages(&self, link: &mut Link, time_us: u64, sensed: &Sensed<'_>) {
        let Link { sent, sequence, messages: bytes, is_at_rest, is_rc_new, .. } = link;
        let estimate = sensed.estimate;
        let field_B_T = self.magnetic_field.vector_B_T(estimate.attitude);
        // At rest, a position is one from the place of the rest.
        let start_m = if *is_at_rest { self.origin.turned(self.start_position_m) } else { [0.0; 3] };
        let position: [f64; 3] = estimate.position.into();
        let place = self.origin.place(std::array::from_fn(|axis| start_m[axis] + position[axis]));
        let sample = Sample { time_us, count: *sent, sensed, place, field_B_T };
        bytes.clear();
        bytes.extend(bytemuck::bytes_of(&Head::default()));
        let mut add = |kind: Kind, payload: &dyn Fn(&mut Vec<u8>)| {
            add_frame(bytes, kind, *sequence, payload);
            *sequence = sequence.wrapping_add(1);
        };
        if sent.is_multiple_of(GPS_EVERY) {
            add(HIL_GPS, &|payload| sample.gps(payload));
        }
        // Without this message, the firmware takes its remote control for lost.
        if *is_rc_new && sent.is_multiple_of(CHANNELS_EVERY) {
            *is_rc_new = false;
            add(RC_CHANNELS, &|payload| sample.channels(payload));
        }
        add(HIL_STATE_QUATERNION, &|payload| sample.state(payload));
        let magnetic = if sent.is_multiple_of(MAGNETIC_EVERY) { MAGNETIC_FIELDS } else { 0 };
        let pressure = if sent.is_multiple_of(PRESSURE_EVERY) { PRESSURE_FIELDS } else { 0 };
        add(HIL_SENSOR, &|payload| sample.sensor(INERTIAL_FIELDS | magnetic | pressure, payload));
        let head = Head { length: length(bytes.len() - size_of::<Head>()), value: SENSOR_PERIOD_US };
        bytes[..size_of::<Head>()].copy_from_slice(bytemuck::bytes_of(&head));
    }

    /// Waits until all of the firmware's threads wait, and reads what it has sent by then.
    fn receive(&self, link: &mut Link) -> Result<(), String> {
        let mut head = Head::default();
        link.stream.receive(bytemuck::bytes_of_mut(&mut head))?;
        let bytes = usize::try_from(head.length).unwrap_or(usize::MAX);
        if bytes > ANSWER_MAX {
            return Err(link.stream.firmware().complaint(&format!("it sends {bytes} bytes in a step")));
        }
        link.received.resize(bytes, 0);
        link.stream.receive(&mut link.received)?;
        link.is_started = head.value != 0;
        let answer = answer(&link.received).and_then(|outputs| {
            outputs.map(|outputs| Ok((outputs.is_armed, self.throttles(&outputs)?))).transpose()
        });
        if let Some((is_armed, throttles)) =
            answer.map_err(|words| link.stream.firmware().complaint(&words))?
        {
            (link.is_armed, link.throttles, link.stale) = (is_armed, throttles, 0);
        }
        Ok(())
    }

    /// Outputs by rotor.
    fn throttles(&self, outputs: &Outputs) -> Result<Throttles, String> {
        let motors = &outputs.motors[..self.vehicle.rotors.len()];
        if motors.iter().any(|motor| !motor.is_finite()) {
            return Err(format!("it sends the motor outputs {motors:?}"));
        }
        Ok(Throttles::from_fn(motors.len(), |rotor| f64::from(motors[rotor]).max(0.0)))
    }
}

#[allow(clippy::cast_possible_truncation, reason = "some hundred bytes")]
fn length(bytes: usize) -> u32 {
    bytes as u32
}

/// The first line of the log about a parameter that `commands` set and PX4 does not have. It sets others of itself without having them.
fn refused(log: &str, commands: &str) -> Option<String> {
    let line = log.lines().find(|line| {
        let name = line.split_once("Parameter ").and_then(|(_, rest)| rest.split_once(" not found"));
        name.is_some_and(|(name, _)| commands.contains(&format!("param set {name} ")))
    });
    line.map(str::to_owned)
}

/// The last outputs in `bytes`.
fn answer(bytes: &[u8]) -> Result<Option<Outputs>, String> {
    let mut last = None;
    for payload in frames(HIL_ACTUATOR_CONTROLS, bytes) {
        let outputs = Outputs::read(payload?);
        if !outputs.is_lockstep {
            return Err("it was built without lockstep (ENABLE_LOCKSTEP_SCHEDULER), expected a SITL with it"
                .to_owned());
        }
        last = Some(outputs);
    }
    Ok(last)
}

/// An instance whose port for ground stations is free.
fn instance() -> Result<u16, String> {
    let is_free = |instance: &u16| UdpSocket::bind((Ipv4Addr::UNSPECIFIED, FIRST_PORT + instance)).is_ok();
    INSTANCES.into_iter().find(is_free).ok_or_else(|| {
        let (first, last) = (FIRST_PORT + INSTANCES.start, FIRST_PORT + INSTANCES.end - 1);
        format!("no port for px4's ground stations: the UDP ports {first} to {last} are in use")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A message of outputs.
    fn message(flags: u8, motor: f32) -> Vec<u8> {
        let mut bytes = Vec::new();
        add_frame(&mut bytes, HIL_ACTUATOR_CONTROLS, 0, |payload| {
            payload.extend([0; 8]);
            payload.extend([flags, 0, 0, 0, 0, 0, 0, 0]);
            payload.extend(motor.to_le_bytes());
            payload.extend([0; 61]);
        });
        bytes
    }

    #[test]
    fn a_parameter_that_is_not_there_is_found_in_the_log() {
        let log =
            "ERROR [param] Parameter UXRCE_DDS_KEY not found.\nERROR [param] Parameter MC_ROL_P not found.\n";
        assert_eq!(refused(log, "param set MC_ROLL_P 3\n"), None);
        let line = Some("ERROR [param] Parameter MC_ROL_P not found.".to_owned());
        assert_eq!(refused(log, "param set MC_ROL_P 3\n"), line);
    }

    #[test]
    fn the_last_outputs_count() {
        assert_eq!(answer(&[]), Ok(None));
        let bytes = [message(1, 0.25), message(1, 0.5)].concat();
        assert_eq!(answer(&bytes).unwrap().unwrap().motors[0], 0.5);
        assert!(answer(&message(0, 0.5)).unwrap_err().contains("without lockstep"));
    }
}
