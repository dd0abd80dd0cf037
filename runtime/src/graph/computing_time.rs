//! Computing times: the time of a process's steps, from its manifest or from measurements.

use super::processes::DeclaredNode;
use crate::manifest::ComputingTimeSetting;
use bus::computing_time::ComputingTime;
use diagnostics::Diagnostic;
use diagnostics::parameter::{ParameterError, not_negative, positive, require};
use inputs::InputFiles;
use serde_json::Value;
use std::path::Path;
use toml::Spanned;

/// A longer time is not that of a loop's step: more likely µs were written for ms.
const MS_MAX: f64 = 1e5;
/// With more measured times than these no run draws all of them.
const TIMES_MAX: usize = 100_000;
/// The fractions of a profile's quantiles, with their keys. Shorter times than the median are not in a profile: half of
/// the steps take the median.
const QUANTILES: [(f64, &str); 6] = [
    (0.0, "p50_us"),
    (0.5, "p50_us"),
    (0.9, "p90_us"),
    (0.99, "p99_us"),
    (0.999, "p99.9_us"),
    (1.0, "max_us"),
];

/// Computing time of the steps of `declared`, if its manifest states it.
///
/// # Errors
/// An invalid time, or a file without any times.
pub fn of(declared: &DeclaredNode<'_>) -> Result<Option<ComputingTime>, Diagnostic> {
    let DeclaredNode { manifest, files, name, process, .. } = declared;
    let Some(setting) = &process.computing_time else { return Ok(None) };
    let who = format!("`computing_time` of `{}`", name.get_ref());
    let refused = |reason: ParameterError| {
        let help = "distribution = \"constant\" with ms, \"uniform\" with min_ms and max_ms, \"lognormal\" with median_ms \
                    and sigma, or \"measured\" with file";
        manifest.problem(&setting.span(), format!("{who}: {reason}"), help)
    };
    if let ComputingTimeSetting::Measured { file, process, scale } = setting.get_ref() {
        let path = manifest.resolve(&Spanned::new(setting.span(), file.clone()))?;
        let process = process.as_deref().unwrap_or(name.get_ref());
        let time = measured(files, &path, process, scale.unwrap_or(1.0));
        return time.map(Some).map_err(refused);
    }
    stated(setting.get_ref()).map(Some).map_err(refused)
}

/// A distribution that the manifest itself holds.
fn stated(setting: &ComputingTimeSetting) -> Result<ComputingTime, ParameterError> {
    let us = |key: &str, ms: f64| {
        let is_good = (0.0..=MS_MAX).contains(&ms);
        require(key, ms, is_good, format!("from 0 to {MS_MAX} ms")).map(|()| ms * 1e3)
    };
    Ok(match setting {
        ComputingTimeSetting::Constant { ms } => ComputingTime::Constant { us: us("ms", *ms)? },
        ComputingTimeSetting::Uniform { min_ms, max_ms } => {
            require("max_ms", max_ms, max_ms >= min_ms, format!("at least `min_ms`, {min_ms}"))?;
            ComputingTime::Uniform { min_us: us("min_ms", *min_ms)?, max_us: us("max_ms", *max_ms)? }
        }
        ComputingTimeSetting::Lognormal { median_ms, sigma } => {
            not_negative("sigma", *sigma)?;
            require("sigma", sigma, *sigma <= 3.0, "at most 3: one step of 700 would take 10 000 medians")?;
            ComputingTime::Lognormal { median_us: us("median_ms", *median_ms)?, sigma: *sigma }
        }
        ComputingTimeSetting::Measured { .. } => unreachable!("it is read from a file"),
    })
}

/// The distribution in the file at `path`: that of `process` in a profile, or a list of times.
fn measured(
    files: &InputFiles,
    path: &Path,
    process: &str,
    scale: f64,
) -> Result<ComputingTime, ParameterError> {
    positive("scale", scale)?;
    let at = |reason: String| ParameterError::conflict("file", format!("{}: {reason}", path.display()));
    let text = files.text(path).map_err(|error| at(error.to_string()))?;
    let mut points = match serde_json::from_str::<Value>(&text) {
        Ok(Value::Object(report)) => quantiles(&report.into(), process).map_err(at)?,
        Ok(Value::Array(times)) => evenly(times.iter().map(Value::as_f64)).map_err(at)?,
        _ => evenly(text.split_whitespace().map(|word| word.parse().ok())).map_err(at)?,
    };
    points.iter_mut().for_each(|[_, us]| *us *= scale);
    let longest_ms = points.last().map_or(0.0, |[_, us]| us * 1e-3);
    require("scale", scale, longest_ms <= MS_MAX, format!("a longest time of at most {MS_MAX} ms"))?;
    Ok(ComputingTime::Measured { fraction_us: points })
}

/// The quantiles of the computing time of `process` in the output of `hummingbus profile --json`.
fn quantiles(report: &Value, process: &str) -> Result<Vec<[f64; 2]>, String> {
    let nodes = report.pointer("/profile/nodes").and_then(Value::as_array);
    let nodes = nodes.ok_or("it holds no profile: print one with `hummingbus profile MANIFEST --json`")?;
    let names = || nodes.iter().filter_map(|node| node["name"].as_str());
    let node = nodes.iter().find(|node| node["name"] == process).ok_or_else(|| {
        let known: Vec<&str> = names().collect();
        format!("it holds no process `{process}`; name one with `process`: {}", known.join(", "))
    })?;
    let point = |&(fraction, key): &(f64, &str)| {
        let us = node["compute"][key].as_f64().filter(|us| *us >= 0.0);
        us.map(|us| [fraction, us]).ok_or_else(|| format!("the computing time of `{process}` has no {key}"))
    };
    QUANTILES.iter().map(point).collect()
}

/// The distribution of a list of times in µs: each as likely as the others, with straight lines between them.
fn evenly(times: impl Iterator<Item = Option<f64>>) -> Result<Vec<[f64; 2]>, String> {
    let time = |(index, us): (usize, Option<f64>)| {
        let us = us.filter(|us| us.is_finite() && *us >= 0.0);
        us.ok_or_else(|| format!("value {} is no time in µs", index + 1))
    };
    let mut times = times.enumerate().take(TIMES_MAX + 1).map(time).collect::<Result<Vec<f64>, _>>()?;
    if times.is_empty() || times.len() > TIMES_MAX {
        return Err(format!("expected 1 to {TIMES_MAX} times in µs, found {}", times.len()));
    }
    times.sort_unstable_by(f64::total_cmp);
    let steps = (times.len() - 1).max(1) as f64;
    Ok(times.into_iter().enumerate().map(|(index, us)| [index as f64 / steps, us]).collect())
}

#[cfg(test)]
mod tests {
    use super::{evenly, quantiles};
    use serde_json::json;

    #[test]
    fn a_list_becomes_its_distribution() {
        let list = |text: &str| evenly(text.split_whitespace().map(|word| word.parse().ok()));
        assert_eq!(list("30 10\n20").unwrap(), [[0.0, 10.0], [0.5, 20.0], [1.0, 30.0]]);
        assert_eq!(list("30").unwrap(), [[0.0, 30.0]]);
        assert_eq!(list("30 -1").unwrap_err(), "value 2 is no time in µs");
        assert!(list("").unwrap_err().starts_with("expected 1 to"));
    }

    #[test]
    fn a_profile_gives_quantiles_of_the_process_that_is_named() {
        let compute = json!({ "p50_us": 1.0, "p90_us": 2.0, "p99_us": 3.0, "p99.9_us": 4.0, "max_us": 5.0 });
        let report = json!({ "profile": { "nodes": [{ "name": "controller", "compute": compute }] } });
        let points = quantiles(&report, "controller").unwrap();
        assert_eq!((points[0], points[1], points[5]), ([0.0, 1.0], [0.5, 1.0], [1.0, 5.0]));
        assert!(quantiles(&report, "pilot").unwrap_err().contains("`process`: controller"));
        assert!(quantiles(&json!({}), "pilot").unwrap_err().contains("holds no profile"));
    }
}
