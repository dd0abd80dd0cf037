//! A project folder for a vehicle of one's own: templates, and the folder that is made from them.

use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the project in the templates.
const TEMPLATE_NAME: &str = "drone";
/// Folder of the templates as their own test names it, and the same in a project, both relative to the Cargo package.
const FOLDERS: (&str, &str) = ("/src/cli/project/", "/../");
/// Longest name of a project.
const NAME_BYTES_MAX: usize = 64;
/// Sources that this program was built from.
const BUILT_FROM: &str = env!("CARGO_MANIFEST_DIR");

/// Files of a project: path and template.
const FILES: [(&str, &str); 10] = [
    (".gitignore", include_str!("project/gitignore")),
    ("README.md", include_str!("project/README.md")),
    ("campaign.toml", include_str!("project/campaign.toml")),
    ("controller/Cargo.toml", include_str!("project/controller/Cargo.toml.in")),
    ("controller/src/hover_test.rs", include_str!("project/controller/src/hover_test.rs")),
    ("controller/src/main.rs", include_str!("project/controller/src/main.rs")),
    ("gains.toml", include_str!("project/gains.toml")),
    ("hover-rust.toml", include_str!("project/hover-rust.toml")),
    ("hover.toml", include_str!("project/hover.toml")),
    ("vehicle.toml", include_str!("project/vehicle.toml")),
];

/// Makes the project `folder`, whose controller builds against the `sources` of hummingbus; where absent, against the sources
/// of this program if they are still there, or else against its published version.
///
/// # Errors
/// If the name is not suitable, the folder exists, its parent does not, or it cannot be written. Nothing is left then.
pub fn make(folder: &Path, sources: Option<&Path>) -> Result<()> {
    let name = name_of(folder)?;
    if folder.symlink_metadata().is_ok() {
        bail!("{} already exists; choose another name, or remove it first", folder.display());
    }
    let sources = sources.map_or_else(built_from, |sources| required(sources).map(Some))?;
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Written beside its place, and renamed once it is whole. The draft is removed in any case.
    let draft = tempfile::tempdir_in(parent)
        .with_context(|| format!("cannot make a folder in {}", parent.display()))?;
    // A folder within: the temporary folder is closed to other users, the project has the rights of the umask.
    let whole = draft.path().join(name);
    for (path, template) in FILES {
        write(&whole.join(path), &filled(template, name, sources.as_deref()))?;
    }
    fs::rename(&whole, folder).with_context(|| format!("cannot make {}", folder.display()))
}

/// The last component of `folder`, which names a Cargo package too.
fn name_of(folder: &Path) -> Result<&str> {
    let name = folder.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let is_name = name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_allowed);
    if !is_name || name.len() > NAME_BYTES_MAX {
        bail!(
            "{:?} is not a project name: it must start with a letter from a to z, followed by letters, digits, `-` or `_`, \
             at most {NAME_BYTES_MAX}",
            folder.display().to_string()
        );
    }
    Ok(name)
}

/// The sources that this program was built from, if they are still there in the same version.
fn built_from() -> Result<Option<PathBuf>> {
    let sources = PathBuf::from(BUILT_FROM);
    Ok(Some(sources).filter(|sources| is_source(sources)))
}

fn is_source(folder: &Path) -> bool {
    let text = fs::read_to_string(folder.join("Cargo.toml")).unwrap_or_default();
    let manifest: toml::Table = text.parse().unwrap_or_default();
    let name = manifest.get("package").and_then(|package| package.get("name"));
    name.and_then(toml::Value::as_str) == Some(env!("CARGO_PKG_NAME"))
}

/// The absolute path of `sources`, which must be a checkout.
fn required(sources: &Path) -> Result<PathBuf> {
    if !is_source(sources) {
        bail!(
            "{} is not a checkout of hummingbus: its Cargo.toml is missing or is another package's",
            sources.display()
        );
    }
    sources.canonicalize().with_context(|| format!("cannot read {}", sources.display()))
}

/// A template with the project's name, and the dependencies of its controller.
fn filled(template: &str, name: &str, sources: Option<&Path>) -> String {
    let dependency = |crate_folder: &str| match sources {
        Some(sources) => {
            let path = sources.join(crate_folder);
            format!("path = {}", toml::Value::from(path.to_string_lossy().trim_end_matches('/')))
        }
        None => format!("version = {:?}", env!("CARGO_PKG_VERSION")),
    };
    // The name last of all but the paths: a path may have the template's name in it.
    template
        .replace(FOLDERS.0, FOLDERS.1)
        .replace(TEMPLATE_NAME, name)
        .replace("@bus@", &dependency("bus"))
        .replace("@hummingbus@", &dependency(""))
}

fn write(path: &Path, text: &str) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, text))
        .with_context(|| format!("cannot write {}", path.display()))
}
