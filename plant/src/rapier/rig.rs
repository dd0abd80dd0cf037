//! A test rig: a slider on the vertical, and a bearing that the vehicle hangs from.
//!
//! The slider only moves up and down, and sideways where the rig sways: level within a square, as the lower end of a
//! long tube does for small angles, with no friction and nothing that leads it back. What hangs with the bearing is
//! lumped in its centre, so that the slider is a point with a mass. A ball joint ties the vehicle's mount to it and
//! leaves all three rotations free; where the rig neither heaves nor sways, to a point of the world.
//!
//! The tilt limit is a cone, as of a rod end, and the same at any yaw: a limit on Euler angles would not be. All
//! stops are inelastic: a rope, a rod end's collar, a tube in a tube.

use super::solver::{Ball, Body, Limit, Row};
use crate::newton_euler::NewtonEuler;
use crate::state::{Rates, RigidBody, State};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use scenes::Rig;
use serde::{Deserialize, Serialize};

/// A bearing that starts lower than this above the lower end of its travel is there: tuned, no source.
const LOWER_END_M: f64 = 1e-6;

/// What carries the bearing: where the bearing's centre is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Slider {
    pub position_W_m: Vector3<f64>,
    pub velocity_W_m_s: Vector3<f64>,
}

impl Slider {
    /// The slider of `rig` with this vehicle on it; none where nothing slides.
    pub(super) fn under(rig: &Rig, vehicle: &RigidBody) -> Option<Self> {
        let arm_W_m = vehicle.attitude_WB * rig.mount_B_m;
        let spin_W_rad_s = vehicle.attitude_WB * vehicle.angular_velocity_B_rad_s;
        let velocity_W_m_s = vehicle.velocity_W_m_s + spin_W_rad_s.cross(&arm_W_m);
        let is_free = freedom(rig);
        let off_W_m = vehicle.position_W_m + arm_W_m - rig.bearing_W_m;
        (is_free.amax() > 0.0).then(|| Self {
            position_W_m: rig.bearing_W_m + off_W_m.component_mul(&is_free),
            velocity_W_m_s: velocity_W_m_s.component_mul(&is_free),
        })
    }

    /// As the solver sees it.
    pub(super) fn body(&self, rig: &Rig) -> Body {
        Body {
            velocity_W_m_s: self.velocity_W_m_s,
            inverse_mass_per_kg: freedom(rig) / rig.moving_mass_kg,
            ..Body::default()
        }
    }

    /// The impulse of its friction over a step of `span_s`, which at most stops it.
    pub(super) fn friction_W_N_s(&self, rig: &Rig, span_s: f64) -> Vector3<f64> {
        let speed_m_s = self.velocity_W_m_s.z;
        let dry_and_viscous_N = rig.slide_friction_N + rig.slide_damping_N_s_m * speed_m_s.abs();
        let stopping_N_s = rig.moving_mass_kg * speed_m_s.abs();
        Vector3::z() * (-speed_m_s.signum() * (dry_and_viscous_N * span_s).min(stopping_N_s))
    }
}

/// For each axis of the world 1 where the slider moves along it, and 0 where it is held.
fn freedom(rig: &Rig) -> Vector3<f64> {
    let [aside, up] = [rig.sway_m, rig.heave_m].map(|way_m| if way_m > 0.0 { 1.0 } else { 0.0 });
    Vector3::new(aside, aside, up)
}

/// Takes `rates` of free flight at `state` to those in the rig, by the force P of the bearing on the vehicle at its
/// mount, at r from the centre of mass: the mount accelerates at a + α × r + ω × (ω × r), which is zero along an axis
/// where the slider is held, and P is what moves and carries the slider along the others.
pub(super) fn hold(rig: &Rig, model: &NewtonEuler, state: &State, rates: Rates) -> Rates {
    let vehicle = model.vehicle();
    // Within a step the quaternion is not kept at length 1.
    let turn_WB = UnitQuaternion::new_normalize(state.body.attitude_WB.into_inner()).to_rotation_matrix();
    let inverse_inertia_W = turn_WB * model.inverse_inertia() * turn_WB.transpose();
    let [spin_W_rad_s, turning_W_rad_s2, arm_W_m] =
        [state.body.angular_velocity_B_rad_s, rates.angular_acceleration_B_rad_s2, rig.mount_B_m]
            .map(|vector_B| turn_WB * vector_B);
    let lever_W = arm_W_m.cross_matrix();
    let yields = Matrix3::identity() / vehicle.mass_kg - lever_W * inverse_inertia_W * lever_W;
    let mount_W_m_s2 = rates.acceleration_W_m_s2
        + turning_W_rad_s2.cross(&arm_W_m)
        + spin_W_rad_s.cross(&spin_W_rad_s.cross(&arm_W_m));
    let weight_W_N = Vector3::z() * (-rig.moving_mass_kg * vehicle.gravity_m_s2);
    let freedom = freedom(rig);
    // A row for each axis: yields P = -mount where it is held, (1 + m yields) P = weight - m mount where it is free.
    let (mut rows, mut right) = (yields, -mount_W_m_s2);
    for axis in (0..3).filter(|&axis| freedom[axis] > 0.0) {
        rows.row_mut(axis).scale_mut(rig.moving_mass_kg);
        rows[(axis, axis)] += 1.0;
        right[axis] = weight_W_N[axis] - rig.moving_mass_kg * mount_W_m_s2[axis];
    }
    let force_W_N = rows.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * right);
    let turned_W_rad_s2 = inverse_inertia_W * arm_W_m.cross(&force_W_N);
    Rates {
        acceleration_W_m_s2: rates.acceleration_W_m_s2 + force_W_N / vehicle.mass_kg,
        angular_acceleration_B_rad_s2: rates.angular_acceleration_B_rad_s2
            + turn_WB.inverse_transform_vector(&turned_W_rad_s2),
        ..rates
    }
}

/// The ball joint between `bodies`: what carries the bearing, and the vehicle.
pub(super) fn bearing(all: &[Body], bodies: [usize; 2], rig: &Rig, vehicle: &RigidBody) -> Ball {
    Ball::new(all, bodies, [Vector3::zeros(), vehicle.attitude_WB * rig.mount_B_m])
}

/// How far the vehicle's mount is from the bearing's centre, at `bearing_W_m`.
pub(super) fn off_W_m(rig: &Rig, vehicle: &RigidBody, bearing_W_m: &Vector3<f64>) -> Vector3<f64> {
    vehicle.position_W_m + vehicle.attitude_WB * rig.mount_B_m - bearing_W_m
}

/// The rig's stops, after what `limits` holds: ends of the heave and the sway of `slider`, and the cone that `vehicle`
/// tilts in. Each is given with its number among `all`.
pub(super) fn stops(
    all: &[Body],
    rig: &Rig,
    slider: Option<(usize, &Slider)>,
    vehicle: (usize, &RigidBody),
    limits: &mut Vec<Limit>,
) {
    if let Some((number, slider)) = slider {
        let off_W_m = slider.position_W_m - rig.bearing_W_m;
        let aside = |axis| (axis, -rig.sway_m, rig.sway_m);
        let ways = [(Vector3::z(), 0.0, rig.heave_m), aside(Vector3::x()), aside(Vector3::y())];
        for (axis, lower_m, upper_m) in ways.into_iter().filter(|(_, lower_m, upper_m)| upper_m > lower_m) {
            let off_m = off_W_m.dot(&axis);
            let row = |along| Row::at(all, [0, number], [Vector3::zeros(); 2], along);
            limits.extend([stop(row(axis), off_m - lower_m), stop(row(-axis), upper_m - off_m)]);
        }
    }
    limits.extend(cone(all, rig, vehicle));
}

/// The cone; `None` where the vehicle is so level that no direction leads to it.
fn cone(all: &[Body], rig: &Rig, (number, vehicle): (usize, &RigidBody)) -> Option<Limit> {
    let up_W = vehicle.attitude_WB * Vector3::z();
    let across_W = Vector3::z().cross(&up_W);
    let sine = across_W.norm();
    let tilt_rad = libm::atan2(sine, up_W.z);
    let axis_W = across_W.try_normalize(1e-9)?;
    Some(stop(Row::about(all, [0, number], -axis_W), rig.tilt_max_rad - tilt_rad))
}

fn stop(normal: Row, gap: f64) -> Limit {
    Limit { normal, gap, restitution: 0.0, friction: None, least: f64::NEG_INFINITY, impulse: 0.0 }
}

/// `body` moved so that it hangs from the bearing, as high as it was within the heave and as its slider lets it move; it
/// turns as it did.
pub(super) fn hung(rig: &Rig, body: &RigidBody) -> RigidBody {
    let arm_W_m = body.attitude_WB * rig.mount_B_m;
    let wanted_m = body.position_W_m.z + arm_W_m.z - rig.bearing_W_m.z;
    let bearing_W_m = rig.bearing_W_m + Vector3::z() * wanted_m.clamp(0.0, rig.heave_m);
    let turning_W_m_s = (body.attitude_WB * body.angular_velocity_B_rad_s).cross(&arm_W_m);
    let mount_W_m_s = (body.velocity_W_m_s + turning_W_m_s).component_mul(&freedom(rig));
    RigidBody { position_W_m: bearing_W_m - arm_W_m, velocity_W_m_s: mount_W_m_s - turning_W_m_s, ..*body }
}

/// Whether the rig keeps a vehicle at rest where it is: always where it does not heave, and at the lower end of its
/// travel unless `lift_N`, the force on the vehicle beyond its weight, raises what hangs there.
pub(super) fn holds(rig: &Rig, body: &RigidBody, lift_N: f64, gravity_m_s2: f64) -> bool {
    let raised_m = off_W_m(rig, &hung(rig, body), &rig.bearing_W_m).z;
    let needed_N = rig.moving_mass_kg * gravity_m_s2 + rig.slide_friction_N;
    rig.heave_m == 0.0 || (raised_m < LOWER_END_M && lift_N < needed_N)
}

/// The angular impulse of the bearing's friction on a vehicle that turns with `spin_W_rad_s`, over a step of
/// `span_s`. At most it stops a body of the least moment of inertia, `inertia_kg_m2`: friction never turns a motion
/// round.
pub(super) fn bearing_friction_W_N_m_s(
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
    let stopping_N_m_s = inertia_kg_m2 * spin_rad_s;
    spin_W_rad_s * (-(dry_and_viscous_N_m * span_s).min(stopping_N_m_s) / spin_rad_s)
}
