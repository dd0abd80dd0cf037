//! Noise of measured rotor speeds, and what it takes from a coefficient.
//!
//! Noise in a regressor flattens its coefficient (Fuller, Measurement Error Models, 1987, section 1.1). The torque about z
//! depends on small differences of the rotors' speeds and on their derivatives, of which noise can be a good part. The
//! products of the noise are estimated by noise of the same size, and taken off the normal equations (section 2.2).

use flights::Flight;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use vehicles::ROTORS_MAX;

use super::least_squares::{self, Prior, Rows, Solution, Weighting};
use crate::numbers::normal::{self, Block};

/// Beyond this part of the squares of a column, noise hides its signal.
const HIDDEN: f64 = 0.5;

/// A solution with the noise of the speeds taken off.
pub struct Corrected {
    /// The solution.
    pub solution: Solution,
    /// Part of each parameter's information that is noise.
    shares: Vec<f64>,
}

impl Corrected {
    /// True if noise is most of what a parameter is told by.
    pub fn hides(&self, parameter: usize) -> bool {
        self.shares[parameter] > HIDDEN
    }
}

/// Standard deviation of the noise of each rotor's speed in rad/s, as third differences show it. Of speeds that are logged
/// slower than the motors follow these hold their motion too: then it is an upper bound.
pub fn deviations(flight: &Flight) -> [f64; ROTORS_MAX] {
    let values = &flight.rotor_speed.values;
    let of_rotor = |rotor: usize| {
        let third = |four: &[[f64; ROTORS_MAX]]| {
            four[3][rotor] - 3.0 * four[2][rotor] + 3.0 * four[1][rotor] - four[0][rotor]
        };
        let squares: f64 = values.windows(4).map(third).map(|third| third * third).sum();
        // The squares of 1, 3, 3 and 1.
        (squares / (20.0 * values.len().max(1) as f64)).sqrt()
    };
    std::array::from_fn(of_rotor)
}

/// The flight with noise of the same size on its rotor speeds once more.
pub fn disturbed(flight: &Flight) -> Flight {
    let mut random = ChaCha8Rng::seed_from_u64(flight.rotor_speed.values.len() as u64);
    // Only the variance counts: even noise from -1 to 1 has a third.
    let mut draw = || 3.0_f64.sqrt() * (2.0 * (random.next_u64() >> 11) as f64 / 2.0_f64.powi(53) - 1.0);
    let (deviations, mut flight) = (deviations(flight), flight.clone());
    for speeds in &mut flight.rotor_speed.values {
        speeds.iter_mut().zip(deviations).for_each(|(speed, deviation)| *speed += deviation * draw());
    }
    flight
}

/// Fits linear `rows` with the noise of their columns taken off, which `noisy` rows of the same flights have twice.
pub fn corrected(rows: &[Rows], noisy: &[Rows], priors: &[Prior]) -> Option<Corrected> {
    let noises = least_squares::noises_of_fit(rows, priors, Weighting::Whitened);
    let blocks = least_squares::blocks(rows, &noises);
    let noise: Vec<Rows> = rows.iter().zip(noisy).map(|(rows, noisy)| difference(rows, noisy)).collect();
    let noise = least_squares::blocks(&noise, &noises);
    if blocks.len() < least_squares::BLOCKS_MIN || noise.len() != blocks.len() {
        return None;
    }
    let inverse = normal::inverse(&normal::sum(&blocks).gram);
    let products = normal::sum(&noise).gram;
    let size = rows.first()?.columns.len();
    let shares = (0..size).map(|at| products[(at, at)] * inverse[(at, at)]).collect();
    let less = |(block, noise): (&Block, &Block)| Block { gram: &block.gram - &noise.gram, ..block.clone() };
    let blocks: Vec<Block> = blocks.iter().zip(&noise).map(less).collect();
    Some(Corrected { solution: Solution::of(vec![0.0; size], &blocks, priors), shares })
}

/// The noise of the columns; the measured side has none of it.
fn difference(rows: &Rows, noisy: &Rows) -> Rows {
    let column =
        |(column, noisy): (&Vec<f64>, &Vec<f64>)| column.iter().zip(noisy).map(|(a, b)| b - a).collect();
    let columns = rows.columns.iter().zip(&noisy.columns).map(column).collect();
    // Values keep the blocks that have rows.
    Rows { columns, ..rows.clone() }
}
