//! ArduCopter's software in the loop, SITL, by its JSON interface (`libraries/SITL/SIM_JSON.cpp` of ArduPilot; read in several
//! versions, flown with 4.6.0-dev).
//!
//! The firmware sends first: a packet of its outputs. Then it waits for the answer, which is the tick's sensors as JSON, and whose
//! timestamp is its clock. So it is in lockstep by itself. The remote control has a port of its own (`remote_control`).
//!
//! Axes as its answer has them: body forward, right, down; world north, east, down. The world's x is east, its y north
//! ([`crate::origin`]).

mod answer;
mod frames;
mod outputs;
mod parameter_file;
mod remote_control;

use crate::autopilot::{Autopilot, Sensed, Throttles};
use crate::datagrams::{self, Datagrams};
use crate::layout::Layout;
use crate::origin::Origin;
use crate::parameter_lines;
use crate::process::Scratch;
use crate::rest::Rest;
use crate::settings;
use bus::component::Info;
use bus::context::NodeContext;
use diagnostics::parameter::{refuse, up_to};
use diagnostics::{ParameterError, nine_decimals};
use frames::{FRAMES, FrameNumbers};
use outputs::Outputs;
use remote_control::RemoteControl;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use vehicles::Vehicle;

/// Part of the rest with the arming switch on, s: the motors of ArduCopter stand still for 2 s after it is armed
/// (`ARMING_DELAY_SEC`), and are then spun up.
const ARMED_S: f64 = 4.0;
/// Longest step of the firmware's clock, s; a longer one is not taken (`SIM_JSON.cpp`).
const PERIOD_MAX_S: f64 = 0.1;
/// Text that occurs in each of its programs.
const NAME: &str = "ArduCopter";
/// Date of the firmware's start, by which its GPS tells the time: 2025-01-01T00:00:00Z, in seconds since 1970. Without it, it is the host's.
const START_TIME_S: u32 = 1_735_689_600;
/// Name of the parameter file in the folder of the firmware.
const PARAMETER_FILE: &str = "hummingbus.parm";
/// Serial ports that stay closed: by default 0 waits for a connection, and 0 to 2 have fixed TCP ports, on which a second
/// firmware would fail. Ports 3 and 4 are the simulated GPS.
const CLOSED_PORTS: [u8; 7] = [0, 1, 2, 5, 6, 7, 8];

/// Parameters of the firmware.
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// ArduCopter's program for SITL, relative to the manifest.
    #[parameter(file = settings::FIRMWARE)]
    firmware: PathBuf,
    /// File of its parameters, relative to the manifest.
    configuration: Option<PathBuf>,
    /// Further arguments of the program; they count more than those of this component.
    #[parameter(default = Vec::new())]
    arguments: Vec<String>,
    /// Channel whose switch arms, counted from 1, where the firmware is to be armed at tick 0; none where the pilot arms.
    armed_by_channel: Option<usize>,
    /// Simulated time before tick 0 in which its estimator settles.
    ///
    /// The estimator (EKF3) aligns its attitude within 6 s, and uses its GPS from 41 s on (measured, ArduCopter 4.6.0-dev); the last 4 s
    /// are for arming.
    #[parameter(default = 45.0, check = up_to(settings::REST_MAX_S, "s"))]
    rest_s: f64,
    /// Host time that an answer may take.
    #[parameter(default = settings::reply_timeout_s(), check = up_to(settings::REPLY_TIMEOUT_MAX_S, "s"))]
    reply_timeout_s: f64,
    /// Place on the earth of the world's origin.
    #[parameter(default = Origin::default(), shown = "the home of PX4's simulations, in Zurich", table = Origin)]
    origin: Origin,
}

/// ArduCopter as the manifest has it.
#[derive(Debug)]
pub struct ArduPilot {
    vehicle: Vehicle,
    layout: Layout,
    firmware: Vec<u8>,
    /// Text of the parameter file.
    parameters: String,
    arguments: Vec<String>,
    rest: Rest,
    reply_timeout: Duration,
    origin: Origin,
}

/// Ports of the loopback by which the firmware talks to the simulator.
#[derive(Debug)]
struct Ports {
    /// Port of this process, to which it sends its outputs.
    output: u16,
    /// For its sensors; it has none with the JSON interface, but needs a number.
    input: u16,
    /// For its remote control.
    rc: u16,
    /// For its landing beacon.
    beacon: u16,
}

/// The firmware that runs.
#[derive(Debug)]
pub struct Link {
    datagrams: Datagrams,
    remote_control: RemoteControl,
    /// Answers sent.
    steps: u64,
    /// Frame count of its last packet.
    frame: u32,
}

impl Autopilot for ArduPilot {
    const INFO: Info =
        Info::new("ardupilot", "ArduCopter's SITL, in lockstep: a process of its own that flies the vehicle");
    type Parameters = Parameters;
    type Link = Link;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { vehicle, firmware, configuration, armed_by_channel, rest_s, .. } = parameters;
        let period_s = context.period_s();
        let framed = framed(context, &vehicle);
        let program = program(context, &firmware);
        let configured = settings::configuration(context, configuration.as_deref());
        let configured = configured.and_then(parameter_lines::checked);
        let checks = ParameterError::gather([
            settings::check_arming(armed_by_channel, remote_control::CHANNELS),
            settings::check_rest(rest_s, ARMED_S, armed_by_channel),
            check_period(period_s),
        ]);
        let rest = ParameterError::both(configured, checks);
        let (framed, (program, (configured, _))) =
            ParameterError::both(framed, ParameterError::both(program, rest))?;
        let (vehicle, layout, numbers) = framed;
        let text = parameter_file::text(&configured, &numbers, vehicle.rotors.len())?;
        Ok(Self {
            layout,
            vehicle,
            firmware: program,
            parameters: text,
            arguments: parameters.arguments,
            rest: Rest { time_s: rest_s, armed_s: ARMED_S, armed_by_channel, period_s },
            reply_timeout: settings::reply_timeout(parameters.reply_timeout_s),
            origin: parameters.origin,
        })
    }

    fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    fn origin(&self) -> &Origin {
        &self.origin
    }

    fn boot(&self) -> Result<Link, String> {
        let scratch = Scratch::new("ardupilot")?;
        let program = scratch.write("ardupilot", &self.firmware)?;
        scratch.write(PARAMETER_FILE, self.parameters.as_bytes())?;
        let no_socket = |error: io::Error| format!("no socket to ardupilot: {error}");
        let (socket, sticks) =
            (datagrams::bound().map_err(no_socket)?, datagrams::bound().map_err(no_socket)?);
        let output = socket.local_addr().map_err(no_socket)?.port();
        let [input, rc, beacon] = datagrams::free_ports().map_err(no_socket)?;
        let mut command = scratch.command(&program)?;
        self.add_arguments(&mut command, &Ports { output, input, rc, beacon });
        let mut datagrams = Datagrams::start(scratch, command, socket, self.reply_timeout)?;
        let first = datagrams.receive(|bytes| Outputs::read(bytes).map(Some))?;
        let remote_control = RemoteControl::new(sticks, rc);
        let mut link = Link { datagrams, remote_control, steps: 0, frame: first.frame };
        if self.rest.of(self, &mut link)? {
            return Ok(link);
        }
        let words = "it is not armed at tick 0: its motors stand still under `armed_by_channel` and the configuration";
        Err(link.datagrams.firmware().complaint(words))
    }

    fn exchange(&self, link: &mut Link, sensed: &Sensed<'_>) -> Result<Throttles, String> {
        link.steps += 1;
        // Without datagrams, the firmware takes its remote control for lost.
        if sensed.is_rc_new {
            link.remote_control.send(sensed.rc)?;
        }
        let time_s = answer::timestamp_s(link.steps, self.rest.period_s);
        link.datagrams.send(answer::text(time_s, sensed).as_bytes())?;
        let last = link.frame;
        let outputs = link.datagrams.receive(|bytes| Outputs::read(bytes)?.after(last))?;
        link.frame = outputs.frame;
        Ok(self.throttles(&outputs))
    }
}

/// The vehicle at `path` in a frame of the firmware. Warns of its oddities.
fn framed(context: &NodeContext<'_>, path: &Path) -> Result<(Vehicle, Layout, FrameNumbers), ParameterError> {
    let vehicle = settings::vehicle(context, path)?;
    let refused = |reason: String| settings::refused_vehicle(&vehicle, &reason);
    let layout = Layout::of(&vehicle.rotors, &FRAMES).map_err(refused)?;
    let numbers = FrameNumbers::of(&layout).map_err(refused)?;
    layout.warn_of_oddities(&vehicle, context);
    Ok((vehicle, layout, numbers))
}

/// The program at `path`, which is ArduCopter's SITL.
fn program(context: &NodeContext<'_>, path: &Path) -> Result<Vec<u8>, ParameterError> {
    let program = settings::program(context, path, "ArduCopter's SITL, build/sitl/bin/arducopter")?;
    settings::require_text(&program, path, NAME, "it is not ArduCopter's SITL")?;
    Ok(program)
}

/// Refuses a period that the firmware's clock cannot take as a step.
fn check_period(period_s: f64) -> Result<(), ParameterError> {
    let period_us = period_s * 1e6;
    let is_short = refuse(period_s >= PERIOD_MAX_S, "period_ticks", || {
        format!(
            "the period is {} s, expected less than {PERIOD_MAX_S} s: ArduPilot's clock takes no longer step",
            nine_decimals(period_s)
        )
    })
    .map_err(|error| error.advised("lower `period_ticks`, or raise run.rate_hz"));
    let is_whole = refuse((period_us - period_us.round()).abs() > 1e-6, "period_ticks", || {
        format!(
            "the period is {} us, expected whole microseconds: ArduPilot's clock cuts each step to them",
            nine_decimals(period_us)
        )
    })
    .map_err(|error| {
        error.advised("choose run.rate_hz so that a tick has whole microseconds, such as 1000 or 400")
    });
    ParameterError::both(is_short, is_whole).map(drop)
}

impl ArduPilot {
    /// Arguments of the program.
    fn add_arguments(&self, command: &mut Command, ports: &Ports) {
        // The vehicle that rests heads along the world's x.
        let Origin { latitude_deg, longitude_deg, altitude_m, x_azimuth_deg } = self.origin;
        command.args(["--model", "JSON:127.0.0.1", "--speedup", "1", "--defaults", PARAMETER_FILE]);
        command.arg("--home").arg(format!("{latitude_deg},{longitude_deg},{altitude_m},{x_azimuth_deg}"));
        command.arg("--start-time").arg(START_TIME_S.to_string());
        let Ports { output, input, rc, beacon } = ports;
        let ports =
            [("sim-port-out", output), ("sim-port-in", input), ("rc-in-port", rc), ("irlock-port", beacon)];
        for (name, port) in ports {
            command.arg(format!("--{name}")).arg(port.to_string());
        }
        for port in CLOSED_PORTS {
            command.arg(format!("--serial{port}")).arg("none:0");
        }
        command.args(&self.arguments);
    }

    /// Outputs by rotor.
    fn throttles(&self, outputs: &Outputs) -> Throttles {
        let mut throttles = Throttles::filled(self.vehicle.rotors.len(), 0.0);
        for (pulse_us, rotor) in outputs.pulse_us.iter().zip(&self.layout.motors) {
            throttles[*rotor] = (f64::from(*pulse_us) - parameter_file::PULSE_MIN_US).max(0.0)
                / parameter_file::PULSE_RANGE_US;
        }
        throttles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hummingbird() -> ArduPilot {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        ArduPilot {
            layout: Layout::of(&vehicle.rotors, &FRAMES).unwrap(),
            vehicle,
            firmware: Vec::new(),
            parameters: String::new(),
            arguments: vec!["--serial0".to_owned(), "tcp:0".to_owned()],
            rest: Rest { time_s: 45.0, armed_s: ARMED_S, armed_by_channel: None, period_s: 1e-3 },
            reply_timeout: Duration::from_secs(1),
            origin: Origin::default(),
        }
    }

    #[test]
    fn motors_reach_their_rotors() {
        // Right, left, front, rear.
        let mut pulse_us = [1500; outputs::CHANNELS_MAX];
        pulse_us[..4].copy_from_slice(&[1200, 1300, 1400, 0]);
        let throttles = hummingbird().throttles(&Outputs { frame: 0, pulse_us });
        assert_eq!(throttles, [0.4, 0.2, 0.0, 0.3], "front, right, rear, left");
    }

    #[test]
    fn arguments_name_the_ports_and_the_users_are_last() {
        let mut command = Command::new("arducopter");
        hummingbird().add_arguments(&mut command, &Ports { output: 4711, input: 1, rc: 4712, beacon: 2 });
        let arguments: Vec<&str> = command.get_args().map(|argument| argument.to_str().unwrap()).collect();
        let text = arguments.join(" ");
        assert!(
            text.contains("--home 47.397742,8.545594,488,90 --start-time 1735689600 --sim-port-out 4711 ")
                && text.contains(" --rc-in-port 4712 "),
            "{text}"
        );
        assert!(
            text.contains("--serial0 none:0 --serial1 none:0 ") && text.ends_with(" --serial0 tcp:0"),
            "{text}"
        );
    }
}
