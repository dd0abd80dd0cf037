//! Time that a flight spent beyond the envelope in which the model of its vehicle was validated.

use crate::attached::Attached;
use crate::states::{FIELDS_OF_STATE, tracks};
use anyhow::Result;
use flights::state::{VehicleState, length, tilt_deg};
use recorder::node::SHADOW_PREFIX;
use recorder::reader::Recording;
use serde::Serialize;
use std::fmt;
use vehicles::Envelope;

/// Message of the topics that hold true states.
const STATE: &str = "hummingbus_msgs/msg/PlantState";

/// A quantity of a flight that left the envelope of its vehicle. Its text is a line of the summary.
///
/// ```
/// use report::beyond::Beyond;
/// let speed = Beyond {
///     topic: "/plant/state".to_owned(),
///     quantity: "speed",
///     unit: "m/s",
///     farthest: 4.125,
///     limit: 2.5,
///     duration_s: 3.2,
/// };
/// assert_eq!(
///     speed.to_string(),
///     "  beyond the validated envelope: speed on /plant/state for 3.200 s, 4.125 m/s at the farthest (limit 2.500 m/s)"
/// );
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Beyond {
    /// Topic of the states.
    pub topic: String,
    /// The quantity.
    pub quantity: &'static str,
    /// Unit of the values.
    pub unit: &'static str,
    /// Value farthest beyond.
    pub farthest: f64,
    /// Limit of the envelope.
    pub limit: f64,
    /// Simulated time beyond the limit, s.
    pub duration_s: f64,
}

impl fmt::Display for Beyond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, quantity, unit, farthest, limit, duration_s } = self;
        write!(
            f,
            "  beyond the validated envelope: {quantity} on {topic} for {duration_s:.3} s, {farthest:.3} {unit} at the farthest \
             (limit {limit:.3} {unit})"
        )
    }
}

/// A limit of an envelope: name and unit, the value of a state, and the limit. A least value has a negative sign.
struct Limit {
    quantity: &'static str,
    unit: &'static str,
    value: fn(&VehicleState) -> f64,
    limit: Option<f64>,
    sign: f64,
}

/// The limits of `envelope` that a state shows.
fn limits(envelope: &Envelope) -> [Limit; 5] {
    let upper = |quantity, unit, value, limit| Limit { quantity, unit, value, limit, sign: 1.0 };
    let height = |state: &VehicleState| state.position_W_m[2];
    [
        upper("speed", "m/s", |state| length(&state.velocity_W_m_s), envelope.speed_max_m_s),
        upper(
            "tilt",
            "deg",
            |state| tilt_deg(&state.attitude_WB),
            envelope.tilt_max_rad.map(f64::to_degrees),
        ),
        upper(
            "angular velocity",
            "rad/s",
            |state| length(&state.angular_velocity_B_rad_s),
            envelope.angular_velocity_max_rad_s,
        ),
        upper("height", "m", height, envelope.height_max_m),
        Limit { sign: -1.0, ..upper("height", "m", height, envelope.height_min_m) },
    ]
}

/// Quantities in `recording` that left the envelope of their vehicle, by topic; none for vehicles without an envelope.
///
/// # Errors
/// If the recording is damaged.
pub(crate) fn of(recording: &Recording) -> Result<Vec<Beyond>> {
    let attached = Attached::to(recording)?;
    let mut names = attached.names();
    if names.is_empty() {
        names.push("");
    }
    let mut found = Vec::new();
    for name in names {
        let envelope = attached.airframe(name).and_then(|airframe| airframe.vehicle().envelope);
        let Some(envelope) = envelope else { continue };
        let prefix = format!("/{name}{}", if name.is_empty() { "" } else { "/" });
        let of_vehicle = recording.topics().iter();
        let topics: Vec<String> = of_vehicle
            .filter(|(topic, kind)| {
                kind.type_name == STATE && topic.starts_with(&prefix) && !topic.starts_with(SHADOW_PREFIX)
            })
            .map(|(topic, _)| topic.clone())
            .collect();
        for (topic, track) in topics.iter().zip(tracks(recording, &topics, FIELDS_OF_STATE)?) {
            found.extend(of_states(topic, &envelope, &track.states().collect::<Vec<_>>()));
        }
    }
    Ok(found)
}

/// The same for states with their times in ns, each of which holds until the next.
fn of_states(topic: &str, envelope: &Envelope, states: &[(u64, VehicleState)]) -> Vec<Beyond> {
    let one = |Limit { quantity, unit, value, limit, sign }: Limit| {
        let limit = limit?;
        let (mut duration_ns, mut farthest, mut is_beyond) = (0, limit, false);
        for (place, (from_ns, state)) in states.iter().enumerate() {
            let found = value(state);
            if sign * found > sign * limit {
                let until_ns = states.get(place + 1).map_or(*from_ns, |next| next.0);
                (duration_ns, is_beyond) = (duration_ns + until_ns - from_ns, true);
                farthest = if sign * found > sign * farthest { found } else { farthest };
            }
        }
        let duration_s = duration_ns as f64 * 1e-9;
        let topic = topic.to_owned();
        is_beyond.then_some(Beyond { topic, quantity, unit, farthest, limit, duration_s })
    };
    limits(envelope).into_iter().filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(height_m: f64, speed_m_s: f64, roll_rad: f64) -> VehicleState {
        VehicleState {
            position_W_m: [0.0, 0.0, height_m],
            velocity_W_m_s: [0.0, speed_m_s, 0.0],
            attitude_WB: [libm::sin(roll_rad / 2.0), 0.0, 0.0, libm::cos(roll_rad / 2.0)],
            angular_velocity_B_rad_s: [0.0; 3],
        }
    }

    #[test]
    fn each_limit_counts_the_time_beyond_it() {
        let envelope = Envelope {
            speed_max_m_s: Some(2.0),
            tilt_max_rad: Some(0.2),
            height_min_m: Some(1.0),
            height_max_m: Some(3.0),
            ..Envelope::default()
        };
        let states =
            [state(2.0, 1.0, 0.0), state(0.5, 2.5, 0.3), state(0.25, 3.0, 0.1), state(2.0, 1.0, 0.4)];
        let times_ns = [0, 100_000_000, 200_000_000, 500_000_000];
        let states: Vec<_> = times_ns.into_iter().zip(states).collect();
        let found = of_states("/plant/state", &envelope, &states);
        let of = |quantity: &str| found.iter().find(|beyond| beyond.quantity == quantity).unwrap();
        assert_eq!(found.len(), 3, "{found:?}");
        assert_eq!((of("speed").duration_s, of("speed").farthest), (0.4, 3.0));
        assert_eq!((of("height").duration_s, of("height").farthest, of("height").limit), (0.4, 0.25, 1.0));
        assert!(
            (of("tilt").farthest - 0.4_f64.to_degrees()).abs() < 1e-9 && of("tilt").duration_s == 0.1,
            "the last state counts"
        );
        assert!(of_states("/plant/state", &Envelope::default(), &states).is_empty());
    }
}
