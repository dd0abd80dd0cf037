//! Pictures for documents: a sheet with time plots and views of the paths under each other, as SVG, and PNG of it.
//!
//! The letters of a PNG are those of `font/roboto-subset.ttf`, so that it looks the same on every machine: Roboto
//! Regular 2.138 (Google, Apache License 2.0), changed by leaving out all but Latin, Greek and Cyrillic letters and
//! signs, with `pyftsubset --layout-features=kern --no-hinting`.

use crate::plot::drawing::Drawing;
use crate::plot::figure::{Across, Axes, Panel, in_layers};
use crate::plot::ink::{
    Area, Flat, LEGEND_ROW, Look, WIDTH, at, draw_legend, draw_line, legend_rows, letters, px,
};
use crate::plot::request::{Format, View};
use crate::plot::{space, thin};
use anyhow::{Context, Result, bail};
use plotters::prelude::*;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use std::ops::Range;

const FONT: &[u8] = include_bytes!("font/roboto-subset.ttf");

/// Dots of a PNG for each pixel of the picture, for sharp letters.
const DOTS_PER_PIXEL: f32 = 1.5;
/// Bins of a curve: as many as its axes have pixels, or half of that.
const BINS: usize = 700;
const TITLE_HEIGHT: u32 = 40;
const AXES_HEIGHT: u32 = 190;
/// Room for the numbers and the name of the axis of time, below the last axes.
const TIME_AXIS_HEIGHT: u32 = 34;
const LETTER_WIDTH: u32 = 7;
const TITLE_SIZE: u32 = 18;
/// Comment of an SVG picture that names its writer.
pub const SVG_MARK: &str = "<!-- Written by hummingbus plot -->";
/// Mark of a PNG picture: a chunk "tEXt" with its length and CRC-32 (PNG specification, 11.3.3.3) behind the
/// signature and the chunk "IHDR".
pub const PNG_MARK: &[u8; 31] = b"\0\0\0\x13tEXtSoftware\0hummingbus\x9d\xd2\xdf\x05";
const PNG_HEAD_BYTES: usize = 8 + 25;

/// The picture as SVG.
///
/// # Errors
/// If there is nothing to draw.
pub fn svg(drawing: &Drawing) -> Result<String> {
    let views = drawing.views_or(Format::Svg.usual_views());
    // Of several vehicles only the first has room.
    let panel = drawing.panels.first().filter(|_| views.contains(&View::Time));
    let axes = panel.map_or(&[][..], |panel| &panel.axes);
    if axes.is_empty() && views.iter().all(|view| *view == View::Time) {
        bail!("there is nothing over time to draw: choose fields with --plot, or a view with --figure");
    }
    let legend = legend_width(drawing, axes, &views);
    let heights = views.iter().map(|view| match view {
        View::Time => {
            axes.iter().map(axes_height).sum::<u32>() + TIME_AXIS_HEIGHT * u32::from(!axes.is_empty())
        }
        view => space::height(drawing, *view, WIDTH - legend),
    });
    let height = TITLE_HEIGHT + heights.sum::<u32>();
    let mut text = String::new();
    {
        let sheet = SVGBackend::with_string(&mut text, (px(WIDTH), px(height))).into_drawing_area();
        sheet.fill(&WHITE)?;
        let (title, mut rest) = sheet.split_vertically(px(TITLE_HEIGHT));
        title.draw_text(&heading(drawing, panel), &letters(TITLE_SIZE), (at(16), at(14)))?;
        let mut next = |height: u32| {
            let (area, below) = rest.split_vertically(px(height));
            rest = below;
            area
        };
        for view in views {
            if view != View::Time {
                space::draw(&next(space::height(drawing, view, WIDTH - legend)), drawing, legend, view)?;
                continue;
            }
            for (index, shown) in axes.iter().enumerate() {
                let room = if index + 1 == axes.len() { TIME_AXIS_HEIGHT } else { 0 };
                draw_axes(&next(axes_height(shown) + room), shown, &drawing.across, legend, room)?;
            }
        }
        sheet.present()?;
    }
    // The units are for plotters only: a viewer of the picture gets its size in pixels.
    let units = format!(r#"width="{}" height="{}""#, px(WIDTH), px(height));
    let text = text.replacen(&units, &format!(r#"width="{WIDTH}" height="{height}""#), 1);
    // Behind the start of the root element.
    Ok(text.replacen('>', &format!(">\n{SVG_MARK}"), 1))
}

/// The title, with the vehicle where its axes are drawn.
fn heading(drawing: &Drawing, panel: Option<&Panel>) -> String {
    match panel.filter(|panel| !panel.vehicle.is_empty()) {
        Some(panel) => format!("{}: {}", drawing.title, panel.vehicle),
        None => drawing.title.clone(),
    }
}

/// The height of axes over time without the numbers below the last ones, in pixels.
#[allow(clippy::cast_possible_truncation, reason = "a legend is short")]
fn axes_height(axes: &Axes) -> u32 {
    AXES_HEIGHT.max((legend_rows(&axes.curves).len() as u32 + 2) * LEGEND_ROW)
}

/// The picture as PNG.
///
/// # Errors
/// If it is too large.
pub fn png(svg: &str) -> Result<Vec<u8>> {
    let mut options = Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family("Roboto");
    let tree = Tree::from_str(svg, &options)?;
    let size = tree.size().to_int_size().scale_by(DOTS_PER_PIXEL).context("the picture is too large")?;
    let mut dots = Pixmap::new(size.width(), size.height()).context("the picture is too large")?;
    resvg::render(&tree, Transform::from_scale(DOTS_PER_PIXEL, DOTS_PER_PIXEL), &mut dots.as_mut());
    let mut bytes = dots.encode_png()?;
    bytes.splice(PNG_HEAD_BYTES..PNG_HEAD_BYTES, *PNG_MARK);
    Ok(bytes)
}

/// Draws axes, with numbers below where there is `room` for them.
fn draw_axes(area: &Area<'_>, axes: &Axes, across: &Across, legend: u32, room: u32) -> Result<()> {
    let area = draw_legend(area, legend, &axes.curves)?.margin(0, px(8), 0, 0);
    let [from, to] = across.range;
    let values = axes.curves.iter().flat_map(|curve| &curve.points).map(|(_, value)| *value);
    let name = if room > 0 { across.label.clone() } else { String::new() };
    let flat = Flat {
        title: &axes.title,
        names: [name, format!("{} [{}]", axes.label, axes.unit)],
        ranges: [from..to.max(from + least(from)), range(values)],
        labels: [13, 6],
        margins: [78, 0, room + 8],
    };
    let mut chart = flat.draw(&area)?;
    for curve in in_layers(&axes.curves) {
        // The stretches between gaps.
        let points = if across.is_time { thinned(&curve.points) } else { curve.points.clone() };
        for stretch in points.split(|(_, value)| !value.is_finite()) {
            draw_line(&mut chart, stretch.iter().copied(), Look::of(curve))?;
        }
    }
    Ok(())
}

/// The width of the legends, in pixels: one for all, so that the axes are as wide as each other.
fn legend_width(drawing: &Drawing, axes: &[Axes], views: &[View]) -> u32 {
    let curves = axes.iter().flat_map(|axes| legend_rows(&axes.curves));
    let has_paths = views.iter().any(|view| *view != View::Time);
    let paths = has_paths.then(|| legend_rows(&drawing.trails)).into_iter().flatten();
    #[allow(clippy::cast_possible_truncation, reason = "a name is short")]
    let longest = curves.chain(paths).map(|(_, name)| name.chars().count() as u32).max().unwrap_or(0);
    (longest * LETTER_WIDTH + 52).clamp(130, WIDTH / 2)
}

/// The points, reduced to the number that a picture shows: a page has more, to zoom into.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut curve = thin::Curve::new(BINS);
    points.iter().for_each(|(time_s, value)| curve.push(*time_s, *value));
    curve.points()
}

/// The least that an axis across spans: of one point there is nothing to see, but an axis must have a length.
fn least(from: f64) -> f64 {
    from.abs().max(1e-3) * 1e-6
}

/// A range that holds all values, with some room.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let ends = values.filter(|value| value.is_finite()).map(|value| (value, value));
    let (low, high) = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 0.0));
    // A value that hardly changes is drawn as a line, not as noise over the whole height.
    let room = ((high - low) * 0.06).max(low.abs().max(high.abs()).max(1.0) * 0.005);
    low - room..high + room
}

#[cfg(test)]
mod tests {
    use super::PNG_MARK;

    #[test]
    fn the_chunk_that_says_who_wrote_a_picture_is_whole() {
        let (length, rest) = PNG_MARK.split_first_chunk::<4>().unwrap();
        let (content, sum) = rest.split_last_chunk::<4>().unwrap();
        assert_eq!(u32::from_be_bytes(*length) as usize, content.len() - 4);
        let bit = |sum: u32| if sum & 1 == 1 { 0xEDB8_8320 ^ (sum >> 1) } else { sum >> 1 };
        let byte = |sum: u32, byte: &u8| (0..8).fold(sum ^ u32::from(*byte), |sum, _| bit(sum));
        assert_eq!(u32::from_be_bytes(*sum), !content.iter().fold(u32::MAX, byte));
    }
}
