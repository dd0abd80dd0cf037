//! Torques of forces that no effect explains.
//!
//! Such a force acts somewhere, and so turns the vehicle too; a controller answers the torque by the rotors. To a fit that knows nothing of
//! the force, rotors then seem to have little torque. What residuals of forces predict of those of torques at the same moment is taken off
//! (seemingly unrelated regressions: Zellner, J. American Statistical Association 57, 1962). What a torque owes to the velocity is left to
//! the effects that have it: the regression has the velocity beside the forces, and only the part of the forces is used.

use crate::normal::{self, Block};

/// Forces have to predict this part of what the velocity leaves of the torque's squares, or it is chance; tuned, no source.
const LEAST_PART: f64 = 0.05;

/// Residuals of one flight, by knot.
#[derive(Debug, Clone, Copy)]
pub struct Moments<'r> {
    /// Angular acceleration about one axis, in rad/s^2.
    pub torque: &'r [f64],
    /// Specific force along x, y and z of the body, in m/s^2.
    pub forces: &'r [Vec<f64>; 3],
    /// Velocity in the body, in m/s.
    pub velocities: &'r [[f64; 3]],
}

/// The angular acceleration by each specific force, in rad/m; `None` where the forces predict nothing beyond chance. Each flight may have
/// means of its own.
pub fn factors(flights: &[Moments]) -> Option<[f64; 3]> {
    let mut block = Block::zero(6);
    for Moments { torque, forces, velocities } in flights {
        let torque = centred(torque.to_vec());
        let forces = forces.each_ref().map(|force| centred(force.clone()));
        let velocities =
            [0, 1, 2].map(|axis| centred(velocities.iter().map(|velocity| velocity[axis]).collect()));
        for (at, residual) in torque.iter().enumerate() {
            let row: Vec<f64> = forces.iter().chain(&velocities).map(|column| column[at]).collect();
            block.add(*residual, &row, 1.0);
        }
    }
    block.complete();
    let left = |free: &[usize]| {
        let of = block.of(free);
        let found = normal::inverse(&of.gram) * &of.gradient;
        (of.cost - of.gradient.dot(&found), found)
    };
    let (all, found) = left(&[0, 1, 2, 3, 4, 5]);
    let (by_velocity, _) = left(&[3, 4, 5]);
    (all < (1.0 - LEAST_PART) * by_velocity).then(|| [found[0], found[1], found[2]])
}

fn centred(column: Vec<f64>) -> Vec<f64> {
    let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
    column.into_iter().map(|row| row - mean).collect()
}

#[cfg(test)]
mod tests {
    use super::{Moments, factors};

    /// A number between -1 and 1 that looks drawn.
    fn drawn(at: usize, salt: u64) -> f64 {
        let mixed =
            (at as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15 ^ salt.wrapping_mul(0xbf58_476d_1ce4_e5b9));
        ((mixed ^ (mixed >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11) as f64 / (1_u64 << 52) as f64
            - 1.0
    }

    /// The factors of a flight whose torque is `by_force` times a gust along y, `by_velocity` times the velocity along y, a mean and noise.
    fn found(by_force: f64, by_velocity: f64) -> Option<[f64; 3]> {
        let column = |salt: u64| -> Vec<f64> { (0..2000).map(|at| drawn(at, salt)).collect() };
        let velocities: Vec<[f64; 3]> = (0..2000).map(|at| [3, 4, 5].map(|salt| drawn(at, salt))).collect();
        // Drag that no effect has: the force follows the velocity too.
        let gust = |(gust, velocity): (f64, &[f64; 3])| gust - 0.5 * velocity[1];
        let forces = [column(6), column(7).into_iter().zip(&velocities).map(gust).collect(), column(8)];
        let torque =
            |at: usize| 4.0 + by_force * forces[1][at] + by_velocity * velocities[at][1] + drawn(at, 9);
        let torque: Vec<f64> = (0..2000).map(torque).collect();
        factors(&[Moments { torque: &torque, forces: &forces, velocities: &velocities }])
    }

    #[test]
    fn the_lever_of_a_gust_is_found_beside_a_torque_by_the_velocity() {
        let [x, y, z] = found(-50.0, 20.0).expect("forces predict the torque");
        assert!(x.abs() < 0.2 && (y + 50.0).abs() < 0.2 && z.abs() < 0.2, "{x} {y} {z}");
    }

    #[test]
    fn a_torque_by_the_velocity_alone_is_left_to_effects() {
        assert_eq!(found(0.0, 20.0), None);
        assert_eq!(found(0.0, 0.0), None);
    }
}
