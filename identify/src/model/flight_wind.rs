//! One wind for each flight: an effect of a set of flights, not of the vehicle.
//!
//! The effect `wind` of the catalogue is then the mean over the fit flights. Each of them has a deviation from it; the first has the negative sum of
//! the others, so that the deviations sum to zero. Deviations of zero are one wind for all flights. A flight without a number of its own, such as a
//! test flight, has the mean. All of these winds are level: near the ground the air moves level, and a vertical wind stands for thrust that the model
//! lacks in some flights.

use diagnostics::unit::WIND_VELOCITY;
use plant::effect_parameters;
use plant::effects::{EffectKind, Quantity};

/// The deviation of a flight's wind from the mean.
pub static FLIGHT_WIND: EffectKind = EffectKind {
    name: "flight-wind",
    summary: "each flight has a wind of its own",
    equation: "v_air += (x, y, 0) in the world, with other values in each flight",
    source: "own (a definition)",
    validity: "constant over a flight, and level",
    parameters: Deviation::SPECS,
    needs: &[Quantity::Airspeed, Quantity::Force],
    // It begins at a start, which depends on the flights: see `wind_start`.
    guesses: &[&[]],
    ..EffectKind::PLAIN
};

effect_parameters! {
    struct Deviation {
        /// velocity of the air along x of the world
        x: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 3.0, source: "that of `wind`";
        /// velocity of the air along y of the world
        y: WIND_VELOCITY, min: -30.0, max: 30.0, neutral: Some(0.0), nominal: 3.0, source: "that of `wind`";
    }
}

/// True for effects by which a wind acts, as drags and lifts.
pub fn is_drag(kind: &EffectKind) -> bool {
    kind.needs == FLIGHT_WIND.needs && kind.only_adds() && kind.guesses.is_empty()
}
