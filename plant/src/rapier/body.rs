//! The vehicle's body in rapier's world, which owns its pose and velocity: this room alone writes and reads
//! them. Here alone, too, rapier's vectors (glam) and ours (nalgebra) become each other.
//!
//! Rapier keeps the angular velocity in the world frame; [`RigidBody`] has it in the body frame.

use crate::state::RigidBody;
use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use rapier3d_f64::dynamics::{MassProperties, RigidBody as Owner, RigidBodyBuilder};
use rapier3d_f64::math::{Pose, Rotation, Vector};
use vehicles::Vehicle;

/// The body of `vehicle`, at the origin. Its mass is the vehicle's, whatever its colliders' shapes. Rapier's own
/// gyroscopic term is off, as the torque that is put on it holds that already; it never sleeps, as motors may
/// start at any tick.
pub(super) fn owner(vehicle: &Vehicle) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic()
        .additional_mass_properties(mass(vehicle))
        .gyroscopic_forces_enabled(false)
        .allow_fast_rotation(true)
        .can_sleep(false)
}

/// Mass and inertia, with principal axes of our own: rapier finds those of an inertia with products with the C
/// library's cosine, whose last digit differs from processor to processor.
fn mass(vehicle: &Vehicle) -> MassProperties {
    let mut principal = vehicle.inertia_kg_m2.symmetric_eigen();
    if principal.eigenvectors.determinant() < 0.0 {
        principal.eigenvectors.column_mut(2).neg_mut();
    }
    let axes =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(principal.eigenvectors));
    let moments = to_rapier(&principal.eigenvalues);
    MassProperties::with_principal_inertia_frame(Vector::ZERO, vehicle.mass_kg, moments, rotation(&axes))
}

/// Pose and velocity, as rapier has them.
pub(super) fn read(owner: &Owner) -> RigidBody {
    let attitude_WB = attitude(owner.rotation());
    RigidBody {
        position_W_m: from_rapier(owner.translation()),
        velocity_W_m_s: from_rapier(owner.linvel()),
        attitude_WB,
        angular_velocity_B_rad_s: attitude_WB.inverse_transform_vector(&from_rapier(owner.angvel())),
    }
}

/// Gives rapier another pose and velocity.
pub(super) fn write(owner: &mut Owner, body: &RigidBody) {
    owner.set_position(pose(body), true);
    owner.set_linvel(to_rapier(&body.velocity_W_m_s), true);
    owner.set_angvel(to_rapier(&(body.attitude_WB * body.angular_velocity_B_rad_s)), true);
}

/// The pose, as rapier writes it.
pub(super) fn pose(body: &RigidBody) -> Pose {
    Pose::from_parts(to_rapier(&body.position_W_m), rotation(&body.attitude_WB))
}

/// Puts a force and a torque on the body for the next step, instead of those of the last.
pub(super) fn push(owner: &mut Owner, force_W_N: &Vector3<f64>, torque_W_N_m: &Vector3<f64>) {
    owner.reset_forces(true);
    owner.reset_torques(true);
    owner.add_force(to_rapier(force_W_N), true);
    owner.add_torque(to_rapier(torque_W_N_m), true);
}

/// A vector as rapier writes it.
pub(super) fn to_rapier(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// A vector of rapier's.
pub(super) fn from_rapier(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn attitude(rotation: &Rotation) -> UnitQuaternion<f64> {
    // Rapier normalises at every step; once more would only move the last bits.
    UnitQuaternion::new_unchecked(Quaternion::new(rotation.w, rotation.x, rotation.y, rotation.z))
}

fn rotation(attitude: &UnitQuaternion<f64>) -> Rotation {
    let [x, y, z, w] = attitude.coords.into();
    Rotation::from_xyzw(x, y, z, w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    /// Principal moments that a body may have, about axes turned in many ways.
    #[test]
    fn rapier_has_the_inertia_of_the_vehicle() {
        let text = vehicles::reference::HUMMINGBIRD;
        let mut vehicle = Vehicle::parse(text, "hummingbird.toml").unwrap();
        let moments = Matrix3::from_diagonal(&Vector3::new(5.6e-3, 4.1e-3, 8.1e-3));
        for turn in 0..100 {
            let turn = f64::from(turn) * 0.3;
            let axes = Rotation3::from_euler_angles(turn, 2.0 * turn, -0.7 * turn);
            let inertia = axes * moments * axes.inverse();
            // As a file gives it: products of inertia once.
            vehicle.inertia_kg_m2 = 0.5 * (inertia + inertia.transpose());
            let found = mass(&vehicle).reconstruct_inertia_matrix();
            let columns = [found.x_axis, found.y_axis, found.z_axis].map(from_rapier);
            let off = Matrix3::from_columns(&columns) - vehicle.inertia_kg_m2;
            assert!(off.amax() < 1e-16, "turn {turn}: {off}");
        }
    }
}
