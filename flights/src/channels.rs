//! From the numbers of a log to a channel in SI units and our frames.

use std::borrow::Cow;

use vehicles::Vehicle;

use crate::arrays;
use crate::declaration::{Entry, Frame, Holds};
use crate::error::{LogError, Spot};
use crate::flight::Channel;
use crate::frame;
use crate::log::{Log, Samples};
use crate::matrices;
use crate::name::Name;
use crate::number_rows::NumberRows;
use crate::quantity::{FRACTION, PERCENT, Quantity};
use crate::scaling;
use crate::seams::SeamList;
use diagnostics::Dimension;
use diagnostics::unit::ANGLE;

/// A channel as read. Times need not grow yet and numbers need not be finite.
pub struct Read<const N: usize> {
    /// The samples.
    pub channel: Channel<N>,
    /// Note about it.
    pub notes: Vec<String>,
    /// Seams of a log in several files.
    pub seams: SeamList,
}

/// Reads `quantity` as `entry` declares it; an attitude in the order w, x, y, z. Angles at which no vehicle
/// flies are refused, unless they are trusted.
pub fn read<const N: usize>(
    log: &dyn Log,
    quantity: Quantity,
    entry: &Entry,
    vehicle: &Vehicle,
    is_trusted: bool,
) -> Result<Read<N>, LogError> {
    let layout = Layout::of(quantity, entry, vehicle)?;
    let samples = scaled_samples(log, entry, &layout.names)?;
    if !is_trusted {
        layout.check_angles(&samples.rows)?;
    }
    if layout.shape == Shape::Matrix {
        matrices::check(&samples.rows)?;
    }
    let mut values = Vec::with_capacity(samples.time_s.len());
    for row in samples.rows.iter() {
        values.push(layout.convert(row)?);
    }
    let channel = Channel { time_s: samples.time_s, values };
    Ok(Read { channel, notes: samples.notes, seams: samples.seams })
}

/// Reads the yaw of an attitude that is level by assumption, in rad; `None` where the entry has none.
pub fn read_yaw(log: &dyn Log, entry: &Entry) -> Result<Option<Channel<1>>, LogError> {
    let Some(yaw) = &entry.yaw else { return Ok(None) };
    let factor = factor(ANGLE, entry.unit.as_deref())?;
    let samples = scaled_samples(log, entry, std::slice::from_ref(yaw))?;
    let sign = if entry.frame == Some(Frame::FrdNed) { -1.0 } else { 1.0 };
    let north = if entry.frame == Some(Frame::FrdNed) { std::f64::consts::FRAC_PI_2 } else { 0.0 };
    let values = samples.rows.iter().map(|row| [north + sign * factor * row[0]]).collect();
    Ok(Some(Channel { time_s: samples.time_s, values }))
}

/// A pitch is a right angle at most, but for noise.
const PITCH_MAX_DEG: f64 = 93.0;

/// The largest size among angles, besides a bad sample or two; 0 of none.
fn usual_largest<'a>(angles: impl Iterator<Item = &'a f64>) -> f64 {
    const BAD: f64 = 0.02;
    let mut sizes: Vec<f64> = angles.map(|angle| angle.abs()).filter(|size| size.is_finite()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(((1.0 - BAD) * sizes.len() as f64) as usize).copied().unwrap_or(0.0)
}

/// The samples of `names`: their signs, then the entry's `scale`, then its `offset` applied.
fn scaled_samples(log: &dyn Log, entry: &Entry, names: &[Name]) -> Result<Samples, LogError> {
    let scales = scaling::each(Spot::Key("scale"), entry.scale.as_ref(), 1.0, names.len())?;
    let offsets = scaling::each(Spot::Key("offset"), entry.offset.as_ref(), 0.0, names.len())?;
    let plain: Vec<String> = names.iter().map(|name| name.plain.clone()).collect();
    let mut samples = log.samples(entry.topic.as_deref(), &plain)?;
    for row in samples.rows.iter_mut() {
        for (((number, name), scale), offset) in row.iter_mut().zip(names).zip(&scales).zip(&offsets) {
            *number = *number * name.sign() * scale + offset;
        }
    }
    Ok(samples)
}

/// Form of a sample in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    /// The numbers of the quantity.
    Plain,
    /// Roll, pitch and yaw of an attitude.
    Euler,
    /// The rotation matrix of an attitude.
    Matrix,
}

/// Numbers of the log that make a sample, and their conversion.
struct Layout<'a> {
    quantity: Quantity,
    names: Cow<'a, [Name]>,
    shape: Shape,
    /// Factor of a number, and the offset that is added then.
    factor: f64,
    offset: f64,
    frame: Frame,
    holds: Holds,
}

impl<'a> Layout<'a> {
    fn of(quantity: Quantity, entry: &'a Entry, vehicle: &Vehicle) -> Result<Self, LogError> {
        let frame = entry.frame.unwrap_or_default();
        let (names, shape) = named(quantity, entry, vehicle.rotors.len())?;
        let pole_pairs = pole_pairs(quantity, entry)?;
        require_command_on_change(quantity, entry)?;
        let (factor, offset) = match (quantity, entry.unit.as_deref()) {
            (Quantity::Attitude, unit) if shape == Shape::Euler => (factor(ANGLE, unit)?, 0.0),
            (Quantity::Attitude, None) => (1.0, 0.0),
            (Quantity::Command, Some(unit @ (FRACTION | PERCENT))) => {
                let range = vehicle.command.max - vehicle.command.min;
                (factor(quantity.dimension(), Some(unit))? * range, vehicle.command.min)
            }
            (_, unit) => (factor(quantity.dimension(), unit)? / pole_pairs, 0.0),
        };
        let holds = holds(quantity, entry)?;
        Ok(Self { quantity, names, shape, factor, offset, frame, holds })
    }

    /// Roll and pitch in rad come to more than a turn, and not in a bad sample or two, only if they are in degrees.
    /// The pitch of the sequence z-y-x lies within a right angle: beyond it are tenths of degrees, or another angle.
    fn check_angles(&self, rows: &NumberRows) -> Result<(), LogError> {
        if self.shape != Shape::Euler {
            return Ok(());
        }
        let largest = usual_largest(rows.iter().flat_map(|row| row.iter().take(2)));
        if self.factor > 0.5 && largest > std::f64::consts::TAU {
            let found = format!("up to {largest:.1}, more than a turn");
            let advice = "write `unit = \"deg\"`, which would fit, or set `trust_units = true`";
            return Err(LogError::unexpected(Spot::Whole, "roll and pitch in rad", found, advice));
        }
        let pitch_deg = (self.factor * usual_largest(rows.iter().filter_map(|row| row.get(1)))).to_degrees();
        if pitch_deg > PITCH_MAX_DEG {
            let found = format!("up to {pitch_deg:.0} degrees");
            let advice = "correct the order of `euler` or its `unit`, or set `scale = 0.1` for tenths of a degree; if the angles are \
                          right, set `trust_units = true`";
            return Err(LogError::unexpected(
                Spot::Whole,
                "a pitch of at most 90 degrees either way",
                found,
                advice,
            ));
        }
        Ok(())
    }

    /// A sample in SI units and our frames.
    fn convert<const N: usize>(&self, row: &[f64]) -> Result<[f64; N], LogError> {
        let scaled: Vec<f64> = row.iter().map(|number| number * self.factor + self.offset).collect();
        let turned: Vec<f64> = match (self.quantity, &scaled[..]) {
            (Quantity::Position | Quantity::Velocity, &[x, y, z]) => {
                frame::world(self.frame, [x, y, z]).into()
            }
            (Quantity::AngularVelocity | Quantity::SpecificForce, &[x, y, z]) => {
                frame::axes(self.frame, self.holds, [x, y, z]).into()
            }
            (Quantity::Attitude, &[roll, pitch, yaw]) if self.shape == Shape::Euler => {
                frame::attitude(self.frame, frame::euler([roll, pitch, yaw])).into()
            }
            (Quantity::Attitude, matrix) if self.shape == Shape::Matrix => {
                frame::attitude(self.frame, matrices::quaternion(matrix)).into()
            }
            (Quantity::Attitude, &[x, y, z, w]) => frame::attitude(self.frame, [w, x, y, z]).into(),
            // Behind the last rotor there are zeros.
            (Quantity::Command | Quantity::RotorSpeed, _) => {
                scaled.into_iter().chain(std::iter::repeat(0.0)).take(N).collect()
            }
            _ => scaled,
        };
        turned.try_into().map_err(|row: Vec<f64>| {
            let (expected, found) = (format!("{N} numbers in a sample"), row.len().to_string());
            LogError::unexpected(Spot::Whole, expected, found, "give a name for each number in `channels`")
        })
    }
}

/// The names that `entry` gives for a sample of `quantity` of a vehicle with so many `rotors`, and the
/// sample's form. For an array the names are those of its parts.
fn named(quantity: Quantity, entry: &Entry, rotors: usize) -> Result<(Cow<'_, [Name]>, Shape), LogError> {
    let refused = |key, expected: &str, found: &str, advice| {
        Err(LogError::unexpected(Spot::Key(key), expected, found, advice))
    };
    let of_attitude =
        [("euler", entry.euler.is_some()), ("matrix", entry.matrix.is_some()), ("yaw", entry.yaw.is_some())];
    if let Some((key, _)) =
        of_attitude.into_iter().find(|(_, is_given)| *is_given && quantity != Quantity::Attitude)
    {
        return refused(key, "this key in `attitude` alone", "it here", "remove it");
    }
    let (key, names, size, shape) = match (&entry.columns, &entry.euler, &entry.matrix) {
        (Some(columns), None, None) => ("columns", columns, quantity.size().unwrap_or(rotors), Shape::Plain),
        (None, Some(euler), None) => ("euler", euler, 3, Shape::Euler),
        (None, None, Some(matrix)) => ("matrix", matrix, 9, Shape::Matrix),
        (None, None, None) if entry.yaw.is_some() => {
            let advice = "add `assume = \"hover\"` to the flight";
            return refused("columns", "an attitude", "a `yaw` alone", advice);
        }
        (None, None, None) => return refused("columns", "this or `fields`", "neither", "add them"),
        (None, ..) => return refused("matrix", "this or `euler`", "both", "remove one"),
        (Some(_), Some(_), _) => return refused("euler", "this or `columns`", "both", "remove one"),
        (Some(_), ..) => return refused("matrix", "this or `columns`", "both", "remove one"),
    };
    let names = match &names[..] {
        // The array as a whole.
        [array] if size > 1 => Cow::Owned(arrays::parts(array, size)),
        names if names.len() == size => Cow::Borrowed(names),
        names => {
            let expected =
                if size > 1 { format!("{size} names, or that of an array") } else { "1 name".to_owned() };
            return refused(key, &expected, &names.len().to_string(), "give a name for each number");
        }
    };
    Ok((names, shape))
}

/// Returns the kind of a specific force, or the axes of an angular velocity, as declared; refuses those of another quantity.
fn holds(quantity: Quantity, entry: &Entry) -> Result<Holds, LogError> {
    let Some(holds) = entry.holds else { return Ok(Holds::default()) };
    let known: &[Holds] = match quantity {
        Quantity::SpecificForce => &Holds::FORCES,
        Quantity::AngularVelocity => &Holds::RATES,
        _ => {
            let expected = "this key in `specific_force` or `angular_velocity` alone";
            return Err(LogError::unexpected(Spot::Key("holds"), expected, "it here", "remove it"));
        }
    };
    if known.contains(&holds) {
        return Ok(holds);
    }
    let quoted = |holds: &Holds| format!("\"{}\"", holds.name());
    let expected = known.iter().map(quoted).collect::<Vec<_>>().join(" or ");
    Err(LogError::unexpected(
        Spot::Key("holds"),
        expected,
        quoted(&holds),
        "write one of these, or leave it out",
    ))
}

/// Refuses `on_change` of all but commands: other channels have a value between their samples.
fn require_command_on_change(quantity: Quantity, entry: &Entry) -> Result<(), LogError> {
    if entry.on_change.is_none() || quantity == Quantity::Command {
        return Ok(());
    }
    Err(LogError::unexpected(Spot::Key("on_change"), "this key in `command` alone", "it here", "remove it"))
}

/// Returns the ratio of the electrical to the mechanical speed; 1 where the log has mechanical speeds.
fn pole_pairs(quantity: Quantity, entry: &Entry) -> Result<f64, LogError> {
    let at = Spot::Key("pole_pairs");
    match entry.pole_pairs {
        Some(_) if quantity != Quantity::RotorSpeed => {
            Err(LogError::unexpected(at, "this key in `rotor_speed` alone", "it here", "remove it"))
        }
        Some(0) => {
            let advice = "count the magnets, or leave it out where the log has mechanical speeds";
            Err(LogError::unexpected(at, "half the number of a motor's magnets", "0", advice))
        }
        pairs => Ok(f64::from(pairs.unwrap_or(1))),
    }
}

fn factor(dimension: Dimension, unit: Option<&str>) -> Result<f64, LogError> {
    unit.and_then(|unit| dimension.factor(unit)).ok_or_else(|| {
        let found = unit.map_or("none".to_owned(), |unit| format!("\"{unit}\""));
        let advice = "write one of these; `scale` and `offset` convert numbers of other units";
        LogError::unexpected(Spot::Key("unit"), dimension.names(" or "), found, advice)
    })
}
