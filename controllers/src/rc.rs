//! Raw channels of a remote control: a script of pulses, a recording of a receiver, and a gamepad, on different channels.
//!
//! A recording is a CSV file with the columns `time_s` and `ch1`, `ch2`, …, in µs. Between two rows the pulses of the earlier
//! one hold, as those of a receiver do.

use crate::gamepad::{Control, Gamepad};
use crate::pulses::{LOW_US, PULSES_US, check_channel, check_pulse};
use component::context::{NodeContext, StepContext};
use component::messages::{RC_CHANNELS_MAX, RcChannels};
use component::{Bounded, Component, Info, OutputPorts, StepError};
use diagnostics::nine_decimals;
use diagnostics::parameter::{ParameterError, finite, not_negative, refuse};
use inputs::{FileKind, InputFiles};
use std::collections::BTreeSet;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use vehicles::table::{Dialect, Row, Table, TableError, names, shown};

/// Number of the throttle's channel, from 1.
const THROTTLE: usize = 3;
/// Pulses of sticks before the script moves them, µs; the throttle and all switches begin at the lower end.
const MIDDLE_US: f64 = 1500.0;
/// Channels of the sticks: roll, pitch, throttle, yaw.
const STICKS: usize = 4;

/// Parameters of `rc`.
#[derive(Debug, component::Parameters)]
pub struct Parameters {
    /// Number of channels.
    #[parameter(shown = "the highest that is used, at least 4", range = format!("from the highest that is used to {RC_CHANNELS_MAX}"))]
    channels: Option<usize>,
    /// List of moves. A move begins at the pulses that the one before it on the channel has reached. Before its first move a stick sends
    /// 1500 µs, throttle and switches 1000 µs.
    #[parameter(default = Vec::new(), table = Move, entry = "N")]
    script: Vec<Move>,
    /// Recording of a receiver, relative to the manifest; `script` then has other channels only.
    #[parameter(file = FileKind::DATA)]
    data: Option<PathBuf>,
    /// Time in the recording at which tick 0 lies.
    #[parameter(default = 0.0)]
    from_s: f64,
    /// Joystick device of Linux of a gamepad or a transmitter, such as `/dev/input/js0`.
    gamepad: Option<PathBuf>,
    /// List of the gamepad's controls, each of which moves a channel; `script` and `data` then have other channels only.
    #[parameter(default = Vec::new(), table = Control, entry = "N")]
    controls: Vec<Control>,
}

/// Move of a channel.
#[derive(Clone, Copy, Debug, component::Parameters)]
struct Move {
    /// Number of the channel, from 1: roll, pitch, throttle, yaw, switches.
    #[parameter(check = check_channel)]
    channel: usize,
    /// Start.
    #[parameter(check = finite)]
    at_s: f64,
    /// Pulses at its end.
    #[parameter(unit = "µs", check = check_pulse)]
    pulse_us: f64,
    /// Duration; 0 for a step.
    #[parameter(default = 0.0, check = not_negative)]
    over_s: f64,
}

/// Outputs of `rc`.
#[derive(Debug, OutputPorts)]
pub struct Outputs {
    /// Channels of the remote control.
    pub rc: RcChannels,
}

/// The component `rc`.
///
/// ```
/// let parameters = serde_json::json!({ "script": [
///     { "channel": 3, "at_s": 0.001, "pulse_us": 1400, "over_s": 0.002 },
///     { "channel": 5, "at_s": 0.0, "pulse_us": 2000 },
/// ] });
/// let mut rc = component::Harness::<controllers::rc::Rc>::from_json(&parameters).unwrap();
/// let throttle_us = [0, 1, 2, 3, 4].map(|_| rc.step(()).unwrap().rc.pulse[2]);
/// assert_eq!(throttle_us, [1000.0, 1000.0, 1200.0, 1400.0, 1400.0]);
/// assert_eq!(rc.step(()).unwrap().rc.pulse, [1500.0, 1500.0, 1400.0, 1500.0, 2000.0]);
/// ```
#[derive(Debug)]
pub struct Rc {
    channels: usize,
    /// By their starts.
    script: Vec<Segment>,
    recording: Option<Recording>,
    from_s: f64,
    gamepad: Option<Gamepad>,
}

impl Component for Rc {
    const INFO: Info = Info::new(
        "rc",
        "raw channels of a remote control: a script of pulses from the manifest, a recording of a receiver, or a gamepad",
    );
    type Parameters = Parameters;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = ();

    fn new(parameters: Parameters, context: &NodeContext<'_>) -> Result<Self, ParameterError> {
        let Parameters { channels, mut script, data, from_s, gamepad, controls } = parameters;
        let start = refuse(!from_s.is_finite() || from_s != 0.0 && data.is_none(), "from_s", || {
            format!("`from_s` is {from_s} s, expected a time of the recording in `data`")
        });
        let recording = data.map(|path| Recording::load(&context.files, &path)).transpose();
        let gamepad = ParameterError::both(start, Gamepad::open(gamepad, controls));
        let (recording, ((), gamepad)) = ParameterError::both(recording, gamepad)?;
        let recorded: BTreeSet<usize> =
            recording.iter().flat_map(|recording| recording.channels.iter().copied()).collect();
        let moved: BTreeSet<usize> = script.iter().map(|it| it.channel).collect();
        let by_hand = gamepad.as_ref().map(Gamepad::channels).unwrap_or_default();
        let shared = [
            refuse_shared("script", &moved, "`data` records", &recorded),
            refuse_shared("controls", &by_hand, "`script` moves", &moved),
            refuse_shared("controls", &by_hand, "`data` records", &recorded),
        ];
        let used = moved.iter().chain(&recorded).chain(&by_hand);
        let highest = used.max().copied().unwrap_or(0).max(STICKS);
        let channels = channels.unwrap_or(highest);
        let count = refuse(!(highest..=RC_CHANNELS_MAX).contains(&channels), "channels", || {
            format!(
                "`channels` is {channels}, expected {highest} to {RC_CHANNELS_MAX}: channel {highest} is used"
            )
        });
        let times = recording.as_ref().map_or(Ok(()), |recording| recording.check_times(from_s, context));
        ParameterError::gather(shared.into_iter().chain([count, times]))?;
        script.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        warn_of_moves(&script, context);
        Ok(Self { channels, script: segments(&script), recording, from_s, gamepad })
    }

    fn initial(&self) {}

    fn step(&self, context: &StepContext<'_>, (): (), (): &mut ()) -> Result<Outputs, StepError> {
        let time_s = context.time_s();
        let row = self.recording.as_ref().map(|recording| recording.row(self.from_s + time_s));
        let by_hand = self.gamepad.as_ref().map(Gamepad::pulses_us).transpose()?;
        let pulse = |at: usize| {
            let moved = by_hand.as_ref().and_then(|pulses_us| pulses_us[at]);
            let recorded = self.recording.as_ref().zip(row).and_then(|(it, row)| it.pulse_us(row, at + 1));
            moved.or(recorded).unwrap_or_else(|| self.scripted_us(at + 1, time_s))
        };
        Ok(Outputs { rc: RcChannels { pulse: Bounded::from_fn(self.channels, pulse), ..Default::default() } })
    }
}

/// Refuses each of the `channels` of `key` that is among the `others`, which another key `has`.
fn refuse_shared(
    key: &str,
    channels: &BTreeSet<usize>,
    has: &str,
    others: &BTreeSet<usize>,
) -> Result<(), ParameterError> {
    let shared = channels.intersection(others).map(|channel| {
        let message = format!("`{key}` moves channel {channel}, which {has}; leave one of them out");
        Err::<(), _>(ParameterError::conflict(key, message))
    });
    ParameterError::gather(shared).map(|_| ())
}

/// Warns of moves of `script`, which is sorted by start, that never act.
fn warn_of_moves(script: &[Move], context: &NodeContext<'_>) {
    if let Some(Move { channel, at_s, pulse_us, .. }) = never_acting(script) {
        let message = format!(
            "`script` moves channel {channel} twice at {at_s} s: the move to {pulse_us} µs never acts; leave it out"
        );
        context.warn("script", message);
    }
    let end_s = context.duration_s();
    let end = nine_decimals(end_s);
    for Move { channel, at_s, .. } in script.iter().filter(|it| it.at_s >= end_s) {
        let message = format!(
            "`script`: channel {channel} moves at {at_s} s, and the run ends at {end} s: it never acts"
        );
        context.warn_behind_end("script", message);
    }
}

impl Rc {
    /// Returns the pulses that the script has on `channel` at `time_s`.
    fn scripted_us(&self, channel: usize, time_s: f64) -> f64 {
        let begun = |it: &&Segment| it.to.channel == channel && it.to.at_s <= time_s;
        self.script.iter().rfind(begun).map_or_else(|| neutral_us(channel), |it| it.reached_us(time_s))
    }
}

/// A move with the pulses from which it begins.
#[derive(Clone, Copy, Debug)]
struct Segment {
    from_us: f64,
    to: Move,
}

impl Segment {
    fn reached_us(&self, time_s: f64) -> f64 {
        let Move { at_s, pulse_us, over_s, .. } = self.to;
        let passed_s = time_s - at_s;
        if passed_s >= over_s {
            return pulse_us;
        }
        self.from_us + (pulse_us - self.from_us) * passed_s / over_s
    }
}

/// Returns `script`, which is sorted by start, with the pulses at which each move begins: those that the move before it on the
/// channel has reached by then.
fn segments(script: &[Move]) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    for to in script {
        let before = segments.iter().rfind(|it| it.to.channel == to.channel);
        let from_us = before.map_or_else(|| neutral_us(to.channel), |it| it.reached_us(to.at_s));
        segments.push(Segment { from_us, to: *to });
    }
    segments
}

/// Returns the first move of `script`, which is sorted by start, that another of its channel replaces when it starts. A step before a ramp
/// is where the ramp starts.
fn never_acting(script: &[Move]) -> Option<&Move> {
    script.iter().enumerate().find_map(|(at, first)| {
        let is_twin =
            |other: &&Move| other.channel == first.channel && other.at_s.total_cmp(&first.at_s).is_eq();
        let next = script[at + 1..].iter().find(is_twin)?;
        (first.over_s > 0.0 || next.over_s == 0.0).then_some(first)
    })
}

fn neutral_us(channel: usize) -> f64 {
    if channel <= STICKS && channel != THROTTLE { MIDDLE_US } else { LOW_US }
}

/// Recording of a receiver, at least one row.
#[derive(Debug)]
struct Recording {
    /// Numbers of the channels, from 1.
    channels: Vec<usize>,
    times_s: Vec<f64>,
    /// Pulses of each of `channels`, row by row.
    pulses_us: Vec<Vec<f64>>,
}

/// The file of a recording, and its table.
struct Source<'a> {
    file: &'a str,
    table: &'a Table,
}

impl Source<'_> {
    /// Refuses the first row of another length than the header's.
    fn require_lengths(&self) -> Result<(), ParameterError> {
        let of_row = |row: Row<'_>| self.table.fault_of_length(row).map(|fault| (row.line, fault));
        let Some((line, fault)) = self.table.rows.iter().find_map(of_row) else { return Ok(()) };
        Err(refused(self.file, format_args!(":{line}: {fault}")))
    }

    /// The rows that are as long as the header: others are refused for their length.
    fn whole_rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.table.rows.iter().filter(|row| self.table.fault_of_length(*row).is_none())
    }

    /// Times, which have to grow, of the column `place`.
    fn times_s(&self, place: usize) -> Result<Vec<f64>, ParameterError> {
        let mut before_s = f64::NEG_INFINITY;
        let time_s = |row: Row<'_>| -> Result<f64, ParameterError> {
            let is_later = |time_s: f64| time_s.is_finite() && time_s > before_s;
            before_s = self.number(row, place, is_later, "a time after the row before")?;
            Ok(before_s)
        };
        self.whole_rows().map(time_s).collect()
    }

    /// Pulses of the column `place`.
    fn pulses_us(&self, place: usize) -> Result<Vec<f64>, ParameterError> {
        let is_pulse = |pulse_us: f64| PULSES_US.contains(&pulse_us);
        self.whole_rows().map(|row| self.number(row, place, is_pulse, "pulses of 800 to 2200 µs")).collect()
    }

    fn number(
        &self,
        row: Row<'_>,
        place: usize,
        is_valid: impl Fn(f64) -> bool,
        expected: &str,
    ) -> Result<f64, ParameterError> {
        let cell = row.cell(place);
        self.table.number(cell).filter(|number| is_valid(*number)).ok_or_else(|| {
            let (line, column, found) = (row.line, &self.table.headers[place], shown(cell));
            let fault = format_args!(":{line}: column `{column}`: expected {expected}, found \"{found}\"");
            refused(self.file, fault)
        })
    }
}

/// Returns the error that the recording `file` has `fault`, which stands behind its name.
fn refused(file: &str, fault: impl Display) -> ParameterError {
    ParameterError::conflict("data", format_args!("{file}{fault}"))
}

impl Recording {
    fn load(files: &InputFiles, path: &Path) -> Result<Self, ParameterError> {
        let file = path.display().to_string();
        let bytes = files
            .bytes(path)
            .map_err(|cause| refused(&file, format_args!(": cannot read it: {cause}; check the path")))?;
        Self::read(&file, &bytes)
    }

    fn read(file: &str, bytes: &[u8]) -> Result<Self, ParameterError> {
        let known: Vec<String> = (1..=RC_CHANNELS_MAX).map(|channel| format!("ch{channel}")).collect();
        let wanted: Vec<&str> = std::iter::once("time_s").chain(known.iter().map(String::as_str)).collect();
        let table = Table::parse(bytes, &wanted, &Dialect::default())
            .map_err(|cause| refused(file, format_args!(": {}", without_keys(&cause))))?;
        let place = |(index, name): (usize, &String)| Some((index + 1, table.column(name).ok()?));
        let places: Vec<(usize, usize)> = known.iter().enumerate().filter_map(place).collect();
        let line = table.header_line.unwrap_or(1);
        let time = table.column("time_s").ok();
        let is_whole = !places.is_empty() && places.len() + 1 == table.headers.len();
        let Some(time) = time.filter(|_| is_whole) else {
            let found = names(&table.headers);
            return Err(refused(
                file,
                format_args!(
                    ":{line}: expected the columns time_s and ch1 to ch{RC_CHANNELS_MAX}, each once, found {found}"
                ),
            ));
        };
        table.check_rows(1).map_err(|cause| refused(file, format_args!(": {cause}")))?;
        let source = Source { file, table: &table };
        let pulses = ParameterError::gather(places.iter().map(|(_, place)| source.pulses_us(*place)));
        let columns = ParameterError::both(source.times_s(time), pulses);
        let ((), (times_s, pulses_us)) = ParameterError::both(source.require_lengths(), columns)?;
        Ok(Self { channels: places.iter().map(|(channel, _)| *channel).collect(), times_s, pulses_us })
    }

    /// Refuses a start behind the end of the recording, and warns of a run that is longer.
    fn check_times(&self, from_s: f64, context: &NodeContext<'_>) -> Result<(), ParameterError> {
        let last_s = self.times_s.last().copied().unwrap_or_default();
        refuse(from_s > last_s, "from_s", || {
            format!("`from_s` is {from_s} s, expected at most {last_s} s, the time of the last row of `data`")
        })?;
        let begin_s = self.times_s.first().copied().unwrap_or_default() - from_s;
        if begin_s > 0.0 {
            context.warn(
                "data",
                format!(
                    "`data` begins at {} s of the run: its first pulses are sent from 0 s on; set `from_s` to begin with its first row",
                    nine_decimals(begin_s)
                ),
            );
        }
        let end_s = last_s - from_s;
        if end_s < context.duration_s() {
            context.warn(
                "data",
                format!(
                    "`data` ends at {} s of the run: its last pulses hold from there on",
                    nine_decimals(end_s)
                ),
            );
        }
        Ok(())
    }

    /// Returns the index of the newest row at `time_s`; of the first one before it.
    fn row(&self, time_s: f64) -> usize {
        self.times_s.partition_point(|row_s| *row_s <= time_s).saturating_sub(1)
    }

    fn pulse_us(&self, row: usize, channel: usize) -> Option<f64> {
        let place = self.channels.iter().position(|known| *known == channel)?;
        Some(self.pulses_us[place][row])
    }
}

/// Text of a fault of the file, without the advice to set a key `csv`, which `rc` does not have.
fn without_keys(cause: &TableError) -> String {
    let text = cause.to_string();
    if !text.contains("`csv.") {
        return text;
    }
    let fault = text.split(';').next().unwrap_or_default();
    let is_of_keys = fault.contains("`csv.");
    let fault = if is_of_keys { String::new() } else { format!("{fault}; ") };
    format!(
        "{fault}expected a line with the names time_s, ch1, ch2, …, then rows of numbers with decimal points"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use component::Parameters as _;

    /// Warnings of `text`, with `files`.
    fn warnings(text: &str) -> Vec<String> {
        let context = NodeContext::new("rc", &[]).timed(1_000_000, 1, 1000);
        Rc::new(toml::from_str(text).unwrap(), &context).unwrap();
        context.into_warnings().into_iter().map(|warning| warning.message).collect()
    }

    #[test]
    fn a_move_that_never_acts_is_warned_of() {
        let twice = |first: &str, second: &str| {
            let of = |more: &str| format!("{{ channel = 3, at_s = 0.5, {more} }}");
            warnings(&format!("script = [{}, {}]", of(first), of(second)))
        };
        let told = twice("pulse_us = 1200", "pulse_us = 1400");
        assert!(told[0].contains("channel 3 twice at 0.5 s: the move to 1200 µs never acts"), "{told:?}");
        assert_eq!(twice("pulse_us = 1200, over_s = 1.0", "pulse_us = 1400, over_s = 1.0").len(), 1);
        assert_eq!(
            twice("pulse_us = 1200", "pulse_us = 1400, over_s = 1.0"),
            [""; 0],
            "the ramp starts at 1200"
        );
    }

    #[test]
    fn data_that_begins_late_is_warned_of() {
        let told = |text: &str, from_s: f64| {
            let context = NodeContext::new("rc", &[]).timed(1_000_000, 1, 1000);
            Recording::read("rc.csv", text.as_bytes()).unwrap().check_times(from_s, &context).unwrap();
            context.into_warnings().into_iter().map(|warning| warning.message).collect::<Vec<_>>()
        };
        let text = "time_s,ch1\n3,1500\n9,1600\n";
        assert!(told(text, 0.0)[0].contains("begins at 3 s of the run"));
        assert_eq!(told(text, 3.0), [""; 0]);
    }

    fn rc(text: &str) -> Result<Rc, ParameterError> {
        let parameters: Parameters = toml::from_str(text).unwrap();
        parameters.validate()?;
        Rc::new(parameters, &NodeContext::new("rc", &[]))
    }

    #[test]
    fn a_move_begins_where_the_one_before_has_come_to() {
        let rc = rc("script = [
            { channel = 1, at_s = 2.0, pulse_us = 1500 },
            { channel = 1, at_s = 1.0, pulse_us = 2000, over_s = 2.0 },
        ]")
        .unwrap();
        let at = |time_s| rc.scripted_us(1, time_s);
        assert_eq!([0.0, 1.0, 1.5, 1.999].map(at)[..3], [1500.0, 1500.0, 1625.0]);
        assert!((at(1.999) - 1749.75).abs() < 1e-9);
        assert_eq!(at(2.0), 1500.0);
        let ramps = "script = [{ channel = 3, at_s = 0.0, pulse_us = 1400, over_s = 2.0 }, { channel = 3, at_s = 1.0, pulse_us = 1000, over_s = 1.0 }]";
        let ramps = super::tests::rc(ramps).unwrap();
        assert_eq!(
            [0.5, 1.0, 1.5, 2.0].map(|time_s| ramps.scripted_us(3, time_s)),
            [1100.0, 1200.0, 1100.0, 1000.0]
        );
    }

    #[test]
    fn pulses_of_a_receiver_hold_from_row_to_row() {
        let text = b"time_s,ch1,ch5\n1,1500,1000\n1.02,1600,2000\n";
        let read = Recording::read("rc.csv", text).unwrap();
        let pulses = |time_s| [1, 5, 2].map(|channel| read.pulse_us(read.row(time_s), channel));
        assert_eq!(pulses(0.0), [Some(1500.0), Some(1000.0), None]);
        assert_eq!(pulses(1.019), [Some(1500.0), Some(1000.0), None]);
        assert_eq!(pulses(1.02), [Some(1600.0), Some(2000.0), None]);
        assert_eq!(pulses(99.0), [Some(1600.0), Some(2000.0), None]);
    }

    #[test]
    fn values_that_no_receiver_sends_are_refused_with_their_place() {
        let refused = |text: &str| Recording::read("rc.csv", text.as_bytes()).unwrap_err().to_string();
        assert!(refused("time_s,ch1\n0,1500\n0,1500\n").contains(":3: column `time_s`"));
        assert!(refused("time_s,ch1\n0,15\n").contains("column `ch1`: expected pulses of 800 to 2200 µs"));
        assert!(refused("time_s,ch1,roll\n0,1500,1\n").contains("ch1 to ch16"));
        assert!(refused("time_s,ch1\n").contains("line 1: expected a row of numbers"));
        let all = refused("time_s,ch1,ch2\n0,15,1500\n0,1500,x\n1,15,1500\n2,1500\n");
        let parts = [":5: expected 3 cells", ":3: column `time_s`", ":2: column `ch1`", ":3: column `ch2`"];
        assert!(parts.iter().all(|part| all.contains(part)) && all.lines().count() == 4, "{all}");
        for text in ["ch1,ch2\n1500,1500\n", "1500,1500\n1500,1500\n", "time,ch1\n0,1500\n"] {
            let fault = refused(text);
            assert!(fault.contains("time_s") && !fault.contains("csv."), "{fault}");
        }
        for (key, text) in [
            ("script.0.channel", "script = [{ channel = 17, at_s = 0.0, pulse_us = 1500 }]"),
            ("script.0.pulse_us", "script = [{ channel = 1, at_s = 0.0, pulse_us = 500 }]"),
            ("script.0.over_s", "script = [{ channel = 1, at_s = 0.0, pulse_us = 1500, over_s = -1.0 }]"),
            ("channels", "channels = 3"),
            ("from_s", "from_s = 1.0"),
        ] {
            assert_eq!(rc(text).unwrap_err().key(), key, "{text}");
        }
        assert_eq!(rc("").unwrap().channels, 4);
    }
}
