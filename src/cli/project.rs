//! A project folder for a vehicle of one's own: templates, and the folder that is made from them.

use super::shell::quoted;
use anyhow::{Context, Result, anyhow, bail};
use clap::ValueEnum;
use runtime::output_file;
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the project in the templates.
const TEMPLATE_NAME: &str = "drone";
/// Folder of the Rust templates as their own test names it, and the same in a project, both relative to the Cargo package.
const FOLDERS: (&str, &str) = ("/src/cli/project/", "/../");
/// Lines of CMake for the library of an installed hummingbus, or else of its sources.
const BUILT_LIBRARY: &str = "\
# The library of hummingbus: the installed one, or else one that Cargo builds from its sources.
find_package(hummingbus QUIET)
if(NOT hummingbus_FOUND AND EXISTS [==[@path@]==])
  add_subdirectory([==[@path@]==] hummingbus)
elseif(NOT hummingbus_FOUND)
@missing@endif()
";
/// Lines of CMake for the library of an installed hummingbus.
const INSTALLED_LIBRARY: &str = "\
# The library of hummingbus, which its Debian package and its tarball install.
find_package(hummingbus @version@ QUIET)
if(NOT hummingbus_FOUND)
@missing@endif()
";
/// Lines of CMake that say where CMake looks for the library. CMake prints an indented line as it is.
const MISSING_LIBRARY: &str = r#"  message(FATAL_ERROR "CMake found no library of hummingbus @version@.
    The Debian package and the tarball of hummingbus hold it.
    If they are in a folder of their own, name the folder that has bin, include and lib:
      cmake -DCMAKE_PREFIX_PATH=FOLDER -S controller -B controller/build
    pkg-config takes PKG_CONFIG_PATH=FOLDER/lib/pkgconfig.")
"#;
/// Longest name of a project.
const NAME_BYTES_MAX: usize = 64;
/// Sources that this program was built from.
const BUILT_FROM: &str = env!("CARGO_MANIFEST_DIR");

/// Files of every project: path and template.
const FILES: [(&str, &str); 6] = [
    (".gitignore", include_str!("project/gitignore")),
    ("README.md", include_str!("project/README.md")),
    ("campaign.toml", include_str!("project/campaign.toml")),
    ("gains.toml", include_str!("project/gains.toml")),
    ("hover.toml", include_str!("project/hover.toml")),
    ("vehicle.toml", include_str!("project/vehicle.toml")),
];

/// Language of a project's controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// Rust, built with Cargo.
    Rust,
    /// C++17, built with CMake.
    Cpp,
    /// Python with numpy.
    Python,
}

/// Additions of a project's controller to the files of every project.
struct Templates {
    /// Name of the language for people.
    title: &'static str,
    /// Manifest that flies the controller.
    manifest: &'static str,
    /// Keys of the process that is the controller, for `swap`.
    program: &'static str,
    /// Section of README.md: how to build, fly and test it.
    section: &'static str,
    /// Files: path and template.
    files: &'static [(&'static str, &'static str)],
}

const RUST: Templates = Templates {
    title: "Rust",
    manifest: "hover-rust.toml",
    program: r#"command = ["controller/target/release/controller"]"#,
    section: include_str!("project/rust/section.md"),
    files: &[
        ("controller/Cargo.toml", include_str!("project/rust/Cargo.toml.in")),
        ("controller/src/hover_test.rs", include_str!("project/rust/src/hover_test.rs")),
        ("controller/src/main.rs", include_str!("project/rust/src/main.rs")),
        ("hover-rust.toml", include_str!("project/hover-rust.toml")),
    ],
};

const CPP: Templates = Templates {
    title: "C++",
    manifest: "hover-cpp.toml",
    program: r#"command = ["controller/build/controller"]"#,
    section: include_str!("project/cpp/section.md"),
    files: &[
        ("controller/CMakeLists.txt", include_str!("project/cpp/CMakeLists.txt")),
        ("controller/controller.cpp", include_str!("project/cpp/controller.cpp")),
        ("hover-cpp.toml", include_str!("project/hover-cpp.toml")),
    ],
};

const PYTHON: Templates = Templates {
    title: "Python",
    manifest: "hover-python.toml",
    program: "command = [\"controller/venv/bin/python\", \"controller.py\"]\nworking_directory = \"controller\"",
    section: include_str!("project/python/section.md"),
    files: &[
        ("controller/controller.py", include_str!("project/python/controller.py")),
        ("controller/test_hover.py", include_str!("project/python/test_hover.py")),
        ("hover-python.toml", include_str!("project/hover-python.toml")),
    ],
};

impl Language {
    fn templates(self) -> &'static Templates {
        match self {
            Self::Rust => &RUST,
            Self::Cpp => &CPP,
            Self::Python => &PYTHON,
        }
    }

    /// Name for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.templates().title
    }
}

/// Makes the project `folder` with a controller in `language`, where absent in Rust, or in Python if this program is a wheel's. The controller
/// builds against the `sources` of hummingbus; where absent, against the wheel, against the sources of this program if they are still there, or else
/// against its published version.
///
/// # Errors
/// If the name is not suitable, the folder exists, its parent does not, or it cannot be written. Nothing is left then.
pub fn make(folder: &Path, language: Option<Language>, sources: Option<&Path>) -> Result<Language> {
    let name = name_of(folder)?;
    let wheel = std::env::current_exe().ok().and_then(|program| environment_of_wheel(&program));
    let language = language.unwrap_or(if wheel.is_some() { Language::Python } else { Language::Rust });
    if folder.symlink_metadata().is_ok() {
        bail!("{} already exists; choose another name, or remove it first", folder.display());
    }
    let sources = match (sources, &wheel) {
        (Some(sources), _) => Some(required(sources)?),
        // Where it was built is nothing to who has installed it.
        (None, Some(_)) => None,
        (None, None) => built_from(),
    };
    let wheel = wheel.filter(|_| sources.is_none());
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !parent.is_dir() {
        bail!("cannot make a folder in {}: there is no such folder; make it first", parent.display());
    }
    // Without links, of which another user may have planted one.
    let parent = output_file::make_folder(parent)?;
    // Written beside its place, and renamed once it is whole. The draft is removed in any case. Its own name says nothing to
    // anybody.
    let draft = tempfile::tempdir_in(&parent)
        .map_err(|error| anyhow!("cannot make a folder in {}: {}", parent.display(), error.kind()))?;
    // A folder within: the temporary folder is closed to other users, the project has the rights of the umask.
    let whole = draft.path().join(name);
    let templates = language.templates();
    for (path, template) in FILES.iter().chain(templates.files) {
        let text = filled(template, name, templates, sources.as_deref(), wheel.as_deref());
        write(&whole.join(path), &text)?;
    }
    fs::rename(&whole, parent.join(name)).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(language)
}

/// The environment of Python that has the wheel of `program` installed: the folder above `lib/python3.X/site-packages/hummingbus/bin`. `None` of a
/// program outside of a wheel.
fn environment_of_wheel(program: &Path) -> Option<PathBuf> {
    let package = program.parent()?.parent()?;
    let is_wheel =
        package.ends_with("site-packages/hummingbus") || package.ends_with("dist-packages/hummingbus");
    package.ancestors().nth(4).filter(|_| is_wheel).map(Path::to_owned)
}

/// The command that makes `controller/venv`, an environment of Python that has the package.
fn environment(sources: Option<&Path>, wheel: Option<&Path>) -> String {
    match wheel {
        Some(found) if found.join("pyvenv.cfg").is_file() => {
            format!("ln -s {} controller/venv", quoted(found))
        }
        Some(_) => "python3 -m venv --system-site-packages controller/venv".to_owned(),
        None => {
            let package =
                sources.map_or_else(|| "hummingbus".to_owned(), |path| quoted(&path.join("python")));
            format!("python3 -m venv controller/venv && controller/venv/bin/pip install {package}")
        }
    }
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
fn built_from() -> Option<PathBuf> {
    Some(PathBuf::from(BUILT_FROM)).filter(|sources| is_source(sources))
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

/// A template with the project's name, its language, and what its controller builds against.
fn filled(
    template: &str,
    name: &str,
    language: &Templates,
    sources: Option<&Path>,
    wheel: Option<&Path>,
) -> String {
    let path = |folder: &str| {
        sources.map(|sources| sources.join(folder).to_string_lossy().trim_end_matches('/').to_owned())
    };
    let dependency = |folder: &str| match path(folder) {
        Some(path) => format!("path = {}", toml::Value::from(path)),
        None => format!("version = {:?}", env!("CARGO_PKG_VERSION")),
    };
    let library = if sources.is_some() { BUILT_LIBRARY } else { INSTALLED_LIBRARY };
    let library = library
        .replace("@missing@", MISSING_LIBRARY)
        .replace("@version@", env!("CARGO_PKG_VERSION"))
        .replace("@path@", &path("bindings/c").unwrap_or_default());
    // The paths last: one may have the project's name in it.
    template
        .replace("@section@\n", language.section)
        .replace("@manifest@", language.manifest)
        .replace("@program@", language.program)
        .replace("@language@", language.title)
        .replace(FOLDERS.0, FOLDERS.1)
        .replace(TEMPLATE_NAME, name)
        .replace("@bus@", &dependency("bus"))
        .replace("@hummingbus@", &dependency(""))
        .replace("@library@\n", &library)
        .replace("@environment@", &environment(sources, wheel))
}

fn write(path: &Path, text: &str) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, text))
        .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::{CPP, environment, environment_of_wheel, filled};
    use std::path::Path;

    #[test]
    fn a_project_of_a_wheel_flies_with_the_wheel() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("lib/python3.11/site-packages/hummingbus/bin/hummingbus");
        let wheel = environment_of_wheel(&program);
        assert_eq!(wheel.as_deref(), Some(folder.path()));
        assert_eq!(environment_of_wheel(Path::new("/usr/bin/hummingbus")), None);
        assert_eq!(environment_of_wheel(&folder.path().join("target/release/hummingbus")), None);
        let system = environment(None, wheel.as_deref());
        assert_eq!(system, "python3 -m venv --system-site-packages controller/venv");
        std::fs::write(folder.path().join("pyvenv.cfg"), "").unwrap();
        let linked = environment(None, wheel.as_deref());
        assert_eq!(linked, format!("ln -s {} controller/venv", folder.path().display()));
        assert!(environment(Some(Path::new("/sources")), None).ends_with("pip install /sources/python"));
    }

    #[test]
    fn a_project_whose_library_is_missing_says_how_to_name_it() {
        let file = |sources| filled(include_str!("project/cpp/CMakeLists.txt"), "quad", &CPP, sources, None);
        let (installed, built) = (file(None), file(Some(Path::new("/sources"))));
        for text in [&installed, &built] {
            assert!(text.contains("cmake -DCMAKE_PREFIX_PATH=FOLDER -S controller"), "{text}");
            assert!(!text.contains('@'), "{text}");
        }
        assert!(!installed.contains("add_subdirectory"), "{installed}");
        assert!(built.contains("\n  add_subdirectory([==[/sources/bindings/c]==] hummingbus)\n"), "{built}");
    }
}
