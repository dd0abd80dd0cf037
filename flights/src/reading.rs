//! Reads one flight from its log: every channel, on one clock, cut to the part that is used.

use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use vehicles::Vehicle;

use crate::channels;
use crate::clean;
use crate::declaration::{Assumption, ChannelMap, Entry, FlightEntry, Format};
use crate::document::{Bad, Document};
use crate::error::FlightsError;
use crate::flight::{Channel, Flight};
use crate::frame;
use crate::jumps;
use crate::known_types;
use crate::log::Log;
use crate::plausible::{self, Finding};
use crate::quantity::Quantity;
use crate::span;

/// Times are differences of decimal fractions since 1970: a sample on the edge of the part belongs to it.
const SLACK_S: f64 = 1e-6;

/// A part of a log, in s from the log's first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// When the first sample was, on the log's own clock.
    pub origin_s: f64,
    /// When the flight's own time begins.
    pub start_s: f64,
    /// The flight's first sample.
    pub from_s: f64,
    /// Its last.
    pub to_s: f64,
}

/// What is needed to read a flight.
pub struct Reading<'a> {
    /// The flights file.
    pub document: &'a Document,
    /// The declared vehicle.
    pub vehicle: &'a Vehicle,
    /// The flight as declared.
    pub entry: &'a FlightEntry,
    /// Where that stands.
    pub at: Range<usize>,
    /// The log's format.
    pub format: Format,
    /// The log.
    pub file: &'a Path,
    /// The channels that apply to the flight.
    pub channels: ChannelMap,
}

impl Reading<'_> {
    /// Reads the flight from `log`; says which part of the log's own time it is, too.
    pub fn flight(mut self, log: &dyn Log) -> Result<(Flight, Part), FlightsError> {
        self.check_delays()?;
        let mut taken = Vec::new();
        if self.channels.is_empty() {
            (self.channels, taken) = known_types::defaults(log, self.format);
        }
        let mut flight = self.read_channels(log)?;
        flight.notes.splice(0..0, taken);
        if self.format == Format::Csv {
            let of_time = plausible::judge_time(&flight, self.vehicle, &self.channels);
            self.settle(&mut flight, of_time.into_iter().collect())?;
        }
        let yaw = self.yaw(log)?;
        let origin_s = self.origin_s(&flight, yaw.as_ref())?;
        self.to_flight_time(&mut flight, origin_s);
        self.check_span(&flight, log, origin_s)?;
        let part = self.part(&flight, origin_s);
        self.assume(&mut flight, yaw.map(|yaw| self.shift(Quantity::Attitude, yaw, origin_s)))?;
        jumps::leave_out(&mut flight);
        self.say_gaps(&mut flight);
        self.check_something_is_left(&flight)?;
        self.judge(&mut flight)?;
        flight.notes = merged(&flight.notes);
        Ok((flight, part))
    }

    fn read_channels(&self, log: &dyn Log) -> Result<Flight, FlightsError> {
        let mut notes = Vec::new();
        let notes = &mut notes;
        let attitude = self.channel(log, Quantity::Attitude, notes)?;
        let attitude = clean::unit_quaternions(attitude, notes)
            .map_err(|reason| self.channel_error(Quantity::Attitude, reason))?;
        Ok(Flight {
            name: self.entry.name.get_ref().clone(),
            file: self.file.to_owned(),
            role: self.entry.role,
            command: self.channel(log, Quantity::Command, notes)?,
            rotor_speed: self.channel(log, Quantity::RotorSpeed, notes)?,
            position: self.channel(log, Quantity::Position, notes)?,
            velocity: self.channel(log, Quantity::Velocity, notes)?,
            attitude,
            angular_velocity: self.channel(log, Quantity::AngularVelocity, notes)?,
            specific_force: self.channel(log, Quantity::SpecificForce, notes)?,
            battery_voltage: self.channel(log, Quantity::BatteryVoltage, notes)?,
            assumed: Vec::new(),
            notes: std::mem::take(notes),
        })
    }

    /// A channel on the log's clock; empty where the flight does not declare it.
    fn channel<const N: usize>(
        &self,
        log: &dyn Log,
        quantity: Quantity,
        notes: &mut Vec<String>,
    ) -> Result<Channel<N>, FlightsError> {
        let Some(entry) = self.declared(quantity) else { return Ok(Channel::default()) };
        if self.entry.assume.is_some() && entry.yaw.is_some() {
            return Ok(Channel::default());
        }
        let complete = known_types::complete(log, quantity, entry);
        let read = complete
            .and_then(|entry| channels::read(log, quantity, &entry, self.vehicle, self.entry.trust_units));
        let cleaned = read.and_then(|(channel, said)| {
            notes.extend(said.into_iter().map(|said| format!("{quantity}: {said}")));
            clean::clean(quantity, channel, notes)
        });
        cleaned.map_err(|reason| self.channel_error(quantity, reason))
    }

    fn declared(&self, quantity: Quantity) -> Option<&Entry> {
        self.channels.get(&quantity).map(Spanned::get_ref)
    }

    /// The yaw of a level attitude, in rad and without jumps, on the log's clock.
    fn yaw(&self, log: &dyn Log) -> Result<Option<Channel<1>>, FlightsError> {
        let Some(entry) = self.declared(Quantity::Attitude).filter(|_| self.entry.assume.is_some()) else {
            return Ok(None);
        };
        let read = channels::read_yaw(log, entry).and_then(|read| match read {
            None => Ok(None),
            Some((channel, _)) => clean::clean(Quantity::Attitude, channel, &mut Vec::new())
                .map(|cleaned| Some(unwrapped(cleaned))),
        });
        read.map_err(|reason| self.channel_error(Quantity::Attitude, reason))
    }

    /// The log's first sample.
    fn origin_s(&self, flight: &Flight, yaw: Option<&Channel<1>>) -> Result<f64, FlightsError> {
        let firsts = spans(flight).into_iter().chain([yaw.and_then(Channel::span_s)]).flatten();
        firsts.map(|(first, _)| first).min_by(f64::total_cmp).ok_or_else(|| {
            let reason = "no channel is declared; name its columns, topics or variables in `channels`";
            self.log_error(&self.at, reason.to_owned())
        })
    }

    /// Puts all channels on the flight's clock and cuts them to its part.
    fn to_flight_time(&self, flight: &mut Flight, origin_s: f64) {
        let take = std::mem::take::<Channel<4>>;
        flight.command =
            self.held_from_start(self.shift(Quantity::Command, take(&mut flight.command), origin_s));
        flight.rotor_speed = self.cut(Quantity::RotorSpeed, take(&mut flight.rotor_speed), origin_s);
        flight.attitude = self.cut(Quantity::Attitude, take(&mut flight.attitude), origin_s);
        let take = std::mem::take::<Channel<3>>;
        flight.position = self.cut(Quantity::Position, take(&mut flight.position), origin_s);
        flight.velocity = self.cut(Quantity::Velocity, take(&mut flight.velocity), origin_s);
        flight.angular_velocity =
            self.cut(Quantity::AngularVelocity, take(&mut flight.angular_velocity), origin_s);
        flight.specific_force = self.cut(Quantity::SpecificForce, take(&mut flight.specific_force), origin_s);
        let voltage = std::mem::take(&mut flight.battery_voltage);
        flight.battery_voltage = self.cut(Quantity::BatteryVoltage, voltage, origin_s);
    }

    /// Moves a channel from the log's clock to the flight's, and to when its samples were true.
    fn shift<const N: usize>(
        &self,
        quantity: Quantity,
        mut channel: Channel<N>,
        origin_s: f64,
    ) -> Channel<N> {
        let delay_s = self.entry.delay_s.get(&quantity).map_or(0.0, |delay_s| *delay_s.get_ref());
        channel.time_s.iter_mut().for_each(|time_s| *time_s = *time_s - origin_s - self.start_s() - delay_s);
        channel
    }

    fn cut<const N: usize>(&self, quantity: Quantity, channel: Channel<N>, origin_s: f64) -> Channel<N> {
        self.window(self.shift(quantity, channel, origin_s))
    }

    /// The samples within the flight's part.
    fn window<const N: usize>(&self, channel: Channel<N>) -> Channel<N> {
        let length_s = self.length_s() + SLACK_S;
        let samples = channel.time_s.into_iter().zip(channel.values);
        let inside = samples.filter(|(time_s, _)| (-SLACK_S..=length_s).contains(time_s));
        let (time_s, values): (Vec<f64>, Vec<[f64; N]>) = inside.unzip();
        // Of the samples that the slack lets in before the start, the last stands at the start.
        let early = time_s.partition_point(|time_s| *time_s <= 0.0).saturating_sub(1);
        let mut kept = Channel { time_s: time_s[early..].to_vec(), values: values[early..].to_vec() };
        kept.time_s.iter_mut().take(1).for_each(|first_s| *first_s = first_s.max(0.0));
        kept
    }

    /// The commands within the flight's part; the one that holds at its start begins there.
    fn held_from_start(&self, mut command: Channel<4>) -> Channel<4> {
        let after = command.time_s.partition_point(|time_s| *time_s <= 0.0);
        if let Some(holding) = after.checked_sub(1) {
            command.time_s[holding] = 0.0;
        }
        self.window(command)
    }

    /// Refuses samples that are too far apart, before anything is computed over their time.
    fn check_span(&self, flight: &Flight, log: &dyn Log, origin_s: f64) -> Result<(), FlightsError> {
        let Some(sparse) = span::sparse(flight, span::SPACING_MAX_S) else { return Ok(()) };
        let place = |time_s: f64| {
            let of_log_s = time_s + self.start_s();
            let line = log.line(of_log_s + origin_s).map_or(String::new(), |line| format!("line {line}, "));
            format!("{line}{of_log_s} s from the log's first sample")
        };
        Err(self.log_error(&self.declaration_of(Quantity::Time), sparse.words(place)))
    }

    /// The part of the log that the flight's samples come from.
    fn part(&self, flight: &Flight, origin_s: f64) -> Part {
        let spans = || spans(flight).into_iter().flatten();
        Part {
            origin_s,
            start_s: self.start_s(),
            from_s: self.start_s() + spans().map(|span| span.0).fold(f64::INFINITY, f64::min),
            to_s: self.start_s() + spans().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn start_s(&self) -> f64 {
        self.entry.from_s.as_ref().map_or(0.0, |from_s| *from_s.get_ref())
    }

    fn length_s(&self) -> f64 {
        self.entry.to_s.as_ref().map_or(f64::INFINITY, |to_s| *to_s.get_ref() - self.start_s())
    }

    /// Fills in what the flights file assumes instead of a measurement.
    fn assume(&self, flight: &mut Flight, yaw: Option<Channel<1>>) -> Result<(), FlightsError> {
        let Some(assume) = &self.entry.assume else { return Ok(()) };
        let Assumption::Hover = assume.get_ref();
        let missing = flight.attitude.is_empty() || flight.angular_velocity.is_empty();
        if flight.command.is_empty() || !missing {
            let expected = "a log with commands, and without attitude or angular velocity";
            let found = if missing { "no commands" } else { "a log that has both" };
            let bad = Bad { expected, found, advice: "map `command`, or remove `assume`" };
            return Err(self.document.bad(&assume.span(), "flight.assume", bad));
        }
        let time_s = &flight.command.time_s;
        if flight.attitude.is_empty() {
            let level =
                |time_s: &f64| frame::euler([0.0, 0.0, yaw.as_ref().map_or(0.0, |yaw| at(yaw, *time_s))]);
            let values = time_s.iter().map(level).collect();
            let kept = Channel { time_s: time_s.clone(), values };
            flight.attitude = clean::unit_quaternions(kept, &mut flight.notes)
                .map_err(|reason| self.channel_error(Quantity::Attitude, reason))?;
            let yaw = if yaw.is_some() { "with the yaw logged" } else { "with yaw 0" };
            flight.assumed.push(format!("attitude: level, {yaw} (assume = \"hover\")"));
        }
        if flight.angular_velocity.is_empty() {
            let values = vec![[0.0; 3]; time_s.len()];
            flight.angular_velocity = Channel { time_s: time_s.clone(), values };
            flight.assumed.push("angular velocity: zero (assume = \"hover\")".to_owned());
        }
        Ok(())
    }

    fn say_gaps(&self, flight: &mut Flight) {
        let mut notes = std::mem::take(&mut flight.notes);
        clean::say_gaps(Quantity::Command, &flight.command, &mut notes);
        clean::say_gaps(Quantity::RotorSpeed, &flight.rotor_speed, &mut notes);
        clean::say_gaps(Quantity::Position, &flight.position, &mut notes);
        clean::say_gaps(Quantity::Velocity, &flight.velocity, &mut notes);
        clean::say_gaps(Quantity::Attitude, &flight.attitude, &mut notes);
        clean::say_gaps(Quantity::AngularVelocity, &flight.angular_velocity, &mut notes);
        clean::say_gaps(Quantity::SpecificForce, &flight.specific_force, &mut notes);
        // Not of the battery: its coarse and slow readings repeat, and left out they look like gaps.
        flight.notes = notes;
    }

    fn check_something_is_left(&self, flight: &Flight) -> Result<(), FlightsError> {
        for (quantity, span) in Quantity::CHANNELS.into_iter().zip(spans(flight)) {
            if span.is_none() && self.declared(quantity).is_some() {
                let reason = format!(
                    "no sample lies in the flight's part from {} s on; correct `from_s` and `to_s`",
                    self.start_s()
                );
                return Err(self.channel_error(quantity, reason));
            }
        }
        Ok(())
    }

    /// Compares the values with physics.
    fn judge(&self, flight: &mut Flight) -> Result<(), FlightsError> {
        let findings = plausible::judge(flight, self.vehicle, &self.channels);
        self.settle(flight, findings)
    }

    /// Notes what is not clear, or is to be trusted; the rest is an error.
    fn settle(&self, flight: &mut Flight, findings: Vec<Finding>) -> Result<(), FlightsError> {
        let (clear, vague): (Vec<_>, Vec<_>) = findings.into_iter().partition(|finding| finding.clear);
        flight.notes.extend(vague.into_iter().map(|finding| finding.message));
        if self.entry.trust_units || clear.is_empty() {
            flight.notes.extend(clear.into_iter().map(|finding| finding.message));
            return Ok(());
        }
        Err(FlightsError::Implausible {
            place: self.document.place(&self.declaration_of(clear[0].channel)),
            flight: flight.name.clone(),
            file: self.file.to_owned(),
            findings: clear,
        })
    }

    fn check_delays(&self) -> Result<(), FlightsError> {
        for (quantity, delay_s) in &self.entry.delay_s {
            let number = *delay_s.get_ref();
            if *quantity == Quantity::Time || !number.is_finite() {
                let expected = "a finite number of seconds for a channel other than time";
                let bad = Bad { expected, found: &number.to_string(), advice: "correct it" };
                return Err(self.document.bad(&delay_s.span(), &format!("flight.delay_s.{quantity}"), bad));
            }
        }
        Ok(())
    }

    fn channel_error(&self, quantity: Quantity, reason: String) -> FlightsError {
        self.log_error(&self.declaration_of(quantity), format!("`{quantity}`: {reason}"))
    }

    /// Where a channel is declared; the flight, for one that was taken by default and stands nowhere in the file.
    fn declaration_of(&self, quantity: Quantity) -> Range<usize> {
        let declared = self.channels.get(&quantity).map(Spanned::span).filter(|span| !span.is_empty());
        declared.unwrap_or(self.at.clone())
    }

    fn log_error(&self, at: &Range<usize>, reason: String) -> FlightsError {
        FlightsError::Log {
            place: self.document.place(at),
            flight: self.entry.name.get_ref().clone(),
            file: self.file.to_owned(),
            reason,
        }
    }
}

/// First and last times of all channels, in the order of [`Quantity::CHANNELS`].
fn spans(flight: &Flight) -> [Option<(f64, f64)>; 8] {
    [
        flight.command.span_s(),
        flight.rotor_speed.span_s(),
        flight.position.span_s(),
        flight.velocity.span_s(),
        flight.attitude.span_s(),
        flight.angular_velocity.span_s(),
        flight.specific_force.span_s(),
        flight.battery_voltage.span_s(),
    ]
}

/// What several channels have in common is said once.
fn merged(notes: &[String]) -> Vec<String> {
    let mut said: Vec<(Vec<&str>, &str)> = Vec::new();
    for note in notes {
        let of_channel = note
            .split_once(": ")
            .filter(|(name, _)| Quantity::CHANNELS.iter().any(|own| own.name() == *name));
        let (channel, words) = of_channel.map_or((None, note.as_str()), |(name, words)| (Some(name), words));
        match said.iter_mut().find(|own| own.1 == words && !own.0.is_empty()) {
            Some(own) => own.0.extend(channel),
            None => said.push((channel.into_iter().collect(), words)),
        }
    }
    let line = |(channels, words): &(Vec<&str>, &str)| match channels[..] {
        [] => (*words).to_owned(),
        _ => format!("{}: {words}", channels.join(", ")),
    };
    said.iter().map(line).collect()
}

/// Angles without jumps of a turn.
fn unwrapped(mut angles: Channel<1>) -> Channel<1> {
    let turn = std::f64::consts::TAU;
    for index in 1..angles.values.len() {
        let step = angles.values[index][0] - angles.values[index - 1][0];
        angles.values[index][0] -= turn * (step / turn).round();
    }
    angles
}

/// The channel at `time_s`, interpolated; outside its span the nearest sample.
fn at(channel: &Channel<1>, time_s: f64) -> f64 {
    let after = channel.time_s.partition_point(|sample_s| *sample_s <= time_s);
    match (after.checked_sub(1), channel.time_s.get(after)) {
        (Some(before), Some(after_s)) => {
            let (from, to) = (channel.values[before][0], channel.values[after][0]);
            let before_s = channel.time_s[before];
            from + (to - from) * (time_s - before_s) / (after_s - before_s)
        }
        (Some(last), None) => channel.values[last][0],
        (None, _) => channel.values.first().map_or(0.0, |first| first[0]),
    }
}
