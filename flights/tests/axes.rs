//! Order, signs and frame of axes: those that the log has and those that are declared.

use crate::support::Motion;
use crate::support::made::{CHANNELS, changed, findings, read, read_text};
use flights::Quantity;

/// An axis that does not follow is not one with a wrong sign.
#[test]
fn an_axis_without_a_signal_is_not_advised_a_sign() {
    let text = changed("wx", 1, |row, rate| rate[0] = if row % 2 == 0 { 9.0 } else { -9.0 });
    let notes = read_text(&text).unwrap_or_else(|error| panic!("{error}")).notes;
    assert!(notes.iter().any(|note| note.contains("(y, z: agree; x: unrelated)")), "{notes:?}");
}

#[test]
fn a_pose_whose_axes_are_mistaken_is_found_without_a_gyroscope() {
    let poses = |angles: &str, position: &str| {
        format!(
            "time = {{ columns = [\"t\"], unit = \"s\" }}\n\
             command = {{ columns = [\"m1\", \"m2\", \"m3\", \"m4\"], unit = \"count\" }}\n\
             attitude = {{ euler = [{angles}], unit = \"rad\" }}\n\
             position = {{ columns = [{position}], unit = \"m\" }}\n"
        )
    };
    let (angles, position) = (r#""roll", "pitch", "yaw""#, r#""px", "py", "pz""#);
    assert_eq!(read(&Motion::default(), &poses(angles, position), "").unwrap().notes, [""; 0]);
    let fits = |angles: &str, position: &str, advised: &str| {
        let found = findings(&Motion::default(), &poses(angles, position));
        let [(Quantity::Attitude, advice)] = &found[..] else { panic!("{angles} {position}: {found:?}") };
        assert!(advice.split(", or ").any(|own| own == advised), "{angles} {position}: {advice}");
    };
    fits(r#""roll", "-pitch", "yaw""#, position, "a `-` before the pitch");
    fits(r#""-roll", "-pitch", "yaw""#, position, "a `-` before roll and pitch");
    fits(r#""pitch", "roll", "yaw""#, position, "roll and pitch in each other's place");
    fits(angles, r#""py", "px", "pz""#, "x and y of the position in each other's place");
}

#[test]
fn a_quaternion_with_w_first_or_the_wrong_way_is_found() {
    let w_first = CHANNELS.replace("\"qx\", \"qy\", \"qz\", \"qw\"", "\"qw\", \"qx\", \"qy\", \"qz\"");
    let found = findings(&Motion::default(), &w_first);
    assert!(
        found.iter().any(|(q, fits)| *q == Quantity::Attitude && fits.contains("w, x, y, z")),
        "{found:?}"
    );
    let inverse = CHANNELS.replace("\"qx\", \"qy\", \"qz\"", "\"-qx\", \"-qy\", \"-qz\"");
    let found = findings(&Motion::default(), &inverse);
    assert!(
        found.iter().any(|(_, fits)| fits.contains("world to the body") || fits.contains("the axes")),
        "{found:?}"
    );
}

/// A gyroscope whose columns are exchanged is not taken for motors in another order: its own columns are named, in either frame.
#[test]
fn a_gyroscope_with_its_axes_in_another_order_is_found() {
    let declared = "[\"wx\", \"wy\", \"wz\"]";
    for (columns, frd_ned, fits) in [
        ("[\"wy\", \"wx\", \"wz\"]", false, "the names in the order [\"wx\", \"wy\", \"wz\"]"),
        ("[\"wz\", \"-wx\", \"wy\"]", false, "the names in the order [\"wx\", \"wy\", \"wz\"]"),
        ("[\"wy\", \"-wx\", \"wz\"]", true, "the names in the order [\"wx\", \"wy\", \"wz\"]"),
    ] {
        let channels = CHANNELS.replace(declared, columns);
        let channels = if frd_ned { channels.replace(" }", ", frame = \"frd-ned\" }") } else { channels };
        let found = findings(&Motion { frd_ned, ..Motion::default() }, &channels);
        let of_rates: Vec<_> =
            found.iter().filter(|(found, _)| *found == Quantity::AngularVelocity).collect();
        assert!(matches!(&of_rates[..], [(_, said)] if said == fits), "{columns}: {found:?}");
    }
}

#[test]
fn frames_are_converted_and_a_wrong_one_is_found() {
    let frd = Motion { frd_ned: true, ..Motion::default() };
    let framed = CHANNELS.replace(" }", ", frame = \"frd-ned\" }");
    let (converted, plain) =
        (read(&frd, &framed, "").unwrap(), read(&Motion::default(), CHANNELS, "").unwrap());
    for (a, b) in converted.position.values.iter().zip(&plain.position.values) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }
    for (a, b) in converted.attitude.values.iter().zip(&plain.attitude.values) {
        assert!(a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs() > 1.0 - 1e-9, "{a:?} {b:?}");
    }
    for (a, b) in converted.specific_force.values.iter().zip(&plain.specific_force.values) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
    let body = "specific_force = { columns = [\"fx\", \"fy\", \"fz\"], unit = \"m/s^2\" }";
    let wrong = framed.replace(&body.replace(" }", ", frame = \"frd-ned\" }"), body);
    assert!(findings(&frd, &wrong).iter().any(|(_, fits)| fits.contains("frd-ned")));
}

/// The gyroscope contradicts an attitude in the wrong frame, but it is not the gyroscope that is wrong.
#[test]
fn a_wrong_frame_is_looked_for_where_it_is() {
    let other = "`frame = \"frd-ned\"`";
    let in_other_frame = |channels: &str, channel: &str| {
        let line = |line: &str| match line.starts_with(channel) {
            true => format!("{}\n", line.replace(" }", ", frame = \"frd-ned\" }")),
            false => format!("{line}\n"),
        };
        channels.lines().map(line).collect::<String>()
    };
    let wrong =
        |channels: &str, channel: &str| findings(&Motion::default(), &in_other_frame(channels, channel));
    let flu = other.replace("frd-ned", "flu-enu");
    let attitude = wrong(CHANNELS, "attitude");
    assert!(attitude.contains(&(Quantity::Attitude, flu.clone())), "{attitude:?}");
    assert!(attitude.iter().all(|(channel, _)| *channel != Quantity::AngularVelocity), "{attitude:?}");
    let rates = wrong(CHANNELS, "angular_velocity");
    assert_eq!(rates, [(Quantity::AngularVelocity, flu.clone())]);
    // Nothing else tells which of the two is wrong.
    let alone: String = CHANNELS
        .lines()
        .filter(|line| {
            !["position", "velocity", "specific_force"].iter().any(|channel| line.starts_with(channel))
        })
        .map(|line| format!("{line}\n"))
        .collect();
    for (channel, fits) in [
        ("attitude", format!("{other} here or {flu} of `attitude`")),
        ("angular_velocity", format!("{flu} here or {other} of `attitude`")),
    ] {
        assert_eq!(wrong(&alone, channel), [(Quantity::AngularVelocity, fits)]);
    }
}
