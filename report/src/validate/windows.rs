//! Errors at the ends of windows: the simulated states of a recording against the measured ones.

use super::errors::{ChannelErrors, FlightErrors, HorizonErrors};
use super::replay::{HORIZONS_MS, MEASURED, Replay, plant};
use crate::states::{FIELDS_OF_STATE, Track, tracks};
use anyhow::Result;
use flights::Flight;
use flights::state::{StateQuantity, WindowEndErrors};
use recorder::reader::Recording;

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
    let window_ns = u64::from(horizon_ms) * 1_000_000;
    let last_ns = measured.time_ns().last().copied().unwrap_or(0);
    let ends: Vec<u64> = (1..=last_ns / window_ns).map(|number| number * window_ns).collect();
    let (start_s, _) = replay.played.span_s();
    let counts = |end_ns: u64| {
        let [from_s, to_s] = [end_ns - window_ns, end_ns].map(|ns| start_s + ns as f64 * 1e-9);
        replay.played.counts(from_s, to_s)
    };
    let counted: Vec<u64> = ends.iter().copied().filter(|end_ns| counts(*end_ns)).collect();
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
