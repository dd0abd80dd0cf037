//! Errors at the ends of windows: the simulated states of a recording against the measured ones.

use super::errors::{ChannelErrors, FlightErrors, HorizonErrors};
use super::replay::{HORIZONS_MS, MEASURED, Replay, plant};
use crate::states::{FIELDS_OF_STATE, Track, tracks};
use anyhow::Result;
use flights::state::{StateQuantity, WindowEndErrors};
use flights::{Channel, Flight};
use recorder::reader::Recording;

/// A time without samples that is longer than this many periods of a channel is a gap.
const GAP_PERIODS: f64 = 5.0;

/// Windows that begin earlier do not count: the rotors' speeds at the start of a flight are not known, and take so
/// long to follow the commands.
const SETTLE_NS: u64 = 500_000_000;

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
    let state = |vehicle, horizon_ms| format!("/{}/state", plant(vehicle, horizon_ms));
    let simulated = HORIZONS_MS
        .into_iter()
        .flat_map(|horizon_ms| (0..vehicles).map(move |number| state(number, horizon_ms)));
    let topics: Vec<String> = std::iter::once(MEASURED.to_owned()).chain(simulated).collect();
    let tracks = tracks(recording, &topics, FIELDS_OF_STATE)?;
    let Some((measured, simulated)) = tracks.split_first() else { anyhow::bail!("nothing was recorded") };
    let horizons = HORIZONS_MS
        .into_iter()
        .zip(simulated.chunks(vehicles))
        .map(|(horizon_ms, tracks)| horizon_errors(flight, replay, horizon_ms, measured, tracks));
    Ok(FlightErrors { name: flight.name.clone(), role: flight.role, horizons: horizons.collect() })
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
    let last_ns = measured.time_ns().last().copied().unwrap_or(0);
    let ends: Vec<u64> = (1..=last_ns / window_ns).map(|number| number * window_ns).collect();
    let is_whole = |end_ns: u64| {
        let begin_ns = end_ns - window_ns;
        let [from_s, to_s] = [begin_ns, end_ns].map(|ns| replay.start_s + ns as f64 * 1e-9);
        // Of the gaps that begin before the window's end, the one that ends last.
        let begun = gaps.partition_point(|gap| gap.0 < to_s);
        begin_ns >= SETTLE_NS && !begun.checked_sub(1).is_some_and(|last| from_s < gaps[last].1)
    };
    let counted: Vec<u64> = ends.iter().copied().filter(|end_ns| is_whole(*end_ns)).collect();
    let errors = simulated.iter().map(|track| track.errors(measured, counted.iter().copied()));
    let errors: Vec<WindowEndErrors> = errors.collect();
    let channel = |quantity: StateQuantity| ChannelErrors {
        quantity,
        rms: errors.iter().map(|errors| errors.rms(quantity)).collect(),
    };
    let quantities = StateQuantity::ALL.into_iter().filter(|quantity| quantity.is_measured(flight));
    HorizonErrors {
        horizon_ms,
        windows: counted.len(),
        left_out: ends.len() - counted.len(),
        channels: quantities.map(channel).collect(),
    }
}

/// The gaps of all measured channels of the state, in seconds of the flight, by when they begin; each with the end of the
/// longest so far, as there can be as many as rows.
fn gaps(flight: &Flight) -> Vec<(f64, f64)> {
    let mut gaps = [&flight.position, &flight.velocity, &flight.angular_velocity].map(channel_gaps).concat();
    if flight.assumed.is_empty() {
        gaps.extend(channel_gaps(&flight.attitude));
    }
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

    #[test]
    fn a_gap_is_a_long_time_without_samples() {
        let mut channel =
            Channel::<3> { time_s: (0..100).map(|n| f64::from(n) * 0.01).collect(), values: Vec::new() };
        assert_eq!(channel_gaps(&channel), []);
        channel.time_s.retain(|time_s| !(0.4..0.455).contains(time_s));
        assert_eq!(channel_gaps(&channel).len(), 1);
    }
}
