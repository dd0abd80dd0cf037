//! Shape of a vehicle for contacts: a flat disc around its propellers, and four feet below.
//!
//! Vehicle files give the rotors' places, but neither propellers nor feet. Those of the Hummingbird are scaled
//! with the length of the arms; for a Crazyflie 2.1 that gives propellers of 2.7 cm instead of 2.3 cm. Where an
//! effect moves the centre of mass, the frame stays as it is: all of it moves the other way, seen from there.

use crate::airframe::Airframe;
use crate::arms::amid_rotors_B_m;
use nalgebra::Vector3;

/// Arm of the Hummingbird: half of the 0.34 m between motor axes (thesis Table 2.1).
const HUMMINGBIRD_ARM_M: f64 = 0.17;
/// Radius of its propellers: 8 inch in diameter (thesis Table 2.1).
const HUMMINGBIRD_PROPELLER_M: f64 = 0.1016;
/// Half of the disc's thickness: tuned, no source; about a motor with its propeller.
const HUMMINGBIRD_DISC_HALF_M: f64 = 0.015;
/// Distance from the centre of mass down to the ground under the feet: half of `body_height`, 0.12 m (RotorS,
/// rotors_description/urdf/hummingbird.xacro).
const HUMMINGBIRD_STAND_M: f64 = 0.06;
/// Distance of the feet from the middle along body x and y: half of `body_width`, 0.1 m (the same file).
const HUMMINGBIRD_FOOT_OUT_M: f64 = 0.05;
/// Radius of the balls that the feet end in: tuned, no source.
const HUMMINGBIRD_FOOT_RADIUS_M: f64 = 0.01;

/// The shape of a vehicle, from its centre of mass, in the body frame.
///
/// ```
/// use plant::{Airframe, contact_dynamics::hull::Hull};
///
/// let vehicle = vehicles::Vehicle::parse(vehicles::reference::HUMMINGBIRD, "hummingbird.toml").unwrap();
/// let hull = Hull::of(&Airframe::new(vehicle));
/// assert!((hull.stand_m() - 0.06).abs() < 1e-12 && (hull.disc_radius_m - 0.2716).abs() < 1e-12, "{hull:?}");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hull {
    /// Radius of the disc around all propellers; its axis is body z.
    pub disc_radius_m: f64,
    /// Half of the disc's thickness.
    pub disc_half_m: f64,
    /// The disc's middle: the mean of the rotors' places.
    pub centre_B_m: Vector3<f64>,
    /// Centres of the feet.
    pub feet_B_m: [Vector3<f64>; 4],
    /// Radius of the feet.
    pub foot_radius_m: f64,
}

impl Hull {
    /// The hull of the vehicle as it flies.
    #[must_use]
    pub fn of(airframe: &Airframe) -> Self {
        let (rotors, shift_B_m) = (&airframe.vehicle().rotors, airframe.frame_shift_B_m());
        let centre_B_m = amid_rotors_B_m(airframe.vehicle());
        let arms_m = rotors.iter().map(|rotor| (rotor.position_m - centre_B_m).xy().norm());
        let arm_m = arms_m.fold(0.0, f64::max);
        let scale = arm_m / HUMMINGBIRD_ARM_M;
        let (out_m, radius_m) = (HUMMINGBIRD_FOOT_OUT_M * scale, HUMMINGBIRD_FOOT_RADIUS_M * scale);
        let middle_B_m = Vector3::new(centre_B_m.x, centre_B_m.y, shift_B_m.z);
        let foot_z_m = radius_m - HUMMINGBIRD_STAND_M * scale;
        let corners = [(out_m, out_m), (out_m, -out_m), (-out_m, -out_m), (-out_m, out_m)];
        Self {
            disc_radius_m: arm_m + HUMMINGBIRD_PROPELLER_M * scale,
            disc_half_m: HUMMINGBIRD_DISC_HALF_M * scale,
            centre_B_m,
            feet_B_m: corners.map(|(x, y)| middle_B_m + Vector3::new(x, y, foot_z_m)),
            foot_radius_m: radius_m,
        }
    }

    /// Height of the centre of mass above the ground when the vehicle stands on its feet.
    #[must_use]
    pub fn stand_m(&self) -> f64 {
        self.foot_radius_m - self.feet_B_m[0].z
    }

    /// Returns the greatest distance of any point of it from the centre of mass.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        let rim_m = self.centre_B_m.norm() + self.disc_radius_m + self.disc_half_m;
        let feet_m = self.feet_B_m.iter().map(|foot_B_m| foot_B_m.norm() + self.foot_radius_m);
        feet_m.fold(rim_m, f64::max)
    }
}
