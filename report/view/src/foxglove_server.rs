//! A live run in Foxglove and Lichtblick: a server of their WebSocket protocol.
//!
//! | room | content |
//! |---|---|
//! | `channels` | the topics of the run, and their newest samples |
//! | `playback` | the state of the run as a player shows it, and a player's requests |
//!
//! Clients get the samples that the recorder writes, with the schemas and the times of the recording. Nothing waits for a
//! client: one that reads too slowly loses the oldest of the samples that wait for it.

mod channels;
mod playback;

use crate::live::Live;
use crate::priority::step_back;
use anyhow::{Context as _, Result, anyhow};
use bus::plan::Plan;
use bus::watch::{WatchFiles, WatchReader};
use channels::{Channels, lock};
use foxglove::websocket::{
    Capability, ChannelView, Client, PlaybackControlRequest, PlaybackState, ServerListener, Status,
};
use foxglove::{Context, FoxgloveError, WebSocketServer, WebSocketServerHandle};
use playback::Playback;
use runtime::run_dir::{LiveRun, find_live};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};

/// Samples that wait for one client; beyond them the oldest are dropped.
const BACKLOG: usize = 16_384;
/// Pause between two looks for new samples.
const LOOK: Duration = Duration::from_millis(10);
/// Looks between two messages with the time of the run: about thirty a second.
const TIME_LOOKS: u32 = 3;
/// Looks after which a run without samples is told of: two seconds.
const SILENT_LOOKS: u32 = 200;
/// Time that clients have at the end to take what waits for them.
const LEAVE: Duration = Duration::from_millis(500);

/// A server that shows a live run in Foxglove.
pub struct Foxglove {
    handle: WebSocketServerHandle,
    shared: Arc<Shared>,
    address: SocketAddr,
    runtime: Runtime,
}

/// The parts that requests of clients use.
struct Shared {
    channels: Channels,
    playback: Playback,
}

impl ServerListener for Shared {
    fn on_subscribe(&self, client: Client, channel: ChannelView) {
        self.channels.send_newest(client.sink_id(), channel.id());
    }

    fn on_playback_control_request(&self, request: PlaybackControlRequest) -> Option<PlaybackState> {
        self.playback.answer(&request)
    }
}

impl std::fmt::Debug for Foxglove {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Foxglove").field("address", &self.address).finish_non_exhaustive()
    }
}

impl Foxglove {
    /// A server at `address` for the run of `plan`, which is called `name` there and comes later by [`Foxglove::follow`].
    ///
    /// # Errors
    /// If the address is taken or is not one of this machine.
    pub fn listen(address: SocketAddr, plan: &Plan, name: &str) -> Result<Self> {
        let mut builder = Builder::new_multi_thread();
        // One, so that `on_worker` holds back what is sent.
        let runtime = builder.worker_threads(1).enable_all().on_thread_start(step_back).build()?;
        let context = Context::new();
        let shared =
            Arc::new(Shared { channels: Channels::new(context.clone()), playback: Playback::new(plan) });
        let [first, end] = [plan.first_tick, plan.duration_ticks].map(|tick| u64::from(tick) * plan.tick_ns);
        let server = WebSocketServer::new()
            .name(name)
            .bind(host_of(&address), address.port())
            .context(&context)
            .capabilities([Capability::Time, Capability::PlaybackControl])
            .playback_time_range(first, end)
            .message_backlog_size(BACKLOG)
            .listener(shared.clone());
        let handle = runtime.block_on(server.start()).map_err(|error| refused(error, &address))?;
        let address = SocketAddr::new(address.ip(), handle.port());
        Ok(Self { handle, shared, address, runtime })
    }

    /// Its address; with the port that it got, where port 0 was asked for.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Shows `run`, which flies `plan`, until the run has ended or `is_ended`. May be called again for a run that has gone
    /// back.
    ///
    /// # Errors
    /// If shared memory has no room for its samples.
    pub fn follow(&self, run: LiveRun, plan: Plan, is_ended: &dyn Fn() -> bool) -> Result<()> {
        step_back();
        let files = WatchFiles::of(&run.entry.run_dir, &run.entry.run_id);
        let samples = Arc::new(Mutex::new(files.watch().context("cannot watch the run")?));
        let (run_id, live) = (run.entry.run_id.clone(), Arc::new(Live::of(run, plan)));
        if self.shared.playback.steer(live.clone()) {
            // The run went back in time: clients forget what they know of it.
            self.handle.clear_session(None);
        }
        let (mut looks, mut is_over) = (0_u32, false);
        while !is_over {
            // Before the look: it then finds the last samples.
            is_over = is_ended() || !live.is_live();
            match self.look(&files, &samples) {
                // Its files have gone.
                Err(_) if !live.is_live() => is_over = true,
                looked => looked?,
            }
            if looks == SILENT_LOOKS && !self.shared.channels.are_open() {
                self.handle.publish_status(Status::warning(
                    "no samples yet: a paused run shows its topics once it goes on; a run that records nothing shows none",
                ));
            }
            self.tell(looks.is_multiple_of(TIME_LOOKS) || is_over);
            looks = looks.wrapping_add(1);
            std::thread::sleep(LOOK);
        }
        if find_live(Some(&run_id)).is_err() {
            // The run may have ended while the ring was made.
            files.remove();
        }
        Ok(())
    }

    /// Sends the samples that have come.
    fn look(&self, files: &WatchFiles, samples: &Arc<Mutex<WatchReader>>) -> Result<()> {
        let channels = &self.shared.channels;
        if !channels.are_open() {
            if !lock(samples).is_attached() {
                return Ok(());
            }
            let topics = files.topics()?;
            self.on_worker(move |channels| channels.open(topics))??;
        }
        let samples = samples.clone();
        let (newest_ns, unknown) = self.on_worker(move |channels| channels.send_all(&mut lock(&samples)))?;
        for topic in unknown {
            self.on_worker(move |channels| channels.open_shadow(&topic))??;
        }
        if let Some(newest_ns) = newest_ns {
            self.shared.playback.reached(newest_ns);
        }
        Ok(())
    }

    /// Does `work` on the thread that serves the clients, because `foxglove` 0.30 takes a subscription in steps. It sends the
    /// offer of a new channel before it takes subscriptions to it. A client gets samples before [`Shared`] is told of its
    /// subscription, and would get the newest of them twice. Nothing happens between two steps while that thread is busy.
    fn on_worker<T: Send + 'static>(&self, work: impl FnOnce(&Channels) -> T + Send + 'static) -> Result<T> {
        let shared = self.shared.clone();
        let task = self.runtime.spawn(async move { work(&shared.channels) });
        self.runtime.block_on(task).context("the server for Foxglove failed")
    }

    /// Sends the state of the run where it has changed, and its time if it `is_time`.
    fn tell(&self, is_time: bool) {
        let playback = &self.shared.playback;
        if is_time && let Some(time_ns) = playback.new_time_ns() {
            self.handle.broadcast_time(time_ns);
        }
        if let Some(state) = playback.new_state() {
            self.handle.broadcast_playback_state(state);
        }
        for status in playback.take_refusals() {
            self.handle.publish_status(status);
        }
    }

    /// Ends the server, once its clients have had time to take what waits for them.
    pub fn close(self) {
        if self.handle.client_count() > 0 {
            std::thread::sleep(LEAVE);
        }
        drop(self.handle.stop());
        self.runtime.shutdown_timeout(LEAVE);
    }
}

/// The host of an address as the server takes it.
fn host_of(address: &SocketAddr) -> String {
    match address {
        SocketAddr::V4(address) => address.ip().to_string(),
        SocketAddr::V6(address) => format!("[{}]", address.ip()),
    }
}

fn refused(error: FoxgloveError, address: &SocketAddr) -> anyhow::Error {
    let cause = match error {
        FoxgloveError::Bind(error) => anyhow!(error),
        error => anyhow!(error),
    };
    cause.context(format!(
        "cannot listen at {address} for Foxglove: name another port, such as --foxglove={}:{}, or an address of this machine",
        host_of(address),
        address.port().wrapping_add(1).max(1024)
    ))
}
