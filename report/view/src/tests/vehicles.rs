//! Vehicles of the catalogue: shadows beside what flew, and wind.

use super::{MS, cdr};
use crate::Shown;
use crate::catalogue::{Lasting, catalogue};
use crate::fields::Listed;
use bus::Message;
use bus::announcement::Announcement;
use bus::messages::{MotorCommand, PlantState, StateEstimate};
use recorder::reader::Recording;
use recorder::writer::RecordingWriter;
use serde_json::{Value, json};

/// Writes one message of each topic with these files attached; the vehicles of the catalogue.
fn vehicles(write: impl Fn(&mut RecordingWriter), files: &[(&str, &str)]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vehicles.mcap");
    let mut writer = RecordingWriter::create(&path).unwrap();
    for (name, text) in files {
        writer.attach(name, text.as_bytes()).unwrap();
    }
    write(&mut writer);
    writer.finish().unwrap();
    let shown = Shown::new(Recording::open(&path).unwrap()).unwrap();
    catalogue(&shown, Listed::of(&shown).unwrap().fields(), &Lasting::of(&shown).unwrap())["vehicles"].take()
}

fn send<T: Message + Default>(writer: &mut RecordingWriter, topic: &str) {
    let channel = writer.add_channel(topic, &Announcement::of(T::SCHEMA)).unwrap();
    writer.write(channel, 1, MS, &cdr(&T::default())).unwrap();
}

#[test]
fn topics_of_shadows_stand_beside_the_flown_ones_of_their_vehicle() {
    let listed = vehicles(
        |writer| {
            for name in ["h1", "h2"] {
                send::<PlantState>(writer, &format!("/{name}/plant/state"));
                send::<MotorCommand>(writer, &format!("/{name}/controller/command"));
            }
            send::<MotorCommand>(writer, "/shadow/h2/controller/command");
            send::<StateEstimate>(writer, "/shadow/h2/ekf/estimate");
        },
        &[],
    );
    assert_eq!((&listed[0]["name"], &listed[0]["shadows"]), (&json!("h1"), &json!({})));
    assert_eq!(
        (&listed[1]["topics"], &listed[1]["shadows"]),
        (
            &json!({ "command": "/h2/controller/command" }),
            &json!({
                "command": { "topic": "/shadow/h2/controller/command", "flown": "/h2/controller/command" },
                "estimate": { "topic": "/shadow/h2/ekf/estimate", "flown": "/h2/ekf/estimate" },
            })
        )
    );
}

#[test]
fn a_vehicle_has_the_wind_of_the_scene_that_its_plant_is_in() {
    let state = |writer: &mut RecordingWriter| send::<PlantState>(writer, "/plant/state");
    let manifest = "[process.plant]\nkind = \"plant\"\nvehicle = \"bird.toml\"\nscene = \"air.toml\"\n";
    let scene = "name = \"air\"\n[[effects]]\nname = \"wind\"\n\
                 x = { value = 3, unit = \"m/s\", source = \"test\", uncertainty = \"exact\" }\n";
    let bird = vehicle_text();
    let files = [("run.toml", manifest), ("bird.toml", &*bird), ("air.toml", scene)];
    let wind = json!({ "velocity_m_s": [3.0, 0.0, 0.0], "has_gusts": false });
    assert_eq!(vehicles(state, &files)[0]["air"], wind);
    assert_eq!(vehicles(state, &files[..2])[0]["air"], Value::Null);
}

fn vehicle_text() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/hummingbird.toml");
    std::fs::read_to_string(path).unwrap()
}
