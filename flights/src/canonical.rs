//! A flight as one table on one time base, in SI: a CSV file that every tool reads, the `player` node among them.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use vehicles::ROTORS_MAX;
use vehicles::gaps::{GAP_PERIODS, held_period_s};

use crate::clean::gaps;
use crate::error::FlightsError;
use crate::flight::{Channel, Flight, period_s};
use crate::frame::{rotation, to_wxyz};
use crate::measured_voltage::MeasuredVoltage;

/// The columns of the file of `flight`, as the `columns` table of a player in a manifest.
#[must_use]
pub fn columns(flight: &Flight) -> String {
    let command: Vec<String> = (1..=flight.rotors).map(|rotor| format!("\"m{rotor}\"")).collect();
    let voltage = MeasuredVoltage::of(flight).map_or("", |_| VOLTAGE);
    format!("command = {{ columns = [{}], unit = \"count\" }}\n{COLUMNS}{voltage}", command.join(", "))
}

const COLUMNS: &str = r#"time = { columns = ["t"], unit = "s" }
position = { columns = ["px", "py", "pz"], unit = "m" }
velocity = { columns = ["vx", "vy", "vz"], unit = "m/s" }
attitude = { columns = ["qx", "qy", "qz", "qw"], unit = "1" }
angular_velocity = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
"#;

const VOLTAGE: &str = "battery_voltage = { columns = [\"vbat\"], unit = \"V\" }\n";

/// The start of every such file.
pub const HEADER_START: &str = "t,m1,";
/// Samples to either side of one at which a derivative is fitted.
pub const HALF_WINDOW: usize = 3;

/// Result of the writing of a canonical file.
#[derive(Debug, Clone, PartialEq)]
pub struct Canonical {
    /// Number of rows.
    pub rows: usize,
    /// Notes on values that were derived, filled in or left out.
    pub notes: Vec<String>,
}

/// Writes `flight` to `path`, a row for each sample of the attitude, or of the angular velocity where no attitude
/// was logged. A command holds until the next; the rest is interpolated, and derived where it was not logged.
///
/// # Errors
/// If the flight has neither attitude nor angular velocity, or the file cannot be written.
pub fn write_csv(flight: &Flight, path: &Path) -> Result<Canonical, FlightsError> {
    let (canonical, text) = csv(flight)?;
    std::fs::write(path, text).map_err(|cause| FlightsError::Write { path: path.to_owned(), cause })?;
    Ok(canonical)
}

/// A row of the table, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Time of the flight.
    pub time_s: f64,
    /// Motor commands in effect; zeros behind the last rotor.
    pub command: [f64; ROTORS_MAX],
    /// Position in W.
    pub position_m: [f64; 3],
    /// Velocity in W.
    pub velocity_m_s: [f64; 3],
    /// Attitude quaternion x, y, z, w, body to world.
    pub attitude: [f64; 4],
    /// Angular velocity in B.
    pub angular_velocity_rad_s: [f64; 3],
    /// Voltage of the battery in V, a mean over 0.2 s; `None` if it was not logged.
    pub battery_v: Option<f64>,
}

impl Row {
    /// A line of the file of a vehicle with so many `rotors`.
    fn text(&self, rotors: usize) -> String {
        let numbers = [
            &[self.time_s][..],
            &self.command[..rotors],
            &self.position_m,
            &self.velocity_m_s,
            &self.attitude,
            &self.angular_velocity_rad_s,
            self.battery_v.as_slice(),
        ]
        .concat();
        numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n"
    }
}

/// The text that [`write_csv`] writes.
///
/// ```
/// use flights::{Channel, Flight, Role};
///
/// let mut flight = Flight::new("still", "log.csv", Role::Fit);
/// flight.attitude = Channel { time_s: vec![0.0, 0.1], values: vec![[1.0, 0.0, 0.0, 0.0]; 2] };
/// let (written, text) = flights::csv(&flight)?;
/// assert!(written.rows == 2 && text.starts_with("t,m1,m2,m3,m4,px,py,pz,"));
/// # Ok::<(), flights::FlightsError>(())
/// ```
///
/// # Errors
/// If the flight has neither attitude nor angular velocity.
pub fn csv(flight: &Flight) -> Result<(Canonical, String), FlightsError> {
    let (canonical, rows) = rows(flight)?;
    Ok((canonical, text(&rows, flight.rotors)))
}

/// The rows of a vehicle with so many `rotors` as a CSV file.
pub fn text(rows: &[Row], rotors: usize) -> String {
    let command: String = (1..=rotors).map(|rotor| format!("m{rotor},")).collect();
    // A flight has a voltage in all rows or in none.
    let voltage = if rows.iter().any(|row| row.battery_v.is_some()) { ",vbat" } else { "" };
    let header = format!("t,{command}px,py,pz,vx,vy,vz,qx,qy,qz,qw,wx,wy,wz{voltage}\n");
    rows.iter().fold(header, |text, row| text + &row.text(rotors))
}

/// The rows of the table.
///
/// # Errors
/// If the flight has neither attitude nor angular velocity.
pub fn rows(flight: &Flight) -> Result<(Canonical, Vec<Row>), FlightsError> {
    let mut notes = Vec::new();
    let table = Table::of(flight, &mut notes);
    let base =
        if flight.attitude.is_empty() { &flight.angular_velocity.time_s } else { &flight.attitude.time_s };
    let times: Vec<f64> = base.iter().copied().filter(|time_s| !table.is_in_gap(*time_s)).collect();
    if times.is_empty() {
        return Err(FlightsError::NoRows { flight: flight.name.clone(), found: flight.spans() });
    }
    if times.len() < base.len() {
        notes.push(format!(
            "{} of {} rows lie in gaps of more than {GAP_PERIODS} periods of some channel; left out",
            base.len() - times.len(),
            base.len()
        ));
    }
    let rows: Vec<Row> = times.iter().map(|time_s| table.row(*time_s)).collect();
    Ok((Canonical { rows: rows.len(), notes }, rows))
}

/// The channels from which rows are made.
struct Table<'a> {
    flight: &'a Flight,
    velocity: Channel<3>,
    angular_velocity: Channel<3>,
    voltage: Option<MeasuredVoltage>,
    /// Times, without their ends, at which a channel has no samples.
    gaps: Vec<(f64, f64)>,
}

impl<'a> Table<'a> {
    fn of(flight: &'a Flight, notes: &mut Vec<String>) -> Self {
        let mut velocity = flight.velocity.clone();
        if velocity.is_empty() && !flight.position.is_empty() {
            let p = |index: usize| Vector3::from(flight.position.values[index]);
            velocity = derivative(&flight.position.time_s, |from, to| p(to) - p(from));
            notes.push("velocity: derived from the position by local quadratics over 7 samples".to_owned());
        }
        let mut angular_velocity = flight.angular_velocity.clone();
        if angular_velocity.is_empty() {
            angular_velocity = turning(&flight.attitude);
            notes.push(
                "angular velocity: derived from the attitude by local quadratics over 7 samples".to_owned(),
            );
        }
        let missing = [
            (flight.command.is_empty(), "command: not logged, filled with 0"),
            (flight.position.is_empty(), "position: not logged, filled with 0"),
            (velocity.is_empty(), "velocity: not logged, filled with 0"),
            (flight.attitude.is_empty(), "attitude: not logged, filled with the identity"),
        ];
        let missing = missing.into_iter().filter(|(is_missing, _)| *is_missing);
        notes.extend(missing.map(|(_, text)| text.to_owned()));
        let (position, attitude) = (&flight.position.time_s, &flight.attitude.time_s);
        let gaps =
            [position, &velocity.time_s, attitude, &angular_velocity.time_s].map(|time_s| without(time_s));
        let gaps = [&gaps.concat()[..], &without_commands(flight)].concat();
        let voltage = MeasuredVoltage::of(flight);
        if voltage.is_some() {
            notes.push("battery voltage: the mean over 0.2 s about each row".to_owned());
        }
        Self { flight, gaps: joined(gaps), velocity, angular_velocity, voltage }
    }

    fn is_in_gap(&self, time_s: f64) -> bool {
        let begun = self.gaps.partition_point(|(from_s, _)| *from_s < time_s);
        begun.checked_sub(1).is_some_and(|last| time_s < self.gaps[last].1)
    }

    fn row(&self, time_s: f64) -> Row {
        let [w, x, y, z] = attitude(&self.flight.attitude, time_s);
        Row {
            time_s,
            command: held(&self.flight.command, time_s),
            position_m: linear(&self.flight.position, time_s),
            velocity_m_s: linear(&self.velocity, time_s),
            attitude: [x, y, z, w],
            angular_velocity_rad_s: linear(&self.angular_velocity, time_s),
            battery_v: self.voltage.as_ref().map(|voltage| voltage.at(time_s)),
        }
    }
}

/// The same open intervals, in order and none over another: a log can have as many gaps as rows.
fn joined(mut gaps: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    gaps.retain(|(from_s, to_s)| from_s < to_s);
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut apart: Vec<(f64, f64)> = Vec::new();
    for (from_s, to_s) in gaps {
        match apart.last_mut() {
            // What begins where another ends leaves that instant.
            Some(last) if from_s < last.1 => last.1 = last.1.max(to_s),
            _ => apart.push((from_s, to_s)),
        }
    }
    apart
}

/// The times at which a channel has no samples: its gaps, and all before and after it but for five periods.
fn without(time_s: &[f64]) -> Vec<(f64, f64)> {
    let (Some(first_s), Some(last_s), Some(period_s)) = (time_s.first(), time_s.last(), period_s(time_s))
    else {
        return Vec::new();
    };
    let slack_s = GAP_PERIODS * period_s;
    let ends = [(f64::NEG_INFINITY, first_s - slack_s), (last_s + slack_s, f64::INFINITY)];
    gaps(time_s).into_iter().chain(ends).collect()
}

/// Times at which the command is not known: gaps of the commands, and all before the first and after the last but for five
/// periods.
fn without_commands(flight: &Flight) -> Vec<(f64, f64)> {
    let time_s = &flight.command.time_s;
    let Some((first_s, last_s)) = flight.command.span_s() else { return Vec::new() };
    let mut gaps = flight.command_gaps_s();
    gaps.push((f64::NEG_INFINITY, first_s));
    if !flight.commands_on_change {
        let period_s = held_period_s(time_s).unwrap_or(0.0);
        gaps.push((last_s + GAP_PERIODS * period_s, f64::INFINITY));
    }
    gaps
}

/// The samples around `time_s` and how far it lies between them; at the ends the nearest sample twice.
fn around<const N: usize>(channel: &Channel<N>, time_s: f64) -> Option<([f64; N], [f64; N], f64)> {
    let after = channel.time_s.partition_point(|sample_s| *sample_s <= time_s);
    let before = after.saturating_sub(1);
    let from = *channel.values.get(before)?;
    match (channel.time_s.get(before), channel.time_s.get(after)) {
        (Some(from_s), Some(to_s)) if after > before => {
            Some((from, channel.values[after], (time_s - from_s) / (to_s - from_s)))
        }
        _ => Some((from, from, 0.0)),
    }
}

fn linear(channel: &Channel<3>, time_s: f64) -> [f64; 3] {
    around(channel, time_s).map_or([0.0; 3], |(from, to, part)| {
        std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * part)
    })
}

fn held(channel: &Channel<ROTORS_MAX>, time_s: f64) -> [f64; ROTORS_MAX] {
    around(channel, time_s).map_or([0.0; ROTORS_MAX], |(from, _, _)| from)
}

/// In the order w, x, y, z.
fn attitude(channel: &Channel<4>, time_s: f64) -> [f64; 4] {
    around(channel, time_s).map_or([1.0, 0.0, 0.0, 0.0], |(from, to, part)| {
        let [a, b] = [from, to].map(rotation);
        to_wxyz(a.try_slerp(&b, part, 1e-12).unwrap_or(a).into_inner())
    })
}

/// Angular velocity in B at every sample of an attitude.
pub fn turning(attitude: &Channel<4>) -> Channel<3> {
    let q = |index: usize| rotation(attitude.values[index]);
    derivative(&attitude.time_s, |from, to| (q(from).inverse() * q(to)).scaled_axis())
}

/// The derivative at every sample: that of the quadratic nearest to the changes to its neighbours, none of them
/// behind a gap. `change(from, to)` is the change from one sample to another.
fn derivative(times: &[f64], change: impl Fn(usize, usize) -> Vector3<f64>) -> Channel<3> {
    let limit_s = GAP_PERIODS * period_s(times).unwrap_or(f64::INFINITY);
    let joined = |a: usize| times[a + 1] - times[a] <= limit_s;
    let slope = |at: usize| {
        let mut from = at;
        while from > 0 && at - from < HALF_WINDOW && joined(from - 1) {
            from -= 1;
        }
        let mut to = at;
        while to + 1 < times.len() && to - at < HALF_WINDOW && joined(to) {
            to += 1;
        }
        quadratic_slope((from..=to).map(|k| (times[k] - times[at], change(at, k))))
    };
    let values = (0..times.len()).map(|at| slope(at).into()).collect();
    Channel { time_s: times.to_vec(), values }
}

/// The slope at 0 of the quadratic nearest to `points`; of the line through their ends where they are too few.
fn quadratic_slope(points: impl Iterator<Item = (f64, Vector3<f64>)> + Clone) -> Vector3<f64> {
    let (mut normal, mut right) = (Matrix3::zeros(), Matrix3::zeros());
    // Times in units of the window, so that the matrix is well conditioned.
    let scale = points.clone().map(|(time, _)| time.abs()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    for (time, value) in points.clone() {
        let tau = time / scale;
        let powers = Vector3::new(1.0, tau, tau * tau);
        normal += powers * powers.transpose();
        right += powers * value.transpose();
    }
    if let Some(inverse) = normal.try_inverse().filter(|_| points.clone().count() > 2) {
        return (inverse * right).row(1).transpose() / scale;
    }
    match points.clone().next().zip(points.last()) {
        Some(((t0, v0), (t1, v1))) if t1 > t0 => (v1 - v0) / (t1 - t0),
        _ => Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_of_a_quadratic_is_exact() {
        let times: Vec<f64> = (0..20).map(|k| 0.01 * f64::from(k) + 0.001 * f64::from(k % 3)).collect();
        let p = |t: f64| Vector3::new(1.0 + 2.0 * t - 3.0 * t * t, t, 5.0);
        let derived = derivative(&times, |from, to| p(times[to]) - p(times[from]));
        for (t, v) in times.iter().zip(&derived.values) {
            assert!((Vector3::from(*v) - Vector3::new(2.0 - 6.0 * t, 1.0, 0.0)).norm() < 1e-9, "{t}: {v:?}");
        }
    }

    #[test]
    fn gaps_are_joined_where_they_overlap() {
        let gaps = vec![(5.0, 6.0), (0.0, 2.0), (1.0, 1.5), (2.0, 3.0), (2.5, 4.0), (9.0, 8.0)];
        assert_eq!(joined(gaps), [(0.0, 2.0), (2.0, 4.0), (5.0, 6.0)]);
    }

    #[test]
    fn single_samples_have_no_slope() {
        assert_eq!(derivative(&[1.0], |_, _| Vector3::zeros()).values, [[0.0; 3]]);
        assert_eq!(
            derivative(&[0.0, 0.5], |a, b| Vector3::x() * (b as f64 - a as f64)).values,
            [[2.0, 0.0, 0.0]; 2]
        );
    }
}
