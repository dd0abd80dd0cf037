//! Thrust and torque coefficients from the motion of the flights, with intervals and held-out errors.

use std::f64::consts::PI;

use flights::{Flight, Role};
use serde::Serialize;
use vehicles::{Uncertainty, Vehicle};

use super::blocks::Blocks;
use super::equations::{ACCELERATION, AIR_TERMS, Equations, FORCE_Z, working};
use super::figure::{Figure, HeldOut, rms};
use super::least_squares::{self, Prior, Rows, Solution, Weighting};
use super::speed_noise::{self, Corrected};
use crate::data::prepared::Propulsion;
use crate::numbers::statistics::{Estimate, mean};
use crate::rotor::score::LEVEL;
use crate::rotor::statics::AIR_KG_M3;

/// Bias of an accelerometer along one axis, in m/s^2: 20 mg, the typical zero-g offset of a BMI088 (Bosch Sensortec,
/// BST-BMI088-DS001, table 2).
const BIAS_SIGMA_M_S2: f64 = 0.2;
/// A coefficient is within so many times the declared one.
const LARGER_MAX: f64 = 3.0;

/// A bias of an accelerometer that is worth telling, in m/s^2.
const BIAS_TOLD_M_S2: f64 = 0.05;
/// Hubs that are nearer to each other lie above each other, in m.
const COAXIAL_M: f64 = 0.01;
const HIDDEN: &str =
    "the noise of the rotor speeds is most of what would tell it; log them faster, or fly more yaw";

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
    /// The same with the noise of their rotor speeds twice.
    noisy: Vec<Equations<'f>>,
    /// Bias of the accelerometer along z of each flight in m/s^2, where the motion determines it.
    biases: Vec<Option<Estimate>>,
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
    let noisy: Vec<Flight> = flights.iter().map(speed_noise::disturbed).collect();
    let mut findings = Vec::new();
    let set = Set::of(flights, &noisy, vehicle, &mut findings)?;
    let (thrust, (torque, rotor_inertia_per_inertia)) = (set.thrust(), set.torque(&mut findings));
    findings.extend(set.findings());
    Ok(FlownCoefficients { thrust, torque, rotor_inertia_per_inertia, findings })
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

    /// A thrust is told by its mean, against which slow disturbances are small. About z the mean is none, and a
    /// controller answers slow disturbances.
    fn weighting(self) -> Weighting {
        if self == Kind::Thrust { Weighting::Plain } else { Weighting::Whitened }
    }

    fn missing(self) -> &'static str {
        if self == Kind::Thrust {
            "neither `specific_force` nor `position` or `velocity` with `attitude` is logged for long enough"
        } else {
            "neither `angular_velocity` nor `attitude` is logged for long enough"
        }
    }
}

impl<'f> Set<'f> {
    fn of(
        flights: &'f [Flight],
        noisy: &'f [Flight],
        vehicle: &'f Vehicle,
        findings: &mut Vec<String>,
    ) -> Result<Self, String> {
        let propulsion = Propulsion::of(vehicle);
        let (mut usable, mut twice) = (Vec::new(), Vec::new());
        for (flight, noisy) in flights.iter().zip(noisy) {
            match (Equations::of(flight, &propulsion), Equations::of(noisy, &propulsion)) {
                (Ok(equations), Ok(noisy)) => {
                    usable.push(equations);
                    twice.push(noisy);
                }
                (Err(reason), _) | (_, Err(reason)) => {
                    findings.push(format!("flight `{}` is not used for forces: {reason}", flight.name));
                }
            }
        }
        let of_fit = || usable.iter().filter(|flight| flight.flight.role == Role::Fit);
        if of_fit().next().is_none() {
            let reasons = findings.join("; ");
            let about = if reasons.is_empty() { String::new() } else { format!(" ({reasons})") };
            return Err(format!(
                "no flight with role \"fit\" has rotor speeds and motion{about}: coefficients are left out"
            ));
        }
        let compared_s = of_fit().map(Equations::compared_s).sum();
        let ends_s: Vec<f64> = usable.iter().map(Equations::end_s).collect();
        let blocks = Blocks::of(compared_s, &ends_s);
        let bias = |(number, flight): (usize, &Equations)| {
            let rows = flight.accelerometer_bias(vehicle.gravity_m_s2, &blocks, number)?;
            let solution = least_squares::solved(&[rows], &[], Weighting::Plain)?;
            Some(solution.estimate(|values| values[0]))
        };
        let biases = usable.iter().enumerate().map(bias).collect();
        Ok(Self { flights: usable, noisy: twice, biases, blocks, vehicle })
    }

    fn of_role(&self, role: Role) -> impl Iterator<Item = (usize, &Equations<'f>)> {
        self.flights.iter().enumerate().filter(move |(_, flight)| flight.flight.role == role)
    }

    /// Rows of the forces of the flights with a role, known biases taken off and `late` of their standard errors more.
    fn force_rows(&self, role: Role, is_each: bool, late: f64) -> Vec<Rows> {
        let of_flight = |(number, flight): (usize, &Equations)| {
            let mut rows = flight.forces(self.vehicle, number, &self.blocks, is_each);
            if let Some(bias) = self.biases[number] {
                for rows in rows.iter_mut().filter(|rows| rows.component == FORCE_Z) {
                    rows.values.iter_mut().for_each(|value| *value -= bias.value + late * bias.sigma);
                    // A known bias is no parameter.
                    rows.columns
                        .iter_mut()
                        .skip(rows_bias(is_each, self.vehicle))
                        .for_each(|column| column.fill(0.0));
                }
            }
            rows
        };
        self.of_role(role).flat_map(of_flight).collect()
    }

    /// Rows of the torques about z of the flights with a role, of which each has a trim of its own.
    fn torque_rows(&self, of: &[Equations], role: Role, is_each: bool) -> Vec<Rows> {
        let flights: Vec<(usize, &Equations)> =
            of.iter().enumerate().filter(|(_, flight)| flight.flight.role == role).collect();
        let trims = flights.len();
        let of_flight = |(trim, (number, flight)): (usize, &(usize, &Equations))| {
            flight.torques(self.vehicle, *number, &self.blocks, is_each, (trim, trims))
        };
        flights.iter().enumerate().filter_map(of_flight).collect()
    }

    fn force_solution(&self, is_each: bool) -> Option<Solution> {
        let priors = priors(is_each, self.vehicle);
        // Rotors are told apart by differences of their speeds, whose mean tells little, and which a controller sets.
        let weighting = if is_each { Weighting::Whitened } else { Kind::Thrust.weighting() };
        let solved =
            |late: f64| least_squares::solved(&self.force_rows(Role::Fit, is_each, late), &priors, weighting);
        let (mut solution, shifted) = (solved(0.0)?, solved(1.0)?);
        let change = shifted.values.iter().zip(&solution.values).map(|(shifted, value)| shifted - value);
        let change = change.collect();
        solution.by_prior.push(change);
        Some(solution)
    }

    fn thrust(&self) -> FlownCoefficient {
        let estimates = |solution: Option<Solution>, count: usize| -> Vec<Option<Estimate>> {
            let of = |at: usize| Some(solution.as_ref()?.estimate(|values| values[at]));
            (0..count).map(of).collect()
        };
        let common = estimates(self.force_solution(false), 1).swap_remove(0);
        let each = estimates(self.force_solution(true), working(self.vehicle).len());
        let rows = |role| self.force_rows(role, false, 0.0);
        let held_out = self.held_out(Kind::Thrust, &rows(Role::Fit), &rows(Role::Test));
        self.coefficient(Kind::Thrust, common, &each, held_out)
    }

    /// The torque coefficient, and the inertia of a rotor by that of the vehicle.
    fn torque(&self, findings: &mut Vec<String>) -> (FlownCoefficient, Figure) {
        let wide = |is_each: bool| {
            Wide::of(
                &self.torque_rows(&self.flights, Role::Fit, is_each),
                &self.torque_rows(&self.noisy, Role::Fit, is_each),
            )
        };
        let (common, each) = (wide(false), wide(true));
        let hidden = |at: usize| common.as_ref().is_some_and(|wide| wide.hides(at));
        let of = |wide: &Option<Wide>, at: usize| wide.as_ref().map(|wide| wide.estimate(at));
        let of_each: Vec<_> = (0..working(self.vehicle).len()).map(|at| of(&each, at)).collect();
        let rows = |role| self.torque_rows(&self.flights, role, false);
        let held_out = self.held_out(Kind::Torque, &rows(Role::Fit), &rows(Role::Test));
        let mut torque = self.coefficient(Kind::Torque, of(&common, 0), &of_each, held_out);
        let noise = |at| hidden(at).then(|| HIDDEN.to_owned());
        let weak = noise(0).or_else(|| self.weaker_than_ideal(&torque.coefficient));
        findings.extend(weak.iter().map(|reason| format!("c_Q: {reason}")));
        for figure in [&mut torque.specific, &mut torque.coefficient] {
            *figure = figure.clone().doubted(weak.clone());
        }
        let inertia = of(&common, 1).map_or_else(
            || Figure::missing("1", Kind::Torque.missing()),
            |estimate| {
                Figure::within("1", estimate, (0.0, 1.0)).doubted(holds_zero(&estimate)).doubted(noise(1))
            },
        );
        (torque, inertia)
    }

    /// Reason to doubt a torque that is less than an ideal rotor of the declared thrust takes: power for the thrust alone is
    /// T^(3/2) / sqrt(2 rho A) (momentum theory; Leishman, Principles of Helicopter Aerodynamics, 2nd ed., eq. 2.14). No rotor
    /// reaches beyond the hub next to it.
    fn weaker_than_ideal(&self, found: &Figure) -> Option<String> {
        let torque = found.determined()?;
        let radius_m = nearest_hubs_m(self.vehicle)?;
        let area_m2 = PI * radius_m * radius_m;
        let ideal = libm::pow(self.vehicle.thrust_coefficient, 1.5) / (2.0 * AIR_KG_M3 * area_m2).sqrt();
        (torque.high < ideal).then(|| {
            format!(
                "an ideal rotor that fits between the hubs takes {ideal:.2e} N*m/(rad/s)^2 for the declared thrust: the controller \
                 cancels what the air does about z, which hides the torque"
            )
        })
    }

    fn coefficient(
        &self,
        kind: Kind,
        common: Option<Estimate>,
        each: &[Option<Estimate>],
        held_out: Vec<HeldOut>,
    ) -> FlownCoefficient {
        let (scale, uncertain) = kind.scale(self.vehicle);
        let most = LARGER_MAX * kind.declared(self.vehicle);
        let scaled = |Estimate { value, sigma, low, high }: Estimate| {
            Estimate { value: scale * value, sigma: scale * sigma, low: scale * low, high: scale * high }
                .with_error(scale * value.abs() * uncertain, LEVEL)
        };
        let figure = |estimate: Option<Estimate>, unit, most: f64| {
            let known = |estimate: Estimate| {
                Figure::within(unit, estimate, (0.0, most)).doubted(holds_zero(&estimate))
            };
            estimate.map_or_else(|| Figure::missing(unit, kind.missing()), known)
        };
        let of_rotor = |(estimate, rotor): (&Option<Estimate>, usize)| {
            let name = self.vehicle.rotors[rotor].name.clone();
            (name, figure(estimate.map(scaled), kind.unit(), scale * most))
        };
        FlownCoefficient {
            specific: figure(common, kind.specific_unit(), most),
            coefficient: figure(common.map(scaled), kind.unit(), scale * most),
            rotors: each.iter().zip(working(self.vehicle)).map(of_rotor).collect(),
            held_out,
        }
    }

    /// Errors on the test flights with the declared and with the fitted coefficient. What else the equations hold, such as
    /// drag and bias, is fitted beside each of the two on the flights with role `fit`.
    fn held_out(&self, kind: Kind, fit: &[Rows], test: &[Rows]) -> Vec<HeldOut> {
        let priors = if kind == Kind::Thrust { priors(false, self.vehicle) } else { Vec::new() };
        let solved = || {
            let fitted = least_squares::solved(fit, &priors, kind.weighting())?.values;
            Some((fitted, with_coefficient(fit, kind.declared(self.vehicle), &priors, kind.weighting())?))
        };
        let Some((fitted, declared)) = solved() else { return Vec::new() };
        let of_flight = |(number, flight): (usize, &Equations)| {
            let (first, last) =
                (self.blocks.of_time(number, 0.0), self.blocks.of_time(number, flight.end_s()));
            let is_its =
                |rows: &&Rows| rows.blocks.first().is_some_and(|block| (first..=last).contains(block));
            let rows: Vec<&Rows> = test.iter().filter(is_its).collect();
            let (rows, quantity, unit) = compared(kind, &rows)?;
            let error = |values: &[f64]| rms(&free_of_trim(kind, rows, values));
            let name = flight.flight.name.clone();
            Some(HeldOut { flight: name, quantity, unit, declared: error(&declared), fitted: error(&fitted) })
        };
        self.of_role(Role::Test).filter_map(of_flight).collect()
    }

    fn findings(&self) -> Vec<String> {
        let names = |is_named: &dyn Fn(usize, &Equations) -> bool| {
            let named = self.flights.iter().enumerate().filter(|(number, flight)| is_named(*number, flight));
            let names: Vec<&str> = named.map(|(_, flight)| flight.flight.name.as_str()).collect();
            names.join(", ")
        };
        let still = names(&|_, flight| !flight.has_velocity());
        let blind = names(&|number, flight| {
            self.biases[number].is_none() && !flight.flight.specific_force.is_empty()
        });
        let drag = (!still.is_empty()).then(|| {
            format!(
                "{still}: no velocity is known, so that thrust includes what the air adds at speed; log `position` and `attitude`"
            )
        });
        let bias = (!blind.is_empty()).then(|| {
            format!(
                "{blind}: nothing tells the bias of the accelerometer, which is taken as {BIAS_SIGMA_M_S2} m/s^2 (one standard deviation)"
            )
        });
        let known = self.biases.iter().flatten().map(|bias| bias.value.abs()).reduce(f64::max);
        let off = known.filter(|most| *most > BIAS_TOLD_M_S2).map(|most| {
            format!("the accelerometer reads up to {most:.3} m/s^2 along z beyond the motion, which is taken off flight by flight")
        });
        drag.into_iter().chain(bias).chain(off).collect()
    }
}

/// A solution without and one with the noise of the rotor speeds taken off. The truth lies between them, as the noise is
/// known up to an upper bound.
struct Wide {
    plain: Solution,
    corrected: Option<Corrected>,
}

impl Wide {
    fn of(rows: &[Rows], noisy: &[Rows]) -> Option<Self> {
        let plain = least_squares::solved(rows, &[], Weighting::Whitened)?;
        Some(Self { plain, corrected: speed_noise::corrected(rows, noisy, &[]) })
    }

    fn hides(&self, parameter: usize) -> bool {
        self.corrected.as_ref().is_some_and(|corrected| corrected.hides(parameter))
    }

    /// The estimate without the correction, in an interval that holds those of both.
    fn estimate(&self, parameter: usize) -> Estimate {
        let of = |solution: &Solution| solution.estimate(|values| values[parameter]);
        let plain = of(&self.plain);
        match &self.corrected {
            Some(corrected) if !corrected.hides(parameter) => {
                let other = of(&corrected.solution);
                Estimate { low: plain.low.min(other.low), high: plain.high.max(other.high), ..plain }
            }
            _ => plain,
        }
    }
}

/// Knowledge that the rows do not hold: the accelerometer's bias is small.
fn priors(is_each: bool, vehicle: &Vehicle) -> Vec<Prior> {
    vec![Prior { parameter: rows_bias(is_each, vehicle), sigma: BIAS_SIGMA_M_S2 }]
}

/// Number of the parameter that is the accelerometer's bias.
fn rows_bias(is_each: bool, vehicle: &Vehicle) -> usize {
    AIR_TERMS + if is_each { working(vehicle).len() } else { 1 }
}

/// Reason to doubt a quantity that is above 0.
fn holds_zero(estimate: &Estimate) -> Option<String> {
    let is_negative = estimate.high < 0.0;
    let negative = "it is negative: check the order of the rotors and their spins in the vehicle file";
    (estimate.low <= 0.0).then(|| if is_negative { negative } else { "its interval holds 0" }.to_owned())
}

/// Least distance of two hubs that do not lie above each other, in m.
fn nearest_hubs_m(vehicle: &Vehicle) -> Option<f64> {
    let places = || vehicle.rotors.iter().map(|rotor| rotor.position_m.xy());
    let distances = places().enumerate().flat_map(|(number, place)| {
        places().skip(number + 1).map(move |other| (other - place).norm()).collect::<Vec<f64>>()
    });
    distances.filter(|distance_m| *distance_m > COAXIAL_M).reduce(f64::min)
}

/// The parameters with the first one held at `coefficient`.
fn with_coefficient(
    rows: &[Rows],
    coefficient: f64,
    priors: &[Prior],
    weighting: Weighting,
) -> Option<Vec<f64>> {
    let held = |rows: &Rows| {
        let (first, others) = rows.columns.split_first()?;
        let values =
            rows.values.iter().zip(first).map(|(value, entry)| value - coefficient * entry).collect();
        Some(Rows { values, columns: others.to_vec(), ..rows.clone() })
    };
    let rows: Vec<Rows> = rows.iter().filter_map(held).collect();
    let priors: Vec<Prior> =
        priors.iter().map(|prior| Prior { parameter: prior.parameter - 1, ..*prior }).collect();
    let solution = least_squares::solved(&rows, &priors, weighting)?;
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
