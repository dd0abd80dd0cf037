//! Flights on demand: a program that needs the rows of some flights before it knows the next ones.

use crate::pool::Pool;
use crate::row::Row;
use crate::worker::Job;
use anyhow::{Result, bail};
use runtime::event::StopToken;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Host time between two looks at the stop token while rows are waited for.
const LOOK: Duration = Duration::from_millis(50);

/// Workers that fly what they are handed, until this value is gone. Any thread may ask.
#[derive(Debug)]
pub struct Flying<'a> {
    jobs: Sender<Job>,
    next: AtomicU64,
    rows: &'a Rows,
    stop: &'a StopToken,
}

/// Rows that are not taken yet, by number of the flight.
#[derive(Debug, Default)]
struct Rows {
    rows: Mutex<Found>,
    news: Condvar,
}

#[derive(Debug, Default)]
struct Found {
    rows: BTreeMap<u64, Row>,
    /// No more rows come.
    is_over: bool,
}

/// Calls `work` with flights on the workers of `pool`; its result.
///
/// # Errors
/// The error of `work`, or of the workers.
pub fn with_flights<T: Send>(
    pool: &Pool<'_>,
    stop: &StopToken,
    work: impl FnOnce(&Flying<'_>) -> Result<T> + Send,
) -> Result<T> {
    let rows = Rows::default();
    let (sender, jobs) = channel();
    std::thread::scope(|scope| {
        let flying = Flying { jobs: sender, next: AtomicU64::new(0), rows: &rows, stop };
        // The workers end when `flying` is gone.
        let worked = scope.spawn(move || work(&flying));
        let end = pool.fly(jobs.into_iter(), stop, |row| {
            rows.found().rows.insert(row.flight, row);
            rows.news.notify_all();
            Ok(())
        });
        rows.found().is_over = true;
        rows.news.notify_all();
        let worked = worked.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        // A worker that refuses its inputs is the reason for rows that are missing.
        end.and(worked)
    })
}

impl Flying<'_> {
    /// Flies a flight for each of `sets`, its overrides; rows in the same order.
    ///
    /// # Errors
    /// If the flights were stopped, or no worker is left.
    pub fn fly(&self, sets: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<Row>> {
        let mut flights = Vec::new();
        for sets in sets {
            let flight = self.next.fetch_add(1, Ordering::Relaxed);
            flights.push(flight);
            // Where nobody listens any more no row comes.
            let _ = self.jobs.send(Job { flight, sets });
        }
        let mut found = self.rows.found();
        loop {
            if flights.iter().all(|flight| found.rows.contains_key(flight)) {
                return Ok(flights.iter().filter_map(|flight| found.rows.remove(flight)).collect());
            }
            if found.is_over || self.stop.count() > 0 {
                bail!("the flights were stopped");
            }
            let waited = self.rows.news.wait_timeout(found, LOOK);
            found = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Rows {
    fn found(&self) -> MutexGuard<'_, Found> {
        self.rows.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
