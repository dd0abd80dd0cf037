//! What the tests of sensors share.

use crate::channel::Channel;
use bus::Message;

/// A tick of 1 ms.
pub(crate) const TICK_NS: u64 = 1_000_000;

/// Requires that mean and variance of `values` are within six of their standard deviations of those of a normal
/// distribution: passed by luck once in 10⁹ seeds.
#[track_caller]
pub(crate) fn require_normal(values: impl Iterator<Item = f64>, mean: f64, sigma: f64) {
    let errors = values.map(|value| (value - mean) / sigma);
    let (count, sum, squares) =
        errors.fold((0.0, 0.0, 0.0), |(n, sum, squares), e| (n + 1.0, sum + e, squares + e * e));
    let (offset, variance): (f64, f64) = (sum / count, squares / count);
    assert!(offset.abs() < 6.0 / count.sqrt(), "the mean is {offset} standard deviations off");
    assert!(
        (variance - 1.0).abs() < 6.0 * (2.0 / count).sqrt(),
        "the variance is {variance} of the expected"
    );
}

/// Requires that a node with a channel of its own goes on from the memory of another, in mid-flight, with the same
/// bytes.
#[track_caller]
pub(crate) fn require_hand_over<S: Message, R: Message>(
    channel: impl Fn() -> Channel,
    mut memory: S,
    sample: impl Fn(&mut Channel, &mut S, u64) -> R,
) {
    let mut first = channel();
    for tick in 0..777 {
        sample(&mut first, &mut memory, tick * TICK_NS);
    }
    let (mut second, mut handed) = (channel(), memory);
    for tick in 777..2000 {
        let expected = sample(&mut first, &mut memory, tick * TICK_NS);
        let found = sample(&mut second, &mut handed, tick * TICK_NS);
        assert!(bytemuck::bytes_of(&found) == bytemuck::bytes_of(&expected), "another sample at tick {tick}");
    }
    assert!(bytemuck::bytes_of(&handed) == bytemuck::bytes_of(&memory), "another memory");
}
