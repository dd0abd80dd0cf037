//! Factors and summands of a log's numbers: counts of a sensor, hundreds of revolutions.

use crate::declaration::EachNumber;
use crate::error::{LogError, Spot};

/// The number that `key` declares for each of the `count` numbers of a sample; `default` where it declares none.
pub fn each(
    key: Spot,
    declared: Option<&EachNumber>,
    default: f64,
    count: usize,
) -> Result<Vec<f64>, LogError> {
    let numbers = match declared {
        None => return Ok(vec![default; count]),
        Some(EachNumber::All(number)) => vec![*number; count],
        Some(EachNumber::Each(numbers)) if numbers.len() == count => numbers.clone(),
        Some(EachNumber::Each(numbers)) => {
            let expected = format!("a number, or a list of {count}");
            let found = format!("a list of {}", numbers.len());
            let advice = "give one for all, or one for each number of a sample";
            return Err(LogError::unexpected(key, expected, found, advice));
        }
    };
    // A scale of 0 makes a channel that does not move.
    let is_usable = |number: &f64| number.is_finite() && (default == 0.0 || *number != 0.0);
    match numbers.iter().find(|number| !is_usable(number)) {
        None => Ok(numbers),
        Some(number) => {
            let expected = if default == 0.0 { "finite numbers" } else { "finite numbers other than 0" };
            let advice = "leave it out where the unit alone converts the numbers";
            Err(LogError::unexpected(key, expected, number.to_string(), advice))
        }
    }
}
