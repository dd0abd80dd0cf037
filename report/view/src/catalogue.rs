//! The catalogue: everything that the page needs to know before it requests values.

use crate::fields::Field;
use crate::marks::marks;
use crate::shown::Shown;
use crate::vehicles::vehicles;
use anyhow::Result;
use report::attached::Attached;
use report::plot::{Solid, bodies_of, scene_of};
use report::topics::{short_name, vehicle};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Parts of a catalogue that stay the same while a recording grows.
#[derive(Debug)]
pub struct Lasting {
    attached: Attached,
    scene: Vec<Solid>,
    bodies: Vec<Solid>,
    tick_ns: Option<u64>,
    is_growing: bool,
}

impl Lasting {
    /// Reads them.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn of(shown: &Shown) -> Result<Self> {
        let recording = shown.recording();
        Ok(Self {
            attached: Attached::to(recording)?,
            scene: scene_of(recording)?,
            bodies: bodies_of(recording)?,
            tick_ns: tick_ns(shown)?,
            is_growing: shown.is_growing(),
        })
    }

    /// Reads them again if they can differ: a recording that is finished has attachments behind its messages, too, and one
    /// of a single tick has no time of a tick.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn update(&mut self, shown: &Shown) -> Result<()> {
        if self.is_growing != shown.is_growing() || self.tick_ns.is_none() {
            *self = Self::of(shown)?;
        }
        Ok(())
    }
}

/// Catalogue of a recording: name, span, topics with the fields that `fields` lists, vehicles, scene and marks.
#[must_use]
pub fn catalogue(shown: &Shown, fields: &BTreeMap<String, Vec<Field>>, lasting: &Lasting) -> Value {
    let Lasting { attached, scene, tick_ns, .. } = lasting;
    let vehicles = vehicles(shown.recording(), fields, attached);
    json!({
        "name": shown.name(),
        "start_s": shown.start_ns() as f64 * 1e-9,
        "duration_ns": shown.duration_ns(),
        "tick_ns": tick_ns,
        "blocks": shown.block_count(),
        "is_growing": shown.is_growing(),
        "cut": cut(shown),
        "notes": notes(shown, vehicles.is_empty()),
        "topics": topics(shown, fields),
        "vehicles": vehicles,
        "scene": scene,
        "bodies": bodies(shown, fields, lasting),
        "marks": marks(attached, tick_ns.map(|tick_ns| tick_ns as f64 * 1e-9)),
    })
}

fn topics(shown: &Shown, fields: &BTreeMap<String, Vec<Field>>) -> Vec<Value> {
    let topics = shown.recording().topics().iter();
    let with_fields = topics.filter_map(|(name, topic)| Some((name, topic, fields.get(name)?)));
    let topic = with_fields.map(|(name, topic, fields)| {
        json!({ "name": name, "type": topic.type_name, "messages": topic.message_count, "fields": fields })
    });
    topic.collect()
}

/// Free bodies of the scene, with the topic of their states.
fn bodies(shown: &Shown, fields: &BTreeMap<String, Vec<Field>>, lasting: &Lasting) -> Value {
    let mut topics = shown.recording().topics().iter();
    let states = topics
        .find(|(name, topic)| short_name(&topic.type_name) == "BodyStates" && fields.contains_key(*name))
        .map(|(name, _)| name);
    let Some(states) = states else { return Value::Null };
    json!({ "topic": states, "vehicle": vehicle(states), "solids": lasting.bodies })
}

/// Texts that people should read before they look.
/// Text about a recording that its writer has not finished.
fn cut(shown: &Shown) -> Option<String> {
    let cut = shown.recording().cut()?;
    let end = cut.last_tick.map_or("no message is whole".to_owned(), |tick| {
        format!("the last whole tick was {tick} when it was opened")
    });
    Some(format!("{} is not finished: its recorder is at work, or was killed; {end}.", shown.name()))
}

fn notes(shown: &Shown, has_no_vehicle: bool) -> Vec<String> {
    let mut notes = Vec::new();
    if has_no_vehicle {
        notes.push(format!(
            "{} has no state of a vehicle: no topic of type PlantState, MeasuredState or StateEstimate. The room shows \
             the scene alone; the scopes show every topic.",
            shown.name()
        ));
    }
    notes
}

/// Time of a tick: that between the first two messages with different ticks, divided by the difference. `None` if
/// that is not a whole number of ns, as in recordings of other programs.
fn tick_ns(shown: &Shown) -> Result<Option<u64>> {
    let mut first = None;
    for block in 0..shown.block_count().min(8) {
        for record in shown.messages(block) {
            let record = record?;
            let (tick, time_ns) = *first.get_or_insert((record.tick, record.time_ns));
            if record.tick > tick && record.time_ns > time_ns {
                let (ticks, span_ns) = (u64::from(record.tick - tick), record.time_ns - time_ns);
                return Ok(span_ns.is_multiple_of(ticks).then_some(span_ns / ticks));
            }
        }
    }
    Ok(None)
}
