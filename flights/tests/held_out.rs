//! A test flight that holds samples that parameters are fitted on is refused, in any form of log.

use crate::support;
use std::path::Path;

use flights::FlightSet;
use support::{Motion, Place};

const HEAD: &str = r#"
[channels]
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
"#;

/// A flight of the same course each time, with the sensors' noise of `seed`.
fn log(seed: u64) -> String {
    let whole = Motion::default().csv();
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).max(1);
    let mut noise = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        0.01 * ((state >> 40) as f64 / f64::from(1 << 24) - 0.5)
    };
    let mut text = String::new();
    for (row, line) in whole.lines().enumerate() {
        let cells = line.split(',').enumerate().map(|(column, cell)| match cell.parse::<f64>() {
            Ok(number) if column > 4 && row > 0 => (number + noise()).to_string(),
            _ => cell.to_owned(),
        });
        text += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

/// Reads two flights, each given as its log and further keys; the text of the refusal, if it is one.
fn held_out(place: &Place, fit: (&str, &str), test: (&str, &str)) -> Result<(), String> {
    let vehicle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../vehicles/hummingbird.toml");
    let flight = |name: &str, (file, keys): (&str, &str)| {
        format!("[[flight]]\nname = \"the {name}\"\nfile = \"{file}\"\nrole = \"{name}\"\n{keys}\n")
    };
    let text =
        format!("vehicle = \"{}\"{HEAD}{}{}", vehicle.display(), flight("fit", fit), flight("test", test));
    place.write("flights.toml", text.as_bytes());
    FlightSet::load(&place.path("flights.toml")).map(|_| ()).map_err(|error| error.to_string())
}

fn refused(place: &Place, fit: (&str, &str), test: (&str, &str), parts: &[&str]) {
    let message = held_out(place, fit, test).expect_err("it is not held out");
    for part in
        parts.iter().chain(&["flights.toml:15:8", "`the fit`", "`the test`", "by `from_s` and `to_s`"])
    {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn a_log_is_not_held_out_from_itself_by_any_name() {
    let place = Place::new();
    place.write("log.csv", log(1).as_bytes());
    refused(&place, ("log.csv", ""), ("log.csv", ""), &["the same file", "log.csv", "0.000 s to 10.000 s"]);
    std::fs::create_dir(place.path("other")).unwrap();
    std::os::unix::fs::symlink("../log.csv", place.path("other/soft.csv")).unwrap();
    std::fs::hard_link(place.path("log.csv"), place.path("hard.csv")).unwrap();
    for spelled in ["other/soft.csv", "hard.csv", "other/../log.csv", "./log.csv"] {
        refused(&place, ("log.csv", ""), (spelled, ""), &["the same file"]);
    }
    std::fs::copy(place.path("log.csv"), place.path("copy.csv")).unwrap();
    refused(&place, ("log.csv", ""), ("copy.csv", ""), &["copies of the same bytes", "copy.csv"]);
}

#[test]
fn parts_of_a_log_are_held_out_where_they_do_not_overlap() {
    let place = Place::new();
    place.write("log.csv", log(1).as_bytes());
    std::fs::copy(place.path("log.csv"), place.path("copy.csv")).unwrap();
    place.write("again.csv", log(1).replace(",v,", ",volts,").as_bytes());
    for other in ["log.csv", "copy.csv", "again.csv"] {
        let (first, second) = (("log.csv", "to_s = 5.0"), (other, "from_s = 5.0"));
        held_out(&place, first, second).unwrap();
        held_out(&place, second, first).unwrap();
        let common =
            if other == "again.csv" { ["samples of", "5.000 s"] } else { ["5.000 s to 6.000 s", "both"] };
        refused(&place, ("log.csv", "to_s = 6.0"), second, &common);
    }
    // Whichever channels each begins with.
    let delayed = "from_s = 5.0\ndelay_s = { position = 0.1 }";
    held_out(&place, ("log.csv", "to_s = 5.0"), ("log.csv", delayed)).unwrap();
}

#[test]
fn rows_that_were_saved_again_are_found_by_their_samples() {
    let place = Place::new();
    let whole = log(1);
    place.write("log.csv", whole.as_bytes());
    let (header, rows) = whole.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let save =
        |rows: &[String]| place.write("again.csv", format!("{header}\n{}\n", rows.join("\n")).as_bytes());
    let check = || {
        refused(&place, ("log.csv", ""), ("again.csv", ""), &["samples of `angular_velocity`", "again.csv"])
    };
    let cells = |row: &str| row.split(',').map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let row = |cells: Vec<f64>| cells.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let commented = whole.replace(",v,", ",battery of the second pack,");
    place.write("again.csv", commented.as_bytes());
    check();
    save(&rows.iter().step_by(3).map(|row| (*row).to_owned()).collect::<Vec<_>>());
    check();
    // The last 3 s, on a clock of their own.
    let late = rows[700..].iter().map(|text| {
        let mut cells = cells(text);
        cells[0] -= 7.0;
        row(cells)
    });
    save(&late.collect::<Vec<_>>());
    check();
    // With fewer digits behind the point.
    for scale in [1e3, 1e4] {
        let rounded =
            |text: &&str| row(cells(text).iter().map(|number| (number * scale).round() / scale).collect());
        save(&rows.iter().map(rounded).collect::<Vec<_>>());
        check();
    }
    // The other way round: fitted on the part, tested on the whole.
    save(&rows[200..500].iter().map(|row| (*row).to_owned()).collect::<Vec<_>>());
    check();
    refused(&place, ("again.csv", ""), ("log.csv", ""), &["samples of"]);
}

#[test]
fn a_course_that_comes_round_may_be_cut_into_laps() {
    let place = Place::new();
    let header = "t,m1,m2,m3,m4,px,py,pz,qx,qy,qz,qw,wx,wy,wz\n";
    let row = |k: u32| {
        let (t, angle) = (0.01 * f64::from(k), std::f64::consts::TAU * 0.002 * f64::from(k));
        format!(
            "{t:.2},100,100,100,100,{},{},1,0,0,0,1,{},0,0\n",
            libm::cos(angle),
            libm::sin(angle),
            0.01 * libm::sin(angle)
        )
    };
    place.write("log.csv", (0..=1000).map(row).fold(header.to_owned(), |text, row| text + &row).as_bytes());
    let (first, second) =
        (("log.csv", "to_s = 5.0\ntrust_units = true"), ("log.csv", "from_s = 5.0\ntrust_units = true"));
    held_out(&place, first, second).unwrap();
}

#[test]
fn the_same_course_flown_again_is_held_out() {
    let place = Place::new();
    place.write("one.csv", log(1).as_bytes());
    place.write("two.csv", log(2).as_bytes());
    held_out(&place, ("one.csv", ""), ("two.csv", "")).unwrap();
}
