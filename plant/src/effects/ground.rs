//! What the ground does to rotors above it.
#![allow(non_snake_case, reason = "units stand last in names, N is the newton")]

use super::situation::Situation;
use super::{Action, Advance, EffectKind, ParameterSpec, Values};
use diagnostics::unit::{LENGTH, RATIO, TIME};

/// More thrust near the ground.
pub static GROUND_EFFECT: EffectKind = EffectKind {
    name: "ground-effect",
    summary: "a rotor near the ground has more thrust, as its downwash is held up",
    equation: "dT_i = T_i (1 / (1 - s (R / 4 z_i)^2) - 1), z_i the height of hub i, taken as R / 2 below that",
    source: "Cheeseman and Bennett, The effect of the ground on a helicopter rotor in forward flight, ARC R&M 3021, \
             1955, its hovering case; s as the coefficient of Sanchez-Cuevas, Heredia and Ollero, Int. J. of Aerospace \
             Engineering 2017, 1823056",
    validity: "hover above z = R / 2; the loss of the effect in forward flight, the fountain between rotors and \
               objects other than the ground are left out",
    parameters: &[
        ParameterSpec {
            name: "strength",
            meaning: "s: 1 for a single rotor",
            dimension: RATIO,
            lower: 0.0,
            upper: 3.0,
            neutral: Some(0.0),
            typical: 1.0,
            typical_source: "Cheeseman and Bennett 1955",
        },
        ParameterSpec {
            name: "rotor_radius",
            meaning: "R: radius of the rotors",
            dimension: LENGTH,
            lower: 0.01,
            upper: 1.0,
            neutral: None,
            typical: 0.1016,
            typical_source: "Hummingbird: propellers of 8 inch, thesis Table 2.1",
        },
    ],
    actions: &[Action::Thrust(ground_effect)],
};

/// Random thrust near the ground.
pub static GROUND_TURBULENCE: EffectKind = EffectKind {
    name: "ground-turbulence",
    summary: "downwash that the ground throws back shakes the thrust of each rotor at random, less with height",
    equation: "dT_i = T_i exp(-max(z_i, 0) / h) n_i with n_i a Gauss-Markov process of deviation s and correlation \
               time t_c, independent between rotors, constant over a tick",
    source: "own; stands for the random air particles near the ground of thesis section 5.1",
    validity: "not a model of the flow: spectrum and height are tuned. It depends on the run's seed",
    parameters: &[
        ParameterSpec {
            name: "intensity",
            meaning: "s: standard deviation of the thrust on the ground, relative to the thrust",
            dimension: RATIO,
            lower: 0.0,
            upper: 0.5,
            neutral: Some(0.0),
            typical: 0.1,
            typical_source: "tuned, no source",
        },
        ParameterSpec {
            name: "height_scale",
            meaning: "h: height above which the turbulence has fallen by a factor of e",
            dimension: LENGTH,
            lower: 0.01,
            upper: 10.0,
            neutral: None,
            typical: 0.3,
            typical_source: "tuned, no source: 3 rotor radii, where ground effect has faded too",
        },
        ParameterSpec {
            name: "correlation_time",
            meaning: "t_c: time over which it forgets",
            dimension: TIME,
            lower: 1e-3,
            upper: 10.0,
            neutral: None,
            typical: 0.05,
            typical_source: "tuned, no source",
        },
    ],
    actions: &[Action::Tick(ground_turbulence)],
};

fn ground_effect(&[strength, radius_m, ..]: &Values, situation: &Situation, rotor: usize) -> f64 {
    let height_m = situation.hub_height_m(rotor).max(radius_m / 2.0);
    let ratio = radius_m / (4.0 * height_m);
    situation.thrust_N(rotor) * (1.0 / (1.0 - strength * ratio * ratio) - 1.0)
}

fn ground_turbulence(&[intensity, scale_m, correlation_s, ..]: &Values, advance: &mut Advance) {
    let keep = libm::exp(-advance.dt_s / correlation_s);
    for (rotor, noise) in advance.remembered.normals().into_iter().enumerate() {
        let lag = &mut advance.remembered.lag[rotor];
        *lag = keep * *lag + (1.0 - keep * keep).sqrt() * noise;
        let height_m = advance.situation.hub_height_m(rotor).max(0.0);
        advance.drive.thrust_deviation[rotor] += intensity * libm::exp(-height_m / scale_m) * *lag;
    }
}
