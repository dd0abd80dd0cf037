//! Torques of forces that no effect explains.
//!
//! Such a force acts somewhere, and so turns the vehicle too; a controller answers the torque by the rotors. To a fit that knows nothing of
//! the force, rotors then seem to have little torque. The part of a torque residual that force residuals predict at the same moment is
//! subtracted, as in seemingly unrelated regressions (Zellner, J. American Statistical Association 57, 1962).
//!
//! Effects have the torques that follow the velocity. So the regression has the velocity beside the forces, and only the
//! part of the forces is used. This is a working covariance, not the likelihood; intervals are those of the jackknife.

#![allow(
    clippy::disallowed_types,
    reason = "not in a component: reports of flights, whose products are summed by hand"
)]

use crate::numbers::normal::{self, Block};
use crate::numbers::statistics::chance_of_no_gain;
use nalgebra::DVector;

/// Forces have to predict this part of what the velocity leaves of the torque's squares; tuned, no source.
const LEAST_PART: f64 = 0.05;
/// Chance of as much gain by blocks that forces do not predict.
const LEVEL: f64 = 0.01;
/// From fewer blocks no gain is beyond chance.
const LEAST_BLOCKS: usize = 12;
/// Columns of forces and velocity, and of the velocity alone.
const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];
const VELOCITY: [usize; 3] = [3, 4, 5];

/// Residuals of one flight, by knot.
#[derive(Debug, Clone, Copy)]
pub struct Moments<'r> {
    /// Angular acceleration about one axis, in rad/s^2.
    pub torque: &'r [f64],
    /// Specific force along x, y and z of the body, in m/s^2.
    pub forces: &'r [Vec<f64>; 3],
    /// Velocity in the body, in m/s.
    pub velocities: &'r [[f64; 3]],
    /// First knot of each block of time, and the one behind its last.
    pub blocks: &'r [(usize, usize)],
}

/// The angular acceleration by each specific force, in rad/m; `None` where the forces predict nothing beyond chance: blocks are predicted by
/// a regression on the others. Each flight may have means of its own.
pub fn factors(flights: &[Moments]) -> Option<[f64; 3]> {
    let blocks: Vec<Block> = flights.iter().flat_map(equations).collect();
    if blocks.len() < LEAST_BLOCKS {
        return None;
    }
    let total = normal::sum(&blocks);
    let gain = |block: &Block| {
        let others = total.without(block);
        cost(block, &others, &VELOCITY) - cost(block, &others, &ALL)
    };
    let gains: Vec<f64> = blocks.iter().map(gain).collect();
    let (all, by_velocity) = (cost(&total, &total, &ALL), cost(&total, &total, &VELOCITY));
    let is_large = all < (1.0 - LEAST_PART) * by_velocity;
    let found = solved(&total, &ALL);
    (is_large && chance_of_no_gain(&gains) < LEVEL).then(|| [found[0], found[1], found[2]])
}

/// The normal equations of the blocks of a flight, by forces and velocity.
fn equations(flight: &Moments) -> Vec<Block> {
    let torque = centred(flight.torque.to_vec());
    let forces = flight.forces.each_ref().map(|force| centred(force.clone()));
    let velocity = |axis: usize| centred(flight.velocities.iter().map(|velocity| velocity[axis]).collect());
    let velocities = [0, 1, 2].map(velocity);
    let of_block = |(first, end): &(usize, usize)| {
        let mut block = Block::zero(ALL.len());
        for at in *first..*end {
            let row: Vec<f64> = forces.iter().chain(&velocities).map(|column| -column[at]).collect();
            block.add(torque[at], &row, 1.0);
        }
        block.complete();
        block
    };
    flight.blocks.iter().map(of_block).collect()
}

/// The regression on some of the columns.
fn solved(block: &Block, columns: &[usize]) -> DVector<f64> {
    let of = block.of(columns);
    -(normal::inverse(&of.gram) * &of.gradient)
}

/// The squares of `block` that a regression of `others` leaves.
fn cost(block: &Block, others: &Block, columns: &[usize]) -> f64 {
    block.of(columns).cost_after(&solved(others, columns))
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
        let blocks: Vec<(usize, usize)> = (0..40).map(|at| (50 * at, 50 * (at + 1))).collect();
        factors(&[Moments { torque: &torque, forces: &forces, velocities: &velocities, blocks: &blocks }])
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

    /// Slow series that have nothing to do with each other look alike for a while.
    #[test]
    fn slow_forces_and_torques_that_are_independent_are_left_alone() {
        let slow = |salt: u64| -> Vec<f64> {
            let mut state = 0.0;
            let next = |at: usize| {
                state = 0.97 * state + drawn(at, salt);
                state
            };
            (0..2000).map(next).collect()
        };
        let blocks: Vec<(usize, usize)> = (0..40).map(|at| (50 * at, 50 * (at + 1))).collect();
        let is_found = |seed: u64| {
            let [torque, vx, vy, vz] = [1, 2, 3, 4].map(|salt| slow(10 * seed + salt));
            let velocities: Vec<[f64; 3]> = (0..2000).map(|at| [vx[at], vy[at], vz[at]]).collect();
            let forces = [5, 6, 7].map(|salt| slow(10 * seed + salt));
            let moments =
                Moments { torque: &torque, forces: &forces, velocities: &velocities, blocks: &blocks };
            factors(&[moments]).is_some()
        };
        let count = (1..=40).filter(|seed| is_found(*seed)).count();
        assert!(count <= 4, "{count} of 40");
    }
}
