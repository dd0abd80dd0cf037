//! HTML pages that need no network: one template with a style and a script for all, and the content of each page.
//!
//! plotly.js is kept in `page/` as published (npm packages `plotly.js-basic-dist-min` and `plotly.js-gl3d-dist-min`
//! 4.1.1, MIT). The crate `plotly` embeds the whole library and two MathJax bundles, which makes a page of 7.5 MB and
//! brings fifty more packages.

use diagnostics::printable_json;
use flate2::read::ZlibDecoder;
use serde_json::Value;
use std::io::Read;

/// Mark near the start of every page.
pub const MARK: &str = r#"<meta name="generator" content="hummingbus">"#;

/// plotly.js with lines, bars and pies.
pub static PLOTLY_BASIC: Bundle = Bundle(include_bytes!(concat!(env!("OUT_DIR"), "/plotly-basic.min.zlib")));
/// plotly.js with lines, and lines and bodies in space.
#[cfg(feature = "plots")]
pub(crate) static PLOTLY_3D: Bundle =
    Bundle(include_bytes!(concat!(env!("OUT_DIR"), "/plotly-gl3d.min.zlib")));

/// Style sheet with the colours of every page, in light and in dark.
pub const COLOURS: &str = include_str!("page/colours.css");

/// A script that the program holds compressed.
#[derive(Debug, Clone, Copy)]
pub struct Bundle(&'static [u8]);

impl Bundle {
    /// The text of the script.
    ///
    /// # Panics
    /// Never: the build compressed this text.
    #[must_use]
    pub fn script(&self) -> String {
        let mut script = String::new();
        let read = ZlibDecoder::new(self.0).read_to_string(&mut script);
        read.expect("the build compressed this text");
        script
    }
}

/// The page with this `body` of headings, texts and the places of tables and plots. `script` draws `data` on it with
/// a bundle of plotly.js and the functions of `kit.js`.
#[must_use]
pub fn page(body: &str, plotly: &Bundle, script: &str, data: &Value) -> Vec<u8> {
    format!(
        include_str!("page/page.html"),
        colours = COLOURS,
        style = include_str!("page/page.css"),
        body = body,
        plotly = plotly.script(),
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
    use std::fs::{read_dir, read_to_string};
    use std::path::{Path, PathBuf};

    #[test]
    fn the_bundles_are_scripts() {
        assert!(PLOTLY_BASIC.script().starts_with("/**\n* plotly.js"), "{:.40}", PLOTLY_BASIC.script());
        #[cfg(feature = "plots")]
        assert!(PLOTLY_3D.script().starts_with("/**\n* plotly.js"), "{:.40}", PLOTLY_3D.script());
    }

    #[test]
    fn every_page_has_the_colours_of_both_schemes() {
        let page = String::from_utf8(page("", &PLOTLY_BASIC, "", &Value::Null)).unwrap();
        assert!(
            page.contains(COLOURS) && page.contains(r#"<meta name="color-scheme" content="light dark">"#)
        );
        // Every name in the styles is declared.
        let used = [include_str!("page/page.css"), include_str!("page/kit.js")].concat();
        let names = used.split("var(--").skip(1).filter_map(|rest| rest.split_once(')'));
        for name in names.map(|(name, _)| name) {
            assert_eq!(COLOURS.matches(&format!(" --{name}: ")).count(), 2, "{name}");
        }
    }

    /// Styles, scripts and templates of pages in `folder` and below, without what others wrote.
    fn sources(folder: &Path) -> Vec<PathBuf> {
        let paths = read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let found = paths.flat_map(|path| {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let is_page = [".css", ".html", ".js"].iter().any(|end| name.ends_with(end));
            match path.is_dir() {
                true if name != "vendor" => sources(&path),
                false if is_page && !name.contains(".min.") => vec![path],
                _ => vec![],
            }
        });
        found.collect()
    }

    /// The text behind the start of the first colour that `text` states by its numbers.
    fn colour(text: &str) -> Option<&str> {
        let is_hexadecimal = |rest: &&str| {
            let digits = rest.chars().take_while(char::is_ascii_hexdigit).count();
            // `#add(` is a function of a script.
            let ends =
                rest[digits..].chars().next().is_none_or(|next| !next.is_alphanumeric() && next != '(');
            matches!(digits, 3 | 4 | 6 | 8) && ends
        };
        let functions = ["rgb(", "rgba(", "hsl(", "hsla("].into_iter();
        let mut arguments = functions.flat_map(|function| text.split(function).skip(1));
        let stated = arguments.find(|rest| rest.starts_with(|first: char| first.is_ascii_digit()));
        text.split('#').skip(1).find(is_hexadecimal).or(stated)
    }

    #[test]
    fn colours_are_stated_in_one_file() {
        for stated in
            ["a { color: #fff; }", "\"#787878\"", "rgb(0 0 0 / 0.4)", "x: \"rgba(120,120,120,0.3)\""]
        {
            assert!(colour(stated).is_some(), "{stated}");
        }
        for named in ["var(--ink)", "this.#add(x)", "`rgba(${parts},1)`", "#plots"] {
            assert_eq!(colour(named), None);
        }
        let crates = Path::new(env!("CARGO_MANIFEST_DIR"));
        let all =
            ["src", "view/assets", "../campaign/src"].map(|folder| sources(&crates.join(folder))).concat();
        assert!(all.len() > 20, "{all:?}");
        for path in all {
            let text = read_to_string(&path).unwrap();
            let found = colour(&text).map(|found| found.lines().next());
            assert_eq!(found.is_some(), path.ends_with("page/colours.css"), "{}: {found:?}", path.display());
        }
    }

    #[test]
    fn names_in_the_data_neither_end_their_element_nor_turn_the_text() {
        let page = page("", &PLOTLY_BASIC, "", &serde_json::json!({ "name": "</script>\u{202e}x" }));
        let page = String::from_utf8(page).unwrap();
        assert!(page.contains("\\u003c/script>\\u202ex") && !page.contains('\u{202e}'));
    }
}
