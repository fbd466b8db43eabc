//! Error responses: `application/problem+json` (RFC 9457).

mod code;
mod response;

pub use code::ProblemCode;

use crate::jobs::Job;
use crate::jobs::kinds::mesh_options::size_required_hint;
use crate::store::is_full;
use axum::http::StatusCode;
use std::time::Duration;

/// An error, for programs (`code`) and for users (`detail`, `hint`).
#[derive(Clone, Debug)]
pub struct Problem {
    /// The HTTP status.
    pub status: StatusCode,
    /// Stable code of the error.
    pub code: ProblemCode,
    /// Cause of the error.
    pub detail: String,
    /// Suggested remedy.
    pub hint: String,
    /// Invalid parameter, if one caused the error.
    pub param: Option<String>,
}

impl Problem {
    /// Unknown path.
    pub(crate) fn not_found(path: &str) -> Self {
        Self {
            status: StatusCode::NOT_FOUND,
            code: ProblemCode::NotFound,
            detail: format!("{path} not found"),
            hint: "GET /api/v1/models lists the models; the page is at /".into(),
            param: None,
        }
    }

    /// The path does not support this method.
    pub(crate) fn method_not_allowed(method: &str, path: &str) -> Self {
        Self {
            status: StatusCode::METHOD_NOT_ALLOWED,
            code: ProblemCode::MethodNotAllowed,
            detail: format!("{path} does not support {method}"),
            hint: "the Allow header lists the supported methods".into(),
            param: None,
        }
    }

    /// The server cannot read or write one of its files.
    pub(crate) fn file_unreadable(error: &std::io::Error) -> Self {
        if is_full(error) {
            return Self::no_space(&error.to_string());
        }
        Self {
            status: StatusCode::INTERNAL_SERVER_ERROR,
            code: ProblemCode::FileUnreadable,
            detail: format!("cannot read a file: {error}"),
            hint: "check the server's permissions on its web, models and data folders".into(),
            param: None,
        }
    }
}

/// Errors of the job API.
impl Problem {
    fn new(status: StatusCode, code: ProblemCode, detail: String, hint: impl Into<String>) -> Self {
        Self { status, code, detail, hint: hint.into(), param: None }
    }

    /// The body is not a JSON object.
    pub(crate) fn malformed_json(reason: &str) -> Self {
        let detail = format!("the body is not a JSON object: {reason}");
        Self::new(StatusCode::BAD_REQUEST, ProblemCode::MalformedJson, detail, "send a JSON object")
    }

    /// A request without the token that it requires.
    pub(crate) fn unauthorized() -> Self {
        let detail = "this request requires the server token".to_owned();
        let hint = "send `Authorization: Bearer TOKEN` with the token from the file given with --token-file";
        Self::new(StatusCode::UNAUTHORIZED, ProblemCode::Unauthorized, detail, hint)
    }

    /// A write request from a page of another origin.
    pub(crate) fn origin_not_allowed(origin: &str) -> Self {
        let detail = format!("the origin {origin} is not allowed to send write requests");
        let hint =
            "use the server's own page or a non-browser client, or allow it with --allow-origin";
        Self::new(StatusCode::FORBIDDEN, ProblemCode::OriginNotAllowed, detail, hint)
    }

    /// The `Host` header does not name this server.
    pub(crate) fn host_not_allowed(host: &str) -> Self {
        let detail = format!("\"{host}\" is not a name of this server");
        let hint =
            "use http://localhost with the port of the server, or allow the name with --host";
        Self::new(StatusCode::FORBIDDEN, ProblemCode::HostNotAllowed, detail, hint)
    }

    /// The path or query cannot be parsed.
    pub(crate) fn invalid_query(reason: &str) -> Self {
        let hint = "GET /openapi.json describes all requests";
        Self::new(StatusCode::BAD_REQUEST, ProblemCode::InvalidQuery, reason.to_owned(), hint)
    }

    /// Invalid value of a parameter.
    pub(crate) fn invalid_parameter(param: &str, detail: impl Into<String>) -> Self {
        let detail = format!("{param}: {}", detail.into());
        let hint = "GET /openapi.json describes all requests";
        let problem = Self::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            ProblemCode::InvalidParameter,
            detail,
            hint,
        );
        Self { param: Some(param.to_owned()), ..problem }
    }

    /// An input of a job does not exist.
    pub(crate) fn input_not_found(param: &str, id: &str) -> Self {
        let hint =
            "GET /api/v1/datasets, /api/v1/models and /api/v1/meshes list the available inputs";
        let problem =
            Self::invalid_parameter(&format!("params.{param}"), format!("\"{id}\" not found"));
        Self { code: ProblemCode::InputNotFound, hint: hint.into(), ..problem }
    }

    /// An encoder was given as the policy to evaluate.
    pub(crate) fn not_a_policy(id: &str) -> Self {
        let detail = format!("\"{id}\" is an encoder, not a policy");
        let hint = "train a policy with this encoder: kind policy.train, parameter encoder_id";
        let problem = Self::invalid_parameter("params.model_id", detail);
        Self { hint: hint.into(), ..problem }
    }

    /// Unknown job.
    pub(crate) fn job_not_found(id: &str) -> Self {
        let detail = format!("job \"{id}\" not found");
        Self::new(
            StatusCode::NOT_FOUND,
            ProblemCode::JobNotFound,
            detail,
            "GET /api/v1/jobs lists the jobs",
        )
    }

    /// Unknown action on a job.
    pub(crate) fn unknown_action(action: &str) -> Self {
        let detail = format!("unknown action \"{action}\"");
        let hint = "the actions are cancel, pause, resume, retry and clone";
        Self::new(StatusCode::NOT_FOUND, ProblemCode::UnknownAction, detail, hint)
    }

    /// The status of a job does not permit this action; `action` is a past participle.
    pub(crate) fn invalid_state(job: &Job, action: &str) -> Self {
        let status = job.status.name();
        let detail = format!("{} is {status} and cannot be {action}", job.id);
        let hint =
            "check the status of the job; the documentation lists the actions for each status";
        Self::new(StatusCode::CONFLICT, ProblemCode::InvalidState, detail, hint)
    }

    /// The resource is an input of an unfinished job.
    pub(crate) fn in_use(id: &str, job: &str) -> Self {
        let detail = format!("{id} is in use by {job}");
        let hint = "wait until the job has finished, or cancel it";
        Self::new(StatusCode::CONFLICT, ProblemCode::InUse, detail, hint)
    }

    /// The resource has changed since the client read it.
    pub(crate) fn precondition_failed(etag: &str) -> Self {
        let detail = format!("If-Match does not contain the current ETag {etag}");
        let hint = "read the resource again, then repeat the request with its ETag";
        Self::new(StatusCode::PRECONDITION_FAILED, ProblemCode::PreconditionFailed, detail, hint)
    }

    /// Built-in models and the default model cannot be deleted.
    pub(crate) fn model_read_only(id: &str) -> Self {
        let detail =
            format!("model \"{id}\" is built in or the default model and cannot be deleted");
        let hint =
            "the operator can delete its folder or select another model with --default-model";
        Self::new(StatusCode::CONFLICT, ProblemCode::ModelReadOnly, detail, hint)
    }

    /// The idempotency key was used for a different request.
    pub(crate) fn idempotency_key_reused() -> Self {
        let detail = "this Idempotency-Key was used with a different body".to_owned();
        let hint = "use a new key for a new request";
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, ProblemCode::IdempotencyKeyReused, detail, hint)
    }

    /// The job created with the idempotency key was deleted.
    pub(crate) fn idempotency_job_deleted() -> Self {
        let detail = "the job created with this Idempotency-Key was deleted".to_owned();
        let hint = "use a new key for a new job";
        Self::new(StatusCode::CONFLICT, ProblemCode::IdempotencyJobDeleted, detail, hint)
    }

    /// The maximum number of jobs is queued.
    pub(crate) fn queue_full(max: usize) -> Self {
        let detail = format!("the queue is full ({max} jobs)");
        let hint = "retry later, or cancel queued jobs";
        Self::new(StatusCode::SERVICE_UNAVAILABLE, ProblemCode::QueueFull, detail, hint)
    }

    /// The maximum number of event streams and waiting requests is reached.
    pub(crate) fn too_many_streams() -> Self {
        let detail = "too many event streams and waiting requests".to_owned();
        let hint = "retry later; the operator can raise the limit of open files";
        Self::new(StatusCode::SERVICE_UNAVAILABLE, ProblemCode::TooManyStreams, detail, hint)
    }

    /// A client exceeded the rate limit of write requests.
    pub(crate) fn rate_limited(max: u32) -> Self {
        let detail = format!("more than {max} write requests per second");
        let hint = "wait for the time in the Retry-After header";
        Self::new(StatusCode::TOO_MANY_REQUESTS, ProblemCode::TooManyRequests, detail, hint)
    }

    /// The disk is nearly full.
    pub(crate) fn disk_full(free: u64, min: u64) -> Self {
        let detail = format!("only {free} bytes free; the server keeps {min} bytes in reserve");
        let hint = "delete datasets, models, meshes, or jobs with ?artifacts=true";
        Self::new(StatusCode::INSUFFICIENT_STORAGE, ProblemCode::DiskFull, detail, hint)
    }

    /// A write failed because the disk is full.
    pub(crate) fn no_space(reason: &str) -> Self {
        let detail = format!("the disk of the server is full: {reason}");
        let hint =
            "free disk space, then repeat the request; DELETE of datasets and jobs frees space";
        Self::new(StatusCode::INSUFFICIENT_STORAGE, ProblemCode::DiskFull, detail, hint)
    }

    /// A record in the database cannot be read.
    pub(crate) fn record_damaged(reason: &str) -> Self {
        let hint = "delete it, or start the version of ngf that wrote it";
        Self::new(StatusCode::CONFLICT, ProblemCode::RecordDamaged, reason.to_owned(), hint)
    }

    /// The stored meshes have reached their maximum total size.
    pub(crate) fn mesh_quota_exceeded(max: u64) -> Self {
        let detail = format!("the stored meshes exceed the quota of {max} bytes");
        let hint = "delete meshes with DELETE /api/v1/meshes/{id}";
        Self::new(StatusCode::INSUFFICIENT_STORAGE, ProblemCode::MeshQuotaExceeded, detail, hint)
    }

    /// Report of a process that is not the current worker of the job.
    pub(crate) fn stale_worker() -> Self {
        let detail = "this worker's lease has expired, or the token is invalid".to_owned();
        let hint = "exit; another worker may be running the job";
        Self::new(StatusCode::CONFLICT, ProblemCode::StaleWorker, detail, hint)
    }

    /// The server runs without a data folder.
    pub(crate) fn jobs_disabled() -> Self {
        let detail = "jobs are disabled on this server".to_owned();
        let hint = "start the server with `ngf serve --data-dir DIR`";
        Self::new(StatusCode::NOT_FOUND, ProblemCode::JobsDisabled, detail, hint)
    }

    /// A stream was requested in another media type.
    pub(crate) fn not_acceptable() -> Self {
        let detail = "event streams are available as text/event-stream only".to_owned();
        let hint = "GET .../events returns the events as JSON";
        Self::new(StatusCode::NOT_ACCEPTABLE, ProblemCode::NotAcceptable, detail, hint)
    }

    /// Invalid mesh file, or a mesh of unknown size.
    pub(crate) fn unusable_mesh(error: &mesh::MeshError) -> Self {
        let (detail, hint) = error.cause_and_hint();
        match error.code() {
            "size_required" => {
                let hint = size_required_hint();
                let problem = Self::invalid_mesh((detail, hint));
                Self { code: ProblemCode::SizeRequired, param: Some("size_m".into()), ..problem }
            }
            _ => Self::invalid_mesh((detail, hint)),
        }
    }

    /// A job with a mesh whose file does not tell its size.
    pub(crate) fn mesh_size_required(id: &str) -> Self {
        let detail = format!("the file of \"{id}\" does not tell the size of the mesh");
        let problem = Self::invalid_parameter("params.size_m", detail);
        Self { code: ProblemCode::SizeRequired, hint: size_required_hint(), ..problem }
    }

    /// Invalid mesh file; see [`mesh::MeshError::cause_and_hint`].
    pub(crate) fn invalid_mesh((detail, hint): (String, String)) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, ProblemCode::InvalidMesh, detail, &hint)
    }

    /// The body exceeds the size limit.
    pub(crate) fn body_too_large(max: usize) -> Self {
        let detail = format!("the body is longer than {max} bytes");
        let hint = "GET /api/v1 lists the limits";
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, ProblemCode::BodyTooLarge, detail, hint)
    }

    /// The multipart form cannot be parsed.
    pub(crate) fn malformed_form(reason: &str) -> Self {
        let hint = "send the file as the body, or as a file field of multipart/form-data";
        Self::new(StatusCode::BAD_REQUEST, ProblemCode::MalformedForm, reason.to_owned(), hint)
    }

    /// The connection ended before the end of the body.
    pub(crate) fn incomplete_body(reason: &str) -> Self {
        let detail = format!("the body is incomplete: {reason}");
        Self::new(
            StatusCode::BAD_REQUEST,
            ProblemCode::IncompleteBody,
            detail,
            "repeat the request",
        )
    }

    /// The body did not arrive in time.
    pub(crate) fn request_timeout(max: Duration) -> Self {
        let detail = format!("the body did not arrive within {} s", max.as_secs());
        Self::new(
            StatusCode::REQUEST_TIMEOUT,
            ProblemCode::RequestTimeout,
            detail,
            "repeat the request",
        )
    }

    /// The database cannot be written.
    pub(crate) fn not_ready() -> Self {
        let detail = "the database of the server cannot be written".to_owned();
        Self::new(
            StatusCode::SERVICE_UNAVAILABLE,
            ProblemCode::NotReady,
            detail,
            "check the free space and the permissions of the disk of the server",
        )
    }

    /// A handler panicked.
    pub(crate) fn internal() -> Self {
        let detail = "internal error; the server continues to run".to_owned();
        let hint = "please report it with the server log";
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, ProblemCode::Internal, detail, hint)
    }

    /// The requested range is outside of the file.
    pub(crate) fn range_not_satisfiable(name: &str) -> Self {
        let detail = format!("the requested range is outside of {name}");
        let hint = "the Content-Range header contains the length";
        Self::new(StatusCode::RANGE_NOT_SATISFIABLE, ProblemCode::RangeNotSatisfiable, detail, hint)
    }

    /// Unknown episode of a dataset.
    pub(crate) fn episode_not_found(reason: &str) -> Self {
        let hint = "the summary of the dataset contains the number of episodes";
        Self::new(StatusCode::NOT_FOUND, ProblemCode::EpisodeNotFound, reason.to_owned(), hint)
    }

    /// The dataset cannot be opened, e.g. because an earlier version generated it.
    pub(crate) fn incompatible_dataset(reason: &str) -> Self {
        let hint = "generate the dataset again with a job with the same parameters";
        Self::new(StatusCode::CONFLICT, ProblemCode::IncompatibleDataset, reason.to_owned(), hint)
    }

    /// Unknown dataset, mesh or artifact; `resource` is its singular name.
    pub(crate) fn record_not_found(resource: &str, id: &str) -> Self {
        let detail = format!("{resource} \"{id}\" not found");
        let hint = match resource {
            "dataset" => "GET /api/v1/datasets lists the datasets",
            "mesh" => "GET /api/v1/meshes lists the meshes",
            "artifact" => "GET /api/v1/jobs/{id}/artifacts lists the artifacts of a job",
            _ => "GET /api/v1 contains the URLs of the lists of resources",
        };
        Self::new(StatusCode::NOT_FOUND, ProblemCode::RecordNotFound, detail, hint)
    }
}
