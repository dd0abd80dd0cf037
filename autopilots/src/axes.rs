//! Axes of ArduPilot and PX4: body forward, right, down; world north, east, down. The run's are body forward, left, up; world east,
//! north, up ([`crate::origin`]).

use bus::messages::{Quaternion, Vector3};
use nalgebra::Quaternion as Product;
use std::f64::consts::FRAC_1_SQRT_2;

/// Forward, right, down of a vector of the body: forward, left, up.
#[must_use]
pub fn forward_right_down(vector: Vector3) -> [f64; 3] {
    [vector.x, -vector.y, -vector.z]
}

/// North, east, down of a vector of the world: east, north, up.
#[must_use]
pub fn north_east_down(vector: Vector3) -> [f64; 3] {
    [vector.y, vector.x, -vector.z]
}

/// Attitude from forward, right, down to north, east, down; w, x, y, z, with w not below 0.
#[must_use]
pub fn attitude(attitude: Quaternion) -> [f64; 4] {
    let Quaternion { x, y, z, w } = attitude;
    // Half a turn about the line between east and north changes the world's axes, half a turn about x the body's.
    let world = Product::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
    let body = Product::new(0.0, 1.0, 0.0, 0.0);
    let product = world * Product::new(w, x, y, z) * body;
    // The two quaternions of an attitude differ by their sign.
    let sign = if product.w < 0.0 { -1.0 } else { 1.0 };
    [product.w, product.i, product.j, product.k].map(|part| sign * part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    /// Roll, pitch and yaw that a firmware reads: to the right, nose up, clockwise from north, degrees.
    fn read_deg(roll: f64, pitch: f64, yaw: f64) -> [f64; 3] {
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_radians);
        let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let [w, x, y, z] = attitude(Quaternion { x: turned.i, y: turned.j, z: turned.k, w: turned.w });
        let (roll, pitch, yaw) = UnitQuaternion::from_quaternion(Product::new(w, x, y, z)).euler_angles();
        [roll, pitch, yaw].map(f64::to_degrees)
    }

    #[test]
    fn vectors_have_their_signs() {
        assert_eq!(forward_right_down([1.0, 2.0, 3.0].into()), [1.0, -2.0, -3.0]);
        assert_eq!(north_east_down([1.0, 2.0, 3.0].into()), [2.0, 1.0, -3.0]);
    }

    #[test]
    fn attitudes_have_their_signs() {
        // Ours is about x forward, y left, z up: the nose goes down with a positive pitch, and to the left with a positive yaw.
        for (given, expected) in [
            ([0.0, 0.0, 0.0], [0.0, 0.0, 90.0]),
            ([10.0, 0.0, 0.0], [10.0, 0.0, 90.0]),
            ([0.0, 10.0, 0.0], [0.0, -10.0, 90.0]),
            ([0.0, 0.0, 30.0], [0.0, 0.0, 60.0]),
            ([0.0, 0.0, 90.0], [0.0, 0.0, 0.0]),
            ([5.0, -8.0, 130.0], [5.0, 8.0, -40.0]),
        ] {
            let found = read_deg(given[0], given[1], given[2]);
            let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6);
            assert!(is_near, "{given:?}: {found:?}, expected {expected:?}");
        }
    }
}
