//! Results of an identification, for programs (`report.json`) and for people.

use crate::data::fault::Fault;
use crate::numbers::digits::{quantity, rounded};
use crate::report::envelope::Reached;
use crate::report::limits::Limits;
use crate::report::loss::{Loss, advice};
use crate::report::proposal::Proposal;
use crate::report::trim::Trim;
use crate::report::whiteness::Whiteness;
use crate::search::align::Offsets;
use crate::search::candidate::Unidentifiable;
use crate::search::ratios::Ratios;
use crate::search::revision::Withdrawn;
use crate::search::unnamed::Unnamed;
use crate::search::worth::{Worth, in_words};
use diagnostics::unit::behind_number;
use flights::Role;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use vehicles::bearing::Bearing;

pub use crate::model::noise::Noise;
pub use crate::report::flight_report::FlightReport;
pub use crate::report::horizons::{Change, Changes};

/// Everything that was found.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The declared vehicle file.
    pub vehicle: String,
    /// The flights.
    pub flights: Vec<FlightReport>,
    /// The effects that are named, in order of acceptance. Not to be acted on where `losses` has some.
    pub verdict: Vec<&'static str>,
    /// Accepted effects that predictions need, with values by the equations and by predictions that contradict each other. The vehicle file has
    /// them. They are not properties of the vehicle.
    pub prediction_only: Vec<&'static str>,
    /// Accepted errors of sensors that change no prediction noticeably, each with the reason. They are fitted, and not named.
    pub without_worth: BTreeMap<&'static str, String>,
    /// Accepted effects whose parameters touch the limit of their meaning, each with the reason. They are fitted, and not named.
    pub at_limit: BTreeMap<&'static str, String>,
    /// True if the search was stopped before its end: effects may be missing, and predictions have judged none of those that are named.
    pub stopped: bool,
    /// Predictions of the test flights that lose to persistence or to the declared vehicle: then the vehicle file does not
    /// describe these flights, with these effects or without.
    pub losses: Vec<Loss>,
    /// Thrust of the commands over the weight, for all flights; `None` if they are about equal, or if nothing shows the ratio.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bearing: Option<Bearing>,
    /// Effects that were accepted and taken back.
    pub withdrawn: Vec<Withdrawn>,
    /// True if the parameters were refined by prediction errors, because that predicts better.
    pub refined: bool,
    /// Every candidate that was judged, by name.
    pub effects: BTreeMap<&'static str, EffectReport>,
    /// The residuals on the validation data.
    pub whiteness: BeforeAfter<BTreeMap<&'static str, Whiteness>>,
    /// Clocks of each flight: attitude, position and velocity against the inertial unit; `null` where the
    /// flight lacks the channels, or has too little of them.
    pub time_offsets_s: BTreeMap<String, Offsets>,
    /// Faulty channels and actuators, flight by flight.
    pub faults: Vec<Fault>,
    /// The trims of the flights where they differ between flights: constant torques that no one vehicle explains.
    pub trims: Vec<Trim>,
    /// The winds of the fit flights, where each has its own; empty where all have the same.
    pub winds: Vec<FlightWind>,
    /// Prediction errors of the test flights: flight, horizon in s, channel.
    pub held_out: Changes,
    /// Parts of the squared errors of the test flights after 0.5 s, by what they are due to: channel.
    pub limits: BTreeMap<&'static str, Limits>,
    /// The same of the flights that effects are chosen on.
    pub selected: Changes,
    /// The same of the flights that parameters are fitted on.
    pub fitted: Changes,
    /// The envelope in which the verdict was judged: limits of the test flights, by the keys of `[envelope]` in a vehicle file.
    pub envelope: BTreeMap<&'static str, Reached>,
    /// White noise of each channel, and the prediction error that it alone makes at each horizon.
    pub noise_floor: BTreeMap<&'static str, Noise>,
    /// Root mean square of the part of the residual that is not noise and that no candidate explains, by equation.
    pub unexplained: BTreeMap<&'static str, Unexplained>,
    /// Effects, or sensors' parts of them, that these flights cannot show, and the data that would be needed.
    pub not_identifiable: Vec<Unidentifiable>,
    /// The ratios that are determined, where the flights show rotation alone.
    pub ratios: Option<Ratios>,
    /// The proposed next flight; `None` if no question is open, or none was searched.
    pub next_flight: Option<Proposal>,
    /// Length of the blocks that count as independent.
    pub block_s: f64,
    /// Number of these blocks in the flights that effects are chosen on.
    pub validation_blocks: usize,
}

/// A value under the declared and under the new model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BeforeAfter<T> {
    /// Declared.
    pub before: T,
    /// With the accepted effects.
    pub after: T,
}

/// An effect as it came out.
#[derive(Debug, Clone, Serialize)]
pub struct EffectReport {
    /// True if it was accepted.
    pub accepted: bool,
    /// True if its parameters and its gain come from the linearised equations, not from a fit.
    pub linearised: bool,
    /// Its fitted parameters.
    pub parameters: BTreeMap<&'static str, Estimate>,
    /// Weighted root mean square of the residual on the validation data, without and with it, in units of the
    /// residual that all candidates together leave.
    pub held_out: BeforeAfter<f64>,
    /// Chance of as much gain without it, by resampled blocks.
    pub chance: f64,
    /// Prediction errors of the flights that effects are chosen on, with and without it; empty where no attitude was measured.
    pub worth: Vec<Worth>,
    /// Effects that would do as well in its place.
    pub confused_with: Vec<&'static str>,
    /// The experiment that would separate it from them.
    pub experiment: Option<String>,
}

impl EffectReport {
    /// True if the equations ask for quite another value of a parameter than predictions: neither is sure to be a property of the vehicle.
    #[must_use]
    pub fn is_contradictory(&self) -> bool {
        self.parameters.values().any(|estimate| estimate.by_equations.is_some())
    }
}

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// True if the estimate stopped at the greatest or least value that the effect may have.
    pub at_bound: bool,
    /// True if these flights determine it: its interval does not cover all values that the effect may have.
    pub determined: bool,
    /// The value by the equations of each moment, where predictions ask for one far beyond its interval. Neither is then sure to be a
    /// property of the vehicle. A possible cause is a force or a torque that no effect has, and that the controller answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_equations: Option<f64>,
}

/// A residual without an explanation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unexplained {
    /// Root mean square of the part of it that is not noise.
    pub rms: f64,
    /// Its unit.
    pub unit: &'static str,
    /// The same under the declared model.
    pub before: f64,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write_flights(f)?;
        self.write_verdict(f)?;
        self.write_trims(f)?;
        self.write_winds(f)?;
        self.write_errors(f)?;
        self.write_residuals(f)?;
        self.write_rest(f)?;
        self.next_flight.iter().try_for_each(|proposal| write!(f, "{proposal}"))
    }
}

/// With fewer blocks of validation data nothing is beyond chance.
const ENOUGH_BLOCKS: usize = 12;
/// Reason why predictions do not judge a verdict.
pub(crate) const UNCHECKED: &str = "no test flight has both a measured attitude and commands or rotor speeds, so that predictions could not refute a wrong verdict";
/// Ratio of prediction errors, new by declared, above which the new vehicle predicts worse.
const WORSE: f64 = 1.2;

/// The level wind of one fit flight: the velocity of the air in the world.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FlightWind {
    /// The flight.
    pub flight: String,
    /// Along x.
    pub x: Estimate,
    /// Along y.
    pub y: Estimate,
}

impl FlightWind {
    /// Its speed, in m/s.
    #[must_use]
    pub fn speed_m_s(&self) -> f64 {
        [self.x, self.y].map(|along| along.value * along.value).iter().sum::<f64>().sqrt()
    }
}

impl Report {
    /// The effects of the verdict, and those that are fitted and not named.
    fn accepted(&self) -> impl Iterator<Item = &&'static str> {
        let unnamed = self.unnamed().fitted().map(|(effect, _)| effect);
        self.verdict.iter().chain(&self.prediction_only).chain(unnamed)
    }

    /// The effects that were found and are not named.
    pub(crate) fn unnamed(&self) -> Unnamed<'_> {
        let Self { withdrawn, without_worth, at_limit, .. } = self;
        Unnamed { withdrawn, without_worth, at_limit }
    }

    /// True if no effect was accepted and the validation data are too short for one.
    pub(crate) fn is_undecided(&self) -> bool {
        self.accepted().next().is_none() && self.validation_blocks < ENOUGH_BLOCKS
    }

    /// True if no prediction judges the verdict: no test flight was predicted from a measured attitude.
    pub(crate) fn is_unchecked(&self) -> bool {
        let is_assumed = |name: &String| {
            self.flights.iter().any(|flight| flight.name == *name && !flight.assumed.is_empty())
        };
        self.held_out
            .iter()
            .all(|(name, horizons)| is_assumed(name) || horizons.values().all(BTreeMap::is_empty))
    }

    /// True if the test flights tell where the model holds. A model that loses, or that no prediction judged, was not validated anywhere.
    pub(crate) fn has_validated(&self) -> bool {
        self.losses.is_empty() && !self.stopped && !self.is_unchecked() && !self.envelope.is_empty()
    }

    /// Limit on the use of the new vehicle file, in words; `None` if there is none.
    #[must_use]
    pub fn limited_use(&self) -> Option<String> {
        if self.stopped {
            Some("not to be used: the search was stopped before its end".to_owned())
        } else if self.is_undecided() {
            None
        } else if !self.losses.is_empty() {
            Some("not to be used: it does not describe these flights".to_owned())
        } else if !self.prediction_only.is_empty() {
            Some(format!(
                "{} for predictions only: not a property of the vehicle",
                self.prediction_only.join(", ")
            ))
        } else {
            None
        }
    }

    /// The envelope as the end of a sentence.
    pub(crate) fn envelope_in_words(&self, text: fn(f64, &str) -> String) -> String {
        let limits = self.envelope.iter();
        let one = |(key, Reached { value, unit }): (&&str, &Reached)| {
            let (name, word) = match key.rsplit_once('_') {
                Some((name, "min")) => (name, "at least"),
                Some((name, _)) => (name, "at most"),
                None => (*key, ""),
            };
            format!("{} {word} {}", name.replace('_', " "), text(*value, unit))
        };
        limits.map(one).collect::<Vec<_>>().join(", ")
    }

    /// Returns assumptions and the reader's notes, each with its flights.
    fn notes(&self) -> Vec<(&str, Vec<&str>)> {
        let mut notes: Vec<(&str, Vec<&str>)> = Vec::new();
        for flight in &self.flights {
            for note in flight.assumed.iter().chain(&flight.notes) {
                match notes.iter_mut().find(|known| known.0 == note) {
                    Some(known) => known.1.push(&flight.name),
                    None => notes.push((note, vec![&flight.name])),
                }
            }
        }
        notes
    }

    fn write_flights(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "declared: {}", self.vehicle)?;
        for flight in &self.flights {
            let role = flight.role.name();
            let equations = flight.equations.join(", ");
            writeln!(f, "  {role:6}  {:28} {:7.1} s  {equations}", flight.name, flight.compared_s)?;
        }
        for (note, flights) in self.notes() {
            let all = flights.len() == self.flights.len() && flights.len() > 1;
            let of = if all { "all flights".to_owned() } else { flights.join(", ") };
            writeln!(f, "note: {of}: {note}")?;
        }
        self.write_clocks(f)
    }

    fn write_verdict(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.stopped {
            let found: Vec<&str> = self.verdict.iter().chain(&self.prediction_only).copied().collect();
            let found = if found.is_empty() { "nothing".to_owned() } else { found.join(", ") };
            writeln!(
                f,
                "\nverdict: undecided. The search was stopped before its end: effects may be missing or wrong. Found so far: {found}"
            )?;
        } else if self.is_undecided() {
            let (blocks, block_s) = (self.validation_blocks, self.block_s);
            writeln!(
                f,
                "\nverdict: undecided. The flights that effects are chosen on have {blocks} blocks of {block_s} s, of {ENOUGH_BLOCKS} \
                 that it takes to show anything beyond chance: fly longer."
            )?;
        } else if !self.losses.is_empty() {
            self.write_losses(f)?;
        } else if self.verdict.is_empty() && self.prediction_only.is_empty() {
            writeln!(f, "\nverdict: nothing. {}", self.unnamed().no_effect())?;
        } else if self.verdict.is_empty() {
            writeln!(f, "\nverdict: nothing that is a property of the vehicle")?;
        } else {
            writeln!(f, "\nverdict: {}", self.verdict.join(", "))?;
            if self.is_unchecked() {
                writeln!(f, "  (not checked by predictions: {UNCHECKED})")?;
            }
        }
        if self.losses.is_empty() && !self.prediction_only.is_empty() {
            let names = self.prediction_only.join(", ");
            writeln!(f, "kept for predictions only, not a property of the vehicle: {names}")?;
        }
        for (effect, reason) in self.unnamed().fitted() {
            writeln!(f, "fitted and not named: {effect}: {reason}")?;
        }
        if let Some(bearing) = self.bearing {
            let is_lost = self.is_undecided() || !self.losses.is_empty();
            writeln!(f, "{}: {bearing}", if is_lost { "likely reason" } else { "warning" })?;
        }
        if self.refined {
            writeln!(
                f,
                "  (parameters refined by prediction errors over 0.05 to 0.5 s, which predicts better)"
            )?;
        }
        for name in self.accepted() {
            let Some(effect) = self.effects.get(name) else { continue };
            writeln!(f, "  {name}: {}", self.residuals_in_words(effect))?;
            for (parameter, estimate) in &effect.parameters {
                let [value, low, high] = [estimate.value, estimate.low, estimate.high].map(rounded);
                let doubt = match estimate {
                    Estimate { determined: false, .. } => "; not determined by these flights",
                    Estimate { at_bound: true, .. } => "; at its bound: another cause may be at work",
                    _ => "",
                };
                let unit = behind_number(estimate.unit);
                writeln!(f, "    {parameter} = {value}{unit}  (95 %: {low} ... {high}){doubt}")?;
                if let Some(other) = estimate.by_equations.map(rounded) {
                    writeln!(
                        f,
                        "      by the equations of each moment {other}{unit}: do not take either for a property of the vehicle; possible cause: \
                         a force or torque that no effect has, and that the controller answers"
                    )?;
                }
            }
            if let Some(worth) = in_words(&effect.worth) {
                let role = self.judged_role().name();
                writeln!(
                    f,
                    "    prediction errors on the {role} flights, without it (the others fitted to that) -> with it, {worth}"
                )?;
            }
            if !effect.confused_with.is_empty() {
                writeln!(f, "    cannot be told from: {}", effect.confused_with.join(", "))?;
            }
            if let Some(experiment) = &effect.experiment {
                writeln!(f, "    to tell them apart: {experiment}")?;
            }
        }
        if let Some(ratios) = &self.ratios {
            writeln!(f, "ratios: {ratios}")?;
            writeln!(f, "  to separate thrust, inertia, static moment and friction: {}", ratios.experiment)?;
        }
        for Withdrawn { effect, reason, .. } in &self.withdrawn {
            writeln!(f, "withdrawn: {effect}: {reason}")?;
        }
        self.faults.iter().try_for_each(|fault| {
            let Fault { flight, channel, kind, consequence, advice, .. } = fault;
            writeln!(f, "fault: {flight}: {channel} ({kind}): {}; {consequence}; {advice}", fault.finding())
        })
    }

    /// Role of the flights on which effects are chosen.
    fn judged_role(&self) -> Role {
        let has_own = self.flights.iter().any(|flight| flight.role == Role::Select);
        if has_own { Role::Select } else { Role::Fit }
    }

    /// Residuals without and with an effect. They are those of the equations, also where predictions refined the parameters.
    fn residuals_in_words(&self, effect: &EffectReport) -> String {
        let BeforeAfter { before, after } = effect.held_out;
        let by = if self.refined { ", by the equations before the refinement:" } else { "" };
        let why = if after > before && !effect.worth.is_empty() {
            "; it is kept for the prediction errors below"
        } else {
            ""
        };
        let [without, with] = [before, after].map(rounded);
        format!("normalised residual on held-out data{by} {without} without it, {with} with all effects{why}")
    }

    /// The answer where predictions lose: no verdict, but advice what to measure.
    fn write_losses(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nverdict: this vehicle file does not describe these flights. Its predictions lose:")?;
        self.losses.iter().try_for_each(|loss| writeln!(f, "  {loss}"))?;
        let mut channels: Vec<&str> = self.losses.iter().map(|loss| loss.channel).collect();
        channels.sort_unstable();
        channels.dedup();
        for channel in channels {
            writeln!(f, "to measure, for {}", advice(channel))?;
        }
        let names: Vec<&str> = self.verdict.iter().chain(&self.prediction_only).copied().collect();
        if !names.is_empty() {
            let names = names.join(", ");
            writeln!(f, "The equations ask for these effects, which are not to be acted on: {names}")?;
        }
        Ok(())
    }

    fn write_trims(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.trims.is_empty() {
            writeln!(f, "\nthe flights differ in trim (rad/s^2 beyond the new model):")?;
        }
        for trim in &self.trims {
            let [x, y, z] = trim.angular_acceleration_rad_s2.map(rounded);
            writeln!(f, "  {:28} roll {x}  pitch {y}  yaw {z}", trim.flight)?;
        }
        Ok(())
    }

    fn write_winds(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.winds.is_empty() {
            writeln!(f, "\neach fit flight has a wind of its own (m/s, 95 %):")?;
        }
        for FlightWind { flight, x, y } in &self.winds {
            let along = |Estimate { value, low, high, .. }: &Estimate| {
                let [value, low, high] = [*value, *low, *high].map(rounded);
                format!("{value} ({low} ... {high})")
            };
            writeln!(f, "  {flight:28} x {}  y {}", along(x), along(y))?;
        }
        if !self.winds.is_empty() {
            writeln!(
                f,
                "  these winds stand for trims, too: do not take them for measured ones. The vehicle file has no wind from these flights, which are \
                 not flown again on the bus"
            )?;
        }
        Ok(())
    }

    /// Number and range of the winds; `None` where all flights have the same.
    pub(crate) fn winds_in_words(&self) -> Option<String> {
        let speeds = || self.winds.iter().map(FlightWind::speed_m_s);
        let (least, most) = (speeds().reduce(f64::min)?, speeds().reduce(f64::max)?);
        let (count, least, most) = (self.winds.len(), rounded(least), quantity(most, "m/s"));
        Some(format!("{count} flights, {count} winds: {least} to {most}"))
    }

    fn write_errors(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.held_out.values().any(|horizons| !horizons.is_empty()) {
            let what = "prediction errors on the test flights (RMS, declared -> new; in brackets with the flight's own trim, with the disturbance \
                        seen before, and persistence)";
            writeln!(f, "\n{what}:")?;
            if !self.winds.is_empty() {
                writeln!(f, "  (last in brackets: in the wind of the flight seen before)")?;
            }
        }
        for (flight, horizons) in self.held_out.iter().filter(|(_, horizons)| !horizons.is_empty()) {
            writeln!(f, "  {flight}")?;
            for (horizon, channels) in horizons {
                let one = |(name, change): (&&str, &Change)| {
                    let [before, after, own_trim, disturbance, persistence] = [
                        change.before,
                        change.after,
                        change.own_trim,
                        change.disturbance,
                        change.persistence,
                    ]
                    .map(rounded);
                    let wind =
                        change.own_wind.map_or(String::new(), |error| format!("; wind {}", rounded(error)));
                    format!(
                        "{name} {before} -> {after} ({own_trim}; {disturbance}; {persistence}{wind}) {}",
                        change.unit
                    )
                };
                let errors = channels.iter().map(one).collect::<Vec<_>>().join("   ");
                writeln!(f, "    {horizon:>4} s  {errors}")?;
            }
        }
        for (channel, limits) in &self.limits {
            writeln!(f, "what limits {channel} after 0.5 s, as parts of the squared error: {limits}")?;
        }
        let worse = self.worse();
        if !worse.is_empty() {
            writeln!(
                f,
                "warning: the new vehicle predicts worse than the declared one: {}",
                worse.join("; ")
            )?;
        }
        Ok(())
    }

    /// Prediction errors on held-out flights that the new vehicle makes larger, with their flights.
    #[must_use]
    pub fn worse(&self) -> Vec<String> {
        let mut worse = Vec::new();
        for (flight, horizons) in &self.held_out {
            for (horizon, channels) in horizons {
                let is_worse = |change: &&Change| change.after > WORSE * change.before;
                worse.extend(channels.iter().filter(|(_, change)| is_worse(change)).map(
                    |(channel, change)| {
                        let [before, after] = [change.before, change.after].map(rounded);
                        format!(
                            "{channel} after {horizon} s of {flight}, {before} -> {after} {}",
                            change.unit
                        )
                    },
                ));
            }
        }
        worse
    }

    fn write_residuals(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.whiteness.after.is_empty() {
            writeln!(
                f,
                "\nresiduals on the test flights (RMS, declared -> new, in brackets without any model):"
            )?;
        }
        for (name, after) in &self.whiteness.after {
            let before = self.whiteness.before.get(name).map_or(f64::NAN, |before| before.rms);
            let [before, new, no_model] = [before, after.rms, after.no_model].map(rounded);
            writeln!(f, "  {name:20} {before} -> {new} ({no_model}){}", behind_number(after.unit))?;
        }
        Ok(())
    }

    fn write_rest(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, Unexplained { rms, unit, before }) in &self.unexplained {
            let [rms, before] = [*rms, *before].map(rounded);
            writeln!(
                f,
                "unexplained: {name}: {rms} {unit} are explained neither by noise nor by any effect (before: {before})"
            )?;
        }
        if self.has_validated() {
            writeln!(f, "validated in flights with {}", self.envelope_in_words(quantity))?;
        }
        if let Some(winds) = self.winds_in_words() {
            writeln!(f, "fitted in {winds}")?;
        }
        self.not_identifiable.iter().try_for_each(|Unidentifiable { effect, needs }| {
            writeln!(f, "not identifiable here: {effect} needs {needs}")
        })
    }
}

#[cfg(test)]
impl Report {
    /// A report of flights that were long enough and show nothing.
    pub(crate) fn of_nothing() -> Self {
        Self {
            vehicle: String::new(),
            flights: Vec::new(),
            verdict: Vec::new(),
            prediction_only: Vec::new(),
            without_worth: BTreeMap::new(),
            at_limit: BTreeMap::new(),
            stopped: false,
            losses: Vec::new(),
            bearing: None,
            withdrawn: Vec::new(),
            refined: false,
            effects: BTreeMap::new(),
            whiteness: BeforeAfter { before: BTreeMap::new(), after: BTreeMap::new() },
            time_offsets_s: BTreeMap::new(),
            faults: Vec::new(),
            trims: Vec::new(),
            winds: Vec::new(),
            selected: Changes::new(),
            held_out: Changes::new(),
            limits: BTreeMap::new(),
            fitted: Changes::new(),
            envelope: BTreeMap::new(),
            noise_floor: BTreeMap::new(),
            unexplained: BTreeMap::new(),
            ratios: None,
            not_identifiable: Vec::new(),
            next_flight: None,
            block_s: 1.0,
            validation_blocks: 20,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wind_of_each_flight_is_told() {
        let along = |value: f64| Estimate {
            value,
            unit: "m/s",
            low: value - 0.5,
            high: value + 0.5,
            at_bound: false,
            determined: true,
            by_equations: None,
        };
        let wind = |flight: &str, [x, y]: [f64; 2]| FlightWind {
            flight: flight.to_owned(),
            x: along(x),
            y: along(y),
        };
        let winds = vec![wind("calm", [0.0, 0.0]), wind("gale", [-8.0, 4.0])];
        let text = Report { winds, ..Report::of_nothing() }.to_string();
        let gale = "x -8.000 (-8.500 ... -7.500)  y 4.000 (3.500 ... 4.500)\n";
        assert!(text.contains("\neach fit flight has a wind of its own (m/s, 95 %):\n  calm "), "{text}");
        assert!(text.contains(gale), "{text}");
        assert!(text.contains("fitted in 2 flights, 2 winds: 0 to 8.944 m/s\n"), "{text}");
        assert!(!Report::of_nothing().to_string().contains("wind"));
    }

    /// An accepted effect whose estimate is at its bound.
    fn effect() -> EffectReport {
        let estimate = Estimate {
            value: 0.1,
            unit: "kg/m",
            low: 0.09,
            high: 0.11,
            at_bound: true,
            determined: true,
            by_equations: None,
        };
        EffectReport {
            accepted: true,
            linearised: false,
            parameters: BTreeMap::from([("coefficient_z", estimate)]),
            held_out: BeforeAfter { before: 1.3, after: 1.1 },
            chance: 1e-4,
            worth: Vec::new(),
            confused_with: Vec::new(),
            experiment: None,
        }
    }

    #[test]
    fn residuals_and_prediction_errors_name_their_flights_and_models() {
        let worth = Worth { channel: "attitude", horizon_s: 0.5, without: 6.749, with: 0.3738, unit: "deg" };
        let held_out = BeforeAfter { before: 1.053, after: 3.227 };
        let mut report = Report {
            verdict: vec!["parasitic-drag"],
            effects: BTreeMap::from([(
                "parasitic-drag",
                EffectReport { held_out, worth: vec![worth], ..effect() },
            )]),
            ..Report::of_nothing()
        };
        let text = report.to_string();
        let errors = "prediction errors on the fit flights, without it (the others fitted to that) -> with it, after 0.5 s: \
                      attitude 6.749 -> 0.3738 deg\n";
        assert!(text.contains(errors), "{text}");
        let residual = "held-out data 1.053 without it, 3.227 with all effects; it is kept for the prediction errors below\n";
        assert!(text.contains(residual), "{text}");
        report.refined = true;
        let text = report.to_string();
        let refined = "held-out data, by the equations before the refinement: 1.053 without it, 3.227 with";
        assert!(text.contains(refined), "{text}");
    }

    #[test]
    fn an_error_of_a_sensor_without_worth_stands_below_the_verdict() {
        let reason = "no prediction error falls noticeably with it";
        let mut report = Report {
            without_worth: BTreeMap::from([("sensor-bias", reason.to_owned())]),
            effects: BTreeMap::from([("sensor-bias", effect()), ("parasitic-drag", effect())]),
            ..Report::of_nothing()
        };
        let text = report.to_string();
        let nothing = "verdict: nothing. The equations fit better with sensor-bias, but no prediction error falls noticeably.\n\
                       fitted and not named: sensor-bias: no prediction error falls noticeably with it\n  sensor-bias: normalised residual";
        assert!(text.contains(nothing), "{text}");
        report.verdict.push("parasitic-drag");
        let text = report.to_string();
        let named = text.find("verdict: parasitic-drag\n").unwrap();
        let below = text.find("\nfitted and not named: sensor-bias: ").unwrap();
        assert!(named < below, "{text}");
    }

    #[test]
    fn a_search_that_was_stopped_gives_no_verdict() {
        let effects = BTreeMap::from([("parasitic-drag", effect())]);
        let verdict = vec!["parasitic-drag"];
        let report = Report { verdict, effects, stopped: true, ..Report::of_nothing() };
        let text = report.to_string();
        assert!(text.contains("verdict: undecided. The search was stopped before its end"), "{text}");
        assert!(text.contains("Found so far: parasitic-drag\n"), "{text}");
        assert!(report.limited_use().is_some_and(|use_| use_.starts_with("not to be used")));
    }

    /// An estimate stands at a limit of what is plausible also where the equations ask for hardly more.
    #[test]
    fn an_estimate_at_its_bound_is_told_as_what_it_is() {
        let effects = BTreeMap::from([("parasitic-drag", effect())]);
        let text = Report { verdict: vec!["parasitic-drag"], effects, ..Report::of_nothing() }.to_string();
        assert!(text.contains("0.1100); at its bound: another cause may be at work\n"), "{text}");
        assert!(!text.contains("more is asked"), "{text}");
    }

    #[test]
    fn a_new_vehicle_that_predicts_worse_is_told() {
        let change = |before, after| Change {
            before,
            after,
            persistence: 1.0,
            own_trim: after,
            disturbance: after,
            own_wind: None,
            measured_attitude: None,
            by_axis: [0.0; 3],
            unit: "m",
        };
        let channels = BTreeMap::from([("position", change(0.1, 0.25)), ("velocity", change(0.1, 0.11))]);
        let mut report = Report {
            held_out: Changes::from([("leg 2".to_owned(), BTreeMap::from([("0.5".to_owned(), channels)]))]),
            ..Report::of_nothing()
        };
        let line = "warning: the new vehicle predicts worse than the declared one: position after 0.5 s of leg 2, 0.1000 -> \
                    0.2500 m\n";
        assert!(report.to_string().contains(line), "{report}");
        report.held_out.clear();
        assert!(!report.to_string().contains("warning"), "{report}");
    }
}
