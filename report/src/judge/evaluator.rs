//! The evaluator: takes samples in the order of their ticks, and yields the figures of all conditions at the end.

use super::condition::{Condition, KeptSamples};
use super::figures::Figures;
use super::signals::Signals;
use super::windows::Windows;
use anyhow::anyhow;
use bus::component::Failure;
use diagnostics::Error;
use flights::state::WindowEndErrors;
use recorder::RecordingError;
use recorder::fields::TopicFields;
use runtime::manifest::Conditions;
use serde::{Deserialize, Serialize};

/// Contents of an evaluator in a checkpoint.
#[derive(Serialize, Deserialize)]
struct Kept {
    /// Conditions first, then measures.
    conditions: Vec<KeptSamples>,
    windows: Vec<WindowEndErrors>,
}

/// The first failure of a condition, from the bytes of [`Evaluator::save`].
pub fn first_failure(bytes: &[u8]) -> Option<Failure> {
    let kept: Kept = postcard::from_bytes(bytes).ok()?;
    let failures = kept.conditions.into_iter();
    let failures = failures.filter_map(|kept| Some(Failure { time_ns: kept.lost_ns?, condition: kept.name }));
    failures.min_by_key(|failure| failure.time_ns)
}

/// Conditions, measures and comparisons of a run, evaluated as samples pass.
///
/// It keeps the sums and extremes of the samples so far. Lag and gain need whole signals: their samples are kept.
///
/// ```
/// use bus::Message;
/// use bus::announcement::Announcement;
/// use bus::messages::PlantState;
/// use recorder::fields::TopicFields;
/// use report::judge::Evaluator;
/// use runtime::manifest::Conditions;
///
/// let mut conditions = Conditions::default();
/// conditions.pass.push(toml::from_str(
///     "name = 'low'\ntopic = '/plant/state'\nfield = 'position.z'\nunit = 'cm'\nstatistic = 'max'\nmax = 150.0",
/// )?);
/// let announced = Announcement::of(PlantState::SCHEMA);
/// let mut evaluator = Evaluator::new(&conditions, |topic| TopicFields::announced(topic, &announced))?;
/// let topic = evaluator.topic("/plant/state").unwrap();
/// for (tick, height) in [1.0, 1.25, 1.125].into_iter().enumerate() {
///     let state = PlantState { position: [0.0, 0.0, height].into(), ..Default::default() };
///     evaluator.take(topic, &[&[0, 1, 0, 0], bytemuck::bytes_of(&state)].concat())?;
///     evaluator.end_tick(tick as u64 * 1_000_000)?;
/// }
/// assert_eq!(evaluator.finish().pass[0].values, [125.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Default)]
pub struct Evaluator {
    signals: Signals,
    pass: Vec<Condition>,
    measures: Vec<Condition>,
    compare: Vec<Windows>,
}

impl Evaluator {
    /// The evaluator of `conditions`, before the first sample; `open` opens each topic that they need once.
    ///
    /// # Errors
    /// As `open` says.
    pub fn new(
        conditions: &Conditions,
        mut open: impl FnMut(&str) -> Result<TopicFields, RecordingError>,
    ) -> Result<Self, Error> {
        let mut signals = Signals::default();
        let mut all = |stated: &[_]| -> anyhow::Result<Vec<Condition>> {
            stated.iter().map(|pass| Condition::new(pass, &mut signals, &mut open)).collect()
        };
        let (pass, measures) = (all(&conditions.pass)?, all(&conditions.measure)?);
        let compare = conditions.compare.iter().map(|compare| Windows::new(compare, &mut signals, &mut open));
        let compare = compare.collect::<Result<_, _>>()?;
        Ok(Self { signals, pass, measures, compare })
    }

    /// Reserves memory for a run of `duration_ns` in ticks of `tick_ns`: no sample allocates, but the first of each topic.
    pub fn reserve(&mut self, duration_ns: u64, tick_ns: u64) {
        self.pass.iter_mut().chain(&mut self.measures).for_each(|one| one.reserve(duration_ns, tick_ns));
    }

    /// The number of `topic`; `None` if no condition needs it.
    #[must_use]
    pub fn topic(&self, topic: &str) -> Option<usize> {
        self.signals.number(topic)
    }

    /// Takes the sample `cdr` of topic number `topic`, sent at the tick under way.
    ///
    /// # Errors
    /// If it does not fit its definition, or lacks a field that a condition needs.
    pub fn take(&mut self, topic: usize, cdr: &[u8]) -> Result<(), RecordingError> {
        self.signals.take(topic, cdr)
    }

    /// Takes the sample `cdr` of topic number `topic`, which was sent before the ticks that follow.
    ///
    /// # Errors
    /// As [`Evaluator::take`].
    pub fn hold(&mut self, topic: usize, cdr: &[u8]) -> Result<(), RecordingError> {
        self.signals.hold(topic, cdr)
    }

    /// The samples and figures kept so far, without the newest sample of each topic.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let conditions = self.pass.iter().chain(&self.measures).map(Condition::kept).collect();
        let windows = self.compare.iter().map(Windows::kept).collect();
        let kept = Kept { conditions, windows };
        postcard::to_stdvec(&kept).unwrap_or_else(|error| unreachable!("numbers serialise: {error}"))
    }

    /// Goes on from the bytes that [`Evaluator::save`] returned for the same conditions; [`Evaluator::hold`] gives it
    /// the newest samples.
    ///
    /// # Errors
    /// If it is of other conditions.
    pub fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let kept: Kept = postcard::from_bytes(bytes).map_err(Error::new)?;
        let (conditions, windows) = (self.pass.len() + self.measures.len(), self.compare.len());
        if (kept.conditions.len(), kept.windows.len()) != (conditions, windows) {
            let other = anyhow!(
                "it holds {} conditions and measures and {} comparisons, and the manifest has {conditions} and {windows}",
                kept.conditions.len(),
                kept.windows.len()
            );
            return Err(other.into());
        }
        for (condition, kept) in self.pass.iter_mut().chain(&mut self.measures).zip(kept.conditions) {
            condition.go_on(kept)?;
        }
        self.compare.iter_mut().zip(kept.windows).for_each(|(compare, kept)| compare.go_on(kept));
        Ok(())
    }

    /// Ends the tick under way, whose simulation time is `time_ns`: all its samples were taken.
    ///
    /// # Errors
    /// If the fields or units of a condition do not fit each other.
    pub fn end_tick(&mut self, time_ns: u64) -> Result<(), Error> {
        let Self { signals, pass, measures, compare } = self;
        pass.iter_mut().chain(measures).try_for_each(|one| one.end_tick(signals, time_ns))?;
        compare.iter_mut().for_each(|one| one.end_tick(signals, time_ns));
        signals.end_tick();
        Ok(())
    }

    /// The figures of all conditions.
    #[must_use]
    pub fn finish(&self) -> Figures {
        let all = |conditions: &[Condition]| conditions.iter().map(Condition::finish).collect();
        let compare = self.compare.iter().map(Windows::finish).collect();
        Figures { pass: all(&self.pass), measures: all(&self.measures), compare }
    }
}
