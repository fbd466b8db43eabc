//! Job endpoints.

use super::RequireScheduler;
use super::http_content::{NO_STORE, check_if_match, matches_if_none_match};
use super::job_request::{
    CreateJobRequest, JobAction, JobPatch, MAX_METADATA, check_metadata, check_name, parse_json,
    query_bool,
};
use super::job_request_schema::JobRequest;
use super::pagination::{CursorPage, DEFAULT_LIMIT, parse_limit};
use crate::extract::{FullBody, Parameters, Path, Query};
use crate::jobs::scheduler::JobScheduler;
use crate::jobs::{Job, JobView, Kind, Params, Status};
use crate::middleware::credentials::bearer_token;
use crate::store::{CreateOutcome, Filter, NewEvent, StoreError};
use crate::{AppState, Problem};
use axum::Json;
use axum::extract::{FromRequest, Request as Asked, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::time::Duration;
use worker_protocol::{ReportReply, WorkerReport};

/// Creates a job.
#[utoipa::path(
    post, path = "/jobs", tag = "jobs", request_body = JobRequest,
    params(
        ("dry_run" = Option<bool>, Query, description = "Only validate, and return the job with an estimate"),
        ("Idempotency-Key" = Option<String>, Header, description = "Repeated requests with the same key create one job, for 24 hours"),
    ),
    responses((status = 201, description = "The queued job", body = JobView<'static>), (status = 200, description = "Result of a dry run", body = JobView<'static>)),
)]
pub(crate) async fn create(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    parameters: Parameters,
    headers: HeaderMap,
    FullBody(body): FullBody,
) -> Result<Response, Problem> {
    let is_dry_run = query_bool(parameters, "dry_run")?;
    let key = headers.get("idempotency-key").map(|key| key.to_str().unwrap_or_default());
    if key.is_some_and(|key| key.is_empty() || key.len() > 255) {
        return Err(Problem::invalid_parameter(
            "Idempotency-Key",
            "must have 1 to 255 visible ASCII characters",
        ));
    }
    let hash = blake3::hash(&body).to_hex().to_string();
    let key = key.map(|key| (key, hash.as_str()));
    // Checked first: a repeated request succeeds even if its inputs or the quotas have changed.
    if !is_dry_run && let Some(outcome) = scheduler.store.find_idempotent(key).await? {
        return creation_response(outcome);
    }
    let request: CreateJobRequest = parse_json(&body)?;
    check_name(request.name.as_deref())?;
    check_metadata(&request.metadata)?;
    let mut params = Params::resolve(request.kind, request.params).map_err(|invalid| {
        Problem::invalid_parameter(&format!("params.{}", invalid.param), invalid.detail)
    })?;
    params.resolve_aliases(|id| state.resolve_model_id(id).to_owned());
    let inputs = scheduler.resolve_inputs(&params).await?;
    let mut job = Job::new(params, inputs);
    (job.name, job.metadata, job.priority) = (request.name, request.metadata, request.priority);
    if is_dry_run {
        let estimate = scheduler.estimate(&job).await?;
        return Ok(Json(job.preview(estimate)).into_response());
    }
    check_quotas(&state, &scheduler).await?;
    let response = creation_response(scheduler.store.create(&job, key).await?);
    scheduler.wake();
    response
}

/// Rejects a new job if the queue or the disk is full.
async fn check_quotas(state: &AppState, scheduler: &JobScheduler) -> Result<(), Problem> {
    let max = state.quotas.max_queued;
    if scheduler.store.ids_with_status(&[Status::Queued]).await?.len() >= max {
        return Err(Problem::queue_full(max));
    }
    state.quotas.ensure_free_space(scheduler.data_dir())
}

/// Response to a creation request.
fn creation_response(outcome: CreateOutcome) -> Result<Response, Problem> {
    match outcome {
        CreateOutcome::Created(job) | CreateOutcome::Replayed(job) => {
            let headers = [(header::LOCATION, format!("/api/v1/jobs/{}", job.id))];
            Ok((StatusCode::CREATED, headers, Json(job.view())).into_response())
        }
        CreateOutcome::KeyConflict => Err(Problem::idempotency_key_reused()),
        CreateOutcome::JobDeleted => Err(Problem::idempotency_job_deleted()),
    }
}

/// Lists jobs.
#[utoipa::path(
    get, path = "/jobs", tag = "jobs",
    params(
        ("status" = Option<String>, Query, description = "Accepted statuses, separated by commas"),
        ("kind" = Option<String>, Query, description = "Accepted kinds, separated by commas"),
        ("after" = Option<String>, Query, description = "Id of the last job of the previous page"),
        ("limit" = Option<i64>, Query, minimum = 1, maximum = 100),
        ("order" = Option<String>, Query, description = "desc (newest first, default) or asc"),
    ),
    responses((status = 200, description = "A page of jobs; `metadata[KEY]=VALUE` filters by metadata", body = CursorPage<JobView<'static>>)),
)]
pub(crate) async fn list(
    RequireScheduler(scheduler): RequireScheduler,
    Query(query): Query<Vec<(String, String)>>,
) -> Result<Json<Value>, Problem> {
    let mut filter = Filter { limit: DEFAULT_LIMIT, ..Filter::default() };
    for (name, value) in query {
        let values = || value.split(',').filter(|value| !value.is_empty());
        match name.as_str() {
            "status" => {
                for value in values() {
                    let status = Status::from_name(value);
                    let names = Status::ALL.map(Status::name).join(", ");
                    let unknown =
                        || Problem::invalid_parameter("status", format!("must be one of {names}"));
                    filter.status.push(status.ok_or_else(unknown)?);
                }
            }
            "kind" => {
                for value in values() {
                    let unknown = || {
                        let names = Kind::names();
                        Problem::invalid_parameter("kind", format!("must be one of {names}"))
                    };
                    filter.kind.push(Kind::from_name(value).ok_or_else(unknown)?);
                }
            }
            "after" => filter.after = Some(value),
            "limit" => filter.limit = parse_limit(&value)?,
            "order" if value == "asc" || value == "desc" => filter.oldest_first = value == "asc",
            "order" => return Err(Problem::invalid_parameter("order", "must be asc or desc")),
            name => match name.strip_prefix("metadata[").and_then(|rest| rest.strip_suffix(']')) {
                Some(_) if filter.metadata.len() == MAX_METADATA => {
                    let reason = format!("up to {MAX_METADATA} metadata filters are supported");
                    return Err(Problem::invalid_parameter("metadata", reason));
                }
                Some(key) => filter.metadata.push((key.to_owned(), value)),
                None => return Err(Problem::invalid_parameter(name, "unknown filter")),
            },
        }
    }
    let limit = filter.limit;
    filter.limit += 1;
    let mut jobs = scheduler.store.jobs(&filter).await?;
    let has_more = jobs.len() as i64 > limit;
    jobs.truncate(limit as usize);
    Ok(Json(json!({
        "object": "list", "has_more": has_more,
        "first_id": jobs.first().map(|job| &job.id), "last_id": jobs.last().map(|job| &job.id),
        "data": jobs.iter().map(Job::view).collect::<Vec<_>>(),
    })))
}

/// Maximum time that a request waits for a change.
const MAX_WAIT: Duration = Duration::from_secs(60);

/// Returns a job; with `?wait=30s`, after its next change.
#[utoipa::path(
    get, path = "/jobs/{id}", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("wait" = Option<String>, Query, description = "Respond after the next change, or after this time, e.g. 30s")),
    responses((status = 200, description = "The job", body = JobView<'static>), (status = 304, description = "Not modified")),
)]
pub(crate) async fn get(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    parameters: Parameters,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let query = parameters.only(&["wait"])?;
    let mut changes = scheduler.store.subscribe();
    let mut job = find_job(&scheduler, &id).await?;
    if let Some(wait) = query.get("wait") {
        let seconds: f64 = wait.trim_end_matches('s').parse().unwrap_or(-1.0);
        if !(0.0..=MAX_WAIT.as_secs_f64()).contains(&seconds) {
            return Err(Problem::invalid_parameter(
                "wait",
                "must be a number of seconds up to 60, e.g. 30s",
            ));
        }
        // Without If-None-Match, waits for the next change.
        let first = etag(&job);
        let is_unchanged = |job: &Job| match headers.contains_key(header::IF_NONE_MATCH) {
            true => matches_if_none_match(&headers, &etag(job)),
            false => etag(job) == first,
        };
        let changed = async {
            while is_unchanged(&job) && !job.status.is_terminal() {
                if changes.changed().await.is_err() {
                    break;
                }
                job = find_job(&scheduler, &id).await?;
            }
            Ok::<_, Problem>(())
        };
        if let Ok(changed) = tokio::time::timeout(Duration::from_secs_f64(seconds), changed).await {
            changed?;
        }
        job = find_job(&scheduler, &id).await?;
    }
    let tag = etag(&job);
    let caching = [(header::ETAG, tag.clone()), (header::CACHE_CONTROL, NO_STORE.into())];
    if matches_if_none_match(&headers, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, caching).into_response());
    }
    Ok((caching, Json(job.view())).into_response())
}

/// ETag of a job.
fn etag(job: &Job) -> String {
    format!("\"{}\"", job.revision)
}

/// The job with this id.
pub(super) async fn find_job(scheduler: &JobScheduler, id: &str) -> Result<Job, Problem> {
    scheduler.store.job(id).await?.ok_or_else(|| Problem::job_not_found(id))
}

/// Performs an action on a job: cancel, pause, resume, retry or clone.
#[utoipa::path(
    post, path = "/jobs/{id}/{action}", tag = "jobs",
    params(("id" = String, Path, description = "Id of the job"), ("action" = inline(JobAction), Path, description = "Action")),
    responses((status = 202, description = "The job; for clone, the new job", body = JobView<'static>)),
)]
pub(crate) async fn action(
    State(state): State<AppState>,
    RequireScheduler(scheduler): RequireScheduler,
    Path((id, action)): Path<(String, String)>,
) -> Result<Response, Problem> {
    let job = match action.as_str() {
        "cancel" => scheduler.cancel(&id).await?,
        "pause" => scheduler.pause(&id).await?,
        "resume" => scheduler.resume(&id).await?,
        "retry" => scheduler.retry(&id).await?,
        "clone" => {
            let original = find_job(&scheduler, &id).await?;
            // The inputs may have been deleted.
            let inputs = scheduler.resolve_inputs(&original.params).await?;
            check_quotas(&state, &scheduler).await?;
            let mut copy = Job::new(original.params, inputs);
            (copy.name, copy.metadata) = (original.name, original.metadata);
            copy.priority = original.priority;
            scheduler.store.create(&copy, None).await?;
            scheduler.wake();
            copy
        }
        _ => return Err(Problem::unknown_action(&action)),
    };
    let location = format!("/api/v1/jobs/{}", job.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(job.view())).into_response())
}

/// Changes the name, the metadata or, while the job is queued, the priority.
#[utoipa::path(
    patch, path = "/jobs/{id}", tag = "jobs", request_body = JobPatch,
    params(("id" = String, Path, description = "Id of the job"), ("If-Match" = Option<String>, Header, description = "ETag of the job; another version is rejected with 412")),
    responses((status = 200, description = "The job", body = JobView<'static>)),
)]
pub(crate) async fn patch(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    headers: HeaderMap,
    FullBody(body): FullBody,
) -> Result<Response, Problem> {
    let patch: JobPatch = parse_json(&body)?;
    check_name(patch.name.as_ref().and_then(Option::as_deref))?;
    patch.metadata.as_ref().and_then(Option::as_ref).map_or(Ok(()), check_metadata)?;
    let update = |job: &mut Job, _: &mut Vec<NewEvent>| {
        check_if_match(&headers, &etag(job))?;
        if let Some(priority) = patch.priority {
            if job.status != Status::Queued {
                return Err(Problem::invalid_state(job, "reprioritized"));
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
    let updated = scheduler.store.update(&id, update).await?;
    let (job, ()) = updated.ok_or_else(|| Problem::job_not_found(&id))??;
    Ok(([(header::ETAG, etag(&job))], Json(job.view())).into_response())
}

/// Deletes a finished job, or one whose record is damaged.
#[utoipa::path(
    delete, path = "/jobs/{id}", tag = "jobs",
    params(
        ("id" = String, Path, description = "Id of the job"),
        ("artifacts" = Option<bool>, Query, description = "Also delete its files, except those of models"),
        ("If-Match" = Option<String>, Header, description = "ETag of the job; another version is rejected with 412"),
    ),
    responses((status = 204, description = "The job is deleted")),
)]
pub(crate) async fn delete(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    parameters: Parameters,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    let delete_files = query_bool(parameters, "artifacts")?;
    match scheduler.store.job(&id).await {
        Ok(None) => return Err(Problem::job_not_found(&id)),
        Ok(Some(job)) if !job.status.is_terminal() => {
            return Err(Problem::invalid_state(&job, "deleted"));
        }
        Ok(Some(job)) => check_if_match(&headers, &etag(&job))?,
        Err(StoreError::Damaged(..)) => {}
        Err(error) => return Err(error.into()),
    }
    scheduler.delete_job(&id, delete_files).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Receives a report of the worker of a job.
#[utoipa::path(
    post, path = "/jobs/{id}/reports", tag = "workers", params(("id" = String, Path, description = "Id of the job")), request_body = WorkerReport,
    responses((status = 200, description = "Instruction to the worker", body = ReportReply)),
)]
pub(crate) async fn report(
    RequireScheduler(scheduler): RequireScheduler,
    Path(id): Path<String>,
    headers: HeaderMap,
    request: Asked,
) -> Result<Response, Problem> {
    // Authorized before the body is read.
    if !scheduler.is_current_token(&id, bearer_token(&headers)).await? {
        return Err(Problem::stale_worker());
    }
    let FullBody(body) = FullBody::from_request(request, &()).await?;
    let report: WorkerReport = parse_json(&body)?;
    Ok(Json(scheduler.apply_report(&id, bearer_token(&headers), report).await?).into_response())
}
