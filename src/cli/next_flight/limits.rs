//! Limits of the next flight: those of the flights file, or what the measured flights reached.

use super::family::Space;
use hummingbus::flights::state::{length, tilt_deg};
use hummingbus::flights::{Flight, FlightSet, NextFlight, Played};
use identify::proposal::Limits;

/// Shortest and longest flight where the flights file does not say it, s.
const DURATION_S: [f64; 2] = [20.0, 60.0];
/// Time between two looks at a measured flight, s.
const LOOK_S: f64 = 0.01;
/// Part of the looks that are left out at either end: noise, and the ends of derivatives.
const OUTLIERS: f64 = 0.005;
/// Least room to both sides, m: less is no room for any manoeuvre.
const LEAST_ROOM_M: f64 = 0.05;

/// Limits of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Room, speed and tilt.
    pub limits: Limits,
    /// Length of the flight, s.
    pub duration_s: f64,
}

/// A limit that a search raises to see if that helps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Raised {
    /// The length.
    Duration,
    /// The speed.
    Speed,
    /// The tilt.
    Tilt,
    /// The room.
    Room,
    /// Speed, tilt and room.
    All,
}

impl Raised {
    /// All of them, cheap ones first.
    pub const ALL: [Self; 5] = [Self::Duration, Self::Speed, Self::Tilt, Self::Room, Self::All];

    /// `bounds` with this one raised, and how a report says so.
    pub fn on(self, bounds: &Bounds) -> (Bounds, String) {
        let mut raised = *bounds;
        let limits = &mut raised.limits;
        if self == Self::Duration {
            raised.duration_s = (4.0 * raised.duration_s).min(600.0);
            let text = format!("duration_s from {:.0} to {:.0}", bounds.duration_s, raised.duration_s);
            return (raised, text);
        }
        let mut texts = Vec::new();
        if matches!(self, Self::Speed | Self::All) {
            limits.speed_max_m_s = (2.5 * limits.speed_max_m_s).clamp(0.5, 50.0);
            texts.push(format!(
                "speed_max_m_s from {:.2} to {:.2}",
                bounds.limits.speed_max_m_s, limits.speed_max_m_s
            ));
        }
        if matches!(self, Self::Tilt | Self::All) {
            limits.tilt_max_deg = (2.0 * limits.tilt_max_deg).clamp(5.0, 50.0_f64.max(limits.tilt_max_deg));
            texts.push(format!(
                "tilt_max_deg from {:.1} to {:.1}",
                bounds.limits.tilt_max_deg, limits.tilt_max_deg
            ));
        }
        if matches!(self, Self::Room | Self::All) {
            for range in &mut limits.room_m {
                let more_m = (range[1] - range[0]).max(1.0);
                *range = [range[0] - more_m, range[1] + more_m];
            }
            // The ground stays where it is.
            limits.room_m[2][0] = bounds.limits.room_m[2][0].min(LEAST_HEIGHT_M);
            texts.push(format!("room_m to {:.1?}", limits.room_m));
        }
        (raised, texts.join(", "))
    }
}

/// No flight is proposed below, unless the flights file allows it, m.
const LEAST_HEIGHT_M: f64 = 0.3;

impl Bounds {
    /// The bounds that `set` asks for; those that it leaves open are what its flights reached.
    pub fn of(set: &FlightSet) -> Self {
        let reached = reached(&set.flights);
        let NextFlight { room_m, speed_max_m_s, tilt_max_deg, duration_s } = set.next_flight;
        let longest_s = set.flights.iter().map(length_s).fold(0.0, f64::max);
        Self {
            limits: Limits {
                room_m: room_m.unwrap_or_else(|| above_ground(reached.room_m)),
                speed_max_m_s: speed_max_m_s.unwrap_or(reached.speed_max_m_s),
                tilt_max_deg: tilt_max_deg.unwrap_or(reached.tilt_max_deg),
            },
            duration_s: duration_s.unwrap_or_else(|| longest_s.clamp(DURATION_S[0], DURATION_S[1])),
        }
    }

    /// The space that manoeuvres use.
    pub fn space(&self, gravity_m_s2: f64) -> Space {
        let [x, y, z] = self.limits.room_m;
        let middle = |[low, high]: [f64; 2]| f64::midpoint(low, high);
        let half = |[low, high]: [f64; 2]| ((high - low) / 2.0).max(LEAST_ROOM_M);
        Space {
            home_m: [x, y, z].map(|range| (middle(range) * 1e3).round() / 1e3),
            free_m: [half(x), half(y), half(z), half(z)],
            speed_m_s: self.limits.speed_max_m_s,
            level_m_s2: gravity_m_s2 * libm::tan(self.limits.tilt_max_deg.to_radians()),
        }
    }

    /// True if a flight that reached `reached` kept the limits.
    pub fn hold(&self, reached: &Limits) -> bool {
        let in_room = |(range, limit): (&[f64; 2], &[f64; 2])| range[0] >= limit[0] && range[1] <= limit[1];
        reached.room_m.iter().zip(&self.limits.room_m).all(in_room)
            && reached.speed_max_m_s <= self.limits.speed_max_m_s
            && reached.tilt_max_deg <= self.limits.tilt_max_deg
    }
}

/// The room without what is near the ground: flights begin and end there, and a proposed one does not know it.
fn above_ground(mut room_m: [[f64; 2]; 3]) -> [[f64; 2]; 3] {
    let [low, high] = &mut room_m[2];
    *low = low.max(LEAST_HEIGHT_M);
    *high = high.max(*low + 2.0 * LEAST_ROOM_M);
    room_m
}

fn length_s(flight: &Flight) -> f64 {
    flight.attitude.span_s().map_or(0.0, |(first_s, last_s)| last_s - first_s)
}

/// Ranges that all but the outliers of the flights' states keep.
fn reached(flights: &[Flight]) -> Limits {
    let (mut positions, mut speeds, mut tilts) = ([const { Vec::new() }; 3], Vec::new(), Vec::new());
    for played in flights.iter().filter_map(|flight| Played::of(flight).ok()) {
        let (from_s, to_s) = played.span_s();
        let mut hint = 0;
        for look in 0..((to_s - from_s) / LOOK_S) as usize {
            let time_s = from_s + look as f64 * LOOK_S;
            let row = played.at(time_s, &mut hint);
            if !played.counts(time_s, time_s + LOOK_S) {
                continue;
            }
            positions.iter_mut().zip(row.position_m).for_each(|(all, at): (&mut Vec<f64>, f64)| all.push(at));
            speeds.push(length(&row.velocity_m_s));
            tilts.push(tilt_deg(&row.attitude));
        }
    }
    let mut limits = Limits { room_m: [[0.0; 2]; 3], speed_max_m_s: 0.0, tilt_max_deg: 0.0 };
    limits.room_m =
        positions.map(|mut all| [quantile(&mut all, OUTLIERS), quantile(&mut all, 1.0 - OUTLIERS)]);
    limits.speed_max_m_s = quantile(&mut speeds, 1.0 - OUTLIERS);
    limits.tilt_max_deg = quantile(&mut tilts, 1.0 - OUTLIERS);
    limits
}

fn quantile(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    #[allow(clippy::cast_sign_loss, reason = "a part of a length")]
    let at = (part * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(at).copied().unwrap_or(0.0)
}
