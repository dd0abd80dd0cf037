//! Search for the course that separates the rivals best: each manoeuvre is flown under each hypothesis, and manoeuvres
//! are joined one after another, that which adds most for its time first.

use super::course::{BEFORE_S, Course};
use super::family::{FAMILY, Manoeuvre};
use super::flying::fly;
use super::limits::Bounds;
use anyhow::{Context as _, Result};
use hummingbus::COMPONENTS;
use hummingbus::flights::Flight;
use hummingbus::inputs::InputFiles;
use hummingbus::vehicles::Vehicle;
use identify::proposal::{Limits, SEPARATED};
use identify::{Evidence, OpenQuestions};
use runtime::event::StopToken;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use toml::Table;

/// A separation beyond this counts little more: twice what answers a question, as a real flight is not the simulated one.
const ENOUGH: f64 = 2.0 * SEPARATED;
/// Worth of a standard error beyond [`ENOUGH`].
const BEYOND: f64 = 0.02;
/// A manoeuvre comes so many times at most, at whichever levels: a flight of one manoeuvre would leave much else open.
const TIMES_MAX: usize = 2;
/// Levels at which a manoeuvre that leaves the limits is tried, each a part of the one before.
const TRIES: usize = 4;
/// Exchanges of manoeuvres at most.
pub const EXCHANGES_MAX: usize = 6;
/// Part of its size with which a manoeuvre that leaves the limits is tried again.
const EASED: f64 = 0.8;
/// A manoeuvre that adds less to a flight is left out.
const LEAST_WORTH: f64 = 1e-3;

/// Means to simulate flights.
pub struct Simulator<'a> {
    /// The open questions.
    pub questions: &'a OpenQuestions,
    /// Vehicle files of the hypotheses, as manifests name them; the first is that of the verdict.
    pub vehicles: &'a [String],
    /// The verdict's vehicle.
    pub facts: &'a Vehicle,
    /// Files that are read already, the vehicle files among them.
    pub files: &'a InputFiles,
    /// Path of the manifest, for paths in it.
    pub path: &'a Path,
    /// Ends the search.
    pub stop: &'a StopToken,
}

/// A manoeuvre that was flown under all hypotheses within the limits.
pub struct Flown {
    /// The row of the family.
    pub manoeuvre: &'static Manoeuvre,
    /// Its level.
    pub level: f64,
    /// Its segments.
    pub segments: Vec<Table>,
    /// Its length with the hover behind it, s.
    pub duration_s: f64,
    /// Evidence that it gives.
    pub evidence: Evidence,
}

impl Simulator<'_> {
    /// The same, which no stop ends: for the last flight of a search.
    pub fn unstopped<'s>(&'s self, never: &'s StopToken) -> Simulator<'s> {
        let Self { questions, vehicles, facts, files, path, .. } = *self;
        Simulator { questions, vehicles, facts, files, path, stop: never }
    }

    /// Flies `course` under each hypothesis; `None` if one of the flights leaves `bounds`, gets out of control or was stopped.
    ///
    /// # Errors
    /// If a flight cannot begin.
    pub fn fly(&self, course: &Course, bounds: &Bounds) -> Result<Option<(Vec<Flight>, Limits)>> {
        let mut flights = Vec::new();
        let mut first = None;
        for vehicle in self.vehicles {
            let manifest = course.manifest(vehicle, &self.vehicles[0], self.facts);
            let manifest = manifest.build(self.path, COMPONENTS)?;
            let flown = fly(&manifest, self.files.branch(), &self.questions.rates(), self.stop)?;
            let Some((flight, reached)) = flown.filter(|(_, reached)| bounds.hold(reached)) else {
                return Ok(None);
            };
            flights.push(flight);
            first.get_or_insert(reached);
        }
        Ok(first.map(|reached| (flights, reached)))
    }

    /// Flies every manoeuvre of the family at each of its levels on all cores; `tell` hears how many are done.
    ///
    /// # Errors
    /// If a flight cannot begin, or cannot be compared with a model.
    pub fn family(&self, bounds: &Bounds, tell: &(dyn Fn(usize, usize) + Sync)) -> Result<Vec<Flown>> {
        let rows: Vec<(&'static Manoeuvre, f64)> =
            FAMILY.iter().flat_map(|row| row.levels.iter().map(move |level| (row, *level))).collect();
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let flown = Mutex::new(Vec::new());
        let work = || {
            loop {
                let at = next.fetch_add(1, Ordering::Relaxed);
                let Some((manoeuvre, level)) = rows.get(at).filter(|_| self.stop.count() == 0) else {
                    return;
                };
                let one = self.one(manoeuvre, *level, bounds);
                let one = one.with_context(|| format!("the manoeuvre {} of the next flight", manoeuvre.name));
                flown.lock().unwrap_or_else(PoisonError::into_inner).push((at, one));
                tell(done.fetch_add(1, Ordering::Relaxed) + 1, rows.len());
            }
        };
        let cores = thread::available_parallelism().map_or(1, usize::from);
        thread::scope(|scope| (0..cores).for_each(|_| drop(scope.spawn(work))));
        let mut flown = flown.into_inner().unwrap_or_else(PoisonError::into_inner);
        // In the order of the family, whichever was done first.
        flown.sort_by_key(|(at, _)| *at);
        flown.into_iter().filter_map(|(_, one)| one.transpose()).collect()
    }

    /// The manoeuvre at `level`, or at the greatest level below at which it keeps the limits.
    fn one(&self, manoeuvre: &'static Manoeuvre, level: f64, bounds: &Bounds) -> Result<Option<Flown>> {
        let space = bounds.space(self.facts.gravity_m_s2);
        let mut level = level;
        for _ in 0..TRIES {
            let segments = (manoeuvre.segments)(&space, level);
            let course = Course::of(&space, [&segments])?;
            if let Some((flights, _)) = self.fly(&course, bounds)? {
                let evidence = self.questions.evidence(&flights)?;
                let duration_s = course.duration_s() - BEFORE_S;
                return Ok(Some(Flown { manoeuvre, level, segments, duration_s, evidence }));
            }
            level = (100.0 * EASED * level).round() / 100.0;
        }
        Ok(None)
    }
}

/// The manoeuvres that together say most within `duration_s`, by their places in `flown`; some come several times.
///
/// They are joined one after another, that which adds most for its time first; then each is exchanged for another as long as
/// that says more, up to so many `exchanges`.
pub fn combined(questions: &OpenQuestions, flown: &[Flown], duration_s: f64, exchanges: usize) -> Vec<usize> {
    let choice = Choice { questions, flown, duration_s: duration_s - BEFORE_S };
    let mut chosen = choice.joined(Vec::new());
    for _ in 0..exchanges {
        let Some(better) = choice.exchanged(&chosen) else { break };
        chosen = choice.joined(better);
    }
    chosen
}

/// A choice among manoeuvres.
struct Choice<'a> {
    questions: &'a OpenQuestions,
    flown: &'a [Flown],
    duration_s: f64,
}

impl Choice<'_> {
    /// Worth of a flight of these manoeuvres.
    fn worth(&self, chosen: &[usize]) -> f64 {
        let worth_of = |separation: f64| separation.min(ENOUGH) + BEYOND * separation;
        separations(self.questions, self.flown, chosen).into_iter().map(worth_of).sum()
    }

    /// True if these manoeuvres fit into the flight, none of them too often.
    fn fits(&self, chosen: &[usize]) -> bool {
        let length_s: f64 = chosen.iter().map(|at| self.flown[*at].duration_s).sum();
        let name = |at: &usize| self.flown[*at].manoeuvre.name;
        let times = |at: &usize| chosen.iter().filter(|other| name(other) == name(at)).count();
        length_s <= self.duration_s && chosen.iter().all(|at| times(at) <= TIMES_MAX)
    }

    /// The chosen and those that are added behind them, that which adds most for its time first.
    fn joined(&self, mut chosen: Vec<usize>) -> Vec<usize> {
        let mut now = self.worth(&chosen);
        loop {
            let with = (0..self.flown.len()).map(|at| ([&chosen[..], &[at]].concat(), at));
            let judged = with.filter(|(with, _)| self.fits(with)).map(|(with, at)| {
                let after = self.worth(&with);
                (with, after, (after - now) / self.flown[at].duration_s)
            });
            let Some((with, after, _)) = judged.max_by(|a, b| a.2.total_cmp(&b.2)) else { break };
            if after - now < LEAST_WORTH {
                break;
            }
            (chosen, now) = (with, after);
        }
        chosen
    }

    /// The chosen with one of them exchanged for another, or left out, if that says more.
    fn exchanged(&self, chosen: &[usize]) -> Option<Vec<usize>> {
        let now = self.worth(chosen);
        let places = 0..chosen.len();
        let with = |place: usize, at: Option<usize>| {
            let mut other = chosen.to_vec();
            other.splice(place..=place, at);
            other
        };
        let others = || (0..self.flown.len()).map(Some).chain([None]);
        let all = places.flat_map(|place| others().map(move |at| (place, at)));
        let judged = all.map(|(place, at)| with(place, at)).filter(|other| self.fits(other));
        let judged = judged.map(|other| (self.worth(&other), other));
        let best = judged.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best.0 > now + LEAST_WORTH).then_some(best.1)
    }
}

/// The separations of the questions by the `chosen` of `flown`.
pub fn separations(questions: &OpenQuestions, flown: &[Flown], chosen: &[usize]) -> Vec<f64> {
    let evidence: Vec<&Evidence> = chosen.iter().map(|at| &flown[*at].evidence).collect();
    questions.separations(&evidence)
}

/// The course of the `chosen`.
///
/// # Errors
/// If a segment cannot be flown.
pub fn course(bounds: &Bounds, gravity_m_s2: f64, flown: &[Flown], chosen: &[usize]) -> Result<Course> {
    Course::of(&bounds.space(gravity_m_s2), chosen.iter().map(|at| &flown[*at].segments))
}
