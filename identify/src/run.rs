//! The whole way: from flights and the declared vehicle to a report.

use crate::data::clock::Lateness;
use crate::data::fault::Fault;
use crate::data::logged_voltage::LoggedVoltage;
use crate::data::parts;
use crate::data::prepared::{BOX_STEPS, Equation, Layout, Prepared, Propulsion, block_s, box_s};
use crate::data::rig;
use crate::data::rows::column;
use crate::data::sensing::SensorErrors;
use crate::error::{faulty, no_flight};
use crate::model::noise;
use crate::model::parameter::Parameters;
use crate::model::physics::Model;
use crate::model::problem::Problem;
use crate::model::whitening::Noises;
use crate::report::effect_reports;
use crate::report::envelope;
use crate::report::horizons::{of_role, predictions};
use crate::report::limits::limits;
use crate::report::loss::losses;
use crate::report::misfit::misfits;
use crate::report::regressor::{Regressor, regressors};
use crate::report::results::{
    BeforeAfter, Changes, EffectReport, FlightReport, FlightWind, Report, Unexplained,
};
use crate::report::trim;
use crate::report::whiteness::{Whiteness, whiteness};
use crate::report::wind_reports;
use crate::search::align::{Offsets, align};
use crate::search::at_limit::at_limits;
use crate::search::candidate::{Candidate, candidates};
use crate::search::confounded::rivals;
use crate::search::excerpt::{self, excerpt, on_all};
use crate::search::faults;
use crate::search::logging;
use crate::search::questions::OpenQuestions;
use crate::search::ratios::Ratios;
use crate::search::select::{Selection, select};
use flights::{Flight, FlightSet, Role};
use plant::effects::{Effect, entry};
use std::collections::BTreeMap;
use vehicles::Vehicle;
use vehicles::bearing::Bearing;

pub use crate::error::IdentifyError;
pub use crate::report::horizons::HORIZONS_S;

/// A residual is worth telling where its persistent part is beyond this part of its noise.
const UNEXPLAINED: f64 = 0.3;

/// Thrust of the commands over the weight by a correct vehicle file: batteries drain, and weights differ.
const BORNE: std::ops::RangeInclusive<f64> = 0.7..=1.4;

/// Greatest mean distance of samples of motion: beyond it they show nothing, and the computation of every tick
/// would cost more time and memory than the comparison is worth.
const SPACING_MAX_S: f64 = 0.5;

/// Results of an identification, with the data that their plots need.
#[derive(Debug)]
pub struct Outcome {
    /// The report.
    pub report: Report,
    /// The plant's effects of the new model, those that were declared included.
    pub effects: Vec<Effect>,
    /// Residuals for pictures: by flight and equation.
    pub pictures: Vec<Picture>,
    /// Regressors of each flight, by name: at the same instants as its pictures.
    pub regressors: BTreeMap<String, Vec<Regressor>>,
    /// Lateness that the alignment found in each flight, by name; to be removed from the flights before they
    /// are simulated again.
    pub late: BTreeMap<String, Lateness>,
    /// Accepted delays and biases of sensors, for the same.
    pub sensor_errors: SensorErrors,
    /// The flights without their faulty channels, and without what a rig makes meaningless; `None` if all is used.
    pub believed: Option<FlightSet>,
    /// Questions that a further flight may answer; `None` if none is open.
    pub questions: Option<OpenQuestions>,
}

/// The residuals of one equation of one flight, before and after, and the measured values.
#[derive(Debug)]
pub struct Picture {
    /// The flight.
    pub flight: String,
    /// Its role.
    pub role: Role,
    /// The equation.
    pub equation: Equation,
    /// Middles of the windows, in s.
    pub time_s: Vec<f64>,
    /// Measured values, by component.
    pub measured: Vec<Vec<f64>>,
    /// Residual of the declared model.
    pub before: Vec<Vec<f64>>,
    /// Residual of the new model.
    pub after: Vec<Vec<f64>>,
}

/// Identifies the effects that the flights of `set` show beyond their vehicle file; `progress` is told each step.
///
/// # Errors
/// If the vehicle file cannot be read, or no flight of a role can be used.
pub fn identify(set: &FlightSet, progress: &mut dyn FnMut(&str)) -> Result<Outcome, IdentifyError> {
    identify_until(set, progress, &|| false)
}

/// The same. The search ends early if `is_stopped` is true between two of its rounds: the report then has what was found so far, and
/// [`Report::stopped`] is true.
///
/// # Errors
/// As [`identify`].
pub fn identify_until(
    set: &FlightSet,
    progress: &mut dyn FnMut(&str),
    is_stopped: &dyn Fn() -> bool,
) -> Result<Outcome, IdentifyError> {
    let vehicle = Vehicle::load_from(&set.files, &set.vehicle)?;
    let declared = entry::resolve(&vehicle.effects)?;
    progress("preparing flights");
    let (mut faults, believed) = believed(&vehicle, &declared, set)?;
    let set = believed.as_ref().unwrap_or(set);
    let (problem, mut flight_reports, offsets) = aligned(&vehicle, &declared, set, &mut faults)?;
    let problem = problem.numbered();
    let all: Vec<&Prepared> = problem.flights().collect();
    let (open, unidentifiable) = candidates(&problem.model.parameters, &all);
    note_parts(&problem, &mut flight_reports);
    // Effects are looked for in an excerpt of long flights, or else in all there is.
    let (searched, whole) = match excerpt(&problem) {
        Some(excerpt) => (excerpt, Some(problem)),
        None => (problem, None),
    };
    let (searched, selection) = select(searched, &open, progress, is_stopped);
    progress("confounded effects");
    let mut effects = effect_reports::judged(&searched, &selection);
    let mut rivals = rivals(&searched, &selection, &open);
    let (problem, selection) = match whole {
        None => (searched, selection),
        Some(whole) => {
            progress("parameters on all flights");
            let of_excerpt = selection.accepted.clone();
            let (whole, selection) = on_all(whole, &searched, selection);
            let mut of_excerpt = of_excerpt.iter();
            rivals.retain(|_| of_excerpt.next().is_some_and(|one| selection.accepted.contains(one)));
            note_excerpt(&searched, &mut flight_reports);
            (whole, selection)
        }
    };
    effect_reports::add_accepted(&problem, &selection, &rivals, &mut effects);
    effect_reports::add_undetermined(&problem, &selection, &unidentifiable, &mut effects);
    note_logging(&problem, &selection, &mut flight_reports);
    let winds = wind_reports::winds(&problem, &selection);
    note_winds(&winds, &mut flight_reports);
    progress("predictions");
    let values = &selection.flown().values;
    let sensor_errors = SensorErrors::of(&problem.model.parameters, values);
    let predictions = predictions(&problem, set, values);
    let held_out = of_role(&predictions, Role::Test);
    let noise_floor = noise::table(&noise::floor(&problem.test), &HORIZONS_S, vehicle.gravity_m_s2);
    let whiteness = BeforeAfter {
        before: whiteness(&problem, &selection.before.values),
        after: whiteness(&problem, values),
    };
    let envelope = envelope::of(
        problem
            .test
            .iter()
            .map(|flight| (&*flight.flight, window_s(&flight.layout), !flight.turns_as_measured())),
    );
    let mut losses = losses(&of_measured_attitude(&problem, &held_out), &noise_floor);
    losses.extend(misfits(&problem, values));
    let is_contradictory =
        |name: &&'static str| effects.get(name).is_some_and(EffectReport::is_contradictory);
    let accepted = effect_reports::accepted(&problem, &selection);
    let without_worth = selection.without_worth.clone();
    let mut at_limit = at_limits(&problem, &selection.accepted, selection.flown());
    at_limit.retain(|name, _| accepted.contains(name) && !without_worth.contains_key(name));
    let is_named = |name: &&'static str| !without_worth.contains_key(name) && !at_limit.contains_key(name);
    let named = accepted.into_iter().filter(is_named);
    let (prediction_only, verdict) = named.partition(is_contradictory);
    let report = Report {
        vehicle: set.vehicle.display().to_string(),
        verdict,
        prediction_only,
        without_worth,
        at_limit,
        stopped: selection.is_stopped,
        losses,
        bearing: bearing(&problem),
        limits: limits(&of_measured_attitude(&problem, &held_out), &noise_floor),
        withdrawn: selection.withdrawn.clone(),
        refined: selection.refined.is_some(),
        effects,
        unexplained: unexplained(&whiteness),
        whiteness,
        time_offsets_s: offsets.into_iter().collect(),
        faults,
        trims: trim::differing(&problem, values),
        winds,
        held_out,
        selected: of_role(&predictions, Role::Select),
        fitted: of_role(&predictions, Role::Fit),
        envelope,
        flights: flight_reports,
        noise_floor,
        ratios: Ratios::of(&problem, &selection.after),
        not_identifiable: unidentifiable,
        next_flight: None,
        block_s: problem.block_s,
        validation_blocks: selection.after.validation_costs.len(),
    };
    let parameters = &problem.model.parameters;
    let effects = parameters.effects_under(&wind_reports::values_of_file(parameters, &selection));
    let name = |flight: &Prepared| flight.flight.name.clone();
    let late = problem.flights().map(|flight| (name(flight), flight.late)).collect();
    let regressors =
        problem.flights().map(|flight| (name(flight), regressors(&problem.model, flight, values))).collect();
    let pictures = pictures(&problem, &selection);
    // A model that loses is not worth another flight of its effects, and nobody knows the wind of another flight.
    let is_judged = report.losses.is_empty() && !report.stopped;
    let is_found = is_judged && !report.verdict.is_empty() && report.winds.is_empty();
    let questions = OpenQuestions::of(&problem, &selection, &rivals).filter(|_| is_found);
    drop(problem);
    Ok(Outcome { pictures, regressors, effects, late, sensor_errors, report, believed, questions })
}

/// Thrust of the commands over the weight while the flights are compared; `None` if both are about equal.
fn bearing(problem: &Problem) -> Option<Bearing> {
    let of_commands = |flight: &&Prepared| {
        flight.moves_freely && flight.flight.rotor_speed.is_empty() && !flight.flight.command.is_empty()
    };
    let compared = |flight: &Prepared| {
        let Prepared { flight, layout, .. } = flight;
        let [first_s, last_s] = [layout.knots.first(), layout.knots.last()]
            .map(|knot| knot.map_or(f64::NAN, |knot| layout.clock.at(*knot)));
        let commands = flight.command.time_s.iter().zip(&flight.command.values);
        let within = commands.filter(|(time_s, _)| (first_s..=last_s).contains(*time_s));
        within.map(|(_, command)| *command).collect::<Vec<_>>()
    };
    let commands: Vec<_> = problem.flights().filter(of_commands).flat_map(compared).collect();
    Bearing::of(&problem.model.vehicle, &commands).filter(|bearing| !BORNE.contains(&bearing.share))
}

/// The errors of flights whose attitude was measured: under an assumed one a prediction does not judge the vehicle.
fn of_measured_attitude(problem: &Problem, errors: &Changes) -> Changes {
    let is_measured =
        |name: &str| problem.flights().any(|flight| flight.flight.name == name && !flight.is_assumed());
    let kept = errors.iter().filter(|(name, _)| is_measured(name));
    kept.map(|(name, errors)| (name.clone(), errors.clone())).collect()
}

/// The problem, its flights as reported, and their clock offsets.
type Aligned<'f> = (Problem<'f>, Vec<FlightReport>, Vec<(String, Offsets)>);

/// The flights of `set` with aligned clocks, without rotors and trims that have a fault; these join `faults`.
fn aligned<'f>(
    vehicle: &Vehicle,
    declared: &[Effect],
    set: &'f FlightSet,
    faults: &mut Vec<Fault>,
) -> Result<Aligned<'f>, IdentifyError> {
    let (problem, reports) =
        problem(vehicle, declared, set).map_err(|cause| faulty(faults, set).unwrap_or(cause))?;
    let (problem, offsets) = align(problem);
    let (problem, of_rotors) = faults::of_rotors(problem);
    faults.extend(of_rotors);
    for (role, flights) in [(Role::Fit, &problem.estimation), (Role::Test, &problem.test)] {
        if flights.is_empty() {
            return Err(faulty(faults, set).unwrap_or_else(|| no_flight(role, &[])));
        }
    }
    Ok((problem, reports, offsets))
}

/// Faults of the channels of `set`, and the set without these and without what a rig makes meaningless; `None` if all is used.
fn believed(
    vehicle: &Vehicle,
    declared: &[Effect],
    set: &FlightSet,
) -> Result<(Vec<Fault>, Option<FlightSet>), IdentifyError> {
    let held = rig::without_translation(set, vehicle, declared);
    let set = held.as_ref().unwrap_or(set);
    let (faults, cleaned) = faults::in_channels(&problem(vehicle, declared, set)?.0, set);
    Ok((faults, cleaned.or(held)))
}

/// Finds the faults of the flights of `set` without fitting anything.
///
/// # Errors
/// As [`identify`].
pub fn faults(set: &FlightSet) -> Result<Vec<Fault>, IdentifyError> {
    let vehicle = Vehicle::load(&set.vehicle)?;
    let declared = entry::resolve(&vehicle.effects)?;
    let (mut faults, believed) = believed(&vehicle, &declared, set)?;
    aligned(&vehicle, &declared, believed.as_ref().unwrap_or(set), &mut faults)?;
    Ok(faults)
}

/// Finds the faults of the channels of `set`, whose flights may have any roles; without an identification.
///
/// # Errors
/// A vehicle file that cannot be read.
pub fn doubts(set: &FlightSet) -> Result<Vec<Fault>, IdentifyError> {
    let vehicle = Vehicle::load_from(&set.files, &set.vehicle)?;
    let declared = entry::resolve(&vehicle.effects)?;
    let held = rig::without_translation(set, &vehicle, &declared);
    let set = held.as_ref().unwrap_or(set);
    Ok(faults::in_channels(&usable(&vehicle, &declared, set).0, set).0)
}

/// The flights on their grids, with the declared model.
///
/// # Errors
/// If the samples of a flight are too far apart, or no flight of a role can be used.
pub fn problem<'f>(
    vehicle: &Vehicle,
    declared: &[Effect],
    set: &'f FlightSet,
) -> Result<(Problem<'f>, Vec<FlightReport>), IdentifyError> {
    let (problem, reports, reasons) = usable(vehicle, declared, set);
    for (role, flights) in [(Role::Fit, &problem.estimation), (Role::Test, &problem.test)] {
        if flights.is_empty() {
            return Err(no_flight(role, &reasons));
        }
    }
    Ok((problem, reports))
}

/// The flights that can be used, all flights as reported, and the reasons of those that cannot.
fn usable<'f>(
    vehicle: &Vehicle,
    declared: &[Effect],
    set: &'f FlightSet,
) -> (Problem<'f>, Vec<FlightReport>, Vec<(&'f Flight, String)>) {
    let parameters = Parameters::of_flights(vehicle, declared, &LoggedVoltage::of(&set.flights));
    let propulsion = Propulsion::of(vehicle);
    let (mut estimation, mut validation, mut test) = (Vec::new(), Vec::new(), Vec::new());
    let (mut reports, mut reasons) = (Vec::new(), Vec::new());
    for flight in &set.flights {
        // A flight that cannot be used does not stop the others.
        let prepared = flight
            .check_span(SPACING_MAX_S)
            .map_err(|cause| cause.to_string())
            .and_then(|()| {
                Prepared::new(flight, box_s(flight), &propulsion).map_err(|cause| cause.to_string())
            })
            .map_err(|reason| reasons.push((flight, reason)))
            .ok();
        let mut report = flight_report(flight, prepared.as_ref());
        let reason = reasons.last().filter(|_| prepared.is_none());
        let slow = prepared.as_ref().and_then(|prepared| prepared.slow_period_s);
        report.notes.extend(slow.map(|period_s| slow_note(period_s, &propulsion)));
        let turns_as_measured =
            prepared.as_ref().is_some_and(|flight| flight.turns_as_measured() && !flight.is_assumed());
        report.notes.extend(turns_as_measured.then(|| TURNS_AS_MEASURED.to_owned()));
        report.notes.extend(reason.map(|(_, reason)| format!("not used: {reason}")));
        reports.push(report);
        match (prepared, flight.role) {
            (Some(prepared), Role::Fit) => estimation.push(prepared),
            (Some(prepared), Role::Select) => validation.push(prepared),
            (Some(prepared), Role::Test) => test.push(prepared),
            (None, _) => {}
        }
    }
    let total_s: f64 = estimation.iter().map(Prepared::compared_s).sum();
    let model = Model { vehicle: vehicle.clone(), parameters };
    let noises = Noises::new();
    let block_s = block_s(total_s);
    let problem = Problem { model, estimation, validation, test, noises, block_s, shared_late_s: 0.0 };
    (problem, reports, reasons)
}

/// Note of a flight whose torques are not compared.
const TURNS_AS_MEASURED: &str =
    "torques are not compared: predictions take the measured attitude, and judge forces alone";

fn slow_note(period_s: f64, propulsion: &Propulsion) -> String {
    let (most_s, motor_s) = (propulsion.longest_period_s(), propulsion.motor_s);
    format!(
        "command: logged every {period_s:.3} s, expected at most {most_s:.3} s, half of the motors' time constant of {motor_s:.3} s; motor lag, \
         command delay, inertia and all torques cannot be determined, and are not compared; log commands or rotor speeds faster"
    )
}

/// Width of the windows in which measurement and model are compared, s.
fn window_s(layout: &Layout) -> f64 {
    4.0 * BOX_STEPS as f64 * layout.clock.step_s
}

fn flight_report(flight: &Flight, prepared: Option<&Prepared>) -> FlightReport {
    let layout = prepared.map(|prepared| &prepared.layout);
    FlightReport {
        name: flight.name.clone(),
        role: flight.role,
        compared_s: prepared.map_or(0.0, Prepared::compared_s),
        window_s: layout.map_or(0.0, window_s),
        equations: layout
            .iter()
            .flat_map(|layout| &layout.equations)
            .map(|equation| equation.name())
            .collect(),
        assumed: flight.assumed.clone(),
        notes: flight.notes.clone(),
    }
}

/// Notes how much of each long flight serves for what.
fn note_parts(problem: &Problem, reports: &mut [FlightReport]) {
    for flight in problem.flights() {
        let of_flight = reports.iter_mut().filter(|report| report.name == flight.flight.name);
        of_flight.for_each(|report| report.notes.extend(parts::note(flight)));
    }
}

/// Notes how much of each flight effects were looked for in.
fn note_excerpt(excerpt: &Problem, reports: &mut [FlightReport]) {
    for flight in excerpt.flights() {
        let of_flight = reports.iter_mut().filter(|report| report.name == flight.flight.name);
        of_flight.for_each(|report| report.notes.push(excerpt::note(flight)));
    }
}

/// Notes the wind of each flight where the fit flights have winds of their own.
fn note_winds(winds: &[FlightWind], reports: &mut [FlightReport]) {
    for report in reports.iter_mut().filter(|_| !winds.is_empty()) {
        let has_wind = winds.iter().any(|wind| wind.flight == report.name);
        report.notes.push((if has_wind { OWN_WIND } else { MEAN_WIND }).to_owned());
    }
}

/// Note of a flight with a wind of its own.
const OWN_WIND: &str = "it has a wind of its own (`winds`), which is not in the vehicle file";

/// Note of the other flights then.
const MEAN_WIND: &str = "its wind is not fitted: it is predicted in the mean wind of the fit flights";

/// Notes the lateness of the commands that their logging explains.
fn note_logging(problem: &Problem, selection: &Selection, reports: &mut [FlightReport]) {
    let leads = selection.accepted.iter();
    let leads = leads.filter_map(|candidate| logging::explained_lead_s(problem, candidate, &selection.after));
    let last = selection.rounds.last().into_iter().flat_map(|round| &round.judged);
    let lags = last.filter(|judged| judged.is_logging).filter_map(|judged| {
        let Candidate { kind, free } = &judged.candidate;
        logging::explained_lag_s(problem, kind, free, &judged.fitted)
    });
    let Some(lead_s) = leads.chain(lags).reduce(f64::max) else { return };
    reports.iter_mut().for_each(|report| report.notes.push(logging::note(problem, lead_s)));
}

fn unexplained(
    whiteness: &BeforeAfter<BTreeMap<&'static str, Whiteness>>,
) -> BTreeMap<&'static str, Unexplained> {
    let one = |(name, after): (&&'static str, &Whiteness)| {
        let noise = (after.rms * after.rms - after.persistent * after.persistent).max(0.0).sqrt();
        let before = whiteness.before.get(name).map_or(0.0, |before| before.persistent);
        let is_large = after.persistent > UNEXPLAINED * noise && after.p_value < 0.01;
        is_large.then_some((*name, Unexplained { rms: after.persistent, unit: after.unit, before }))
    };
    whiteness.after.iter().filter_map(one).collect()
}

fn pictures(problem: &Problem, selection: &Selection) -> Vec<Picture> {
    let mut pictures = Vec::new();
    for flight in problem.flights() {
        let before = problem.model.residual_under(flight, &selection.before.values);
        let after = problem.model.residual_under(flight, &selection.flown().values);
        let measured = &problem.model.tracks(flight, &selection.flown().values).rows;
        for equation in &flight.layout.equations {
            let columns = |rows: &[f64]| {
                (0..equation.size()).map(|axis| column(flight, rows, *equation, axis)).collect()
            };
            pictures.push(Picture {
                flight: flight.flight.name.clone(),
                role: flight.flight.role,
                equation: *equation,
                time_s: flight.layout.knots.iter().map(|knot| flight.layout.clock.at(*knot)).collect(),
                measured: columns(measured),
                before: columns(&before),
                after: columns(&after),
            });
        }
    }
    pictures
}
