//! HTML pages that need no network: a template, its data as JSON, and the scripts that draw them.
//!
//! plotly.js is kept in `page/` as it is published (npm packages `plotly.js-basic-dist-min` and
//! `plotly.js-gl3d-dist-min` 4.1.1, MIT): the crate `plotly` embeds the whole library and two MathJax bundles, which
//! makes a page of 7.5 MB and brings fifty more packages.

use crate::output_file::{Kind, Mark};
use std::io::{self, Write};

/// A page; every template has the mark.
pub const KIND: Kind =
    Kind { name: "page", mark: Mark::Within(br#"<meta name="generator" content="hummingbus">"#) };

/// plotly.js with lines, bars and pies.
pub const PLOTLY_BASIC: &str = include_str!("page/plotly-basic.min.js");
/// plotly.js with lines, and lines and bodies in space.
pub const PLOTLY_3D: &str = include_str!("page/plotly-gl3d.min.js");

/// A page that is not yet filled in: its marks `{{plotly}}`, `{{data}}` and `{{script}}` follow in this order.
pub struct Page {
    /// The page with the three marks.
    pub template: &'static str,
    /// A bundle of plotly.js.
    pub plotly: &'static str,
    /// The script that draws the data.
    pub script: &'static str,
}

impl Page {
    /// Writes the page with `data`, which is JSON.
    pub fn write(&self, data: &str, out: &mut impl Write) -> io::Result<()> {
        let mut rest = self.template;
        for (mark, text) in
            [("{{plotly}}", self.plotly), ("{{data}}", &escaped(data)), ("{{script}}", self.script)]
        {
            let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
            out.write_all(before.as_bytes())?;
            out.write_all(text.as_bytes())?;
            rest = after;
        }
        out.write_all(rest.as_bytes())
    }
}

/// JSON as a script element takes it: no name can end the element.
fn escaped(json: &str) -> String {
    json.replace('<', "\\u003c")
}
