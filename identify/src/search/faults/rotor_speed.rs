//! Wrong rotor speed sensors, and motors that do not follow their commands.
//!
//! A measured speed that disagrees with its command is either wrong, or the rotor does turn so. The motion of the vehicle
//! decides: the speed that explains the measured forces and torques better is believed. This is done flight by flight: a
//! sensor that reads half in one of six flights reads 0.917 in the mean, which no threshold detects.

use super::twin::is_off_scale;
use crate::data::fault::{Fault, Part};
use crate::data::prepared::{Equation, Prepared};
use crate::data::rows::column;
use crate::model::problem::Problem;
use crate::numbers::statistics::deviation;

/// Least spread of a speed that is not stuck, as a share of the expected spread.
const STUCK: f64 = 0.05;
/// Largest tolerance of a motor: distance of its ratio of measured to expected speed from that of the other rotors, or of
/// the same rotor in other flights.
const RATIO: f64 = 0.15;
const SENSOR: &str = "check the sensor, its unit and `pole_pairs` for this flight";
const MOTOR: &str = "check motor, propeller and the column of the command";

/// Finds faults of the rotors in each flight. Faulty sensors are distrusted in `problem`.
pub fn find(problem: &mut Problem) -> Vec<Fault> {
    let speeds: Vec<Option<Speeds>> = problem.flights().map(|flight| Speeds::of(problem, flight)).collect();
    let (mut faults, rotors) = (Vec::new(), problem.model.vehicle.rotors.len());
    for at in 0..speeds.len() {
        let suspicions: Vec<(usize, Suspicion)> =
            (0..rotors).filter_map(|rotor| Some((rotor, suspicion(&speeds, at, rotor)?))).collect();
        // All at once: if every sensor is wrong, one alone improves nothing.
        suspicions.iter().for_each(|(rotor, _)| distrust(problem, at, *rotor, true));
        for (rotor, suspicion) in suspicions {
            faults.push(judged(problem, at, rotor, suspicion));
        }
    }
    faults
}

/// Decides on one suspicion by the motion.
fn judged(problem: &mut Problem, at: usize, rotor: usize, suspicion: Suspicion) -> Fault {
    let distrusting = motion_cost(problem, at);
    distrust(problem, at, rotor, false);
    let trusting = motion_cost(problem, at);
    let is_sensor = distrusting < trusting;
    distrust(problem, at, rotor, is_sensor);
    let found = format!(
        "{}; the measured motion is {} explained by the commanded speed (squared residual {:.3} of that with the measured \
         one)",
        suspicion.found,
        if is_sensor { "better" } else { "worse" },
        distrusting / trusting
    );
    let (kind, consequence, advice) = if is_sensor {
        (suspicion.kind, "the sensor is not used in this flight; the speed follows from the command", SENSOR)
    } else {
        ("rotor-off-command", "the measured speed is used: the rotor does turn so", MOTOR)
    };
    let flight = problem.flights().nth(at).map_or(String::new(), |flight| flight.flight.name.clone());
    let channel = format!("rotor_speed.{}", rotor + 1);
    Fault { flight, channel, kind, expected: suspicion.expected, found, consequence, advice }
}

struct Suspicion {
    kind: &'static str,
    expected: String,
    found: String,
}

/// Measured and expected speeds of one flight's rotors.
struct Speeds {
    measured: Vec<Vec<f64>>,
    expected: Vec<Vec<f64>>,
}

impl Speeds {
    /// Speeds at all knots; `None` if the flight does not have both.
    fn of(problem: &Problem, flight: &Prepared) -> Option<Self> {
        flight.offset_of(flight.rotor_speed())?;
        let declared = problem.model.parameters.baseline();
        let rows = &problem.model.tracks(flight, &declared).rows;
        let commanded = problem.model.rotors(flight, &declared).commanded;
        let rotors = || 0..flight.flight.rotors;
        let at_knots =
            |rotor: usize| flight.layout.knots.iter().map(|knot| commanded[*knot][rotor]).collect();
        Some(Self {
            measured: rotors().map(|rotor| column(flight, rows, flight.rotor_speed(), rotor)).collect(),
            expected: rotors().map(at_knots).collect(),
        })
    }

    /// Ratio of a rotor's measured to its expected speed.
    fn ratio(&self, rotor: usize) -> f64 {
        self.measured[rotor].iter().sum::<f64>() / self.expected[rotor].iter().sum::<f64>()
    }
}

fn suspicion(flights: &[Option<Speeds>], at: usize, rotor: usize) -> Option<Suspicion> {
    let speeds = flights[at].as_ref()?;
    let (spread, wanted) = (deviation(&speeds.measured[rotor]), deviation(&speeds.expected[rotor]));
    if spread < STUCK * wanted {
        let expected = format!("a spread of {wanted:.2} rad/s, for which its command asks");
        return Some(Suspicion { kind: "stuck-sensor", expected, found: format!("{spread:.2} rad/s") });
    }
    let here = speeds.ratio(rotor);
    let off = |usual: f64, who: &str| {
        ((here / usual - 1.0).abs() > RATIO).then(|| Suspicion {
            kind: "scaled-sensor",
            expected: format!("{usual:.3} of the commanded speed, as {who}"),
            found: format!("{here:.3} of it"),
        })
    };
    let others = (0..speeds.measured.len()).filter(|other| *other != rotor).map(|other| speeds.ratio(other));
    let elsewhere = (0..flights.len()).filter(|other| *other != at);
    let elsewhere = elsewhere.filter_map(|other| Some(flights[other].as_ref()?.ratio(rotor)));
    // Of two flights, the one further from its commands is wrong.
    let is_further = |usual: &f64| libm::log(here).abs() > libm::log(*usual).abs();
    let of_rotors = middle(others).and_then(|usual| off(usual, "the other rotors of this flight"));
    let of_flights =
        || middle(elsewhere).filter(is_further).and_then(|usual| off(usual, "in the other flights"));
    of_rotors.or_else(of_flights)
}

/// Median; of an even number, the upper of two.
fn middle(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

fn distrust(problem: &mut Problem, at: usize, rotor: usize, is_distrusted: bool) {
    if let Some(flight) = problem.flights_mut().nth(at) {
        flight.distrusted[rotor] = is_distrusted;
    }
}

/// Squared residual of one flight's forces and torques, each in units of its measured size.
fn motion_cost(problem: &Problem, at: usize) -> f64 {
    let declared = problem.model.parameters.baseline();
    let Some(flight) = problem.flights().nth(at) else { return 0.0 };
    let residual = problem.model.residual_under(flight, &declared);
    let measured = &problem.model.tracks(flight, &declared).rows;
    let of_motion = |equation: &Equation| !matches!(equation, Equation::RotorSpeed(_) | Equation::Gyroscope);
    let mut sum = 0.0;
    for equation in flight.layout.equations.iter().filter(|equation| of_motion(equation)) {
        for axis in 0..equation.size() {
            let power = |rows: &[f64]| -> f64 {
                column(flight, rows, *equation, axis).iter().map(|row| row * row).sum()
            };
            sum += power(&residual) / power(measured).max(1e-12);
        }
    }
    sum
}

/// Fault of a flight with rotor speeds and without commands: a sensor that reads half or twice of the others. No
/// rotor carries its share of the weight at such a speed.
pub fn among_each_other(flight: &Prepared) -> Option<Fault> {
    let channel = &flight.flight.rotor_speed;
    if channel.is_empty() || !flight.flight.command.is_empty() {
        return None;
    }
    let clock = &flight.layout.clock;
    let (first_s, last_s) = (clock.at(*flight.layout.knots.first()?), clock.at(*flight.layout.knots.last()?));
    let in_flight = || {
        let pairs = channel.time_s.iter().zip(&channel.values);
        pairs.filter(|(time_s, _)| (first_s..=last_s).contains(time_s)).map(|(_, speeds)| speeds)
    };
    let count = in_flight().count().max(1) as f64;
    let mean = |rotor: usize| in_flight().map(|speeds| speeds[rotor]).sum::<f64>() / count;
    let rotors = flight.flight.rotors;
    (0..rotors).find_map(|rotor| {
        let others = middle((0..rotors).filter(|other| *other != rotor).map(mean))?;
        is_off_scale(mean(rotor) / others).then(|| Fault {
            flight: flight.flight.name.clone(),
            channel: format!("rotor_speed.{}", rotor + 1),
            kind: "scaled-sensor",
            expected: format!("about {others:.0} rad/s in the mean, as the other rotors"),
            found: format!("{:.0} rad/s", mean(rotor)),
            consequence: Part::RotorSpeed.consequence(),
            advice: SENSOR,
        })
    })
}
