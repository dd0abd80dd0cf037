//! Commands of a log beside the motion of the vehicle: what tells commands from numbers that a logger or an exporter put in their
//! place.

/// Commands of a log beside the motion of the vehicle.
#[derive(Debug, Clone)]
pub struct CommandLog<'a> {
    /// Times of the commands.
    pub time_s: &'a [f64],
    /// Commands, a column for each rotor.
    pub rotors: Vec<Vec<f64>>,
    /// Least and greatest command of the vehicle; infinite where they are not known.
    pub range: (f64, f64),
    /// Times of the angular velocity.
    pub rate_time_s: &'a [f64],
    /// Angular velocity in B.
    pub rates: &'a [[f64; 3]],
}

/// Stretch of commands, by its first and its last sample.
pub type Stretch = (usize, usize);

impl CommandLog<'_> {
    /// Times of a stretch.
    #[must_use]
    pub fn times_s(&self, (from, to): &Stretch) -> (f64, f64) {
        (self.time_s[*from], self.time_s[*to])
    }

    /// True if the vehicle turns in `stretches` at least by `part` of what it does elsewhere, about some axis.
    #[must_use]
    pub fn goes_on(&self, stretches: &[Stretch], part: f64) -> bool {
        let mut stretches_s: Vec<(f64, f64)> =
            stretches.iter().map(|stretch| self.times_s(stretch)).collect();
        stretches_s.sort_by(|a, b| a.0.total_cmp(&b.0));
        let within = |time_s: &f64| {
            let begun = stretches_s.partition_point(|stretch| stretch.0 <= *time_s);
            begun.checked_sub(1).is_some_and(|last| *time_s <= stretches_s[last].1)
        };
        let inside: Vec<bool> = self.rate_time_s.iter().map(within).collect();
        (0..3).any(|axis| {
            let usual_size = |is_inside: bool| {
                let of = self.rates.iter().zip(&inside).filter(|(_, inside)| **inside == is_inside);
                let numbers: Vec<f64> = of.map(|(rate, _)| rate[axis]).collect();
                let middle = median(numbers.iter().copied())?;
                median(numbers.iter().map(|number| (number - middle).abs()))
            };
            matches!((usual_size(true), usual_size(false)), (Some(inside), Some(outside)) if outside > 0.0 && inside > part * outside)
        })
    }
}

/// Least change in the same time elsewhere, in the smallest steps of the channel: a coarser one shows nothing.
const STEPS: f64 = 10.0;

/// True if the numbers change over `count` samples by many of their smallest steps, in nine of ten places.
#[must_use]
pub fn is_fine(numbers: &[f64], count: usize) -> bool {
    let size = numbers.iter().fold(0.0_f64, |size, number| size.max(number.abs()));
    // Smaller steps are rounding errors of a unit conversion.
    let steps = numbers.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 1e-9 * size);
    let Some(least) = steps.reduce(f64::min) else { return false };
    // Of the stretch itself nothing is taken: there the way is zero.
    let ways = numbers.iter().zip(numbers.iter().skip(count)).map(|(from, to)| (to - from).abs());
    let mut ways: Vec<f64> = ways.filter(|way| *way > 0.0).collect();
    ways.sort_by(f64::total_cmp);
    ways.get(ways.len() / 10).is_some_and(|way| *way > STEPS * least)
}

/// The median, of two in the middle the greater one; `None` of nothing.
fn median(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}
