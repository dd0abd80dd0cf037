//! A pilot's thumbs: turns set points into the channels of a remote control, for autopilots that fly by sticks.
//!
//! Roll and pitch go to their sticks in proportion to the angle at which the firmware has full sticks. Yaw is held by a turn
//! of the yaw stick, which asks for a rate. The altitude is held by the throttle, since an angle mode leaves it to the pilot:
//! a climb of Kx·(altitude − height), and throttle = hover + Kv·(climb − measured) + integral of Ki·(climb − measured), as a
//! pilot corrects what the battery takes. Switches move at their times.

use crate::angle::wrap_rad;
use crate::pulses::check_pulse;
use component::context::{NodeContext, StepContext};
use component::messages::{RC_CHANNELS_MAX, RcChannels, SetPoint, StateEstimate};
use component::{Bounded, Component, Info, InputPorts, OutputPorts, StepError};
use diagnostics::parameter::{ParameterError, finite, not_negative, positive, require, within};
use nalgebra::{Quaternion, UnitQuaternion};

/// Channels before the first switch: roll, pitch, throttle, yaw.
const STICKS: usize = 4;
/// Pulses of a stick in its middle, and from there to its end, µs.
const MIDDLE_US: f64 = 1500.0;
const HALF_US: f64 = 500.0;
/// Pulses of a throttle at its lower end, and over its whole way; a switch that is off has the former.
const LOW_US: f64 = 1000.0;
const WHOLE_US: f64 = 1000.0;

/// Parameters of the remote control.
#[derive(Debug, Clone, component::Parameters)]
pub struct Parameters {
    /// Angle of the firmware's angle mode at full stick.
    #[parameter(check = positive, example = "30.0")]
    tilt_max_deg: f64,
    /// Yaw rate of the firmware at full stick.
    #[parameter(check = positive, example = "100.0")]
    yaw_rate_max_deg_s: f64,
    /// Throttle at hover.
    #[parameter(check = within(0.0..=1.0, "0 to 1"), example = "0.4")]
    hover_throttle: f64,
    /// Error of the altitude to a climb, Kx.
    #[parameter(default = 1.5, check = not_negative)]
    altitude_1_s: f64,
    /// Greatest speed of climbing and sinking.
    #[parameter(default = 1.0, check = positive)]
    climb_max_m_s: f64,
    /// Error of the climb to throttle, Kv.
    #[parameter(default = 0.12, check = not_negative)]
    climb_s_m: f64,
    /// The same, integrated, Ki.
    #[parameter(default = 0.06, check = not_negative)]
    climb_integral_1_m: f64,
    /// Error of the yaw to a yaw rate.
    #[parameter(default = 2.0, check = not_negative)]
    yaw_1_s: f64,
    /// List of moves of switches; a switch that has not moved sends 1000 µs.
    #[parameter(default = Vec::new(), table = Switch, entry = "N")]
    switches: Vec<Switch>,
}

/// A switch that moves.
#[derive(Debug, Clone, Copy, component::Parameters)]
struct Switch {
    /// Its channel, counted from 1; the first four are the sticks.
    #[parameter(check = check_switch)]
    channel: usize,
    /// Time of the move.
    #[parameter(check = finite)]
    at_s: f64,
    /// Pulses from then on.
    #[parameter(unit = "µs", check = check_pulse)]
    pulse_us: f64,
}

/// Requires a channel behind the sticks.
fn check_switch(key: &str, channel: f64) -> Result<(), ParameterError> {
    let first = STICKS + 1;
    let is_there = (first as f64..=RC_CHANNELS_MAX as f64).contains(&channel);
    require(key, channel, is_there, format!("{first} to {RC_CHANNELS_MAX}"))
}

/// Inputs of the remote control.
#[derive(Debug, InputPorts)]
pub struct Inputs<'a> {
    /// Set point of the pilot.
    pub set_point: &'a SetPoint,
    /// The motion that he sees.
    pub estimate: &'a StateEstimate,
}

/// Outputs of the remote control.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Its channels.
    pub rc: RcChannels,
}

/// State of the remote control.
#[derive(Debug, Clone, Copy, Default, PartialEq, component::Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/RemoteControlState")]
pub struct RemoteControlState {
    /// Throttle that the integral has added to that of hover.
    #[field(unit = "1")]
    pub throttle: f64,
}

/// The component `remote-control`.
///
/// ```
/// use component::messages::{SetPoint, StateEstimate};
/// use controllers::remote_control::{Inputs, RemoteControl};
///
/// let parameters = serde_json::json!({ "tilt_max_deg": 30, "yaw_rate_max_deg_s": 90, "hover_throttle": 0.4,
///     "switches": [{ "channel": 5, "at_s": 0.0, "pulse_us": 2000 }] });
/// let mut sticks = component::Harness::<RemoteControl>::from_json(&parameters).unwrap();
/// let set_point = SetPoint { roll: 15_f64.to_radians(), ..Default::default() };
/// let rc = sticks.step(Inputs { set_point: &set_point, estimate: &StateEstimate::default() }).unwrap().rc;
/// assert_eq!(rc.pulse, [1750.0, 1500.0, 1400.0, 1500.0, 2000.0], "µs: half of the roll stick's way, hover, and the switch");
/// ```
#[derive(Debug, Clone)]
pub struct RemoteControl {
    parameters: Parameters,
    period_s: f64,
}

impl Component for RemoteControl {
    const INFO: Info = Info::new(
        "remote-control",
        "turns set points into the sticks and switches of a remote control, for autopilots",
    );
    type Parameters = Parameters;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = RemoteControlState;

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        if let Some(Switch { channel, at_s, pulse_us }) = never_acting(&parameters.switches) {
            let message = format!(
                "`switches` moves channel {channel} twice at {at_s} s: the move to {pulse_us} µs never acts; leave it out"
            );
            context.warn("switches", message);
        }
        Ok(Self { parameters, period_s: context.period_s() })
    }

    fn initial(&self) -> RemoteControlState {
        RemoteControlState::default()
    }

    fn step(
        &self,
        context: &StepContext<'_>,
        Inputs { set_point, estimate }: Inputs<'_>,
        state: &mut RemoteControlState,
    ) -> Result<Outputs, StepError> {
        let Parameters { tilt_max_deg, yaw_rate_max_deg_s, .. } = self.parameters;
        let stick = |part: f64| MIDDLE_US + HALF_US * part.clamp(-1.0, 1.0);
        let tilt = |angle_rad: f64| stick(angle_rad.to_degrees() / tilt_max_deg);
        // To the right is clockwise from above, against the yaw.
        let turn = -self.yaw_rate_rad_s(set_point, estimate).to_degrees() / yaw_rate_max_deg_s;
        let throttle = self.throttle(set_point, estimate, state);
        let sticks = [tilt(set_point.roll), tilt(set_point.pitch), LOW_US + WHOLE_US * throttle, stick(turn)];
        let last = self.parameters.switches.iter().map(|switch| switch.channel).max().unwrap_or(STICKS);
        let channel =
            |at: usize| sticks.get(at).copied().unwrap_or_else(|| self.switched(at + 1, context.time_s()));
        let pulse = Bounded::from_fn(last, channel);
        Ok(Outputs { rc: RcChannels { pulse, ..Default::default() } })
    }
}

/// Returns the first of `switches` that a later one of the same channel and time replaces.
fn never_acting(switches: &[Switch]) -> Option<&Switch> {
    let is_twin = |a: &Switch, b: &Switch| a.channel == b.channel && a.at_s.total_cmp(&b.at_s).is_eq();
    let mut all = switches.iter().enumerate();
    all.find_map(|(at, first)| switches[at + 1..].iter().any(|other| is_twin(first, other)).then_some(first))
}

impl RemoteControl {
    fn yaw_rate_rad_s(&self, set_point: &SetPoint, estimate: &StateEstimate) -> f64 {
        let component::messages::Quaternion { x, y, z, w } = estimate.attitude;
        let (_, _, yaw_rad) = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).euler_angles();
        self.parameters.yaw_1_s * wrap_rad(set_point.yaw - yaw_rad)
    }

    /// Throttle of this step, 0 to 1; beyond these ends the integral does not grow.
    fn throttle(
        &self,
        set_point: &SetPoint,
        estimate: &StateEstimate,
        state: &mut RemoteControlState,
    ) -> f64 {
        let Parameters { altitude_1_s, climb_max_m_s, climb_s_m, climb_integral_1_m, hover_throttle, .. } =
            self.parameters;
        let asked_m_s = altitude_1_s * (set_point.altitude - estimate.position.z);
        let error_m_s = asked_m_s.clamp(-climb_max_m_s, climb_max_m_s) - estimate.velocity.z;
        let throttle = hover_throttle + climb_s_m * error_m_s + state.throttle;
        let is_beyond = throttle > 1.0 && error_m_s > 0.0 || throttle < 0.0 && error_m_s < 0.0;
        if !is_beyond {
            state.throttle += climb_integral_1_m * error_m_s * self.period_s;
        }
        throttle.clamp(0.0, 1.0)
    }

    /// Pulses of the switch `channel` at `time_s`: those of its last move.
    fn switched(&self, channel: usize, time_s: f64) -> f64 {
        let moves = self
            .parameters
            .switches
            .iter()
            .filter(|switch| switch.channel == channel && switch.at_s <= time_s);
        moves.max_by(|a, b| a.at_s.total_cmp(&b.at_s)).map_or(LOW_US, |switch| switch.pulse_us)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sticks(more: serde_json::Value) -> component::Harness<RemoteControl> {
        let mut parameters =
            serde_json::json!({ "tilt_max_deg": 30, "yaw_rate_max_deg_s": 90, "hover_throttle": 0.4 });
        parameters.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        component::Harness::from_json(&parameters).unwrap()
    }

    #[test]
    fn a_switch_that_moves_twice_at_one_time_is_warned_of() {
        let told = |second_s: f64| {
            let context = NodeContext::new("sticks", &[]);
            let parameters = serde_json::json!({ "tilt_max_deg": 30, "yaw_rate_max_deg_s": 90, "hover_throttle": 0.4, "switches": [
                { "channel": 5, "at_s": 1.0, "pulse_us": 2000 }, { "channel": 5, "at_s": second_s, "pulse_us": 1000 },
            ] });
            RemoteControl::new(serde_json::from_value(parameters).unwrap(), &context).unwrap();
            context.into_warnings().into_iter().map(|warning| warning.message).collect::<Vec<_>>()
        };
        assert!(told(1.0)[0].contains("channel 5 twice at 1 s: the move to 2000 µs never acts"));
        assert_eq!(told(2.0), [""; 0]);
    }

    /// An integral beyond full throttle comes back when the vehicle is too high, also where nothing else answers.
    #[test]
    fn the_integral_comes_back_from_full_throttle() {
        let mut sticks = sticks(serde_json::json!({ "climb_s_m": 0, "climb_integral_1_m": 2 }));
        let mut throttle_us = |altitude: f64| {
            let set_point = SetPoint { altitude, ..Default::default() };
            let estimate = StateEstimate::default();
            let mut step =
                || sticks.step(Inputs { set_point: &set_point, estimate: &estimate }).unwrap().rc.pulse[2];
            (0..1000).map(|_| step()).last().unwrap()
        };
        assert_eq!(throttle_us(10.0), 2000.0);
        assert!(throttle_us(-10.0) < 1100.0);
    }

    /// A yaw to the left is a stick to the left; switches keep the pulses of their last move.
    #[test]
    fn yaw_and_switches_have_their_signs_and_times() {
        let moves = serde_json::json!([
            { "channel": 6, "at_s": 0.002, "pulse_us": 1500 },
            { "channel": 6, "at_s": 0.001, "pulse_us": 2000 }
        ]);
        let mut sticks = sticks(serde_json::json!({ "switches": moves }));
        let set_point = SetPoint { yaw: 0.1, ..Default::default() };
        let estimate = StateEstimate::default();
        let mut step =
            || sticks.step(Inputs { set_point: &set_point, estimate: &estimate }).unwrap().rc.pulse;
        let pulses = [step(), step(), step()];
        assert!(pulses[0][3] < 1500.0, "{pulses:?}");
        assert_eq!(
            pulses.map(|pulse| [pulse[4], pulse[5]]),
            [[1000.0, 1000.0], [1000.0, 2000.0], [1000.0, 1500.0]]
        );
    }
}
