//! How the air moves. By itself it does nothing: drag and inflow do, which see the vehicle's velocity through it.
#![allow(non_snake_case, reason = "a trailing _W names the frame a vector is written in")]

use super::{Action, Advance, EffectKind, ParameterSpec, Values};
use diagnostics::unit::VELOCITY;
use nalgebra::Vector3;

const FOOT_M: f64 = 0.3048;

const fn wind_component(name: &'static str, meaning: &'static str, typical: f64) -> ParameterSpec {
    ParameterSpec {
        name,
        meaning,
        dimension: VELOCITY,
        lower: -30.0,
        upper: 30.0,
        neutral: Some(0.0),
        typical,
        typical_source: "a light breeze: 3 m/s is Beaufort 2",
    }
}

/// Steady wind.
pub static WIND: EffectKind = EffectKind {
    name: "wind",
    summary: "the air moves steadily, everywhere alike",
    equation: "v_air += (x, y, z) in the world",
    source: "own (a definition)",
    validity: "no shear near the ground or in the lee of walls; without an effect that feels the air, such as drag, \
               it does nothing",
    parameters: &[
        wind_component("x", "velocity of the air along x of the world", 3.0),
        wind_component("y", "velocity of the air along y of the world", 1.0),
        wind_component("z", "velocity of the air along z of the world", 0.2),
    ],
    actions: &[Action::Tick(wind)],
};

/// Gusts.
pub static TURBULENCE: EffectKind = EffectKind {
    name: "turbulence",
    summary: "the air gusts at random, in strength and scale as Dryden's model has it near the ground",
    equation: "each axis of v_air is a Gauss-Markov process of deviation s and correlation time L / V, constant over \
               a tick; s_z = 0.1 W, s_xy = s_z / (0.177 + 0.000823 h)^0.4, L_z = h, L_xy = h / (0.177 + 0.000823 \
               h)^1.2 with h in feet, held within 10...1000; V the speed through the air, at least W",
    source: "MIL-F-8785C, section 3.7, atmospheric disturbances: Dryden form, low-altitude model; the spectrum of \
             the longitudinal axis, of first order, is used for all three axes",
    validity: "heights of 3 to 300 m over open ground; lower heights count as 3 m. Axes are the world's. It depends \
               on the run's seed, starts from still air, and needs an effect that feels the air",
    parameters: &[ParameterSpec {
        name: "wind_at_20_ft",
        meaning: "W: mean wind 20 feet above the ground; the mean itself is for `wind`",
        dimension: VELOCITY,
        lower: 0.0,
        upper: 25.0,
        neutral: Some(0.0),
        typical: 7.717,
        typical_source: "light turbulence of MIL-F-8785C: 15 knots",
    }],
    actions: &[Action::Tick(turbulence)],
};

fn wind(&[x, y, z, ..]: &Values, advance: &mut Advance) {
    advance.drive.air_velocity_W_m_s += Vector3::new(x, y, z);
}

fn turbulence(&[wind_m_s, ..]: &Values, advance: &mut Advance) {
    let noise = advance.remembered.normals();
    let height_ft = (advance.situation.height_m / FOOT_M).clamp(10.0, 1000.0);
    let shape = 0.177 + 0.000823 * height_ft;
    let sigma_z_m_s = 0.1 * wind_m_s;
    let sigma_xy_m_s = sigma_z_m_s / libm::pow(shape, 0.4);
    let (length_z_m, length_xy_m) = (height_ft * FOOT_M, height_ft * FOOT_M / libm::pow(shape, 1.2));
    let speed_m_s = advance.situation.airspeed_B_m_s.norm().max(wind_m_s);
    let sigma_m_s = [sigma_xy_m_s, sigma_xy_m_s, sigma_z_m_s];
    let length_m = [length_xy_m, length_xy_m, length_z_m];
    for axis in 0..3 {
        let keep = libm::exp(-advance.dt_s * speed_m_s / length_m[axis]);
        let lag = &mut advance.remembered.lag[axis];
        *lag = keep * *lag + sigma_m_s[axis] * (1.0 - keep * keep).sqrt() * noise[axis];
        advance.drive.air_velocity_W_m_s[axis] += *lag;
    }
}
