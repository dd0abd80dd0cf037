//! The stored recordings of sticks: written by the random pilot, like a hand, and flown by the cascade.

use crate::flight;
use crate::random_pilot;
use controllers::cascade::CascadeLaw;
use controllers::cascade_gains::CascadeGains;
use controllers::set_points::SetPoint;
use controllers::sticks::Sticks;
use flight::{Loop, NOISY, PERIOD_S, Senses, believed};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Channel and seed.
const STORED: [(&str, u64); 2] = [("roll", 1), ("pitch", 2)];

fn path(channel: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../manifests/sticks").join(format!("{channel}.csv"))
}

fn stored(channel: &str) -> Sticks {
    Sticks::load(&inputs::InputFiles::default(), &path(channel)).unwrap()
}

fn stick_deg(sticks: &Sticks, channel: &str, time_s: f64) -> f64 {
    let asked = sticks.at(time_s, &SetPoint::default());
    if channel == "roll" { asked.roll_rad.to_degrees() } else { asked.pitch_rad.to_degrees() }
}

#[test]
fn the_random_pilot_writes_the_stored_recordings_anew_byte_for_byte() {
    for (channel, seed) in STORED {
        let text = std::fs::read_to_string(path(channel)).unwrap();
        assert!(random_pilot::recording(channel, seed) == text, "manifests/sticks/{channel}.csv");
        assert!(random_pilot::recording(channel, seed + 10) != text);
    }
}

#[test]
fn a_recording_moves_like_a_hand_within_the_sticks_range_and_rests_at_its_ends() {
    for (channel, _) in STORED {
        let sticks = stored(channel);
        let values: Vec<f64> =
            (0..=1500).map(|row| stick_deg(&sticks, channel, f64::from(row) * 0.02)).collect();
        let size = |limit: f64| values.iter().filter(|value| value.abs() > limit).count();
        assert_eq!(size(30.0), 0);
        assert!(size(20.0) < values.len() / 10, "{} of {} beyond 20 deg", size(20.0), values.len());
        assert!(size(5.0) > values.len() / 4, "{} of {} beyond 5 deg", size(5.0), values.len());
        let quickest = values.windows(2).map(|pair| (pair[1] - pair[0]).abs() / 0.02).fold(0.0, f64::max);
        assert!(quickest < 300.0, "{quickest} deg/s");
        assert!(values[..50].iter().chain(&values[1475..]).all(|value| value.abs() < 2.0));
    }
}

/// Free flight: the angle follows the stick with the loop's lag.
#[test]
fn the_cascade_follows_the_recordings() {
    let law = CascadeLaw {
        gains: CascadeGains::default(),
        vehicle: believed().hover_model(),
        period_s: PERIOD_S,
        attitude_every_steps: 1,
    };
    for (channel, _) in STORED {
        let sticks = stored(channel);
        let no_walls = [f64::INFINITY; 4];
        let mut flight = Loop::new(Vector3::new(0.0, 0.0, 1.5), Senses::new(1, no_walls, NOISY));
        let (mut squares, mut lowest_m) = (0.0, f64::INFINITY);
        for tick in 0..30_000 {
            let asked =
                sticks.at(f64::from(tick) * PERIOD_S, &SetPoint { altitude_m: 1.5, ..SetPoint::default() });
            flight.set_point = asked;
            flight.step(&law);
            let (roll_rad, pitch_rad, _) = flight.state.body.attitude_WB.euler_angles();
            let late = stick_deg(&sticks, channel, f64::from(tick) * PERIOD_S - 0.3);
            let angle_deg = if channel == "roll" { roll_rad } else { pitch_rad }.to_degrees();
            squares += (angle_deg - late) * (angle_deg - late);
            lowest_m = lowest_m.min(flight.position().z);
        }
        let rms_deg = f64::sqrt(squares / 30_000.0);
        println!("{channel}: {rms_deg:.2} deg RMS from the stick 0.3 s ago, never below {lowest_m:.2} m");
        assert!(rms_deg < 2.5 && lowest_m > 1.3, "{channel}: {rms_deg} deg, {lowest_m} m");
    }
}
