//! Stable codes of errors.

use serde::Serialize;
use utoipa::ToSchema;

/// Stable code of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProblemCode {
    /// The connection ended before the end of the body.
    IncompleteBody,
    /// The body exceeds the size limit.
    BodyTooLarge,
    /// The body did not arrive in time.
    RequestTimeout,
    /// The card of a model is not JSON.
    InvalidCard,
    /// The dataset cannot be opened, e.g. because an earlier version generated it.
    IncompatibleDataset,
    /// The disk is full or nearly full.
    DiskFull,
    /// The dataset has no such episode.
    EpisodeNotFound,
    /// A file of the page cannot be served with these request headers.
    FileNotServed,
    /// The server cannot read one of its files.
    FileUnreadable,
    /// The `Host` header does not name this server.
    HostNotAllowed,
    /// A write request from a page of another origin.
    OriginNotAllowed,
    /// The idempotency key was used with a different body.
    IdempotencyKeyReused,
    /// The job created with the idempotency key was deleted.
    IdempotencyJobDeleted,
    /// The resource is an input of an unfinished job.
    InUse,
    /// An input of a job does not exist.
    InputNotFound,
    /// Internal error of the server.
    Internal,
    /// The path or query cannot be parsed.
    InvalidQuery,
    /// Malformed model id.
    InvalidModelId,
    /// Invalid value of a parameter.
    InvalidParameter,
    /// The status of the job does not permit this action.
    InvalidState,
    /// Unknown job.
    JobNotFound,
    /// The server runs without a data folder.
    JobsDisabled,
    /// The multipart form cannot be parsed.
    MalformedForm,
    /// The body is not a JSON object.
    MalformedJson,
    /// The archive is not a valid tar archive, or its files do not match its manifest.
    InvalidArchive,
    /// The mesh file is invalid.
    InvalidMesh,
    /// The file and the options do not tell how large the mesh is.
    SizeRequired,
    /// The stored meshes have reached their maximum total size.
    MeshQuotaExceeded,
    /// The path does not support this method.
    MethodNotAllowed,
    /// The model no longer has the requested content.
    ModelChanged,
    /// The model has no such file.
    ModelFileNotFound,
    /// Unknown model.
    ModelNotFound,
    /// A stream was requested in another media type.
    NotAcceptable,
    /// Unknown path.
    NotFound,
    /// The reporting process is not the current worker of the job.
    StaleWorker,
    /// Built-in models and the default model cannot be deleted.
    ModelReadOnly,
    /// The database cannot be written.
    NotReady,
    /// The web page has not been built.
    WebNotBuilt,
    /// The resource has changed since the client read it.
    PreconditionFailed,
    /// The maximum number of jobs is queued.
    QueueFull,
    /// The requested range is outside of the file.
    RangeNotSatisfiable,
    /// A record in the database cannot be read.
    RecordDamaged,
    /// Unknown dataset, mesh or artifact.
    RecordNotFound,
    /// The database or a file cannot be read or written.
    StorageFailed,
    /// The maximum number of archives is being received.
    TooManyUploads,
    /// The client exceeded the rate limit of write requests.
    TooManyRequests,
    /// The maximum number of event streams and waiting requests is reached.
    TooManyStreams,
    /// The request requires the server token.
    Unauthorized,
    /// Unknown action on a job.
    UnknownAction,
}
