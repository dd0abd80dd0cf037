//! Work that reads recordings, on threads of its own: a few at the same time.

use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio::task::{JoinError, spawn_blocking};

/// Threads that read recordings.
#[derive(Debug)]
pub struct Readers(Arc<Semaphore>);

impl Readers {
    /// Allows up to `count` readers at the same time.
    pub fn new(count: usize) -> Self {
        Self(Arc::new(Semaphore::new(count)))
    }

    /// The result of `work`, which waits for its turn. Work that has begun goes on and keeps its turn, even if its
    /// result is not awaited any more.
    ///
    /// # Errors
    /// If `work` panicked.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, JoinError> {
        // The semaphore is never closed.
        let turn = self.0.clone().acquire_owned().await;
        spawn_blocking(move || {
            let _turn = turn;
            work()
        })
        .await
    }
}

#[cfg(test)]
mod tests {
    use super::Readers;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, mpsc};
    use std::time::Duration;

    /// A page sends a request, sends another and drops the first, again and again.
    #[test]
    fn dropped_questions_keep_their_turns_while_they_are_read() {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).build().unwrap();
        let (readers, begun) = (Arc::new(Readers::new(2)), Arc::new(AtomicUsize::new(0)));
        let (release, wait) = mpsc::channel::<()>();
        let wait = Arc::new(std::sync::Mutex::new(wait));
        for _ in 0..8 {
            let (readers, begun, wait) = (readers.clone(), begun.clone(), wait.clone());
            let question = runtime.spawn(async move {
                let read = move || {
                    begun.fetch_add(1, Ordering::SeqCst);
                    let _ = wait.lock().unwrap().recv();
                };
                readers.run(read).await
            });
            std::thread::sleep(Duration::from_millis(50));
            question.abort();
        }
        assert_eq!(begun.load(Ordering::SeqCst), 2, "the others wait, and were dropped meanwhile");
        drop(release);
        runtime.block_on(readers.run(|| ())).unwrap();
    }
}
