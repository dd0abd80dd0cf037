//! The library and the programs of the tests, built once with CMake, as users build them.

use crate::support::{HUMMINGBUS, repository};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The programs that the tests fly, and the library as `cmake --install` has put it.
pub struct Built {
    /// Programs of `tests/bindings/cpp`.
    pub programs: PathBuf,
    /// Prefix of the installed library.
    pub prefix: PathBuf,
}

impl Built {
    /// The program `name`.
    pub fn program(&self, name: &str) -> String {
        self.programs.join(name).to_string_lossy().into_owned()
    }
}

/// The library installed to a prefix, the example and the programs of the tests built against it.
pub fn built() -> &'static Built {
    static BUILT: OnceLock<Built> = OnceLock::new();
    BUILT.get_or_init(|| {
        let target = Path::new(HUMMINGBUS).parent().unwrap();
        let folder = target.join("bindings");
        let (library, prefix) = (folder.join("library"), folder.join("prefix"));
        // The library that the build of all crates has made, or one that CMake has Cargo make.
        let is_made = ["so", "a"].iter().all(|end| target.join(format!("libhummingbus_c.{end}")).exists());
        let mut configure = cmake(&["-S", &repository("bindings/c"), "-B"], &library);
        configure.arg("-DHUMMINGBUS_PROFILE=dev");
        let built = if is_made { target.to_string_lossy().into_owned() } else { String::new() };
        configure.arg(format!("-DHUMMINGBUS_BUILT={built}"));
        succeed(configure);
        succeed(cmake(&["--build"], &library));
        let mut install = cmake(&["--install"], &library);
        install.arg("--prefix").arg(&prefix);
        succeed(install);
        let programs = folder.join("programs");
        for (source, place) in [("examples/cpp", "example"), ("tests/bindings/cpp", "tests")] {
            let mut configure = cmake(&["-S", &repository(source), "-B"], &folder.join(place));
            configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display()));
            configure.arg(format!("-DCMAKE_RUNTIME_OUTPUT_DIRECTORY={}", programs.display()));
            succeed(configure);
            succeed(cmake(&["--build"], &folder.join(place)));
        }
        Built { programs, prefix }
    })
}

fn cmake(arguments: &[&str], folder: &Path) -> Command {
    if arguments[0] == "-S" {
        // A folder that was copied or moved would be refused.
        let _ = std::fs::remove_file(folder.join("CMakeCache.txt"));
    }
    let mut command = Command::new("cmake");
    command.args(arguments).arg(folder);
    command
}

/// Runs `command`, which has to succeed.
#[track_caller]
pub fn succeed(mut command: Command) -> String {
    let ended =
        command.output().unwrap_or_else(|error| panic!("{command:?}: {error}; scripts/test installs it"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(ended.status.success(), "{command:?}\n{}{}", text(&ended.stdout), text(&ended.stderr));
    text(&ended.stdout)
}
