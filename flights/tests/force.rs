//! Specific force: where it comes from, and what is mistaken for it.

use crate::support::Motion;
use crate::support::made::{CHANNELS, findings, read, refused};
use flights::{Flight, Quantity};

/// The channels with a specific force from other columns.
fn with_force(columns: &str, keys: &str) -> String {
    CHANNELS.replace("\"fx\", \"fy\", \"fz\"", columns).replace("\"m/s^2\"", &format!("\"m/s^2\"{keys}"))
}

const WORLD_ACCELERATION: &str = r#""ax", "ay", "az""#;
const WORLD_FORCE: &str = r#""ax", "ay", "sz""#;

#[test]
fn accelerations_in_the_world_become_specific_force_in_the_body() {
    let plain = read(&Motion::default(), CHANNELS, "").unwrap().specific_force;
    let same = |flight: &Flight| {
        assert_eq!(flight.specific_force.time_s, plain.time_s);
        for (a, b) in flight.specific_force.values.iter().zip(&plain.values) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
        }
        let [note] = &flight.notes[..] else { panic!("{:?}", flight.notes) };
        assert!(
            note.starts_with("specific_force: computed with the attitude from what is declared as world-")
        );
    };
    for (columns, holds) in
        [(WORLD_ACCELERATION, "world-acceleration"), (WORLD_FORCE, "world-specific-force")]
    {
        let channels = with_force(columns, &format!(", holds = \"{holds}\""));
        same(&read(&Motion::default(), &channels, "").unwrap());
        let framed = channels.replace(" }", ", frame = \"frd-ned\" }");
        same(&read(&Motion { frd_ned: true, ..Motion::default() }, &framed, "").unwrap());
    }
}

#[test]
fn what_is_no_specific_force_is_refused_as_what_it_is() {
    let fits = |motion: &Motion, channels: &str, expected: &str| {
        let found = findings(motion, channels);
        assert_eq!(found, [(Quantity::SpecificForce, expected.to_owned())], "{channels}");
    };
    let plain = Motion::default();
    for channels in [
        with_force(WORLD_ACCELERATION, ""),
        with_force(WORLD_ACCELERATION, "").replace("velocity", "# velocity"),
    ] {
        let channels = channels.replace("angular_# velocity", "angular_velocity");
        fits(&plain, &channels, "`holds = \"world-acceleration\"`");
    }
    fits(&plain, &with_force(WORLD_FORCE, ""), "`holds = \"world-specific-force\"`");
    let body = with_force(r#""fx", "fy", "fz""#, ", holds = \"world-acceleration\"");
    fits(&plain, &body, "`holds = \"specific-force\"`");
    let force = with_force(WORLD_FORCE, ", holds = \"world-acceleration\"");
    fits(&plain, &force, "`holds = \"world-specific-force\"`");
    // PX4's own, beside channels whose frame is said, or in place of an accelerometer of its body.
    let frd = Motion { frd_ned: true, ..Motion::default() };
    let framed = with_force(WORLD_ACCELERATION, "").replace(" }", ", frame = \"frd-ned\" }");
    fits(&frd, &framed, "`holds = \"world-acceleration\"`");
    let unframed = framed.replace("\"m/s^2\", frame = \"frd-ned\"", "\"m/s^2\"");
    fits(&frd, &unframed, "`holds = \"world-acceleration\"` with `frame = \"frd-ned\"`");
    let text = read(&plain, &with_force(WORLD_ACCELERATION, ""), "").unwrap_err().to_string();
    assert!(
        text.contains("flights.toml:9:") && text.contains("differs from the vehicle's acceleration by"),
        "{text}"
    );
    let in_g = Motion { force_unit: 1.0 / 9.81, ..Motion::default() };
    fits(&in_g, &with_force(WORLD_ACCELERATION, ", holds = \"world-acceleration\""), "`unit = \"g\"`");
    assert!(read(&plain, &with_force(WORLD_ACCELERATION, ""), "trust_units = true").is_ok());
}

#[test]
fn what_a_force_holds_needs_an_attitude_and_a_force() {
    let channels = with_force(WORLD_ACCELERATION, ", holds = \"world-acceleration\"");
    let without = channels.replace("attitude =", "# attitude =");
    let text = refused(&without, "");
    assert!(
        text.contains("`holds`: expected an attitude at its times") && text.contains("map `attitude`"),
        "{text}"
    );
    let other = refused(&CHANNELS.replace("\"m/s\"", "\"m/s\", holds = \"world-acceleration\""), "");
    assert!(
        other.contains(
            "`velocity`: `holds`: expected this key in `specific_force` or `angular_velocity` alone"
        ),
        "{other}"
    );
}
