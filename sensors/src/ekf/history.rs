//! Recent past, as the filter remembers it: the IMU's readings, and measurements that wait their turn.

use component::Message;
use component::messages::Vector3;

/// Readings that are remembered at least.
const READINGS_MIN: usize = 256;
/// Readings that are remembered at most: 100 MB of them.
const READINGS_MAX: usize = 4 << 20;
/// Number of measurements that can wait.
pub(crate) const WAITING: usize = 48;

/// A reading of the IMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfReading")]
pub struct Reading {
    /// When it was read.
    #[field(unit = "ns")]
    pub time_ns: u64,
    /// Specific force.
    #[field(unit = "m/s^2", frame = "body")]
    pub specific_force: Vector3,
    /// Angular rate.
    #[field(unit = "rad/s", frame = "body")]
    pub angular_velocity: Vector3,
}

impl Reading {
    /// The reading at `time_ns` on the line from this one to `next`.
    pub(crate) fn toward(&self, next: &Self, time_ns: u64) -> Self {
        let part = (time_ns - self.time_ns) as f64 / (next.time_ns - self.time_ns) as f64;
        let mix = |a: Vector3, b: Vector3| Vector3 {
            x: a.x + part * (b.x - a.x),
            y: a.y + part * (b.y - a.y),
            z: a.z + part * (b.z - a.z),
        };
        Self {
            time_ns,
            specific_force: mix(self.specific_force, next.specific_force),
            angular_velocity: mix(self.angular_velocity, next.angular_velocity),
        }
    }

    /// True if all of its numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let all = [self.specific_force, self.angular_velocity].map(<[f64; 3]>::from);
        all.as_flattened().iter().all(|value| value.is_finite())
    }
}

/// The last readings, one a period.
///
/// They are kept in single precision, since a node's hand-over state is written at every tick: it rounds a reading by
/// 10⁻⁷ of itself, four orders below its noise. The filter sees no other readings than these.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Readings {
    /// Number of the readings and time of the newest.
    head: ReadingsHead,
    /// Time between two, ns.
    period_ns: u64,
    /// Specific force in m/s² and angular rate in rad/s, body axes. Reading number n is at the place n modulo the number of
    /// places.
    ring: Box<[[f32; 6]]>,
}

/// The part of the readings that has the same size whatever is remembered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfReadings")]
pub(crate) struct ReadingsHead {
    /// Readings so far.
    #[field(unit = "1")]
    count: u64,
    /// When the newest was read.
    #[field(unit = "ns")]
    newest_ns: u64,
}

/// Places for readings every `period_s` that reach `span_s` back; `None` where they would fill the memory.
pub(crate) fn places(span_s: f64, period_s: f64) -> Option<usize> {
    let needed = (span_s / period_s).ceil() + 2.0;
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the range, which is checked"
    )]
    (needed <= READINGS_MAX as f64).then(|| READINGS_MIN.max(needed as usize))
}

impl Readings {
    /// Creates an empty memory for readings that will come every `period_ns`, with `places` places.
    #[must_use]
    pub fn every(period_ns: u64, places: usize) -> Self {
        Self { head: ReadingsHead::default(), period_ns, ring: vec![[0.0; 6]; places].into_boxed_slice() }
    }

    /// Time between two, ns.
    #[must_use]
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// The part whose size does not depend on the number of readings, and the bytes of the rest.
    pub fn parts(&self) -> (ReadingsHead, &[u8]) {
        (self.head, bytemuck::cast_slice(&self.ring))
    }

    /// Goes on from both parts; the bytes are as many as those of its own.
    pub fn go_on(&mut self, head: ReadingsHead, ring: &[u8]) {
        self.head = head;
        bytemuck::cast_slice_mut(&mut self.ring).copy_from_slice(ring);
    }

    /// Remembers the newest reading, one period after the last.
    pub fn push(&mut self, reading: &Reading) {
        let (force, rate) = (reading.specific_force, reading.angular_velocity);
        let values = [force.x, force.y, force.z, rate.x, rate.y, rate.z];
        let place = self.place(self.head.count);
        self.ring[place] = values.map(|value| value as f32);
        self.head.newest_ns = reading.time_ns;
        self.head.count += 1;
    }

    /// The newest reading, if there is one.
    #[must_use]
    pub fn newest(&self) -> Option<Reading> {
        self.head.count.checked_sub(1).map(|number| self.numbered(number))
    }

    /// The readings after `time_ns`, oldest first.
    pub fn after(&self, time_ns: u64) -> impl Iterator<Item = Reading> {
        let next = self.last_until(time_ns).map_or(self.oldest(), |number| number + 1);
        (next..self.head.count).map(|number| self.numbered(number))
    }

    /// The reading at `time_ns`, between those around it; `None` before the oldest and after the newest.
    #[must_use]
    pub fn at(&self, time_ns: u64) -> Option<Reading> {
        let number = self.last_until(time_ns)?;
        let before = self.numbered(number);
        if before.time_ns == time_ns {
            return Some(before);
        }
        (number + 1 < self.head.count).then(|| before.toward(&self.numbered(number + 1), time_ns))
    }

    /// The number of the last reading up to `time_ns`.
    fn last_until(&self, time_ns: u64) -> Option<u64> {
        let back = self.head.newest_ns.saturating_sub(time_ns).div_ceil(self.period_ns);
        let number = self.head.count.checked_sub(1 + back)?;
        (number >= self.oldest()).then_some(number)
    }

    fn oldest(&self) -> u64 {
        self.head.count.saturating_sub(self.ring.len() as u64)
    }

    fn place(&self, number: u64) -> usize {
        number as usize % self.ring.len()
    }

    fn numbered(&self, number: u64) -> Reading {
        let [a, b, c, u, v, w] = self.ring[self.place(number)].map(f64::from);
        let time_ns = self.head.newest_ns - (self.head.count - 1 - number) * self.period_ns;
        Reading { time_ns, specific_force: [a, b, c].into(), angular_velocity: [u, v, w].into() }
    }
}

/// A sensor of quantities that the filter estimates, in the order of `component::messages::Innovation`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A satellite receiver.
    Gps,
    /// Motion capture.
    Mocap,
    /// A barometer.
    Barometer,
    /// A magnetometer.
    Magnetometer,
}

impl Source {
    /// All, in order.
    pub const ALL: [Self; 4] = [Self::Gps, Self::Mocap, Self::Barometer, Self::Magnetometer];

    /// The place in arrays of all.
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }

    /// True if it measures the whole position.
    pub(crate) fn tells_position(self) -> bool {
        matches!(self, Self::Gps | Self::Mocap)
    }
}

/// A measurement, of whatever sensor.
///
/// ```
/// use sensors::ekf::history::{Measurement, Source};
///
/// let altitude = Measurement::new(Source::Barometer, 16_000_000, &[1.5]);
/// assert_eq!((altitude.sensor(), altitude.values[0]), (Source::Barometer, 1.5));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfMeasurement")]
pub struct Measurement {
    /// When it was measured.
    #[field(unit = "ns")]
    pub measured_ns: u64,
    /// Measured values: position and velocity, position and quaternion, altitude, or field.
    #[field(unit = "")]
    pub values: [f64; 7],
    /// The sensor's place in `Source::ALL`.
    #[field(unit = "1")]
    pub sensor: u32,
    /// Zero.
    #[field(unit = "")]
    pub pad0: u32,
}

impl Measurement {
    /// Creates the measurement of `sensor` at `measured_ns`; `values` are at most seven.
    #[must_use]
    pub fn new(sensor: Source, measured_ns: u64, values: &[f64]) -> Self {
        let mut measurement = Self { measured_ns, sensor: sensor as u32, ..Default::default() };
        measurement.values[..values.len()].copy_from_slice(values);
        measurement
    }

    /// The sensor that measured it.
    #[must_use]
    pub fn sensor(&self) -> Source {
        Source::ALL[self.sensor as usize % Source::ALL.len()]
    }
}

/// The newest measurement of each sensor that is wired: outside `None` where there is no such sensor, inside where
/// it has not measured yet. In the order of [`Source::ALL`].
pub type Newest = [Option<Option<Measurement>>; 4];

/// Measurements that wait until no earlier one can arrive, in the order of their times.
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
#[message(type_name = "hummingbus_msgs/msg/EkfWaiting")]
pub(crate) struct Waiting {
    count: u64,
    queue: [Measurement; WAITING],
}

impl Default for Waiting {
    fn default() -> Self {
        Self { count: 0, queue: [Measurement::default(); WAITING] }
    }
}

impl Waiting {
    /// Puts `measurement` behind those of its time and before; there must be room.
    pub fn insert(&mut self, measurement: Measurement) {
        let count = self.count as usize;
        let waiting = &self.queue[..count];
        let place = waiting.partition_point(|other| other.measured_ns <= measurement.measured_ns);
        self.queue.copy_within(place..count, place + 1);
        self.queue[place] = measurement;
        self.count += 1;
    }

    /// True if there is no room for another.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.count as usize == WAITING
    }

    /// The earliest, if there is one.
    #[must_use]
    pub fn first(&self) -> Option<&Measurement> {
        self.queue[..self.count as usize].first()
    }

    /// Takes the earliest.
    pub fn pop(&mut self) -> Option<Measurement> {
        let first = *self.first()?;
        self.queue.copy_within(1..self.count as usize, 0);
        self.count -= 1;
        Some(first)
    }
}
