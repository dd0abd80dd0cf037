//! A terminal for a program under test: what it draws, and keys for it.

use crate::support::{Place, poll};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};

const ROWS: u16 = 24;
const COLUMNS: u16 = 80;

/// A pseudo terminal of 80 × 24 characters with `hummingbus` in it; dropping it kills that.
pub struct Terminal {
    keyboard: File,
    screen: Arc<Mutex<vt100::Parser>>,
    child: Child,
}

impl Terminal {
    /// Starts `hummingbus` with `args` in a new terminal.
    pub fn start(place: &Place, args: &[&str]) -> Self {
        let keyboard = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&keyboard).unwrap();
        unlockpt(&keyboard).unwrap();
        let size = Winsize { ws_row: ROWS, ws_col: COLUMNS, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&keyboard, size).unwrap();
        let path = ptsname(&keyboard, Vec::new()).unwrap().into_string().unwrap();
        let inside = File::options().read(true).write(true).open(path).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_hummingbus"));
        place.mark(&mut command).args(args).env("TERM", "xterm-256color");
        let share = || Stdio::from(OwnedFd::from(inside.try_clone().unwrap()));
        let child = command.stdin(share()).stdout(share()).stderr(share()).spawn().unwrap();
        let screen = Arc::new(Mutex::new(vt100::Parser::new(ROWS, COLUMNS, 0)));
        let (keyboard, drawn) = (File::from(keyboard), screen.clone());
        let output = keyboard.try_clone().unwrap();
        // Ends when the last process inside has closed the terminal.
        std::thread::spawn(move || draw(output, &drawn));
        Self { keyboard, screen, child }
    }

    /// Presses keys.
    pub fn press(&mut self, keys: &str) {
        self.keyboard.write_all(keys.as_bytes()).unwrap();
    }

    /// Sends a signal to the program.
    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).unwrap();
    }

    /// Returns the text on the screen.
    pub fn content(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    /// Waits until all of `texts` stand on the screen.
    pub fn await_texts(&self, texts: &[&str]) {
        poll(&format!("{texts:?} do not appear"), || {
            let content = self.content();
            texts.iter().all(|text| content.contains(text)).then_some(())
        });
    }

    /// True if the screen is the program's own, which it gives back when it leaves.
    pub fn is_taken(&self) -> bool {
        self.screen.lock().unwrap().screen().alternate_screen()
    }

    /// Waits for the end of the program.
    pub fn end(&mut self) -> ExitStatus {
        poll("the program does not leave", || self.child.try_wait().unwrap())
    }
}

fn draw(mut output: File, screen: &Mutex<vt100::Parser>) {
    let mut bytes = [0; 4096];
    while let Ok(count @ 1..) = output.read(&mut bytes) {
        screen.lock().unwrap().process(&bytes[..count]);
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
