//! Commands that the logger held: they repeat to the last bit while the vehicle goes on turning. Nobody knows them there; the
//! repeats are left out, so that every reader finds a gap.

use crate::canonical::turning;
use crate::flight::{Channel, Flight, median};
use crate::held;
use vehicles::Vehicle;
use vehicles::gaps::held_period_s;

/// Shortest stretch; whole numbers of a coarse range repeat for less.
const HELD_S: f64 = 1.0;
/// Shortest stretch in which all rotors repeat at once; motors reach another speed in a longer one.
const TOGETHER_S: f64 = 0.1;
/// And it is so many times as long as commands usually stay.
const USUAL_STAYS: usize = 5;
/// Least number of equal samples.
const LEAST_SAMPLES: usize = 20;
/// Least change in the same time elsewhere, in the smallest steps of the channel: a coarser one shows nothing.
const STEPS: f64 = 10.0;
/// Within the stretch the vehicle turns by this part of what it does elsewhere, at least.
const GOES_ON: f64 = 0.5;
/// Greatest part of the commands that a logger holds: if more repeat, a motor's column is wrong.
const PART_MAX: f64 = 0.5;

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

/// Leaves out the repeats of commands that the logger held, and notes them.
pub fn leave_out(flight: &mut Flight, vehicle: &Vehicle) {
    if flight.commands_on_change || !flight.assumed.is_empty() {
        return;
    }
    let rates = rates(flight);
    let command = &flight.command;
    let rotors = vehicle.rotors.len();
    let held: Vec<(usize, usize)> = (0..rotors).flat_map(|rotor| held(command, rotor, vehicle)).collect();
    let together = held_together(command, vehicle);
    // Of a log that holds most of its commands nothing is left out, and there may be many stretches.
    let count = |stretches: &[(usize, usize)]| stretches.iter().map(|(from, to)| to - from).sum::<usize>();
    let samples = count(&held).max(rotors * count(&together));
    if samples as f64 > PART_MAX * (rotors * command.time_s.len()) as f64 {
        return;
    }
    let times_s = |(from, to): &(usize, usize)| (command.time_s[*from], command.time_s[*to]);
    // In a short one the vehicle turns little, in all of them as much as elsewhere.
    let all_s: Vec<(f64, f64)> = together.iter().map(times_s).collect();
    let together = if goes_on(&rates, &all_s) { together } else { Vec::new() };
    let long = held.into_iter().filter(|stretch| goes_on(&rates, &[times_s(stretch)]));
    let stretches: Vec<(usize, usize)> = long.chain(together).collect();
    let mut is_kept = vec![true; command.time_s.len()];
    // The first of a stretch was fresh.
    stretches.iter().for_each(|(from, to)| is_kept[from + 1..=*to].fill(false));
    let repeats = is_kept.iter().filter(|is_kept| !**is_kept).count();
    if repeats == 0 || repeats as f64 > PART_MAX * is_kept.len() as f64 {
        return;
    }
    let longest = stretches.iter().max_by(|a, b| {
        let length_s = |(from, to): &(usize, usize)| command.time_s[*to] - command.time_s[*from];
        length_s(a).total_cmp(&length_s(b))
    });
    if let Some((from, to)) = longest {
        let [from_s, to_s] = [from, to].map(|at| command.time_s[*at]);
        flight.notes.push(format!(
            "command: {repeats} of {} samples are held by the logger: they repeat to the last digit while the vehicle goes on \
             turning, the longest from {from_s:.2} s to {to_s:.2} s; left out",
            is_kept.len()
        ));
    }
    flight.command = flight.command.kept(|at| is_kept[at]);
}

/// Angular velocity, or else the rate of change of the attitude.
fn rates(flight: &Flight) -> Channel<3> {
    if flight.angular_velocity.is_empty() && !flight.attitude.is_empty() {
        return turning(&flight.attitude);
    }
    flight.angular_velocity.clone()
}

/// Stretches in which the command of a rotor repeats, each by its first and last sample. At its limits a command may stay.
fn held<const N: usize>(command: &Channel<N>, rotor: usize, vehicle: &Vehicle) -> Vec<(usize, usize)> {
    let number = |at: usize| command.values[at][rotor];
    let (least, greatest) = limits(command, rotor, vehicle);
    let is_at_limit = |number: f64| number <= least || number >= greatest;
    let (mut found, mut from) = (Vec::new(), 0);
    for at in 1..=command.values.len() {
        if command.values.get(at).is_some_and(|values| values[rotor].to_bits() == number(from).to_bits()) {
            continue;
        }
        let to = at - 1;
        let is_long = to - from >= LEAST_SAMPLES && command.time_s[to] - command.time_s[from] >= HELD_S;
        if is_long && !is_at_limit(number(from)) && is_fine(command, rotor, to - from) {
            found.push((from, to));
        }
        from = at;
    }
    found
}

/// Shorter stretches in which the commands of all rotors repeat at once, which fine commands do not do by chance.
fn held_together<const N: usize>(command: &Channel<N>, vehicle: &Vehicle) -> Vec<(usize, usize)> {
    let starts: Vec<usize> = held::starts(&command.values).chain([command.values.len()]).collect();
    let mut stays: Vec<usize> = starts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    stays.sort_unstable();
    let Some(usual) = stays.get(stays.len() / 2) else { return Vec::new() };
    let limits: Vec<(f64, f64)> =
        (0..vehicle.rotors.len()).map(|rotor| limits(command, rotor, vehicle)).collect();
    let is_held = |(from, to): &(usize, usize)| {
        let duration_s = command.time_s[*to] - command.time_s[*from];
        let inside = |(rotor, (least, greatest)): (usize, &(f64, f64))| {
            let number = command.values[*from][rotor];
            number > *least && number < *greatest
        };
        to - from >= USUAL_STAYS * usual
            && (TOGETHER_S..HELD_S).contains(&duration_s)
            && limits.iter().enumerate().any(inside)
            && (0..limits.len()).all(|rotor| is_fine(command, rotor, to - from))
    };
    starts.windows(2).map(|pair| (pair[0], pair[1] - 1)).filter(is_held).collect()
}

/// Numbers at which the command of a rotor may stay.
fn limits<const N: usize>(command: &Channel<N>, rotor: usize, vehicle: &Vehicle) -> (f64, f64) {
    // A controller may clamp within the range of the vehicle file: what is never passed is a limit.
    let numbers = || command.values.iter().map(|values| values[rotor]);
    let least = numbers().fold(f64::INFINITY, f64::min).max(vehicle.command.min);
    let greatest = numbers().fold(f64::NEG_INFINITY, f64::max).min(vehicle.command.max);
    (least, greatest)
}

/// True if the command changes in `count` samples by many of its smallest steps, in nine of ten places.
fn is_fine<const N: usize>(command: &Channel<N>, rotor: usize, count: usize) -> bool {
    let numbers: Vec<f64> = command.values.iter().map(|values| values[rotor]).collect();
    let size = numbers.iter().fold(0.0_f64, |size, number| size.max(number.abs()));
    // Smaller steps are rounding errors of a unit conversion.
    let steps = numbers.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 1e-9 * size);
    let Some(least) = steps.reduce(f64::min) else { return false };
    // Of the stretch itself nothing is taken: there the way is zero.
    let ways = numbers.iter().zip(numbers.iter().skip(count)).map(|(from, to)| (to - from).abs());
    let mut ways: Vec<f64> = ways.filter(|way| *way > 0.0).collect();
    ways.sort_by(f64::total_cmp);
    ways.get(ways.len() / 10).is_some_and(|way| *way > STEPS * least)
}

/// True if the vehicle turns in `stretches_s` about as much as elsewhere.
fn goes_on(rates: &Channel<3>, stretches_s: &[(f64, f64)]) -> bool {
    let within = |time_s: f64| stretches_s.iter().any(|(from_s, to_s)| (*from_s..=*to_s).contains(&time_s));
    let inside: Vec<bool> = rates.time_s.iter().map(|time_s| within(*time_s)).collect();
    let is_inside = |at: usize| inside[at];
    (0..3).any(|axis| {
        let usual_size = |inside: bool| {
            let of = (0..rates.values.len()).filter(|at| is_inside(*at) == inside);
            let numbers: Vec<f64> = of.map(|at| rates.values[at][axis]).collect();
            let middle = median(numbers.iter().copied())?;
            median(numbers.iter().map(|number| (number - middle).abs()))
        };
        matches!((usual_size(true), usual_size(false)), (Some(inside), Some(outside)) if outside > 0.0 && inside > GOES_ON * outside)
    })
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
