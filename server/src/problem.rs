//! The one shape of an error: `application/problem+json` (RFC 9457).

mod code;

pub use code::Code;

use crate::job::Job;
use crate::store::StoreError;
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::time::Duration;

/// What went wrong, for a program (`code`) and for a person (`detail`, `hint`).
#[derive(Clone, Debug)]
pub struct Problem {
    /// The HTTP status.
    pub status: StatusCode,
    /// Which kind of problem.
    pub code: Code,
    /// What happened to this request.
    pub detail: String,
    /// What to do about it.
    pub hint: String,
    /// Which parameter is meant, if one is.
    pub param: Option<String>,
}

impl Problem {
    /// Nothing lives at this path.
    pub(crate) fn not_found(path: &str) -> Self {
        Self {
            status: StatusCode::NOT_FOUND,
            code: Code::NotFound,
            detail: format!("there is nothing at {path}"),
            hint: "GET /api/v1/models lists the models; the page is at /".into(),
            param: None,
        }
    }

    /// The path exists, the method does not.
    pub(crate) fn method_not_allowed(method: &str, path: &str) -> Self {
        Self {
            status: StatusCode::METHOD_NOT_ALLOWED,
            code: Code::MethodNotAllowed,
            detail: format!("{path} does not answer {method}"),
            hint: "the Allow header names the methods that it answers".into(),
            param: None,
        }
    }

    /// The server could not read its own files.
    pub(crate) fn unreadable(error: &std::io::Error) -> Self {
        Self {
            status: StatusCode::INTERNAL_SERVER_ERROR,
            code: Code::FileUnreadable,
            detail: format!("a file could not be read: {error}"),
            hint: "check that the server may read its page and models folders".into(),
            param: None,
        }
    }
}

/// Problems of jobs.
impl Problem {
    fn new(status: StatusCode, code: Code, detail: String, hint: impl Into<String>) -> Self {
        Self { status, code, detail, hint: hint.into(), param: None }
    }

    /// The body is no JSON object.
    pub(crate) fn malformed(why: &str) -> Self {
        let detail = format!("the body is no JSON object: {why}");
        Self::new(StatusCode::BAD_REQUEST, Code::MalformedJson, detail, "send a JSON object")
    }

    /// A change needs the token.
    pub(crate) fn unauthorized() -> Self {
        let detail = "this needs the server's token".to_owned();
        let hint =
            "send it as `Authorization: Bearer TOKEN`; it is in the file given with --token-file";
        Self::new(StatusCode::UNAUTHORIZED, Code::Unauthorized, detail, hint)
    }

    /// A page of somebody else's asks.
    pub(crate) fn foreign_origin(origin: &str) -> Self {
        let detail = format!("pages of {origin} may not change anything here");
        let hint = "ask from the server's own page, or without a browser";
        Self::new(StatusCode::FORBIDDEN, Code::ForeignOrigin, detail, hint)
    }

    /// A parameter in the address cannot be read.
    pub(crate) fn invalid_address(why: &str) -> Self {
        let hint = "GET /openapi.json describes every request";
        Self::new(StatusCode::BAD_REQUEST, Code::InvalidAddress, why.to_owned(), hint)
    }

    /// A parameter is not as it must be.
    pub(crate) fn invalid(param: &str, detail: impl Into<String>) -> Self {
        let detail = format!("{param}: {}", detail.into());
        let hint = "GET /openapi.json describes every request";
        let problem =
            Self::new(StatusCode::UNPROCESSABLE_ENTITY, Code::InvalidParameter, detail, hint);
        Self { param: Some(param.to_owned()), ..problem }
    }

    /// What a job is to work on is not there.
    pub(crate) fn missing_input(param: &str, id: &str) -> Self {
        let hint = "GET /api/v1/datasets and /api/v1/models list what there is";
        let problem = Self::invalid(&format!("params.{param}"), format!("there is no \"{id}\""));
        Self { code: Code::InputNotFound, hint: hint.into(), ..problem }
    }

    /// An encoder is asked to act.
    pub(crate) fn encoder_alone(id: &str) -> Self {
        let detail = format!("\"{id}\" is an encoder, which does not act");
        let hint = "train a policy with it: kind policy.train, encoder_id";
        let problem = Self::invalid("params.model_id", detail);
        Self { hint: hint.into(), ..problem }
    }

    /// There is no such job.
    pub(crate) fn no_job(id: &str) -> Self {
        let detail = format!("there is no job \"{id}\"");
        Self::new(
            StatusCode::NOT_FOUND,
            Code::JobNotFound,
            detail,
            "GET /api/v1/jobs lists the jobs",
        )
    }

    /// A job cannot be asked for that.
    pub(crate) fn no_verb(verb: &str) -> Self {
        let detail = format!("a job cannot be asked to \"{verb}\"");
        let hint = "it can be asked to cancel, pause, resume, retry and clone";
        Self::new(StatusCode::NOT_FOUND, Code::UnknownAction, detail, hint)
    }

    /// A job does not stand where that is possible.
    pub(crate) fn invalid_state(job: &Job, what: &str) -> Self {
        let status = job.status.name();
        let detail = format!("{} is {status}: it cannot be {what}", job.id);
        let hint =
            "GET the job for its status; what can be done from there is in the documentation";
        Self::new(StatusCode::CONFLICT, Code::InvalidState, detail, hint)
    }

    /// A job that has not ended works on it.
    pub(crate) fn in_use(id: &str, job: &str) -> Self {
        let detail = format!("{job} works on {id}");
        let hint = "wait until the job has ended, or cancel it";
        Self::new(StatusCode::CONFLICT, Code::InUse, detail, hint)
    }

    /// No job made it, so the server does not delete it.
    pub(crate) fn not_of_a_job(id: &str) -> Self {
        let detail = format!("the model \"{id}\" is not one that a job made");
        let hint = "whoever operates the server removes its folder, or chooses another default";
        Self::new(StatusCode::CONFLICT, Code::NotOfAJob, detail, hint)
    }

    /// A key was used for another request.
    pub(crate) fn key_reused() -> Self {
        let detail = "this Idempotency-Key was used with another body".to_owned();
        let hint = "use a new key for a new request";
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, Code::IdempotencyKeyReused, detail, hint)
    }

    /// A key was used for a job that was deleted.
    pub(crate) fn key_of_deleted() -> Self {
        let detail = "the job of this Idempotency-Key was deleted".to_owned();
        let hint = "use a new key for a new job";
        Self::new(StatusCode::CONFLICT, Code::IdempotencyKeySpent, detail, hint)
    }

    /// Too many jobs wait.
    pub(crate) fn queue_full(most: usize) -> Self {
        let detail = format!("{most} jobs wait already");
        let hint = "try again later, or cancel some";
        Self::new(StatusCode::SERVICE_UNAVAILABLE, Code::QueueFull, detail, hint)
    }

    /// An address asks too often.
    pub(crate) fn too_often(most: u32) -> Self {
        let detail = format!("more than {most} changes a second were asked for");
        let hint = "wait as long as the Retry-After header says";
        Self::new(StatusCode::TOO_MANY_REQUESTS, Code::TooManyRequests, detail, hint)
    }

    /// The disk is nearly full.
    pub(crate) fn disk_full(free: u64, least: u64) -> Self {
        let detail = format!("{free} bytes are free on the disk, and {least} stay so");
        let hint = "delete datasets, models, meshes, or jobs with ?artifacts=true";
        Self::new(StatusCode::INSUFFICIENT_STORAGE, Code::DiskFull, detail, hint)
    }

    /// As many meshes are kept as may be.
    pub(crate) fn meshes_full(most: u64) -> Self {
        let detail = format!("meshes of {most} bytes in all are kept");
        let hint = "delete some: DELETE /api/v1/meshes/{id}";
        Self::new(StatusCode::INSUFFICIENT_STORAGE, Code::MeshesFull, detail, hint)
    }

    /// A report of a process that is no longer the job's.
    pub(crate) fn not_its_turn() -> Self {
        let detail = "this process is not, or no longer, the one that works on the job".to_owned();
        let hint = "end at once: another one may be at work";
        Self::new(StatusCode::CONFLICT, Code::NotItsTurn, detail, hint)
    }

    /// The server does no jobs.
    pub(crate) fn no_jobs() -> Self {
        let detail = "this server has no folder for jobs".to_owned();
        let hint = "start it with `ngf serve --data DIR`";
        Self::new(StatusCode::NOT_FOUND, Code::JobsDisabled, detail, hint)
    }

    /// A stream was asked for as something else.
    pub(crate) fn not_acceptable() -> Self {
        let detail = "events are streamed as text/event-stream only".to_owned();
        let hint = "GET .../events gives them as JSON";
        Self::new(StatusCode::NOT_ACCEPTABLE, Code::NotAcceptable, detail, hint)
    }

    /// A mesh is of no use; the message of the reader ends with the cure, as a sentence of its own.
    pub(crate) fn unusable_mesh(message: &str) -> Self {
        let (cause, cure) = message.rsplit_once(". ").unwrap_or((message, "Try another file"));
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, Code::MeshUnusable, cause.to_owned(), cure)
    }

    /// A body is too long.
    pub(crate) fn too_large(most: usize) -> Self {
        let detail = format!("at most {most} bytes are read");
        let hint = "GET /api/v1 tells the limits";
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, Code::BodyTooLarge, detail, hint)
    }

    /// A form cannot be read.
    pub(crate) fn malformed_form(why: &str) -> Self {
        let hint = "send the file as the body, or as a file of multipart/form-data";
        Self::new(StatusCode::BAD_REQUEST, Code::MalformedForm, why.to_owned(), hint)
    }

    /// A body ended before its end.
    pub(crate) fn broken_off(why: &str) -> Self {
        let detail = format!("the body broke off: {why}");
        Self::new(StatusCode::BAD_REQUEST, Code::BodyIncomplete, detail, "send it again")
    }

    /// A body took too long to arrive.
    pub(crate) fn too_slow(most: Duration) -> Self {
        let detail = format!("the body was not there after {} s", most.as_secs());
        Self::new(StatusCode::REQUEST_TIMEOUT, Code::BodyTooSlow, detail, "send it again")
    }

    /// The server's data cannot be read.
    pub(crate) fn not_ready() -> Self {
        let detail = "the data of the server cannot be read".to_owned();
        Self::new(StatusCode::SERVICE_UNAVAILABLE, Code::NotReady, detail, "look at its disk")
    }

    /// A handler panicked.
    pub(crate) fn panicked() -> Self {
        let detail = "the server made a mistake; it goes on".to_owned();
        let hint = "please report it, with the server's log";
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Code::Internal, detail, hint)
    }

    /// A file does not have these bytes.
    pub(crate) fn out_of_range(name: &str) -> Self {
        let detail = format!("{name} does not have the bytes that were asked for");
        let hint = "the Content-Range header gives the length";
        Self::new(StatusCode::RANGE_NOT_SATISFIABLE, Code::RangeNotSatisfiable, detail, hint)
    }

    /// There is no such episode.
    pub(crate) fn no_episode(why: &str) -> Self {
        let hint = "the dataset's summary counts its episodes";
        Self::new(StatusCode::NOT_FOUND, Code::EpisodeNotFound, why.to_owned(), hint)
    }

    /// A dataset cannot be opened, as one that an earlier version made.
    pub(crate) fn unusable_dataset(why: &str) -> Self {
        let hint = "make it again: a job with the same parameters";
        Self::new(StatusCode::CONFLICT, Code::DatasetUnusable, why.to_owned(), hint)
    }

    /// There is no such record.
    pub(crate) fn no_record(what: &str, id: &str) -> Self {
        let detail = format!("there is no {what} \"{id}\"");
        let hint = format!("GET /api/v1/{what}s lists what there is");
        Self::new(StatusCode::NOT_FOUND, Code::RecordNotFound, detail, hint)
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        tracing::error!(%error, "the store");
        let hint = "look at the server's log; what was there is still there";
        let status = StatusCode::INTERNAL_SERVER_ERROR;
        Self::new(status, Code::StoreFailed, error.to_string(), hint)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        // "about:blank" says that `title` is the status's own phrase; `code` tells kinds apart.
        let mut body = json!({
            "type": "about:blank",
            "title": self.status.canonical_reason().unwrap_or("Error"),
            "status": self.status.as_u16(),
            "detail": self.detail,
            "code": self.code,
            "hint": self.hint,
        });
        if let Some(param) = &self.param {
            body["errors"] = json!([{ "param": param, "detail": self.detail }]);
        }
        if let Some(id) = crate::observe::current() {
            body["request_id"] = id.into();
        }
        let is_busy = self.status == StatusCode::SERVICE_UNAVAILABLE;
        let mut response = (self.status, Json(body)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if is_busy {
            headers.insert(header::RETRY_AFTER, HeaderValue::from_static("10"));
        }
        response
    }
}
