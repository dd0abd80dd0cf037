//! The pages that are open, and the events that they hear.
//!
//! Each page keeps one stream of events open for its life. So the server knows that a page is there, also one in the
//! background, whose timers a browser slows down.

use crate::take_overs::TakeOver;
use axum::response::sse::Event;
use futures_util::stream::{self, Stream};
use runtime::ctl::protocol::Status;
use serde::Serialize;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Host time between two events.
const PERIOD: Duration = Duration::from_millis(125);
/// Host time after which a page that lost its stream requests another one.
const RETRY: Duration = Duration::from_millis(500);

/// Counts pages.
#[derive(Debug, Default)]
pub struct Pages {
    open: AtomicUsize,
    seen: AtomicUsize,
}

impl Pages {
    /// Number of pages that are open.
    pub fn open(&self) -> usize {
        self.open.load(Ordering::SeqCst)
    }

    /// Number of pages that were ever opened.
    pub fn seen(&self) -> usize {
        self.seen.load(Ordering::SeqCst)
    }
}

/// The place of an open page; dropping it closes it.
struct Place<T: AsRef<Pages>>(Arc<T>);

impl<T: AsRef<Pages>> Place<T> {
    fn take(content: Arc<T>) -> Self {
        let pages: &Pages = (*content).as_ref();
        pages.open.fetch_add(1, Ordering::SeqCst);
        pages.seen.fetch_add(1, Ordering::SeqCst);
        Self(content)
    }
}

impl<T: AsRef<Pages>> Drop for Place<T> {
    fn drop(&mut self) {
        let pages: &Pages = (*self.0).as_ref();
        pages.open.fetch_sub(1, Ordering::SeqCst);
    }
}

/// An event that a page hears.
#[derive(Debug, Serialize)]
pub struct News {
    /// State of the live run; none without one, or where it cannot be steered.
    pub run: Option<Status>,
    /// Processes of that run that have taken over from others.
    pub take_overs: Vec<TakeOver>,
    /// Number of recordings.
    pub recordings: usize,
    /// Times that the live run has started.
    pub starts: usize,
}

/// Events for one page, for as long as it listens: the results of `look` on `content`.
pub fn events<T: AsRef<Pages> + Send + Sync + 'static>(
    content: Arc<T>,
    look: impl Fn(&T) -> News + Send + 'static,
) -> impl Stream<Item = Result<Event, Infallible>> + Send + 'static {
    let start = (Place::take(content), look, true);
    stream::unfold(start, |(place, look, is_first)| async move {
        if !is_first {
            tokio::time::sleep(PERIOD).await;
        }
        let told = serde_json::to_string(&look(&place.0));
        let told = told.unwrap_or_else(|error| unreachable!("its types serialise: {error}"));
        Some((Ok(Event::default().retry(RETRY).data(told)), (place, look, false)))
    })
}
