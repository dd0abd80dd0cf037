//! Betaflight's software in the loop, SITL (`src/platform/SIMULATOR/sitl.c` of Betaflight; read at commit 301d01ab).
//!
//! Its own clock is the host's, stretched by what it sees of its packets: with that, no two runs agree, and one that waits for
//! answers stalls. So a library is preloaded (`lockstep.c`), which gives it the run's time, hands it a tick's packets, and takes its
//! motors' outputs. The firmware itself is as it was built.
//!
//! Axes as its packets have them, from x forward, y left, z up: angular velocity (p, −q, r), the specific force negated; the
//! attitude's quaternion, for the compass, w first, conjugated by half a turn about x; velocity east, north, up.

pub mod mixers;

use crate::atmosphere::pressure_Pa;
use crate::autopilot::{Autopilot, Sensed, Throttles};
use crate::layout::Layout;
use crate::origin::Origin;
use crate::process::Scratch;
use crate::rest::{Rest, pulse_us, steps};
use crate::settings;
use crate::stream::Stream;
use bus::component::Info;
use bus::context::NodeContext;
use diagnostics::ParameterError;
use diagnostics::parameter::{positive, up_to};
use mixers::MIXERS;
use std::path::{Path, PathBuf};
use std::time::Duration;
use vehicles::Vehicle;

/// The library that is preloaded.
const LOCKSTEP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/lockstep.so"));
/// The library in the folder in which the firmware runs: a path with a blank or a colon could not be preloaded.
const PRELOADED: &str = "./lockstep.so";
/// Its variable: what the firmware's clock shows when it first waits for packets, in ns.
const BOOT_VARIABLE: &str = "HUMMINGBUS_FIRMWARE_BOOT_NS";
/// Time in which the firmware starts by itself, in s of its own clock.
const BOOT_S: f64 = 2.0;
/// Rest on the ground before tick 0, in s: the gyroscope is calibrated within 1.25 s, and 5 s after its start the firmware may be
/// armed (its setting `pwr_on_arm_grace`).
const REST_S: f64 = 5.0;
/// The last part of that with the arming switch on.
const ARMED_S: f64 = 1.0;
/// Its time without motor outputs after which it flies no more, s: a hundred of its control steps.
const STALE_S: f64 = 0.1;
/// Channels of a packet of the remote control, and motors of a packet of the outputs.
const CHANNELS: usize = 16;
/// Host time that loading the configuration may take; it takes less than 1 s. Half of the default watchdog, so that the run ends
/// with this reason.
const CONFIGURATION_LIMIT: Duration = Duration::from_secs(10);
/// Text that occurs in each of its programs.
const NAME: &str = "Betaflight";
/// Its argument that loads a configuration, since 2026-02-21 (pull request 14935).
const CONFIGURE: &str = "--config";
const WITHOUT_CONFIGURE: &str = "this version of Betaflight cannot load a configuration, expected one from 2026-02-21 on (docs/firmware.md; \
                                 releases up to 2025.12 are older)";
/// Mark of a line of its command line about a command that it refuses.
const REFUSED: &str = "###ERROR";
/// Start of a line behind that, about the values that it takes.
const ALLOWED: &str = "Allowed";

/// Parameters of the firmware.
#[derive(Debug, bus::Parameters)]
pub struct Parameters {
    /// Vehicle file, relative to the manifest.
    #[parameter(file = vehicles::FILE)]
    vehicle: PathBuf,
    /// Betaflight's program for SITL, relative to the manifest.
    #[parameter(file = settings::FIRMWARE)]
    firmware: PathBuf,
    /// File of commands of its command line, which it runs before it flies, relative to the manifest.
    configuration: Option<PathBuf>,
    /// Channel whose switch arms, counted from 1, where the firmware is to be armed at tick 0; none where the pilot arms.
    armed_by_channel: Option<usize>,
    /// Packets of the remote control a second, as receivers of serial protocols send at least.
    #[parameter(default = 50.0, check = positive)]
    rc_rate_hz: f64,
    /// Host time that an answer may take.
    #[parameter(default = settings::reply_timeout_s(), check = up_to(settings::REPLY_TIMEOUT_MAX_S, "s"))]
    reply_timeout_s: f64,
    /// Place on the earth of the world's origin.
    #[parameter(default = Origin::default(), shown = "the home of PX4's simulations, in Zurich", table = Origin)]
    origin: Origin,
}

/// A tick's packets, as `lockstep.c` reads them.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct TickPackets {
    length_ns: u64,
    has_sticks: u64,
    state: StatePacket,
    sticks_time_s: f64,
    channels_us: [u16; CHANNELS],
}

/// The packet of the flight dynamics.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct StatePacket {
    time_s: f64,
    angular_velocity_rad_s: [f64; 3],
    acceleration_m_s2: [f64; 3],
    /// w, x, y, z.
    attitude: [f64; 4],
    velocity_m_s: [f64; 3],
    /// Longitude and latitude in degrees, altitude in m.
    place: [f64; 3],
    pressure_Pa: f64,
}

/// The answer.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Answer {
    is_fresh: u32,
    motors: u16,
    padding: u16,
    pulse_us: [f32; CHANNELS],
}

/// Betaflight as the manifest has it.
#[derive(Debug)]
pub struct Betaflight {
    vehicle: Vehicle,
    layout: Layout,
    firmware: Vec<u8>,
    /// File of the program.
    firmware_path: PathBuf,
    configuration: String,
    /// File of the configuration.
    configuration_path: PathBuf,
    armed_by_channel: Option<usize>,
    period_ns: u64,
    /// Ticks between two packets of the remote control.
    rc_ticks: u64,
    reply_timeout: Duration,
    origin: Origin,
}

/// The firmware that runs.
#[derive(Debug)]
pub struct Link {
    stream: Stream,
    /// Packets sent.
    steps: u64,
    /// Steps since the last motor outputs came.
    stale_steps: u64,
    /// True if channels have come since the last packet of the remote control.
    is_rc_new: bool,
}

impl Autopilot for Betaflight {
    const INFO: Info = Info::new(
        "betaflight",
        "Betaflight's SITL, in lockstep: a process of its own that flies the vehicle",
    );
    type Parameters = Parameters;
    type Link = Link;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { vehicle, firmware, configuration, armed_by_channel, .. } = parameters;
        let files = ParameterError::both(
            program(context, &firmware),
            settings::configuration(context, configuration.as_deref()),
        );
        let rest = ParameterError::both(files, settings::check_arming(armed_by_channel, CHANNELS));
        let ((vehicle, layout), ((program, configured), ())) =
            ParameterError::both(mixed(context, &vehicle), rest)?;
        Ok(Self {
            vehicle,
            layout,
            firmware: program,
            firmware_path: firmware,
            configuration_path: configuration.unwrap_or_default(),
            configuration: configured,
            armed_by_channel,
            period_ns: context.tick_ns * u64::from(context.period_ticks),
            rc_ticks: steps(1.0 / parameters.rc_rate_hz, context.period_s()).max(1),
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
        self.start().map_err(|error| format!("{}: {error}", self.firmware_path.display()))
    }

    fn exchange(&self, link: &mut Link, sensed: &Sensed<'_>) -> Result<Throttles, String> {
        link.is_rc_new |= sensed.is_rc_new;
        let mut packets = self.packets(link.steps, sensed);
        if link.is_rc_new && link.steps.is_multiple_of(self.rc_ticks) {
            (packets.has_sticks, link.is_rc_new) = (1, false);
        }
        link.steps += 1;
        link.stream.send(bytemuck::bytes_of(&packets))?;
        let answer = link.receive()?;
        link.stale_steps = if answer.is_fresh == 0 { link.stale_steps + 1 } else { 0 };
        let throttles = if link.stale_steps < steps(STALE_S, self.period_ns as f64 * 1e-9).max(1) {
            self.throttles(&answer)
        } else {
            Err(format!("it has sent no motor outputs for {STALE_S} s of its time"))
        };
        throttles.map_err(|words| link.stream.firmware().complaint(&words))
    }
}

/// The vehicle at `path`, for which the firmware has a mixer. Warns of its oddities.
fn mixed(context: &NodeContext<'_>, path: &Path) -> Result<(Vehicle, Layout), ParameterError> {
    let vehicle = settings::vehicle(context, path)?;
    let layout = Layout::of(&vehicle.rotors, &MIXERS)
        .map_err(|reason| settings::refused_vehicle(&vehicle, &reason))?;
    layout.warn_of_oddities(&vehicle, context);
    Ok((vehicle, layout))
}

/// The program at `path`, which is Betaflight's SITL and can load a configuration.
fn program(context: &NodeContext<'_>, path: &Path) -> Result<Vec<u8>, ParameterError> {
    let program = settings::preloadable(context, path, "Betaflight's SITL, obj/main/betaflight_SITL.elf")?;
    settings::require_text(&program, path, NAME, "it is not Betaflight's SITL")?;
    settings::require_text(&program, path, CONFIGURE, WITHOUT_CONFIGURE)?;
    Ok(program)
}

impl Betaflight {
    /// Loads the configuration, and starts the firmware.
    fn start(&self) -> Result<Link, String> {
        let scratch = Scratch::new("betaflight")?;
        let program = scratch.write("betaflight", &self.firmware)?;
        scratch.write("lockstep.so", LOCKSTEP)?;
        let configuration = scratch.write("configuration", self.commands().as_bytes())?;
        let mut configure = scratch.command(&program)?;
        configure.env("LD_PRELOAD", PRELOADED).arg(CONFIGURE).arg(configuration);
        let printed = scratch
            .run(configure, CONFIGURATION_LIMIT)
            .map_err(|error| format!("it does not load its configuration: {error}"))?;
        if let Some(refusal) = refusal(&printed) {
            return Err(self.refused(&refusal));
        }
        let mut command = scratch.command(&program)?;
        command.env("LD_PRELOAD", PRELOADED).env(BOOT_VARIABLE, nanoseconds(BOOT_S).to_string());
        let stream = Stream::start(scratch, command, self.reply_timeout)?;
        let mut link = Link { stream, steps: 0, stale_steps: 0, is_rc_new: false };
        link.receive()?;
        if self.rest().of(self, &mut link)? {
            return Ok(link);
        }
        let words = "it is not armed at tick 0: its motors stand still under `armed_by_channel` and the configuration";
        Err(link.stream.firmware().complaint(words))
    }

    /// The refusal of a command, at its line of the configuration.
    fn refused(&self, refusal: &Refusal<'_>) -> String {
        let Refusal { command, reason, allowed } = refusal;
        let mut lines = self.configuration.lines();
        let line = lines.position(|line| !command.is_empty() && line.trim() == *command);
        let place =
            line.map_or(String::new(), |at| format!("{}:{}: ", self.configuration_path.display(), at + 1));
        let allowed = if allowed.is_empty() { String::new() } else { format!(" ({allowed})") };
        format!(
            "{place}the configuration has a command that Betaflight refuses: `{command}`: {reason}{allowed}"
        )
    }

    /// Input of its command line: the commands of the configuration, then the mixer of the vehicle, which they may not undo,
    /// and `save`.
    fn commands(&self) -> String {
        let Layout { frame: mixer, is_reversed, .. } = self.layout;
        let reversed = if is_reversed { "ON" } else { "OFF" };
        let ends = |line: &&str| matches!(line.split_whitespace().next(), Some("save" | "exit" | "batch"));
        let kept: String =
            self.configuration.lines().filter(|line| !ends(line)).flat_map(|line| [line, "\n"]).collect();
        format!("{kept}mixer {mixer}\nset yaw_motors_reversed = {reversed}\nsave\n")
    }

    fn rest(&self) -> Rest {
        Rest {
            time_s: REST_S,
            armed_s: ARMED_S,
            armed_by_channel: self.armed_by_channel,
            period_s: self.period_ns as f64 * 1e-9,
        }
    }

    /// The packets of a tick, the `step`th of the firmware, without that of the remote control.
    fn packets(&self, step: u64, sensed: &Sensed<'_>) -> TickPackets {
        let time_s = BOOT_S + (step + 1) as f64 * self.period_ns as f64 * 1e-9;
        let Sensed { imu, estimate, rc, .. } = sensed;
        let (rates, force, attitude) = (imu.angular_velocity, imu.specific_force, estimate.attitude);
        let position = estimate.position;
        // SITL mirrors longitude and latitude about its first packet, since those of Gazebo are mirrored (`sitl.c`,
        // ENABLE_GAZEBO_BRIDGE, on by default). The first packet is of the origin.
        let place = self.origin.place([-position.x, -position.y, position.z]);
        let state = StatePacket {
            time_s,
            angular_velocity_rad_s: [rates.x, -rates.y, rates.z],
            acceleration_m_s2: [-force.x, -force.y, -force.z],
            attitude: [attitude.w, attitude.x, -attitude.y, -attitude.z],
            velocity_m_s: estimate.velocity.into(),
            place,
            pressure_Pa: pressure_Pa(place[2]),
        };
        TickPackets {
            length_ns: self.period_ns,
            has_sticks: 0,
            state,
            sticks_time_s: time_s,
            channels_us: std::array::from_fn(|at| pulse_us(rc, at)),
        }
    }

    /// Outputs by rotor.
    fn throttles(&self, answer: &Answer) -> Result<Throttles, String> {
        let count = self.vehicle.rotors.len();
        let pulses_us = &answer.pulse_us[..count];
        if usize::from(answer.motors) < count || pulses_us.iter().any(|pulse| !pulse.is_finite()) {
            let motors = answer.motors;
            return Err(format!("it sends {motors} motor outputs, {pulses_us:?} us, for {count} rotors"));
        }
        let mut throttles = Throttles::filled(count, 0.0);
        for (pulse_us, rotor) in pulses_us.iter().zip(&self.layout.motors) {
            throttles[*rotor] = (f64::from(*pulse_us) - 1000.0).max(0.0) / 1000.0;
        }
        Ok(throttles)
    }
}

/// A command that the firmware refuses: the command, its reason, and the values that it takes, where it prints them.
#[derive(Debug, PartialEq)]
struct Refusal<'a> {
    command: &'a str,
    reason: &'a str,
    allowed: &'a str,
}

/// The first command that the firmware refuses, by the text that it has printed: it prints each command behind a prompt before its answer.
fn refusal(printed: &str) -> Option<Refusal<'_>> {
    let lines: Vec<&str> = printed.lines().collect();
    let at = lines.iter().position(|line| line.contains(REFUSED))?;
    let before = at.checked_sub(1).map_or("", |at| lines[at]);
    let behind = lines.get(at + 1).filter(|line| line.starts_with(ALLOWED));
    Some(Refusal {
        command: before.trim_start_matches(['#', ' ']).trim_end(),
        reason: lines[at],
        allowed: behind.map_or("", |line| line.trim_end()),
    })
}

impl Link {
    fn receive(&mut self) -> Result<Answer, String> {
        let mut answer = Answer::default();
        self.stream.receive(bytemuck::bytes_of_mut(&mut answer))?;
        Ok(answer)
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use bus::messages::{Imu, Quaternion, RcChannels, StateEstimate};

    fn hummingbird() -> Betaflight {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        Betaflight {
            layout: Layout::of(&vehicle.rotors, &MIXERS).unwrap(),
            vehicle,
            firmware: Vec::new(),
            firmware_path: PathBuf::from("betaflight_SITL.elf"),
            configuration_path: PathBuf::from("bird.cli"),
            configuration: "aux 0 0 0 1700 2100 0 0\nsave\n".to_owned(),
            armed_by_channel: None,
            period_ns: 1_000_000,
            rc_ticks: 20,
            reply_timeout: Duration::from_secs(1),
            origin: Origin::default(),
        }
    }

    /// Axes of the packets of SITL against body x forward, y left, z up.
    #[test]
    fn axes_and_units_are_those_of_the_packets() {
        let imu = Imu {
            angular_velocity: [0.1, 0.2, 0.3].into(),
            specific_force: [1.0, 2.0, 9.81].into(),
            ..Imu::default()
        };
        let attitude = Quaternion { x: 0.1, y: 0.2, z: 0.3, w: 0.9 };
        let estimate = StateEstimate {
            attitude,
            velocity: [3.0, 4.0, 5.0].into(),
            position: [0.0, 111.195, 12.0].into(),
            ..StateEstimate::default()
        };
        let rc =
            RcChannels { pulse: [1500.4, 1500.6, 900.0, 9000.0, 2000.0].into(), ..RcChannels::default() };
        let sensed = Sensed { time_s: 0.0, imu: &imu, estimate: &estimate, rc: &rc, is_rc_new: true };
        let betaflight = hummingbird();
        let packets = betaflight.packets(20, &sensed);
        let state = packets.state;
        assert_eq!(state.time_s, 2.021, "the firmware's time goes on from its start");
        assert_eq!(state.angular_velocity_rad_s, [0.1, -0.2, 0.3]);
        assert_eq!(state.acceleration_m_s2, [-1.0, -2.0, -9.81]);
        assert_eq!(state.attitude, [0.9, 0.1, -0.2, -0.3], "w first");
        assert_eq!(state.velocity_m_s, [3.0, 4.0, 5.0], "east, north, up");
        let [longitude_deg, latitude_deg, altitude_m] = state.place;
        assert_eq!((longitude_deg, altitude_m), (8.545_594, 500.0));
        assert!(
            (latitude_deg - 47.396_742).abs() < 1e-8,
            "{latitude_deg}: 0.001 degrees to the north, mirrored"
        );
        // ISO 2533: 95.46 kPa at 500 m.
        assert!((state.pressure_Pa - 95_461.0).abs() < 5.0, "{}", state.pressure_Pa);
        assert_eq!(packets.channels_us[..6], [1500, 1501, 900, 2200, 2000, 1000], "what is not sent is off");
    }

    #[test]
    fn motors_reach_their_rotors_and_the_mixer_the_command_line() {
        let betaflight = hummingbird();
        let mut answer = Answer { motors: 4, ..Answer::default() };
        // Rear, right, left, front.
        answer.pulse_us[..4].copy_from_slice(&[1100.0, 1200.0, 1300.0, 1400.0]);
        assert_eq!(betaflight.throttles(&answer).unwrap(), [0.4, 0.2, 0.1, 0.3], "front, right, rear, left");
        answer.pulse_us[1] = f32::NAN;
        assert!(betaflight.throttles(&answer).unwrap_err().contains("NaN"), "no output is taken for a stop");
        let commands = "aux 0 0 0 1700 2100 0 0\nmixer QUADP\nset yaw_motors_reversed = OFF\nsave\n";
        assert_eq!(betaflight.commands(), commands);
    }

    /// Text of the real firmware.
    #[test]
    fn a_refused_command_is_found_in_the_printed_text_and_in_its_file() {
        let mut betaflight = hummingbird();
        betaflight.configuration = "aux 0 0 0 1700 2100 0 0\nset p_roll = 99999\n".to_owned();
        let printed = "# aux 0 0 0 1700 2100 0 0\n# set p_roll = 99999\n###ERROR IN set: INVALID VALUE###\nAllowed range: 0 - 250\n";
        assert_eq!(
            betaflight.refused(&refusal(printed).unwrap()),
            "bird.cli:2: the configuration has a command that Betaflight refuses: `set p_roll = 99999`: ###ERROR IN set: INVALID \
             VALUE### (Allowed range: 0 - 250)"
        );
        assert_eq!(refusal("# aux 0 0 0 1700 2100 0 0\nsaved\n"), None);
        let other = refusal("###ERROR IN set: INVALID VALUE###").unwrap();
        assert_eq!((other.command, other.allowed), ("", ""));
    }
}
