//! Gains files: TOML as vehicle files are, every number with its unit and source, positions in the errors.
//!
//! `gains!` declares the gains of a law: the fields, and their places in the file. The file that a law is tuned with
//! is built in, and serves where the manifest names none. A file is read to its end despite its faults, so that
//! all of them are reported at once.

use diagnostics::ParameterError;
use diagnostics::parameter::Bounds;
use diagnostics::unit::{ANGLE, Dimension, SPEED};
use diagnostics::{Diagnostic, Faults};
use inputs::{FileKind, FileRole, InputFiles};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_3, PI};
use std::path::Path;
use std::rc::Rc;
use vehicles::reader::{Document, Quantity, Section};

/// Gains files, for parameters that name one.
pub(crate) const FILE: FileKind = FileKind::of(FileRole::Settings);

/// Declares gains as `name: type = reading` for each field, where `reading` is of the [`Table`] that the head names; after
/// `built in "FILE"` those of the file in `controllers/gains` are the default.
macro_rules! gains {
    (
        $(#[$meta:meta])*
        pub struct $name:ident of $table:ident, built in $file:literal { $($fields:tt)* }
    ) => {
        gains! {
            $(#[$meta])*
            pub struct $name of $table { $($fields)* }
        }

        impl $name {
            /// The text of the file that is built in.
            pub(crate) const BUILT_IN: &str = include_str!(concat!("../gains/", $file));

            /// The gains in the file at `path` among `files`, or those built in.
            ///
            /// # Errors
            /// The file cannot be read, or holds invalid gains; all its faults.
            pub fn load(
                files: &inputs::InputFiles,
                path: Option<&std::path::Path>,
            ) -> Result<Self, diagnostics::ParameterError> {
                let load = |path| $crate::gains_file::load(files, path, Self::read);
                path.map_or_else(|| Ok(Self::default()), load)
            }
        }

        impl Default for $name {
            fn default() -> Self {
                $crate::gains_file::parse(Self::BUILT_IN, concat!("controllers/gains/", $file), Self::read)
                    .expect("a test reads the built-in gains")
            }
        }
    };
    (
        $(#[$meta:meta])*
        pub struct $name:ident of $table:ident {
            $($(#[$field_meta:meta])* $field:ident: $type:ty = $reading:expr,)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $type,)*
        }

        impl $name {
            pub(crate) fn read($table: &$crate::gains_file::Table<'_, '_>) -> Self {
                Self { $($field: $reading,)* }
            }
        }
    };
}

/// Function that makes gains of a file's root table.
pub(crate) type Reader<G> = fn(&Table<'_, '_>) -> G;

/// The gains in the file at `path` among `files`, the manifest's parameter `gains`.
///
/// # Errors
/// The file cannot be read, or holds invalid gains; all its faults.
pub(crate) fn load<G>(files: &InputFiles, path: &Path, read: Reader<G>) -> Result<G, ParameterError> {
    let file = path.display().to_string();
    let text = files.text(path);
    let unreadable = |cause| Diagnostic::unreadable(&file, &cause);
    let gains = text.map_err(unreadable).and_then(|text| parse(&text, &file, read));
    gains.map_err(|error| error.named_by("gains"))
}

/// The gains in `text`; `file_name` is for messages only.
///
/// # Errors
/// Each key of the text that is missing, unknown or no gain.
pub(crate) fn parse<G>(text: &str, file_name: &str, read: Reader<G>) -> Result<G, Diagnostic> {
    let doc = Document::new(file_name, text);
    let tree = doc.tree()?;
    let root = Rc::new(Section::new(&doc, String::new(), 0..0, tree.get_ref()));
    let tables = RefCell::new(BTreeMap::from([(String::new(), Some(root.clone()))]));
    let opened = Rc::new(Opened { tables, faults: RefCell::default() });
    let gains = read(&Table { section: Some(root), opened: opened.clone() });
    let mut faults = opened.faults.take();
    for table in opened.tables.take().into_values().flatten() {
        faults.keep(table.finish());
    }
    faults.finish(Some(gains))
}

/// The tables of a file that were asked for, and the faults so far.
struct Opened<'d, 't> {
    tables: RefCell<BTreeMap<String, Option<Rc<Section<'d, 't>>>>>,
    faults: RefCell<Faults>,
}

impl Opened<'_, '_> {
    fn keep<T>(&self, read: Result<T, Diagnostic>) -> Option<T> {
        self.faults.borrow_mut().keep(read)
    }
}

/// A table of a gains file. A number that is missing or no gain is noted, and read as no number.
#[derive(Clone)]
pub(crate) struct Table<'d, 't> {
    /// `None` where the file has no such table, which is noted.
    section: Option<Rc<Section<'d, 't>>>,
    opened: Rc<Opened<'d, 't>>,
}

/// Greatest gain, in its unit. A loop that is closed once a tick T holds an angle with less than 4/T², and a
/// rate with less than 2/T. The shortest tick is 1 µs. With every motor, gains are far from both limits.
pub(crate) const GAIN: Bounds = Bounds {
    min: 0.0,
    max: 1e9,
    unit: "",
    why: "a negative gain turns a loop against itself, and no run has ticks short enough for a larger one",
};

/// A limit, a weight's deviation or a time, in its unit: none that is of use to a vehicle is so small or so large.
const LIMIT: Bounds = Bounds {
    min: 1e-12,
    max: 1e12,
    unit: "",
    why: "a limit, a deviation or a time is above 0: less than 1e-12 of any unit lets nothing through, and from 1e12 \
          on squares and products of it are no figures of a vehicle",
};

impl Table<'_, '_> {
    /// True if it has `name`.
    pub(crate) fn has(&self, name: &'static str) -> bool {
        self.section.as_ref().is_some_and(|section| section.has(name))
    }

    /// The table at the dotted `path` within this one.
    pub(crate) fn table(&self, path: &'static str) -> Self {
        path.split('.').fold(self.clone(), |table, name| table.child(name))
    }

    fn child(&self, name: &'static str) -> Self {
        let Some(section) = &self.section else { return self.clone() };
        let open = || self.opened.keep(section.section(name)).map(Rc::new);
        let section = self.opened.tables.borrow_mut().entry(section.key(name)).or_insert_with(open).clone();
        Self { section, opened: self.opened.clone() }
    }

    /// The number at the dotted `key` that `check` passes.
    fn number(
        &self,
        key: &'static str,
        of: Dimension,
        check: impl for<'q, 't> FnOnce(Quantity<'q, 't>) -> Result<Quantity<'q, 't>, Diagnostic>,
    ) -> f64 {
        let (table, name) = match key.rsplit_once('.') {
            Some((path, name)) => (self.table(path), name),
            None => (self.clone(), key),
        };
        let Some(section) = table.section else { return f64::NAN };
        let read = section.chosen(name, of).and_then(check);
        self.opened.keep(read).map_or(f64::NAN, |number| number.si)
    }

    /// A gain: zero or more, since a negative one turns a loop against itself.
    pub(crate) fn gain(&self, key: &'static str, of: Dimension) -> f64 {
        self.number(key, of, |number| number.not_negative()?.within(&GAIN))
    }

    /// A limit or a time: more than zero.
    pub(crate) fn limit(&self, key: &'static str, of: Dimension) -> f64 {
        self.number(key, of, |number| number.positive()?.within(&LIMIT))
    }

    /// A limit that is more than zero and less than `bound`, which `expected` describes.
    fn limit_below(&self, key: &'static str, of: Dimension, bound: f64, expected: &str) -> f64 {
        self.limit_that(key, of, |number| number < bound, expected)
    }

    /// A limit that is more than zero and that `fits`, as `expected` describes.
    fn limit_that(
        &self,
        key: &'static str,
        of: Dimension,
        fits: impl Fn(f64) -> bool,
        expected: &str,
    ) -> f64 {
        self.number(key, of, |number| {
            let number = number.positive()?.within(&LIMIT)?;
            let holds = fits(number.si);
            number.require(holds, expected)
        })
    }

    /// A bandwidth that steps of 1 ms resolve.
    pub(crate) fn bandwidth(&self, key: &'static str) -> f64 {
        let expected = "a bandwidth above 0 and below 200 rad/s, up to which steps of 1 ms resolve it";
        self.limit_below(key, SPEED, BANDWIDTH_MAX_RAD_S, expected)
    }

    /// A tilt that the altitude loop can make up for.
    pub(crate) fn tilt(&self, key: &'static str) -> f64 {
        let expected = "an angle above 0 and below 60 degrees, up to which the thrust makes up for a tilt";
        self.limit_below(key, ANGLE, FRAC_PI_3, expected)
    }

    /// The same, or half a turn: then the vehicle may turn over.
    pub(crate) fn tilt_or_turn(&self, key: &'static str) -> f64 {
        let expected = "an angle above 0 and below 60 degrees, up to which the thrust makes up for a tilt, or 180 degrees";
        let is_turn = |angle_rad: f64| (angle_rad - PI).abs() < 1e-9;
        self.limit_that(key, ANGLE, |angle_rad| angle_rad < FRAC_PI_3 || is_turn(angle_rad), expected)
    }
}

/// Bandwidths stay below this, rad/s. Tuned, no source: a fifth of 1 kHz, at which an observer or a lag that is stepped
/// once a tick still behaves as the continuous one; from some 1000 rad/s on it diverges.
const BANDWIDTH_MAX_RAD_S: f64 = 200.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cascade_gains::CascadeGains;

    #[test]
    fn all_faults_of_a_file_are_told_at_once() {
        let text = CascadeGains::BUILT_IN.replace("[command_filter]", "[filter]");
        let text = text.replace("damping_ratio", "damping").replace("rate_feed_forward", "feed_forward");
        let error = parse(&text, "my.toml", CascadeGains::read).unwrap_err();
        let (count, error) = (error.all().count(), error.to_string());
        let told =
            ["missing key `command_filter`", "unknown key `filter`", "unknown key `attitude.feed_forward`"];
        assert!(told.iter().all(|fault| error.contains(fault)), "{error}");
        assert!(error.ends_with("did you mean `rate_feed_forward`?"), "a misspelt key is one fault: {error}");
        assert_eq!(count, 3, "one for each: {error}");
    }
}
