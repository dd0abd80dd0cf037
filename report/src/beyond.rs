//! Time that a flight spent beyond the envelope in which the model of its vehicle was validated.

use crate::attached::Attached;
use crate::states::{FIELDS_OF_STATE, tracks};
use anyhow::Result;
use bus::plan::{NodePlan, Plan};
use flights::state::{VehicleState, length, tilt_deg};
use recorder::node::SHADOW_PREFIX;
use recorder::reader::Recording;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;
use toml::Table;
use vehicles::Envelope;

/// Message of the topics that hold true states.
pub(crate) const STATE: &str = "hummingbus_msgs/msg/PlantState";

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
    value: fn(&Flown) -> f64,
    limit: Option<f64>,
    sign: f64,
}

/// A state of a flight, and the norm of the specific force.
struct Flown {
    state: VehicleState,
    specific_force_m_s2: f64,
}

/// The limits of `envelope` that a state shows.
fn limits(envelope: &Envelope) -> [Limit; 6] {
    let upper = |quantity, unit, value, limit| Limit { quantity, unit, value, limit, sign: 1.0 };
    let height = |flown: &Flown| flown.state.position_W_m[2];
    [
        upper("speed", "m/s", |flown| length(&flown.state.velocity_W_m_s), envelope.speed_max_m_s),
        upper(
            "tilt",
            "deg",
            |flown| tilt_deg(&flown.state.attitude_WB),
            envelope.tilt_max_rad.map(f64::to_degrees),
        ),
        upper(
            "angular velocity",
            "rad/s",
            |flown| length(&flown.state.angular_velocity_B_rad_s),
            envelope.angular_velocity_max_rad_s,
        ),
        upper("specific force", "m/s^2", |flown| flown.specific_force_m_s2, envelope.specific_force_max_m_s2),
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
            let forces = specific_forces_m_s2(recording, topic)?;
            let flown =
                |((time_ns, state), specific_force_m_s2)| (time_ns, Flown { state, specific_force_m_s2 });
            let states: Vec<_> = track.states().zip(forces).map(flown).collect();
            found.extend(of_states(topic, &envelope, &states));
        }
    }
    Ok(found)
}

/// Names of the vehicles in the run of `plan` whose files have an envelope; `read` returns the text of a file. Only a
/// recording of the run can be compared with these envelopes.
#[must_use]
pub fn with_envelope(plan: &Plan, read: &dyn Fn(&Path) -> Option<String>) -> Vec<String> {
    let is_plant = |node: &&NodePlan| {
        !node.name.starts_with(SHADOW_PREFIX)
            && node.outputs.iter().any(|output| plan.topics[output.topic].type_name == STATE)
    };
    let name = |node: &NodePlan| {
        let file: Table = read(Path::new(node.parameters.get("vehicle")?.as_str()?))?.parse().ok()?;
        file.get("envelope")?;
        Some(file.get("name")?.as_str()?.to_owned())
    };
    let names: BTreeSet<String> = plan.nodes.iter().filter(is_plant).filter_map(name).collect();
    names.into_iter().collect()
}

/// The norms of the specific force in all states on `topic`, in their order.
fn specific_forces_m_s2(recording: &Recording, topic: &str) -> Result<Vec<f64>> {
    let names = ["specific_force.x", "specific_force.y", "specific_force.z"];
    let axes = recording.series(&names.map(|name| (topic, name)))?;
    let count = axes.first().map_or(0, |axis| axis.value.len());
    let norm = |index: usize| axes.iter().map(|axis| axis.value[index].powi(2)).sum::<f64>().sqrt();
    Ok((0..count).map(norm).collect())
}

/// The same for states with their times in ns, each of which holds until the next.
fn of_states(topic: &str, envelope: &Envelope, states: &[(u64, Flown)]) -> Vec<Beyond> {
    let one = |Limit { quantity, unit, value, limit, sign }: Limit| {
        let limit = limit?;
        let (mut duration_ns, mut farthest, mut is_beyond) = (0, limit, false);
        for (place, (from_ns, flown)) in states.iter().enumerate() {
            let found = value(flown);
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

    fn state(height_m: f64, speed_m_s: f64, roll_rad: f64, specific_force_m_s2: f64) -> Flown {
        let state = VehicleState {
            position_W_m: [0.0, 0.0, height_m],
            velocity_W_m_s: [0.0, speed_m_s, 0.0],
            attitude_WB: [libm::sin(roll_rad / 2.0), 0.0, 0.0, libm::cos(roll_rad / 2.0)],
            angular_velocity_B_rad_s: [0.0; 3],
        };
        Flown { state, specific_force_m_s2 }
    }

    #[test]
    fn each_limit_counts_the_time_beyond_it() {
        let envelope = Envelope {
            speed_max_m_s: Some(2.0),
            specific_force_max_m_s2: Some(12.0),
            tilt_max_rad: Some(0.2),
            height_min_m: Some(1.0),
            height_max_m: Some(3.0),
            ..Envelope::default()
        };
        let states = [
            state(2.0, 1.0, 0.0, 9.81),
            state(0.5, 2.5, 0.3, 12.0),
            state(0.25, 3.0, 0.1, 15.5),
            state(2.0, 1.0, 0.4, 9.81),
        ];
        let times_ns = [0, 100_000_000, 200_000_000, 500_000_000];
        let states: Vec<_> = times_ns.into_iter().zip(states).collect();
        let found = of_states("/plant/state", &envelope, &states);
        let of = |quantity: &str| found.iter().find(|beyond| beyond.quantity == quantity).unwrap();
        assert_eq!(found.len(), 4, "{found:?}");
        assert_eq!((of("speed").duration_s, of("speed").farthest), (0.4, 3.0));
        assert_eq!((of("height").duration_s, of("height").farthest, of("height").limit), (0.4, 0.25, 1.0));
        let force = of("specific force");
        assert_eq!((force.farthest, force.limit), (15.5, 12.0));
        assert!((force.duration_s - 0.3).abs() < 1e-9, "{force:?}");
        assert!(
            (of("tilt").farthest - 0.4_f64.to_degrees()).abs() < 1e-9 && of("tilt").duration_s == 0.1,
            "the last state counts"
        );
        assert!(of_states("/plant/state", &Envelope::default(), &states).is_empty());
    }
}
