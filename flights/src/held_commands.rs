//! Commands that a logger held, or that an exporter filled in: the true ones are unknown there. They are left
//! out, so that every reader finds a gap.

use crate::canonical::turning;
use crate::flight::{Channel, Flight, median};
use crate::held;
use std::ops::RangeInclusive;
use vehicles::Vehicle;
use vehicles::command_log::{CommandLog, Stretch};
use vehicles::filled_commands::Filled;
use vehicles::gaps::held_period_s;
use vehicles::held_commands;

/// Stretches that a note names.
const NAMED: usize = 5;
/// A vehicle that nothing carries is pushed by less than this part of gravity, and falls by more than the rest of it.
const CARRIED: f64 = 0.5;
/// Rotors that stop carry less within a short time already: the specific force falls by this part of gravity
/// at least. It falls by as much in fewer than the part [`DROPS_ELSEWHERE`] of all times of the flight.
const DROP: f64 = 0.2;
const DROPS_ELSEWHERE: f64 = 0.05;
/// Fewer other times of the same length say nothing.
const TIMES_MIN: usize = 20;

impl Flight {
    /// Usual longest time between two commands: between those that differ, where the log holds them on a finer grid. `None`
    /// with fewer than two.
    ///
    /// ```
    /// use flights::{Channel, Flight, Role};
    ///
    /// let mut flight = Flight::new("merged", "log.csv", Role::Fit);
    /// let held = |k: i32| [f64::from(k / 10); vehicles::ROTORS_MAX];
    /// flight.command.time_s = (0..100).map(|k| 0.005 * f64::from(k)).collect();
    /// flight.command.values = (0..100).map(held).collect();
    /// assert!((flight.command_period_s().unwrap() - 0.05).abs() < 1e-9);
    /// ```
    #[must_use]
    pub fn command_period_s(&self) -> Option<f64> {
        let Channel { time_s, values } = &self.command;
        match held::regular_starts(values).filter(|_| !self.commands_on_change) {
            Some(starts) => held_period_s(&starts.iter().map(|at| time_s[*at]).collect::<Vec<_>>()),
            None => held_period_s(time_s),
        }
    }

    /// The flight with each command once, where its log holds them on a finer grid; `None` where it does not.
    #[must_use]
    pub fn without_held_commands(&self) -> Option<Self> {
        let starts = held::regular_starts(&self.command.values).filter(|_| !self.commands_on_change)?;
        let mut is_start = vec![false; self.command.values.len()];
        starts.iter().for_each(|at| is_start[*at] = true);
        Some(Self { command: self.command.kept(|at| is_start[at]), ..self.clone() })
    }
}

/// Leaves out commands that an exporter filled in and repeats of commands that the logger held, and notes them.
pub fn leave_out(flight: &mut Flight, vehicle: &Vehicle) {
    if flight.commands_on_change || !flight.assumed.is_empty() {
        return;
    }
    let rates = rates(flight);
    let filled =
        Filled::of(&log(flight, vehicle, &rates), &|from_s, to_s| falls(flight, vehicle, from_s, to_s));
    note_filled(flight, &filled);
    let stretches: Vec<RangeInclusive<usize>> = filled.stretches().map(|(from, to)| *from..=*to).collect();
    remove(flight, &stretches);
    let held = held_commands::of(&log(flight, vehicle, &rates));
    note_held(flight, &held);
    // The first of a stretch was fresh.
    let repeats: Vec<RangeInclusive<usize>> = held.iter().map(|(from, to)| from + 1..=*to).collect();
    remove(flight, &repeats);
}

/// The commands of `flight`, a column for each rotor of `vehicle`, beside its `rates`.
fn log<'a>(flight: &'a Flight, vehicle: &Vehicle, rates: &'a Channel<3>) -> CommandLog<'a> {
    let Channel { time_s, values } = &flight.command;
    let column = |rotor: usize| values.iter().map(|values| values[rotor]).collect();
    CommandLog {
        time_s,
        rotors: (0..vehicle.rotors.len()).map(column).collect(),
        range: (vehicle.command.min, vehicle.command.max),
        rate_time_s: &rates.time_s,
        rates: &rates.values,
    }
}

fn remove(flight: &mut Flight, stretches: &[RangeInclusive<usize>]) {
    let mut is_kept = vec![true; flight.command.time_s.len()];
    stretches.iter().for_each(|stretch| is_kept[stretch.clone()].fill(false));
    flight.command = flight.command.kept(|at| is_kept[at]);
}

fn note_filled(flight: &mut Flight, filled: &Filled) {
    let time_s = &flight.command.time_s;
    let kinds = [
        (&filled.zeros, "zeros, although the vehicle flies before and after them"),
        (&filled.lines, "straight lines of all rotors from one command to the next, between noisy ones"),
    ];
    for (stretches, kind) in kinds.into_iter().filter(|(stretches, _)| !stretches.is_empty()) {
        let count: usize = stretches.iter().map(|(from, to)| to + 1 - from).sum();
        let verb = if count == 1 { "was" } else { "were" };
        let all = match stretches.len() {
            1 => "1 stretch".to_owned(),
            several => format!("{several} stretches"),
        };
        let one = |(from, to): &Stretch| format!("{:.2} s to {:.2} s", time_s[*from], time_s[*to]);
        let named: Vec<String> = stretches.iter().take(NAMED).map(one).collect();
        let more = match stretches.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        flight.notes.push(format!(
            "command: {count} of {} samples in {all} {verb} filled in by an exporter: {kind}; from {}{more}; left out",
            time_s.len(),
            named.join(", from ")
        ));
    }
}

fn note_held(flight: &mut Flight, held: &[Stretch]) {
    let time_s = &flight.command.time_s;
    let times_s = |(from, to): &Stretch| (time_s[*from], time_s[*to]);
    let longest = held.iter().map(times_s).max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
    let Some((from_s, to_s)) = longest else { return };
    let mut is_repeat = vec![false; time_s.len()];
    held.iter().for_each(|(from, to)| is_repeat[from + 1..=*to].fill(true));
    let repeats = is_repeat.iter().filter(|is_repeat| **is_repeat).count();
    flight.notes.push(format!(
        "command: {repeats} of {} samples are held by the logger: they repeat to the last digit while the vehicle goes on \
         turning, the longest from {from_s:.2} s to {to_s:.2} s; left out",
        time_s.len()
    ));
}

/// Angular velocity, or else the rate of change of the attitude.
fn rates(flight: &Flight) -> Channel<3> {
    if flight.angular_velocity.is_empty() && !flight.attitude.is_empty() {
        return turning(&flight.attitude);
    }
    flight.angular_velocity.clone()
}

/// True if the motion shows that nothing carries the vehicle in the second half of the time: rotors go on turning for a moment.
fn falls(flight: &Flight, vehicle: &Vehicle, from_s: f64, to_s: f64) -> bool {
    let gravity_m_s2 = vehicle.gravity_m_s2;
    let middle_s = f64::midpoint(from_s, to_s);
    let within = |time_s: &f64| (middle_s..=to_s).contains(time_s);
    let Channel { time_s, values } = &flight.specific_force;
    let from = time_s.partition_point(|time_s| *time_s < middle_s);
    let to = time_s.partition_point(|time_s| *time_s <= to_s);
    let sizes = values[from..to].iter().map(|f| f.iter().map(|part| part * part).sum::<f64>().sqrt());
    if let Some(size) = median(sizes) {
        return size < CARRIED * gravity_m_s2 || drops(flight, gravity_m_s2, from_s, to_s);
    }
    let velocity =
        flight.velocity.time_s.iter().zip(&flight.velocity.values).filter(|(time_s, _)| within(time_s));
    let speeds: Vec<(f64, f64)> = velocity.map(|(time_s, v)| (*time_s, v[2])).collect();
    if let Some(rise_m_s2) = slope(&speeds) {
        return rise_m_s2 < -CARRIED * gravity_m_s2;
    }
    let position = flight.position.time_s.iter().zip(&flight.position.values);
    let heights: Vec<(f64, f64)> = position
        .filter(|(time_s, _)| (from_s..=to_s).contains(*time_s))
        .map(|(time_s, p)| (*time_s, p[2]))
        .collect();
    let (before, behind) = heights.split_at(heights.len() / 2);
    let change_m_s = slope(behind).zip(slope(before)).map(|(behind, before)| behind - before);
    change_m_s.is_some_and(|change_m_s| change_m_s < -CARRIED * gravity_m_s2 * (to_s - from_s) / 2.0)
}

/// True if the specific force falls at `from_s` more than almost anywhere else in the flight. Rotors need a moment to stop. Commands that an
/// exporter filled in are unrelated to the force.
fn drops(flight: &Flight, gravity_m_s2: f64, from_s: f64, to_s: f64) -> bool {
    let Channel { time_s, values } = &flight.specific_force;
    let mean = |from_s: f64, to_s: f64| {
        let index = |limit_s: f64| time_s.partition_point(|time_s| *time_s < limit_s);
        let within = &values[index(from_s)..index(to_s)];
        let sum: f64 = within.iter().map(|f| f.iter().map(|part| part * part).sum::<f64>().sqrt()).sum();
        (!within.is_empty()).then(|| sum / within.len() as f64)
    };
    let (Some(first_s), Some(last_s)) = (time_s.first(), time_s.last()) else { return false };
    let length_s = to_s - from_s;
    let drop =
        |at_s: f64| Some(mean(at_s - length_s / 2.0, at_s)? - mean(at_s + length_s / 2.0, at_s + length_s)?);
    let here = drop(from_s).unwrap_or(0.0);
    if here <= DROP * gravity_m_s2 {
        return false;
    }
    let times = ((last_s - first_s) / length_s).floor().min(values.len() as f64);
    let others: Vec<f64> =
        (0..times as usize).filter_map(|time| drop(first_s + length_s * time as f64)).collect();
    let as_far = others.iter().filter(|other| **other >= here).count();
    others.len() >= TIMES_MIN && (as_far as f64) < DROPS_ELSEWHERE * others.len() as f64
}

/// Slope of the straight line through points that leaves the least squares; `None` with fewer than three.
fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let count = points.len() as f64;
    let (time_s, value) =
        points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
    let of = |product: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(product).sum::<f64>();
    let squares = of(&|point| (point.0 - time_s).powi(2));
    (points.len() >= 3 && squares > 0.0)
        .then(|| of(&|point| (point.0 - time_s) * (point.1 - value)) / squares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Role;

    /// A flight of 20 s at 100 Hz that turns to and fro, with commands that follow.
    fn flight() -> (Flight, Vehicle) {
        let vehicle = Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
        let mut flight = Flight::new("f", "log", Role::Fit);
        let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
        let rate = |t: &f64| [0.5 * libm::sin(5.0 * t), 0.3 * libm::cos(3.0 * t), 0.0];
        flight.angular_velocity =
            Channel { values: time_s.iter().map(rate).collect(), time_s: time_s.clone() };
        let commands =
            |t: &f64| {
                std::array::from_fn(|rotor| {
                    if rotor < 4 { 76.0 + 5.0 * libm::sin(5.0 * t + rotor as f64) } else { 0.0 }
                })
            };
        flight.command = Channel { values: time_s.iter().map(commands).collect(), time_s };
        (flight, vehicle)
    }

    #[test]
    fn what_the_logger_held_is_a_gap() {
        for rotors in [0..4, 1..2] {
            let (mut flight, vehicle) = flight();
            let first = flight.command.values[500];
            flight.command.values[500..900].iter_mut().for_each(|values| {
                values[rotors.clone()].copy_from_slice(&first[rotors.clone()]);
            });
            leave_out(&mut flight, &vehicle);
            assert_eq!(flight.command.time_s.len(), 2000 - 399, "{rotors:?}");
            assert!(flight.notes[0].starts_with("command: 399 of 2000 samples are held by the logger"));
            assert!(flight.notes[0].contains("from 5.00 s to 8.99 s"), "{:?}", flight.notes);
        }
    }

    #[test]
    fn short_holds_of_all_rotors_are_gaps() {
        let (mut flight, vehicle) = flight();
        let holds = || (0..12).map(|number| 100 + 150 * number);
        for from in holds() {
            let first = flight.command.values[from];
            flight.command.values[from..from + 40].fill(first);
        }
        leave_out(&mut flight, &vehicle);
        assert!(flight.notes[0].starts_with("command: 468 of 2000 samples are held by the logger"));
        // While one rotor goes on, the others may stay; and so may commands in steps that are coarse beside their changes.
        for is_coarse in [false, true] {
            let (mut flight, _) = self::flight();
            if is_coarse {
                flight.command.values.iter_mut().flatten().for_each(|number| *number = number.round());
            }
            for from in holds() {
                let first = flight.command.values[from];
                let rotors = if is_coarse { 0..4 } else { 0..3 };
                flight.command.values[from..from + 40]
                    .iter_mut()
                    .for_each(|values| values[rotors.clone()].copy_from_slice(&first[rotors.clone()]));
            }
            leave_out(&mut flight, &vehicle);
            assert_eq!((flight.command.time_s.len(), flight.notes), (2000, vec![]), "{is_coarse}");
        }
    }

    /// Zeros of a vehicle that falls are commands; the accelerometer, the velocity or the position shows it.
    #[test]
    fn zeros_of_a_fall_are_commands() {
        let vertical = |t: f64, is_falling: bool| {
            let fallen_s = if is_falling { (t - 5.0).clamp(0.0, 0.4) } else { 0.0 };
            (
                5.0 - 4.9 * fallen_s * fallen_s,
                -9.8 * fallen_s,
                if is_falling && (5.0..5.4).contains(&t) { 0.0 } else { 9.8 },
            )
        };
        for (sensor, is_falling) in (0..3).flat_map(|sensor| [(sensor, false), (sensor, true)]) {
            let (mut flight, vehicle) = flight();
            flight.command.values[500..540].iter_mut().for_each(|values| values.fill(0.0));
            let time_s = flight.command.time_s.clone();
            let of = |value: &dyn Fn((f64, f64, f64)) -> f64| {
                let values = time_s.iter().map(|t| [0.0, 0.0, value(vertical(*t, is_falling))]).collect();
                Channel { time_s: time_s.clone(), values }
            };
            match sensor {
                0 => flight.position = of(&|(height_m, _, _)| height_m),
                1 => flight.velocity = of(&|(_, rise_m_s, _)| rise_m_s),
                _ => flight.specific_force = of(&|(_, _, force_m_s2)| force_m_s2),
            }
            leave_out(&mut flight, &vehicle);
            let left = if is_falling { 2000 } else { 1960 };
            assert_eq!(flight.command.time_s.len(), left, "{sensor} {is_falling}: {:?}", flight.notes);
        }
    }

    /// The rotors of a small vehicle lose half of their thrust in 0.14 s.
    #[test]
    fn a_short_cut_of_the_motors_is_a_command_if_the_vehicle_feels_it() {
        for is_cut in [true, false] {
            let (mut flight, vehicle) = flight();
            let time_s = flight.command.time_s.clone();
            let part = |at: usize| {
                let lost = if is_cut && (1000..1014).contains(&at) { (at - 1000) as f64 / 28.0 } else { 0.0 };
                (1.0 - lost) * (1.0 + 0.1 * libm::sin(0.2 * at as f64))
            };
            let forces = (0..time_s.len()).map(|at| [0.0, 0.0, vehicle.gravity_m_s2 * part(at)]).collect();
            flight.specific_force = Channel { values: forces, time_s };
            flight.command.values[1000..1014].iter_mut().for_each(|values| values.fill(0.0));
            leave_out(&mut flight, &vehicle);
            let is_left_out = flight.notes.iter().any(|note| note.contains("filled in by an exporter"));
            assert_eq!(
                (is_left_out, flight.command.time_s.len()),
                (!is_cut, if is_cut { 2000 } else { 1986 })
            );
        }
    }

    #[test]
    fn commands_that_may_stay_are_left() {
        let unchanged = |change: &dyn Fn(&mut Flight)| {
            let (mut flight, vehicle) = flight();
            change(&mut flight);
            let before = flight.command.clone();
            leave_out(&mut flight, &vehicle);
            assert_eq!((flight.command, flight.notes), (before, vec![]));
        };
        unchanged(&|_| {});
        let hold = |flight: &mut Flight, command: f64| {
            flight.command.values[500..900].iter_mut().for_each(|values| values[..4].fill(command));
        };
        // At a limit of the vehicle or of the controller, at rest, on change, in whole numbers, and for most of the flight.
        unchanged(&|flight| hold(flight, 200.0));
        unchanged(&|flight| hold(flight, 60.0));
        unchanged(&|flight| {
            hold(flight, 76.0);
            flight.angular_velocity.values[500..900].fill([0.0; 3]);
        });
        unchanged(&|flight| {
            hold(flight, 76.0);
            flight.commands_on_change = true;
        });
        unchanged(&|flight| {
            let whole =
                |values: &mut [f64; vehicles::ROTORS_MAX]| *values = values.map(|x| (x / 5.0).round());
            flight.command.values.iter_mut().for_each(whole);
            hold(flight, 15.0);
        });
        unchanged(&|flight| flight.command.values[200..1700].iter_mut().for_each(|values| values[1] = 70.0));
    }
}
