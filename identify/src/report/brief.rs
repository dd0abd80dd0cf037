//! The first page of a report, for people who fly: the answer, what is missing, how sure that is, what it changes, and what
//! to do next.

use crate::model::flight_wind::FLIGHT_WIND;
use crate::model::sensor_effects::SENSOR_EFFECTS;
use crate::numbers::digits::{printed, printed_quantity};
use crate::report::horizons::Change;
use crate::report::loss::advice;
use crate::report::results::{EffectReport, Estimate, Report, UNCHECKED};
use serde::Serialize;
use std::collections::BTreeSet;

/// Horizon of the prediction errors on the page, s.
const HORIZON: &str = "0.5";
/// Channels on the page, in this order.
const CHANNELS: [&str; 3] = ["attitude", "velocity", "position"];

/// The first page of a report: sentences.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Brief {
    /// The answer in one sentence.
    pub answer: String,
    /// Effects that the declared vehicle lacks.
    pub missing: Vec<String>,
    /// Certainty of each of them.
    pub certainty: Vec<String>,
    /// Prediction errors half a second ahead, on flights that decided nothing.
    pub changes: Vec<String>,
    /// Next steps, the weightiest first.
    pub next: Vec<String>,
}

impl Brief {
    /// The first page of `report`.
    #[must_use]
    pub fn of(report: &Report) -> Self {
        let named = |name: &&'static str| Some((*name, report.effects.get(name)?));
        let accepted: Vec<_> = report.verdict.iter().filter_map(named).collect();
        let is_judged = report.losses.is_empty() && !report.stopped;
        let findings = if is_judged { accepted.as_slice() } else { &[] };
        Self {
            answer: answer(report),
            // Effects of a model that loses, or of a search that was stopped, are no findings.
            missing: findings
                .iter()
                .map(|(name, effect)| missing(name, effect))
                .chain(winds(report).filter(|_| is_judged))
                .collect(),
            certainty: findings
                .iter()
                .map(|(name, effect)| certainty(name, effect))
                .chain(report.ratios.iter().map(|ratios| format!("Ratios: {ratios}.")))
                .collect(),
            changes: CHANNELS
                .iter()
                .filter_map(|channel| change(report, channel))
                .chain(judged_in(report))
                .collect(),
            next: next(report, &accepted),
        }
    }
}

fn answer(report: &Report) -> String {
    let count = report.verdict.len();
    let effects = if count == 1 { "one effect".to_owned() } else { format!("{count} effects") };
    let (small, beyond) = (report.unnamed().small_names(), report.unnamed().bound_names());
    if report.stopped {
        "The search was stopped before its end: there is no answer yet.".to_owned()
    } else if report.is_undecided() {
        "These flights are too short to tell.".to_owned()
    } else if !report.losses.is_empty() && count == 0 && report.prediction_only.is_empty() {
        "The declared vehicle file does not describe these flights: simpler predictions are better."
            .to_owned()
    } else if !report.losses.is_empty() {
        "Do not use the new vehicle file: simpler predictions of these flights are better.".to_owned()
    } else if count == 0 && !report.prediction_only.is_empty() {
        format!(
            "The declared vehicle file lacks nothing that these flights can name. The new one has {} for predictions only: not a \
             property of the vehicle.",
            report.prediction_only.join(" and ")
        )
    } else if count == 0 && !small.is_empty() && report.at_limit.is_empty() {
        format!(
            "The declared vehicle file predicts these flights as well as any. They show {}, too small to change a prediction.",
            small.join(" and ")
        )
    } else if count == 0 && !beyond.is_empty() {
        format!(
            "The declared vehicle file lacks nothing that these flights can name. They put the estimate of {} at its bound: the cause \
             is not known.",
            beyond.join(" and ")
        )
    } else if count == 0 {
        "The declared vehicle file says all that these flights can show.".to_owned()
    } else if report.is_unchecked() {
        format!("The declared vehicle file seems to lack {effects}. No prediction could check that.")
    } else if !report.worse().is_empty() {
        format!(
            "The declared vehicle file lacks {effects}, but the new one does not predict everything better."
        )
    } else {
        format!("The declared vehicle file lacks {effects}. The new one predicts these flights better.")
    }
}

fn missing(name: &str, effect: &EffectReport) -> String {
    let other = || SENSOR_EFFECTS.into_iter().chain([&FLIGHT_WIND]).find(|kind| kind.name == name);
    let summary = plant::effects::find(name).or_else(other).map_or("", |kind| kind.summary);
    let values: Vec<_> = effect.parameters.iter().map(|(name, estimate)| value(name, estimate)).collect();
    format!("{name}: {summary}; {}.", values.join(", "))
}

/// The winds of the flights, where each has its own.
fn winds(report: &Report) -> Option<String> {
    let words = report.winds_in_words()?;
    Some(format!("{words}. The new vehicle file has none of them: a wind is no property of the vehicle."))
}

fn value(name: &str, estimate: &Estimate) -> String {
    let ([value, low, high], unit) = printed([estimate.value, estimate.low, estimate.high], estimate.unit);
    format!("{} {value}{unit} ({low} to {high})", name.replace('_', " "))
}

fn certainty(name: &str, effect: &EffectReport) -> String {
    let rivals = match effect.confused_with.as_slice() {
        [] => String::new(),
        rivals => format!("; these flights cannot tell it from {}", rivals.join(", ")),
    };
    let loose = effect.parameters.iter().filter(|(_, estimate)| !estimate.determined);
    let loose: Vec<String> = loose.map(|(parameter, _)| parameter.replace('_', " ")).collect();
    let loose = match loose.as_slice() {
        [] => String::new(),
        loose => format!("; these flights do not determine: {}", loose.join(", ")),
    };
    // The search draws 20,000 resamplings: none of them says less.
    let chance =
        if effect.chance < 1e-4 { "below 0.0001".to_owned() } else { format!("{:.4}", effect.chance) };
    format!("{name}: the chance that it makes the model no better is {chance}{rivals}{loose}.")
}

/// The errors of a channel over all test flights; `None` where it was not measured.
fn change(report: &Report, channel: &str) -> Option<String> {
    let found: Vec<&Change> =
        report.held_out.values().filter_map(|horizons| horizons.get(HORIZON)?.get(channel)).collect();
    let unit = found.first()?.unit;
    let range = |of: fn(&Change) -> f64| {
        let values = found.iter().map(|change| of(change));
        values.fold([f64::INFINITY, 0.0_f64], |[low, high], value| [low.min(value), high.max(value)])
    };
    let [new_low, new_high] = range(|change| change.after);
    let [old_low, old_high] = range(|change| change.before);
    let [still_low, still_high] = range(|change| change.persistence);
    let (texts, unit) = printed([new_low, new_high, old_low, old_high, still_low, still_high], unit);
    let [new_low, new_high, old_low, old_high, still_low, still_high] = &texts;
    let text = |low: &str, high: &str| {
        if low == high { format!("{low}{unit}") } else { format!("{low} to {high}{unit}") }
    };
    Some(format!(
        "{channel}: {} with the new file, {} with the declared one; {} without any model.",
        text(new_low, new_high),
        text(old_low, old_high),
        text(still_low, still_high)
    ))
}

/// The envelope of the test flights; `None` where nothing of it is known.
fn judged_in(report: &Report) -> Option<String> {
    let words = report.has_validated().then(|| report.envelope_in_words(printed_quantity))?;
    Some(format!("Validated in flights with {words}. The model was not validated beyond these limits."))
}

fn next(report: &Report, accepted: &[(&str, &EffectReport)]) -> Vec<String> {
    let mut steps = Vec::new();
    if report.stopped {
        steps.push("Run the command again, and let it end.".to_owned());
        return steps;
    }
    if report.is_undecided() {
        steps.push(format!(
            "Fly longer: the flights to choose effects on have {} blocks of {} s, and a dozen are needed.",
            report.validation_blocks, report.block_s
        ));
    }
    for fault in &report.faults {
        steps.push(format!("Look at {} of {}: {}.", fault.channel, fault.flight, fault.advice));
    }
    // By channel: several losses of one have one remedy.
    let lost: BTreeSet<&str> = report.losses.iter().map(|loss| loss.channel).collect();
    steps.extend(lost.iter().map(|channel| format!("Measure, for {}.", advice(channel))));
    if !report.trims.is_empty() {
        steps.push(
            "Weigh and balance the vehicle before each flight: these flights differ in trim.".to_owned(),
        );
    }
    if report.is_unchecked() && !accepted.is_empty() {
        steps.push(format!("Log more, so that predictions can check the answer: {UNCHECKED}."));
    }
    for (name, effect) in accepted {
        if let (Some(experiment), Some(rival)) = (&effect.experiment, effect.confused_with.first()) {
            steps.push(format!("To tell {name} from {rival}: {experiment}."));
        }
    }
    if let Some(ratios) = &report.ratios {
        steps
            .push(format!("To separate thrust, inertia, static moment and friction: {}.", ratios.experiment));
    }
    if let Some(proposal) = &report.next_flight {
        let sentences = proposal.sentences().join(" ");
        steps.push(if proposal.is_worth_flying() {
            format!(
                "Fly next-flight.toml ({:.0} s; set points in next-flight.csv), and identify again with it among the flights to \
                 fit. {sentences}",
                proposal.duration_s
            )
        } else {
            format!("No flight within the limits answers the open questions. {sentences}")
        });
    }
    if report.losses.is_empty() && !report.prediction_only.is_empty() {
        steps.push(format!(
            "Use the values of {} in the new file for predictions only: the equations and the predictions contradict each other. \
             A controller that reacts to a disturbance can cause this. Log rotor speeds, and fly in still air.",
            report.prediction_only.join(" and ")
        ));
    }
    if report.losses.is_empty() && !(accepted.is_empty() && report.prediction_only.is_empty()) {
        steps.push(
            "Fly once more, and let `hummingbus validate` judge the new file on that flight.".to_owned(),
        );
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::Brief;
    use crate::report::horizons::{Change, Changes};
    use crate::report::loss::Loss;
    use crate::report::proposal::Proposal;
    use crate::report::results::FlightWind;
    use crate::report::results::{BeforeAfter, EffectReport, Estimate, Report};
    use crate::search::questions::Question;
    use crate::search::revision::Withdrawn;
    use std::collections::BTreeMap;

    fn coefficient() -> Estimate {
        Estimate {
            value: 1.4137e-6,
            unit: "N*s^2/(m*rad)",
            low: 1.362e-6,
            high: 1.465e-6,
            at_bound: false,
            determined: true,
            by_equations: None,
        }
    }

    fn effect() -> EffectReport {
        EffectReport {
            accepted: true,
            linearised: false,
            parameters: BTreeMap::from([("coefficient", coefficient())]),
            held_out: BeforeAfter { before: 1.35, after: 1.06 },
            chance: 5e-5,
            worth: Vec::new(),
            confused_with: vec!["blade-flapping"],
            experiment: Some("fly with a load".to_owned()),
        }
    }

    fn loss(flight: &str) -> Loss {
        Loss {
            flight: flight.to_owned(),
            horizon: "0.5",
            channel: "attitude",
            rival: "persistence",
            new: 40.0,
            knowing: "nothing",
            other: 9.0,
            unit: "deg",
        }
    }

    fn report() -> Report {
        let change = |before, after| Change {
            before,
            after,
            persistence: 9.0,
            own_trim: after,
            disturbance: after,
            own_wind: None,
            measured_attitude: None,
            by_axis: [0.0; 3],
            unit: "deg",
        };
        let flight = |before, after| {
            BTreeMap::from([("0.5".to_owned(), BTreeMap::from([("attitude", change(before, after))]))])
        };
        Report {
            verdict: vec!["rotor-drag"],
            effects: BTreeMap::from([("rotor-drag", effect())]),
            limits: BTreeMap::new(),
            held_out: Changes::from([
                ("one".to_owned(), flight(20.0, 2.0)),
                ("two".to_owned(), flight(30.0, 5.0)),
            ]),
            ..Report::of_nothing()
        }
    }

    #[test]
    fn a_search_that_was_stopped_has_no_answer() {
        let brief = Brief::of(&Report { stopped: true, ..report() });
        assert_eq!(brief.answer, "The search was stopped before its end: there is no answer yet.");
        assert_eq!(brief.next, ["Run the command again, and let it end."]);
        assert!(brief.missing.is_empty() && brief.certainty.is_empty(), "{brief:?}");
    }

    #[test]
    fn a_verdict_that_no_prediction_checks_says_so() {
        let brief = Brief::of(&Report { held_out: Changes::new(), ..report() });
        assert_eq!(
            brief.answer,
            "The declared vehicle file seems to lack one effect. No prediction could check that."
        );
        assert!(brief.next.iter().any(|step| step.contains("measured attitude")), "{:?}", brief.next);
    }

    #[test]
    fn a_missing_effect_is_told_with_its_size_certainty_worth_and_rival() {
        let Brief { answer, missing, certainty, changes, next } = Brief::of(&report());
        assert_eq!(
            answer,
            "The declared vehicle file lacks one effect. The new one predicts these flights better."
        );
        assert_eq!(
            missing,
            [
                "rotor-drag: drag at the hub of a spinning rotor, linear in the rotor speed and in the speed across the \
                 rotor; coefficient 1.414·10⁻⁶ N·s²/(m·rad) (1.362·10⁻⁶ to 1.465·10⁻⁶)."
            ]
        );
        assert_eq!(
            certainty,
            [
                "rotor-drag: the chance that it makes the model no better is below 0.0001; these flights cannot tell it from blade-flapping."
            ]
        );
        assert_eq!(
            changes,
            [
                "attitude: 2.000 to 5.000 deg with the new file, 20.00 to 30.00 deg with the declared one; 9.000 deg without any model."
            ]
        );
        assert_eq!(next[0], "To tell rotor-drag from blade-flapping: fly with a load.");
        assert!(next[1].contains("hummingbus validate"), "{next:?}");
    }

    #[test]
    fn a_pilot_reads_whole_sentences_and_short_lengths_in_millimetres() {
        let offset =
            Estimate { value: 0.005_995, unit: "m", low: 0.005_985, high: 0.006_005, ..coefficient() };
        assert_eq!(super::value("x", &offset), "x 5.995 mm (5.985 to 6.005)");
        let question =
            Question::Parameter { effect: "com-offset", parameter: "z", plausible: 0.005, unit: "m" };
        let proposal = Proposal::of_one_question(question, 0.0);
        let brief = Brief::of(&Report { next_flight: Some(proposal), ..Report::of_nothing() });
        assert_eq!(
            brief.next,
            [
                "No flight within the limits answers the open questions. Open question: z of com-offset to within 5.000 mm. The best \
              flight separates its answers by 0.0 standard errors, and 3 are needed. Raise speed_max_m_s."
            ]
        );
    }

    #[test]
    fn a_model_that_loses_is_not_to_be_used_and_what_to_measure_is_said_once() {
        let brief = Brief::of(&Report { losses: vec![loss("one"), loss("two")], ..report() });
        assert!(brief.answer.starts_with("Do not use the new vehicle file"), "{}", brief.answer);
        let measure: Vec<_> =
            brief.next.iter().filter(|step| step.starts_with("Measure, for torques")).collect();
        assert_eq!(measure.len(), 1, "{:?}", brief.next);
        assert!(!brief.next.iter().any(|step| step.contains("validate")), "{:?}", brief.next);
        assert!(
            brief.missing.is_empty() && brief.certainty.is_empty(),
            "its effects are no findings: {brief:?}"
        );
        let nothing = Report { losses: vec![loss("one")], ..Report::of_nothing() };
        assert!(Brief::of(&nothing).answer.starts_with("The declared vehicle file does not describe"));
    }

    #[test]
    fn flights_that_show_nothing_or_too_little_are_told_apart() {
        let nothing = Brief::of(&Report::of_nothing());
        assert_eq!(nothing.answer, "The declared vehicle file says all that these flights can show.");
        assert!(nothing.missing.is_empty() && nothing.changes.is_empty(), "{nothing:?}");
        let found = Withdrawn::because("ground-effect", "no prediction error falls noticeably".to_owned());
        let small = Report { withdrawn: vec![found.clone()], ..Report::of_nothing() };
        assert!(Brief::of(&small).answer.contains("They show ground-effect, too small"));
        assert!(
            small
                .to_string()
                .contains("verdict: nothing. The equations fit better with ground-effect, but no prediction")
        );
        let reached = Withdrawn { effect: "sensor-bias", at_bound: true, ..found.clone() };
        let beyond = Report { withdrawn: vec![reached], ..Report::of_nothing() };
        assert!(
            Brief::of(&beyond)
                .answer
                .contains("They put the estimate of sensor-bias at its bound: the cause")
        );
        assert!(
            beyond
                .to_string()
                .contains("verdict: nothing. The equations put the estimate of sensor-bias at its bound")
        );
        let replaced = Withdrawn { replaced_by: Some("mass-error"), ..found.clone() };
        let text = Report { withdrawn: vec![replaced.clone()], ..Report::of_nothing() }.to_string();
        assert!(text.contains("verdict: nothing. No candidate makes"), "{text}");
        let mass = Withdrawn { effect: "mass-error", at_bound: true, ..found.clone() };
        let answer = Brief::of(&Report { withdrawn: vec![replaced, mass], ..Report::of_nothing() }).answer;
        assert!(answer.contains("They put the estimate of mass-error at its bound"), "{answer}");
        let touched = BTreeMap::from([("gyroscopic-torque", "it touches its limit".to_owned())]);
        let limited = Report { at_limit: touched, withdrawn: vec![found], ..Report::of_nothing() };
        let (answer, text) = (Brief::of(&limited).answer, limited.to_string());
        assert!(answer.contains("They put the estimate of gyroscopic-torque at its bound"), "{answer}");
        assert!(
            text.contains("verdict: nothing. The equations put the estimate of gyroscopic-torque at"),
            "{text}"
        );
        assert!(text.contains("\nfitted and not named: gyroscopic-torque: it touches its limit\n"), "{text}");
        let short = Brief::of(&Report { validation_blocks: 3, ..Report::of_nothing() });
        assert_eq!(short.answer, "These flights are too short to tell.");
        assert!(short.next[0].starts_with("Fly longer: "), "{:?}", short.next);
    }

    #[test]
    fn winds_of_flights_are_counted() {
        let wind = |flight: &str, [x, y]: [f64; 2]| {
            let along = |value| Estimate { value, ..coefficient() };
            FlightWind { flight: flight.to_owned(), x: along(x), y: along(y) }
        };
        let winds = vec![wind("calm", [0.0, 0.0]), wind("breeze", [3.0, -4.0])];
        let brief = Brief::of(&Report { winds: winds.clone(), ..report() });
        let line = "2 flights, 2 winds: 0 to 5.000 m/s. The new vehicle file has none of them: a wind is no property of the vehicle.";
        assert!(brief.missing.iter().any(|text| text == line), "{:?}", brief.missing);
        let lost = Brief::of(&Report { winds, losses: vec![loss("one")], ..report() });
        assert!(lost.missing.is_empty(), "{:?}", lost.missing);
    }

    #[test]
    fn a_value_that_is_not_determined_is_named() {
        let mut effect = effect();
        assert!(!super::certainty("rotor-drag", &effect).contains("determine"));
        effect.parameters.get_mut("coefficient").unwrap().determined = false;
        let text = super::certainty("rotor-drag", &effect);
        assert!(text.ends_with("; these flights do not determine: coefficient."), "{text}");
    }

    /// The inertia of a vehicle whose controller answers a disturbance: predictions ask for another one than the equations.
    #[test]
    fn an_effect_that_is_no_property_is_not_named() {
        let estimate = Estimate { by_equations: Some(0.4), ..*effect().parameters.values().next().unwrap() };
        let contradictory = EffectReport { parameters: BTreeMap::from([("error_xx", estimate)]), ..effect() };
        assert!(contradictory.is_contradictory() && !effect().is_contradictory());
        let report = Report {
            verdict: Vec::new(),
            prediction_only: vec!["inertia-error"],
            effects: BTreeMap::from([("inertia-error", contradictory)]),
            ..report()
        };
        let brief = Brief::of(&report);
        assert!(brief.answer.contains("lacks nothing that these flights can name"), "{brief:?}");
        assert!(brief.missing.is_empty() && brief.certainty.is_empty(), "{brief:?}");
        assert!(
            brief.next.iter().any(|step| step.contains("inertia-error in the new file for predictions only")),
            "{brief:?}"
        );
        assert_eq!(
            report.limited_use().unwrap(),
            "inertia-error for predictions only: not a property of the vehicle"
        );
        let lost = Report { losses: vec![loss("one")], ..report.clone() };
        assert!(lost.limited_use().unwrap().ends_with("it does not describe these flights"));
        assert_eq!(Report::of_nothing().limited_use(), None);
        assert!(Brief::of(&lost).answer.starts_with("Do not use the new vehicle file"), "{lost}");
        let text = report.to_string();
        for part in
            ["verdict: nothing that is a property", "not a property of the vehicle: inertia-error", "0.4"]
        {
            assert!(text.contains(part), "no {part:?} in: {text}");
        }
    }
}
