//! The server: addresses and their answers.
//!
//! | address | answer |
//! |---|---|
//! | `GET  /token=…/` | the page |
//! | `GET  /token=…/assets/NAME` | a file of the page |
//! | `GET  /token=…/api/catalogue` | JSON: the recordings ([`crate::catalogue`]) |
//! | `GET  /token=…/api/growth` | JSON: of each recording its duration, blocks and number of topics, if it still grows, and the error that ended reading |
//! | `POST /token=…/api/frames` | numbers: [`crate::frames`] |
//! | `POST /token=…/api/curves` | numbers: [`crate::curves`]; the header `x-read` holds the part that was read for them |
//! | `POST /token=…/api/newest` | numbers: time of the newest sample of the live run, and the newest values; 204 where nothing newer than the recording can be had |
//! | `GET  /token=…/api/layouts` | JSON: the user's layouts of scopes by their names |
//! | `POST /token=…/api/layouts` | the same, once it has kept or forgotten one |
//! | `GET  /token=…/api/events` | events: state of the live run, how often it has started, number of recordings; open for as long as the page of a live run is |
//! | `GET  /token=…/api/run` | JSON: manifest and processes of the live run; null without one |
//! | `GET  /token=…/api/schedule` | JSON: the tick of the live run as planned, and as it goes; null without one |
//! | `POST /token=…/api/fly` | nothing: takes set points of a person for a node of kind `operator` |
//! | `POST /token=…/api/ctl` | JSON: the run's answer to a request of [`runtime::ctl::protocol`] |
//!
//! Numbers are 64-bit floats, little-endian, one after the other. It listens on the loopback alone, and answers requests
//! that name it and know its token; all others get 403.

use crate::assets::{PAGE, asset};
use crate::curves::{CurvesRequest, curves};
use crate::entry::Entry;
use crate::frames::{FramesRequest, frames};
use crate::gate::Gate;
use crate::layouts::{Keeping, Layout, Layouts};
use crate::live::{Asking, Live};
use crate::newest::NewestRequest;
use crate::pages::{News, Pages, events};
use crate::priority::step_back;
use crate::readers::Readers;
use crate::shown::Shown;
use anyhow::{Context as _, Result, anyhow};
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response, Sse};
use axum::routing::{get, post};
use axum::{Json, Router};
use bus::plan::Plan;
use runtime::ctl::protocol::{Answer, Request as Asked};
use runtime::run_dir::LiveRun;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock, PoisonError, RwLock};
use std::time::Duration;

/// Bytes of a request: fields by their names.
const BODY_BYTES_MAX: usize = 1 << 20;
/// Requests that read recordings at the same time.
const READERS: usize = 4;
/// Requests to the live run that wait for their answers at the same time.
const ASKERS: usize = 8;
/// Pause between two looks for the end.
const LOOK: Duration = Duration::from_millis(50);
/// Looks for the end between two checks of a recording's growth: half a second.
const GROWTH_LOOKS: u32 = 10;
/// Time that answers under way have at the end.
const LEAVE: Duration = Duration::from_millis(500);

/// Headers of every answer: no other page embeds or reads it, nothing but the page's own files runs in it, and no request
/// of it names its address.
const HEADERS: [(HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::REFERRER_POLICY, "no-referrer"),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
];

/// A server that shows recordings.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    content: Arc<Content>,
}

/// Recordings and live run, and the gate in front of them.
#[derive(Debug)]
struct Content {
    gate: Gate,
    /// True for the page of a live run, which gets its events for as long as it is open.
    is_live: bool,
    /// `None` until the live run has recorded something.
    recordings: RwLock<Arc<Vec<Entry>>>,
    /// Absent for recordings that are shown by their names.
    live: RwLock<Option<Arc<Live>>>,
    /// Times that the live run has started: once more at each rewind.
    starts: AtomicUsize,
    /// Reason why there is no recording, and none will come.
    refusal: OnceLock<String>,
    layouts: Layouts,
    pages: Pages,
    readers: Readers,
    askers: Readers,
}

impl Content {
    fn recordings(&self) -> Arc<Vec<Entry>> {
        self.recordings.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set_recordings(&self, recordings: Vec<Entry>) {
        *self.recordings.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(recordings);
    }

    fn live(&self) -> Option<Arc<Live>> {
        self.live.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn news(&self) -> News {
        let live = self.live();
        News {
            run: live.as_ref().and_then(|live| live.status()),
            take_overs: live.map_or(Vec::new(), |live| live.take_overs()),
            recordings: self.recordings().len(),
            starts: self.starts.load(Ordering::Relaxed),
        }
    }
}

impl AsRef<Pages> for Content {
    fn as_ref(&self) -> &Pages {
        &self.pages
    }
}

/// The way to a server at work: it receives the recordings to show.
#[derive(Clone, Debug)]
pub struct Handle(Arc<Content>);

impl Handle {
    /// Shows these recordings from now on.
    ///
    /// # Errors
    /// If a recording is damaged.
    pub fn show(&self, recordings: Vec<Shown>) -> Result<()> {
        self.0.set_recordings(recordings.into_iter().map(Entry::of).collect::<Result<_>>()?);
        Ok(())
    }

    /// True once it shows recordings.
    #[must_use]
    pub fn has_recordings(&self) -> bool {
        !self.0.recordings().is_empty()
    }

    /// Shows the state of `run`, which flies `plan`, and lets pages steer it. A run that has gone back is shown anew:
    /// its recordings so far are removed from the page.
    pub fn steer(&self, run: LiveRun, plan: Plan) {
        self.0.set_recordings(Vec::new());
        let live = Some(Arc::new(Live::of(run, plan)));
        *self.0.live.write().unwrap_or_else(PoisonError::into_inner) = live;
        self.0.starts.fetch_add(1, Ordering::Relaxed);
    }

    /// Looks at the live run, so that its state is known to the end, also to a page that is opened behind it. A run that has
    /// ended cannot be looked at for the first time.
    pub fn look(&self) {
        let _ = self.0.live().map(|live| (live.status(), live.take_overs()));
    }

    /// Sends pages the reason why there is nothing to show.
    pub fn refuse(&self, reason: String) {
        let _ = self.0.refusal.set(reason);
    }

    /// Number of pages that are open, and of those that were ever opened.
    #[must_use]
    pub fn pages(&self) -> [usize; 2] {
        [self.0.pages.open(), self.0.pages.seen()]
    }
}

impl Server {
    /// A server for these recordings at a port of the loopback; at any free one for port 0.
    ///
    /// # Errors
    /// If a recording is damaged or the port is taken.
    pub fn new(recordings: Vec<Shown>, port: u16) -> Result<Self> {
        let server = Self::listening(port, false)?;
        server.handle().show(recordings)?;
        Ok(server)
    }

    /// A server of a live run, which comes later through its [`Handle`], as does its recording.
    ///
    /// # Errors
    /// If the port is taken.
    pub fn awaiting(port: u16) -> Result<Self> {
        Self::listening(port, true)
    }

    fn listening(port: u16, is_live: bool) -> Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).with_context(|| {
            format!("cannot listen at port {port} of 127.0.0.1: name another one with --port, or leave it out for any free one")
        })?;
        listener.set_nonblocking(true)?;
        let gate =
            Gate::new(listener.local_addr()?.port()).map_err(|error| anyhow!("no random token: {error}"))?;
        let content = Content {
            gate,
            is_live,
            recordings: RwLock::default(),
            live: RwLock::default(),
            starts: AtomicUsize::new(0),
            refusal: OnceLock::new(),
            layouts: Layouts::of_user(),
            pages: Pages::default(),
            readers: Readers::new(READERS),
            askers: Readers::new(ASKERS),
        };
        Ok(Self { listener, content: Arc::new(content) })
    }

    /// The way to this server while it serves.
    #[must_use]
    pub fn handle(&self) -> Handle {
        Handle(self.content.clone())
    }

    /// The address of the page, with its token.
    #[must_use]
    pub fn address(&self) -> String {
        self.content.gate.address()
    }

    /// Serves the page until `is_ended`.
    ///
    /// # Errors
    /// If the system refuses threads.
    pub fn serve(self, is_ended: &dyn Fn() -> bool) -> Result<()> {
        let mut builder = tokio::runtime::Builder::new_multi_thread();
        let runtime = builder.worker_threads(2).enable_all().on_thread_start(step_back).build()?;
        let listener = {
            let _entered = runtime.enter();
            tokio::net::TcpListener::from_std(self.listener)?
        };
        let routes = routes(self.content.clone());
        runtime.spawn(async move { axum::serve(listener, routes).await });
        let (content, is_over) = (self.content, AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| keep_up(&content, &is_over));
            while !is_ended() {
                std::thread::sleep(LOOK);
            }
            is_over.store(true, Ordering::Relaxed);
        });
        runtime.shutdown_timeout(LEAVE);
        Ok(())
    }
}

/// Reads the overviews, and goes on while recordings grow. Damage ends the overview: long windows of it are refused with
/// the place of the damage.
fn keep_up(content: &Content, is_over: &AtomicBool) {
    step_back();
    // Each has its turn, whether or not one before it grows. A live run may go back, and begin another recording.
    let goes_on = || {
        let growing = content.recordings().iter().filter(|entry| entry.keep_up(is_over)).count();
        growing > 0 || content.is_live
    };
    while goes_on() {
        for _ in 0..GROWTH_LOOKS {
            if is_over.load(Ordering::Relaxed) {
                return;
            }
            std::thread::sleep(LOOK);
        }
    }
}

fn routes(content: Arc<Content>) -> Router {
    Router::new()
        .route("/{token}/", get(|| async { ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], PAGE) }))
        .route("/{token}/assets/{*name}", get(file))
        .route("/{token}/api/catalogue", get(catalogues))
        .route("/{token}/api/growth", get(growth))
        .route("/{token}/api/frames", post(answer_frames))
        .route("/{token}/api/curves", post(answer_curves))
        .route("/{token}/api/newest", post(newest))
        .route("/{token}/api/layouts", get(layouts).post(keep_layout))
        .route("/{token}/api/events", get(hear))
        .route("/{token}/api/run", get(described))
        .route("/{token}/api/schedule", get(scheduled))
        .route("/{token}/api/fly", post(fly))
        .route("/{token}/api/ctl", post(steer))
        .layer(DefaultBodyLimit::max(BODY_BYTES_MAX))
        .layer(from_fn_with_state(content.clone(), guard))
        .with_state(content)
}

/// Lets in requests that the gate knows, and gives every answer its headers.
async fn guard(State(content): State<Arc<Content>>, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok());
    let mut response = match content.gate.check(host, request.uri().path()) {
        Ok(()) => next.run(request).await,
        Err(refusal) => (StatusCode::FORBIDDEN, refusal.text()).into_response(),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn file(Path((_, name)): Path<(String, String)>) -> Response {
    match asset(&name) {
        Some(asset) => ([(header::CONTENT_TYPE, asset.media)], asset.content).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no such file\n").into_response(),
    }
}

async fn catalogues(State(content): State<Arc<Content>>) -> Json<Value> {
    let recordings = content.recordings();
    let catalogues = recordings.iter().map(|entry| entry.known().catalogue.clone());
    Json(json!({
        "recordings": catalogues.collect::<Vec<_>>(),
        "refusal": content.refusal.get(),
        "is_live": content.is_live,
    }))
}

async fn growth(State(content): State<Arc<Content>>) -> Json<Value> {
    Json(content.recordings().iter().map(Entry::growth).collect())
}

async fn hear(State(content): State<Arc<Content>>) -> Response {
    Sse::new(events(content, Content::news)).into_response()
}

async fn described(State(content): State<Arc<Content>>) -> Json<Value> {
    Json(content.live().map_or(Value::Null, |live| live.described()))
}

/// The kernel is asked for each process: a thread of its own.
async fn scheduled(State(content): State<Arc<Content>>) -> Response {
    let asking = content.clone();
    let work = move || asking.live().map_or(Value::Null, |live| live.schedule());
    match content.askers.run(work).await {
        Ok(found) => Json(found).into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "looking ended by an error of the program\n").into_response()
        }
    }
}

/// A write of a few bytes to a file in memory or its cache: no thread of its own.
async fn fly(State(content): State<Arc<Content>>, Json(asking): Json<Asking>) -> Response {
    let live = content.live().context("this page shows no live run");
    match live.and_then(|live| live.fly(&asking)) {
        Ok(()) => StatusCode::NO_CONTENT.into_response(),
        Err(error) => (StatusCode::CONFLICT, format!("{error:#}\n")).into_response(),
    }
}

async fn steer(State(content): State<Arc<Content>>, Json(request): Json<Asked>) -> Response {
    let asking = content.clone();
    let work = move || match asking.live() {
        Some(live) => live.ask(&request),
        None => Answer::refused("this page shows no live run"),
    };
    match content.askers.run(work).await {
        Ok(answer) => Json(answer).into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "asking ended by an error of the program\n").into_response()
        }
    }
}

async fn answer_frames(State(content): State<Arc<Content>>, Json(request): Json<FramesRequest>) -> Response {
    reading(content, request.recording, move |entry| Ok((frames(&entry.known().shown, &request)?, 1.0))).await
}

async fn answer_curves(State(content): State<Arc<Content>>, Json(request): Json<CurvesRequest>) -> Response {
    reading(content, request.recording, move |entry| {
        let found = curves(&entry.known().shown, &entry.overview, &request)?;
        Ok((found.values, found.read))
    })
    .await
}

async fn layouts(State(content): State<Arc<Content>>) -> Response {
    listed(content.layouts.all())
}

async fn keep_layout(State(content): State<Arc<Content>>, Json(keeping): Json<Keeping>) -> Response {
    listed(content.layouts.keep(keeping))
}

fn listed(found: Result<BTreeMap<String, Layout>>) -> Response {
    match found {
        Ok(layouts) => Json(layouts).into_response(),
        Err(error) => (StatusCode::CONFLICT, format!("{error:#}\n")).into_response(),
    }
}

async fn newest(State(content): State<Arc<Content>>, Json(request): Json<NewestRequest>) -> Response {
    let asking = content.clone();
    let work = move || {
        let (Some(live), recordings) = (asking.live(), asking.recordings()) else { return Ok(None) };
        let Some(entry) = recordings.first() else { return Ok(None) };
        live.newest(&entry.known().shown, &request.fields)
    };
    match content.readers.run(work).await {
        Ok(Ok(Some(values))) => octets(&values).into_response(),
        Ok(Ok(None)) => StatusCode::NO_CONTENT.into_response(),
        Ok(Err(error)) => (StatusCode::BAD_REQUEST, format!("{error:#}\n")).into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "reading ended by an error of the program\n").into_response()
        }
    }
}

fn octets(values: &[f64]) -> ([(HeaderName, &'static str); 1], Vec<u8>) {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    ([(header::CONTENT_TYPE, "application/octet-stream")], bytes)
}

/// The answer to a request that reads a recording: on a thread of its own, since files are read there.
async fn reading(
    content: Arc<Content>,
    recording: usize,
    read: impl FnOnce(&Entry) -> Result<(Vec<f64>, f64)> + Send + 'static,
) -> Response {
    let reader = content.clone();
    let work = move || {
        let recordings = reader.recordings();
        let entry = recordings.get(recording).with_context(|| match recordings.len() {
            0 => "no tick is recorded yet".to_owned(),
            count => format!("there is no recording {recording}, expected 0 to {}", count - 1),
        })?;
        read(entry)
    };
    match content.readers.run(work).await {
        Ok(Ok((values, part))) => {
            let read = [(HeaderName::from_static("x-read"), part.to_string())];
            (read, octets(&values)).into_response()
        }
        Ok(Err(error)) => (StatusCode::BAD_REQUEST, format!("{error:#}\n")).into_response(),
        Err(_) => {
            (StatusCode::INTERNAL_SERVER_ERROR, "reading ended by an error of the program\n").into_response()
        }
    }
}
