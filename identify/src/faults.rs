//! Sensors of rotor speed that do not tell the truth, and motors that do not turn as they are told.
//!
//! A measured speed that disagrees with its command is either wrong or a rotor that really turns so. The vehicle's own
//! motion decides: whichever of the two speeds explains the measured forces and torques better is believed.

use crate::fit::Problem;
use crate::prepared::{Equation, Prepared};
use crate::rows::column;
use crate::statistics::deviation;
use serde::Serialize;

/// A speed whose spread is below this part of the expected is stuck.
const STUCK: f64 = 0.05;
/// A ratio of measured to expected speed further than this from the other rotors' is no tolerance of a motor.
const RATIO: f64 = 0.15;

/// Something that is broken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Fault {
    /// The channel, with the rotor counted from 1.
    pub channel: String,
    /// `stuck-sensor`, `scaled-sensor` or `rotor-off-command`.
    pub kind: &'static str,
    /// The finding as text, with numbers.
    pub finding: String,
    /// What was done about it.
    pub consequence: &'static str,
}

/// Looks for faults of the rotors, and has the problem distrust the sensors that have one.
pub fn find(problem: &mut Problem) -> Vec<Fault> {
    let mut faults = Vec::new();
    for rotor in 0..4 {
        let Some(suspicion) = suspicion(problem, rotor) else { continue };
        let trusting = motion_cost(problem);
        distrust(problem, rotor, true);
        let distrusting = motion_cost(problem);
        let is_sensor = distrusting < trusting;
        distrust(problem, rotor, is_sensor);
        let channel = format!("rotor_speed.{}", rotor + 1);
        let evidence = format!(
            "{}; the measured motion is {} explained by the commanded speed (squared residual {:.3} of that with the \
             measured one)",
            suspicion.finding,
            if is_sensor { "better" } else { "worse" },
            distrusting / trusting
        );
        faults.push(if is_sensor {
            let consequence = "the sensor is not used; the speed follows from the command";
            Fault { channel, kind: suspicion.kind, finding: evidence, consequence }
        } else {
            let consequence = "the measured speed is used: the rotor does turn so";
            Fault { channel, kind: "rotor-off-command", finding: evidence, consequence }
        });
    }
    faults
}

struct Suspicion {
    kind: &'static str,
    finding: String,
}

fn suspicion(problem: &Problem, rotor: usize) -> Option<Suspicion> {
    let pairs = speeds(problem)?;
    let of = |rotor: usize| -> (Vec<f64>, Vec<f64>) {
        pairs.iter().map(|pair| (pair.0[rotor], pair.1[rotor])).unzip()
    };
    let (measured, expected) = of(rotor);
    let (spread, wanted) = (deviation(&measured), deviation(&expected));
    if spread < STUCK * wanted {
        let finding = format!("it spreads by {spread:.2} rad/s where its command asks for {wanted:.2} rad/s");
        return Some(Suspicion { kind: "stuck-sensor", finding });
    }
    let total = |speeds: Vec<f64>| speeds.iter().sum::<f64>();
    let ratio = |rotor: usize| total(of(rotor).0) / total(of(rotor).1);
    let mut others: Vec<f64> = (0..4).filter(|other| *other != rotor).map(ratio).collect();
    others.sort_by(f64::total_cmp);
    let ratio_here = ratio(rotor);
    ((ratio_here / others[1] - 1.0).abs() > RATIO).then(|| Suspicion {
        kind: "scaled-sensor",
        finding: format!(
            "it reads {ratio_here:.3} of the commanded speed, the other rotors {:.3}",
            others[1]
        ),
    })
}

/// Measured and expected speeds of all rotors at all knots of all flights; `None` where no flight has both.
fn speeds(problem: &Problem) -> Option<Vec<([f64; 4], [f64; 4])>> {
    let declared = problem.model.parameters.baseline();
    let mut pairs = Vec::new();
    for flight in problem.flights() {
        let Some(offset) = flight.offset_of(Equation::RotorSpeed) else { continue };
        let rows = problem.model.tracks(flight, &declared).rows;
        let rotors = problem.model.rotors(flight, &declared);
        for (at, knot) in flight.layout.knots.iter().enumerate() {
            let first = at * flight.width() + offset;
            pairs.push((std::array::from_fn(|i| rows[first + i]), rotors.commanded[*knot]));
        }
    }
    (!pairs.is_empty()).then_some(pairs)
}

fn distrust(problem: &mut Problem, rotor: usize, is_distrusted: bool) {
    for flight in problem.estimation.iter_mut().chain(&mut problem.validation) {
        flight.distrusted[rotor] = is_distrusted;
    }
}

/// Squared residual of forces and torques, each in units of its measured size.
fn motion_cost(problem: &Problem) -> f64 {
    let declared = problem.model.parameters.baseline();
    problem.estimation.iter().map(|flight| flight_cost(problem, flight, &declared)).sum()
}

fn flight_cost(problem: &Problem, flight: &Prepared, declared: &[f64]) -> f64 {
    let residual = problem.model.residual_under(flight, declared);
    let measured = problem.model.tracks(flight, declared).rows;
    let of_motion = |equation: &Equation| !matches!(equation, Equation::RotorSpeed | Equation::Gyroscope);
    let mut sum = 0.0;
    for equation in flight.layout.equations.iter().filter(|equation| of_motion(equation)) {
        for axis in 0..equation.size() {
            let power = |rows: &[f64]| -> f64 {
                column(flight, rows, *equation, axis).iter().map(|row| row * row).sum()
            };
            sum += power(&residual) / power(&measured).max(1e-12);
        }
    }
    sum
}
