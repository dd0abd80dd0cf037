//! Choice of the curves: named with `--plot`, or by the types of the recording's topics.

use crate::plot::field::Channel;
use crate::plot::request::Request;
use crate::plot::scene;
use crate::plot::thin::{Line, Poses};
use crate::topics::{self, is_of_shadow, short_name};
use anyhow::{Context, Result, bail};
use diagnostics::printable_line;
use recorder::reader::{Recording, Topic};
use serde::Serialize;
use std::collections::BTreeSet;

/// Points of a path in space.
const TRAIL_POINTS_MAX: usize = 2000;

/// Meaning of a curve; it decides the look of its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Values of the flight itself: a full line.
    Flown,
    /// Estimates of an estimator: a wide and pale band.
    Estimated,
    /// Measurements of a sensor, or of a real flight: a thin line.
    Measured,
    /// Set points and references: a dashed line.
    Asked,
}

impl Role {
    /// The role of `field` in a topic of type `type_name`.
    fn of(type_name: &str, field: &str) -> Self {
        let name = field.split('[').next().unwrap_or_default();
        match short_name(type_name) {
            "SetPoint" | "Reference" => Self::Asked,
            // Its other fields are actions of the controller.
            "ControlStatus" if name.ends_with("set_point") => Self::Asked,
            "MeasuredState" | "Imu" | "Gps" | "Mocap" | "Barometer" | "Magnetometer" | "Ranges"
            | "Battery" => Self::Measured,
            name if name.ends_with("Estimate") => Self::Estimated,
            _ => Self::Flown,
        }
    }

    /// Layer of the line: an estimator's noise must not hide the flown line, nor that line the set point.
    pub fn layer(self) -> u8 {
        match self {
            Self::Estimated => 0,
            Self::Measured => 1,
            Self::Flown => 2,
            Self::Asked => 3,
        }
    }

    /// Suffix that distinguishes the curve's name from that of the flown one.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Flown => "",
            Self::Estimated => " estimate",
            Self::Measured => " measured",
            Self::Asked => " set point",
        }
    }
}

/// Figures that are drawn if the recording has topics of these types: title, label of the vertical axis, and rows of
/// types with their fields for the figure. Of the rows of set points only the first one found is drawn: the others
/// mostly hold the same values. The thesis shows a flight in these figures (its Figs 5.1–5.5), and its wall following
/// uses the distances.
const FIGURES: [(&str, &str, &[Row]); 7] = [
    ("Attitude", "angle", ATTITUDE),
    ("Body rates", "angular velocity in the body", &[(&TURNING, &["angular_velocity"])]),
    ("Velocity", "velocity in the world", &[(&MOVING, &["velocity"])]),
    ("Position", "position in the world", POSITION),
    ("Distances", "distance", &[(&["Ranges", "WallEstimate"], &["distance"])]),
    ("Motor command", "command", &[(&["MotorCommand"], &["command"])]),
    ("Rotor speed", "rotor speed", &[(&["PlantState"], &["rotor_speed"])]),
];
const ATTITUDE: &[Row] = &[
    (&TURNING, &["attitude"]),
    (&["ControlStatus"], &["attitude_set_point"]),
    (&["SetPoint"], &["roll", "pitch", "yaw"]),
    (&["Reference"], &["yaw"]),
];
const POSITION: &[Row] = &[
    (&MOVING, &["position"]),
    (&["ControlStatus"], &["altitude_set_point"]),
    (&["SetPoint"], &["altitude"]),
];

/// Message types, and fields of these.
type Row = (&'static [&'static str], &'static [&'static str]);

/// The types with an attitude and an angular velocity.
const TURNING: [&str; 4] = ["PlantState", "MeasuredState", "AttitudeEstimate", "StateEstimate"];
/// The types with a field `position`; the first two make a vehicle.
const MOVING: [&str; 4] = ["PlantState", "MeasuredState", "StateEstimate", "Reference"];

/// A requested field of a topic: a number, or a value that is made of numbers.
#[derive(Clone, Debug)]
pub struct Ask {
    /// Topic.
    pub topic: String,
    /// Field path.
    pub field: String,
    /// Its meaning.
    pub role: Role,
    /// Samples read: its channels with their curves; empty if no message was in the span.
    pub curves: Vec<(Channel, Line)>,
}

impl Ask {
    fn new(topic: &str, field: &str, type_name: &str) -> Self {
        let role = Role::of(type_name, field);
        Self { topic: topic.to_owned(), field: field.to_owned(), role, curves: Vec::new() }
    }

    /// The vehicle whose topic it is; empty where it has no name.
    pub fn vehicle(&self) -> &str {
        topics::vehicle(&self.topic)
    }
}

/// One set of axes over time.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Vehicle; empty where the recording has one without a name, or fields were named.
    pub vehicle: String,
    /// Title; empty where the fields say it.
    pub title: &'static str,
    /// Label of the vertical axis; empty if the fields state it.
    pub label: &'static str,
    /// Fields to draw.
    pub asks: Vec<Ask>,
}

/// The curves and paths to draw, with the samples read for them.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Axes over time, vehicle by vehicle.
    pub axes: Vec<Wanted>,
    /// Paths in space.
    pub trails: Vec<(Ask, Poses)>,
    /// True if the user named the fields: a missing one is then an error.
    pub is_named: bool,
    /// The number that the curves are drawn against instead of time.
    pub against: Option<Ask>,
}

impl Choice {
    /// Returns the plots of the request, or else those that the types of the topics suggest, of one vehicle or of
    /// all.
    ///
    /// # Errors
    /// If a topic or the vehicle is not there, or nothing is.
    pub fn of(recording: &Recording, request: &Request) -> Result<Self> {
        let (vehicles, plots) = (vehicles(recording), &request.plots);
        let shown = match request.vehicle.as_deref() {
            None => &vehicles[..],
            Some(name) => match vehicles.iter().position(|known| known == name) {
                Some(index) => &vehicles[index..=index],
                None => {
                    bail!(
                        "the recording has no vehicle `{}`; it has {}",
                        printable_line(name),
                        listed(&vehicles)
                    )
                }
            },
        };
        let axes = if plots.is_empty() {
            shown.iter().flat_map(|vehicle| default_axes(recording, vehicle, &vehicles)).collect()
        } else {
            plots.iter().map(|plot| named(recording, plot)).collect::<Result<_>>()?
        };
        let is_shown = |topic: &str| shown.iter().any(|vehicle| belongs(topic, vehicle, &vehicles));
        let trails = trails(recording, is_shown);
        let against = request.against.as_deref().map(|against| number_of(recording, against)).transpose()?;
        let choice = Self { axes, trails, is_named: !plots.is_empty(), against };
        if choice.axes.is_empty() && choice.trails.is_empty() {
            let topics = listed(&recording.topics().keys().cloned().collect::<Vec<_>>());
            bail!(
                "no topic of the recording is of a type that is plotted by itself: name fields with --plot \
                 TOPIC:FIELD; the topics are {topics}"
            );
        }
        Ok(choice)
    }
}

fn listed(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        [only] if only.is_empty() => "one without a name".to_owned(),
        names => printable_line(&names.join(", ")).into_owned(),
    }
}

/// The vehicles by name, `h2` before `h10`.
fn vehicles(recording: &Recording) -> Vec<String> {
    let makes_one = |topic: &Topic| MOVING[..2].contains(&short_name(&topic.type_name));
    let states = recording.topics().iter().filter(|(name, topic)| makes_one(topic) && !is_of_shadow(name));
    let names: BTreeSet<_> =
        states.map(|(name, _)| (topics::vehicle(name).len(), topics::vehicle(name))).collect();
    let no_name = names.is_empty().then(String::new);
    names.into_iter().map(|(_, name)| name.to_owned()).chain(no_name).collect()
}

/// True if a topic, other than a shadow's, belongs to `vehicle`, or to no vehicle and so to all.
fn belongs(topic: &str, vehicle: &str, vehicles: &[String]) -> bool {
    let is_under = |vehicle: &str| {
        let rest = topic.strip_prefix('/').and_then(|topic| topic.strip_prefix(vehicle));
        !vehicle.is_empty() && rest.is_some_and(|rest| rest.starts_with('/'))
    };
    !is_of_shadow(topic) && (is_under(vehicle) || !vehicles.iter().any(|other| is_under(other)))
}

fn default_axes(recording: &Recording, vehicle: &str, vehicles: &[String]) -> Vec<Wanted> {
    let topics = || recording.topics().iter().filter(|(name, _)| belongs(name, vehicle, vehicles));
    let axes = FIGURES.map(|(title, label, rows)| {
        let mut asks: Vec<Ask> = Vec::new();
        let rows = rows.iter().flat_map(|(types, fields)| types.iter().map(move |name| (name, fields)));
        for (wanted, fields) in rows {
            let of_type = topics().filter(|(_, topic)| short_name(&topic.type_name) == *wanted);
            let more = of_type
                .flat_map(|(name, topic)| fields.iter().map(|field| Ask::new(name, field, &topic.type_name)));
            let is_asked = asks.iter().any(|ask| ask.role == Role::Asked);
            asks.extend(more.filter(|ask| !is_asked || ask.role != Role::Asked));
        }
        Wanted { vehicle: vehicle.to_owned(), title, label, asks }
    });
    axes.into_iter().filter(|axes| !axes.asks.is_empty()).collect()
}

fn trails(recording: &Recording, is_shown: impl Fn(&str) -> bool) -> Vec<(Ask, Poses)> {
    let moves = |topic: &Topic| MOVING.contains(&short_name(&topic.type_name)) && topic.message_count > 0;
    let moving = recording.topics().iter().filter(|(name, topic)| moves(topic) && is_shown(name));
    let trail = |(name, topic): (&String, &Topic)| {
        (Ask::new(name, "position", &topic.type_name), Poses::new(TRAIL_POINTS_MAX))
    };
    let moving = moving.map(trail);
    let bodies = |(name, topic): (&String, &Topic)| {
        let is_theirs = short_name(&topic.type_name) == "BodyStates" && is_shown(name);
        let names = if is_theirs { scene::body_names(recording) } else { Vec::new() };
        let trail = |(number, body)| {
            let ask = Ask::new(name, &format!("position[{number}]"), &topic.type_name);
            (ask, Poses::new(TRAIL_POINTS_MAX).of_body(body))
        };
        names.into_iter().enumerate().map(trail).collect::<Vec<_>>()
    };
    moving.chain(recording.topics().iter().flat_map(bodies)).collect()
}

/// Topic and number that `--against` names.
fn number_of(recording: &Recording, against: &str) -> Result<Ask> {
    let said = printable_line(against);
    let Some((topic, field)) = against.split_once(':') else {
        bail!("--against {said}: it is not TOPIC:FIELD, such as /plant/state:rotor_speed[0]");
    };
    let found = recording.topic(topic).with_context(|| format!("--against {said}"))?;
    Ok(Ask::new(topic, field, &found.type_name))
}

/// The axes that `TOPIC:FIELD,TOPIC:FIELD…` names; a field without a topic is of the topic before.
fn named(recording: &Recording, plot: &str) -> Result<Wanted> {
    let said = printable_line(plot);
    let mut last_topic = None;
    let mut asks = Vec::new();
    for part in plot.split(',').map(str::trim) {
        let named = part.split_once(':').or_else(|| last_topic.map(|topic| (topic, part)));
        let Some((topic, field)) = named else {
            bail!(
                "--plot {said}: `{}` is not TOPIC:FIELD, such as /plant/state:position.z",
                printable_line(part)
            );
        };
        if field.is_empty() {
            bail!("--plot {said}: `{}` names no field", printable_line(part));
        }
        let found = recording.topic(topic).with_context(|| format!("--plot {said}"))?;
        asks.push(Ask::new(topic, field, &found.type_name));
        last_topic = Some(topic);
    }
    Ok(Wanted { vehicle: String::new(), title: "", label: "", asks })
}

#[cfg(test)]
mod tests {
    use super::Role;

    #[test]
    fn of_a_controllers_status_only_set_points_are_asked_for_and_every_sensor_measures() {
        let cases = [
            ("ControlStatus", "attitude_set_point[1]", Role::Asked),
            ("ControlStatus", "altitude_set_point", Role::Asked),
            ("ControlStatus", "thrust_error", Role::Flown),
            ("SetPoint", "roll", Role::Asked),
            ("Ranges", "distance[0]", Role::Measured),
            ("Battery", "voltage", Role::Measured),
            ("WallEstimate", "distance[0]", Role::Estimated),
            ("PlantState", "position.z", Role::Flown),
        ];
        for (name, field, role) in cases {
            assert_eq!(Role::of(&format!("hummingbus_msgs/msg/{name}"), field), role, "{name} {field}");
        }
    }
}
