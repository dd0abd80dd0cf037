//! One HTML page that needs no network: time plots, and the paths in space with the scene.
//!
//! It is drawn by `page.js` with plotly.js ([`crate::page`]).

use crate::page::PLOTLY_3D;
use crate::plot::choice::Role;
use crate::plot::drawing::Drawing;
use crate::plot::figure::{Axes, Curve, Line, Trail, colour_name, shared_roles};
use crate::plot::outline::Outline;
use crate::plot::request::{Format, View};
use crate::plot::scene::Solid;
use serde::Serialize;
use serde_json::{Value, json};

/// The page.
pub fn page(drawing: &Drawing) -> Vec<u8> {
    crate::page::page(include_str!("page.html"), &PLOTLY_3D, include_str!("page.js"), &data(drawing))
}

/// Data for the page's script: the drawing with its points.
fn data(drawing: &Drawing) -> Value {
    let views = drawing.views_or(Format::Html.usual_views());
    let panels = drawing.panels.iter().filter(|_| views.contains(&View::Time));
    json!({
        "title": drawing.title,
        "recording": drawing.recording,
        "span_s": drawing.span_s,
        "across": drawing.across,
        "panels": panels.map(|panel| with(panel, [("axes", panel.axes.iter().map(axes).collect())])).collect::<Vec<_>>(),
        "views": views,
        "trails": drawing.trails.iter().map(trail).collect::<Vec<_>>(),
        "airframes": drawing.airframes.iter().map(airframe).collect::<Vec<_>>(),
        "shared": shared(&drawing.trails),
        "solids": drawing.solids.iter().map(solid).collect::<Vec<_>>(),
    })
}

/// The JSON of `thing` with these entries.
fn with<const N: usize>(thing: &impl Serialize, entries: [(&str, Value); N]) -> Value {
    let mut value = json!(thing);
    entries.into_iter().for_each(|(key, entry)| value[key] = entry);
    value
}

fn axes(axes: &Axes) -> Value {
    with(axes, [("curves", axes.curves.iter().map(curve).collect()), ("shared", shared(&axes.curves))])
}

/// The roles that have one row in the legend, with its text.
fn shared<P>(lines: &[Line<P>]) -> Value {
    let row = |role: Role| json!({ "role": role, "name": role.suffix().trim_start() });
    shared_roles(lines).into_iter().map(row).collect()
}

fn curve(curve: &Curve) -> Value {
    // Times to the microsecond keep the page small.
    let x = curve.points.iter().map(|(time_s, _)| json!((time_s * 1e6).round() / 1e6));
    let y = curve.points.iter().map(|point| short(point.1));
    with(curve, [("x", x.collect()), ("y", y.collect()), ("colour", colour_name(curve.colour).into())])
}

fn trail(trail: &Trail) -> Value {
    let axis = |axis: usize| trail.points.iter().map(|point| short(point[axis])).collect();
    let colour = colour_name(trail.colour).into();
    with(trail, [("x", axis(0)), ("y", axis(1)), ("z", axis(2)), ("colour", colour)])
}

/// The lines of an airframe, one after another with a gap between two.
fn airframe(airframe: &Outline) -> Value {
    let axis = |axis: usize| {
        let along = |line: &Vec<[f64; 3]>| -> Vec<Value> {
            line.iter().map(|point| short(point[axis])).chain([Value::Null]).collect()
        };
        airframe.lines.iter().flat_map(along).collect()
    };
    let colour = colour_name(airframe.colour).into();
    with(airframe, [("x", axis(0)), ("y", axis(1)), ("z", axis(2)), ("colour", colour)])
}

fn solid(solid: &Solid) -> Value {
    with(solid, [("top", json!(solid.outlines(0, 1))), ("side", json!(solid.outlines(0, 2)))])
}

/// A number as short as a float of 32 bits is written: finer than any plot. A value that is not finite is a gap.
fn short(value: f64) -> Value {
    #[allow(clippy::cast_possible_truncation, reason = "that is the purpose")]
    let single = value as f32;
    // By way of its text, since a 64-bit float with the same value has many more digits.
    single.to_string().parse::<f64>().map_or(Value::Null, Value::from)
}
