//! Bounds for the numbers of a vehicle: wide enough for everything with rotors that has flown, from 80 mg to 56 t.
//!
//! The ends are RoboBee (80 mg, 3 cm; Ma et al., "Controlled flight of a biologically inspired, insect-scale robot",
//! Science 340, 2013) and the Mil Mi-26 (56 t, rotor of 32 m at 132 rpm; Jane's All the World's Aircraft), a decade or
//! more beyond either. They are not design limits: they catch slipped exponents and wrong units, and keep the
//! products of the physics within the range of a double.

use diagnostics::parameter::Bounds;

const fn bounds(min: f64, max: f64, unit: &'static str, why: &'static str) -> Bounds {
    Bounds { min, max, unit, why }
}

/// Take-off mass.
pub const MASS: Bounds =
    bounds(1e-6, 1e6, "kg", "the lightest that flies weighs 80 mg, the heaviest with rotors 56 t");
/// Moments of inertia about the body's axes: mass times the square of half a span.
pub const INERTIA: Bounds =
    bounds(1e-12, 1e9, "kg*m^2", "80 mg over 3 cm make 1e-9 kg*m^2, and 56 t over 32 m make 1e7");
/// Products of inertia, which are no larger than the moments.
pub const INERTIA_PRODUCT: Bounds = bounds(-1e9, 1e9, "kg*m^2", "56 t over 32 m make 1e7 kg*m^2");
/// Gravity.
pub const GRAVITY: Bounds =
    bounds(0.0, 300.0, "m/s^2", "Jupiter has 24.8 m/s^2 and the sun, where nothing flies, 274");
/// Thrust by rotor speed squared.
pub const THRUST_COEFFICIENT: Bounds =
    bounds(0.0, 1e5, "N/(rad/s)^2", "a rotor of 32 m that carries 56 t at 132 rpm has 2.9e3");
/// Torque by rotor speed squared.
pub const TORQUE_COEFFICIENT: Bounds =
    bounds(0.0, 1e6, "N*m/(rad/s)^2", "a rotor of 32 m that takes 17 MW at 132 rpm has 6.4e3");
/// Drag torque of a rotor against that of its siblings.
pub const TORQUE_SCALE: Bounds = bounds(0.5, 2.0, "", "the rotors of one vehicle are made alike");
/// Moment of inertia of a rotor.
pub const ROTOR_INERTIA: Bounds =
    bounds(0.0, 1e7, "kg*m^2", "eight blades of 375 kg and 16 m make 2.6e5 kg*m^2");
/// Places of hubs.
pub const HUB: Bounds = bounds(-100.0, 100.0, "m", "the longest helicopter measures 40 m over its rotors");
/// Components of the direction of a rotor's thrust, whose length does not matter.
pub const AXIS: Bounds = bounds(-1e3, 1e3, "", "give a direction, such as [0, 0.2, 1]");
/// First-order lag of a motor.
pub const TIME_CONSTANT: Bounds =
    bounds(1e-6, 100.0, "s", "a rotor takes a millisecond to some seconds to follow");
/// Natural frequency of a motor.
pub const NATURAL_FREQUENCY: Bounds =
    bounds(1e-2, 1e6, "rad/s", "a rotor takes a millisecond to some seconds to follow");
/// Damping ratio of a motor.
pub const DAMPING_RATIO: Bounds = bounds(
    1e-3,
    1e3,
    "",
    "less swings for ever, more is of first order: say so with model = \"first-order\"",
);
/// Raw commands.
pub const COMMAND: Bounds = bounds(-1e10, 1e10, "counts", "a timer of 32 bits counts to 4.3e9");
/// Rotor speeds.
pub const ROTOR_SPEED: Bounds =
    bounds(0.0, 1e5, "rad/s", "a blade of 1 cm is as fast as sound at 3.4e4 rad/s");
