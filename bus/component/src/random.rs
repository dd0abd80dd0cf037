//! One counter-based random stream per node, derived from the run's seed and the node's name.
//!
//! Adding or removing a node changes no other node's stream, and a stream does not depend on the
//! order in which processes start.

mod normal;

pub use normal::normal;

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// The generator behind every node's noise.
///
/// ```
/// let mut imu = component::random::stream(7, "imu");
/// let drawn: f64 = (0..1000).map(|_| component::random::normal(&mut imu)).sum();
/// assert!((drawn / 1000.0).abs() < 0.1, "the mean of 1000 draws is near 0");
/// ```
pub type Stream = ChaCha8Rng;

/// The random stream of the node named `node` in a run whose seed is `run_seed`.
///
/// The 32-byte ChaCha key is the run seed followed by three FNV-1a hashes of the name, each started from another
/// offset. Two names share a stream only if all three collide.
#[must_use]
pub fn stream(run_seed: u64, node: &str) -> Stream {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&run_seed.to_le_bytes());
    for (lane, chunk) in key[8..].chunks_exact_mut(8).enumerate() {
        let hash = fnv1a(node.as_bytes(), FNV_OFFSET.wrapping_add(lane as u64));
        chunk.copy_from_slice(&hash.to_le_bytes());
    }
    Stream::from_seed(key)
}

/// A copy of `stream` that continues `words` words of 32 bits after its start.
///
/// A component does not change, so it keeps its stream at the start. The position belongs to its state, or follows from the
/// tick.
///
/// ```
/// use component::random::{at, normal, stream};
///
/// let imu = stream(7, "imu");
/// let mut random = imu.clone();
/// let first = normal(&mut random);
/// let drawn_words = random.get_word_pos();
/// assert_eq!(normal(&mut at(&imu, drawn_words)), normal(&mut random));
/// assert_eq!(normal(&mut at(&imu, 0)), first);
/// ```
#[must_use]
pub fn at(stream: &Stream, words: u128) -> Stream {
    let mut random = stream.clone();
    random.set_word_pos(words);
    random
}

/// The next draw, evenly from 0 up to 1: a multiple of 2^-53.
pub fn uniform(random: &mut impl Rng) -> f64 {
    (random.next_u64() >> 11) as f64 * (0.5 * f64::EPSILON)
}

/// The number of this exponent whose fraction are the highest bits of `bits`: from 2^exponent up to twice that.
fn exponent_and_fraction(exponent: u64, bits: u64) -> f64 {
    f64::from_bits((1023 + exponent) << 52 | bits >> 12)
}

/// Start of [`fnv1a`].
#[doc(hidden)]
pub const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a over `bytes`, started from `offset` (Fowler, Noll, Vo; draft-eastlake-fnv).
#[doc(hidden)]
#[must_use]
pub fn fnv1a(bytes: &[u8], offset: u64) -> u64 {
    bytes.iter().fold(offset, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(FNV_PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_a_function_of_seed_and_name() {
        let first = |seed, name| stream(seed, name).next_u64();
        assert_eq!(first(7, "imu"), first(7, "imu"));
        assert_ne!(first(7, "imu"), first(8, "imu"));
        assert_ne!(first(7, "imu"), first(7, "gps"));
    }
}
