//! The user's browser.

use std::ffi::OsStr;
use std::process::{Command, Stdio};

/// Opens `address` in the browser that `BROWSER` names, or in the desktop's; false if there is neither. The browser is not
/// waited for.
///
/// `BROWSER` holds commands between colons, of which the first that starts is taken; `%s` in one stands for the address.
#[must_use]
pub fn open(address: &str) -> bool {
    let named = std::env::var("BROWSER").unwrap_or_default();
    let has_desktop = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    let commands = commands(&named, has_desktop, address);
    commands.iter().any(|words| start(&words[0], &words[1..]))
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

fn start(program: &str, arguments: &[impl AsRef<OsStr>]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    match command.spawn() {
        Ok(mut child) => {
            // Whoever is not waited for stays in the table of processes.
            std::thread::spawn(move || child.wait());
            true
        }
        Err(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::commands;

    #[test]
    fn the_named_browsers_come_first_and_a_desktop_is_needed_otherwise() {
        let address = "http://127.0.0.1:1/";
        assert_eq!(
            commands("firefox --new-window:chromium --app=%s", true, address),
            [vec!["firefox", "--new-window", address], vec!["chromium", &format!("--app={address}")]]
        );
        assert_eq!(commands("", true, address), [["xdg-open", address]]);
        assert!(commands("", false, address).is_empty());
    }
}
