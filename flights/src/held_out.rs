//! Check that flights are held out. None with role `test` holds samples that parameters are fitted or effects
//! are chosen on. None with role `select` holds samples that parameters are fitted on. The log with the time,
//! or the samples themselves, show it.

use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

use crate::flight::{Channel, Flight};
use crate::quantity::Quantity;
use crate::reading::Part;
use crate::twin::{Comparison, Twin, twin};

/// A sample on the edge of two parts belongs to both.
const EDGE_S: f64 = 1e-5;

/// Two flights that hold the same.
#[derive(Debug)]
pub struct Clash {
    /// The index of the flight that is used first: with role `fit` or `select`.
    pub used: usize,
    /// The index of the flight that is to be held out from it: with role `select` or `test`.
    pub held_out: usize,
    /// Relation of the two, as text.
    pub reason: String,
}

/// The flights that are not held out, each with the first flight that it is not held out from; `parts` are the parts
/// of the logs that the flights are, and `sha256` gives the SHA-256 of a log as it was read.
pub fn clashes(flights: &[Flight], parts: &[Part], sha256: impl Fn(&Path) -> Option<String>) -> Vec<Clash> {
    let clash = |used: usize, held_out: usize| {
        let pair = [used, held_out].map(|index| (&flights[index], &parts[index]));
        let reason = match shared(pair.map(|(flight, _)| flight), &sha256) {
            Some(shared) => same_part(pair, &shared),
            None => same_samples(pair),
        };
        reason.map(|reason| Clash { used, held_out, reason })
    };
    let all = 0..flights.len();
    let before =
        |held_out: usize| all.clone().filter(move |used| flights[*used].role < flights[held_out].role);
    let first = |held_out| before(held_out).find_map(|used| clash(used, held_out));
    all.clone().filter_map(first).collect()
}

/// A file that two flights have in common: its paths, and how they are the same.
struct Shared<'a> {
    files: [&'a Path; 2],
    how: &'static str,
}

fn shared<'a>(pair: [&'a Flight; 2], sha256: impl Fn(&Path) -> Option<String>) -> Option<Shared<'a>> {
    let [fit, test] = pair;
    let pairs = fit.files().flat_map(|a| test.files().map(move |b| [a, b]));
    pairs.into_iter().find_map(|[a, b]| {
        let how = same_file(a, b, || sha256(a) == sha256(b))?;
        Some(Shared { files: [a, b], how })
    })
}

/// Returns the time that both, of one log, have in common, as text. Their samples need not be compared then: a
/// course that comes round has the same ones again.
fn same_part([(_, fit_part), (_, test_part)]: [(&Flight, &Part); 2], shared: &Shared<'_>) -> Option<String> {
    // On the log's own clock: the first samples of two choices of channels, and of parts of a log, can be others.
    let begin_s = |part: &Part| part.clock_s + part.origin_s;
    let span = |part: &Part| (begin_s(part) + part.from_s, begin_s(part) + part.to_s);
    let (a, b) = (span(fit_part), span(test_part));
    let (from_s, to_s) = (a.0.max(b.0), a.1.min(b.1));
    (to_s - from_s > EDGE_S).then(|| {
        format!(
            "{} and {} are {}; of its time, one has {:.3} s to {:.3} s, the other {:.3} s to {:.3} s, and both have {:.3} s to \
             {:.3} s",
            shared.files[0].display(),
            shared.files[1].display(),
            shared.how,
            fit_part.from_s,
            fit_part.to_s,
            test_part.from_s,
            test_part.to_s,
            from_s - begin_s(fit_part),
            to_s - begin_s(fit_part),
        )
    })
}

/// Returns as text how two paths lead to one file, or, by `have_same_bytes`, to copies of the same bytes;
/// `None` if they do not.
///
/// ```
/// let (here, there) = ("Cargo.toml".as_ref(), "src/../Cargo.toml".as_ref());
/// assert_eq!(flights::same_file(here, there, || false), Some("the same file"));
/// let (one, copy) = ("Cargo.toml".as_ref(), "src/lib.rs".as_ref());
/// assert_eq!(flights::same_file(one, copy, || true), Some("copies of the same bytes"));
/// ```
#[must_use]
pub fn same_file(a: &Path, b: &Path, have_same_bytes: impl FnOnce() -> bool) -> Option<&'static str> {
    let (of_a, of_b) = (std::fs::metadata(a).ok(), std::fs::metadata(b).ok());
    let (Some(of_a), Some(of_b)) = (of_a, of_b) else { return (a == b).then_some("the same file") };
    if (of_a.dev(), of_a.ino()) == (of_b.dev(), of_b.ino()) {
        return Some("the same file");
    }
    have_same_bytes().then_some("copies of the same bytes")
}

/// Returns as text the measurements of the fit flight that the test flight holds, in any files. Each channel of
/// motion that both have, and that is conclusive, has to agree: commands can be the same in two flights.
/// Quaternions are normalised, so their rounding is not seen: if they do not agree, others may still do so.
fn same_samples([(fit, fit_part), (test, test_part)]: [(&Flight, &Part); 2]) -> Option<String> {
    let channels: [(Quantity, &dyn Fn() -> Comparison); 5] = [
        (Quantity::AngularVelocity, &|| twin(&fit.angular_velocity, &test.angular_velocity)),
        (Quantity::SpecificForce, &|| twin(&fit.specific_force, &test.specific_force)),
        (Quantity::Position, &|| twin(&fit.position, &test.position)),
        (Quantity::Attitude, &|| twin(&one_sign(&fit.attitude), &one_sign(&test.attitude))),
        (Quantity::Velocity, &|| twin(&fit.velocity, &test.velocity)),
    ];
    let mut found: Option<(Quantity, Twin)> = None;
    for (quantity, compare) in channels {
        match compare() {
            Comparison::Other if quantity != Quantity::Attitude => return None,
            Comparison::Same(twin) => found = found.or(Some((quantity, twin))),
            Comparison::Other | Comparison::Unknown => {}
        }
    }
    let (quantity, Twin { same, compared, in_first_s, in_second_s }) = found?;
    Some(format!(
        "{same} of {compared} samples of `{quantity}` in {} from {:.3} s to {:.3} s are those in {} from {:.3} s to {:.3} s, \
         so that one is a copy or a part of the other, or both are simulated without noise on the same course",
        test.file.display(),
        test_part.start_s + in_second_s.0,
        test_part.start_s + in_second_s.1,
        fit.file.display(),
        fit_part.start_s + in_first_s.0,
        fit_part.start_s + in_first_s.1,
    ))
}

/// Quaternions with their largest part positive: which of the two signs a flight has depends on where it begins.
fn one_sign(attitude: &Channel<4>) -> Channel<4> {
    let turned = |q: &[f64; 4]| {
        let largest = q.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
        q.map(|part| part * largest.signum())
    };
    Channel { time_s: attitude.time_s.clone(), values: attitude.values.iter().map(turned).collect() }
}
