//! The vehicles of a recording: their bodies, and the topics of their states and commands.

use crate::fields::Field;
use recorder::reader::Recording;
use report::airframe::{Body, Paint, Part, Shape};
use report::attached::Attached;
use report::topics::{beside_shadow, is_of_shadow, short_name, vehicle};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Types of messages with a vehicle's pose, the best first.
const STATES: [&str; 3] = ["PlantState", "MeasuredState", "StateEstimate"];
/// Topics that are shown of a vehicle, by their types, and their names in the catalogue.
const SHOWN: [(&str, &str); 8] = [
    ("StateEstimate", "estimate"),
    ("MeasuredState", "measured"),
    ("Reference", "reference"),
    ("SetPoint", "set_point"),
    ("ControlStatus", "status"),
    ("Ranges", "ranges"),
    ("WallEstimate", "walls"),
    ("MotorCommand", "command"),
];
/// Topics that are shown of the shadows of a vehicle's processes, by their types, and their names in the catalogue.
const SHADOWED: [(&str, &str); 2] = [("MotorCommand", "command"), ("StateEstimate", "estimate")];

/// The vehicles as the catalogue lists them, `h2` before `h10`.
pub fn vehicles(
    recording: &Recording,
    fields: &BTreeMap<String, Vec<Field>>,
    attached: &Attached,
) -> Vec<Value> {
    let mut states: Vec<(&str, &str)> = Vec::new();
    for wanted in STATES {
        for topic in topics_of(recording, fields, wanted) {
            if !states.iter().any(|(name, _)| *name == vehicle(topic)) {
                states.push((vehicle(topic), topic));
            }
        }
    }
    states.sort_by_key(|(name, _)| (name.len(), *name));
    states.iter().map(|(name, topic)| one(recording, fields, attached, name, topic)).collect()
}

/// The topics of a type that have messages, those of shadows left out.
fn topics_of<'a>(
    recording: &'a Recording,
    fields: &'a BTreeMap<String, Vec<Field>>,
    type_name: &'a str,
) -> impl Iterator<Item = &'a str> {
    all_of(recording, fields, type_name).filter(|name| !is_of_shadow(name))
}

/// The topics of a type that have messages.
fn all_of<'a>(
    recording: &'a Recording,
    fields: &'a BTreeMap<String, Vec<Field>>,
    type_name: &'a str,
) -> impl Iterator<Item = &'a str> {
    let topics = recording.topics().iter();
    let of_type = topics.filter(move |(_, topic)| short_name(&topic.type_name) == type_name);
    of_type.map(|(name, _)| name.as_str()).filter(|name| fields.contains_key(*name))
}

/// Topics of shadows of the processes of the vehicle that is called `name`, each with the flown topic beside it.
fn shadows(recording: &Recording, fields: &BTreeMap<String, Vec<Field>>, name: &str) -> Value {
    let shadow_of = |type_name: &'static str| {
        all_of(recording, fields, type_name).find_map(|shadow| {
            let flown = beside_shadow(shadow).filter(|flown| vehicle(flown) == name)?;
            Some(json!({ "topic": shadow, "flown": flown }))
        })
    };
    SHADOWED.iter().filter_map(|(type_name, key)| Some(((*key).to_owned(), shadow_of(type_name)?))).collect()
}

fn one(
    recording: &Recording,
    fields: &BTreeMap<String, Vec<Field>>,
    attached: &Attached,
    name: &str,
    state: &str,
) -> Value {
    let topic_of = |type_name: &'static str| {
        topics_of(recording, fields, type_name).find(|topic| vehicle(topic) == name && *topic != state)
    };
    let topics: BTreeMap<&str, &str> =
        SHOWN.iter().filter_map(|(type_name, key)| Some((*key, topic_of(type_name)?))).collect();
    let speeds = fields[state].iter().filter(|field| field.path.starts_with("rotor_speed[")).count();
    json!({
        "name": name,
        "state": state,
        "topics": topics,
        "shadows": shadows(recording, fields, name),
        "rotor_speeds": speeds,
        "body": body(attached, name),
        "air": attached.wind(name).map(|wind| {
            json!({ "velocity_m_s": wind.velocity_W_m_s, "has_gusts": wind.has_gusts })
        }),
    })
}

/// The body of a vehicle whose file is attached; null without one.
fn body(attached: &Attached, name: &str) -> Value {
    let Some(airframe) = attached.airframe(name) else { return Value::Null };
    let Some(body) = Body::of(&airframe) else { return Value::Null };
    let vehicle = airframe.vehicle();
    let rotors = vehicle.rotors.iter().map(|rotor| {
        json!({
            "name": rotor.name,
            "at_m": rotor.position_m.as_slice(),
            "axis": rotor.axis.as_slice(),
            "spin": rotor.spin,
        })
    });
    let map = &vehicle.command;
    json!({
        "name": body.name,
        "command": {
            "min": map.min,
            "max": map.max,
            "speed_at_min_rad_s": map.speed_at_min_rad_s,
            "speed_at_max_rad_s": map.speed_at_max_rad_s,
            "zero_is_off": map.zero_is_off,
        },
        "weight_N": vehicle.mass_kg * vehicle.gravity_m_s2,
        "thrust_coefficient": vehicle.thrust_coefficient,
        "reach_m": body.reach_m(),
        "propeller_radius_m": body.propeller_radius_m,
        "rotors": rotors.collect::<Vec<_>>(),
        "parts": body.seen.iter().map(part).collect::<Vec<_>>(),
    })
}

fn part(part: &Part) -> Value {
    let shape = match part.shape {
        Shape::Box(edges_m) => json!({ "box": edges_m }),
        Shape::Cylinder { radius_m, length_m } => json!({ "cylinder": [radius_m, length_m] }),
        Shape::Ball(radius_m) => json!({ "ball": radius_m }),
    };
    let paint = match part.paint {
        Paint::Frame => "frame",
        Paint::Front => "front",
        Paint::CounterClockwise => "counter-clockwise",
        Paint::Clockwise => "clockwise",
    };
    json!({
        "name": part.name,
        "shape": shape,
        "at_m": part.centre_B_m.as_slice(),
        "roll_pitch_yaw_rad": part.roll_pitch_yaw_rad,
        "paint": paint,
    })
}
