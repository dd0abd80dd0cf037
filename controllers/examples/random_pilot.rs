//! A random pilot: writes a recording of one stick as a hand moves it, and nothing on the other.
//!
//! `cargo run -p hummingbus-controllers --example random_pilot -- roll 1 > manifests/sticks/roll.csv` and
//! `… -- pitch 2 > manifests/sticks/pitch.csv` wrote the two that are stored; a test writes them anew.
//!
//! The hand makes one move after another, drawn at random: a rest, a pulse, or a step held for a while. The
//! opposite follows each of the latter two, so that the vehicle stays near its place. The wanted angle passes
//! through the hand's slowness, a critically damped lag of second order, and a tremor is added; the stick has
//! its stops. All numbers are tuned, no source, but for the stops (thesis §5.3). Only sums, products and the
//! bus's random stream are used, so that every machine writes the same bytes.

use rand_core::Rng;

/// One row every 20 ms, as a remote control sends.
const ROW_S: f64 = 0.02;
const LENGTH_S: f64 = 30.0;
/// Sticks rest at the beginning and at the end.
const REST_S: f64 = 1.5;
/// The stops of the stick (thesis §5.3).
const STOP_DEG: f64 = 30.0;
/// Speed with which a hand follows its intention: about 2 Hz.
const HAND_RAD_S: f64 = 12.0;
/// Size and quickness of its tremor.
const TREMOR_DEG: f64 = 0.25;
const TREMOR_FOLLOWING: f64 = 0.3;

/// Angle that the hand wants for a while.
struct Move {
    angle_deg: f64,
    seconds: f64,
}

/// A pilot's head and hand.
struct Pilot {
    random: component::random::Stream,
}

impl Pilot {
    /// An even number from `low` to `high`.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (f64::from(self.random.next_u32()) / 4_294_967_296.0)
    }

    /// Mostly up to 20 degrees, once in ten up to 28.
    fn angle_deg(&mut self) -> f64 {
        let is_large = self.between(0.0, 1.0) < 0.1;
        let size_deg = if is_large { self.between(20.0, 28.0) } else { self.between(4.0, 20.0) };
        if self.between(0.0, 1.0) < 0.5 { size_deg } else { -size_deg }
    }

    fn next_moves(&mut self) -> [Move; 3] {
        let angle_deg = self.angle_deg();
        let seconds = match self.between(0.0, 1.0) {
            share if share < 0.5 => self.between(0.25, 0.5),
            _ => self.between(0.6, 1.2),
        };
        let rest = Move { angle_deg: 0.0, seconds: self.between(0.3, 1.5) };
        [Move { angle_deg, seconds }, Move { angle_deg: -angle_deg, seconds }, rest]
    }

    /// Returns the wanted angle at every row.
    fn wanted_deg(&mut self) -> Vec<f64> {
        let rows = |seconds: f64| (seconds / ROW_S) as usize;
        let mut wanted = vec![0.0; rows(REST_S)];
        while wanted.len() < rows(LENGTH_S - REST_S) {
            for next in self.next_moves() {
                wanted.extend(std::iter::repeat_n(next.angle_deg, rows(next.seconds)));
            }
        }
        wanted.truncate(rows(LENGTH_S - REST_S));
        wanted.resize(rows(LENGTH_S) + 1, 0.0);
        wanted
    }

    /// Returns the angle of the stick at every row, as the hand moves it.
    fn stick_deg(&mut self) -> Vec<f64> {
        let wanted = self.wanted_deg();
        let (mut stick_deg, mut rate_deg_s, mut tremor_deg) = (0.0_f64, 0.0_f64, 0.0_f64);
        let step = HAND_RAD_S * ROW_S;
        let mut moved = |wanted_deg: f64| {
            // Implicit in the rate, which keeps so large a step stable.
            let pull_deg_s = HAND_RAD_S * step * (wanted_deg - stick_deg);
            rate_deg_s = (rate_deg_s + pull_deg_s) / (1.0 + 2.0 * step + step * step);
            stick_deg += rate_deg_s * ROW_S;
            tremor_deg += TREMOR_FOLLOWING * (self.between(-2.0, 2.0) * TREMOR_DEG - tremor_deg);
            let held_deg = (stick_deg + tremor_deg).clamp(-STOP_DEG, STOP_DEG);
            // Whole hundredths, and no minus before a zero.
            (held_deg * 100.0).round() / 100.0 + 0.0
        };
        wanted.into_iter().map(&mut moved).collect()
    }
}

/// The recording of the stick named `channel`, "roll" or "pitch", as CSV.
pub fn recording(channel: &str, seed: u64) -> String {
    let mut pilot = Pilot { random: component::random::stream(seed, "random pilot") };
    let mut text = String::from("time_s,roll_deg,pitch_deg\n");
    for (row, stick_deg) in pilot.stick_deg().into_iter().enumerate() {
        let time_s = row as f64 * ROW_S;
        let (roll_deg, pitch_deg) = if channel == "roll" { (stick_deg, 0.0) } else { (0.0, stick_deg) };
        text += &format!("{time_s:.2},{roll_deg:.2},{pitch_deg:.2}\n");
    }
    text
}

fn main() {
    let mut args = std::env::args().skip(1);
    let (channel, seed) = (args.next(), args.next().and_then(|seed| seed.parse().ok()));
    match (channel.as_deref(), seed) {
        (Some(channel @ ("roll" | "pitch")), Some(seed)) => print!("{}", recording(channel, seed)),
        _ => {
            eprintln!("usage: random_pilot roll|pitch SEED, such as: random_pilot roll 1 > roll.csv");
            std::process::exit(2);
        }
    }
}
