//! The kinds of problems, by their stable names.

use serde::Serialize;
use utoipa::ToSchema;

/// Stable name of a kind of problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    /// The connection ended before the body did.
    BodyIncomplete,
    /// A body is longer than is read.
    BodyTooLarge,
    /// A body took too long to arrive.
    BodyTooSlow,
    /// A model's card is not JSON.
    CardInvalid,
    /// A dataset cannot be opened, as one of an earlier version.
    DatasetUnusable,
    /// The disk is nearly full.
    DiskFull,
    /// A dataset has no such episode.
    EpisodeNotFound,
    /// A file of the page cannot be served as asked.
    FileRefused,
    /// The server cannot read one of its own files.
    FileUnreadable,
    /// A page of another origin asks for a change.
    ForeignOrigin,
    /// The key was used with another body.
    IdempotencyKeyReused,
    /// The job of the key was deleted.
    IdempotencyKeySpent,
    /// A job that has not ended works on it.
    InUse,
    /// What a job is to work on is not there.
    InputNotFound,
    /// The server made a mistake.
    Internal,
    /// A parameter in the address cannot be read.
    InvalidAddress,
    /// No model can have this id.
    InvalidModelId,
    /// A parameter is not as it must be.
    InvalidParameter,
    /// A job does not stand where that is possible.
    InvalidState,
    /// There is no such job.
    JobNotFound,
    /// The server has no folder for jobs.
    JobsDisabled,
    /// A form cannot be read.
    MalformedForm,
    /// The body is no JSON object.
    MalformedJson,
    /// A mesh is of no use.
    MeshUnusable,
    /// As many meshes are kept as may be.
    MeshesFull,
    /// The path exists, the method does not.
    MethodNotAllowed,
    /// A model no longer has the content that was asked for.
    ModelChanged,
    /// A model has no such file.
    ModelFileNotFound,
    /// There is no such model.
    ModelNotFound,
    /// A stream was asked for as something else.
    NotAcceptable,
    /// Nothing lives at this path.
    NotFound,
    /// A process reports that is no longer the job's.
    NotItsTurn,
    /// No job made this model.
    NotOfAJob,
    /// The server's data cannot be read.
    NotReady,
    /// The page has not been built.
    PageNotBuilt,
    /// Too many jobs wait.
    QueueFull,
    /// A file does not have these bytes.
    RangeNotSatisfiable,
    /// There is no such record.
    RecordNotFound,
    /// The server's data cannot be read or written.
    StoreFailed,
    /// An address asks too often.
    TooManyRequests,
    /// A change needs the token.
    Unauthorized,
    /// A job cannot be asked for that.
    UnknownAction,
}
