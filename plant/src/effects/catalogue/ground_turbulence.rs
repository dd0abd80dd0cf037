//! Random thrust near the ground.

use crate::effects::kind::{Action, Advance, EffectKind, Randomness, Values};
use diagnostics::unit::{LENGTH, RATIO, TIME};

pub static EFFECT: EffectKind = EffectKind {
    name: "ground-turbulence",
    summary: "downwash that the ground reflects varies the thrust of each rotor at random, less with height",
    equation: "dT_i = T_i exp(-max(z_i, 0) / h) n_i with n_i a Gauss-Markov process of deviation s and correlation \
               time t_c, independent between rotors, constant over a tick",
    source: "own; represents the random air particles near the ground of thesis section 5.1",
    validity: "tuned spectrum and height: this is not a model of the flow. It depends on the run's seed",
    parameters: Parameters::SPECS,
    actions: &[Action::Tick(shake)],
    randomness: Randomness::Stochastic,
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Parameters {
        /// s: standard deviation of the thrust on the ground, relative to the thrust
        intensity: RATIO, min: 0.0, max: 0.5, neutral: Some(0.0), nominal: 0.1, source: "tuned, no source";
        /// h: height above which the turbulence has fallen by a factor of e
        height_scale: LENGTH, min: 0.01, max: 10.0, neutral: None, nominal: 0.3,
            source: "tuned, no source: 3 rotor radii, where ground effect has faded too";
        /// t_c: time over which it forgets
        correlation_time: TIME, min: 1e-3, max: 10.0, neutral: None, nominal: 0.05, source: "tuned, no source";
    }
}

fn shake(values: &Values, advance: &mut Advance) {
    let Parameters { intensity, height_scale: scale_m, correlation_time: correlation_s } = values.into();
    let keep = libm::exp(-advance.dt_s / correlation_s);
    for rotor in 0..advance.state.rotors.len() {
        let noise = advance.state.normal();
        let lag = &mut advance.state.rotors[rotor];
        *lag = keep * *lag + (1.0 - keep * keep).sqrt() * noise;
        let height_m = advance.condition.hub_height_m(rotor).max(0.0);
        advance.actuation.thrust_deviation[rotor] += intensity * libm::exp(-height_m / scale_m) * *lag;
    }
}
