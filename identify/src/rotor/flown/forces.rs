//! Thrust and torque coefficients from the motion of the flights, with intervals and held-out errors.

use flights::{Flight, Role};
use serde::Serialize;
use vehicles::{Uncertainty, Vehicle};

use super::blocks::Blocks;
use super::equations::{ACCELERATION, AIR_TERMS, Equations, FORCE_Z, working};
use super::figure::{Figure, HeldOut, rms};
use super::least_squares::{self, Prior, Rows, Solution};
use crate::prepared::Propulsion;
use crate::rotor::score::LEVEL;
use crate::statistics::{Estimate, mean};

/// Bias of an accelerometer along one axis, in m/s^2: 20 mg, the typical zero-g offset of a BMI088 (Bosch Sensortec,
/// BST-BMI088-DS001, table 2).
const BIAS_SIGMA_M_S2: f64 = 0.2;
/// A coefficient is within so many times the declared one.
const LARGER_MAX: f64 = 3.0;

/// Coefficients as the flights show them.
#[derive(Debug, Clone, Serialize)]
pub struct FlownCoefficients {
    /// Thrust.
    pub thrust: FlownCoefficient,
    /// Torque.
    pub torque: FlownCoefficient,
    /// Moment of inertia of a rotor by that of the vehicle about z.
    pub rotor_inertia_per_inertia: Figure,
    /// Faults of the data, and data that were left out.
    pub findings: Vec<String>,
}

/// A coefficient.
#[derive(Debug, Clone, Serialize)]
pub struct FlownCoefficient {
    /// Coefficient by the mass, or by the moment of inertia about z: this is what the flights determine.
    pub specific: Figure,
    /// The coefficient itself, with the mass or the moment of inertia of the vehicle file.
    pub coefficient: Figure,
    /// The coefficient of each rotor alone, by name.
    pub rotors: Vec<(String, Figure)>,
    /// Errors on each test flight.
    pub held_out: Vec<HeldOut>,
}

/// The flights that can be compared.
struct Set<'f> {
    flights: Vec<Equations<'f>>,
    blocks: Blocks,
    vehicle: &'f Vehicle,
}

/// A kind of coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Thrust,
    Torque,
}

/// Fits the coefficients to `flights`, which have rotor speeds and no commands.
///
/// # Errors
/// The reason why there is nothing to fit.
pub fn fitted(flights: &[Flight], vehicle: &Vehicle) -> Result<FlownCoefficients, String> {
    let propulsion = Propulsion::of(vehicle);
    let (mut usable, mut findings) = (Vec::new(), Vec::new());
    for flight in flights {
        match Equations::of(flight, &propulsion) {
            Ok(equations) => usable.push(equations),
            Err(reason) => {
                findings.push(format!("flight `{}` is not used for forces: {reason}", flight.name))
            }
        }
    }
    if !usable.iter().any(|flight| flight.flight.role == Role::Fit) {
        let reasons = if findings.is_empty() { String::new() } else { format!(": {}", findings.join("; ")) };
        return Err(format!(
            "no flight with role \"fit\" has rotor speeds and motion{reasons}: coefficients are left out"
        ));
    }
    let compared_s =
        usable.iter().filter(|flight| flight.flight.role == Role::Fit).map(Equations::compared_s).sum();
    let ends_s: Vec<f64> = usable.iter().map(Equations::end_s).collect();
    let set = Set { flights: usable, blocks: Blocks::of(compared_s, &ends_s), vehicle };
    findings.extend(set.findings());
    let (thrust, torque) = (set.coefficient(Kind::Thrust), set.coefficient(Kind::Torque));
    Ok(FlownCoefficients { thrust, torque, rotor_inertia_per_inertia: set.rotor_inertia(), findings })
}

impl Kind {
    fn unit(self) -> &'static str {
        if self == Kind::Thrust { "N/(rad/s)^2" } else { "N*m/(rad/s)^2" }
    }

    fn specific_unit(self) -> &'static str {
        if self == Kind::Thrust { "N/(rad/s)^2/kg" } else { "N*m/(rad/s)^2/(kg*m^2)" }
    }

    /// Mass or moment of inertia, and its relative standard deviation.
    fn scale(self, vehicle: &Vehicle) -> (f64, f64) {
        let (value, key) = match self {
            Kind::Thrust => (vehicle.mass_kg, "body.mass"),
            Kind::Torque => (vehicle.inertia_kg_m2[(2, 2)], "body.inertia_zz"),
        };
        let known = vehicle.provenance.iter().find(|known| known.key == key);
        let sigma = known.map_or(0.0, |known| match known.uncertainty {
            Uncertainty::OneSigma(sigma) => sigma / value,
            Uncertainty::Said(_) => 0.0,
        });
        (value, sigma)
    }

    /// The declared coefficient by the mass or the moment of inertia.
    fn declared(self, vehicle: &Vehicle) -> f64 {
        let coefficient =
            if self == Kind::Thrust { vehicle.thrust_coefficient } else { vehicle.torque_coefficient };
        coefficient / self.scale(vehicle).0
    }

    fn missing(self) -> &'static str {
        if self == Kind::Thrust {
            "neither `specific_force` nor `position` or `velocity` with `attitude` is logged for long enough"
        } else {
            "neither `angular_velocity` nor `attitude` is logged for long enough"
        }
    }
}

impl Set<'_> {
    fn of_role(&self, role: Role) -> impl Iterator<Item = (usize, &Equations<'_>)> {
        self.flights.iter().enumerate().filter(move |(_, flight)| flight.flight.role == role)
    }

    /// Rows of the flights with a role.
    fn rows(&self, kind: Kind, role: Role, is_each: bool) -> Vec<Rows> {
        let flights: Vec<_> = self.of_role(role).collect();
        let trims = flights.len();
        let of_flight = |(trim, (number, flight)): (usize, &(usize, &Equations))| match kind {
            Kind::Thrust => flight.forces(self.vehicle, *number, &self.blocks, is_each),
            Kind::Torque => {
                let rows = flight.torques(self.vehicle, *number, &self.blocks, is_each, (trim, trims));
                rows.into_iter().collect()
            }
        };
        flights.iter().enumerate().flat_map(of_flight).collect()
    }

    /// Knowledge that the rows do not hold: the accelerometer's bias is small.
    fn priors(kind: Kind, coefficients: usize) -> Vec<Prior> {
        let bias = Prior { parameter: coefficients + AIR_TERMS, sigma: BIAS_SIGMA_M_S2 };
        if kind == Kind::Thrust { vec![bias] } else { Vec::new() }
    }

    fn solution(&self, kind: Kind, is_each: bool) -> Option<Solution> {
        let coefficients = if is_each { working(self.vehicle).len() } else { 1 };
        least_squares::solved(&self.rows(kind, Role::Fit, is_each), &Self::priors(kind, coefficients))
    }

    fn coefficient(&self, kind: Kind) -> FlownCoefficient {
        let (scale, uncertain) = kind.scale(self.vehicle);
        let most = LARGER_MAX * kind.declared(self.vehicle);
        let scaled = |estimate: Estimate| {
            let Estimate { value, sigma, low, high } = estimate;
            let scaled =
                Estimate { value: scale * value, sigma: scale * sigma, low: scale * low, high: scale * high };
            scaled.with_error(scale * value.abs() * uncertain, LEVEL)
        };
        let figure = |estimate: Estimate, unit, most: f64| {
            let is_none = estimate.low <= 0.0;
            Figure::within(unit, estimate, (0.0, most))
                .doubted(is_none.then(|| "its interval holds 0".to_owned()))
        };
        let (specific, coefficient) = match self.solution(kind, false) {
            None => (
                Figure::missing(kind.specific_unit(), kind.missing()),
                Figure::missing(kind.unit(), kind.missing()),
            ),
            Some(solution) => {
                let estimate = solution.estimate(|values| values[0]);
                (
                    figure(estimate, kind.specific_unit(), most),
                    figure(scaled(estimate), kind.unit(), scale * most),
                )
            }
        };
        let each = self.solution(kind, true);
        let of_rotor = |(at, rotor): (usize, usize)| {
            let estimate = each.as_ref().map(|solution| scaled(solution.estimate(|values| values[at])));
            let name = self.vehicle.rotors[rotor].name.clone();
            let missing = || Figure::missing(kind.unit(), kind.missing());
            (name, estimate.map_or_else(missing, |estimate| figure(estimate, kind.unit(), scale * most)))
        };
        let rotors = working(self.vehicle).into_iter().enumerate().map(of_rotor).collect();
        FlownCoefficient { specific, coefficient, rotors, held_out: self.held_out(kind) }
    }

    /// Errors on the test flights with the declared and with the fitted coefficient. What else the equations hold, such as
    /// drag and bias, is fitted beside each of the two on the flights with role `fit`.
    fn held_out(&self, kind: Kind) -> Vec<HeldOut> {
        let fit = self.rows(kind, Role::Fit, false);
        let test = self.rows(kind, Role::Test, false);
        let Some(fitted) = least_squares::solved(&fit, &Self::priors(kind, 1)) else { return Vec::new() };
        let Some(declared) = with_coefficient(&fit, kind.declared(self.vehicle), &Self::priors(kind, 1))
        else {
            return Vec::new();
        };
        let of_flight = |(number, flight): (usize, &Equations)| {
            let first = self.blocks.of_time(number, 0.0);
            let next = self.blocks.of_time(number, flight.end_s());
            let of_flight =
                |rows: &&Rows| rows.blocks.first().is_some_and(|block| (first..=next).contains(block));
            let rows: Vec<&Rows> = test.iter().filter(of_flight).collect();
            let (rows, quantity, unit) = compared(kind, &rows)?;
            let error = |values: &[f64]| rms(&free_of_trim(kind, rows, values));
            let name = flight.flight.name.clone();
            Some(HeldOut {
                flight: name,
                quantity,
                unit,
                declared: error(&declared),
                fitted: error(&fitted.values),
            })
        };
        self.of_role(Role::Test).filter_map(of_flight).collect()
    }

    fn rotor_inertia(&self) -> Figure {
        let unit = "1";
        match self.solution(Kind::Torque, false) {
            None => Figure::missing(unit, Kind::Torque.missing()),
            Some(solution) => {
                let estimate = solution.estimate(|values| values[1]);
                let holds_none = (estimate.low <= 0.0).then(|| "its interval holds 0".to_owned());
                Figure::within(unit, estimate, (0.0, 1.0)).doubted(holds_none)
            }
        }
    }

    fn findings(&self) -> Vec<String> {
        let without: Vec<&str> = self
            .flights
            .iter()
            .filter(|flight| !flight.has_velocity())
            .map(|flight| flight.flight.name.as_str())
            .collect();
        let drag = (!without.is_empty()).then(|| {
            format!(
                "{}: no velocity is known, so that thrust includes what the air adds at speed; log `position` and `attitude`",
                without.join(", ")
            )
        });
        drag.into_iter().collect()
    }
}

/// The parameters with the first one held at `coefficient`.
fn with_coefficient(rows: &[Rows], coefficient: f64, priors: &[Prior]) -> Option<Vec<f64>> {
    let held = |rows: &Rows| {
        let (first, others) = rows.columns.split_first()?;
        let values =
            rows.values.iter().zip(first).map(|(value, entry)| value - coefficient * entry).collect();
        Some(Rows { values, columns: others.to_vec(), ..rows.clone() })
    };
    let rows: Vec<Rows> = rows.iter().filter_map(held).collect();
    let priors: Vec<Prior> =
        priors.iter().map(|prior| Prior { parameter: prior.parameter - 1, ..*prior }).collect();
    let solution = least_squares::solved(&rows, &priors)?;
    Some(std::iter::once(coefficient).chain(solution.values).collect())
}

/// The component of a flight that held-out errors are told of.
fn compared<'r>(kind: Kind, rows: &[&'r Rows]) -> Option<(&'r Rows, &'static str, &'static str)> {
    let of = |component: usize| rows.iter().find(|rows| rows.component == component).copied();
    match kind {
        Kind::Torque => of(0).map(|rows| (rows, "angular acceleration about z", "rad/s^2")),
        Kind::Thrust => of(FORCE_Z)
            .map(|rows| (rows, "specific force along z", "m/s^2"))
            .or_else(|| of(ACCELERATION + 2).map(|rows| (rows, "vertical acceleration", "m/s^2"))),
    }
}

/// The residual of a flight; of torques less its mean, which is the flight's own trim.
fn free_of_trim(kind: Kind, rows: &Rows, values: &[f64]) -> Vec<f64> {
    if kind == Kind::Thrust {
        return rows.residual(values);
    }
    // The trims of other flights are not those of this one.
    let shared = &values[..3.min(values.len())];
    let mut residual = rows.residual(shared);
    let trim = mean(&residual);
    residual.iter_mut().for_each(|value| *value -= trim);
    residual
}
