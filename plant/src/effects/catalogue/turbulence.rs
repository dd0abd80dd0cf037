//! Gusts.

use crate::effects::kind::{Action, Advance, EffectKind, Randomness, Values};
use diagnostics::unit::WIND_VELOCITY;

/// Random gusts added to the wind.
pub static EFFECT: EffectKind = EffectKind {
    name: "turbulence",
    summary: "random gusts, with the strength and scale of Dryden's model near the ground",
    equation: "each axis of v_air is a Gauss-Markov process of deviation s and correlation time L / V, constant over \
               a tick; s_z = 0.1 W, s_xy = s_z / (0.177 + 0.000823 h)^0.4, L_z = h, L_xy = h / (0.177 + 0.000823 \
               h)^1.2 with h in feet, held within 10...1000; V the speed through the air, at least W",
    source: "MIL-F-8785C, section 3.7, atmospheric disturbances: Dryden form, low-altitude model; the spectrum of \
             the longitudinal axis, of first order, is used for all three axes",
    validity: "heights of 3 to 300 m over open ground; lower heights count as 3 m. Axes are the world's. It \
               depends on the run's seed, starts from still air, and acts only through an effect that \
               depends on the air",
    parameters: Parameters::SPECS,
    actions: &[Action::Tick(gust)],
    moves_air: true,
    randomness: Randomness::Stochastic,
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// W: mean wind 20 feet above the ground; the mean itself is for `wind`
        wind_at_20_ft: WIND_VELOCITY, min: 0.0, max: 25.0, neutral: Some(0.0), nominal: 7.717,
            source: "light turbulence of MIL-F-8785C: 15 knots";
    }
}

const FOOT_M: f64 = 0.3048;

fn gust(values: &Values, advance: &mut Advance) {
    let Parameters { wind_at_20_ft: wind_m_s } = values.into();
    let noise = advance.state.normals();
    let height_ft = (advance.condition.height_m / FOOT_M).clamp(10.0, 1000.0);
    let shape = 0.177 + 0.000823 * height_ft;
    let sigma_z_m_s = 0.1 * wind_m_s;
    let sigma_xy_m_s = sigma_z_m_s / libm::pow(shape, 0.4);
    let (length_z_m, length_xy_m) = (height_ft * FOOT_M, height_ft * FOOT_M / libm::pow(shape, 1.2));
    let speed_m_s = advance.condition.airspeed_B_m_s.norm().max(wind_m_s);
    let sigma_m_s = [sigma_xy_m_s, sigma_xy_m_s, sigma_z_m_s];
    let length_m = [length_xy_m, length_xy_m, length_z_m];
    for axis in 0..3 {
        let keep = libm::exp(-advance.dt_s * speed_m_s / length_m[axis]);
        let lag = &mut advance.state.numbers[axis];
        *lag = keep * *lag + sigma_m_s[axis] * (1.0 - keep * keep).sqrt() * noise[axis];
        advance.actuation.air_velocity_W_m_s[axis] += *lag;
    }
}
