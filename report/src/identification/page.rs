//! The page of an identification, which needs no network: the results, and the residuals behind them.
//!
//! It is drawn by `page.js` with plotly.js ([`crate::page`]).

use crate::page::PLOTLY_BASIC;
use identify::brief::Brief;
use identify::run::{Outcome, Picture};
use identify::statistics::{autocorrelation, cross_correlation, white_noise_bound};
use identify::{Equation, Regressor};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Windows of neighbouring knots overlap; those of every fourth do not.
const APART: usize = 4;
/// Lags of correlations, in windows that do not overlap.
const LAGS: usize = 25;
/// Points of a curve over time at most, and of all curves together.
const CURVE_POINTS: (usize, usize) = (4000, 100_000);
/// Points of a cloud at most, and of all clouds together.
const CLOUD_POINTS: (usize, usize) = (1500, 40_000);
/// Fewest points of a curve or cloud, however many there are.
const POINTS_MIN: usize = 300;

/// The page of `outcome`; `flown` are the results on the bus, as in the report's `bus`, if it was flown.
#[must_use]
pub fn page(outcome: &Outcome, flown: Option<&Value>) -> Vec<u8> {
    crate::page::page(
        include_str!("page.html"),
        &PLOTLY_BASIC,
        include_str!("page.js"),
        &data(outcome, flown),
    )
}

fn data(outcome: &Outcome, flown: Option<&Value>) -> Value {
    let components: usize = outcome.pictures.iter().map(|picture| picture.measured.len()).sum();
    let share = |(most, all): (usize, usize)| (all / components.max(1)).clamp(POINTS_MIN, most);
    let points = [share(CURVE_POINTS), share(CLOUD_POINTS)];
    let flights = outcome.report.flights.iter().filter_map(|found| flight(outcome, &found.name, points));
    json!({ "brief": Brief::of(&outcome.report), "report": outcome.report, "bus": flown, "flights": flights.collect::<Vec<_>>() })
}

/// A flight's residuals, and the quantities that they are plotted against, as curves and clouds of up to so many
/// points; `None` if nothing was compared.
fn flight(outcome: &Outcome, name: &str, [curve, cloud]: [usize; 2]) -> Option<Value> {
    let pictures: Vec<&Picture> = outcome.pictures.iter().filter(|picture| picture.flight == name).collect();
    let first = pictures.first()?;
    let cloud = evenly(first.time_s.len(), cloud);
    let regressors = outcome.regressors.get(name).map_or(&[][..], Vec::as_slice);
    let input = |of: &Regressor| json!({ "name": of.name, "unit": of.unit, "cloud": at(&of.values, &cloud) });
    let equation = |picture: &&Picture| {
        let axes = 0..picture.measured.len();
        let components = axes.map(|axis| component(picture, axis, regressors, curve, &cloud));
        json!({
            "name": title(picture.equation),
            "unit": picture.equation.unit(),
            "components": components.collect::<Vec<_>>(),
        })
    };
    Some(json!({
        "name": name,
        "role": first.role,
        "inputs": regressors.iter().map(input).collect::<Vec<_>>(),
        "equations": pictures.iter().map(equation).collect::<Vec<_>>(),
    }))
}

fn title(equation: Equation) -> &'static str {
    match equation {
        Equation::SpecificForce => "specific force (body)",
        Equation::Acceleration => "acceleration (world)",
        Equation::AngularAcceleration => "angular acceleration (body)",
        Equation::Gyroscope => "gyroscope less attitude (body)",
        Equation::RotorSpeed(_) => "rotor speed",
    }
}

/// One component: its curves over time, its cloud of evenly chosen windows, and its correlations.
fn component(
    picture: &Picture,
    axis: usize,
    regressors: &[Regressor],
    points: usize,
    cloud: &[usize],
) -> Value {
    let (measured, before, after) = (&picture.measured[axis], &picture.before[axis], &picture.after[axis]);
    let chosen = extremes(&[measured, before, after], points);
    let name = match picture.equation {
        Equation::RotorSpeed(_) => format!("rotor {}", axis + 1),
        _ => ["x", "y", "z"][axis].to_owned(),
    };
    let inputs = std::iter::once(measured).chain(regressors.iter().map(|regressor| &regressor.values));
    let both = |of: &dyn Fn(&[f64]) -> Vec<Value>| json!({ "before": of(before), "after": of(after) });
    let windows = apart(before).len();
    json!({
        "name": name,
        "rms": [rms(before), rms(after)],
        "curve": {
            "time": chosen.iter().map(|at| (picture.time_s[*at] * 1e4).round() / 1e4).collect::<Vec<_>>(),
            "measured": at(measured, &chosen), "before": at(before, &chosen), "after": at(after, &chosen),
            "breaks": breaks(&picture.time_s, &chosen),
        },
        "cloud": { "measured": at(measured, cloud), "before": at(before, cloud), "after": at(after, cloud) },
        "bounds": { "95": white_noise_bound(windows, 0.95), "99": white_noise_bound(windows, 0.99) },
        "auto": both(&|residual| short(&autocorrelation(&apart(residual), lags(windows)))),
        "cross": inputs.map(|input| both(&|residual| lagged(residual, input))).collect::<Vec<_>>(),
    })
}

/// Windows that do not overlap.
fn apart(values: &[f64]) -> Vec<f64> {
    values.iter().step_by(APART).copied().collect()
}

/// Number of lags that `windows` windows allow.
fn lags(windows: usize) -> usize {
    LAGS.min(windows / 2)
}

/// Correlation with an input, from the longest lag by which the residual leads to the longest by which the input does.
fn lagged(residual: &[f64], input: &[f64]) -> Vec<Value> {
    let (residual, input) = (apart(residual), apart(input));
    let lags = lags(residual.len());
    let mut correlations = cross_correlation(&input, &residual, lags);
    correlations.reverse();
    correlations.pop();
    correlations.extend(cross_correlation(&residual, &input, lags));
    short(&correlations)
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Indices of up to `points` of `count` samples, evenly spaced.
fn evenly(count: usize, points: usize) -> Vec<usize> {
    (0..count).step_by(count.div_ceil(points).max(1)).collect()
}

/// About `points` of the samples: of every stretch the first, and where each of `series` is lowest and highest.
fn extremes(series: &[&Vec<f64>], points: usize) -> Vec<usize> {
    let count = series[0].len();
    if count <= points {
        return (0..count).collect();
    }
    let stretch = (count * (1 + 2 * series.len())).div_ceil(points);
    let mut chosen = BTreeSet::from([count - 1]);
    for first in (0..count).step_by(stretch) {
        let all = first..(first + stretch).min(count);
        chosen.insert(first);
        for values in series {
            let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
            chosen.extend(all.clone().min_by(by_value).into_iter().chain(all.clone().max_by(by_value)));
        }
    }
    chosen.into_iter().collect()
}

/// Indices into `chosen` of the samples after a gap: an interval between neighbours longer than one and a half times
/// the shortest.
fn breaks(time_s: &[f64], chosen: &[usize]) -> Vec<usize> {
    let ways = || time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let limit_s = 1.5 * ways().fold(f64::INFINITY, f64::min);
    let gaps = ways().enumerate().filter(|(_, way)| *way > limit_s);
    let after = gaps.map(|(before, _)| chosen.partition_point(|at| *at <= before));
    after.filter(|at| *at < chosen.len()).collect::<BTreeSet<_>>().into_iter().collect()
}

fn at(values: &[f64], chosen: &[usize]) -> Vec<Value> {
    chosen.iter().map(|at| digits(values[*at])).collect()
}

fn short(values: &[f64]) -> Vec<Value> {
    values.iter().map(|value| digits(*value)).collect()
}

/// Five digits: finer than any plot. A value that is not finite is null.
fn digits(value: f64) -> Value {
    format!("{value:.4e}").parse::<f64>().map_or(Value::Null, Value::from)
}

#[cfg(test)]
mod tests {
    use super::{breaks, evenly, extremes, lagged, page};
    use flights::Role;
    use identify::report::{BeforeAfter, FlightReport, Report};
    use identify::run::{Outcome, Picture};
    use identify::{Equation, Regressor, SensorErrors};
    use std::collections::BTreeMap;

    #[test]
    fn a_long_flight_keeps_its_ends_and_extremes_within_its_points() {
        let wave: Vec<f64> = (0..100_000).map(|at| libm::sin(f64::from(at) * 0.01)).collect();
        let mut peak = wave.clone();
        (peak[54_321], peak[99_999]) = (9.0, -9.0);
        let chosen = extremes(&[&wave, &peak], 4000);
        assert!(chosen.len() <= 4002 && chosen.len() > 800, "{}", chosen.len());
        assert!([0, 54_321, 99_999].iter().all(|at| chosen.contains(at)));
        assert_eq!(extremes(&[&wave[..10].to_vec()], 10), (0..10).collect::<Vec<_>>());
        assert_eq!(evenly(10, 4), [0, 3, 6, 9]);
    }

    #[test]
    fn a_line_breaks_where_knots_are_missing() {
        let time_s = [0.0, 0.1, 0.2, 0.9, 1.0, 1.1, 5.0];
        assert_eq!(breaks(&time_s, &[0, 1, 2, 3, 4, 5, 6]), [3, 6]);
        assert_eq!(breaks(&time_s, &[0, 4, 6]), [1, 2]);
    }

    #[test]
    fn an_input_that_leads_shows_at_positive_lags() {
        let input: Vec<f64> = (0..400).map(|at| f64::from((at / 4 * 7919) % 101)).collect();
        let residual: Vec<f64> = (0..400).map(|at| if at < 8 { 50.0 } else { input[at - 8] }).collect();
        let correlations = lagged(&residual, &input);
        let value = |at: usize| correlations[at].as_f64().unwrap();
        let highest = (0..correlations.len()).max_by(|a, b| value(*a).total_cmp(&value(*b))).unwrap();
        assert_eq!((correlations.len(), highest), (51, 25 + 2));
    }
    const FLIGHTS: [&str; 2] = ["first hour", "second hour"];

    fn noise(seed: usize, count: usize) -> Vec<f64> {
        (0..count).map(|at| ((at * 7919 + seed * 104_729) % 10_007) as f64 * 1.234_567e-3).collect()
    }

    fn picture(flight: &str, equation: Equation, count: usize) -> Picture {
        let columns = |seed| (0..equation.size()).map(|axis| noise(seed + axis, count)).collect();
        let time_s = (0..count).map(|at| at as f64 * 0.03).collect();
        let (measured, before, after) = (columns(1), columns(5), columns(9));
        Picture { flight: flight.to_owned(), role: Role::Test, equation, time_s, measured, before, after }
    }

    fn report() -> Report {
        let flight = |name: &str| FlightReport {
            name: name.to_owned(),
            role: Role::Test,
            compared_s: 3600.0,
            window_s: 0.12,
            equations: Vec::new(),
            assumed: Vec::new(),
            notes: Vec::new(),
        };
        Report {
            vehicle: "one.toml".to_owned(),
            flights: FLIGHTS.map(flight).to_vec(),
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
            held_out: BTreeMap::new(),
            limits: BTreeMap::new(),
            selected: BTreeMap::new(),
            fitted: BTreeMap::new(),
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

    #[test]
    fn hours_of_flight_make_a_page_that_a_browser_opens_at_once() {
        let count = 120_000;
        let equations = [
            Equation::SpecificForce,
            Equation::Acceleration,
            Equation::AngularAcceleration,
            Equation::Gyroscope,
            Equation::RotorSpeed(4),
        ];
        let of_flight = |name: &'static str| equations.map(|equation| picture(name, equation, count));
        let inputs = |_| Regressor { name: "speed", unit: "m/s", values: noise(3, count) };
        let regressors = FLIGHTS.map(|name| (name.to_owned(), (0..10).map(inputs).collect()));
        let outcome = Outcome {
            late: BTreeMap::new(),
            report: report(),
            effects: Vec::new(),
            pictures: FLIGHTS.into_iter().flat_map(of_flight).collect(),
            regressors: BTreeMap::from(regressors),
            sensor_errors: SensorErrors::default(),
            believed: None,
            questions: None,
        };
        let page = page(&outcome, None);
        assert!((4_000_000..8_000_000).contains(&page.len()), "{} bytes", page.len());
    }
}
