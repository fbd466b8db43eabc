//! What happened to jobs: as a list, and as a stream.

use super::jobs::find;
use super::list::{Stretch, limit};
use super::{Jobs, answers};
use crate::engine::Engine;
use crate::extract::{Path, Query};
use crate::metrics::OpenStream;
use crate::store::{Event, Type};
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::sse::{Event as SseEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use utoipa::ToSchema;

/// The number in `evt_17` or `17`.
fn number(param: &str, text: &str) -> Result<i64, Problem> {
    text.trim_start_matches("evt_")
        .parse()
        .map_err(|_| Problem::invalid(param, "it is the id of an event, as evt_17"))
}

/// The type of events that is called so.
fn kind(text: &str) -> Result<Type, Problem> {
    Type::named(text).ok_or_else(|| {
        let names = Type::ALL.map(Type::name).join(", ");
        Problem::invalid("type", format!("it is one of {names}"))
    })
}

/// What happened to a job, oldest first.
#[utoipa::path(
    get, path = "/jobs/{id}/events", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("after" = Option<String>, Query, description = "Id of an event"), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100), ("type" = Option<String>, Query, description = "Only those of this type, as alert")),
    responses((status = 200, description = "What happened, oldest first", body = Stretch<answers::Event>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    find(&engine, &id).await?;
    let after = query.get("after").map_or(Ok(0), |text| number("after", text))?;
    let asked = query.get("limit").map_or(Ok(100), |text| limit(text))?;
    let kind = query.get("type").map(|text| kind(text)).transpose()?;
    let mut events = engine.store.events(&[id], kind, after, asked + 1).await?;
    let has_more = events.len() as i64 > asked;
    events.truncate(asked as usize);
    let id_of = |event: Option<&Event>| event.map(|event| event.json["id"].clone());
    let (first, last) = (id_of(events.first()), id_of(events.last()));
    let data: Vec<Value> = events.into_iter().map(|event| event.json).collect();
    Ok(Json(json!({
        "object": "list", "has_more": has_more, "first_id": first, "last_id": last, "data": data,
    })))
}

/// The stream of one job.
#[utoipa::path(
    get, path = "/jobs/{id}/stream", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("after" = Option<String>, Query, description = "Id of an event"), ("Last-Event-ID" = Option<String>, Header)),
    responses((status = 200, description = "Events as they come", content_type = "text/event-stream", body = StreamedEvent), (status = 204, description = "It has ended, and all is read")),
)]
pub(crate) async fn stream_of(
    State(state): State<AppState>,
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    open(&state, engine, vec![id], &query, &headers).await
}

/// Jobs in one stream.
const MOST_JOBS: usize = 100;

/// The stream of several jobs, or of all; the latter never ends, and begins with what happens from now on.
#[utoipa::path(
    get, path = "/stream", tag = "events",
    params(("jobs" = Option<String>, Query, description = "Ids with commas; all if it is left out"), ("after" = Option<String>, Query), ("Last-Event-ID" = Option<String>, Header)),
    responses((status = 200, description = "Events of several jobs as they come", content_type = "text/event-stream", body = StreamedEvent), (status = 204, description = "All have ended, and all is read")),
)]
pub(crate) async fn stream_all(
    State(state): State<AppState>,
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let Some(named) = query.get("jobs") else {
        return open(&state, engine, Vec::new(), &query, &headers).await;
    };
    let jobs: Vec<String> =
        named.split(',').filter(|id| !id.is_empty()).map(str::to_owned).collect();
    if !(1..=MOST_JOBS).contains(&jobs.len()) {
        return Err(Problem::invalid("jobs", format!("it names 1 to {MOST_JOBS} jobs: a,b")));
    }
    open(&state, engine, jobs, &query, &headers).await
}

/// An event on its way.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct StreamedEvent {
    /// Its number, for Last-Event-ID.
    id: Option<String>,
    /// Its type, or `done`.
    event: String,
    /// The event as JSON, as the list has it.
    data: String,
}

/// Events read at a time.
const PAGE: i64 = 256;

/// A stream under way.
struct Reader {
    engine: Arc<Engine>,
    /// All if none is named.
    jobs: Vec<String>,
    after: i64,
    ready: std::vec::IntoIter<Event>,
    news: tokio::sync::watch::Receiver<i64>,
    stopping: tokio::sync::watch::Receiver<bool>,
    is_over: bool,
    _open: OpenStream,
}

async fn open(
    state: &AppState,
    engine: Arc<Engine>,
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
        (Some(text), _) => number("Last-Event-ID", text)?,
        (None, Some(text)) => number("after", text)?,
        (None, None) if jobs.is_empty() => *engine.store.news().borrow(),
        (None, None) => 0,
    };
    for id in &jobs {
        find(&engine, id).await?;
    }
    let mut reader = Reader {
        news: engine.store.news(),
        stopping: state.stopping(),
        engine,
        jobs,
        after,
        ready: Vec::new().into_iter(),
        is_over: false,
        _open: OpenStream::new(&state.metrics),
    };
    // A browser that is told so does not come back.
    if reader.all_ended().await? && reader.fetch().await? == 0 {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let first = stream::once(async {
        Ok::<_, Infallible>(SseEvent::default().retry(Duration::from_secs(2)).comment("events"))
    });
    let events = stream::unfold(reader, |mut reader| async move {
        let event = reader.next().await?;
        Some((Ok::<_, Infallible>(event), reader))
    });
    let keep = KeepAlive::new().interval(Duration::from_secs(15)).text("still here");
    let events = futures_util::StreamExt::chain(first, events);
    // The last one is for proxies, which would wait for more of it.
    let headers = [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (HeaderName::from_static("x-accel-buffering"), "no"),
    ];
    Ok((headers, Sse::new(events).keep_alive(keep)).into_response())
}

impl Reader {
    async fn all_ended(&self) -> Result<bool, Problem> {
        if self.jobs.is_empty() {
            return Ok(false);
        }
        for id in &self.jobs {
            let job = self.engine.store.job(id).await?;
            if job.is_some_and(|job| !job.status.is_terminal()) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads what was written down since; gives how much that is.
    async fn fetch(&mut self) -> Result<usize, Problem> {
        let events = self.engine.store.events(&self.jobs, None, self.after, PAGE).await?;
        let count = events.len();
        self.ready = events.into_iter();
        Ok(count)
    }

    /// The next event; none once all has been said.
    async fn next(&mut self) -> Option<SseEvent> {
        loop {
            if let Some(event) = self.ready.next() {
                self.after = event.seq;
                let text = event.json.to_string();
                return Some(
                    SseEvent::default().id(event.seq.to_string()).event(event.kind).data(text),
                );
            }
            if self.is_over {
                return None;
            }
            // What is written from here on is news.
            self.news.mark_unchanged();
            let ended = self.all_ended().await.ok()?;
            if self.fetch().await.ok()? > 0 {
                continue;
            }
            if ended {
                self.is_over = true;
                return Some(SseEvent::default().event("done").data("{}"));
            }
            tokio::select! {
                changed = self.news.changed() => changed.ok()?,
                _ = self.stopping.wait_for(|stopping| *stopping) => return None,
            }
        }
    }
}
