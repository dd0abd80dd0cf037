//! From measuring to arriving: the times of a sensor's measurements, their delays, and their losses.
//!
//! A sensor's node computes at each of its periods. It *measures* at the first of them at or after each multiple of 1 /
//! `rate_hz`; a measurement *arrives* at the first at or after `delay_ms` later. In between it waits in a queue of the
//! node's hand-over state, so that a backup goes on with the measurements under way. The queue is as long as delay and rate
//! need. Rate and delay are therefore exact where they are multiples of the node's period, and rounded up to it elsewhere;
//! a measurement always holds the truth of its stated time.
//!
//! Losses follow a two-state Markov chain (Gilbert, "Capacity of a burst-noise channel", Bell System Technical
//! Journal 39, 1960): with probability `dropout` a measurement is lost, and losses last `dropout_mean_s` on
//! average. They are drawn from a stream of their own: switching them on does not reshuffle the noise.

use crate::noise::LazyStream;
use component::context::{NodeContext, SampleTimes};
use component::random::{Stream, stream, uniform};
use component::sample_ticks::SampleTicks;
use component::{Message, State, StateError, Transfer};
use diagnostics::digits;
use diagnostics::parameter::{ParameterError, not_negative, positive, refuse, require};

/// Steps of a node between two measurements below which it warns that they are not evenly spaced: a fifth of
/// the interval. Tuned, no source.
const UNEVEN_SHARE: f64 = 5.0;

/// Places of a queue beside those of the measurements under way: one for the measurement that arrived last, and one for a
/// delay that is rounded up to the node's period.
const MORE_PLACES: usize = 2;

/// Number of measurements that may be under way: 1 s at 10 kHz. The state of a sensor is stated after every tick where another
/// process may take its place.
const UNDER_WAY_MAX: f64 = 10_000.0;

/// Times at which a sensor measures, and the delays and losses of its measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Measurements a second.
    pub rate_hz: f64,
    /// Time from a measurement to its arrival.
    pub delay_ms: f64,
    /// Fraction of measurements that are lost.
    pub dropout: f64,
    /// Mean duration of losses; 0 where each is independent of the one before.
    pub dropout_mean_s: f64,
}

impl Timing {
    /// # Errors
    /// A parameter is outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        ParameterError::gather([
            positive("rate_hz", self.rate_hz),
            not_negative("delay_ms", self.delay_ms),
            fraction_lost("dropout", self.dropout),
            not_negative("dropout_mean_s", self.dropout_mean_s),
        ])?;
        let (longest_us, rate_hz) = (UNDER_WAY_MAX / self.rate_hz * 1e6, self.rate_hz);
        // Rounded down: whoever writes the number of the message is not refused again.
        let expected = format!(
            "at most {} ms: at {rate_hz} Hz {UNDER_WAY_MAX} measurements are under way then",
            longest_us.floor() / 1e3
        );
        let delay = require("delay_ms", self.delay_ms, self.under_way() <= UNDER_WAY_MAX, &expected);
        let losses = Losses::new(self);
        let mean_is_good = losses.begin <= 1.0 && losses.stay >= 0.0;
        let expected = "zero, or long enough for one measurement and for the fraction `dropout` of them";
        let mean = require("dropout_mean_s", self.dropout_mean_s, mean_is_good, expected);
        ParameterError::both(delay, mean).map(drop)
    }

    /// The longest period of a node, in ticks of `tick_ns`, that does not change the ticks of measurements
    /// and arrivals. They are then the same as with a period of one tick. If interval or delay are no whole
    /// number of ticks, the period is one tick.
    #[must_use]
    pub(crate) fn period_ticks(&self, tick_ns: u64) -> u32 {
        let whole = |ticks: f64| {
            let is_whole = (ticks - ticks.round()).abs() <= 1e-9 * ticks && ticks <= f64::from(u32::MAX);
            is_whole.then_some(ticks.round() as u32)
        };
        let tick_s = tick_ns as f64 * 1e-9;
        let interval = whole((self.rate_hz * tick_s).recip()).filter(|ticks| *ticks > 0);
        let delay = whole(self.delay_ms * 1e-3 / tick_s);
        interval.zip(delay).map_or(1, |(interval, delay)| greatest_common_divisor(interval, delay))
    }

    /// Ticks at which measurements arrive at a node that computes every `period_ticks` ticks of `tick_ns`.
    #[must_use]
    pub(crate) fn sample_ticks(&self, tick_ns: u64, period_ticks: u32) -> SampleTicks {
        SampleTicks::measured(period_ticks, tick_ns, self.interval_ns(), self.delay_ns())
    }

    fn interval_ns(&self) -> u64 {
        nanoseconds(self.rate_hz.recip())
    }

    fn delay_ns(&self) -> u64 {
        nanoseconds(self.delay_ms * 1e-3)
    }

    /// Number of measurements under way, without the rounding to a node's period.
    fn under_way(&self) -> f64 {
        self.delay_ms * 1e-3 * self.rate_hz
    }

    /// Refuses a rate at which a node of `run` cannot measure; warns if measurements would be uneven or never arrive.
    ///
    /// # Errors
    /// The sensor measures more often than its node computes, or as [`Timing::validate`].
    pub fn check(&self, run: &NodeContext<'_>) -> Result<(), ParameterError> {
        self.validate()?;
        let (rate_hz, node_hz) = (self.rate_hz, run.period_s().recip());
        refuse(rate_hz * run.period_s() > 1.0 + 1e-9, "rate_hz", || {
            format!(
                "`rate_hz` is {rate_hz} Hz, expected at most {} Hz, at which its node computes (run.rate_hz = \
                 {}, period_ticks = {}); raise run.rate_hz, or lower `period_ticks` or `rate_hz`",
                digits(node_hz),
                run.rate_hz(),
                run.period_ticks
            )
        })?;
        let share = node_hz / rate_hz;
        // Off by up to a step of the node: at 60 Hz of 1 kHz a sixteenth of the interval, which cameras have as well.
        if share < UNEVEN_SHARE && (share - share.round()).abs() > 1e-6 * share {
            run.warn("rate_hz", format!(
                "`rate_hz` is {rate_hz} Hz, which does not divide the {} Hz at which its node computes: the \
                 measurements are not evenly spaced",
                digits(node_hz)
            ));
        }
        if self.delay_ms * 1e-3 >= run.duration_s() {
            let message = "as long as the run: no measurement arrives before its end";
            run.warn_behind_end("delay_ms", format!("`delay_ms` is {} ms, {message}", self.delay_ms));
        }
        Ok(())
    }
}

/// Passes a fraction of measurements that are lost.
pub(crate) fn fraction_lost(key: &str, fraction: f64) -> Result<(), ParameterError> {
    require(key, fraction, (0.0..1.0).contains(&fraction), "a fraction from 0 to below 1")
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// The chances with which losses begin and last.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Losses {
    /// Probability of losing a measurement after one that was not lost.
    begin: f64,
    /// Probability of losing a measurement after one that was lost.
    stay: f64,
}

impl Losses {
    /// Those of a sensor that loses nothing.
    const NONE: Self = Self { begin: 0.0, stay: 0.0 };

    /// In the long run begin · (1 − dropout) = (1 − stay) · dropout, and losses last 1 / (1 − stay).
    fn new(timing: &Timing) -> Self {
        let dropout = timing.dropout;
        if timing.dropout_mean_s == 0.0 {
            return Self { begin: dropout, stay: dropout };
        }
        let end = (timing.dropout_mean_s * timing.rate_hz).recip();
        Self { begin: end * dropout / (1.0 - dropout), stay: 1.0 - end }
    }
}

/// State of a channel from tick to tick, beside the queue of measurements.
#[derive(Debug, Clone, Copy, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/ChannelState")]
pub struct ChannelState {
    /// Simulation time from which on the next measurement is due.
    #[field(unit = "ns")]
    next_ns: u64,
    /// Measurements so far; number n is at place n modulo the length of the queue.
    #[field(unit = "1")]
    measured: u64,
    /// Number of measurements that have arrived.
    #[field(unit = "1")]
    arrived: u64,
    /// Words of 32 bits drawn from the noise stream: the low and the high half of the count.
    #[field(unit = "1")]
    noise_words: [u64; 2],
    /// The same of the stream of losses.
    #[field(unit = "1")]
    loss_words: [u64; 2],
    /// Lost parts of the last measurement, a bit for each.
    #[field(unit = "1")]
    lost: u32,
    /// Zero.
    #[field(unit = "")]
    pad0: u32,
}

/// The channel of a node, and its random streams at their start.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Places of the queue of measurements.
    places: usize,
    interval_ns: u64,
    delay_ns: u64,
    losses: Losses,
    noise: Stream,
    loss: Stream,
}

/// State of a sensor beside its measurements.
pub trait Remembered {
    /// Message that it sends.
    type Measurement: Copy;

    /// Returns the state of the channel.
    fn channel(&mut self) -> &mut ChannelState;
}

/// State of a sensor with the measurements under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Queued<S: Remembered> {
    /// State of the sensor beside its measurements.
    pub sensor: S,
    /// Arrival times of the measurements in the queue.
    arrival_ns: Vec<u64>,
    /// The last measurements, which start as the one that is sent until the first arrives.
    queue: Vec<S::Measurement>,
}

impl<S: Remembered> Queued<S> {
    const SENSOR_BYTES: usize = size_of::<S>();
    const PLACE_BYTES: usize = size_of::<u64>() + size_of::<S::Measurement>();
}

/// The bytes of the sensor's state, then arrival time and measurement of each place of the queue.
impl<S: Message + Remembered<Measurement: Message>> State for Queued<S> {
    const TRANSFER: Transfer = Transfer::Bytes(S::SCHEMA.type_name);

    fn configuration(&self) -> u64 {
        S::SCHEMA.layout_hash() ^ <S::Measurement as Message>::SCHEMA.layout_hash().rotate_left(1)
    }

    fn size(&self) -> usize {
        Self::SENSOR_BYTES + self.queue.len() * Self::PLACE_BYTES
    }

    fn save(&self, bytes: &mut [u8]) {
        let (sensor, places) = bytes.split_at_mut(Self::SENSOR_BYTES);
        sensor.copy_from_slice(bytemuck::bytes_of(&self.sensor));
        let queued = self.arrival_ns.iter().zip(&self.queue);
        for (place, (arrival_ns, measurement)) in places.chunks_exact_mut(Self::PLACE_BYTES).zip(queued) {
            let (time, message) = place.split_at_mut(size_of::<u64>());
            time.copy_from_slice(bytemuck::bytes_of(arrival_ns));
            message.copy_from_slice(bytemuck::bytes_of(measurement));
        }
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        StateError::check_size(S::SCHEMA.type_name, self.size(), bytes)?;
        let (sensor, places) = bytes.split_at(Self::SENSOR_BYTES);
        self.sensor = bytemuck::pod_read_unaligned(sensor);
        let queued = self.arrival_ns.iter_mut().zip(&mut self.queue);
        for (place, (arrival_ns, measurement)) in places.chunks_exact(Self::PLACE_BYTES).zip(queued) {
            let (time, message) = place.split_at(size_of::<u64>());
            *arrival_ns = bytemuck::pod_read_unaligned(time);
            *measurement = bytemuck::pod_read_unaligned(message);
        }
        Ok(())
    }
}

/// The chance in one measurement.
#[derive(Debug)]
pub struct Chance<'a> {
    /// Simulation time.
    pub now_ns: u64,
    noise: LazyStream<'a>,
    loss: LazyStream<'a>,
    losses: Losses,
    /// Parts of the last measurement that were lost, a bit for each.
    lost: u32,
}

impl Chance<'_> {
    /// The node's random stream.
    pub fn noise(&mut self) -> &mut Stream {
        self.noise.get()
    }

    /// Draws whether part `part` of the measurement, numbered from 0, is lost; to be asked once for each.
    pub fn is_lost(&mut self, part: u32) -> bool {
        let was_lost = self.lost >> part & 1 == 1;
        let chance = if was_lost { self.losses.stay } else { self.losses.begin };
        let is_lost = self.losses != Losses::NONE && uniform(self.loss.get()) < chance;
        self.lost = self.lost & !(1 << part) | u32::from(is_lost) << part;
        is_lost
    }
}

impl Channel {
    /// The channel of the node of `context`; warns if measurements would be uneven or never arrive.
    ///
    /// # Errors
    /// As [`Timing::check`].
    pub fn new(timing: &Timing, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        timing.check(context)?;
        let measured_every_s = Some(timing.rate_hz.recip());
        let delay_s = timing.delay_ms * 1e-3;
        context.state_times(SampleTimes { measured_every_s, delay_s, remembered_s: None });
        let random = || stream(context.seed, context.name);
        let (noise, mut loss) = (random(), random());
        loss.set_stream(1);
        let (interval_ns, delay_ns) = (timing.interval_ns(), timing.delay_ns());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most `UNDER_WAY_MAX`")]
        let places = timing.under_way().ceil() as usize + MORE_PLACES;
        Ok(Self { places, interval_ns, delay_ns, losses: Losses::new(timing), noise, loss })
    }

    /// The state before the first measurement: that of the `sensor`, which sends `first` until the first arrives.
    pub(crate) fn state<S: Remembered>(&self, sensor: S, first: S::Measurement) -> Queued<S> {
        Queued { sensor, arrival_ns: vec![0; self.places], queue: vec![first; self.places] }
    }

    /// Returns the measurement that has arrived by `now_ns`, a tick of its node. If one is due, `measure` makes
    /// it from the one before.
    pub(crate) fn measure<S: Remembered>(
        &self,
        now_ns: u64,
        state: &mut Queued<S>,
        measure: impl FnOnce(&mut S, &S::Measurement, &mut Chance<'_>) -> S::Measurement,
    ) -> S::Measurement {
        let Queued { sensor, arrival_ns, queue } = state;
        let under_way = sensor.channel();
        if now_ns >= under_way.next_ns {
            let last = queue[self.before(under_way.measured)];
            let noise = LazyStream::new(&self.noise, under_way.noise_words);
            let loss = LazyStream::new(&self.loss, under_way.loss_words);
            let mut chance = Chance { now_ns, noise, loss, losses: self.losses, lost: under_way.lost };
            let measurement = measure(sensor, &last, &mut chance);
            let under_way = sensor.channel();
            let number = self.place(under_way.measured);
            queue[number] = measurement;
            under_way.lost = chance.lost;
            under_way.noise_words = chance.noise.words();
            under_way.loss_words = chance.loss.words();
            arrival_ns[number] = now_ns.saturating_add(self.delay_ns);
            under_way.measured += 1;
            under_way.next_ns = (now_ns / self.interval_ns + 1).saturating_mul(self.interval_ns);
        }
        let under_way = sensor.channel();
        while under_way.arrived < under_way.measured && arrival_ns[self.place(under_way.arrived)] <= now_ns {
            under_way.arrived += 1;
        }
        queue[self.before(under_way.arrived)]
    }

    /// The place of measurement `number` in the queue.
    fn place(&self, number: u64) -> usize {
        (number % self.places as u64) as usize
    }

    /// The place of the measurement before `number`; before the first it is the last place, not yet written.
    fn before(&self, number: u64) -> usize {
        self.place(number.checked_sub(1).unwrap_or(self.places as u64 - 1))
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use std::marker::PhantomData;

    const TICK_NS: u64 = 1_000_000;

    /// State of a sensor that remembers nothing beside its measurements.
    #[derive(Clone, Debug, PartialEq)]
    struct Plain<M>(ChannelState, PhantomData<M>);

    impl<M: Copy> Remembered for Plain<M> {
        type Measurement = M;

        fn channel(&mut self) -> &mut ChannelState {
            &mut self.0
        }
    }

    fn nothing_measured<M: Copy>(channel: &Channel, sent: M) -> Queued<Plain<M>> {
        channel.state(Plain(ChannelState::default(), PhantomData), sent)
    }

    fn timing() -> Timing {
        Timing { rate_hz: 10.0, delay_ms: 0.0, dropout: 0.0, dropout_mean_s: 0.0 }
    }

    #[test]
    fn a_node_computes_as_seldom_as_its_measurements_are_made_and_arrive() {
        let period = |rate_hz, delay_ms| Timing { rate_hz, delay_ms, ..timing() }.period_ticks(TICK_NS);
        assert_eq!(
            [period(50.0, 0.0), period(50.0, 40.0), period(50.0, 10.0), period(10.0, 80.0)],
            [20, 20, 10, 20]
        );
        // Between two ticks, or at 60 Hz: each of them has to be looked at.
        assert_eq!([period(50.0, 2.5), period(60.0, 0.0), period(1000.0, 0.0), period(2000.0, 0.0)], [1; 4]);
        assert_eq!([period(0.0, 1.0), period(-1.0, 0.0), period(f64::NAN, 0.0), period(1e-300, 0.0)], [1; 4]);
    }

    /// Every sample but that of tick 0 is a new measurement, and no measurement is left out; of a delay of several whole intervals the
    /// samples before the first measurement are left over.
    #[test]
    fn a_sample_is_sent_when_a_measurement_arrives() {
        let late = |rate_hz, delay_ms| Timing { rate_hz, delay_ms, ..timing() };
        for (timing, period_ticks, before) in [
            (late(50.0, 0.0), 1, 0),
            (late(50.0, 10.0), 10, 0),
            (late(50.0, 10.0), 1, 0),
            (late(50.0, 2.5), 1, 0),
            (late(60.0, 40.0), 1, 0),
            (late(160.0, 6.0), 5, 0),
            (late(10.0, 250.0), 10, 0),
            (late(100.0, 10.0), 5, 0),
            (late(50.0, 60.0), 20, 2),
        ] {
            let arrivals = arrivals(&timing, period_ticks, 3000);
            let is_new = |pair: &[(u64, u64)]| (pair[1].1 != pair[0].1).then_some(pair[1].0);
            let new: Vec<u64> = arrivals.windows(2).filter_map(is_new).collect();
            let ticks = timing.sample_ticks(TICK_NS, u32::try_from(period_ticks).unwrap());
            let sent: Vec<u64> = (1..3000).filter(|tick| ticks.is_due(*tick)).map(u64::from).collect();
            assert_eq!(sent[before..], new, "{timing:?} every {period_ticks} ticks");
        }
    }

    fn channel(timing: &Timing, period_ticks: u64, seed: u64, node: &str) -> Result<Channel, ParameterError> {
        let period_ticks = u32::try_from(period_ticks).unwrap();
        Channel::new(timing, &NodeContext::new(node, &[]).timed(TICK_NS, period_ticks, 10_000).seeded(seed))
    }

    /// The times at which measurements were made, tick by tick as they arrive; 0 is sent until the first.
    fn arrivals(timing: &Timing, period_ticks: u64, ticks: u64) -> Vec<(u64, u64)> {
        let channel = channel(timing, period_ticks, 1, "gps").unwrap();
        let mut state = nothing_measured(&channel, u64::MAX);
        (0..ticks)
            .step_by(usize::try_from(period_ticks).unwrap())
            .map(|tick| {
                let now_ns = tick * TICK_NS;
                (tick, channel.measure(now_ns, &mut state, |_, _, _| now_ns) / TICK_NS)
            })
            .collect()
    }

    const NOTHING: u64 = u64::MAX / TICK_NS;

    #[test]
    fn a_sensor_that_measures_more_often_than_its_node_computes_is_refused_with_both_rates() {
        let rate_of = |tick_ns, period_ticks| {
            let run = NodeContext::new("node", &[]).timed(tick_ns, period_ticks, 10_000);
            let outcome = Timing { rate_hz: 200.0, ..timing() }.check(&run);
            (outcome, run.into_warnings())
        };
        for (tick_ns, period_ticks) in [(100_000_000, 1), (1_000_000, 100)] {
            let message = rate_of(tick_ns, period_ticks).0.unwrap_err().to_string();
            assert!(message.contains("`rate_hz` is 200 Hz, expected at most 10 Hz"), "{message}");
        }
        assert_eq!(rate_of(1_000_000, 5), (Ok(()), vec![]));
        let (outcome, warnings) = rate_of(1_000_000, 3);
        assert_eq!(rate_of(700_000, 1), (Ok(()), vec![]), "a seventh of the interval");
        assert!(outcome.is_ok() && warnings[0].message.contains("not evenly spaced"), "{warnings:?}");
    }

    #[test]
    fn without_delay_a_measurement_arrives_as_it_is_made_and_is_held_until_the_next() {
        for (tick, measured) in arrivals(&timing(), 1, 1000) {
            assert_eq!(measured, tick / 100 * 100);
        }
    }

    #[test]
    fn a_delay_shorter_than_the_interval_and_one_longer_are_exact() {
        for delay_ticks in [1_u64, 80, 99, 100, 250, 3000, 8250] {
            let timing = Timing { delay_ms: delay_ticks as f64, ..timing() };
            for (tick, measured) in arrivals(&timing, 1, 9900) {
                let expected = tick.checked_sub(delay_ticks).map_or(NOTHING, |tick| tick / 100 * 100);
                assert_eq!(measured, expected, "at tick {tick} with a delay of {delay_ticks}");
            }
        }
    }

    #[test]
    fn what_is_no_multiple_of_the_period_is_rounded_up_to_it() {
        let timing = Timing { rate_hz: 160.0, delay_ms: 6.0, ..timing() };
        let found = arrivals(&timing, 5, 35);
        let expected = [(0, NOTHING), (5, NOTHING), (10, 0), (15, 0), (20, 10), (25, 15), (30, 20)];
        assert_eq!(found, expected);
        let found: Vec<u64> =
            arrivals(&Timing { delay_ms: 0.0, ..timing }, 1, 26).iter().map(|f| f.1).collect();
        assert_eq!((found[6], found[7], found[13], found[19], found[25]), (0, 7, 13, 19, 25));
    }

    #[test]
    fn a_channel_that_starts_late_measures_once_and_then_at_its_rate() {
        let channel = channel(&timing(), 1, 1, "gps").unwrap();
        let mut state = nothing_measured(&channel, ());
        let mut count = 0;
        for tick in 5031..5331 {
            channel.measure(tick * TICK_NS, &mut state, |_, _, _| count += 1);
        }
        assert_eq!(count, 4);
    }

    fn lost(timing: &Timing, count: usize) -> Vec<bool> {
        let channel = channel(timing, 1, 3, "mocap").unwrap();
        let mut state = nothing_measured(&channel, false);
        let interval_ns = channel.interval_ns;
        (0..count as u64)
            .map(|n| channel.measure(n * interval_ns, &mut state, |_, _, chance| chance.is_lost(0)))
            .collect()
    }

    #[test]
    fn the_fraction_dropout_is_lost_and_losses_last_as_long_as_stated() {
        let count = 200_000;
        for (dropout, dropout_mean_s, measurements) in
            [(0.1, 0.0, 1.0 / 0.9), (0.1, 0.05, 5.0), (0.4, 0.2, 20.0)]
        {
            let timing = Timing { rate_hz: 100.0, dropout, dropout_mean_s, ..timing() };
            let lost = lost(&timing, count);
            let losses = lost.iter().filter(|lost| **lost).count() as f64;
            let bursts = lost.windows(2).filter(|pair| !pair[0] && pair[1]).count() as f64;
            // The standard deviation of the fraction is below √(2·length·p/n); six of them.
            let bound = 6.0 * (2.0 * measurements * dropout / count as f64).sqrt();
            let (fraction, length) = (losses / count as f64, losses / bursts);
            assert!((fraction - dropout).abs() < bound, "{fraction} of {dropout}, bound {bound}");
            assert!((length / measurements - 1.0).abs() < 6.0 / bursts.sqrt(), "{length} of {measurements}");
        }
    }

    #[test]
    fn losses_do_not_reshuffle_the_noise() {
        let noise = |dropout: f64| {
            let channel = channel(&Timing { dropout, ..timing() }, 1, 3, "gps").unwrap();
            let mut state = nothing_measured(&channel, 0);
            let measure = |_: &mut _, _: &u64, chance: &mut Chance<'_>| {
                chance.is_lost(0);
                chance.noise().next_u64()
            };
            [0, 1, 2].map(|n| channel.measure(n * 100 * TICK_NS, &mut state, measure))
        };
        assert_eq!(noise(0.0), noise(0.9));
    }

    #[test]
    fn a_state_that_is_handed_over_goes_on_as_the_one_it_was_taken_from() {
        let timing = Timing { rate_hz: 250.0, delay_ms: 50.0, dropout: 0.3, dropout_mean_s: 0.02 };
        let measure = |_: &mut _, _: &u64, chance: &mut Chance<'_>| {
            if chance.is_lost(0) { 0 } else { chance.noise().next_u64() }
        };
        let first = channel(&timing, 1, 3, "gps").unwrap();
        let mut state = nothing_measured(&first, 1);
        for tick in 0..333 {
            first.measure(tick * TICK_NS, &mut state, measure);
        }
        let second = channel(&timing, 1, 3, "gps").unwrap();
        let mut handed = state.clone();
        for tick in 333..1000 {
            let expected = first.measure(tick * TICK_NS, &mut state, measure);
            let found = second.measure(tick * TICK_NS, &mut handed, measure);
            assert_eq!(found, expected, "at tick {tick}");
        }
        assert_eq!(handed, state);
    }

    #[test]
    fn impossible_timings_are_named() {
        let refused = |timing: Timing| timing.validate().unwrap_err().to_string();
        let cases = [
            ("rate_hz", Timing { rate_hz: 0.0, ..timing() }),
            ("rate_hz", Timing { rate_hz: f64::NAN, ..timing() }),
            ("delay_ms", Timing { delay_ms: -1.0, ..timing() }),
            ("delay_ms", Timing { delay_ms: 1_000_001.0, ..timing() }),
            ("delay_ms", Timing { delay_ms: f64::NAN, ..timing() }),
            ("dropout", Timing { dropout: 1.0, ..timing() }),
            ("dropout", Timing { dropout: -0.1, ..timing() }),
            ("dropout_mean_s", Timing { dropout_mean_s: f64::INFINITY, ..timing() }),
            ("dropout_mean_s", Timing { dropout: 0.1, dropout_mean_s: 0.05, ..timing() }),
            ("dropout_mean_s", Timing { dropout: 0.9, dropout_mean_s: 0.5, ..timing() }),
        ];
        for (key, timing) in cases {
            let error = refused(timing);
            assert!(error.starts_with(&format!("`{key}` must be ")), "{error}");
        }
        let fast = Timing { rate_hz: 8000.0, delay_ms: 2000.0, ..timing() };
        assert!(refused(fast).contains("at most 1250 ms: at 8000 Hz"), "{}", refused(fast));
        let error = channel(&timing(), 200, 1, "gps").unwrap_err().to_string();
        assert!(error.contains("`rate_hz`") && error.contains("`period_ticks`"), "{error}");
    }
}
