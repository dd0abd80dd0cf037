//! Pushes that act on a vehicle beyond a model, as they are expected over a window.

/// Angular acceleration in B and acceleration in W beyond a model's.
pub type AddedAcceleration = [f64; 6];

/// A push over the time of one window.
#[derive(Debug, Clone, PartialEq)]
pub struct Forecast {
    /// Time of the first value, in s.
    pub start_s: f64,
    /// Time from one value to the next, in s.
    pub step_s: f64,
    /// Values, with straight lines between them; the last one stays.
    pub values: Vec<AddedAcceleration>,
}

impl Forecast {
    /// The same push at all times.
    pub fn constant(push: AddedAcceleration) -> Self {
        Self { start_s: 0.0, step_s: 1.0, values: vec![push] }
    }

    /// No push.
    pub fn none() -> Self {
        Self { start_s: 0.0, step_s: 1.0, values: Vec::new() }
    }

    /// True if it pushes at no time.
    pub fn is_none(&self) -> bool {
        self.values.is_empty()
    }

    /// The push at a time.
    pub fn at(&self, time_s: f64) -> AddedAcceleration {
        let Some(last) = self.values.last() else { return [0.0; 6] };
        let place = ((time_s - self.start_s) / self.step_s).max(0.0);
        let (before, part) = (place as usize, place.fract());
        match (self.values.get(before), self.values.get(before + 1)) {
            (Some(from), Some(to)) => std::array::from_fn(|at| from[at] + part * (to[at] - from[at])),
            _ => *last,
        }
    }
}
