//! Reads one flight from its log: every channel, on one clock, cut to the part that is used.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

use toml::Spanned;
use vehicles::Vehicle;
use vehicles::gaps::{GAP_PERIODS, of_held};

use crate::channels;
use crate::clean;
use crate::declaration::{Assumption, ChannelMap, Entry, FlightEntry, Format};
use crate::document::Document;
use crate::error::{FlightsError, LogError, Spot};
use crate::finding::Finding;
use crate::flight::{AnyChannel, Channel, Flight};
use crate::frame;
use crate::held_commands;
use crate::jumps;
use crate::known::SETTLE_S;
use crate::known_types;
use crate::log::Log;
use crate::plausible;
use crate::quantity::Quantity;
use crate::seams::{self, SeamList, Seams};
use crate::span::{self, Moment, Sparse};
use crate::specific_force::{self, Meaning};

/// Times are differences of decimal fractions since 1970: a sample on the edge of the part belongs to it.
const SLACK_S: f64 = 1e-6;

/// A part of a log, in s from the log's first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// When the log's own clock begins, on the clock of the computer that wrote it, where that is known.
    pub clock_s: f64,
    /// When the first sample was, on the log's own clock.
    pub origin_s: f64,
    /// When the flight's own time begins.
    pub start_s: f64,
    /// The flight's first sample.
    pub from_s: f64,
    /// Its last.
    pub to_s: f64,
}

/// Arguments for the reading of a flight.
pub struct Reading<'a> {
    /// The flights file.
    pub document: &'a Document,
    /// The declared vehicle.
    pub vehicle: &'a Vehicle,
    /// Name of the flight in reports.
    pub name: &'a str,
    /// The flight as declared.
    pub entry: &'a FlightEntry,
    /// Place of its entry.
    pub at: Range<usize>,
    /// The log's format.
    pub format: Format,
    /// The files of the log, in the order of time.
    pub files: &'a [PathBuf],
    /// The channels that apply to the flight.
    pub channels: ChannelMap,
    /// The logs of channels that are in other files.
    pub others: OtherLogs,
}

/// A log beside the flight's own.
pub struct OtherLog {
    /// Its files, in the order of time.
    pub files: Vec<PathBuf>,
    /// Its content.
    pub log: Box<dyn Log>,
}

/// Logs by the channel that is read from them.
pub type OtherLogs = BTreeMap<Quantity, OtherLog>;

/// Findings while channels are read.
#[derive(Default)]
struct Said {
    notes: Vec<String>,
    errors: Vec<FlightsError>,
    seams: Seams,
}

impl Reading<'_> {
    /// Reads the flight from `log`; also returns its part of the log's own time. The memory of the log is free
    /// before the flight is judged.
    ///
    /// # Errors
    /// Those of all channels at once.
    pub fn flight(mut self, whole: Box<dyn Log>) -> Result<(Flight, Part), FlightsError> {
        let log = whole.as_ref();
        let mut taken = Vec::new();
        if self.channels.is_empty() {
            (self.channels, taken) = known_types::defaults(log, self.format, self.vehicle.rotors.len());
        }
        let topics: Vec<&str> =
            self.channels.values().filter_map(|entry| entry.get_ref().topic.as_deref()).collect();
        log.check_clocks(&topics).map_err(|cause| self.log_error(&self.at, None, cause))?;
        let (mut flight, seams) = self.read_channels(log)?;
        flight.commands_on_change =
            self.declared(Quantity::Command).is_some_and(|entry| entry.on_change == Some(true));
        flight.on_rig = self.entry.rig;
        flight.without_torques = self.entry.torques == Some(false);
        flight.notes.splice(0..0, taken);
        let breaks = self.part_at_seams(&mut flight, &seams);
        if self.format.is_table() {
            let of_time = plausible::judge_time(&flight, self.vehicle, &self.channels);
            self.settle(&mut flight, of_time.into_iter().collect())?;
        }
        let mut yaw = self.yaw(log)?;
        let origin_s = self.origin_s(&flight, yaw.as_ref())?;
        self.to_flight_time(&mut flight, origin_s);
        self.check_span(&flight, log, origin_s)?;
        let part = self.part(&flight, log, origin_s);
        drop(whole);
        self.say_breaks(&mut flight, &breaks, origin_s);
        yaw.iter_mut().for_each(|yaw| self.shift(Quantity::Attitude, &mut yaw.time_s, origin_s));
        self.assume(&mut flight, yaw)?;
        jumps::leave_out_jumps(&mut flight);
        self.turn_into_body(&mut flight)?;
        held_commands::leave_out(&mut flight, self.vehicle);
        say_gaps(&mut flight);
        self.check_something_is_left(&flight)?;
        let findings = plausible::judge(&flight, self.vehicle, &self.channels);
        self.settle(&mut flight, findings)?;
        flight.notes = merged(&flight.notes);
        Ok((flight, part))
    }

    fn read_channels(&self, log: &dyn Log) -> Result<(Flight, Seams), FlightsError> {
        let mut flight = Flight::new(self.name, &self.files[0], self.entry.role);
        flight.rotors = self.vehicle.rotors.len();
        flight.other_files = self.files[1..].to_vec();
        flight.other_files.extend(self.others.values().flat_map(|other| other.files.iter().cloned()));
        let said = &mut Said::default();
        flight.attitude = self.channel(log, Quantity::Attitude, said);
        match clean::unit_quaternions(std::mem::take(&mut flight.attitude), &mut said.notes) {
            Ok(attitude) => flight.attitude = attitude,
            Err(cause) => said.errors.push(self.channel_error(Quantity::Attitude, cause)),
        }
        let commands = self.channel(log, Quantity::Command, said);
        flight.command = clean::without_wild_commands(commands, self.vehicle, &mut said.notes);
        flight.rotor_speed = self.channel(log, Quantity::RotorSpeed, said);
        flight.position = self.channel(log, Quantity::Position, said);
        flight.velocity = self.channel(log, Quantity::Velocity, said);
        flight.angular_velocity = self.channel(log, Quantity::AngularVelocity, said);
        flight.specific_force = self.channel(log, Quantity::SpecificForce, said);
        flight.battery_voltage = self.channel(log, Quantity::BatteryVoltage, said);
        FlightsError::gather(std::mem::take(&mut said.errors))?;
        flight.notes = std::mem::take(&mut said.notes);
        Ok((flight, std::mem::take(&mut said.seams)))
    }

    /// A channel on the log's clock; empty where the flight does not declare it, or where it cannot be read.
    fn channel<const N: usize>(&self, log: &dyn Log, quantity: Quantity, said: &mut Said) -> Channel<N> {
        let Some(entry) = self.declared(quantity) else { return Channel::default() };
        if self.entry.assume.is_some() && entry.yaw.is_some() {
            return Channel::default();
        }
        let log = self.log_of(quantity, log);
        let complete = known_types::complete(log, quantity, entry, self.vehicle.rotors.len());
        let read = complete.and_then(|entry| {
            let mut read = channels::read(log, quantity, &entry, self.vehicle, self.entry.trust_units)?;
            if let Some(absent) = known_types::absent(log, quantity, &entry) {
                let (messages, notes) = (&absent.messages, &mut said.notes);
                read.channel = clean::without_absent(quantity, read.channel, messages, absent.fields, notes)?;
            }
            Ok(read)
        });
        let cleaned = read.and_then(|read| {
            said.notes.extend(read.notes.into_iter().map(|note| format!("{quantity}: {note}")));
            said.seams.of_channel.insert(quantity, read.seams);
            clean::clean(quantity, read.channel, &mut said.notes)
        });
        cleaned.unwrap_or_else(|cause| {
            said.errors.push(self.channel_error(quantity, cause));
            Channel::default()
        })
    }

    /// The log of a channel, if not the flight's own, `log`.
    fn log_of<'b>(&'b self, quantity: Quantity, log: &'b dyn Log) -> &'b dyn Log {
        self.others.get(&quantity).map_or(log, |other| other.log.as_ref())
    }

    /// Makes a gap of the time between two parts of a log, in every channel that the log has, where samples are missing.
    /// Returns these times of the flight's own log, on its clock. The voltage of a battery changes slowly and is left as it is.
    fn part_at_seams(&self, flight: &mut Flight, seams: &Seams) -> SeamList {
        let of_log: Vec<Quantity> = Quantity::CHANNELS
            .iter()
            .copied()
            .filter(|quantity| !self.others.contains_key(quantity))
            .collect();
        let is_on_change = flight.commands_on_change;
        let holds = |quantity| is_on_change && quantity == Quantity::Command;
        let times: Vec<_> = flight.times().into_iter().filter(|(quantity, _)| !holds(*quantity)).collect();
        let of_own_log = seams.breaks(&of_log, &times);
        let of_others: BTreeMap<Quantity, SeamList> =
            self.others.keys().map(|quantity| (*quantity, seams.breaks(&[*quantity], &times))).collect();
        let mut notes = Vec::new();
        for (quantity, channel) in flight.channels_mut() {
            let breaks = of_others.get(&quantity).unwrap_or(&of_own_log);
            if breaks.is_empty() || quantity == Quantity::BatteryVoltage || holds(quantity) {
                continue;
            }
            let count = seams::widen(channel, breaks);
            if count > 0 {
                notes.push(format!(
                    "{quantity}: {count} samples beside the gap between two files are left out"
                ));
            }
        }
        flight.notes.extend(notes);
        if is_on_change {
            flight.command_breaks_s = of_others.get(&Quantity::Command).unwrap_or(&of_own_log).clone();
        }
        of_own_log
    }

    /// Notes the times between the files of the flight's log, in which nothing was logged.
    fn say_breaks(&self, flight: &mut Flight, breaks: &[(f64, f64)], origin_s: f64) {
        let mut times = breaks.iter().map(|(from_s, to_s)| [*from_s, *to_s]).collect::<Vec<_>>();
        times.iter_mut().flatten().for_each(|time_s| *time_s -= origin_s + self.start_s());
        let shown: Vec<String> =
            times.iter().map(|[from_s, to_s]| format!("{from_s:.3} s to {to_s:.3} s")).collect();
        if !shown.is_empty() {
            let count = self.files.len();
            flight.notes.push(format!(
                "the log has {count} files; nothing was logged between them from {}",
                shown.join(", from ")
            ));
        }
    }

    fn declared(&self, quantity: Quantity) -> Option<&Entry> {
        self.channels.get(&quantity).map(Spanned::get_ref)
    }

    /// The yaw of a level attitude, in rad and without jumps, on the log's clock.
    fn yaw(&self, log: &dyn Log) -> Result<Option<Channel<1>>, FlightsError> {
        let Some(entry) = self.declared(Quantity::Attitude).filter(|_| self.entry.assume.is_some()) else {
            return Ok(None);
        };
        let log = self.log_of(Quantity::Attitude, log);
        let read = channels::read_yaw(log, entry).and_then(|read| match read {
            None => Ok(None),
            Some(channel) => clean::clean(Quantity::Attitude, channel, &mut Vec::new())
                .map(|cleaned| Some(unwrapped(cleaned))),
        });
        read.map_err(|cause| self.channel_error(Quantity::Attitude, cause))
    }

    /// The log's first sample.
    fn origin_s(&self, flight: &Flight, yaw: Option<&Channel<1>>) -> Result<f64, FlightsError> {
        let times = flight.times().into_iter().map(|(_, time_s)| time_s);
        let firsts = times.chain(yaw.map(|yaw| &yaw.time_s[..])).filter_map(<[f64]>::first).copied();
        firsts.min_by(f64::total_cmp).ok_or_else(|| {
            let advice = "name its columns, topics or variables in `channels`";
            let cause = LogError::unexpected(Spot::Key("channels"), "a channel", "none", advice);
            self.log_error(&self.at, None, cause)
        })
    }

    /// Puts all channels on the flight's clock and cuts them to its part.
    fn to_flight_time(&self, flight: &mut Flight, origin_s: f64) {
        for (quantity, channel) in flight.channels_mut() {
            self.shift(quantity, channel.time_s(), origin_s);
        }
        for (from_s, to_s) in &mut flight.command_breaks_s {
            self.shift(Quantity::Command, std::slice::from_mut(from_s), origin_s);
            self.shift(Quantity::Command, std::slice::from_mut(to_s), origin_s);
        }
        begin_holding(flight);
        flight.channels_mut().into_iter().for_each(|(_, channel)| self.cut(channel));
    }

    /// Moves times from the log's clock to the flight's, and to when the samples were true.
    fn shift(&self, quantity: Quantity, time_s: &mut [f64], origin_s: f64) {
        let delay_s = self.entry.delay_s.get(&quantity).map_or(0.0, |delay_s| *delay_s.get_ref());
        time_s.iter_mut().for_each(|time_s| *time_s = *time_s - origin_s - self.start_s() - delay_s);
    }

    /// Leaves the samples within the flight's part.
    fn cut(&self, channel: &mut dyn AnyChannel) {
        let part = -SLACK_S..=self.length_s() + SLACK_S;
        let times = channel.time_s().clone();
        // Of the samples that the slack lets in before the start, the last stands at the start.
        let early = times.iter().rposition(|time_s| *time_s <= 0.0).unwrap_or(0);
        channel.keep(&|index| index >= early && part.contains(&times[index]));
        channel.time_s().iter_mut().take(1).for_each(|first_s| *first_s = first_s.max(0.0));
    }

    /// Refuses samples that are too far apart, before anything is computed over their time.
    fn check_span(&self, flight: &Flight, log: &dyn Log, origin_s: f64) -> Result<(), FlightsError> {
        flight.check_span(span::SPACING_MAX_S).map_err(|sparse| {
            let gap = sparse.gap.map(|moment| {
                let time_s = moment.time_s + self.start_s();
                Moment { time_s, is_in_log: true, line: log.line(time_s + origin_s) }
            });
            let at = self.declaration_of(Quantity::Time);
            self.log_error(&at, None, LogError::Sparse(Sparse { gap, ..sparse }))
        })
    }

    /// The part of the log that the flight's samples come from.
    fn part(&self, flight: &Flight, log: &dyn Log, origin_s: f64) -> Part {
        let times = || flight.times().into_iter().map(|(_, time_s)| time_s);
        let (firsts, lasts) = (times().filter_map(<[f64]>::first), times().filter_map(<[f64]>::last));
        Part {
            clock_s: log.origin_ns() as f64 * 1e-9,
            origin_s,
            start_s: self.start_s(),
            from_s: self.start_s() + firsts.copied().fold(f64::INFINITY, f64::min),
            to_s: self.start_s() + lasts.copied().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn start_s(&self) -> f64 {
        self.entry.from_s.as_ref().map_or(0.0, |from_s| *from_s.get_ref())
    }

    fn length_s(&self) -> f64 {
        self.entry.to_s.as_ref().map_or(f64::INFINITY, |to_s| *to_s.get_ref() - self.start_s())
    }

    /// Fills in the assumptions of the flights file in place of measurements.
    fn assume(&self, flight: &mut Flight, yaw: Option<Channel<1>>) -> Result<(), FlightsError> {
        let Some(assume) = &self.entry.assume else { return Ok(()) };
        let Assumption::Hover = assume.get_ref();
        let missing = flight.attitude.is_empty() || flight.angular_velocity.is_empty();
        if flight.command.is_empty() || !missing {
            let expected = "of a log with commands, and without attitude or angular velocity";
            let found = if missing { "no commands" } else { "a log that has both" };
            let advice = "map `command`, or remove `assume`";
            return Err(self.document.bad(&assume.span(), "flight.assume", expected, found, advice));
        }
        let time_s = &flight.command.time_s;
        if flight.attitude.is_empty() {
            let level =
                |time_s: &f64| frame::euler([0.0, 0.0, yaw.as_ref().map_or(0.0, |yaw| at(yaw, *time_s))]);
            let values = time_s.iter().map(level).collect();
            let kept = Channel { time_s: time_s.clone(), values };
            flight.attitude = clean::unit_quaternions(kept, &mut flight.notes)
                .map_err(|cause| self.channel_error(Quantity::Attitude, cause))?;
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

    /// Converts the logged vectors to a specific force and an angular velocity in the body.
    fn turn_into_body(&self, flight: &mut Flight) -> Result<(), FlightsError> {
        let axes = self.declared(Quantity::AngularVelocity).and_then(|entry| entry.holds).unwrap_or_default();
        let turned = specific_force::rates_in_body(
            &flight.angular_velocity,
            &flight.attitude,
            axes,
            &mut flight.notes,
        );
        flight.angular_velocity =
            turned.map_err(|cause| self.channel_error(Quantity::AngularVelocity, cause))?;
        let Some(entry) = self.declared(Quantity::SpecificForce) else { return Ok(()) };
        let meaning =
            Meaning { holds: entry.holds.unwrap_or_default(), gravity_m_s2: self.vehicle.gravity_m_s2 };
        let turned =
            specific_force::in_body(&flight.specific_force, &flight.attitude, meaning, &mut flight.notes);
        flight.specific_force = turned.map_err(|cause| self.channel_error(Quantity::SpecificForce, cause))?;
        Ok(())
    }

    fn check_something_is_left(&self, flight: &Flight) -> Result<(), FlightsError> {
        let is_lost =
            |(quantity, time_s): &(Quantity, &[f64])| time_s.is_empty() && self.declared(*quantity).is_some();
        let lost = flight.times().into_iter().filter(is_lost).map(|(quantity, _)| {
            let expected = format!("samples in the flight's part from {} s on", self.start_s());
            let (found, advice) = ("none", "set `from_s` and `to_s` to times of the log");
            self.channel_error(quantity, LogError::unexpected(Spot::Whole, expected, found, advice))
        });
        FlightsError::gather(lost.collect())
    }

    /// Notes findings that are not clear, or that the flights file trusts; the rest is an error.
    fn settle(&self, flight: &mut Flight, findings: Vec<Finding>) -> Result<(), FlightsError> {
        let (clear, vague): (Vec<_>, Vec<_>) =
            findings.into_iter().partition(|finding| finding.fits.is_some());
        flight.notes.extend(vague.into_iter().map(|finding| finding.message));
        if self.entry.trust_units || clear.is_empty() {
            flight.notes.extend(clear.into_iter().map(|finding| finding.message));
            return Ok(());
        }
        Err(FlightsError::Implausible {
            place: self.document.place(&self.declaration_of(clear[0].channel)),
            flight: flight.name.clone(),
            file: self.files[0].clone(),
            findings: clear,
        })
    }

    fn channel_error(&self, quantity: Quantity, cause: LogError) -> FlightsError {
        self.log_error(&self.declaration_of(quantity), Some(quantity), cause)
    }

    /// Returns the place of a channel's declaration. For a channel that was taken by default, returns that of
    /// the flight.
    fn declaration_of(&self, quantity: Quantity) -> Range<usize> {
        let declared = self.channels.get(&quantity).map(Spanned::span).filter(|span| !span.is_empty());
        declared.unwrap_or(self.at.clone())
    }

    fn log_error(&self, at: &Range<usize>, channel: Option<Quantity>, cause: LogError) -> FlightsError {
        let other = channel.and_then(|channel| self.others.get(&channel)).map(|other| &other.files[0]);
        let (flight, file) = (self.name.to_owned(), other.unwrap_or(&self.files[0]).clone());
        FlightsError::Log { place: self.document.place(at), flight, file, channel, cause }
    }
}

/// Moves the command that holds at the start, 0 s, to there; not if the start lies in a gap.
fn begin_holding(flight: &mut Flight) {
    let is_in_gap = flight.command_gaps_s().into_iter().any(|(from_s, to_s)| from_s <= 0.0 && 0.0 < to_s);
    let time_s = &mut flight.command.time_s;
    let Some(holding) = time_s.partition_point(|time_s| *time_s <= 0.0).checked_sub(1) else { return };
    let is_last = holding + 1 == time_s.len() && !flight.commands_on_change;
    if !(is_in_gap || is_last) {
        time_s[holding] = 0.0;
    }
}

fn say_gaps(flight: &mut Flight) {
    let mut notes = std::mem::take(&mut flight.notes);
    for (quantity, time_s) in flight.times() {
        match quantity {
            // Coarse and slow readings repeat; without the repeats they look like gaps.
            Quantity::BatteryVoltage => {}
            Quantity::Command if flight.commands_on_change => {}
            Quantity::Command => say_command_gaps(time_s, &mut notes),
            _ => clean::say_gaps(quantity, time_s, &mut notes),
        }
    }
    flight.notes = notes;
}

/// Notes gaps of the commands and their consequence.
fn say_command_gaps(time_s: &[f64], notes: &mut Vec<String>) {
    let gaps = of_held(time_s);
    let longest = gaps.iter().copied().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
    let Some((from_s, to_s)) = longest else { return };
    notes.push(format!(
        "{}: gaps of more than {GAP_PERIODS} periods: {}, the longest from {from_s:.3} s to {to_s:.3} s; the rotor speeds \
         are unknown there and for {SETTLE_S} s after each, so nothing is compared; if the log writes commands only on change, set \
         `on_change = true` in the channel `command`",
        Quantity::Command,
        gaps.len(),
    ));
}

/// Merges equal notes of several channels into one.
fn merged(notes: &[String]) -> Vec<String> {
    let mut said: Vec<(Vec<&str>, &str)> = Vec::new();
    for note in notes {
        let of_channel = note
            .split_once(": ")
            .filter(|(name, _)| Quantity::CHANNELS.iter().any(|channel| channel.name() == *name));
        let (channel, text) = of_channel.map_or((None, note.as_str()), |(name, text)| (Some(name), text));
        match said.iter_mut().find(|other| other.1 == text && !other.0.is_empty()) {
            Some(same) => same.0.extend(channel),
            None => said.push((channel.into_iter().collect(), text)),
        }
    }
    let line = |(channels, text): &(Vec<&str>, &str)| match channels[..] {
        [] => (*text).to_owned(),
        _ => format!("{}: {text}", channels.join(", ")),
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
