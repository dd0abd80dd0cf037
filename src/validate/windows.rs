//! Errors at the ends of windows: the simulated states of a recording against the measured ones.
//!
//! Position and velocity are compared in the world, rates in the body, each by the length of the difference; attitudes
//! by the angle of the rotation between them.

use super::HORIZONS_MS;
use super::errors::{ChannelErrors, FlightErrors, HorizonErrors};
use super::replay::{MEASURED, Replay, plant};
use anyhow::Result;
use flights::{Channel, Flight};
use recorder::reader::Recording;
use recorder::series::Series;

/// A time without samples that is longer than this many periods of a channel is a gap.
const GAP_PERIODS: f64 = 5.0;

/// Windows that begin earlier do not count: the rotors' speeds at the start of a flight are not known, and take so
/// long to follow the commands.
const SETTLE_NS: u64 = 500_000_000;

/// Fields of a state, simulated or measured: what [`Quantity::error`] reads.
const FIELDS: [&str; 13] = [
    "position.x",
    "position.y",
    "position.z",
    "velocity.x",
    "velocity.y",
    "velocity.z",
    "attitude.x",
    "attitude.y",
    "attitude.z",
    "attitude.w",
    "angular_velocity.x",
    "angular_velocity.y",
    "angular_velocity.z",
];

/// The values of [`FIELDS`].
type State = [f64; FIELDS.len()];

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Position in the world.
    Position,
    /// Velocity in the world.
    Velocity,
    /// Attitude, as the angle of the rotation between two.
    Attitude,
    /// Angular velocity in the body.
    Rates,
}

impl Quantity {
    /// All, in the order of reports.
    pub const ALL: [Self; 4] = [Self::Position, Self::Velocity, Self::Attitude, Self::Rates];

    /// The name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Attitude => "attitude",
            Self::Rates => "rates",
        }
    }

    /// The unit of its errors.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position => "m",
            Self::Velocity => "m/s",
            Self::Attitude => "deg",
            Self::Rates => "rad/s",
        }
    }

    /// Whether `flight` tells of it, by a measurement or by the change of one; an assumption tells nothing.
    #[must_use]
    pub fn is_measured(self, flight: &Flight) -> bool {
        let is_attitude_measured = flight.assumed.is_empty() && !flight.attitude.is_empty();
        match self {
            Self::Position => !flight.position.is_empty(),
            Self::Velocity => !flight.velocity.is_empty() || !flight.position.is_empty(),
            Self::Attitude => is_attitude_measured,
            Self::Rates => {
                !flight.angular_velocity.is_empty() && flight.assumed.is_empty() || is_attitude_measured
            }
        }
    }

    /// How far `simulated` is from `measured`, in the unit of this quantity.
    fn error(self, simulated: &State, measured: &State) -> f64 {
        let distance = |from: usize| {
            (from..from + 3).map(|field| (simulated[field] - measured[field]).powi(2)).sum::<f64>().sqrt()
        };
        match self {
            Self::Position => distance(0),
            Self::Velocity => distance(3),
            Self::Attitude => {
                let dot: f64 = (6..10).map(|field| simulated[field] * measured[field]).sum();
                // `clamp` keeps NaN, where `min` would make it a perfect match.
                (2.0 * libm::acos(dot.abs().clamp(0.0, 1.0))).to_degrees()
            }
            Self::Rates => distance(10),
        }
    }
}

/// The errors of the flown `replay` of `flight` with `vehicles` vehicles, in its `recording`.
///
/// # Errors
/// A recording that cannot be read.
pub fn flight_errors(
    flight: &Flight,
    replay: &Replay,
    recording: &Recording,
    vehicles: usize,
) -> Result<FlightErrors> {
    let plants = HORIZONS_MS.map(|horizon_ms| (0..vehicles).map(move |vehicle| plant(vehicle, horizon_ms)));
    let simulated = plants.into_iter().flatten().map(|plant| format!("/{plant}/state"));
    let topics: Vec<String> = std::iter::once(MEASURED.to_owned()).chain(simulated).collect();
    let tracks = tracks(recording, &topics)?;
    let Some((measured, simulated)) = tracks.split_first() else { anyhow::bail!("nothing was recorded") };
    let horizons = HORIZONS_MS
        .into_iter()
        .zip(simulated.chunks(vehicles))
        .map(|(horizon_ms, tracks)| horizon_errors(flight, replay, horizon_ms, measured, tracks));
    Ok(FlightErrors { name: flight.name.clone(), role: flight.role, horizons: horizons.collect() })
}

/// The states of one topic over time.
struct Track {
    time_ns: Vec<u64>,
    fields: Vec<Series>,
}

impl Track {
    fn at(&self, time_ns: u64) -> Option<State> {
        let index = self.time_ns.binary_search(&time_ns).ok()?;
        Some(std::array::from_fn(|field| self.fields[field].value[index]))
    }
}

/// The states of all `topics`, read in one pass.
fn tracks(recording: &Recording, topics: &[String]) -> Result<Vec<Track>> {
    let wanted: Vec<(&str, &str)> =
        topics.iter().flat_map(|topic| FIELDS.map(|field| (topic.as_str(), field))).collect();
    let mut series = recording.series(&wanted)?.into_iter();
    let track = |_| {
        let fields: Vec<Series> = series.by_ref().take(FIELDS.len()).collect();
        Track { time_ns: fields[0].time_ns.clone(), fields }
    };
    Ok(topics.iter().map(track).collect())
}

fn horizon_errors(
    flight: &Flight,
    replay: &Replay,
    horizon_ms: u32,
    measured: &Track,
    simulated: &[Track],
) -> HorizonErrors {
    let gaps = gaps(flight);
    let window_ns = u64::from(horizon_ms) * 1_000_000;
    let last_ns = measured.time_ns.last().copied().unwrap_or(0);
    let ends: Vec<u64> = (1..=last_ns / window_ns).map(|number| number * window_ns).collect();
    let is_whole = |end_ns: u64| {
        let begin_ns = end_ns - window_ns;
        let (from_s, to_s) =
            (replay.start_s() + begin_ns as f64 * 1e-9, replay.start_s() + end_ns as f64 * 1e-9);
        // Of the gaps that begin before the window's end, the one that ends last.
        let begun = gaps.partition_point(|gap| gap.0 < to_s);
        begin_ns >= SETTLE_NS && !begun.checked_sub(1).is_some_and(|last| from_s < gaps[last].1)
    };
    let counted: Vec<u64> = ends.iter().copied().filter(|end_ns| is_whole(*end_ns)).collect();
    let rms = |quantity: Quantity, track: &Track| {
        let errors = counted
            .iter()
            .filter_map(|end_ns| Some(quantity.error(&track.at(*end_ns)?, &measured.at(*end_ns)?)));
        root_mean_square(errors)
    };
    let channel = |quantity: Quantity| ChannelErrors {
        quantity,
        rms: simulated.iter().map(|track| rms(quantity, track)).collect(),
    };
    let quantities = Quantity::ALL.into_iter().filter(|quantity| quantity.is_measured(flight));
    HorizonErrors {
        horizon_ms,
        windows: counted.len(),
        left_out: ends.len() - counted.len(),
        channels: quantities.map(channel).collect(),
    }
}

/// NaN of nothing.
fn root_mean_square(errors: impl Iterator<Item = f64>) -> f64 {
    let (squares, count) =
        errors.fold((0.0, 0.0), |(squares, count), error| (squares + error * error, count + 1.0));
    (squares / count).sqrt()
}

/// The gaps of all measured channels of the state, in seconds of the flight, by when they begin; each with the end of the
/// longest so far, as there can be as many as rows.
fn gaps(flight: &Flight) -> Vec<(f64, f64)> {
    let attitude = if flight.assumed.is_empty() { channel_gaps(&flight.attitude) } else { Vec::new() };
    let mut gaps = [
        channel_gaps(&flight.position),
        channel_gaps(&flight.velocity),
        attitude,
        channel_gaps(&flight.angular_velocity),
    ]
    .concat();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut last_s = f64::NEG_INFINITY;
    for gap in &mut gaps {
        last_s = last_s.max(gap.1);
        gap.1 = last_s;
    }
    gaps
}

fn channel_gaps<const N: usize>(channel: &Channel<N>) -> Vec<(f64, f64)> {
    let Some(period_s) = channel.period_s() else { return Vec::new() };
    let is_gap = |pair: &&[f64]| pair[1] - pair[0] > GAP_PERIODS * period_s;
    channel.time_s.windows(2).filter(is_gap).map(|pair| (pair[0], pair[1])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> State {
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    }

    #[test]
    fn errors_are_lengths_and_angles() {
        let mut other = state();
        (other[0], other[1], other[5], other[10]) = (0.3, 0.4, -2.0, 0.1);
        // A turn by 60 degrees about z, with the other sign of its quaternion.
        (other[8], other[9]) = (-0.5, -(0.75_f64.sqrt()));
        let found = Quantity::ALL.map(|quantity| quantity.error(&other, &state()));
        for (found, expected) in found.into_iter().zip([0.5, 2.0, 60.0, 0.1]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        other[6] = f64::NAN;
        assert!(Quantity::Attitude.error(&other, &state()).is_nan());
    }

    #[test]
    fn a_gap_is_a_long_time_without_samples() {
        let mut channel =
            Channel::<3> { time_s: (0..100).map(|n| f64::from(n) * 0.01).collect(), values: Vec::new() };
        assert_eq!(channel_gaps(&channel), []);
        channel.time_s.retain(|time_s| !(0.4..0.455).contains(time_s));
        assert_eq!(channel_gaps(&channel).len(), 1);
    }

    #[test]
    fn the_root_of_the_mean_square() {
        assert_eq!(root_mean_square([3.0, 4.0, 5.0, 0.0, 0.0].into_iter()), 10.0_f64.sqrt());
        assert!(root_mean_square(std::iter::empty()).is_nan());
    }
}
