//! Pictures for documents: a sheet with time plots and views of the paths under each other, as SVG, and PNG of it.
//!
//! The letters of a PNG are those of `font/roboto-subset.ttf`, so that it looks the same on every machine: Roboto
//! Regular 2.138 (Google, Apache License 2.0), changed by leaving out all but Latin, Greek and Cyrillic letters and
//! signs, with `pyftsubset --layout-features=kern --no-hinting`.

use crate::plot::drawing::{Drawing, TIME_LABEL, View};
use crate::plot::figure::{Axes, Curve};
use crate::plot::ink::{
    Area, GRID, INK, LABEL_SIZE, LEGEND_ROW, Look, UNITS_PER_PIXEL, WIDTH, at, draw_legend, draw_line,
    letters, number, px,
};
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
const HEAD_SIZE: u32 = 15;
/// Something on the sheet, with its height in pixels.
enum Section<'a> {
    Axes(&'a Axes, bool),
    View(View),
}

impl Section<'_> {
    fn height(&self, drawing: &Drawing, legend: u32) -> u32 {
        match self {
            #[allow(clippy::cast_possible_truncation, reason = "a legend is short")]
            Self::Axes(axes, is_last) => {
                let rows = axes.curves.len() as u32 + 2;
                AXES_HEIGHT.max(rows * LEGEND_ROW) + if *is_last { TIME_AXIS_HEIGHT } else { 0 }
            }
            Self::View(view) => space::height(drawing, *view, WIDTH - legend),
        }
    }
}

/// What says in an SVG picture who wrote it: a comment.
pub const SVG_MARK: &str = "<!-- Written by hummingbus plot -->";
/// The same in a PNG picture: a chunk "tEXt" with its length and CRC-32 (PNG specification, 11.3.3.3) behind the
/// signature and the chunk "IHDR".
pub const PNG_MARK: &[u8; 31] = b"\0\0\0\x13tEXtSoftware\0hummingbus\x9d\xd2\xdf\x05";
const PNG_HEAD_BYTES: usize = 8 + 25;

/// The picture as SVG.
///
/// # Errors
/// If there is nothing to draw.
pub fn svg(drawing: &Drawing) -> Result<String> {
    let sections = sections(drawing)?;
    let legend = legend_width(drawing, &sections);
    let height = TITLE_HEIGHT + sections.iter().map(|section| section.height(drawing, legend)).sum::<u32>();
    let mut text = String::new();
    {
        let sheet = SVGBackend::with_string(&mut text, (px(WIDTH), px(height))).into_drawing_area();
        sheet.fill(&WHITE)?;
        let (title, mut rest) = sheet.split_vertically(px(TITLE_HEIGHT));
        title.draw_text(&heading(drawing, &sections), &letters(TITLE_SIZE), (at(16), at(14)))?;
        for section in &sections {
            let (area, below) = rest.split_vertically(px(section.height(drawing, legend)));
            rest = below;
            match section {
                Section::Axes(axes, is_last) => draw_axes(&area, axes, drawing, legend, *is_last)?,
                Section::View(view) => space::draw(&area, drawing, legend, *view)?,
            }
        }
        sheet.present()?;
    }
    // The units are for plotters only: whoever shows the picture is told its size in pixels.
    let units = format!(r#"width="{}" height="{}""#, px(WIDTH), px(height));
    let text = text.replacen(&units, &format!(r#"width="{WIDTH}" height="{height}""#), 1);
    // Behind the start of the root element.
    Ok(text.replacen('>', &format!(">\n{SVG_MARK}"), 1))
}

/// The title, with the vehicle where its axes are drawn.
fn heading(drawing: &Drawing, sections: &[Section<'_>]) -> String {
    let shows_axes = sections.iter().any(|section| matches!(section, Section::Axes(..)));
    match drawing.panels.first().filter(|panel| shows_axes && !panel.vehicle.is_empty()) {
        Some(panel) => format!("{}: {}", drawing.title, panel.vehicle),
        None => drawing.title.clone(),
    }
}

fn sections(drawing: &Drawing) -> Result<Vec<Section<'_>>> {
    let mut sections = Vec::new();
    for view in drawing.views_or(&[View::Time]) {
        if view == View::Time {
            let axes = drawing.panels.first().map_or(&[][..], |panel| &panel.axes);
            let is_last = |index: usize| index + 1 == axes.len();
            sections.extend(axes.iter().enumerate().map(|(index, axes)| Section::Axes(axes, is_last(index))));
        } else {
            sections.push(Section::View(view));
        }
    }
    if sections.is_empty() {
        bail!("there is nothing over time to draw: choose fields with --plot, or a view with --figure");
    }
    Ok(sections)
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

fn draw_axes(area: &Area<'_>, axes: &Axes, drawing: &Drawing, legend: u32, is_last: bool) -> Result<()> {
    let names = axes.curves.iter().map(|curve| curve.name.as_str());
    let plots = draw_legend(
        area,
        legend,
        names.zip(axes.curves.iter().map(|curve| Look::new(curve.colour, curve.role))),
    )?;
    let [from_s, to_s] = drawing.span_s;
    let values = axes.curves.iter().flat_map(|curve| &curve.points).map(|(_, value)| *value);
    let mut chart = ChartBuilder::on(&plots)
        .caption(&axes.title, letters(HEAD_SIZE))
        .margin_left(px(12))
        .margin_bottom(px(8))
        .set_label_area_size(LabelAreaPosition::Left, px(66))
        .set_label_area_size(LabelAreaPosition::Bottom, px(if is_last { TIME_AXIS_HEIGHT + 8 } else { 8 }))
        .build_cartesian_2d(from_s..to_s.max(from_s + 1e-3), range(values))?;
    let mut mesh = chart.configure_mesh();
    mesh.x_labels(13)
        .y_labels(6)
        .label_style(letters(LABEL_SIZE))
        .axis_style(INK.stroke_width(UNITS_PER_PIXEL));
    mesh.light_line_style(TRANSPARENT).bold_line_style(GRID.stroke_width(UNITS_PER_PIXEL));
    mesh.y_desc(format!("{} [{}]", axes.label, axes.unit)).axis_desc_style(letters(LABEL_SIZE));
    mesh.set_all_tick_mark_size(px(4)).x_label_formatter(&number).y_label_formatter(&number);
    if is_last {
        mesh.x_desc(TIME_LABEL);
    } else {
        mesh.x_labels(13).x_label_formatter(&|_| String::new());
    }
    mesh.draw()?;
    let mut curves: Vec<&Curve> = axes.curves.iter().collect();
    curves.sort_by_key(|curve| curve.role.layer());
    for curve in curves {
        let (look, points) = (Look::new(curve.colour, curve.role), thinned(&curve.points));
        for stretch in finite(&points) {
            draw_line(&mut chart, stretch.iter().copied(), look)?;
        }
    }
    Ok(())
}

/// The width of the legends, in pixels: one for all, so that the axes are as wide as each other.
fn legend_width(drawing: &Drawing, sections: &[Section<'_>]) -> u32 {
    let names = sections.iter().flat_map(|section| match section {
        Section::Axes(axes, _) => axes.curves.iter().map(|curve| &curve.name).collect::<Vec<_>>(),
        Section::View(_) => drawing.trails.iter().map(|trail| &trail.name).collect(),
    });
    #[allow(clippy::cast_possible_truncation, reason = "a name is short")]
    let longest = names.map(|name| name.chars().count() as u32).max().unwrap_or(0);
    (longest * LETTER_WIDTH + 52).clamp(130, WIDTH / 2)
}

/// As many points as a picture shows: a page has more, to zoom into.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut curve = thin::Curve::new(BINS);
    points.iter().for_each(|(time_s, value)| curve.push(*time_s, *value));
    curve.points()
}

/// The stretches of a curve without gaps.
fn finite(points: &[(f64, f64)]) -> impl Iterator<Item = &[(f64, f64)]> {
    points.split(|(_, value)| !value.is_finite()).filter(|stretch| !stretch.is_empty())
}

/// A range that holds all values, with some room.
pub fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let ends = values.filter(|value| value.is_finite()).fold(None, |ends: Option<(f64, f64)>, value| {
        Some(ends.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
    });
    let (low, high) = ends.unwrap_or((0.0, 0.0));
    // What hardly moves is drawn as a line, not as noise over the whole height.
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
