//! Search for the course that separates the rivals best: each manoeuvre is flown under each hypothesis, and manoeuvres
//! are joined one after another, that which adds most for its time first.

use super::course::Course;
use super::family::{FAMILY, Manoeuvre};
use super::flying::fly;
use super::limits::Bounds;
use anyhow::Result;
use hummingbus::COMPONENTS;
use hummingbus::flights::Flight;
use hummingbus::inputs::InputFiles;
use hummingbus::vehicles::Vehicle;
use identify::proposal::{Limits, SEPARATED};
use identify::{Evidence, OpenQuestions};
use runtime::event::StopToken;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use toml::Table;

/// A separation beyond this counts little more: twice what answers a question, as a real flight is not the simulated one.
const ENOUGH: f64 = 2.0 * SEPARATED;
/// Worth of a standard error beyond [`ENOUGH`].
const BEYOND: f64 = 0.02;
/// A manoeuvre that adds less to a flight is left out.
const LEAST_WORTH: f64 = 1e-3;

/// What flights are simulated with.
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
    /// Flies `course` under each hypothesis; `None` if one of the flights leaves `bounds`, cannot be flown or was stopped.
    pub fn fly(&self, course: &Course, bounds: &Bounds) -> Option<(Vec<Flight>, Limits)> {
        let mut flights = Vec::new();
        let mut first = None;
        for vehicle in self.vehicles {
            let manifest = course.manifest(vehicle, &self.vehicles[0], self.facts);
            let manifest = manifest.build(self.path, COMPONENTS).ok()?;
            // A vehicle that gets out of control is not a candidate's.
            let (flight, reached) =
                fly(&manifest, self.files.branch(), &self.questions.rates(), self.stop).ok()?;
            if !bounds.hold(&reached) {
                return None;
            }
            flights.push(flight);
            first.get_or_insert(reached);
        }
        Some((flights, first?))
    }

    /// Flies every manoeuvre of the family at each of its levels on all cores; `tell` hears how many are done.
    pub fn family(&self, bounds: &Bounds, tell: &(dyn Fn(usize, usize) + Sync)) -> Vec<Flown> {
        let rows: Vec<(&'static Manoeuvre, f64)> =
            FAMILY.iter().flat_map(|row| row.levels.iter().map(move |level| (row, *level))).collect();
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let flown = Mutex::new(Vec::new());
        let work = || {
            while let Some((manoeuvre, level)) = rows.get(next.fetch_add(1, Ordering::Relaxed)) {
                let at = next.load(Ordering::Relaxed);
                if self.stop.count() > 0 {
                    return;
                }
                if let Some(one) = self.one(manoeuvre, *level, bounds) {
                    flown.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push((at, one));
                }
                tell(done.fetch_add(1, Ordering::Relaxed) + 1, rows.len());
            }
        };
        let cores = thread::available_parallelism().map_or(1, usize::from);
        thread::scope(|scope| (0..cores).for_each(|_| drop(scope.spawn(work))));
        let mut flown = flown.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        // In the order of the family, whichever was done first.
        flown.sort_by_key(|(_, one)| {
            rows.iter().position(|(row, level)| row.name == one.manoeuvre.name && *level == one.level)
        });
        flown.into_iter().map(|(_, one)| one).collect()
    }

    fn one(&self, manoeuvre: &'static Manoeuvre, level: f64, bounds: &Bounds) -> Option<Flown> {
        let space = bounds.space(self.facts.gravity_m_s2);
        let segments = (manoeuvre.segments)(&space, level);
        let course = Course::of(&space, [&segments]).ok()?;
        let (flights, _) = self.fly(&course, bounds)?;
        let evidence = self.questions.evidence(&flights).ok()?;
        let [before_s, after_s] = course.parts_s.first().map(|(from_s, _)| [*from_s, course.duration_s()])?;
        Some(Flown { manoeuvre, level, segments, duration_s: after_s - before_s, evidence })
    }
}

/// The manoeuvres that together say most within `duration_s`, by their places in `flown`; some come several times.
pub fn combined(questions: &OpenQuestions, flown: &[Flown], duration_s: f64) -> Vec<usize> {
    let worth = |chosen: &[usize]| {
        let evidence: Vec<&Evidence> = chosen.iter().map(|at| &flown[*at].evidence).collect();
        let worth_of = |separation: f64| separation.min(ENOUGH) + BEYOND * separation;
        questions.separations(&evidence).into_iter().map(worth_of).sum::<f64>()
    };
    let (mut chosen, mut left_s) = (Vec::new(), duration_s - BEFORE_S);
    let mut now = worth(&chosen);
    loop {
        let gain = |at: usize| {
            let with = [&chosen[..], &[at]].concat();
            let after = worth(&with);
            (at, after, (after - now) / flown[at].duration_s)
        };
        let fitting = (0..flown.len()).filter(|at| flown[*at].duration_s <= left_s).map(gain);
        let Some((at, after, _)) = fitting.max_by(|a, b| a.2.total_cmp(&b.2)) else { break };
        if after - now < LEAST_WORTH {
            break;
        }
        left_s -= flown[at].duration_s;
        (chosen, now) = ([&chosen[..], &[at]].concat(), after);
    }
    chosen
}

/// Hover at the begin of a course, s.
const BEFORE_S: f64 = 1.0;

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
