//! A test rig: a slider on the vertical, and a bearing that the vehicle hangs from.
//!
//! The slider only moves up and down, and sideways where the rig sways: level within a square, as the lower end of a
//! long tube does for small angles, without friction or a restoring force. The mass that hangs with the bearing is
//! lumped in its centre. A ball joint ties the vehicle's mount to it and leaves all three rotations free. So
//! the slider has no state of its own: it is where the mount is. The mount carries its mass along the free
//! axes. Along the others the slider holds the mount.
//!
//! The tilt limit is a cone, as of a rod end, and the same at any yaw: a limit on Euler angles would not be. All
//! stops are inelastic: a rope, a rod end's collar, a tube in a tube.

use super::solver::{Body, Row, Unilateral, join, part, stop};
use crate::newton_euler::NewtonEuler;
use crate::state::{BodyRates, Rates, RigidBody, State};
use nalgebra::{Matrix3, Matrix3x6, Matrix6, UnitQuaternion, Vector3, Vector6};
use scenes::Rig;

/// A bearing that starts lower than this above the lower end of its travel is there: tuned, no source.
const LOWER_END_M: f64 = 1e-6;

/// Length of the lever at which the gap to the cone is measured, so that the gap is in metres. Tuned, no source.
const LEVER_M: f64 = 0.1;

/// For each axis of the world 1 where the slider moves along it, and 0 where it is held.
fn freedom(rig: &Rig) -> Vector3<f64> {
    let [aside, up] = [rig.sway_m, rig.heave_m].map(|way_m| if way_m > 0.0 { 1.0 } else { 0.0 });
    Vector3::new(aside, aside, up)
}

/// Takes `rates` of free flight at `state` to those in the rig. The force P of the bearing acts on the
/// vehicle at its mount, at r from the centre of mass. The mount accelerates at a + α × r + ω × (ω × r). This
/// is zero along an axis where the slider is held. Along the others, P moves and carries the slider.
pub(super) fn hold(rig: &Rig, model: &NewtonEuler, state: &State, rates: Rates) -> Rates {
    let vehicle = model.vehicle();
    // Within a step the quaternion is not kept at length 1.
    let turn_WB = UnitQuaternion::new_normalize(state.body.attitude_WB.into_inner()).to_rotation_matrix();
    let inverse_inertia_W = turn_WB * model.inverse_inertia() * turn_WB.transpose();
    let [spin_W_rad_s, turning_W_rad_s2, arm_W_m] =
        [state.body.angular_velocity_B_rad_s, rates.body.angular_acceleration_B_rad_s2, rig.mount_B_m]
            .map(|vector_B| turn_WB * vector_B);
    let lever_W = arm_W_m.cross_matrix();
    let yields = Matrix3::identity() / vehicle.mass_kg - lever_W * inverse_inertia_W * lever_W;
    let mount_W_m_s2 = rates.body.acceleration_W_m_s2
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
    let body = BodyRates {
        acceleration_W_m_s2: rates.body.acceleration_W_m_s2 + force_W_N / vehicle.mass_kg,
        angular_acceleration_B_rad_s2: rates.body.angular_acceleration_B_rad_s2
            + turn_WB.inverse_transform_vector(&turned_W_rad_s2),
        ..rates.body
    };
    Rates { body, ..rates }
}

/// The vehicle in the rig at one attitude, as impulses see it.
pub(super) struct Mounted<'a> {
    rig: &'a Rig,
    /// Takes the vehicle's twist to the velocity of its mount.
    mount: Matrix3x6<f64>,
    /// The mobility of the vehicle alone.
    free: Matrix6<f64>,
}

impl<'a> Mounted<'a> {
    /// `vehicle` in `rig`, with the mobility that it has in free flight.
    pub(super) fn new(rig: &'a Rig, vehicle: &RigidBody, free: Matrix6<f64>) -> Self {
        let arm_W_m = vehicle.attitude_WB * rig.mount_B_m;
        let mut mount = Matrix3x6::zeros();
        mount.fixed_columns_mut::<3>(0).copy_from(&Matrix3::identity());
        mount.fixed_columns_mut::<3>(3).copy_from(&-arm_W_m.cross_matrix());
        Self { rig, mount, free }
    }

    /// The mobility in the rig: the mobility in free flight, reduced by the slider's mass and its guides.
    /// Computed by the Sherman-Morrison-Woodbury formula, with the inverse mass that the slider adds along
    /// each axis: 0 where it is held.
    pub(super) fn mobility(&self) -> Matrix6<f64> {
        let added = Matrix3::from_diagonal(&(freedom(self.rig) / self.rig.moving_mass_kg));
        let answer = self.free * self.mount.transpose();
        let inverse = (self.mount * answer + added).try_inverse().unwrap_or_else(Matrix3::zeros);
        self.free - answer * inverse * answer.transpose()
    }

    /// The twist, or the shift, that takes `off_W`, of the mount, away along the axes along which the slider is held.
    pub(super) fn back(&self, off_W: &Vector3<f64>) -> Vector6<f64> {
        let freedom = freedom(self.rig);
        let answer = self.free * self.mount.transpose();
        let (mut rows, mut off_W) = (self.mount * answer, *off_W);
        for axis in (0..3).filter(|&axis| freedom[axis] > 0.0) {
            rows.row_mut(axis).fill(0.0);
            rows.column_mut(axis).fill(0.0);
            (rows[(axis, axis)], off_W[axis]) = (1.0, 0.0);
        }
        rows.try_inverse().map_or(Vector6::zeros(), |inverse| answer * (inverse * -off_W))
    }

    /// The velocity of the mount, m/s.
    pub(super) fn mount_W_m_s(&self, twist: &Vector6<f64>) -> Vector3<f64> {
        self.mount * twist
    }

    /// The kinetic energy of the slider, J, with the vehicle's twist; twice the mixed one of two twists where they differ.
    pub(super) fn slider_energy_J(&self, one: &Vector6<f64>, other: &Vector6<f64>) -> f64 {
        let free = freedom(self.rig);
        0.5 * self.rig.moving_mass_kg * (self.mount * one).component_mul(&free).dot(&(self.mount * other))
    }

    /// The rig's stops, after the constraints in `constraints`: ends of the heave and the sway, and the cone in
    /// which `vehicle`, with the number `body` among `all`, tilts.
    pub(super) fn stops(
        &self,
        all: &[Body],
        body: usize,
        vehicle: &RigidBody,
        constraints: &mut Vec<Unilateral>,
    ) {
        let rig = self.rig;
        let off_W_m = off_W_m(rig, vehicle);
        let aside = |axis| (axis, -rig.sway_m, rig.sway_m);
        let ways = [(Vector3::z(), 0.0, rig.heave_m), aside(Vector3::x()), aside(Vector3::y())];
        for (axis, lower_m, upper_m) in ways.into_iter().filter(|(_, lower_m, upper_m)| upper_m > lower_m) {
            let off_m = off_W_m.dot(&axis);
            let row = |along: Vector3<f64>| Row::on(all, body, self.mount.transpose() * along);
            constraints.extend([stop(row(axis), off_m - lower_m), stop(row(-axis), upper_m - off_m)]);
        }
        let up_W = vehicle.attitude_WB * Vector3::z();
        let across_W = Vector3::z().cross(&up_W);
        let tilt_rad = libm::atan2(across_W.norm(), up_W.z);
        // Level, no direction leads to the cone.
        if let Some(axis_W) = across_W.try_normalize(1e-9) {
            let row = Row::on(all, body, join(&Vector3::zeros(), &(axis_W * -LEVER_M)));
            constraints.push(stop(row, LEVER_M * (rig.tilt_max_rad - tilt_rad)));
        }
    }

    /// The impulse of the rig's friction over a step of `span_s` on a vehicle with this twist. At most it stops the
    /// slider's mass and a body of the least moment of inertia, `inertia_kg_m2`: friction never turns a motion round.
    pub(super) fn friction(&self, twist: &Vector6<f64>, inertia_kg_m2: f64, span_s: f64) -> Vector6<f64> {
        let rig = self.rig;
        let speed_m_s = if rig.heave_m > 0.0 { self.mount_W_m_s(twist).z } else { 0.0 };
        let slide_N_s = against(
            speed_m_s.abs(),
            (rig.slide_friction_N, rig.slide_damping_N_s_m),
            rig.moving_mass_kg,
            span_s,
        );
        let spin_W_rad_s = part(twist)[1];
        let spin_rad_s = spin_W_rad_s.norm();
        let bearing = (rig.bearing_friction_N_m, rig.bearing_damping_N_m_s);
        let turn_N_m_s = against(spin_rad_s, bearing, inertia_kg_m2, span_s);
        let about_W = spin_W_rad_s.try_normalize(0.0).unwrap_or_default();
        let slide = self.mount.transpose() * (Vector3::z() * (-slide_N_s * speed_m_s.signum()));
        slide + join(&Vector3::zeros(), &(about_W * -turn_N_m_s))
    }
}

/// Returns the momentum that dry and viscous friction take of a motion over a step; at most all that this
/// inertia has.
fn against(rate: f64, (dry, viscous): (f64, f64), inertia: f64, span_s: f64) -> f64 {
    ((dry + viscous * rate) * span_s).min(inertia * rate)
}

/// Numbers that distinguish this rig from others: the place of its bearing, and the mass that hangs there.
pub(super) fn numbers(rig: &Rig) -> Vec<f64> {
    let places = rig.bearing_W_m.iter().chain(rig.mount_B_m.iter());
    places.copied().chain([rig.heave_m, rig.sway_m, rig.tilt_max_rad, rig.moving_mass_kg]).collect()
}

/// Returns the vector from the lower end of the bearing's travel to the vehicle's mount.
pub(super) fn off_W_m(rig: &Rig, vehicle: &RigidBody) -> Vector3<f64> {
    vehicle.position_W_m + vehicle.attitude_WB * rig.mount_B_m - rig.bearing_W_m
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

/// True if the rig keeps a vehicle at rest where it is. A rig that does not heave always does. Any other does
/// so at the lower end of its travel, unless `lift_N` raises the mass that hangs there. This is the force on
/// the vehicle beyond its weight.
pub(super) fn holds(rig: &Rig, body: &RigidBody, lift_N: f64, gravity_m_s2: f64) -> bool {
    let raised_m = off_W_m(rig, &hung(rig, body)).z;
    let needed_N = rig.moving_mass_kg * gravity_m_s2 + rig.slide_friction_N;
    rig.heave_m == 0.0 || (raised_m < LOWER_END_M && lift_N < needed_N)
}
