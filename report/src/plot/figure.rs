//! Figures, ready for any kind of file: axes with named, coloured curves of one unit, and paths in space.

use crate::plot::choice::{Ask, Choice, Role, Wanted};
use crate::plot::thin;
use anyhow::{Result, bail};
use diagnostics::printable_line;
use serde::{Serialize, Serializer};

/// Distinguishable also without colour vision (after Okabe and Ito): those of light pages, `--curve-0` to `--curve-7` of
/// `colours.css`.
const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#b8508c", "#a87b00", "#3b97c9", "#6b4fa0", "#4d4d4d"];

/// Name in the style sheet of pages of a line's colour.
pub fn colour_name(colour: &str) -> String {
    let index = COLOURS.iter().position(|known| *known == colour).unwrap_or_default();
    format!("--curve-{index}")
}

/// A line over time or in space.
#[derive(Clone, Debug, Serialize)]
pub struct Line<P> {
    /// Name in the legend.
    pub name: String,
    /// Topic.
    pub topic: String,
    /// Field path of a line over time.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub field: String,
    /// Its meaning.
    pub role: Role,
    /// Colour, as HTML writes it.
    pub colour: &'static str,
    /// True if it is drawn darker: its colour is that of a leading line beside it.
    pub is_darker: bool,
    /// True if it is drawn as a wide and pale band: an estimate beside leading lines of another role.
    pub is_band: bool,
    /// Samples in the recording.
    pub samples: u64,
    /// The points; JSON has their number.
    #[serde(serialize_with = "count")]
    pub points: Vec<P>,
}

/// A line over time: times in seconds and values.
pub type Curve = Line<(f64, f64)>;
/// A path in space, by positions in metres.
pub type Trail = Line<[f64; 3]>;

/// A set of axes over time.
#[derive(Clone, Debug, Serialize)]
pub struct Axes {
    /// Title.
    pub title: String,
    /// Label of the vertical axis.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// The lines, those on top last.
    pub curves: Vec<Curve>,
}

/// The axis across: time, or the number that the curves are drawn against.
#[derive(Clone, Debug, Serialize)]
pub struct Across {
    /// Label of the axis, with its unit.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// Its ends.
    pub range: [f64; 2],
    /// True if the axis is time.
    pub is_time: bool,
}

/// The axes of a vehicle.
#[derive(Clone, Debug, Serialize)]
pub struct Panel {
    /// Vehicle; empty where it has no name.
    pub vehicle: String,
    /// Its axes.
    pub axes: Vec<Axes>,
}

/// The lines in the order in which they are drawn, those on top last.
pub fn in_layers<P>(lines: &[Line<P>]) -> Vec<&Line<P>> {
    let mut lines: Vec<&Line<P>> = lines.iter().collect();
    lines.sort_by_key(|line| line.role.layer());
    lines
}

fn count<T, S: Serializer>(points: &[T], serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serializer.serialize_u64(points.len() as u64)
}

/// The axes of all vehicles, those without a curve left out.
///
/// # Errors
/// If the curves of one set of axes have different units.
pub fn panels(wanted: &[Wanted]) -> Result<Vec<Panel>> {
    let mut panels = Vec::new();
    for of_vehicle in wanted.chunk_by(|a, b| a.vehicle == b.vehicle) {
        let mut axes = of_vehicle.iter().map(axes).collect::<Result<Vec<_>>>()?;
        axes.retain(|axes| !axes.curves.is_empty());
        if !axes.is_empty() {
            panels.push(Panel { vehicle: of_vehicle[0].vehicle.clone(), axes });
        }
    }
    Ok(panels)
}

fn axes(wanted: &Wanted) -> Result<Axes> {
    let unit = unit(&wanted.asks)?;
    let curves = wanted.asks.iter().flat_map(|ask| ask.curves.iter().map(move |curve| (ask, curve)));
    let curves = curves.map(|(ask, (channel, curve))| Curve {
        name: String::new(),
        topic: ask.topic.clone(),
        field: channel.path.clone(),
        role: ask.role,
        colour: "",
        is_darker: false,
        is_band: false,
        samples: curve.samples(),
        points: curve.points(),
    });
    let mut curves: Vec<Curve> = curves.collect();
    curves.sort_by_key(|curve| curve.role);
    name(&mut curves);
    colour(&mut curves);
    set_beside(&mut curves);
    let fields = together(&distinct(wanted.asks.iter().map(|ask| ask.field.as_str())));
    let or_fields = |text: &str| if text.is_empty() { fields.clone() } else { text.to_owned() };
    Ok(Axes { title: or_fields(wanted.title), label: or_fields(wanted.label), unit, curves })
}

/// The one unit of all curves.
fn unit(asks: &[Ask]) -> Result<String> {
    let units_of = |ask: &Ask| distinct(ask.curves.iter().map(|(channel, _)| channel.unit.clone()));
    let units = distinct(asks.iter().flat_map(units_of));
    if units.len() > 1 {
        let told = |ask: &Ask| format!("{}:{} in {}", ask.topic, ask.field, units_of(ask).join(", "));
        let asks = asks.iter().map(told).collect::<Vec<_>>().join(", ");
        bail!(
            "one set of axes has one unit, but it was asked for {}: give each unit a --plot of its own",
            printable_line(&asks)
        );
    }
    Ok(units.into_iter().next().unwrap_or_default())
}

/// The items without those that came before, in their order.
fn distinct<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    items.fold(Vec::new(), |mut seen, item| {
        if !seen.contains(&item) {
            seen.push(item);
        }
        seen
    })
}

/// The axis across all curves: the time that was read, or the span of the number that they are drawn against.
///
/// # Errors
/// If that is not one number.
pub fn across(choice: &Choice, span_s: [f64; 2]) -> Result<Across> {
    let Some(ask) = &choice.against else {
        let (label, unit) = ("simulated time [s]".to_owned(), "s".to_owned());
        return Ok(Across { label, unit, range: span_s, is_time: true });
    };
    let [(channel, line)] = &ask.curves[..] else {
        let parts =
            ask.curves.iter().map(|(channel, _)| channel.path.as_str()).collect::<Vec<_>>().join(", ");
        let asked = format!("{}:{}", ask.topic, ask.field);
        bail!(
            "--against {} is several numbers: name one of {}",
            printable_line(&asked),
            printable_line(&parts)
        );
    };
    let values = line.points().into_iter().map(|(_, value)| value).filter(|value| value.is_finite());
    let range = values
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
    let (label, unit) = (format!("{} [{}]", ask.field, channel.unit), channel.unit.clone());
    Ok(Across { label, unit, range, is_time: false })
}

/// The names of fields; parts of one field with its name once.
fn together(fields: &[&str]) -> String {
    let parts: Option<Vec<_>> = fields.iter().map(|field| field.rsplit_once('.')).collect();
    match parts.as_deref() {
        Some([(whole, _), _, ..]) if parts.iter().flatten().all(|(other, _)| other == whole) => {
            let parts: Vec<_> = parts.iter().flatten().map(|(_, part)| *part).collect();
            format!("{whole} {}", parts.join(", "))
        }
        _ => fields.join(", "),
    }
}

/// The last part of a field's path.
fn short(path: &str) -> &str {
    path.rsplit_once('.').map_or(path, |(_, last)| last)
}

/// Names a flown curve by its component, and every other by that and its role; by topic and field if two would have
/// the same name.
fn name(curves: &mut [Curve]) {
    let named = |curve: &Curve| {
        let is_fellow = |other: &&Curve| {
            other.role == Role::Flown
                && component(&other.field).is_some_and(|it| component(&curve.field) == Some(it))
        };
        let fellow = curves.iter().find(is_fellow).filter(|_| curve.role != Role::Flown);
        format!("{}{}", short(&fellow.unwrap_or(curve).field), curve.role.suffix())
    };
    let names: Vec<String> = curves.iter().map(named).collect();
    for (curve, name) in curves.iter_mut().zip(&names) {
        let is_only = names.iter().filter(|other| *other == name).count() == 1;
        curve.name = if is_only { name.clone() } else { format!("{} {}", curve.topic, curve.field) };
    }
}

/// The axis, angle or rotor that a field is of: a flown curve and its set point share the colour.
fn component(field: &str) -> Option<usize> {
    let short = short(field);
    match short.strip_suffix("_set_point").unwrap_or(short) {
        "x" | "u" | "roll" => Some(0),
        "y" | "v" | "pitch" => Some(1),
        "z" | "w" | "yaw" | "altitude" => Some(2),
        last => last.rsplit_once('[')?.1.strip_suffix(']')?.parse().ok(),
    }
}

/// Gives the flown curves different colours, and every other that of the flown one of its component.
fn colour(curves: &mut [Curve]) {
    // Colour and component of the curves that have a colour which no other has.
    let mut taken: Vec<(usize, Option<usize>)> = Vec::new();
    for curve in curves {
        let part = component(&curve.field);
        let fellow = taken.iter().find(|(_, other)| part.is_some() && *other == part);
        let index = match fellow.filter(|_| curve.role != Role::Flown) {
            Some((index, _)) => *index,
            None => {
                let is_free = |index: &usize| taken.iter().all(|(other, _)| other != index);
                let free = part.into_iter().chain(0..COLOURS.len()).find(is_free).unwrap_or(taken.len());
                taken.push((free, part));
                free
            }
        };
        curve.colour = COLOURS[index % COLOURS.len()];
    }
}

/// The paths in space: those of one vehicle have one colour, and each free body has one. Where there is one vehicle alone,
/// its flown, estimated, measured and requested paths differ in colour.
pub fn trails(read: &[(Ask, thin::Poses)]) -> Vec<Trail> {
    let drawn = || read.iter().filter(|(_, trail)| trail.samples > 0);
    // A body may be called as a vehicle is.
    let mover = |(ask, trail): &'_ (Ask, thin::Poses)| {
        (trail.body().is_some(), trail.body().unwrap_or(ask.vehicle()).to_owned())
    };
    let movers = distinct(drawn().map(mover));
    let drawn = drawn().map(|read| {
        let (ask, trail) = read;
        let index = match movers.len() {
            1 => role_colour(ask.role),
            _ => movers.iter().position(|known| *known == mover(read)).unwrap_or_default(),
        };
        Trail {
            name: trail.body().map_or_else(|| trail_name(ask.vehicle(), ask.role), str::to_owned),
            topic: ask.topic.clone(),
            field: String::new(),
            role: ask.role,
            colour: COLOURS[index % COLOURS.len()],
            is_darker: false,
            is_band: false,
            samples: trail.samples,
            points: trail.points().into_iter().map(|[x, y, z, ..]| [x, y, z]).collect(),
        }
    });
    let mut trails: Vec<Trail> = drawn.collect();
    trails.sort_by_key(|trail| trail.role);
    set_beside(&mut trails);
    trails
}

/// Sets which lines stand beside leading ones: the flown, or else the measured, or else the estimated.
fn set_beside<P>(lines: &mut [Line<P>]) {
    let is_there = |role: &Role| lines.iter().any(|line| line.role == *role);
    let Some(leading) = [Role::Flown, Role::Measured, Role::Estimated].into_iter().find(is_there) else {
        return;
    };
    let led = |line: &&Line<P>| line.role == leading;
    let colours: Vec<&'static str> = lines.iter().filter(led).map(|line| line.colour).collect();
    for line in lines.iter_mut().filter(|line| line.role != leading) {
        line.is_darker = colours.contains(&line.colour);
        line.is_band = line.role == Role::Estimated;
    }
}

/// Roles whose lines share a row of the legend: several lines, which all have the colours of leading ones. Nine rows hide the three
/// that matter.
pub fn shared_roles<P>(lines: &[Line<P>]) -> Vec<Role> {
    let is_shared = |role: &Role| {
        let of_role = || lines.iter().filter(|line| line.role == *role);
        of_role().count() > 1 && of_role().all(|line| line.is_darker)
    };
    [Role::Estimated, Role::Measured, Role::Asked].into_iter().filter(is_shared).collect()
}

/// Number of the colour of an only vehicle's path.
fn role_colour(role: Role) -> usize {
    match role {
        Role::Flown => 0,
        Role::Estimated => 1,
        Role::Measured => 3,
        Role::Asked => 2,
    }
}

fn trail_name(vehicle: &str, role: Role) -> String {
    match (vehicle, role) {
        ("", Role::Flown) => "flown".to_owned(),
        (vehicle, role) => format!("{vehicle}{}", role.suffix()).trim_start().to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::{COLOURS, Curve, colour, colour_name, name, set_beside, shared_roles};
    use crate::plot::choice::Role;

    fn curve(topic: &str, field: &str, role: Role) -> Curve {
        let (topic, field) = (topic.to_owned(), field.to_owned());
        Curve {
            name: String::new(),
            topic,
            field,
            role,
            colour: "",
            is_darker: false,
            is_band: false,
            samples: 0,
            points: Vec::new(),
        }
    }

    #[test]
    fn an_altitude_that_was_asked_for_is_named_and_coloured_as_the_z_that_was_flown() {
        let mut curves = ["position.x", "position.y", "position.z"]
            .map(|f| curve("/plant/state", f, Role::Flown))
            .to_vec();
        curves.push(curve("/controller/status", "altitude_set_point", Role::Asked));
        name(&mut curves);
        colour(&mut curves);
        assert_eq!(curves[3].name, "z set point");
        assert_eq!(curves[3].colour, curves[2].colour);
        assert_ne!(curves[3].colour, curves[0].colour);
    }

    #[test]
    fn pages_have_the_colours_of_pictures() {
        for colour in COLOURS {
            let declared = format!("{}: {colour};", colour_name(colour));
            assert!(crate::page::COLOURS.contains(&declared), "{declared}");
        }
    }

    #[test]
    fn estimates_beside_measured_distances_are_bands_and_share_a_row() {
        let distances = |topic: &str, role| {
            (0..3).map(|beam| curve(topic, &format!("distance[{beam}]"), role)).collect::<Vec<_>>()
        };
        let mut curves = [distances("/walls", Role::Estimated), distances("/range", Role::Measured)].concat();
        colour(&mut curves);
        set_beside(&mut curves);
        let (estimated, measured) = curves.split_at(3);
        assert!(estimated.iter().all(|curve| curve.is_band && curve.is_darker));
        assert!(measured.iter().all(|curve| !curve.is_band && !curve.is_darker));
        assert_eq!(shared_roles(&curves), [Role::Estimated]);
        // Alone, an estimate is a line.
        let mut alone = distances("/walls", Role::Estimated);
        colour(&mut alone);
        set_beside(&mut alone);
        assert!(alone.iter().all(|curve| !curve.is_band) && shared_roles(&alone).is_empty());
    }
}
