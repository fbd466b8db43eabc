//! Jobs over HTTP.

use super::Jobs;
use super::content::{NOT_KEPT, is_known};
use super::job_request::{
    JobPatch, JobRequest, MOST_METADATA, Request, Verb, checked_metadata, checked_name, flag,
    read_json,
};
use super::list::{STANDARD_LIMIT, Stretch, limit};
use crate::engine::{Answer, Engine, Report};
use crate::extract::{Path, Query, Whole};
use crate::guard::bearer;
use crate::job::{Job, JobView, Kind, Params, Status};
use crate::store::{Created, Filter, News};
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::{FromRequest, Request as Asked, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Duration;

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
    responses((status = 200, description = "A page of jobs; `metadata[KEY]=VALUE` filters, too", body = Stretch<JobView<'static>>)),
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
                Some(_) if filter.metadata.len() == MOST_METADATA => {
                    let most = format!("jobs have {MOST_METADATA} entries at most");
                    return Err(Problem::invalid("metadata", most));
                }
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
    if let Some(wait) = query.get("wait") {
        let seconds: f64 = wait.trim_end_matches('s').parse().unwrap_or(-1.0);
        if !(0.0..=MOST_WAIT.as_secs_f64()).contains(&seconds) {
            return Err(Problem::invalid("wait", "it is a number of seconds up to 60, as 30s"));
        }
        // Whoever does not say what is known waits for the next change.
        let first = tag(&job);
        let is_known = |job: &Job| match headers.contains_key(header::IF_NONE_MATCH) {
            true => is_known(&headers, &tag(job)),
            false => tag(job) == first,
        };
        let changed = async {
            while is_known(&job) && !job.status.is_terminal() {
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
    let told = [(header::ETAG, tag.clone()), (header::CACHE_CONTROL, NOT_KEPT.into())];
    if is_known(&headers, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, told).into_response());
    }
    Ok((told, Json(job.view())).into_response())
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
    checked_name(patch.name.as_ref().and_then(Option::as_deref))?;
    patch.metadata.as_ref().and_then(Option::as_ref).map_or(Ok(()), checked_metadata)?;
    let change = |job: &mut Job, _: &mut Vec<News>| {
        if let Some(priority) = patch.priority {
            if job.status != Status::Queued {
                return Err(Problem::invalid_state(job, "moved in the queue"));
            }
            job.priority = priority;
        }
        if let Some(name) = patch.name {
            job.name = name;
        }
        if let Some(metadata) = patch.metadata {
            job.metadata = metadata.unwrap_or_default();
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
        engine.store.forget_files(&id, None).await?;
    }
    engine.store.delete(&id).await?;
    engine.remove_folder(&id).await;
    Ok(StatusCode::NO_CONTENT)
}

/// Hears the process of a job.
#[utoipa::path(
    post, path = "/jobs/{id}/reports", tag = "processes", params(("id" = String, Path, description = "Id of the job")), request_body = Report,
    responses((status = 200, description = "What the process is to do", body = Answer)),
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
