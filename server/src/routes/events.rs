//! What happened to jobs: as a list, as a stream, as columns of numbers.

use super::Jobs;
use super::jobs::find;
use super::list::limit;
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
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
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

/// What happened to a job, oldest first.
#[utoipa::path(
    get, path = "/jobs/{id}/events", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("after" = Option<String>, Query, description = "Id of an event"), ("limit" = Option<i64>, Query, minimum = 1, maximum = 100)),
    responses((status = 200, description = "What happened, oldest first", body = Page<Object>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Json<Value>, Problem> {
    find(&engine, &id).await?;
    let after = query.get("after").map_or(Ok(0), |text| number("after", text))?;
    let asked = query.get("limit").map_or(Ok(100), |text| limit(text))?;
    let mut events = engine.store.events(&[id], None, after, asked + 1).await?;
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

/// Points of a course that are given at most, unless asked otherwise.
const STANDARD_POINTS: usize = 1000;

/// The same, whatever is asked.
const MOST_POINTS: usize = 100_000;

/// Events in memory at a time.
const READ_AT_A_TIME: i64 = 4096;

/// What a job measured, in columns; thinned so that no peak is lost.
#[utoipa::path(
    get, path = "/jobs/{id}/metrics", tag = "events",
    params(("id" = String, Path, description = "Id of the job"), ("keys" = Option<String>, Query, description = "Names with commas"), ("after_step" = Option<usize>, Query), ("max_points" = Option<usize>, Query), ("format" = Option<String>, Query, description = "json, csv or ndjson")),
    responses((status = 200, description = "Columns of numbers, thinned so that no peak is lost", body = Object)),
)]
pub(crate) async fn metrics(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<Response, Problem> {
    let whole = |name: &str, otherwise: usize| -> Result<usize, Problem> {
        let Some(text) = query.get(name) else { return Ok(otherwise) };
        text.parse().map_err(|_| Problem::invalid(name, "it is a whole number"))
    };
    let job = find(&engine, &id).await?;
    let (after, points) = (whole("after_step", 0)?, whole("max_points", STANDARD_POINTS)?);
    let began = job.started_at.unwrap_or(job.created_at);
    let is_asked =
        |name: &str| query.get("keys").is_none_or(|keys| keys.split(',').any(|key| key == name));
    let mut rows: BTreeMap<u64, Map<String, Value>> = BTreeMap::new();
    let (ids, mut read, mut last) = ([id], Vec::new().into_iter(), 0);
    loop {
        let Some(mut event) = read.next() else {
            let page = engine.store.events(&ids, Some(Type::Metric), last, READ_AT_A_TIME).await?;
            last = page.last().map_or(last, |event| event.seq);
            read = page.into_iter();
            if read.len() == 0 {
                break;
            }
            continue;
        };
        let at = event.json["created_at"].as_str().and_then(|at| at.parse().ok());
        let wall = at
            .map(|at: chrono::DateTime<chrono::Utc>| (at - began).num_milliseconds() as f64 / 1e3);
        let Value::Object(mut values) = event.json["data"].take() else { continue };
        let Some(step) = values.remove("step").and_then(|step| step.as_u64()) else { continue };
        if step > after as u64 || after == 0 {
            values.retain(|name, _| is_asked(name));
            values.insert("wall".into(), json!(wall));
            // What a process did again counts once.
            rows.entry(step).or_default().extend(values);
        }
    }
    let mut names: Vec<String> = Vec::new();
    for name in rows.values().flat_map(|row| row.keys()) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    let rows: Vec<(u64, Map<String, Value>)> = rows.into_iter().collect();
    let kept = thinned(&rows, &names, points.min(MOST_POINTS));
    let column = |name: &str| -> Value {
        kept.iter().map(|(_, row)| row.get(name).cloned().unwrap_or_default()).collect()
    };
    let steps = || kept.iter().map(|(step, _)| json!(step));
    match query.get("format").map(String::as_str) {
        None | Some("json") => {
            let mut columns = Map::from_iter([("step".to_owned(), steps().collect())]);
            columns.extend(names.iter().map(|name| (name.clone(), column(name))));
            Ok(Json(columns).into_response())
        }
        Some("ndjson") => {
            let line = |(step, row): &(u64, Map<String, Value>)| {
                let mut row = row.clone();
                row.insert("step".into(), json!(step));
                format!("{}\n", Value::Object(row))
            };
            let text: String = kept.iter().map(line).collect();
            Ok(([(header::CONTENT_TYPE, "application/x-ndjson")], text).into_response())
        }
        Some("csv") => {
            let mut text = format!("step,{}\n", names.join(","));
            for (step, row) in &kept {
                let cells = names.iter().map(|name| row.get(name).map_or(String::new(), cell));
                text += &format!("{step},{}\n", cells.collect::<Vec<_>>().join(","));
            }
            Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response())
        }
        Some(_) => Err(Problem::invalid("format", "it is json, csv or ndjson")),
    }
}

/// A number as it is, anything else as a text in quotes.
fn cell(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Number(number) => number.to_string(),
        other => format!("\"{}\"", other.to_string().replace('"', "\"\"")),
    }
}

/// At most about `points` rows: of each stretch the least and the greatest of every column but the time, in their order.
fn thinned(
    rows: &[(u64, Map<String, Value>)],
    names: &[String],
    points: usize,
) -> Vec<(u64, Map<String, Value>)> {
    if rows.len() <= points.max(2) {
        return rows.to_vec();
    }
    let columns: Vec<&String> = names.iter().filter(|name| *name != "wall").collect();
    let stretches = (points / (2 * columns.len().max(1))).max(1);
    let mut kept = BTreeSet::new();
    for name in columns {
        let value = |i: usize| rows[i].1.get(name).and_then(Value::as_f64);
        let known: Vec<(usize, f64)> =
            (0..rows.len()).filter_map(|i| Some((i, value(i)?))).collect();
        // A column that has few values is cut where it has them.
        for stretch in 0..stretches {
            let [first, end] = [stretch, stretch + 1].map(|k| k * known.len() / stretches);
            let order = |a: &&(usize, f64), b: &&(usize, f64)| a.1.total_cmp(&b.1);
            let part = &known[first..end];
            kept.extend(
                [part.iter().min_by(order), part.iter().max_by(order)]
                    .iter()
                    .flatten()
                    .map(|(i, _)| *i),
            );
        }
    }
    kept.into_iter().map(|i| rows[i].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_peaks_and_the_order() {
        let mut rows: Vec<(u64, Map<String, Value>)> = (0..1000)
            .map(|step| (step, Map::from_iter([("loss".to_owned(), json!(1.0))])))
            .collect();
        rows[617].1.insert("loss".into(), json!(9.0));
        rows[311].1.insert("loss".into(), json!(0.1));
        // Another column has few values.
        for (step, value) in [(250, 1), (500, 7), (750, 2)] {
            rows[step].1.insert("exam".into(), json!(value));
        }
        let names = ["exam", "loss", "wall"].map(str::to_owned);
        let kept = thinned(&rows, &names, 40);
        let steps: Vec<u64> = kept.iter().map(|(step, _)| *step).collect();
        assert!(steps.len() <= 40 && steps.is_sorted(), "{steps:?}");
        assert!([617, 311, 250, 500, 750].iter().all(|step| steps.contains(step)), "{steps:?}");
        assert_eq!(thinned(&rows[..5], &names, 20).len(), 5);
    }
}
