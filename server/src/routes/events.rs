//! Events of jobs: as a list, and as server-sent event streams.

use super::event_stream;
use super::jobs::find_job;
use super::pagination::{CursorPage, parse_limit};
use super::{RequireScheduler, schemas};
use crate::extract::{Parameters, Path};
use crate::jobs::scheduler::JobScheduler;
use crate::metrics::OpenStream;
use crate::store::{Event, EventType};
use crate::{AppState, Problem};
use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use utoipa::ToSchema;

/// Parses an event id: `evt_17` or `17`.
fn parse_event_seq(param: &str, text: &str) -> Result<i64, Problem> {
    text.trim_start_matches("evt_")
        .parse()
        .map_err(|_| Problem::invalid_parameter(param, "must be an event id, e.g. evt_17"))
}

/// Parses an event type.
fn parse_type(text: &str) -> Result<EventType, Problem> {
    EventType::from_name(text).ok_or_else(|| {
        let names = EventType::ALL.map(EventType::name).join(", ");
        Problem::invalid_parameter("type", format!("must be one of {names}"))
    })
}

/// Lists the events of a job, oldest first.
#[utoipa::path(
    get, path = "/jobs/{id}/events", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("after" = Option<String>, Query, description = "Id of the last event of the previous page"), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100), ("type" = Option<String>, Query, description = "Only events of this type, e.g. alert")),
    responses((status = 200, description = "Events, oldest first", body = CursorPage<schemas::Event>)),
)]
pub(crate) async fn list(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    parameters: Parameters,
) -> Result<Json<Value>, Problem> {
    let query = parameters.only(&["after", "limit", "type"])?;
    find_job(&scheduler, &id).await?;
    let after = query.get("after").map_or(Ok(0), |text| parse_event_seq("after", text))?;
    let count = query.get("limit").map_or(Ok(100), |text| parse_limit(text))?;
    let kind = query.get("type").map(|text| parse_type(text)).transpose()?;
    let mut events = scheduler.store.events(&[id], kind, after, count + 1).await?;
    let has_more = events.len() as i64 > count;
    events.truncate(count as usize);
    let id_of = |event: Option<&Event>| event.map(|event| event.json["id"].clone());
    let (first, last) = (id_of(events.first()), id_of(events.last()));
    let data: Vec<Value> = events.into_iter().map(|event| event.json).collect();
    Ok(Json(json!({
        "object": "list", "has_more": has_more, "first_id": first, "last_id": last, "data": data,
    })))
}

/// Streams the events of a job.
#[utoipa::path(
    get, path = "/jobs/{id}/stream", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("after" = Option<String>, Query, description = "Id of the last received event"), ("Last-Event-ID" = Option<String>, Header)),
    responses((status = 200, description = "Event stream", content_type = "text/event-stream", body = StreamedEvent), (status = 204, description = "The job has finished and all events were received")),
)]
pub(crate) async fn stream_of(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    parameters: Parameters,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    open_stream(&state, scheduler, vec![id], &parameters.all(), &headers).await
}

/// Maximum number of jobs in one stream.
const MAX_STREAM_JOBS: usize = 100;

/// Streams the events of several jobs, or of all jobs.
///
/// The stream of all jobs starts with the next event and never ends.
#[utoipa::path(
    get, path = "/stream", tag = "events",
    params(("jobs" = Option<String>, Query, description = "Job ids, separated by commas; all jobs if omitted"), ("after" = Option<String>, Query), ("Last-Event-ID" = Option<String>, Header)),
    responses((status = 200, description = "Event stream of several jobs", content_type = "text/event-stream", body = StreamedEvent), (status = 204, description = "All jobs have finished and all events were received")),
)]
pub(crate) async fn stream_all(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    parameters: Parameters,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let query = parameters.all();
    let Some(named) = query.get("jobs") else {
        return open_stream(&state, scheduler, Vec::new(), &query, &headers).await;
    };
    let jobs: Vec<String> =
        named.split(',').filter(|id| !id.is_empty()).map(str::to_owned).collect();
    if !(1..=MAX_STREAM_JOBS).contains(&jobs.len()) {
        return Err(Problem::invalid_parameter(
            "jobs",
            format!("must be 1 to {MAX_STREAM_JOBS} job ids, separated by commas"),
        ));
    }
    open_stream(&state, scheduler, jobs, &query, &headers).await
}

/// Server-sent event.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct StreamedEvent {
    /// Sequence number, for Last-Event-ID.
    id: Option<String>,
    /// Event type, or `done` after the last event.
    event: String,
    /// The event as JSON, as in the list.
    data: String,
}

/// Interval at which an idle stream sends a comment.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(15);

/// Number of events read at a time.
const EVENTS_PER_READ: i64 = 256;

/// State of an open event stream.
struct EventReader {
    scheduler: Arc<JobScheduler>,
    /// Ids of the jobs; empty: all jobs.
    jobs: Vec<String>,
    /// Sequence number of the last event sent.
    after: i64,
    /// Events read and not yet sent.
    ready: std::vec::IntoIter<Event>,
    changes: tokio::sync::watch::Receiver<i64>,
    stopping: tokio::sync::watch::Receiver<bool>,
    /// Whether an event was sent.
    has_started: bool,
    is_finished: bool,
    _open: OpenStream,
}

/// Opens an event stream; 204 if the jobs have finished and the client has all events.
async fn open_stream(
    state: &AppState,
    scheduler: Arc<JobScheduler>,
    jobs: Vec<String>,
    query: &BTreeMap<String, String>,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let accepts = headers.get(header::ACCEPT).and_then(|value| value.to_str().ok());
    if accepts.is_some_and(|accepts| {
        !["text/event-stream", "text/*", "*/*"].iter().any(|kind| accepts.contains(kind))
    }) {
        return Err(Problem::not_acceptable());
    }
    let resumed = headers.get("last-event-id").and_then(|value| value.to_str().ok());
    let after = match (resumed, query.get("after")) {
        (Some(text), _) => parse_event_seq("Last-Event-ID", text)?,
        (None, Some(text)) => parse_event_seq("after", text)?,
        (None, None) if jobs.is_empty() => *scheduler.store.subscribe().borrow(),
        (None, None) => 0,
    };
    for id in &jobs {
        find_job(&scheduler, id).await?;
    }
    let mut reader = EventReader {
        changes: scheduler.store.subscribe(),
        stopping: state.shutdown_signal(),
        scheduler,
        jobs,
        after,
        ready: Vec::new().into_iter(),
        has_started: false,
        is_finished: false,
        _open: OpenStream::new(&state.metrics),
    };
    // A browser does not reconnect after 204.
    if reader.all_ended().await? && reader.fetch().await? == 0 {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let opening = stream::once(async { Ok::<_, Infallible>(event_stream::OPENING) });
    let events = stream::unfold(reader, |mut reader| async move {
        let text = reader.next_text().await?;
        Some((Ok::<_, Infallible>(text), reader))
    });
    let body = Body::from_stream(futures_util::StreamExt::chain(opening, events));
    // `x-accel-buffering` disables buffering in proxies.
    let headers = [
        (header::CONTENT_TYPE, "text/event-stream"),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (HeaderName::from_static("x-accel-buffering"), "no"),
    ];
    Ok((headers, body).into_response())
}

impl EventReader {
    /// Whether all jobs of the stream have finished; false for the stream of all jobs.
    async fn all_ended(&self) -> Result<bool, Problem> {
        if self.jobs.is_empty() {
            return Ok(false);
        }
        for id in &self.jobs {
            let job = self.scheduler.store.job(id).await?;
            if job.is_some_and(|job| !job.status.is_terminal()) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads the next events; returns their number.
    async fn fetch(&mut self) -> Result<usize, Problem> {
        let events =
            self.scheduler.store.events(&self.jobs, None, self.after, EVENTS_PER_READ).await?;
        let count = events.len();
        self.ready = events.into_iter();
        Ok(count)
    }

    /// Waits for the next event, or for the time of a comment; `None` at the end of the stream.
    async fn next_text(&mut self) -> Option<Bytes> {
        match tokio::time::timeout(KEEP_ALIVE_INTERVAL, self.next_event()).await {
            Ok(event) => event,
            Err(_) => Some(event_stream::KEEP_ALIVE),
        }
    }

    /// Waits for the next event; `None` at the end of the stream.
    async fn next_event(&mut self) -> Option<Bytes> {
        loop {
            if let Some(event) = self.ready.next() {
                self.after = event.seq;
                let is_first = !std::mem::replace(&mut self.has_started, true);
                let text = event.json.to_string();
                return Some(event_stream::event(Some(event.seq), &event.kind, &text, is_first));
            }
            if self.is_finished {
                return None;
            }
            // Marked before reading, so that later events wake the stream.
            self.changes.mark_unchanged();
            let ended = self.all_ended().await.ok()?;
            if self.fetch().await.ok()? > 0 {
                continue;
            }
            if ended {
                self.is_finished = true;
                return Some(event_stream::event(None, "done", "{}", !self.has_started));
            }
            tokio::select! {
                changed = self.changes.changed() => changed.ok()?,
                _ = self.stopping.wait_for(|stopping| *stopping) => return None,
            }
        }
    }
}
