//! Lines, letters, flat axes and legends of pictures, in plotters' units.

use crate::plot::choice::Role;
use crate::plot::figure::{Line, shared_roles};
use anyhow::Result;
use plotters::coord::types::RangedCoordf64;
use plotters::coord::{CoordTranslate, Shift};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// A part of a picture that is drawn on.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Plotters places everything on whole units: finer ones than the picture's make its lines smooth.
pub const UNITS_PER_PIXEL: u32 = 8;
/// Width of a picture in pixels.
pub const WIDTH: u32 = 1000;
/// Height of a row of a legend in pixels.
pub const LEGEND_ROW: u32 = 18;
/// Bold enough beside the curves' names, and thin enough beside each other.
const FLOWN_WIDTH: u32 = 14;
const THIN_WIDTH: u32 = 7;
/// Seen on both sides of a flown line.
const BAND_WIDTH: u32 = 44;
const BAND_OPACITY: f64 = 0.5;
/// Size of the letters of titles, but for the sheet's.
pub const HEAD_SIZE: u32 = 15;
/// Size of all other letters.
pub const LABEL_SIZE: u32 = 13;
/// Colour of lines that only guide the eye.
pub const GRID: RGBColor = RGBColor(225, 225, 225);
/// Colour of letters and axes.
pub const INK: RGBColor = RGBColor(40, 40, 40);

/// Units for `pixels`.
pub const fn px(pixels: u32) -> u32 {
    pixels * UNITS_PER_PIXEL
}

/// Units for `pixels`, as a coordinate.
#[allow(clippy::cast_possible_wrap, reason = "a picture is far smaller than 2^31 units")]
pub const fn at(pixels: u32) -> i32 {
    px(pixels) as i32
}

/// Letters of `size` pixels.
pub fn letters<'a>(size: u32) -> TextStyle<'a> {
    ("sans-serif", px(size)).into_font().color(&INK)
}

/// Look of a line.
#[derive(Clone, Copy)]
pub struct Look {
    colour: RGBAColor,
    width: u32,
    /// True if it is dashed.
    pub is_dashed: bool,
}

impl Look {
    /// Look of `line`: bands are wide and pale. Other lines than the flown one are thin, and darker where they share a leading line's
    /// colour.
    pub fn of<P>(line: &Line<P>) -> Self {
        let RGBColor(red, green, blue) = rgb(line.colour);
        let is_darker = line.is_darker && !line.is_band;
        let colour =
            if is_darker { RGBColor(red / 2, green / 2, blue / 2) } else { RGBColor(red, green, blue) };
        Self::inked(line, colour)
    }

    /// Look of `line` in another colour.
    fn inked<P>(line: &Line<P>, colour: RGBColor) -> Self {
        let is_dashed = line.role == Role::Asked;
        if line.is_band {
            return Self { colour: colour.mix(BAND_OPACITY), width: BAND_WIDTH, is_dashed };
        }
        let width = if line.role == Role::Flown { FLOWN_WIDTH } else { THIN_WIDTH };
        Self { colour: colour.to_rgba(), width, is_dashed }
    }

    /// The style of the line for plotters.
    pub fn style(self) -> ShapeStyle {
        self.colour.stroke_width(self.width)
    }
}

/// A colour that is written as HTML writes it.
pub fn rgb(colour: &str) -> RGBColor {
    let part = |index: usize| colour.get(index..index + 2).and_then(|hex| u8::from_str_radix(hex, 16).ok());
    RGBColor(part(1).unwrap_or(0), part(3).unwrap_or(0), part(5).unwrap_or(0))
}

/// Draws a line on flat axes or in space.
///
/// # Errors
/// If plotters cannot.
pub fn draw_line<T: CoordTranslate>(
    chart: &mut ChartContext<'_, SVGBackend<'_>, T>,
    points: impl Iterator<Item = T::From> + Clone,
    look: Look,
) -> Result<()>
where
    T::From: Clone + 'static,
{
    if look.is_dashed {
        chart.draw_series(DashedLineSeries::new(points, px(6), px(4), look.style()))?;
    } else {
        chart.draw_series(LineSeries::new(points, look.style()))?;
    }
    Ok(())
}

/// Draws a legend, `width` pixels wide, at the right side of an area; returns the rest of the area. Beside the curves
/// it hides none.
pub fn draw_legend<'a, P>(area: &Area<'a>, width: u32, lines: &[Line<P>]) -> Result<Area<'a>> {
    let (plots, legend) = area.split_horizontally(px(WIDTH - width));
    let anchor = Pos::new(HPos::Left, VPos::Center);
    for (row, (look, name)) in (0..).zip(legend_rows(lines)) {
        let y = at(36 + row * LEGEND_ROW);
        let dashes: &[(u32, u32)] =
            if look.is_dashed { &[(10, 18), (22, 30), (34, 36)] } else { &[(10, 36)] };
        for (from, to) in dashes {
            legend.draw(&PathElement::new([(at(*from), y), (at(*to), y)], look.style()))?;
        }
        legend.draw(&Text::new(name, (at(44), y), letters(LABEL_SIZE).pos(anchor)))?;
    }
    Ok(plots)
}

/// Rows of a legend: those of lines, then one for each role whose lines share a row.
pub fn legend_rows<P>(lines: &[Line<P>]) -> Vec<(Look, String)> {
    let shared = shared_roles(lines);
    let alone = lines.iter().filter(|line| !shared.contains(&line.role));
    let mut rows: Vec<_> = alone.map(|line| (Look::of(line), line.name.clone())).collect();
    let first_of = |role: Role| lines.iter().find(move |line| line.role == role);
    let firsts = shared.into_iter().filter_map(first_of);
    rows.extend(firsts.map(|line| (Look::inked(line, INK), line.role.suffix().trim_start().to_owned())));
    rows
}

/// Look of flat axes.
pub struct Flat<'a> {
    /// Title.
    pub title: &'a str,
    /// Labels of the axes across and up; the first is drawn only where it has room.
    pub names: [String; 2],
    /// Ends of the axes.
    pub ranges: [Range<f64>; 2],
    /// Numbers of labels along them.
    pub labels: [usize; 2],
    /// Room beside them in pixels: left, right, below.
    pub margins: [u32; 3],
}

/// A chart with flat axes.
pub type FlatChart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

impl Flat<'_> {
    /// Draws the axes.
    ///
    /// # Errors
    /// If plotters cannot.
    pub fn draw<'a>(self, area: &Area<'a>) -> Result<FlatChart<'a>> {
        let Self { title, names: [across, up], ranges: [x, y], labels, margins: [left, right, below] } = self;
        let mut chart = ChartBuilder::on(area)
            .caption(title, letters(HEAD_SIZE))
            .margin_left(px(12))
            .margin_right(px(right))
            .set_label_area_size(LabelAreaPosition::Left, px(left - 12))
            .set_label_area_size(LabelAreaPosition::Bottom, px(below))
            .build_cartesian_2d(x, y)?;
        let mut mesh = chart.configure_mesh();
        mesh.label_style(letters(LABEL_SIZE)).axis_desc_style(letters(LABEL_SIZE));
        mesh.axis_style(INK.stroke_width(UNITS_PER_PIXEL)).light_line_style(TRANSPARENT);
        mesh.bold_line_style(GRID.stroke_width(UNITS_PER_PIXEL)).set_all_tick_mark_size(px(4));
        mesh.x_labels(labels[0]).y_labels(labels[1]).y_desc(up).y_label_formatter(&number);
        if across.is_empty() {
            mesh.x_label_formatter(&|_| String::new());
        } else {
            mesh.x_desc(across).x_label_formatter(&number);
        }
        mesh.draw()?;
        Ok(chart)
    }
}

/// A number at an axis: without the digits that steps of 0.1 add to it.
pub fn number(value: &f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    // No minus before a zero.
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}
