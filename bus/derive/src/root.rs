//! Path of the crate of components, as the crate that derives can name it.

use proc_macro2::{Span, TokenStream as Tokens};
use std::path::Path;
use syn::{Error, Result};
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

/// Path of the crate of components in itself.
const ITSELF: &str = "::component";

/// Path of the crate of components in the crate that is compiled, by the dependencies in its `Cargo.toml`. Build systems that set
/// no `CARGO_MANIFEST_DIR` have to name the crate `component`.
///
/// # Errors
/// None of the dependencies gives the crate of components.
pub(crate) fn path() -> Result<Tokens> {
    let folder = std::env::var_os("CARGO_MANIFEST_DIR");
    let manifest = folder.as_ref().and_then(|folder| Some((folder, read(Path::new(folder))?)));
    let Some((folder, manifest)) = manifest else { return parsed(ITSELF) };
    let inherited = of_workspace(Path::new(folder), &manifest);
    let missing = || {
        let message = "the Cargo.toml of this crate names no package that has the components of hummingbus: add \
                       `hummingbus-component`, `hummingbus-bus` or `hummingbus` to its [dependencies]";
        Error::new(Span::call_site(), message)
    };
    parsed(&path_by(&manifest, &inherited).ok_or_else(missing)?)
}

fn parsed(path: &str) -> Result<Tokens> {
    path.parse::<Tokens>()
        .map_err(|error| Error::new(Span::call_site(), format_args!("the dependency `{path}`: {error}")))
}

/// The `Cargo.toml` in `folder`, if it can be read.
fn read(folder: &Path) -> Option<Table> {
    std::fs::read_to_string(folder.join("Cargo.toml")).ok()?.parse().ok()
}

/// The dependencies that the workspace of the package in `folder` gives to its members. The workspace is the nearest one above, or
/// the one that `manifest` names.
fn of_workspace(folder: &Path, manifest: &Table) -> Table {
    let stated = manifest.get("package").and_then(|package| package.get("workspace")?.as_str());
    let stated = stated.map(|stated| folder.join(stated));
    let workspace =
        stated.as_deref().unwrap_or(folder).ancestors().find_map(|folder| read(folder)?.remove("workspace"));
    let dependencies = workspace.as_ref().and_then(|workspace| workspace.get("dependencies")?.as_table());
    dependencies.cloned().unwrap_or_default()
}

/// Path of the crate of components for a crate with this `manifest`, in a workspace with the dependencies `inherited`. `None` if it
/// depends on none of the packages.
fn path_by(manifest: &Table, inherited: &Table) -> Option<String> {
    let name = manifest.get("package").and_then(|package| package.get("name")?.as_str());
    if name == Some(SOURCES[0].package) {
        return Some(ITSELF.to_owned());
    }
    ["dependencies", "dev-dependencies"].iter().find_map(|section| {
        SOURCES.iter().find_map(|source| {
            let mut all = dependencies(manifest, section);
            let name = all.find_map(|(key, value)| source.name(key, value, inherited))?;
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
    /// Name of the library in code, if the dependency `key` with this `value` is the package. `inherited` has the dependencies of the
    /// workspace.
    fn name(&self, key: &str, value: &Value, inherited: &Table) -> Option<String> {
        let is_inherited = value.get("workspace").is_some();
        let stated = if is_inherited { inherited.get(key)? } else { value };
        match stated.get("package").and_then(Value::as_str) {
            Some(package) => (package == self.package).then(|| key.replace('-', "_")),
            None => (key == self.package).then(|| self.library.to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{of_workspace, path_by, read};
    use std::path::Path;
    use toml::Table;

    /// Dependencies of a workspace. `flight` has a name of its own, and `pilot` is another project.
    const INHERITED: &str = "bus = { package = 'hummingbus-bus', path = 'bus' }\n\
                             component = { package = 'hummingbus-component', version = '0.1' }\n\
                             hummingbus-bus = '0.1'\nflight = { package = 'hummingbus' }\npilot = '1'\n";

    fn path(manifest: &str, inherited: &str) -> Option<String> {
        path_by(&manifest.parse().unwrap(), &inherited.parse().unwrap())
    }

    #[test]
    fn the_crate_of_components_is_found_over_every_package_that_has_it() {
        let cases = [
            ("[dependencies]\nhummingbus-component = '0.1'", "::component"),
            ("[dependencies]\nhummingbus-bus = { path = 'bus' }", "::bus::component"),
            ("[dependencies]\nhummingbus = '0.1'", "::hummingbus::component"),
            ("[dependencies]\nbus = { package = 'hummingbus-bus', version = '0.1' }", "::bus::component"),
            ("[dependencies]\nmy-bus = { package = 'hummingbus-bus' }", "::my_bus::component"),
            ("[dependencies]\nbus.workspace = true", "::bus::component"),
            ("[dependencies]\nhummingbus-bus.workspace = true", "::bus::component"),
            ("[dependencies]\nflight = { workspace = true, optional = true }", "::flight::component"),
            ("[dependencies]\ncomponent.workspace = true\nbus.workspace = true", "::component"),
            ("[dependencies]\ncomponent = '3.0'\nhummingbus = '0.1'", "::hummingbus::component"),
            ("[target.'cfg(unix)'.dependencies]\nhummingbus-bus = '0.1'", "::bus::component"),
            (
                "[dependencies]\nserde = '1'\n[dev-dependencies]\nhummingbus = '0.1'",
                "::hummingbus::component",
            ),
            ("[package]\nname = 'hummingbus-component'", "::component"),
        ];
        for (text, expected) in cases {
            assert_eq!(path(text, INHERITED).as_deref(), Some(expected), "{text}");
        }
    }

    #[test]
    fn a_package_of_another_project_is_not_taken_for_it() {
        for text in ["serde = '1'", "bus = '2'", "pilot.workspace = true", "missing.workspace = true"] {
            assert_eq!(path(&format!("[dependencies]\n{text}"), INHERITED), None, "{text}");
        }
        let own = "[dependencies]\nbus.workspace = true\nhummingbus = '0.1'";
        assert_eq!(path(own, "bus = '2'").as_deref(), Some("::hummingbus::component"));
    }

    #[test]
    fn the_workspace_is_the_nearest_above_or_the_one_that_the_manifest_names() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let nearest = of_workspace(folder, &read(folder).unwrap());
        assert_eq!(nearest["component"]["package"].as_str(), Some("hummingbus-component"));
        let named: Table = "[package]\nworkspace = '../..'".parse().unwrap();
        assert_eq!(of_workspace(folder, &named), nearest);
        assert!(of_workspace(Path::new("/"), &Table::new()).is_empty());
    }
}
