//! Views of the paths in space, with the scene: from above, from the side, and in three dimensions.

use crate::plot::drawing::Drawing;
use crate::plot::figure::in_layers;
use crate::plot::ink::{
    Area, Flat, GRID, HEAD_SIZE, LABEL_SIZE, Look, at, draw_legend, draw_line, letters, number, px, rgb,
};
use crate::plot::request::View;
use anyhow::Result;
use plotters::coord::CoordTranslate;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// Room beside the axes of a flat view, in pixels: left, right, above, below.
const MARGINS: [u32; 4] = [80, 12, 34, 50];
/// Room in pixels between the name of the axis across and the title of the next view.
const GAP: u32 = 18;
const FLAT_HEIGHT: Range<u32> = 260..760;
const PATH_HEIGHT: u32 = 640;
/// Direction of view of the paths in three dimensions, in rad: from the right of -y, and from above.
const YAW: f64 = 0.6;
const PITCH: f64 = 0.45;
const SOLID: RGBColor = RGBColor(120, 120, 120);
/// The shortest edge of the view, in metres: a hover in one place has an extent of millimetres.
const EXTENT_MIN_M: f64 = 1.0;

/// The ends along the three axes of the view, the ground included.
fn extent(drawing: &Drawing) -> [Range<f64>; 3] {
    let points = drawing.trails.iter().flat_map(|trail| &trail.points);
    let corners = drawing.solids.iter().flat_map(|solid| &solid.corners);
    let airframes = drawing.airframes.iter().flat_map(|airframe| airframe.lines.iter().flatten());
    let all =
        points.chain(corners).chain(airframes).filter(|point| point.iter().all(|value| value.is_finite()));
    let mut ends = [f64::INFINITY..f64::NEG_INFINITY, f64::INFINITY..f64::NEG_INFINITY, 0.0..0.0];
    for point in all {
        for (ends, value) in ends.iter_mut().zip(point) {
            *ends = ends.start.min(*value)..ends.end.max(*value);
        }
    }
    ends.map(with_room)
}

fn with_room(ends: Range<f64>) -> Range<f64> {
    if ends.start > ends.end {
        return -0.5 * EXTENT_MIN_M..0.5 * EXTENT_MIN_M;
    }
    let missing = (EXTENT_MIN_M - length(&ends)).max(0.0);
    let room = 0.04 * length(&ends) + missing / 2.0;
    widened(&ends, 2.0 * room)
}

/// A range that is longer by `more`; nothing is below the ground.
fn widened(ends: &Range<f64>, more: f64) -> Range<f64> {
    if ends.start == 0.0 { 0.0..ends.end + more } else { ends.start - more / 2.0..ends.end + more / 2.0 }
}

fn length(ends: &Range<f64>) -> f64 {
    ends.end - ends.start
}

/// The axes that a flat view shows across and up.
fn flat_axes(view: View) -> [usize; 2] {
    if view == View::Side { [0, 2] } else { [0, 1] }
}

/// The height of a view `width` pixels wide: so much that both axes of a flat one have one scale.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a height of some hundred pixels")]
pub fn height(drawing: &Drawing, view: View, width: u32) -> u32 {
    if view == View::Path {
        return PATH_HEIGHT + GAP;
    }
    let extent = extent(drawing);
    let [across, up] = flat_axes(view).map(|axis| length(&extent[axis]));
    let [left, right, above, below] = MARGINS;
    let height = f64::from(width - left - right) * up / across + f64::from(above + below);
    (height as u32).clamp(FLAT_HEIGHT.start, FLAT_HEIGHT.end) + GAP
}

/// Draws a view of the paths.
///
/// # Errors
/// If plotters cannot.
pub fn draw(area: &Area<'_>, drawing: &Drawing, legend: u32, view: View) -> Result<()> {
    let plots = draw_legend(area, legend, &drawing.trails)?.margin(0, px(GAP), 0, 0);
    if view == View::Path { draw_path(&plots, drawing) } else { draw_flat(&plots, drawing, view) }
}

fn draw_flat(plots: &Area<'_>, drawing: &Drawing, view: View) -> Result<()> {
    let axes = flat_axes(view);
    let extent = extent(drawing);
    let (width, height) = plots.dim_in_pixel();
    let [left, right, above, below] = MARGINS;
    let room = [width - px(left + right), height - px(above + below)];
    let flat = Flat {
        title: if view == View::Side { "Path from the side" } else { "Path from above" },
        names: axes.map(|axis| format!("{} [m]", AXES[axis])),
        ranges: equal(axes.map(|axis| extent[axis].clone()), room),
        labels: room.map(labels),
        margins: [left, right, below],
    };
    let mut chart = flat.draw(plots)?;
    for solid in &drawing.solids {
        for outline in solid.outlines(axes[0], axes[1]) {
            // An edge has no inside.
            if outline.len() > 2 {
                chart.draw_series([Polygon::new(outline.clone(), SOLID.mix(0.3))])?;
            }
            chart.draw_series([PathElement::new(outline, SOLID.stroke_width(px(1)))])?;
        }
    }
    draw_trails(&mut chart, drawing, |point| (point[axes[0]], point[axes[1]]))
}

/// Draws the vehicles, the paths and their starts, those on top last: an estimate must not hide the flown path.
fn draw_trails<'a, T: CoordTranslate>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, T>,
    drawing: &Drawing,
    place: impl Fn([f64; 3]) -> T::From + Copy,
) -> Result<()>
where
    T::From: Clone + 'static,
{
    for airframe in &drawing.airframes {
        let style = rgb(airframe.colour).mix(0.7).stroke_width(px(1));
        let line = |line: &Vec<[f64; 3]>| {
            PathElement::new(line.iter().map(|point| place(*point)).collect::<Vec<_>>(), style)
        };
        chart.draw_series(airframe.lines.iter().map(line))?;
    }
    for trail in in_layers(&drawing.trails) {
        let look = Look::of(trail);
        let finite = trail.points.iter().filter(|point| point.iter().all(|value| value.is_finite()));
        let places = finite.map(|point| place(*point));
        draw_line(chart, places.clone(), look)?;
        chart.draw_series(places.take(1).map(|start| Circle::new(start, px(4), look.style().filled())))?;
    }
    Ok(())
}

/// Number of labels along an axis of this length: the same number per metre on either axis.
fn labels(units: u32) -> usize {
    (units / px(70)) as usize
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Widens one of two ranges, so that a metre is as long on both axes.
fn equal([across, up]: [Range<f64>; 2], [width, height]: [u32; 2]) -> [Range<f64>; 2] {
    let (width, height) = (f64::from(width), f64::from(height));
    let metre = (width / length(&across)).min(height / length(&up));
    [(across, width), (up, height)].map(|(ends, size)| widened(&ends, size / metre - length(&ends)))
}

/// A point of the world as plotters takes it: its y axis points up, and its z axis to the viewer.
fn turned([x, y, z]: [f64; 3]) -> (f64, f64, f64) {
    (x, z, -y)
}

fn draw_path(plots: &Area<'_>, drawing: &Drawing) -> Result<()> {
    let [x, y, z] = extent(drawing);
    let lengths = [length(&x), length(&z), length(&y)];
    let size = cube(lengths, plots.dim_in_pixel());
    let mut chart = ChartBuilder::on(plots)
        .caption("Path", letters(HEAD_SIZE))
        .margin(px(8))
        .build_cartesian_3d(x.clone(), z.clone(), -y.end..-y.start)?;
    chart.set_3d_pixel_range(size).with_projection(|mut view| {
        (view.yaw, view.pitch) = (YAW, PITCH);
        view.into_matrix()
    });
    let mut axes = chart.configure_axes();
    axes.label_style(letters(LABEL_SIZE)).tick_size(px(4)).max_light_lines(1);
    axes.light_grid_style(TRANSPARENT)
        .bold_grid_style(GRID.stroke_width(px(1)))
        .axis_panel_style(TRANSPARENT);
    axes.x_formatter(&number).y_formatter(&number).z_formatter(&|value| number(&-value)).draw()?;
    let middle = |ends: &Range<f64>| (ends.start + ends.end) / 2.0;
    let names = [
        ("x [m]", [middle(&x), y.start, 0.0], (-30, 40)),
        ("y [m]", [x.end, middle(&y), 0.0], (40, 36)),
        ("z [m]", [x.start, y.start, middle(&z)], (-60, 0)),
    ];
    for (name, place, (right, down)) in names {
        let style = letters(LABEL_SIZE).pos(Pos::new(HPos::Center, VPos::Center));
        let text = Text::new(name, (right * at(1), down * at(1)), style);
        chart.draw_series([EmptyElement::at(turned(place)) + text])?;
    }
    for solid in &drawing.solids {
        for edge in &solid.edges {
            let edge = edge.map(turned);
            chart.draw_series([PathElement::new(edge.to_vec(), SOLID.mix(0.7).stroke_width(px(1)))])?;
        }
    }
    draw_trails(&mut chart, drawing, turned)
}

/// The edges, in units, of a box with edges of these lengths that fills an area when it is looked at.
#[allow(clippy::cast_possible_truncation, reason = "a picture is far smaller than 2^31 units")]
fn cube([x, up, depth]: [f64; 3], (width, height): (u32, u32)) -> (i32, i32, i32) {
    let across = x * libm::cos(YAW) + depth * libm::sin(YAW);
    let upward = up * libm::cos(PITCH) + (x * libm::sin(YAW) + depth * libm::cos(YAW)) * libm::sin(PITCH);
    let room = (f64::from(width) - f64::from(px(150)), f64::from(height) - f64::from(px(130)));
    let metre = (room.0 / across).min(room.1 / upward);
    ((x * metre) as i32, (up * metre) as i32, (depth * metre) as i32)
}
