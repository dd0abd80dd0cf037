//! HTML pages that need no network: one template with a style and a script for all, and what each page has of its own.
//!
//! plotly.js is kept in `page/` as it is published (npm packages `plotly.js-basic-dist-min` and
//! `plotly.js-gl3d-dist-min` 4.1.1, MIT): the crate `plotly` embeds the whole library and two MathJax bundles, which
//! makes a page of 7.5 MB and brings fifty more packages.

use serde_json::Value;

/// What every page has near its start.
pub const MARK: &str = r#"<meta name="generator" content="hummingbus">"#;

/// plotly.js with lines, bars and pies.
pub(crate) const PLOTLY_BASIC: &str = include_str!("page/plotly-basic.min.js");
/// plotly.js with lines, and lines and bodies in space.
pub(crate) const PLOTLY_3D: &str = include_str!("page/plotly-gl3d.min.js");

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const KIT: &str = include_str!("page/kit.js");

/// A page that is not yet filled in.
pub(crate) struct Page {
    /// Headings, texts, and the places of tables and plots.
    pub body: &'static str,
    /// A bundle of plotly.js.
    pub plotly: &'static str,
    /// The script that draws the data, with what `kit.js` offers.
    pub script: &'static str,
}

impl Page {
    /// The page with `data`.
    pub fn with(&self, data: &Value) -> Vec<u8> {
        // No name in the data can end the element that holds it.
        let data = data.to_string().replace('<', "\\u003c");
        let parts = [
            ("{{style}}", STYLE),
            ("{{body}}", self.body),
            ("{{plotly}}", self.plotly),
            ("{{data}}", &data),
            ("{{kit}}", KIT),
            ("{{script}}", self.script),
        ];
        let (mut page, mut rest) = (String::new(), TEMPLATE);
        for (mark, text) in parts {
            let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
            page += before;
            page += text;
            rest = after;
        }
        page += rest;
        page.into_bytes()
    }
}
