//! Faults of all stages of a manifest, told at once, and no false ones after them.

use crate::refusals::good;
use crate::support::Place;

/// Checks `text`, which must have the faults with these `parts` of their messages and no others, in this order.
#[track_caller]
fn told(text: &str, parts: &[&str]) {
    let place = Place::new();
    let path = place.write("faulty.toml", text.to_owned());
    let found = place.call(&["check", &path, "--json"]).with_code(2).json();
    let faults = found["faults"].as_array().unwrap();
    let messages: Vec<&str> = faults.iter().map(|fault| fault["message"].as_str().unwrap()).collect();
    assert_eq!(messages.len(), parts.len(), "{messages:#?}");
    for (message, part) in messages.iter().zip(parts) {
        assert!(message.contains(part), "{part} is missing: {messages:#?}");
    }
}

/// The good manifest with each pair's first text replaced by its second.
#[track_caller]
fn with(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(good(), |text, (from, to)| {
        assert_eq!(text.matches(from).count(), 1, "{from} stands once in the good manifest");
        text.replace(from, to)
    })
}

/// The value of an unknown key goes to another key only where one or two letters are wrong.
#[test]
fn an_unknown_key_is_told_alone() {
    let imu = "inputs.imu = \"/imu/imu\"";
    let text = with(&[(imu, "inputs.imu = { topic = \"/imu/imu\", every_ticks = 2 }")]);
    told(&text, &["unknown key `process.ekf.inputs.imu.every_ticks`"]);
    let text = with(&[(imu, "inputs.imu = { topi = \"/imu/imu\" }")]);
    told(&text, &["unknown key `process.ekf.inputs.imu.topi`"]);
}
