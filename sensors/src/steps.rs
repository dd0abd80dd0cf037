//! Rounding of a value to a resolution.

/// The multiple of `step` that is nearest to `value`; any value where `step` is 0.
pub(crate) fn in_steps(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

#[cfg(test)]
mod tests {
    use super::in_steps;

    #[test]
    fn a_value_becomes_the_nearest_multiple_and_a_step_of_zero_changes_none() {
        assert_eq!([0.74, 0.76, -0.76].map(|value| in_steps(value, 0.5)), [0.5, 1.0, -1.0]);
        assert_eq!(in_steps(0.123_456, 0.0), 0.123_456);
    }
}
