//! Open connections and their activity; selects the one to close when there are too many.

use std::collections::HashMap;
use std::io;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore};

/// Most requests end within this time: a longer one, such as a slow upload, is interrupted for a new connection at
/// once, others after [`SHORT_WAIT`].
const SHORT_REQUEST: Duration = Duration::from_secs(1);

/// Time that a new connection waits for short requests to end.
const SHORT_WAIT: Duration = Duration::from_millis(10);

/// Time that a new connection waits for another one to close.
const ADMISSION_TIMEOUT: Duration = Duration::from_millis(200);

/// Interval between two log entries on rejected connections.
const LOG_INTERVAL: Duration = Duration::from_secs(60);

/// Activity of a connection.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Activity {
    /// No complete request head since then.
    Idle(Instant),
    /// A request since then: the body or the response is incomplete.
    Request(Instant),
    /// An event stream, or a request that waits for a change.
    LongLived,
}

/// State of a connection, shared with its requests.
#[derive(Debug)]
pub(super) struct Handle {
    activity: Mutex<Activity>,
    /// Notified when the connection must close.
    close: Notify,
    registry: Arc<Registry>,
}

/// Open connection; removed from the registry when dropped.
#[derive(Debug)]
pub(super) struct Connection {
    id: u64,
    handle: Arc<Handle>,
    _permit: OwnedSemaphorePermit,
}

/// Request in progress; the connection is idle again when it is dropped.
#[derive(Debug)]
pub(super) struct RunningRequest {
    handle: Arc<Handle>,
    is_long_lived: bool,
}

/// All open connections.
#[derive(Debug)]
pub(super) struct Registry {
    open: Mutex<HashMap<u64, Arc<Handle>>>,
    permits: Arc<Semaphore>,
    max: usize,
    next_id: AtomicU64,
    /// Number of connections with [`Activity::LongLived`].
    num_long_lived: AtomicUsize,
    last_log: Mutex<Option<Instant>>,
}

/// Locks a mutex. A panic cannot leave these values half written.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Registry {
    /// Registry of up to `max` connections, at least 2.
    pub(super) fn new(max: usize) -> Self {
        let max = max.clamp(2, Semaphore::MAX_PERMITS.min(u32::MAX as usize));
        Self {
            open: Mutex::default(),
            permits: Arc::new(Semaphore::new(max)),
            max,
            next_id: AtomicU64::new(0),
            num_long_lived: AtomicUsize::new(0),
            last_log: Mutex::default(),
        }
    }

    /// Maximum number of long-lived requests. The remaining connections serve short ones.
    fn max_long_lived(&self) -> usize {
        self.max - self.max.div_ceil(10)
    }

    /// Registers a new connection. At the maximum number, the longest-idle one is closed for it; `None` if all
    /// are active.
    pub(super) async fn admit(self: &Arc<Self>) -> Option<Connection> {
        let permit = match self.permits.clone().try_acquire_owned() {
            Ok(permit) => permit,
            Err(_) => self.permit_of_another().await?,
        };
        let id = self.next_id.fetch_add(1, Ordering::Relaxed);
        let handle = Arc::new(Handle {
            activity: Mutex::new(Activity::Idle(Instant::now())),
            close: Notify::new(),
            registry: self.clone(),
        });
        lock(&self.open).insert(id, handle.clone());
        Some(Connection { id, handle, _permit: permit })
    }

    /// Closes a connection and takes its place; `None` if all serve long-lived requests.
    async fn permit_of_another(&self) -> Option<OwnedSemaphorePermit> {
        if !self.close_longest_idle(SHORT_REQUEST) {
            if let Some(permit) = self.permit_within(SHORT_WAIT).await {
                return Some(permit);
            }
            self.close_longest_idle(Duration::ZERO);
        }
        let permit = self.permit_within(ADMISSION_TIMEOUT).await;
        if permit.is_none() {
            self.log_failure(&io::Error::other("all connections are active"));
        }
        permit
    }

    /// The place of a connection that closes within this time.
    async fn permit_within(&self, time: Duration) -> Option<OwnedSemaphorePermit> {
        let permit = tokio::time::timeout(time, self.permits.clone().acquire_owned()).await;
        permit.ok().and_then(Result::ok)
    }

    /// Closes the connection that is idle for the longest time; if none is idle, the one with the longest request
    /// of at least this time. Long-lived requests are not interrupted. Returns whether one is closed.
    pub(super) fn close_longest_idle(&self, min_request: Duration) -> bool {
        let now = Instant::now();
        let open = lock(&self.open);
        let closable = open.values().filter_map(|handle| {
            let order = match *lock(&handle.activity) {
                Activity::Idle(since) => (0, since),
                Activity::Request(since) if now - since >= min_request => (1, since),
                _ => return None,
            };
            Some((order, handle))
        });
        let Some((_, handle)) = closable.min_by_key(|(order, _)| *order) else { return false };
        // Not selected again before it has closed.
        *lock(&handle.activity) = Activity::LongLived;
        handle.close.notify_one();
        true
    }

    /// Resolves when all connections are closed.
    pub(super) async fn all_closed(&self) {
        // The semaphore is never closed.
        self.permits.acquire_many(self.max as u32).await.ok();
    }

    /// Logs, once per [`LOG_INTERVAL`], that a connection was not accepted.
    pub(super) fn log_failure(&self, error: &io::Error) {
        let mut last = lock(&self.last_log);
        if last.is_none_or(|time| time.elapsed() >= LOG_INTERVAL) {
            *last = Some(Instant::now());
            tracing::warn!(%error, open = lock(&self.open).len(), "cannot accept a connection");
        }
    }
}

impl Connection {
    /// State shared with the requests of the connection.
    pub(super) fn handle(&self) -> Arc<Handle> {
        self.handle.clone()
    }

    /// Resolves when the connection must close.
    pub(super) async fn closed(&self) {
        self.handle.close.notified().await;
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        lock(&self.handle.registry.open).remove(&self.id);
    }
}

impl Handle {
    /// Records the start of a request; `None` if it is long-lived and there are too many of them.
    pub(super) fn begin_request(self: &Arc<Self>, is_long_lived: bool) -> Option<RunningRequest> {
        let registry = &self.registry;
        if is_long_lived {
            let before = registry.num_long_lived.fetch_add(1, Ordering::Relaxed);
            if before >= registry.max_long_lived() {
                registry.num_long_lived.fetch_sub(1, Ordering::Relaxed);
                return None;
            }
        }
        *lock(&self.activity) = match is_long_lived {
            true => Activity::LongLived,
            false => Activity::Request(Instant::now()),
        };
        Some(RunningRequest { handle: self.clone(), is_long_lived })
    }
}

impl Drop for RunningRequest {
    fn drop(&mut self) {
        if self.is_long_lived {
            self.handle.registry.num_long_lived.fetch_sub(1, Ordering::Relaxed);
        }
        *lock(&self.handle.activity) = Activity::Idle(Instant::now());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a connection has been asked to close.
    async fn is_closed(connection: &Connection) -> bool {
        tokio::time::timeout(Duration::from_millis(1), connection.closed()).await.is_ok()
    }

    #[tokio::test]
    async fn longest_idle_connection_is_closed_at_the_maximum() {
        let registry = Arc::new(Registry::new(3));
        let [streaming, first, second] =
            [registry.admit().await, registry.admit().await, registry.admit().await]
                .map(Option::unwrap);
        let _stream = streaming.handle().begin_request(true).unwrap();
        // The first connection is idle again, later than the second one.
        drop(first.handle().begin_request(false).unwrap());
        let (admitted, was_closed) = tokio::join!(registry.admit(), async {
            let was_closed = is_closed(&second).await;
            drop(second);
            was_closed
        });
        assert!(admitted.is_some() && was_closed);
        assert!(!is_closed(&streaming).await && !is_closed(&first).await);
    }

    #[tokio::test]
    async fn longest_request_is_interrupted_when_none_is_idle() {
        let registry = Arc::new(Registry::new(2));
        let [first, second] = [registry.admit().await, registry.admit().await].map(Option::unwrap);
        let requests = [&first, &second].map(|one| one.handle().begin_request(false).unwrap());
        let (admitted, ()) = tokio::join!(registry.admit(), async {
            first.closed().await;
            drop(first);
        });
        assert!(admitted.is_some() && !is_closed(&second).await);
        drop(requests);
    }

    #[tokio::test]
    async fn streams_leave_connections_for_short_requests() {
        let registry = Arc::new(Registry::new(20));
        let mut streams = Vec::new();
        for _ in 0..18 {
            let connection = registry.admit().await.unwrap();
            let stream = connection.handle().begin_request(true).unwrap();
            streams.push((connection, stream));
        }
        let other = registry.admit().await.unwrap();
        assert!(other.handle().begin_request(true).is_none());
        assert!(other.handle().begin_request(false).is_some());
        streams.pop();
        assert!(other.handle().begin_request(true).is_some());
    }
}
