//! The server of a live run for Foxglove and Lichtblick, on a thread of this process.

use super::live_page::{LOOK, first};
use super::output::say;
use anyhow::{Result, anyhow};
use bus::plan::Plan;
use runtime::run_dir::LiveRun;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use view::foxglove_server::Foxglove;

/// Port at which Foxglove looks for a server.
const PORT: u16 = 8765;

/// The address that a user asks for: `PORT`, `ADDRESS` or `ADDRESS:PORT`; of the loopback where only the port is named.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let text = text.strip_prefix("localhost").map_or(text.to_owned(), |rest| format!("127.0.0.1{rest}"));
    let at_loopback = || text.parse().map(|port: u16| SocketAddr::new(Ipv4Addr::LOCALHOST.into(), port));
    let bare = || text.trim_matches(['[', ']']).parse().map(|address: IpAddr| SocketAddr::new(address, PORT));
    at_loopback().or_else(|_| text.parse()).or_else(|_| bare()).map_err(|_| {
        format!("expected a port, an IP address or both, such as {PORT}, 0.0.0.0 or 192.168.1.5:{PORT}")
    })
}

/// Shows a live run in Foxglove until it is closed.
pub struct LiveFoxglove {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl LiveFoxglove {
    /// A server for the run of `plan`, which is called `name`. It shows the run that `find` finds, once it does; a run that
    /// goes back is found again.
    ///
    /// # Errors
    /// If the address is taken.
    pub fn open(
        address: SocketAddr,
        plan: &Plan,
        name: &str,
        find: impl Fn() -> Option<LiveRun> + Send + 'static,
    ) -> Result<Self> {
        let server = Foxglove::listen(address, plan, name)?;
        let address = server.address();
        say(&format!("In Foxglove or Lichtblick: Open connection, Foxglove WebSocket, {}", url(&address)));
        if !address.ip().is_loopback() {
            let port = address.port();
            say(&format!(
                "warning: everybody who reaches port {port} of this machine sees the run and can pause it"
            ));
        }
        let is_over = Arc::new(AtomicBool::new(false));
        let seen = is_over.clone();
        let thread = std::thread::spawn(move || {
            let followed = follow(&server, &find, &|| seen.load(Ordering::Relaxed));
            server.close();
            followed
        });
        Ok(Self { is_over, thread: Some(thread) })
    }

    /// True once it shows nothing more.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Ends the server, once it has sent what its clients have not got yet.
    ///
    /// # Errors
    /// Reason for which it could not show the run.
    pub fn close(mut self) -> Result<()> {
        self.end()
    }

    fn end(&mut self) -> Result<()> {
        self.is_over.store(true, Ordering::Relaxed);
        let panicked =
            |_| Err(anyhow!("the server for Foxglove failed in a way that is a defect of hummingbus"));
        self.thread.take().map_or(Ok(()), |thread| thread.join().unwrap_or_else(panicked))
    }
}

impl Drop for LiveFoxglove {
    fn drop(&mut self) {
        // A caller that wants to see errors closes it.
        let _ = self.end();
    }
}

/// The address as a client on this machine takes it, or one elsewhere.
fn url(address: &SocketAddr) -> String {
    if address.ip().is_unspecified() {
        format!("ws://NAME-OF-THIS-MACHINE:{}", address.port())
    } else {
        format!("ws://{address}")
    }
}

fn follow(server: &Foxglove, find: &dyn Fn() -> Option<LiveRun>, is_ended: &dyn Fn() -> bool) -> Result<()> {
    let found = || {
        let run = find()?;
        let plan = Plan::load(&run.entry.run_dir).ok()?;
        Some((run, plan))
    };
    while !is_ended()
        && let Some((run, plan)) = first(found, LOOK, is_ended)
    {
        server.follow(run, plan, is_ended)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::address;

    #[test]
    fn an_address_is_a_port_of_the_loopback_unless_it_names_another() {
        let parsed = |text| address(text).unwrap().to_string();
        assert_eq!(parsed("9000"), "127.0.0.1:9000");
        assert_eq!(parsed("0.0.0.0"), "0.0.0.0:8765");
        assert_eq!(parsed("192.168.1.5:9000"), "192.168.1.5:9000");
        assert_eq!(parsed("localhost:9000"), "127.0.0.1:9000");
        assert_eq!(parsed("localhost"), "127.0.0.1:8765");
        assert_eq!(parsed("[::1]:9000"), "[::1]:9000");
        assert_eq!(parsed("::1"), "[::1]:8765");
        for text in ["", "nowhere", "65536", "1.2.3", ":9000", "ws://127.0.0.1"] {
            assert!(address(text).is_err(), "{text}");
        }
    }
}
