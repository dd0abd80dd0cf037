//! The made-up flight in CSV, its channels, and changes of both.

use super::{Motion, Place};
use flights::{Flight, FlightsError, Quantity};

pub const CHANNELS: &str = r#"
time = { columns = ["t"], unit = "s" }
command = { columns = ["m1", "m2", "m3", "m4"], unit = "count" }
position = { columns = ["px", "py", "pz"], unit = "m" }
velocity = { columns = ["vx", "vy", "vz"], unit = "m/s" }
attitude = { columns = ["qx", "qy", "qz", "qw"] }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
battery_voltage = { columns = ["v"], unit = "V" }
"#;

/// Reads the made-up flight in CSV with `channels`, and `extra` in the flight's table.
pub fn read(motion: &Motion, channels: &str, extra: &str) -> Result<Flight, FlightsError> {
    let place = Place::new();
    place.write("log.csv", motion.csv().as_bytes());
    place.load("log.csv", channels, extra)
}

/// The text with which the flight is refused.
pub fn refused(channels: &str, extra: &str) -> String {
    read(&Motion::default(), channels, extra).unwrap_err().to_string()
}

/// Returns the contradictions in the flight, each with the correction that fits.
pub fn findings(motion: &Motion, channels: &str) -> Vec<(Quantity, String)> {
    match read(motion, channels, "") {
        Err(FlightsError::Implausible { findings, .. }) => findings
            .into_iter()
            .map(|finding| (finding.channel, finding.fits.expect("a clear finding says what fits")))
            .collect(),
        other => panic!("{:?}", other.map(|flight| flight.notes).map_err(|error| error.to_string())),
    }
}

/// The made-up flight in CSV, its columns from `first` on changed by `change`, which knows the row.
pub fn changed(first: &str, count: usize, change: impl Fn(usize, &mut [f64])) -> String {
    let whole = Motion::default().csv();
    let mut lines = whole.lines();
    let header = lines.next().unwrap();
    let at = header.split(',').position(|name| name == first).unwrap();
    let row = |(row, line): (usize, &str)| {
        let mut cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        change(row, &mut cells[at..at + count]);
        cells.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n"
    };
    header.to_owned() + "\n" + &lines.enumerate().map(row).collect::<String>()
}

/// Reads the flight with this text.
pub fn read_text(text: &str) -> Result<Flight, FlightsError> {
    let place = Place::new();
    place.write("log.csv", text.as_bytes());
    place.load("log.csv", CHANNELS, "")
}

/// The channels without one of them.
pub fn without(channel: &str) -> String {
    let kept = CHANNELS.lines().filter(|line| !line.starts_with(channel));
    kept.map(|line| line.to_owned() + "\n").collect()
}
