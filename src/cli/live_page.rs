//! The page of a live run, served by a thread of this process.

use super::output::say;
use anyhow::{Result, anyhow};
use bus::plan::Plan;
use recorder::reader::Recording;
use runtime::event::StopToken;
use runtime::run_dir::LiveRun;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use view::browser::{self, Redirect};
use view::live::recording_of;
use view::{Handle, Server, Shown};

/// Pause between two looks: for the run, for its first messages, for the end.
pub const LOOK: Duration = Duration::from_millis(50);
/// Pause between two looks for a run that goes back: its page may stay open for hours after its end.
const LATER_LOOK: Duration = Duration::from_millis(500);
/// Looks without an open page after which the page is closed: it may be reloading. Two seconds.
const DESERTED_LOOKS: u32 = 40;

/// The page of a live run; dropping it ends it.
pub struct LivePage {
    address: String,
    handle: Handle,
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Result<()>>>,
    /// Leads the browser to the address until the page ends.
    redirect: Option<Redirect>,
}

impl LivePage {
    /// Serves the page at `port`, and opens a browser unless `no_open`. For a run of this process, before it starts:
    /// a browser started while a run flies ends with it.
    ///
    /// # Errors
    /// If the port is taken.
    pub fn open(port: u16, no_open: bool) -> Result<Self> {
        let server = Server::awaiting(port)?;
        let (address, handle) = (server.address(), server.handle());
        let is_over = Arc::new(AtomicBool::new(false));
        let seen = is_over.clone();
        let serve = std::thread::spawn(move || server.serve(&|| seen.load(Ordering::Relaxed)));
        let redirect = if no_open { None } else { opened(&address) };
        Ok(Self { address, handle, is_over, threads: vec![serve], redirect })
    }

    /// The address with its token.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// True if a browser was started.
    pub fn is_opened(&self) -> bool {
        self.redirect.is_some()
    }

    /// Shows the run that `find` finds, once it does: its state at once, its recording from the first messages on. A run that
    /// goes back is found again.
    pub fn follow(&mut self, find: impl Fn() -> Option<LiveRun> + Send + 'static) {
        let (handle, is_over) = (self.handle.clone(), self.is_over.clone());
        let is_ended = move || is_over.load(Ordering::Relaxed);
        self.threads.push(std::thread::spawn(move || follow(&handle, &find, &is_ended)));
    }

    /// The run has ended, with this recording; it is shown if none of it was before.
    ///
    /// # Errors
    /// If the recording is damaged.
    pub fn show_whole(&self, recording: &Path) -> Result<()> {
        if !self.handle.has_recordings() {
            self.handle.show(vec![Shown::new(Recording::open(recording)?)?])?;
        }
        Ok(())
    }

    /// Waits until `stop` is used, or, with `while_open`, until the last page was closed.
    pub fn stay(&self, stop: &StopToken, while_open: bool) {
        let mut deserted = 0;
        while stop.count() == 0 && deserted < DESERTED_LOOKS {
            std::thread::sleep(LOOK);
            let [open, seen] = self.handle.pages();
            deserted = if while_open && seen > 0 && open == 0 { deserted + 1 } else { 0 };
        }
    }

    /// Ends the page.
    ///
    /// # Errors
    /// Reason that ended the server before.
    pub fn close(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        self.is_over.store(true, Ordering::Relaxed);
        let panicked =
            |_| Err(anyhow!("the server of the page failed in a way that is a defect of hummingbus"));
        let ends = self.threads.drain(..).map(|thread| thread.join().unwrap_or_else(panicked));
        ends.collect()
    }
}

impl Drop for LivePage {
    fn drop(&mut self) {
        // A caller that wants to see errors closes it.
        let _ = self.end();
    }
}

/// The browser that shows `address`; `None` if there is none, or it could not be opened.
pub fn opened(address: &str) -> Option<Redirect> {
    browser::open(address).unwrap_or_else(|error| {
        say(&format!("warning: no browser was opened: {error:#}"));
        None
    })
}

/// Hands the run and its recording to the server as they come up; once more after each rewind.
fn follow(handle: &Handle, find: &dyn Fn() -> Option<LiveRun>, is_ended: &dyn Fn() -> bool) -> Result<()> {
    let found = || {
        let run = find()?;
        let plan = Plan::load(&run.entry.run_dir).ok()?;
        let watched = runtime::run_dir::find_live(Some(&run.entry.run_id)).ok()?;
        Some((run, plan, watched))
    };
    let mut pause = LOOK;
    while !is_ended()
        && let Some((run, plan, watched)) = first(found, pause, is_ended)
    {
        let is_over = || is_ended() || !watched.is_live();
        let path = recording_of(&plan).map(str::to_owned);
        handle.steer(run, plan);
        match path {
            Ok(path) => {
                let shown = || {
                    // Before the run ends: its control segment goes with it.
                    handle.look();
                    Shown::new(Recording::salvage(Path::new(&path)).ok()?).ok()
                };
                if let Some(shown) = first(shown, LOOK, &is_over)
                    && let Err(error) = handle.show(vec![shown])
                {
                    handle.refuse(format!("{error:#}"));
                }
            }
            Err(error) => handle.refuse(format!("{error:#}")),
        }
        first(|| None::<()>, LOOK, &is_over);
        pause = LATER_LOOK;
    }
    Ok(())
}

/// The first value of `look`; `None` if `is_ended` before.
pub fn first<T>(look: impl Fn() -> Option<T>, pause: Duration, is_ended: &dyn Fn() -> bool) -> Option<T> {
    loop {
        let found = look();
        if found.is_some() || is_ended() {
            return found;
        }
        std::thread::sleep(pause);
    }
}
