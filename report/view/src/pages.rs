//! The pages that are open, and the events that they hear.
//!
//! Each page keeps one stream of events open for its life. So the server knows that a page is there, also one in the
//! background, whose timers a browser slows down.

use crate::live::Live;
use axum::response::sse::Event;
use futures_util::stream::{self, Stream};
use serde_json::json;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Host time between two events.
const PERIOD: Duration = Duration::from_millis(125);
/// Host time after which a page that lost its stream asks for another one.
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

/// Events for one page, for as long as it listens: the state of the live run, which `look` finds in `content`, and the
/// number of recordings.
pub fn events<T: AsRef<Pages> + Send + Sync + 'static>(
    content: Arc<T>,
    look: impl Fn(&T) -> (Option<&Live>, usize) + Send + 'static,
) -> impl Stream<Item = Result<Event, Infallible>> + Send + 'static {
    let start = (Place::take(content), look, true);
    stream::unfold(start, |(place, look, is_first)| async move {
        if !is_first {
            tokio::time::sleep(PERIOD).await;
        }
        let (live, recordings) = look(&place.0);
        let told = json!({ "run": live.and_then(Live::status), "recordings": recordings });
        let event = Event::default().retry(RETRY).data(told.to_string());
        Some((Ok(event), (place, look, false)))
    })
}
