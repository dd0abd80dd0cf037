//! Vehicles that a rig holds at a point, such as a gimbal or a ball joint.
//!
//! The bearing takes all forces. So the vehicle stays where it is however it leans, and its accelerometer reads the gravity
//! that the bearing bears, not the thrust. In free flight it accelerates as it leans. The mean is left out of both: a vehicle that
//! leans into a steady wind stays where it is too.
#![allow(non_snake_case, reason = "a trailing _WB or _B names the frames of a rotation or a vector")]

use nalgebra::{Matrix3, Vector3};

use crate::agreement::{Agreement, Pairs};
use crate::flight::{Channel, Flight};
use crate::frame::rotation;

/// Windows over which accelerations are compared, in s.
const WINDOW_S: f64 = 0.4;
/// Least root mean square of the acceleration by which the vehicle leans, in m/s²: 2 degrees. Less shows nothing.
const LEANING_M_S2: f64 = 0.3;
/// A held vehicle accelerates by less than this part of it. The rest is noise, play, and a tracked point beside the bearing.
const HELD: f64 = 0.25;
/// A free one accelerates by more than this part of it, with this correlation at least.
const FREE: f64 = 0.5;
const FREE_CORRELATION: f64 = 0.7;
/// Beyond this correlation a small acceleration follows the lean: the position may have another unit. Real flights in a wind
/// of 12 m/s have 0.65 to 0.72.
const FOLLOWS: f64 = 0.6;
/// Unless so much of its variance is that of a point that turns with the vehicle.
const TURNS: f64 = 0.7;
/// The size of the specific force of a free vehicle follows the commands of all rotors with at least this correlation.
const THRUST_CORRELATION: f64 = 0.7;
/// Rotors in this lowest part of the range of their total may stand on the ground.
const FLYING: f64 = 0.3;
/// No tracked point is further from the bearing, in m.
const LEVER_MAX_M: f64 = 0.5;

/// Answer of a flight to the question if a rig holds its vehicle.
///
/// ```
/// use flights::{Channel, Flight, Hold, Role};
///
/// // It leans by 6 degrees to and fro, and stays where it is.
/// let mut flight = Flight::new("swing", "log.csv", Role::Fit);
/// let time_s: Vec<f64> = (0..2000).map(|k| 0.01 * f64::from(k)).collect();
/// let roll = |time_s: &f64| { let half = 0.05 * (2.0 * time_s).sin(); [half.cos(), half.sin(), 0.0, 0.0] };
/// flight.attitude = Channel { values: time_s.iter().map(roll).collect(), time_s: time_s.clone() };
/// assert_eq!(flights::hold(&flight, 9.81), Hold::Unknown);
/// flight.position = Channel { values: vec![[1.0, 2.0, 1.5]; 2000], time_s };
/// assert!(matches!(flights::hold(&flight, 9.81), Hold::Held(_)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Hold {
    /// A rig holds the vehicle; the reason as text.
    Held(String),
    /// It moves freely.
    Free,
    /// The flight does not show it.
    Unknown,
}

/// Finds if a rig holds the vehicle of `flight`: by [`Flight::on_rig`], else by its channels.
#[must_use]
pub fn hold(flight: &Flight, gravity_m_s2: f64) -> Hold {
    match flight.on_rig {
        Some(true) => return Hold::Held("the flights file declares it".to_owned()),
        Some(false) => return Hold::Free,
        None => {}
    }
    if !flight.assumed.is_empty() || flight.attitude.is_empty() {
        return by_thrust(flight);
    }
    let place = by_place(flight, gravity_m_s2);
    let force = by_force(flight, gravity_m_s2);
    match (place, force) {
        (Hold::Free, _) | (_, Hold::Free) => Hold::Free,
        (Hold::Held(reason), _) | (_, Hold::Held(reason)) => Hold::Held(reason),
        (Hold::Unknown, Hold::Unknown) => Hold::Unknown,
    }
}

/// Compares the acceleration of the position, or else of the velocity, with the lean.
fn by_place(flight: &Flight, gravity_m_s2: f64) -> Hold {
    let leaning = Pairs::leaning_of(&flight.attitude, gravity_m_s2);
    let by_velocity = flight.position.is_empty();
    let none = Channel::default();
    let velocity = if by_velocity { &flight.velocity } else { &none };
    let pairs = Pairs::accelerations(&leaning, velocity, &flight.position, WINDOW_S);
    let channel = if by_velocity { "velocity" } else { "position" };
    let is_other_unit =
        |agreement: &Agreement| !by_velocity && agreement.correlation.abs() > FOLLOWS && !turns_about(flight);
    judged(pairs, channel, is_other_unit)
}

/// Compares the acceleration that the accelerometer feels, gravity taken off, with the lean.
fn by_force(flight: &Flight, gravity_m_s2: f64) -> Hold {
    let leaning = Pairs::leaning_of(&flight.attitude, gravity_m_s2);
    let felt = felt_velocity(&flight.attitude, &flight.specific_force);
    let pairs = Pairs::accelerations(&leaning, &felt, &Channel::default(), WINDOW_S);
    judged(pairs, "specific_force", |_| false)
}

/// Compares the size of the specific force with the total of the rotors: a free vehicle feels its thrust, while a bearing bears the
/// weight whatever the rotors do. It never shows a vehicle as held: in a steady hover the thrust is constant, too.
fn by_thrust(flight: &Flight) -> Hold {
    let rotors = if flight.rotor_speed.is_empty() { &flight.command } else { &flight.rotor_speed };
    let total = rotors.values.iter().map(|values| [values.iter().sum(), 0.0, 0.0]).collect();
    let total = Channel { time_s: rotors.time_s.clone(), values: total };
    let mut pairs = Pairs::sizes(&total, &flight.specific_force, WINDOW_S);
    let totals = || pairs.logged.iter().map(|total| total.x);
    let [least, greatest] = [totals().fold(f64::MAX, f64::min), totals().fold(f64::MIN, f64::max)];
    pairs.retain_logged(|total| total.x - least > FLYING * (greatest - least));
    let follows = pairs.without_means().agreement(LEANING_M_S2).map(|agreement| agreement.correlation);
    if follows.is_some_and(|correlation| correlation > THRUST_CORRELATION) {
        Hold::Free
    } else {
        Hold::Unknown
    }
}

fn judged(pairs: Pairs, channel: &str, is_doubted: impl Fn(&Agreement) -> bool) -> Hold {
    let pairs = pairs.level().without_means();
    let Some(agreement) = pairs.agreement(0.0) else { return still(&pairs, channel) };
    // Of the logged over the derived: the lean over the acceleration.
    let part = 1.0 / agreement.slope.abs();
    if pairs.size_logged() < LEANING_M_S2 {
        Hold::Unknown
    } else if part < HELD && !is_doubted(&agreement) {
        Hold::Held(reason(channel, part))
    } else if part > FREE && agreement.correlation > FREE_CORRELATION {
        Hold::Free
    } else {
        Hold::Unknown
    }
}

/// A channel that does not change at all has no agreement with anything.
fn still(pairs: &Pairs, channel: &str) -> Hold {
    let is_still = pairs.is_enough() && pairs.derived.iter().all(|one| one.norm() < 1e-9);
    if is_still && pairs.size_logged() > LEANING_M_S2 {
        Hold::Held(reason(channel, 0.0))
    } else {
        Hold::Unknown
    }
}

fn reason(channel: &str, part: f64) -> String {
    format!("by `{channel}` it accelerates by {:.1} % of what its lean asks for in free flight", 100.0 * part)
}

/// The specific force in the world, integrated over time: the velocity that the vehicle feels, and a share that grows steadily.
fn felt_velocity(attitude: &Channel<4>, force: &Channel<3>) -> Channel<3> {
    let mut felt = Channel::default();
    let (mut at, mut sum, mut before_s) = (0, Vector3::zeros(), None);
    for (time_s, force_B) in force.time_s.iter().zip(&force.values) {
        while attitude.time_s.get(at + 1).is_some_and(|next_s| next_s <= time_s) {
            at += 1;
        }
        let Some(attitude_WB) = attitude.values.get(at) else { break };
        let step_s = before_s.map_or(0.0, |before_s| time_s - before_s);
        sum += rotation(*attitude_WB) * Vector3::from(*force_B) * step_s;
        before_s = Some(*time_s);
        felt.time_s.push(*time_s);
        felt.values.push(sum.into());
    }
    felt
}

/// True if the position is that of a point that turns with the vehicle about another: position = place + R lever.
pub(crate) fn turns_about(flight: &Flight) -> bool {
    let (attitude, position) = (&flight.attitude, &flight.position);
    let mut at = 0;
    let mut samples = Vec::new();
    for (time_s, place) in position.time_s.iter().zip(&position.values) {
        while attitude.time_s.get(at + 1).is_some_and(|next_s| next_s <= time_s) {
            at += 1;
        }
        let Some(attitude_WB) = attitude.values.get(at) else { return false };
        samples.push((Vector3::from(*place), rotation(*attitude_WB).to_rotation_matrix().into_inner()));
    }
    lever(&samples).is_some_and(|(lever_m, part)| part > TURNS && lever_m.norm() < LEVER_MAX_M)
}

/// The lever of least squares among positions, each with the rotation of the vehicle, and the part of the positions' variance that
/// it explains.
fn lever(samples: &[(Vector3<f64>, Matrix3<f64>)]) -> Option<(Vector3<f64>, f64)> {
    let count = samples.len().max(1) as f64;
    let mean: Vector3<f64> = samples.iter().map(|sample| sample.0).sum::<Vector3<f64>>() / count;
    let mean_turn: Matrix3<f64> = samples.iter().map(|sample| sample.1).sum::<Matrix3<f64>>() / count;
    let (mut gram, mut right, mut all) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for (place, turn) in samples {
        let (place, turn) = (place - mean, turn - mean_turn);
        gram += turn.transpose() * turn;
        right += turn.transpose() * place;
        all += place.norm_squared();
    }
    // A lever along an axis that never turns shows nowhere.
    let lever = (gram + Matrix3::identity() * (1e-6 * gram.trace())).try_inverse()? * right;
    let left: f64 =
        samples.iter().map(|(place, turn)| (place - mean - (turn - mean_turn) * lever).norm_squared()).sum();
    (all > 0.0).then(|| (lever, 1.0 - left / all))
}
