//! Jobs over HTTP.

use super::Jobs;
use super::artifacts::is_whole;
use crate::engine::{Engine, Report};
use crate::extract::{Path, Query, Whole};
use crate::guard::bearer;
use crate::job::{
    DatasetParams, EncoderParams, EvaluationParams, Job, JobView, Kind, MeshParams, Params,
    PolicyParams, Status,
};
use crate::store::{Created, Filter, News, Type};
use crate::{AppState, Problem};
use axum::Json;
use axum::body::Body;
use axum::extract::{FromRequest, Request as Asked, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::time::Duration;
use tower::ServiceExt;
use tower_http::services::ServeFile;
use utoipa::ToSchema;

/// What is asked for.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    kind: Kind,
    #[serde(default)]
    params: Map<String, Value>,
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    metadata: Map<String, Value>,
    #[serde(default)]
    priority: i64,
}

/// What is asked for, as it is described: the parameters go with the kind.
#[derive(ToSchema)]
#[serde(tag = "kind")]
#[expect(dead_code, reason = "only described")]
enum JobTask {
    #[serde(rename = "dataset.generate")]
    Dataset {
        #[serde(default)]
        params: DatasetParams,
    },
    #[serde(rename = "encoder.train")]
    Encoder { params: EncoderParams },
    #[serde(rename = "policy.train")]
    Policy { params: PolicyParams },
    #[serde(rename = "policy.evaluate")]
    Evaluation { params: EvaluationParams },
    #[serde(rename = "mesh.prepare")]
    Mesh { params: MeshParams },
}

/// A request for a job, as it is described.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
struct JobRequest {
    #[serde(flatten)]
    task: JobTask,
    /// A name for people.
    #[schema(max_length = 200)]
    name: Option<String>,
    /// At most 16 texts.
    #[schema(value_type = Option<std::collections::HashMap<String, String>>)]
    metadata: Option<Map<String, Value>>,
    /// Higher ones begin first.
    priority: Option<i64>,
}

/// What can be asked of a job.
#[derive(ToSchema)]
#[serde(rename_all = "snake_case")]
#[expect(dead_code, reason = "only described")]
enum Verb {
    Cancel,
    Pause,
    Resume,
    Retry,
    Clone,
}

/// A page of a list.
#[derive(ToSchema)]
#[expect(dead_code, reason = "only described")]
pub(super) struct Page<T> {
    /// Always `list`.
    object: String,
    data: Vec<T>,
    /// Whether there are more after these.
    has_more: bool,
}

/// Bounds of what may be said of a job.
const MOST_NAME: usize = 200;
const MOST_METADATA: usize = 16;
const MOST_KEY: usize = 64;
const MOST_VALUE: usize = 512;

fn checked_name(name: Option<&str>) -> Result<(), Problem> {
    if name.is_some_and(|name| name.len() > MOST_NAME) {
        return Err(Problem::invalid("name", format!("it may have {MOST_NAME} bytes at most")));
    }
    Ok(())
}

fn checked_metadata(metadata: &Map<String, Value>) -> Result<(), Problem> {
    let is_good = |(key, value): (&String, &Value)| {
        key.len() <= MOST_KEY && value.as_str().is_some_and(|value| value.len() <= MOST_VALUE)
    };
    if metadata.len() > MOST_METADATA || !metadata.iter().all(is_good) {
        return Err(Problem::invalid(
            "metadata",
            format!(
                "{MOST_METADATA} entries at most: keys of {MOST_KEY} bytes, texts of {MOST_VALUE}"
            ),
        ));
    }
    Ok(())
}

/// Asks for a job.
#[utoipa::path(
    post, path = "/jobs", tag = "jobs", request_body = JobRequest,
    params(
        ("dry_run" = Option<bool>, Query, description = "Only answer with what would be done"),
        ("Idempotency-Key" = Option<String>, Header, description = "The same key asks once, for a day"),
    ),
    responses((status = 201, description = "The job, which waits", body = JobView<'static>), (status = 200, description = "A dry run", body = JobView<'static>)),
)]
pub(crate) async fn create(
    State(state): State<AppState>,
    Jobs(engine): Jobs,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
    Whole(body): Whole,
) -> Result<Response, Problem> {
    let is_dry = flag(&query, "dry_run")?;
    let key = headers.get("idempotency-key").map(|key| key.to_str().unwrap_or_default());
    if key.is_some_and(|key| key.is_empty() || key.len() > 255) {
        return Err(Problem::invalid("Idempotency-Key", "it has 1 to 255 visible characters"));
    }
    let hash = blake3::hash(&body).to_hex().to_string();
    let key = key.map(|key| (key, hash.as_str()));
    // Whatever has changed since: what was asked for was asked for.
    if !is_dry && let Some(before) = engine.store.asked(key).await? {
        return created(before);
    }
    let request: Request = read_json(&body)?;
    checked_name(request.name.as_deref())?;
    checked_metadata(&request.metadata)?;
    let mut params = Params::resolve(request.kind, request.params).map_err(|invalid| {
        Problem::invalid(&format!("params.{}", invalid.param), invalid.detail)
    })?;
    // What `default` stands for may be another model tomorrow.
    match &mut params {
        Params::Policy(params) => params.encoder_id = state.model_of(&params.encoder_id).to_owned(),
        Params::Evaluation(params) => params.model_id = state.model_of(&params.model_id).to_owned(),
        _ => {}
    }
    let inputs = engine.inputs(&params).await?;
    let mut job = Job::new(request.kind, params, inputs);
    (job.name, job.metadata, job.priority) = (request.name, request.metadata, request.priority);
    if is_dry {
        let estimate = engine.estimate(&job).await?;
        return Ok(Json(job.draft(estimate)).into_response());
    }
    has_room(&state, &engine).await?;
    let answer = created(engine.store.create(&job, key).await?);
    engine.wake();
    answer
}

/// Refuses another job where too many wait, or where the disk is full.
async fn has_room(state: &AppState, engine: &Engine) -> Result<(), Problem> {
    let most = state.limits.queued;
    if engine.store.ids_in(&[Status::Queued]).await?.len() >= most {
        return Err(Problem::queue_full(most));
    }
    state.limits.leave_space(engine.data())
}

/// The one thing that may be asked for behind the path, true or false.
fn flag(query: &BTreeMap<String, String>, name: &str) -> Result<bool, Problem> {
    if let Some(other) = query.keys().find(|key| *key != name) {
        return Err(Problem::invalid(other, "there is no such parameter"));
    }
    match query.get(name).map(String::as_str) {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(_) => Err(Problem::invalid(name, "it is true or false")),
    }
}

/// What became of asking for a job.
fn created(created: Created) -> Result<Response, Problem> {
    match created {
        Created::New(job) | Created::Before(job) => {
            let headers = [(header::LOCATION, format!("/api/v1/jobs/{}", job.id))];
            Ok((StatusCode::CREATED, headers, Json(job.view())).into_response())
        }
        Created::Other => Err(Problem::key_reused()),
        Created::Gone => Err(Problem::key_of_deleted()),
    }
}

/// Reads JSON; says where it is wrong.
pub(super) fn read_json<T: serde::de::DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let value: Value =
        serde_json::from_slice(body).map_err(|error| Problem::malformed(&error.to_string()))?;
    // Serde would read a list of the fields' values, too.
    if !value.is_object() {
        return Err(Problem::malformed("it is a value of another kind"));
    }
    serde_path_to_error::deserialize(value).map_err(|error| {
        let text = error.inner().to_string();
        let path = error.path().to_string();
        let field = text.split('`').nth(1).unwrap_or_default();
        Problem::invalid(if path == "." { field } else { &path }, text.clone())
    })
}

/// Jobs in a list.
const STANDARD_LIMIT: i64 = 20;
const MOST_LIMIT: i64 = 100;

/// Some jobs.
#[utoipa::path(
    get, path = "/jobs", tag = "jobs",
    params(
        ("status" = Option<String>, Query, description = "One or more, with commas"),
        ("kind" = Option<String>, Query, description = "One or more, with commas"),
        ("after" = Option<String>, Query, description = "Id of the last job of the page before"),
        ("limit" = Option<i64>, Query, minimum = 1, maximum = 100),
        ("order" = Option<String>, Query, description = "desc, newest first, or asc"),
    ),
    responses((status = 200, description = "A page of jobs; `metadata[KEY]=VALUE` filters, too", body = Page<JobView<'static>>)),
)]
pub(crate) async fn list(
    Jobs(engine): Jobs,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Json<Value>, Problem> {
    let mut filter = Filter { limit: STANDARD_LIMIT, ..Filter::default() };
    for (name, value) in query {
        let words = || value.split(',').filter(|word| !word.is_empty());
        match name.as_str() {
            "status" => {
                for word in words() {
                    let known = Status::named(word);
                    let names = Status::ALL.map(Status::name).join(", ");
                    let unknown = || Problem::invalid("status", format!("it is one of {names}"));
                    filter.status.push(known.ok_or_else(unknown)?);
                }
            }
            "kind" => {
                for word in words() {
                    let names = Kind::ALL.map(Kind::name).join(", ");
                    let unknown = || Problem::invalid("kind", format!("it is one of {names}"));
                    filter.kind.push(Kind::named(word).ok_or_else(unknown)?);
                }
            }
            "after" => filter.after = Some(value),
            "limit" => filter.limit = limit(&value)?,
            "order" if value == "asc" || value == "desc" => filter.oldest_first = value == "asc",
            "order" => return Err(Problem::invalid("order", "it is asc or desc")),
            name => match name.strip_prefix("metadata[").and_then(|rest| rest.strip_suffix(']')) {
                Some(key) => filter.metadata.push((key.to_owned(), value)),
                None => return Err(Problem::invalid(name, "there is no such filter")),
            },
        }
    }
    let asked = filter.limit;
    filter.limit += 1;
    let mut jobs = engine.store.jobs(&filter).await?;
    let has_more = jobs.len() as i64 > asked;
    jobs.truncate(asked as usize);
    Ok(Json(json!({
        "object": "list", "has_more": has_more,
        "first_id": jobs.first().map(|job| &job.id), "last_id": jobs.last().map(|job| &job.id),
        "data": jobs.iter().map(Job::view).collect::<Vec<_>>(),
    })))
}

/// The length of a list.
pub(super) fn limit(text: &str) -> Result<i64, Problem> {
    match text.parse() {
        Ok(limit) if (1..=MOST_LIMIT).contains(&limit) => Ok(limit),
        _ => Err(Problem::invalid("limit", format!("it is a number from 1 to {MOST_LIMIT}"))),
    }
}

/// The longest that a request may wait for a change.
const MOST_WAIT: Duration = Duration::from_secs(60);

/// One job; with `?wait=30s`, once it has changed.
#[utoipa::path(
    get, path = "/jobs/{id}", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("wait" = Option<String>, Query, description = "Answer once it has changed, or after so many seconds: 30s")),
    responses((status = 200, description = "The job", body = JobView<'static>), (status = 304, description = "It is as If-None-Match says")),
)]
pub(crate) async fn get(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let mut news = engine.store.news();
    let mut job = find(&engine, &id).await?;
    let known = headers.get(header::IF_NONE_MATCH).and_then(|tag| tag.to_str().ok());
    if let Some(wait) = query.get("wait") {
        let seconds: f64 = wait.trim_end_matches('s').parse().unwrap_or(-1.0);
        if !(0.0..=MOST_WAIT.as_secs_f64()).contains(&seconds) {
            return Err(Problem::invalid("wait", "it is a number of seconds up to 60, as 30s"));
        }
        // Whoever does not say what is known waits for the next change.
        let before = known.map_or_else(|| tag(&job), str::to_owned);
        let changed = async {
            while tag(&job) == before && !job.status.is_terminal() {
                if news.changed().await.is_err() {
                    break;
                }
                job = find(&engine, &id).await?;
            }
            Ok::<_, Problem>(())
        };
        if let Ok(changed) = tokio::time::timeout(Duration::from_secs_f64(seconds), changed).await {
            changed?;
        }
        job = find(&engine, &id).await?;
    }
    let tag = tag(&job);
    let headers = [(header::ETAG, tag.clone()), (header::CACHE_CONTROL, "no-store".into())];
    if known == Some(&tag) {
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    Ok((headers, Json(job.view())).into_response())
}

fn tag(job: &Job) -> String {
    format!("\"{}\"", job.revision)
}

pub(super) async fn find(engine: &Engine, id: &str) -> Result<Job, Problem> {
    engine.store.job(id).await?.ok_or_else(|| Problem::no_job(id))
}

/// What can be done to a job.
#[utoipa::path(
    post, path = "/jobs/{id}/{verb}", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("verb" = inline(Verb), Path, description = "What is asked of it")),
    responses((status = 202, description = "The job; of clone, the new one", body = JobView<'static>)),
)]
pub(crate) async fn act(
    State(state): State<AppState>,
    Jobs(engine): Jobs,
    Path((id, verb)): Path<(String, String)>,
) -> Result<Response, Problem> {
    let job = match verb.as_str() {
        "cancel" => engine.cancel(&id).await?,
        "pause" => engine.pause(&id).await?,
        "resume" => engine.resume(&id).await?,
        "retry" => engine.retry(&id).await?,
        "clone" => {
            let original = find(&engine, &id).await?;
            // What it works on may have been deleted.
            let inputs = engine.inputs(&original.params).await?;
            has_room(&state, &engine).await?;
            let mut copy = Job::new(original.kind, original.params, inputs);
            (copy.name, copy.metadata) = (original.name, original.metadata);
            copy.priority = original.priority;
            engine.store.create(&copy, None).await?;
            engine.wake();
            copy
        }
        _ => return Err(Problem::no_verb(&verb)),
    };
    let location = format!("/api/v1/jobs/{}", job.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(job.view())).into_response())
}

/// What can be changed of a job.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct JobPatch {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    metadata: Option<Map<String, Value>>,
    #[serde(default)]
    priority: Option<i64>,
}

/// Changes name, metadata or, while it waits, priority.
#[utoipa::path(
    patch, path = "/jobs/{id}", tag = "jobs", request_body = JobPatch, params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "The job", body = JobView<'static>)),
)]
pub(crate) async fn patch(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Whole(body): Whole,
) -> Result<Response, Problem> {
    let patch: JobPatch = read_json(&body)?;
    checked_name(patch.name.as_deref())?;
    patch.metadata.as_ref().map_or(Ok(()), checked_metadata)?;
    let change = |job: &mut Job, _: &mut Vec<News>| {
        if let Some(priority) = patch.priority {
            if job.status != Status::Queued {
                return Err(Problem::invalid_state(job, "moved in the queue"));
            }
            job.priority = priority;
        }
        if let Some(name) = patch.name {
            job.name = Some(name);
        }
        if let Some(metadata) = patch.metadata {
            job.metadata = metadata;
        }
        Ok(())
    };
    let changed = engine.store.change(&id, change).await?;
    let (job, ()) = changed.ok_or_else(|| Problem::no_job(&id))??;
    Ok(Json(job.view()).into_response())
}

/// Forgets a job that has ended.
#[utoipa::path(
    delete, path = "/jobs/{id}", tag = "jobs", params(("id" = String, Path, description = "Id of the job"), ("artifacts" = Option<bool>, Query, description = "Its files, too, but for those of models")),
    responses((status = 204, description = "It is forgotten")),
)]
pub(crate) async fn delete(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
) -> Result<StatusCode, Problem> {
    let with_files = flag(&query, "artifacts")?;
    let job = find(&engine, &id).await?;
    if !job.status.is_terminal() {
        return Err(Problem::invalid_state(&job, "deleted"));
    }
    if with_files {
        engine.store.forget_files(&id).await?;
    }
    engine.store.delete(&id).await?;
    tokio::fs::remove_dir_all(engine.folder(&id)).await.ok();
    Ok(StatusCode::NO_CONTENT)
}

/// Hears the process of a job.
#[utoipa::path(
    post, path = "/jobs/{id}/reports", tag = "processes", params(("id" = String, Path, description = "Id of the job")), request_body = Object,
    responses((status = 200, description = "What the process is to do", body = Object)),
)]
pub(crate) async fn report(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    headers: HeaderMap,
    asked: Asked,
) -> Result<Response, Problem> {
    // A stranger's report is not even read.
    if !engine.is_its_turn(&id, bearer(&headers)).await? {
        return Err(Problem::not_its_turn());
    }
    let Whole(body) = Whole::from_request(asked, &()).await?;
    let report: Report = read_json(&body)?;
    Ok(Json(engine.hear(&id, bearer(&headers), report).await?).into_response())
}

/// Models that it wrote on its way, oldest first.
#[utoipa::path(
    get, path = "/jobs/{id}/checkpoints", tag = "jobs", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "Models that it wrote on its way", body = Page<Object>)),
)]
pub(crate) async fn checkpoints(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    find(&engine, &id).await?;
    let events = engine.store.events(&[id], Some(Type::Checkpoint), 0, i64::MAX).await?;
    let data: Vec<Value> = events.into_iter().map(|mut event| event.json["data"].take()).collect();
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// Its files.
#[utoipa::path(
    get, path = "/jobs/{id}/artifacts", tag = "jobs", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, description = "Its files", body = Page<Object>)),
)]
pub(crate) async fn artifacts(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    find(&engine, &id).await?;
    let artifacts = engine.store.artifacts_of(&id).await?;
    let data: Vec<Value> = artifacts
        .iter()
        .map(|artifact| {
            let mut json = json!(artifact);
            json["url"] = format!("/api/v1/artifacts/{}", artifact.hash).into();
            json
        })
        .collect();
    Ok(Json(json!({ "object": "list", "data": data, "has_more": false })))
}

/// What its process printed; `?tail=` gives the last lines.
#[utoipa::path(
    get, path = "/jobs/{id}/logs", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("tail" = Option<usize>, Query, description = "The last so many lines")),
    responses((status = 200, description = "What its process printed", content_type = "text/plain", body = String), (status = 206, description = "A part of it", content_type = "text/plain", body = String)),
)]
pub(crate) async fn logs(
    Jobs(engine): Jobs,
    Path(id): Path<String>,
    Query(query): Query<BTreeMap<String, String>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    find(&engine, &id).await?;
    let path = engine.folder(&id).join("log.txt");
    let kind = HeaderValue::from_static("text/plain; charset=utf-8");
    let mut answer = match query.get("tail") {
        Some(count) => {
            let invalid = |_| Problem::invalid("tail", "it is a number of lines");
            let text = tail(&path, count.parse().map_err(invalid)?).await;
            text.map_err(|error| Problem::unreadable(&error))?.into_response()
        }
        None if !path.exists() => String::new().into_response(),
        None => {
            let mut request = axum::http::Request::new(Body::empty());
            let bytes = tokio::fs::metadata(&path).await.map_or(0, |file| file.len());
            let is_part =
                |range: &&HeaderValue| range.to_str().is_ok_and(|text| !is_whole(text, bytes));
            let range = headers.get(header::RANGE).filter(is_part).cloned();
            request.headers_mut().extend(range.map(|range| (header::RANGE, range)));
            match ServeFile::new(&path).oneshot(request).await {
                Ok(answer) => answer.map(Body::new),
                Err(never) => match never {},
            }
        }
    };
    if answer.status() == StatusCode::RANGE_NOT_SATISFIABLE {
        return Err(Problem::out_of_range("the log"));
    }
    answer.headers_mut().insert(header::CONTENT_TYPE, kind);
    answer.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(answer)
}

/// Bytes at the end of a log in which its last lines are looked for.
const TAIL_BYTES: u64 = 1 << 20;

/// The last lines of a file; none if there is none.
async fn tail(path: &std::path::Path, count: usize) -> std::io::Result<String> {
    use tokio::io::{AsyncReadExt, AsyncSeekExt};
    let mut file = match tokio::fs::File::open(path).await {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(String::new()),
        Err(error) => return Err(error),
    };
    let length = file.metadata().await?.len();
    file.seek(std::io::SeekFrom::Start(length.saturating_sub(TAIL_BYTES))).await?;
    let mut bytes = Vec::new();
    file.take(TAIL_BYTES).read_to_end(&mut bytes).await?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().collect();
    Ok(lines[lines.len().saturating_sub(count)..].iter().map(|line| format!("{line}\n")).collect())
}
