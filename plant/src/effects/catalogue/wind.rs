//! Steady wind. By itself it does nothing: drag and inflow do, which see the velocity through the air.

use crate::effects::kind::{Action, Advance, EffectKind, Quantity, Values};
use diagnostics::unit::WIND_VELOCITY;
use nalgebra::Vector3;

/// The air moves steadily.
pub static EFFECT: EffectKind = EffectKind {
    name: "wind",
    summary: "a steady wind, the same everywhere",
    equation: "v_air += (x, y, z) in the world",
    source: "own (a definition)",
    validity: "no shear near the ground or in the lee of walls. It acts only through an effect that depends \
               on the air, such as drag",
    parameters: Parameters::SPECS,
    actions: &[Action::Tick(blow)],
    moves_air: true,
    needs: &[Quantity::Airspeed, Quantity::Force],
    ..EffectKind::PLAIN
};

/// Source of each nominal value.
const BREEZE: &str = "a light breeze: 3 m/s is Beaufort 2";

effect_parameters! {
    struct Parameters {
        /// velocity of the air along x of the world
        x: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 3.0, source: BREEZE;
        /// velocity of the air along y of the world
        y: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 1.0, source: BREEZE;
        /// velocity of the air along z of the world
        z: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 0.2, source: BREEZE;
    }
}

fn blow(values: &Values, advance: &mut Advance) {
    let Parameters { x, y, z } = values.into();
    advance.actuation.air_velocity_W_m_s += Vector3::new(x, y, z);
}
