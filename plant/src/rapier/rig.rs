//! A test rig as rapier's joints: a slider on the vertical, and a bearing that the vehicle hangs from.
//!
//! The slider is a body that can only move up and down (rapier takes its other directions out of the equations, so
//! that no link without mass makes them stiff), and sideways where the rig sways: level within a square, as the lower
//! end of a long tube does for small angles, with no friction and nothing that leads it back. A ball joint ties the vehicle's mount to it and leaves all three
//! rotations free; where the rig does not heave, to a point of the world.
//!
//! The tilt limit is a cone, as of a rod end, and the same at any yaw: a limit on Euler angles would not be. It
//! is a rope from a point on world z above the bearing to the point as far above it on body z: for a tilt t and
//! a lever l the distance of the two is 2 l sin(t / 2), so a longest distance is a largest tilt.

use super::body::to_rapier;
use crate::state::RigidBody;
use nalgebra::Vector3;
use rapier3d_f64::dynamics::{
    GenericJointBuilder, JointAxesMask, JointAxis, LockedAxes, MassProperties, RigidBody as Slider,
    RigidBodyBuilder, RigidBodyHandle, RopeJointBuilder, SphericalJointBuilder,
};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::PhysicsWorld;
use scenes::Rig;

/// Lever of the rope that limits the tilt: long against the solver's error in distance, short enough to keep its
/// pull small. Tuned, no source.
const LEVER_M: f64 = 0.1;

/// A bearing that starts lower than this above the lower end of its travel is there: tuned, no source.
const LOWER_END_M: f64 = 1e-6;

/// Builds `rig` around `vehicle`; returns the slider where it heaves or sways.
pub(super) fn build(
    physics: &mut PhysicsWorld,
    vehicle: RigidBodyHandle,
    rig: &Rig,
) -> Option<RigidBodyHandle> {
    let foot = physics.insert_body(RigidBodyBuilder::fixed().translation(to_rapier(&rig.bearing_W_m)));
    let slider = (rig.heave_m > 0.0 || rig.sway_m > 0.0).then(|| slider(physics, foot, rig));
    let above = slider.unwrap_or(foot);
    let (mount, lever) = (to_rapier(&rig.mount_B_m), Vector::Z * LEVER_M);
    physics.insert_impulse_joint(above, vehicle, SphericalJointBuilder::new().local_anchor2(mount));
    let rope = RopeJointBuilder::new(2.0 * LEVER_M * libm::sin(rig.tilt_max_rad / 2.0));
    physics.insert_impulse_joint(above, vehicle, rope.local_anchor1(lever).local_anchor2(mount + lever));
    slider
}

fn slider(physics: &mut PhysicsWorld, foot: RigidBodyHandle, rig: &Rig) -> RigidBodyHandle {
    let on_its_line = LockedAxes::TRANSLATION_LOCKED_X | LockedAxes::TRANSLATION_LOCKED_Y;
    let sways = rig.sway_m > 0.0;
    let locked = LockedAxes::ROTATION_LOCKED | if sways { LockedAxes::empty() } else { on_its_line };
    let mass = MassProperties::new(Vector::ZERO, rig.moving_mass_kg, Vector::ZERO);
    let slider = RigidBodyBuilder::dynamic()
        .translation(to_rapier(&rig.bearing_W_m))
        .additional_mass_properties(mass)
        .locked_axes(locked)
        .can_sleep(false);
    let slider = physics.insert_body(slider);
    let mut travel =
        GenericJointBuilder::new(JointAxesMask::empty()).limits(JointAxis::LinZ, [0.0, rig.heave_m]);
    if sways {
        let side = [-rig.sway_m, rig.sway_m];
        travel = travel.limits(JointAxis::LinX, side).limits(JointAxis::LinY, side);
    }
    physics.insert_impulse_joint(foot, slider, travel.build());
    slider
}

/// `body` moved so that it hangs from the bearing, as high as it was within the heave; and the bearing's place.
pub(super) fn hung(rig: &Rig, body: &RigidBody) -> (RigidBody, Vector3<f64>) {
    let arm_W_m = body.attitude_WB * rig.mount_B_m;
    let wanted_m = body.position_W_m.z + arm_W_m.z - rig.bearing_W_m.z;
    let bearing_W_m = rig.bearing_W_m + Vector3::z() * wanted_m.clamp(0.0, rig.heave_m);
    (RigidBody { position_W_m: bearing_W_m - arm_W_m, ..*body }, bearing_W_m)
}

/// Whether the rig keeps a vehicle at rest where it is: always where it does not heave, and at the lower end of its
/// travel unless `lift_N`, the force on the vehicle beyond its weight, raises what hangs there.
pub(super) fn holds(rig: &Rig, body: &RigidBody, lift_N: f64, gravity_m_s2: f64) -> bool {
    let raised_m = (hung(rig, body).1 - rig.bearing_W_m).z;
    let needed_N = rig.moving_mass_kg * gravity_m_s2 + rig.slide_friction_N;
    rig.heave_m == 0.0 || (raised_m < LOWER_END_M && lift_N < needed_N)
}

/// Puts the slider at `bearing_W_m`, moving with the vehicle's mount where it can.
pub(super) fn place(
    slider: &mut Slider,
    rig: &Rig,
    bearing_W_m: &Vector3<f64>,
    velocity_W_m_s: &Vector3<f64>,
) {
    slider.set_translation(to_rapier(bearing_W_m), true);
    let freedom = if rig.sway_m > 0.0 { Vector::ONE } else { Vector::Z };
    slider.set_linvel(freedom * to_rapier(velocity_W_m_s), true);
}

/// Weight and friction of the slider over a step of `span_s`.
pub(super) fn push_slider(slider: &mut Slider, rig: &Rig, gravity_m_s2: f64, span_s: f64) {
    let speed_m_s = slider.linvel().z;
    let dry_and_viscous_N = rig.slide_friction_N + rig.slide_damping_N_s_m * speed_m_s.abs();
    let stopping_N = rig.moving_mass_kg * speed_m_s.abs() / span_s;
    let friction_N = -speed_m_s.signum() * dry_and_viscous_N.min(stopping_N);
    slider.reset_forces(true);
    slider.add_force(Vector::Z * (friction_N - rig.moving_mass_kg * gravity_m_s2), true);
}

/// The torque of the bearing's friction on a vehicle that turns with `spin_W_rad_s`, over a step of `span_s`. At
/// most it stops a body of the least moment of inertia, `inertia_kg_m2`: friction never turns a motion round.
pub(super) fn bearing_torque_W_N_m(
    rig: &Rig,
    spin_W_rad_s: &Vector3<f64>,
    inertia_kg_m2: f64,
    span_s: f64,
) -> Vector3<f64> {
    let spin_rad_s = spin_W_rad_s.norm();
    if spin_rad_s == 0.0 {
        return Vector3::zeros();
    }
    let dry_and_viscous_N_m = rig.bearing_friction_N_m + rig.bearing_damping_N_m_s * spin_rad_s;
    let stopping_N_m = inertia_kg_m2 * spin_rad_s / span_s;
    spin_W_rad_s * (-dry_and_viscous_N_m.min(stopping_N_m) / spin_rad_s)
}
