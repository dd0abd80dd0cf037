//! Path of the crate of components, as the crate that derives can name it.

use proc_macro2::TokenStream as Tokens;
use std::path::Path;
use toml::{Table, Value};

/// A package that gives the crate of components.
struct Source {
    package: &'static str,
    /// Name of its library.
    library: &'static str,
    /// Path of the crate of components in it.
    inner: &'static str,
}

/// The packages that give the crate of components, the most direct first.
const SOURCES: [Source; 3] = [
    Source { package: "hummingbus-component", library: "component", inner: "" },
    Source { package: "hummingbus-bus", library: "bus", inner: "::component" },
    Source { package: "hummingbus", library: "hummingbus", inner: "::component" },
];

/// Name of the crate of components in itself.
const ITSELF: &str = "::component";

/// Path of the crate of components in the crate that is compiled: over the package that its `Cargo.toml` depends on.
pub(crate) fn path() -> Tokens {
    let manifest = std::env::var_os("CARGO_MANIFEST_DIR")
        .and_then(|folder| std::fs::read_to_string(Path::new(&folder).join("Cargo.toml")).ok())
        .and_then(|text| text.parse::<Table>().ok());
    let path = manifest.and_then(|manifest| path_by(&manifest)).unwrap_or_else(|| ITSELF.to_owned());
    path.parse().unwrap_or_else(|error| unreachable!("a dependency has the name of a crate: {error}"))
}

/// The same for a crate with this `manifest`; `None` if it depends on none of the packages.
fn path_by(manifest: &Table) -> Option<String> {
    ["dependencies", "dev-dependencies"].iter().find_map(|section| {
        SOURCES.iter().find_map(|source| {
            let name = dependencies(manifest, section).find_map(|(key, value)| source.name(key, value))?;
            Some(format!("::{name}{}", source.inner))
        })
    })
}

/// The dependencies in `section`, for every target.
fn dependencies<'m>(manifest: &'m Table, section: &'m str) -> impl Iterator<Item = (&'m String, &'m Value)> {
    let targets = manifest.get("target").and_then(Value::as_table).into_iter().flat_map(Table::values);
    let of_targets = targets.filter_map(move |target| target.get(section));
    manifest.get(section).into_iter().chain(of_targets).filter_map(Value::as_table).flatten()
}

impl Source {
    /// Name of the library if the dependency `key` with this `value` is the package. A dependency that is inherited from a
    /// workspace does not state its package: the key of the library counts.
    fn name(&self, key: &str, value: &Value) -> Option<String> {
        let is_inherited = value.get("workspace").is_some();
        match value.get("package").and_then(Value::as_str) {
            Some(package) => (package == self.package).then(|| key.replace('-', "_")),
            None if key == self.package || is_inherited && key == self.library => {
                Some(self.library.to_owned())
            }
            None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::path_by;

    #[test]
    fn the_crate_of_components_is_found_over_every_package_that_has_it() {
        let path = |text: &str| path_by(&text.parse().unwrap());
        let cases = [
            ("[dependencies]\nhummingbus-component = '0.1'", "::component"),
            ("[dependencies]\nhummingbus-bus = { path = 'bus' }", "::bus::component"),
            ("[dependencies]\nhummingbus = '0.1'", "::hummingbus::component"),
            ("[dependencies]\nbus = { package = 'hummingbus-bus', version = '0.1' }", "::bus::component"),
            ("[dependencies]\nmy-bus = { package = 'hummingbus-bus' }", "::my_bus::component"),
            ("[dependencies]\nbus.workspace = true", "::bus::component"),
            ("[dependencies]\ncomponent.workspace = true\nbus.workspace = true", "::component"),
            ("[dependencies]\ncomponent = '3.0'\nhummingbus = '0.1'", "::hummingbus::component"),
            ("[target.'cfg(unix)'.dependencies]\nhummingbus-bus = '0.1'", "::bus::component"),
            (
                "[dependencies]\nserde = '1'\n[dev-dependencies]\nhummingbus = '0.1'",
                "::hummingbus::component",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(path(text).as_deref(), Some(expected), "{text}");
        }
        assert_eq!(path("[dependencies]\nserde = '1'"), None);
    }
}
