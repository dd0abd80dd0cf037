//! A build of PX4, and the folder in which it runs: its program, its start-up scripts, and the parameters.

use crate::process::Scratch;
use crate::settings;
use bus::context::NodeContext;
use diagnostics::ParameterError;
use diagnostics::parameter::refuse;
use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Scripts of the start-up, beside the folder of the program.
const SCRIPTS: [&str; 2] = ["etc/init.d", "etc/init.d-posix"];
const AIRFRAMES: &str = "etc/init.d-posix/airframes";
const START_UP: &str = "etc/init.d-posix/rcS";
/// Names of the start-up's commands, in the folder of the program.
const ALIASES: &str = "px4-alias.sh";
/// Start of PX4's links to ground stations. The script is replaced by an empty one, since a link takes ports and time.
const LINKS: &str = "px4-rc.mavlink";
/// The library in the folder above that in which PX4 runs: a path with a blank or a colon could not be preloaded.
const LIBRARY: &str = "lockstep.so";
/// Its path from the folder in which PX4 runs.
pub const PRELOADED: &str = "../lockstep.so";

/// The files of a build that a start needs, as they are attached to the recording.
#[derive(Debug)]
pub struct Build {
    program: Vec<u8>,
    aliases: String,
    /// Scripts by their paths from the folder of the build.
    scripts: Vec<(PathBuf, Vec<u8>)>,
    /// The airframe among the scripts.
    airframe: PathBuf,
}

/// Paths of the folder.
#[derive(Debug)]
pub struct Folder {
    /// The program.
    pub program: PathBuf,
    /// The folder in which it runs.
    pub root: PathBuf,
}

impl Build {
    /// Reads the build of the program at `firmware`, with the airframe `model`.
    ///
    /// # Errors
    /// Files are missing.
    pub fn read(context: &NodeContext<'_>, firmware: &Path, model: &str) -> Result<Self, ParameterError> {
        let program = settings::preloadable(context, firmware, "PX4's SITL, build/px4_sitl_default/bin/px4");
        let refused = |reason: String| ParameterError::conflict("firmware", reason);
        let unread = |path: &Path, error: io::Error| {
            let path = path.display();
            refused(format!(
                "cannot read {path}: {error}: PX4 needs the folder `etc` of its build beside that of its program, bin/px4"
            ))
        };
        let source = match fs::canonicalize(firmware) {
            Ok(source) => source,
            // A missing program is told once.
            Err(error) => return Err(program.err().unwrap_or_else(|| unread(firmware, error))),
        };
        let bin = source.parent().unwrap_or(&source);
        let folder = bin.parent().unwrap_or(bin);
        if let Err(outside) = require_build(firmware, bin, folder) {
            return Err(program.err().unwrap_or(outside));
        }
        let mut names = Vec::new();
        for scripts in SCRIPTS {
            let used = file_names(&folder.join(scripts)).filter(|name| is_script(scripts, name));
            names.extend(used.map(|name| Path::new(scripts).join(name)));
        }
        let airframe = file_names(&folder.join(AIRFRAMES)).find(|name| is_airframe(name, model));
        let airframe = airframe.map(|name| Path::new(AIRFRAMES).join(name)).ok_or_else(|| {
            let airframes = folder.join(AIRFRAMES);
            refused(format!(
                "no airframe with the name `{model}` (parameter `model`) in {}: PX4 needs the folder `etc` of its build beside that \
                 of its program, bin/px4",
                airframes.display()
            ))
        });
        names.extend(airframe.as_ref().ok().cloned());
        let read = |path: &Path| context.files.bytes(path).map_err(|error| unread(path, error));
        let script = |name: PathBuf| -> Result<_, ParameterError> {
            let bytes = read(&folder.join(&name))?;
            Ok((name, bytes.to_vec()))
        };
        let aliases = read(&bin.join(ALIASES)).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        let scripts = ParameterError::gather(names.into_iter().map(script));
        let files = ParameterError::both(aliases, scripts);
        let (program, (airframe, (aliases, scripts))) =
            ParameterError::both(program, ParameterError::both(airframe, files))?;
        Ok(Self { program, aliases, scripts, airframe })
    }

    /// Fills the folder of `scratch`; `parameters` are commands that set parameters.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn fill(
        &self,
        scratch: &Scratch,
        library: &[u8],
        parameters: &str,
        has_links: bool,
    ) -> Result<Folder, String> {
        let program = scratch.write("px4", &self.program)?;
        scratch.write(LIBRARY, library)?;
        scratch.write(ALIASES, relative(&self.aliases).as_bytes())?;
        for command in commands(&self.aliases) {
            scratch.link(OsStr::new(command), Path::new("px4"))?;
        }
        if !has_links {
            scratch.write(LINKS, b"")?;
        }
        for folder in ["etc"].into_iter().chain(SCRIPTS).chain([AIRFRAMES]) {
            scratch.add_folder(folder)?;
        }
        for (name, bytes) in &self.scripts {
            let mut text = String::from_utf8_lossy(bytes).into_owned();
            if name == Path::new(START_UP) {
                text = in_order(&text);
            }
            // Behind the airframe's own parameters, and before a module starts.
            if *name == self.airframe {
                let _ = write!(text, "\n{parameters}");
            }
            scratch.write(&name.to_string_lossy(), text.as_bytes())?;
        }
        Ok(Folder { program, root: scratch.add_folder("rootfs")? })
    }
}

/// Refuses a program at `firmware` that is in no build: both files beside it in `bin` and those of the start-up in `folder` are missing.
fn require_build(firmware: &Path, bin: &Path, folder: &Path) -> Result<(), ParameterError> {
    let is_outside = !bin.join(ALIASES).is_file() && !folder.join(AIRFRAMES).is_dir();
    refuse(is_outside, "firmware", || {
        format!(
            "{}: the program is outside of a build of PX4: expected the file {ALIASES} beside it, and the folder `etc` of the build beside \
             that of the program; name the program in its build, build/px4_sitl_default/bin/px4",
            firmware.display()
        )
    })
}

/// True for a script that the start-up may run; the other `rcS` is for boards.
fn is_script(folder: &str, name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    name.starts_with("rc.")
        || name.starts_with("px4-rc.")
        || Path::new(folder).join(&*name) == Path::new(START_UP)
}

/// Names of the files in `folder`, sorted; empty if it cannot be read.
fn file_names(folder: &Path) -> std::vec::IntoIter<OsString> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter(|entry| entry.path().is_file());
    let mut names: Vec<_> = files.map(|entry| entry.file_name()).collect();
    names.sort();
    names.into_iter()
}

/// True for a number, `_` and the name of `model`.
fn is_airframe(name: &OsStr, model: &str) -> bool {
    let name = name.to_string_lossy();
    let number = name.strip_suffix(model).and_then(|rest| rest.strip_suffix('_'));
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// The aliases with the folder in which PX4 runs as a relative path: a script would take a blank in the absolute one for its end.
fn relative(aliases: &str) -> String {
    let line = |line: &str| if line.starts_with("R=") { "R=./\n".to_owned() } else { format!("{line}\n") };
    aliases.lines().map(line).collect()
}

/// Programs of the commands in the aliases: the first words of their values.
fn commands(aliases: &str) -> impl Iterator<Item = &str> {
    aliases.lines().filter_map(|line| {
        let (_, value) = line.strip_prefix("alias ")?.split_once("='")?;
        value.split([' ', '\'']).next().filter(|command| command.starts_with("px4-"))
    })
}

/// The start-up script with all of its commands one after the other: it starts the estimator beside the commands that follow, in an
/// order that would depend on the host.
fn in_order(script: &str) -> String {
    let line =
        |line: &str| format!("{}\n", if line.ends_with(" start &") { &line[..line.len() - 2] } else { line });
    script.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scripts_are_independent_of_the_folder_and_run_in_order() {
        let aliases =
            "R=\"`pwd`/\"\nalias set=_set\nalias ekf2='px4-ekf2 --instance $px4_instance'\nalias x='px4-x'\n";
        assert_eq!(commands(aliases).collect::<Vec<_>>(), ["px4-ekf2", "px4-x"]);
        assert!(relative(aliases).starts_with("R=./\nalias set=_set\n"));
        assert_eq!(in_order("if a\n\tekf2 start &\nb && c\n"), "if a\n\tekf2 start\nb && c\n");
    }

    #[test]
    fn a_program_outside_of_a_build_is_refused_with_one_error() {
        let firmware = Path::new("/nowhere/bin/px4");
        let told = Build::read(&NodeContext::new("px4", &[]), firmware, "none_iris").unwrap_err();
        assert_eq!(told.into_each().len(), 1, "a missing program");
        let outside = require_build(firmware, Path::new("/nowhere/bin"), Path::new("/nowhere"));
        let told = outside.unwrap_err().to_string();
        assert!(told.contains("outside of a build of PX4: expected the file px4-alias.sh"), "{told}");
    }

    #[test]
    fn scripts_are_those_of_the_simulation() {
        let is = |folder: &str, name: &str| is_script(folder, OsStr::new(name));
        assert!(is(SCRIPTS[1], "rcS") && is(SCRIPTS[1], "px4-rc.simulator") && is(SCRIPTS[0], "rc.mc_apps"));
        assert!(!is(SCRIPTS[0], "rcS") && !is(SCRIPTS[1], "CMakeLists.txt"));
    }

    #[test]
    fn an_airframe_is_found_by_its_name() {
        let is = |name: &str| is_airframe(OsStr::new(name), "none_iris");
        assert!(is("10016_none_iris"));
        assert!(!is("10016_none_iris.post") && !is("_none_iris") && !is("10016_gz_none_iris"));
    }
}
