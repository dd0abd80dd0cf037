//! The user's browser.

use anyhow::{Context as _, Result};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_encode};
use std::ffi::OsStr;
use std::fs::{OpenOptions, Permissions};
use std::io::Write as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
use std::process::{Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// Bytes of a path that stand as they are in an address.
const PATH: AsciiSet = NON_ALPHANUMERIC.remove(b'/').remove(b'.').remove(b'-').remove(b'_').remove(b'~');

/// Looks for the failure of a browser that was started, and the pause between two.
const FAILURE_LOOKS: u32 = 20;
const FAILURE_LOOK: Duration = Duration::from_millis(20);

/// A file that leads a browser to an address. Only this user can read it, and dropping it removes it.
///
/// The arguments of a process are visible to every user of the machine: an address with a token must not be among them.
#[derive(Debug)]
pub struct Redirect {
    folder: TempDir,
}

impl Redirect {
    /// # Errors
    /// If the file cannot be written to the folder of temporary files.
    fn to(address: &str) -> Result<Self> {
        let folder = tempfile::Builder::new()
            .prefix("hummingbus-view-")
            .permissions(Permissions::from_mode(0o700))
            .tempdir()
            .context("cannot make a folder for the page that leads the browser to the address")?;
        let redirect = Self { folder };
        let path = redirect.path();
        let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path);
        file.and_then(|mut file| file.write_all(page(address).as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(redirect)
    }

    fn path(&self) -> std::path::PathBuf {
        self.folder.path().join("open.html")
    }

    fn address(&self) -> String {
        format!("file://{}", percent_encode(self.path().as_os_str().as_bytes(), &PATH))
    }
}

/// A page that leads to `address`, which has no character that HTML takes for its own.
fn page(address: &str) -> String {
    format!(
        "<!doctype html>\n<meta charset=\"utf-8\">\n<meta name=\"referrer\" content=\"no-referrer\">\n\
         <meta http-equiv=\"refresh\" content=\"0; url={address}\">\n<title>hummingbus view</title>\n\
         <p><a href=\"{address}\">The page of hummingbus view</a></p>\n"
    )
}

/// Opens `address` in the browser that `BROWSER` names, or in the desktop's; `None` if there is neither, or it fails at once. The browser gets
/// the path of a file that leads there, which has to stay until it has read it.
///
/// `BROWSER` holds commands between colons, of which the first that starts is taken; `%s` in one stands for the address.
///
/// # Errors
/// If the file cannot be written.
pub fn open(address: &str) -> Result<Option<Redirect>> {
    let named = std::env::var("BROWSER").unwrap_or_default();
    let has_desktop = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    open_by(&named, has_desktop, address)
}

fn open_by(named: &str, has_desktop: bool, address: &str) -> Result<Option<Redirect>> {
    let redirect = Redirect::to(address)?;
    let commands = commands(named, has_desktop, &redirect.address());
    let is_open = commands.iter().any(|words| start(&words[0], &words[1..]));
    Ok(is_open.then_some(redirect))
}

/// The commands to try, each as its words. Without a desktop `xdg-open` would start a browser in this terminal.
fn commands(named: &str, has_desktop: bool, address: &str) -> Vec<Vec<String>> {
    let named = named.split(':').filter(|command| !command.trim().is_empty());
    let mut commands: Vec<Vec<String>> = named.map(|command| words(command, address)).collect();
    if commands.is_empty() && has_desktop {
        commands.push(words("xdg-open", address));
    }
    commands
}

/// The words of a command, with the address in its place or at its end.
fn words(command: &str, address: &str) -> Vec<String> {
    let has_place = command.contains("%s");
    let words = command.split_whitespace().map(|word| word.replace("%s", address));
    words.chain((!has_place).then(|| address.to_owned())).collect()
}

/// Starts a program; false if there is none, or it fails at once.
fn start(program: &str, arguments: &[impl AsRef<OsStr>]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let Ok(mut child) = command.spawn() else { return false };
    for _ in 0..FAILURE_LOOKS {
        match child.try_wait() {
            // One that has handed the address to a browser at work ends at once, too.
            Ok(Some(status)) => return status.success(),
            Ok(None) => std::thread::sleep(FAILURE_LOOK),
            Err(_) => return false,
        }
    }
    // A child that is not waited for stays in the table of processes.
    std::thread::spawn(move || child.wait());
    true
}

#[cfg(test)]
mod tests {
    use super::{commands, open_by};
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;
    use std::path::Path;
    use std::time::Duration;

    #[test]
    fn the_named_browsers_come_first_and_a_desktop_is_needed_otherwise() {
        let address = "http://127.0.0.1:1/";
        assert_eq!(
            commands("firefox --new-window:chromium --app=%s", true, address),
            [vec!["firefox", "--new-window", address], vec!["chromium", &format!("--app={address}")]]
        );
        assert_eq!(commands("", true, address), [["xdg-open", address]]);
        assert!(commands("", false, address).is_empty());
        assert!(open_by("", false, address).unwrap().is_none());
        assert!(
            open_by("/bin/false", false, address).unwrap().is_none(),
            "a browser that fails shows nothing"
        );
        assert!(open_by("/bin/false:/bin/true", false, address).unwrap().is_some());
    }

    /// Every user sees the arguments of a process, and no other user may learn the token.
    #[test]
    fn a_browser_gets_a_private_file_that_leads_to_the_address() {
        let folder = tempfile::tempdir().unwrap();
        let (script, seen) = (folder.path().join("browser"), folder.path().join("seen"));
        let moved = folder.path().join("moved");
        // In one step, so that the file is whole when it is there.
        let text =
            format!("echo \"$@\" > {} && mv {} {}\n", moved.display(), moved.display(), seen.display());
        fs::write(&script, text).unwrap();
        let address = "http://127.0.0.1:1/token=0123abcd/";
        let redirect = open_by(&format!("sh {}", script.display()), false, address).unwrap().unwrap();
        while !seen.exists() {
            std::thread::sleep(Duration::from_millis(10));
        }
        let argument = fs::read_to_string(&seen).unwrap();
        assert!(!argument.contains("0123abcd"), "{argument}");
        let path = Path::new(argument.trim().strip_prefix("file://").unwrap());
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(path), mode(path.parent().unwrap())), (0o600, 0o700));
        assert!(fs::read_to_string(path).unwrap().contains(&format!("url={address}\"")), "{argument}");
        drop(redirect);
        assert!(!path.parent().unwrap().exists());
    }
}
