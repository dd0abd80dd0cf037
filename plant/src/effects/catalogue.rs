//! The list of all effects; each is a file of its own in the folder of this one.

use super::kind::EffectKind;

mod battery_sag;
mod bearing_friction;
mod blade_flapping;
mod com_offset;
pub(super) mod command_delay;
mod command_slope;
mod gimbal_friction;
mod ground_effect;
mod ground_turbulence;
mod gyroscopic_torque;
mod inertia_error;
mod mass_error;
mod motor_lag;
mod parasitic_drag;
mod rate_damping;
mod rig_pendulum;
mod rotor_drag;
mod thrust_scale;
mod torque_scale;
mod translational_lift;
pub(super) mod turbulence;
mod velocity_torque;
mod weak_rotor;
pub(super) mod wind;

/// The effects of the catalogue.
pub static CATALOGUE: &[&EffectKind] = &[
    &rotor_drag::EFFECT,
    &parasitic_drag::EFFECT,
    &translational_lift::EFFECT,
    &blade_flapping::EFFECT,
    &velocity_torque::EFFECT,
    &rate_damping::EFFECT,
    &ground_effect::EFFECT,
    &ground_turbulence::EFFECT,
    &wind::EFFECT,
    &turbulence::EFFECT,
    &command_delay::EFFECT,
    &motor_lag::EFFECT,
    &command_slope::EFFECT,
    &battery_sag::EFFECT,
    &weak_rotor::EFFECT,
    &thrust_scale::EFFECT,
    &mass_error::EFFECT,
    &com_offset::EFFECT,
    &inertia_error::EFFECT,
    &torque_scale::EFFECT,
    &gyroscopic_torque::EFFECT,
    &rig_pendulum::EFFECT,
    &bearing_friction::EFFECT,
    &gimbal_friction::EFFECT,
];

/// The effect that files call `name`.
///
/// ```
/// use plant::effects::find;
///
/// assert_eq!(find("wind").unwrap().parameters.len(), 3);
/// assert!(find("windy").is_none());
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static EffectKind> {
    CATALOGUE.iter().copied().find(|kind| kind.name == name)
}
