//! Ticks at which the samples of a topic are sent. They follow from the plan alone, so that a reader knows without a message which
//! sample is the newest at a tick.

use serde::{Deserialize, Serialize};

/// Ticks at which the samples of a topic are sent.
///
/// ```
/// use component::sample_ticks::SampleTicks;
///
/// // 10 measurements a second at a tick of 1 ms, each 80 ms late.
/// let gps = SampleTicks::measured(1, 1_000_000, 100_000_000, 80_000_000);
/// let sent: Vec<u32> = (0..300).filter(|tick| gps.is_due(*tick)).collect();
/// assert_eq!(sent, [0, 80, 180, 280]);
/// assert_eq!((gps.newest(179), gps.next(81)), (80, 180));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SampleTicks {
    /// Multiples of a number of ticks, which is at least one.
    Every(u32),
    /// Tick 0, and the ticks at which measurements arrive.
    Measured(Measured),
}

/// Ticks at which the measurements of a sensor arrive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Measured {
    /// Ticks between two steps of the sensor.
    step_ticks: u32,
    /// Simulated time between two steps.
    step_ns: u64,
    /// Time between two measurements; at least one step.
    interval_ns: u64,
    /// Steps from a measurement to its arrival.
    delay_steps: u32,
}

impl SampleTicks {
    /// Multiples of `ticks`; every tick where that is 0.
    #[must_use]
    pub const fn every(ticks: u32) -> Self {
        Self::Every(if ticks == 0 { 1 } else { ticks })
    }

    /// Ticks at which measurements arrive at a node that computes every `step_ticks` ticks of `tick_ns`. It measures at its first tick
    /// at or after each multiple of `interval_ns`. A measurement arrives at the first tick at or after `delay_ns` later.
    #[must_use]
    pub fn measured(step_ticks: u32, tick_ns: u64, interval_ns: u64, delay_ns: u64) -> Self {
        let step_ticks = step_ticks.max(1);
        let step_ns = tick_ns.saturating_mul(u64::from(step_ticks)).max(1);
        let interval_ns = interval_ns.max(step_ns);
        let (steps, delay_steps) = (interval_ns / step_ns, delay_ns.div_ceil(step_ns));
        let is_regular = interval_ns.is_multiple_of(step_ns) && delay_steps.is_multiple_of(steps);
        match u32::try_from(steps.saturating_mul(u64::from(step_ticks))) {
            // One that arrives as a later one is made is sent with its stamp.
            Ok(ticks) if is_regular => Self::Every(ticks),
            _ => {
                let delay_steps = u32::try_from(delay_steps).unwrap_or(u32::MAX);
                Self::Measured(Measured { step_ticks, step_ns, interval_ns, delay_steps })
            }
        }
    }

    /// Number of the newest sample at `tick`: that of tick 0 is number 0.
    #[must_use]
    pub fn sequence(self, tick: u32) -> u64 {
        match self {
            Self::Every(ticks) => u64::from(tick / ticks),
            Self::Measured(measured) => measured.sequence(tick),
        }
    }

    /// Tick of sample number `sequence`.
    #[must_use]
    pub fn tick(self, sequence: u64) -> u64 {
        match self {
            Self::Every(ticks) => sequence.saturating_mul(u64::from(ticks)),
            Self::Measured(measured) => measured.tick(sequence),
        }
    }

    /// Number of the first sample at or after `tick`.
    #[must_use]
    pub fn first_sequence(self, tick: u32) -> u64 {
        tick.checked_sub(1).map_or(0, |before| self.sequence(before) + 1)
    }

    /// Tick of the newest sample at `tick`.
    #[must_use]
    pub fn newest(self, tick: u32) -> u32 {
        match self {
            Self::Every(ticks) => tick - tick % ticks,
            // Never later than `tick`.
            Self::Measured(measured) => u32::try_from(measured.tick(measured.sequence(tick))).unwrap_or(tick),
        }
    }

    /// Tick of the first sample at or after `tick`; the greatest number if it lies behind.
    #[must_use]
    pub fn next(self, tick: u32) -> u32 {
        u32::try_from(self.tick(self.first_sequence(tick))).unwrap_or(u32::MAX)
    }

    /// True if a sample is sent at `tick`.
    #[must_use]
    pub fn is_due(self, tick: u32) -> bool {
        match self {
            Self::Every(ticks) => tick.is_multiple_of(ticks),
            Self::Measured(_) => self.newest(tick) == tick,
        }
    }

    /// Ticks between two samples; `None` if they differ.
    #[must_use]
    pub fn period(self) -> Option<u32> {
        match self {
            Self::Every(ticks) => Some(ticks),
            Self::Measured(_) => None,
        }
    }

    /// Least number of ticks between two samples behind the first.
    #[must_use]
    pub fn least(self) -> u32 {
        match self {
            Self::Every(ticks) => ticks,
            Self::Measured(measured) => measured.least(),
        }
    }

    /// Mean number of ticks between two samples behind the first.
    #[must_use]
    pub fn mean(self) -> f64 {
        match self {
            Self::Every(ticks) => f64::from(ticks),
            Self::Measured(Measured { step_ticks, step_ns, interval_ns, .. }) => {
                f64::from(step_ticks) * (interval_ns as f64 / step_ns as f64)
            }
        }
    }

    /// Greatest number of samples that are sent within `ticks`.
    #[must_use]
    pub fn most_within(self, ticks: u64) -> u64 {
        // The sample of tick 0 may be followed by another sooner than all others.
        ticks.div_ceil(u64::from(self.least())) + u64::from(self.period().is_none())
    }
}

impl Measured {
    /// Numbers count arrivals; without a delay the first of them is that of tick 0.
    fn sequence(self, tick: u32) -> u64 {
        let (step, delay) = (u64::from(tick / self.step_ticks), u64::from(self.delay_steps));
        let made = |step: u64| step.saturating_mul(self.step_ns) / self.interval_ns;
        match step.checked_sub(delay) {
            None => 0,
            Some(step) => made(step) + u64::from(delay > 0),
        }
    }

    fn tick(self, sequence: u64) -> u64 {
        let delay = u64::from(self.delay_steps);
        let measured = if delay > 0 { sequence.checked_sub(1) } else { Some(sequence) };
        let Some(measured) = measured else { return 0 };
        let step = measured.saturating_mul(self.interval_ns).div_ceil(self.step_ns);
        step.saturating_add(delay).saturating_mul(u64::from(self.step_ticks))
    }

    fn least(self) -> u32 {
        let steps = u32::try_from(self.interval_ns / self.step_ns).unwrap_or(u32::MAX);
        steps.saturating_mul(self.step_ticks)
    }
}

#[cfg(test)]
mod tests {
    use super::SampleTicks;

    const TICK_NS: u64 = 1_000_000;

    fn due(ticks: SampleTicks, end: u32) -> Vec<u32> {
        (0..end).filter(|tick| ticks.is_due(*tick)).collect()
    }

    fn measured(step_ticks: u32, rate_hz: u64, delay_ms: u64) -> SampleTicks {
        SampleTicks::measured(step_ticks, TICK_NS, 1_000_000_000 / rate_hz, delay_ms * TICK_NS)
    }

    #[test]
    fn samples_are_sent_as_often_as_measurements_are_made() {
        assert_eq!(measured(1, 50, 0), SampleTicks::every(20));
        assert_eq!(measured(10, 100, 10), SampleTicks::every(10), "one interval late");
        assert_eq!(measured(20, 50, 40), SampleTicks::every(20), "two intervals late");
        assert_eq!(due(measured(10, 50, 10), 80), [0, 10, 30, 50, 70]);
        assert_eq!(due(measured(1, 60, 0), 60), [0, 17, 34, 50]);
        assert_eq!(due(measured(5, 160, 6), 35), [0, 10, 20, 25, 30], "rounded up to its steps");
        assert_eq!(due(measured(1, 10, 250), 500), [0, 250, 350, 450]);
    }

    #[test]
    fn numbers_and_ticks_of_samples_agree() {
        let all = [
            SampleTicks::every(0),
            SampleTicks::every(7),
            measured(1, 50, 10),
            measured(1, 60, 0),
            measured(3, 31, 5),
            measured(5, 160, 6),
            measured(1, 10, 250),
            measured(1, 1_000, 1),
        ];
        for ticks in all {
            let sent = due(ticks, 1000);
            for tick in 0..900 {
                let newest = sent.iter().rposition(|sent| *sent <= tick).unwrap();
                let next = sent.iter().position(|sent| *sent >= tick).unwrap();
                assert_eq!((ticks.sequence(tick), ticks.newest(tick)), (newest as u64, sent[newest]));
                assert_eq!((ticks.first_sequence(tick), ticks.next(tick)), (next as u64, sent[next]));
                assert_eq!(ticks.tick(newest as u64), u64::from(sent[newest]), "{ticks:?}");
                let within = sent.iter().filter(|sent| (tick..tick + 100).contains(sent)).count() as u64;
                assert!(within <= ticks.most_within(100), "{within} from {tick} on: {ticks:?}");
            }
            let gaps = sent[1..].windows(2).map(|pair| pair[1] - pair[0]);
            assert_eq!(gaps.clone().min(), Some(ticks.least()), "{ticks:?}");
            let mean = f64::from(gaps.clone().sum::<u32>()) / gaps.count() as f64;
            assert!((mean / ticks.mean() - 1.0).abs() < 0.03, "{mean} of {ticks:?}");
        }
    }

    #[test]
    fn rates_that_no_run_reaches_send_once() {
        let never = SampleTicks::measured(1, TICK_NS, u64::MAX, u64::MAX);
        assert_eq!((never.newest(u32::MAX - 1), never.next(1)), (0, u32::MAX));
        assert_eq!(SampleTicks::every(u32::MAX).next(u32::MAX), u32::MAX);
        assert_eq!(
            SampleTicks::measured(1, TICK_NS, 1, 0),
            SampleTicks::every(1),
            "more often than it steps"
        );
    }

    #[test]
    fn a_plan_keeps_them() {
        for ticks in [SampleTicks::every(5), measured(1, 60, 10)] {
            let text = serde_json::to_string(&ticks).unwrap();
            assert_eq!(serde_json::from_str::<SampleTicks>(&text).unwrap(), ticks, "{text}");
        }
    }
}
