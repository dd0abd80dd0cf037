//! The files of the page, part of this program: the page needs no network.

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Its name in the address.
    pub name: &'static str,
    /// Its media type.
    pub media: &'static str,
    /// Its content.
    pub content: &'static str,
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// Assets by their names.
macro_rules! assets {
    ($($name:literal: $media:expr,)*) => {
        /// The files beside the page.
        pub const ASSETS: &[Asset] = &[
            // The colours that all pages share.
            Asset { name: "colours.css", media: STYLE, content: report::page::COLOURS },
            $(Asset { name: $name, media: $media, content: include_str!(concat!("../assets/", $name)) },)*
        ];
    };
}

assets! {
    "main.js": SCRIPT,
    "api.js": SCRIPT,
    "playback.js": SCRIPT,
    "feed.js": SCRIPT,
    "newest.js": SCRIPT,
    "layouts.js": SCRIPT,
    "room.js": SCRIPT,
    "body.js": SCRIPT,
    "flat.js": SCRIPT,
    "wind.js": SCRIPT,
    "scopes.js": SCRIPT,
    "picker.js": SCRIPT,
    "controls.js": SCRIPT,
    "run.js": SCRIPT,
    "hand.js": SCRIPT,
    "schedule.js": SCRIPT,
    "palette.js": SCRIPT,
    "view.css": STYLE,
    "vendor/three.min.js": SCRIPT,
    "vendor/uplot.min.js": SCRIPT,
    "vendor/uplot.min.css": STYLE,
    "vendor/LICENSES.txt": "text/plain; charset=utf-8",
}

/// The page.
pub const PAGE: &str = include_str!("../assets/index.html");

/// The file with this name.
pub fn asset(name: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.name == name)
}
