//! The family of manoeuvres that a next flight is made of: one row for each.
//!
//! Every manoeuvre begins and ends at rest in the middle of the room, so that any of them can follow any other.

use toml::{Table, toml};

/// Room and agility that a manoeuvre may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Space {
    /// Begin and end of manoeuvres: the middle of the room, in the world, m.
    pub home_m: [f64; 3],
    /// Free way from there along x and y, to both sides, and down and up, m.
    pub free_m: [f64; 4],
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Level acceleration, m/s^2: gravity times the tangent of the tilt.
    pub level_m_s2: f64,
}

/// A row of the family.
pub struct Manoeuvre {
    /// Its name.
    pub name: &'static str,
    /// Description for a pilot.
    pub description: &'static str,
    /// Parts of speed and acceleration that are tried.
    pub levels: &'static [f64],
    /// Segments of a trajectory in the space, at a level.
    pub segments: fn(&Space, f64) -> Vec<Table>,
}

/// Levels of most manoeuvres.
const LEVELS: &[f64] = &[0.9, 0.55, 0.3];
/// Levels of fast ones.
const FAST: &[f64] = &[0.8, 0.4];
/// Part of the free way that is used: the vehicle overshoots.
const OF_WAY: f64 = 0.9;
/// Vertical acceleration of climbs and of short steps of height, m/s^2: a quarter and a half of gravity.
const CLIMB_M_S2: [f64; 2] = [2.5, 5.0];
/// Times from rest to rest of short moves, s.
const SHORT_S: [f64; 2] = [0.7, 1.1];
/// Greatest speed and acceleration of a minimum-snap move from rest to rest, in units of distance by time and its square:
/// 35 t^4 - 84 t^5 + 70 t^6 - 20 t^7.
const SNAP: [f64; 2] = [2.1875, 7.513];

/// The family.
pub const FAMILY: &[Manoeuvre] = &[
    Manoeuvre {
        name: "hover",
        description: "hover",
        levels: &[1.0],
        segments: |_, _| vec![toml! { kind = "hover" duration_s = 4.0 }],
    },
    Manoeuvre {
        name: "runs along x",
        description: "straight runs forwards and backwards, stopping at both ends",
        levels: LEVELS,
        segments: |space, level| runs(space, level, [1.0, 0.0], None),
    },
    Manoeuvre {
        name: "runs along y",
        description: "straight runs to the left and to the right, stopping at both ends",
        levels: LEVELS,
        segments: |space, level| runs(space, level, [0.0, 1.0], None),
    },
    Manoeuvre {
        name: "turning runs",
        description: "straight runs forwards and backwards while the nose turns by 90 degrees",
        levels: LEVELS,
        segments: |space, level| runs(space, level, [1.0, 0.0], Some(90.0)),
    },
    Manoeuvre {
        name: "circle",
        description: "circles to the left, the nose held",
        levels: LEVELS,
        segments: |space, level| circle(space, level, 1.0),
    },
    Manoeuvre {
        name: "circle to the right",
        description: "circles to the right, the nose turning by 180 degrees",
        levels: LEVELS,
        segments: |space, level| circle(space, level, -1.0),
    },
    Manoeuvre {
        name: "figure eight",
        description: "figure eights along x",
        levels: LEVELS,
        segments: figure_eight,
    },
    Manoeuvre {
        name: "climbs",
        description: "climb to the top, descend to the bottom, and return",
        levels: LEVELS,
        segments: |space, level| climbs(space, level, 0.0),
    },
    Manoeuvre {
        name: "heights",
        description: "hover at the bottom, then at the top, for 2 s each",
        levels: &[0.6],
        segments: |space, level| climbs(space, level, 2.0),
    },
    Manoeuvre {
        name: "low runs",
        description: "descend to the bottom, straight runs there, and return",
        levels: &[0.9, 0.5],
        segments: low_runs,
    },
    Manoeuvre {
        name: "waves",
        description: "runs forwards and backwards that rise and sink by a few decimetres all the way",
        levels: FAST,
        segments: waves,
    },
    Manoeuvre {
        name: "pitch doublets",
        description: "short sharp moves forwards and backwards, one after another without a rest",
        levels: FAST,
        segments: |space, level| doublets(space, level, [1.0, 0.0], SHORT_S[0]),
    },
    Manoeuvre {
        name: "roll doublets",
        description: "short sharp moves to the left and to the right, one after another without a rest",
        levels: FAST,
        segments: |space, level| doublets(space, level, [0.0, 1.0], SHORT_S[0]),
    },
    Manoeuvre {
        name: "roll and pitch doublets",
        description: "short sharp moves along both diagonals, one after another without a rest",
        levels: FAST,
        segments: |space, level| {
            [[0.7, 0.7], [0.7, -0.7]]
                .iter()
                .flat_map(|way| doublets(space, level, *way, SHORT_S[0]))
                .collect()
        },
    },
    Manoeuvre {
        name: "slow roll and pitch doublets",
        description: "moves of 1.1 s along both diagonals, one after another without a rest",
        levels: FAST,
        segments: |space, level| {
            [[0.7, 0.7], [0.7, -0.7]]
                .iter()
                .flat_map(|way| doublets(space, level, *way, SHORT_S[1]))
                .collect()
        },
    },
    Manoeuvre {
        name: "steps of height",
        description: "short sharp climbs and descents, one after another without a rest",
        levels: FAST,
        segments: height_doublets,
    },
    Manoeuvre {
        name: "yaw doublets",
        description: "sharp turns of the nose to both sides",
        levels: &[90.0, 45.0],
        segments: |_, degrees| {
            let turn =
                |to: f64, duration_s: f64| toml! { kind = "hover" duration_s = duration_s yaw_deg = to };
            vec![turn(degrees, 0.9), turn(-degrees, 1.3), turn(degrees, 1.3), turn(0.0, 0.9)]
        },
    },
];

/// A minimum-snap move to a point relative to home, from rest to rest.
fn to(space: &Space, away_m: [f64; 3], time_s: f64, yaw_deg: Option<f64>) -> Table {
    let point: Vec<f64> = space.home_m.iter().zip(away_m).map(|(home, away)| round(home + away)).collect();
    let mut segment = toml! { kind = "minimum-snap" };
    segment.insert("waypoints_m".to_owned(), vec![point].into());
    segment.insert("times_s".to_owned(), vec![round(time_s)].into());
    segment.extend(yaw_deg.map(|yaw_deg| ("yaw_deg".to_owned(), yaw_deg.into())));
    segment
}

/// Millimetres and milliseconds: what a pilot reads, and what is flown.
fn round(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// Time of a move from rest to rest over a distance.
fn move_s(distance_m: f64, speed_m_s: f64, most_m_s2: f64) -> f64 {
    let by_speed_s = SNAP[0] * distance_m / speed_m_s.max(1e-3);
    by_speed_s.max((SNAP[1] * distance_m / most_m_s2.max(1e-3)).sqrt()).max(SHORT_S[0])
}

fn runs(space: &Space, level: f64, way: [f64; 2], yaw_deg: Option<f64>) -> Vec<Table> {
    let reach = |axis: usize| if way[axis] == 0.0 { f64::INFINITY } else { space.free_m[axis] };
    let length_m = OF_WAY * reach(0).min(reach(1));
    let time_s = |distance_m| move_s(distance_m, level * space.speed_m_s, level * space.level_m_s2);
    let at = |part: f64| [part * length_m * way[0], part * length_m * way[1], 0.0];
    let (half_s, whole_s) = (time_s(length_m), time_s(2.0 * length_m));
    vec![
        to(space, at(1.0), half_s, yaw_deg),
        to(space, at(-1.0), whole_s, yaw_deg.map(|yaw| -yaw)),
        to(space, at(1.0), whole_s, yaw_deg),
        to(space, at(0.0), half_s, yaw_deg.map(|_| 0.0)),
    ]
}

fn low_runs(space: &Space, level: f64) -> Vec<Table> {
    let (low_m, length_m) = (-OF_WAY * space.free_m[2], OF_WAY * space.free_m[0]);
    let down_s = move_s(-low_m, level * space.speed_m_s, CLIMB_M_S2[0]);
    let run_s = |distance_m| move_s(distance_m, level * space.speed_m_s, level * space.level_m_s2);
    vec![
        to(space, [0.0, 0.0, low_m], down_s, None),
        to(space, [length_m, 0.0, low_m], run_s(length_m), None),
        to(space, [-length_m, 0.0, low_m], run_s(2.0 * length_m), None),
        to(space, [0.0, 0.0, low_m], run_s(length_m), None),
        to(space, [0.0, 0.0, 0.0], down_s, None),
    ]
}

fn climbs(space: &Space, level: f64, stay_s: f64) -> Vec<Table> {
    let [_, _, down, up] = space.free_m.map(|free| OF_WAY * free);
    let time_s = |distance_m| move_s(distance_m, level * space.speed_m_s, CLIMB_M_S2[0]);
    let stay = || (stay_s > 0.0).then(|| toml! { kind = "hover" duration_s = stay_s });
    let way = [
        Some(to(space, [0.0, 0.0, -down], time_s(down), None)),
        stay(),
        Some(to(space, [0.0, 0.0, up], time_s(down + up), None)),
        stay(),
        Some(to(space, [0.0, 0.0, 0.0], time_s(up), None)),
    ];
    way.into_iter().flatten().collect()
}

fn circle(space: &Space, level: f64, side: f64) -> Vec<Table> {
    // It begins at home, which lies on it.
    let radius_m = round(OF_WAY * (space.free_m[1] / 2.0).min(space.free_m[0]));
    let speed_m_s = (level * space.speed_m_s).min((level * space.level_m_s2 * radius_m).sqrt());
    let yaw_deg = (side < 0.0).then_some(180.0);
    closed(space, "circle", "radius_m", side * radius_m, radius_m, speed_m_s, yaw_deg)
}

fn figure_eight(space: &Space, level: f64) -> Vec<Table> {
    let length_m = round(OF_WAY * space.free_m[0].min(2.0 * space.free_m[1]));
    // Its greatest acceleration is 1.06 v^2 / a.
    let speed_m_s = (level * space.speed_m_s).min((0.94 * level * space.level_m_s2 * length_m).sqrt());
    let radius_m = length_m * std::f64::consts::SQRT_2;
    closed(space, "figure-eight", "half_length_m", length_m, radius_m, speed_m_s, None)
}

/// Least time of a ramp, s.
const RAMP_S: f64 = 1.0;
/// Time of a ramp in units of its speed by the level acceleration: at its peak it takes half of that, and the curve the
/// rest.
const RAMP: f64 = 4.0;

/// Laps of a closed curve, with ramps that find room in them, and a turn back to the yaw at its beginning.
fn closed(
    space: &Space,
    kind: &str,
    key: &str,
    size_m: f64,
    radius_m: f64,
    speed_m_s: f64,
    yaw_deg: Option<f64>,
) -> Vec<Table> {
    let speed_m_s = round(speed_m_s).max(0.01);
    let ramp_s = round((RAMP * speed_m_s / space.level_m_s2.max(1e-3)).max(RAMP_S));
    let laps = (speed_m_s * ramp_s / (std::f64::consts::TAU * radius_m)).ceil().max(1.0);
    #[allow(clippy::cast_possible_truncation, reason = "a few laps")]
    let mut segment = toml! { kind = kind speed_m_s = speed_m_s laps = (laps as i64) ramp_s = ramp_s };
    segment.insert(key.to_owned(), size_m.into());
    segment.extend(yaw_deg.map(|yaw_deg| ("yaw_deg".to_owned(), yaw_deg.into())));
    let back = yaw_deg.map(|_| toml! { kind = "hover" duration_s = 2.0 yaw_deg = 0.0 });
    std::iter::once(segment).chain(back).collect()
}

/// Moves of `time_s` to both sides of home, as long as speed, acceleration and room allow.
fn doublets(space: &Space, level: f64, way: [f64; 2], time_s: f64) -> Vec<Table> {
    let by_speed_m = level * space.speed_m_s * time_s / SNAP[0];
    let by_tilt_m = level * space.level_m_s2 * time_s * time_s / SNAP[1];
    let reach_m = OF_WAY * space.free_m[0].min(space.free_m[1]);
    let size_m = by_speed_m.min(by_tilt_m).min(reach_m);
    let at = |part: f64| [part * size_m * way[0], part * size_m * way[1], 0.0];
    let half = |part: f64| to(space, at(part), time_s, None);
    vec![half(1.0), half(0.0), half(-1.0), half(0.0), half(1.0), half(0.0)]
}

/// Runs to both ends along x, on which the thrust swings: heights alternate from point to point.
fn waves(space: &Space, level: f64) -> Vec<Table> {
    let length_m = OF_WAY * OF_WAY * space.free_m[0];
    let speed_m_s = (0.6 * level * space.speed_m_s).min(0.3 * level * space.level_m_s2);
    let swing_m = level * CLIMB_M_S2[1] * (WAVE_S / std::f64::consts::PI).powi(2);
    let swing_m = swing_m.min(OF_WAY * OF_WAY * space.free_m[2].min(space.free_m[3]));
    let steps = (2.0 * length_m / (speed_m_s * WAVE_S)).ceil().clamp(3.0, WAVES_MAX);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few dozen")]
    let count = steps as usize;
    let run = |from_m: f64| {
        let height_m = |step: usize| if step == count { 0.0 } else { swing_m * [1.0, -1.0][step % 2] };
        let point = |step: usize| {
            let part = step as f64 / steps;
            let away_m = [from_m * (1.0 - 2.0 * part), 0.0, height_m(step)];
            let at: Vec<f64> =
                space.home_m.iter().zip(away_m).map(|(home, away)| round(home + away)).collect();
            toml::Value::from(at)
        };
        let span_s = (2.0 * length_m / steps / speed_m_s.max(1e-3)).max(WAVE_S);
        // It starts and stops within a longer span.
        let time_s = |step: usize| round(if step == 1 || step == count { 2.0 * span_s } else { span_s });
        let mut segment = toml! { kind = "minimum-snap" };
        segment.insert("waypoints_m".to_owned(), (1..=count).map(point).collect::<Vec<_>>().into());
        segment.insert("times_s".to_owned(), (1..=count).map(time_s).collect::<Vec<_>>().into());
        segment
    };
    let aside_s = move_s(length_m, level * space.speed_m_s, level * space.level_m_s2);
    let at = |away_m: f64| to(space, [away_m, 0.0, 0.0], aside_s, None);
    vec![at(length_m), run(length_m), run(-length_m), at(0.0)]
}

/// Time from one turning point of a wave to the next, s.
const WAVE_S: f64 = 0.6;
/// Most turning points of a run.
const WAVES_MAX: f64 = 24.0;

fn height_doublets(space: &Space, level: f64) -> Vec<Table> {
    let time_s = SHORT_S[0];
    let by_speed_m = level * space.speed_m_s * time_s / SNAP[0];
    let by_thrust_m = level * CLIMB_M_S2[1] * time_s * time_s / SNAP[1];
    let size_m = by_speed_m.min(by_thrust_m).min(OF_WAY * space.free_m[2].min(space.free_m[3]));
    let at = |part: f64| to(space, [0.0, 0.0, part * size_m], time_s, None);
    vec![at(1.0), at(0.0), at(-1.0), at(0.0), at(1.0), at(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use controllers::trajectory::{Start, Trajectory};

    /// Each course starts and ends in the middle of the room at rest, and stays within what it may use.
    #[test]
    fn every_manoeuvre_keeps_its_space_and_comes_home() {
        let space =
            Space { home_m: [1.0, -1.0, 2.0], free_m: [2.0, 1.5, 1.0, 1.5], speed_m_s: 3.0, level_m_s2: 5.0 };
        for manoeuvre in FAMILY {
            for level in manoeuvre.levels {
                let segments = (manoeuvre.segments)(&space, *level);
                let entries: Vec<_> = segments.iter().map(|it| serde_json::to_value(it).unwrap()).collect();
                let start = Start { position_W_m: space.home_m.into(), yaw_rad: 0.0 };
                let course = Trajectory::read(&entries, start).unwrap();
                let name = format!("{} at {level}", manoeuvre.name);
                for step in 0..=1000 {
                    let point = course.at(course.duration_s() * f64::from(step) / 1000.0);
                    let away: Vec<f64> =
                        point.path_W[0].iter().zip(space.home_m).map(|(a, b)| a - b).collect();
                    assert!(away[0].abs() <= 2.0 && away[1].abs() <= 1.5, "{name}: {away:?}");
                    assert!((-1.0..=1.5).contains(&away[2]), "{name}: {away:?}");
                    assert!(point.path_W[1].norm() <= 3.0, "{name}: {} m/s", point.path_W[1].norm());
                    assert!(
                        point.path_W[2].xy().norm() <= 5.0,
                        "{name}: {} m/s^2",
                        point.path_W[2].xy().norm()
                    );
                }
                let end = course.at(course.duration_s());
                let home: nalgebra::Vector3<f64> = space.home_m.into();
                assert!((end.path_W[0] - home).norm() < 1e-6 && end.yaw_rad == 0.0, "{name}: {end:?}");
            }
        }
    }
}
