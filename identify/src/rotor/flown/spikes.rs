//! Speeds that no rotor has: single readings far from those about them.

use flights::Flight;

use crate::rotor::plateau::running_median;

/// A reading this part away from the running median of five is a spike: within two readings no loaded rotor gets there and back.
const AWAY: f64 = 0.3;
/// And by so much in rad/s, so that a rotor at rest has none.
const AWAY_RAD_S: f64 = 20.0;

/// Returns the flight without samples that have a spike; `findings` says how many there are.
pub fn left_out(flight: &Flight, findings: &mut Vec<String>) -> Flight {
    let mut flight = flight.clone();
    let channel = &mut flight.rotor_speed;
    let mut is_spike = vec![false; channel.time_s.len()];
    for rotor in 0..flight.rotors {
        let speeds: Vec<f64> = channel.values.iter().map(|speeds| speeds[rotor]).collect();
        let smooth = running_median(&speeds);
        let far = speeds
            .iter()
            .zip(&smooth)
            .map(|(speed, smooth)| (speed - smooth).abs() > (AWAY * smooth.abs()).max(AWAY_RAD_S));
        is_spike.iter_mut().zip(far).for_each(|(any, is_far)| *any |= is_far);
    }
    let count = is_spike.iter().filter(|is_spike| **is_spike).count();
    if count > 0 {
        let all = is_spike.len();
        findings.push(format!(
            "flight `{}`: {count} of {all} readings of the rotor speeds are spikes, left out",
            flight.name
        ));
        let mut kept = is_spike.iter();
        channel.time_s.retain(|_| kept.next().is_none_or(|is_spike| !is_spike));
        let mut kept = is_spike.iter();
        channel.values.retain(|_| kept.next().is_none_or(|is_spike| !is_spike));
    }
    flight
}
