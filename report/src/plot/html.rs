//! One HTML page that needs no network: time plots, and the paths in space with the scene.
//!
//! It is drawn by `page.js` with plotly.js ([`crate::page`]).

use crate::page::{PLOTLY_3D, Page};
use crate::plot::drawing::{Drawing, TIME_LABEL, View};
use crate::plot::figure::{Axes, Curve, Trail};
use crate::plot::scene::{EDGES, Solid};
use serde_json::{Value, json};

const PAGE: Page =
    Page { body: include_str!("page.html"), plotly: PLOTLY_3D, script: include_str!("page.js") };

/// The page.
pub fn page(drawing: &Drawing) -> Vec<u8> {
    PAGE.with(&data(drawing))
}

fn data(drawing: &Drawing) -> Value {
    let views = drawing.views_or(&[View::Time, View::Path, View::Top, View::Side]);
    let panels = drawing.panels.iter().filter(|_| views.contains(&View::Time)).map(|panel| {
        let axes: Vec<Value> = panel.axes.iter().map(axes).collect();
        json!({ "vehicle": panel.vehicle, "axes": axes })
    });
    json!({
        "title": drawing.title,
        "recording": drawing.recording,
        "span_s": drawing.span_s,
        "time_label": TIME_LABEL,
        "panels": panels.collect::<Vec<_>>(),
        "views": views,
        "trails": drawing.trails.iter().map(trail).collect::<Vec<_>>(),
        "solids": drawing.solids.iter().map(solid).collect::<Vec<_>>(),
        "edges": EDGES,
    })
}

fn axes(axes: &Axes) -> Value {
    let curves: Vec<Value> = axes.curves.iter().map(curve).collect();
    json!({ "title": axes.title, "label": axes.label, "unit": axes.unit, "curves": curves })
}

fn curve(curve: &Curve) -> Value {
    let (x, y): (Vec<_>, Vec<_>) =
        curve.points.iter().map(|(time_s, value)| (micros(*time_s), short(*value))).unzip();
    json!({ "name": curve.name, "topic": curve.topic, "field": curve.field, "role": curve.role,
            "colour": curve.colour, "x": x, "y": y })
}

fn trail(trail: &Trail) -> Value {
    let axis = |axis: usize| trail.points.iter().map(|point| short(point[axis])).collect::<Vec<_>>();
    json!({ "name": trail.name, "role": trail.role, "colour": trail.colour,
            "x": axis(0), "y": axis(1), "z": axis(2) })
}

fn solid(solid: &Solid) -> Value {
    json!({ "name": solid.name, "corners": solid.corners, "top": solid.outline(0, 1), "side": solid.outline(0, 2) })
}

/// A time in seconds to the microsecond, which keeps the page small.
fn micros(time_s: f64) -> Value {
    json!((time_s * 1e6).round() / 1e6)
}

/// A number as short as a float of 32 bits is written: finer than any plot. What is no number is a gap.
fn short(value: f64) -> Value {
    #[allow(clippy::cast_possible_truncation, reason = "that is the purpose")]
    let single = value as f32;
    // By way of its text, since a 64-bit float with the same value has many more digits.
    if single.is_finite() {
        json!(format!("{single:?}").parse::<f64>().unwrap_or(value))
    } else {
        Value::Null
    }
}
