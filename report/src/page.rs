//! HTML pages that need no network: one template with a style and a script for all, and the content of each page.
//!
//! plotly.js is kept in `page/` as published (npm packages `plotly.js-basic-dist-min` and `plotly.js-gl3d-dist-min`
//! 4.1.1, MIT). The crate `plotly` embeds the whole library and two MathJax bundles, which makes a page of 7.5 MB and
//! brings fifty more packages.

use diagnostics::printable_json;
use serde_json::Value;

/// Mark near the start of every page.
pub const MARK: &str = r#"<meta name="generator" content="hummingbus">"#;

/// plotly.js with lines, bars and pies.
pub const PLOTLY_BASIC: &str = include_str!("page/plotly-basic.min.js");
/// plotly.js with lines, and lines and bodies in space.
#[cfg(feature = "plots")]
pub(crate) const PLOTLY_3D: &str = include_str!("page/plotly-gl3d.min.js");

/// The page with this `body` of headings, texts and the places of tables and plots. `script` draws `data` on it with
/// a bundle of plotly.js and the functions of `kit.js`.
#[must_use]
pub fn page(body: &str, plotly: &str, script: &str, data: &Value) -> Vec<u8> {
    format!(
        include_str!("page/page.html"),
        style = include_str!("page/page.css"),
        body = body,
        plotly = plotly,
        // No name in the data can turn or hide text, or end the element that holds it.
        data = printable_json(&data.to_string()).replace('<', "\\u003c"),
        kit = include_str!("page/kit.js"),
        script = script,
    )
    .into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_the_data_neither_end_their_element_nor_turn_the_text() {
        let page = page("", "", "", &serde_json::json!({ "name": "</script>\u{202e}x" }));
        let page = String::from_utf8(page).unwrap();
        assert!(page.contains("\\u003c/script>\\u202ex") && !page.contains('\u{202e}'));
    }
}
