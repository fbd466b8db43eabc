//! Tar archives of datasets and models: sent as streams, and received with limits.

mod pack;
mod unpack;

pub(crate) use pack::{Archive, Source};
pub(crate) use unpack::{MAX_ARCHIVE_BYTES, Received, receive};

use crate::{Problem, ProblemCode};
use axum::http::StatusCode;

impl Problem {
    /// An archive with invalid entries, or whose files do not match its manifest.
    pub(crate) fn invalid_archive(reason: impl Into<String>) -> Self {
        Self {
            status: StatusCode::UNPROCESSABLE_ENTITY,
            code: ProblemCode::InvalidArchive,
            detail: format!("the archive is invalid: {}", reason.into()),
            hint: "send the unchanged archive of GET /api/v1/datasets/{id}/archive or \
                   /api/v1/models/{id}/archive, or `tar -c` of the folder of a complete dataset"
                .into(),
            param: None,
        }
    }

    /// The maximum number of archives is being received.
    pub(crate) fn too_many_uploads() -> Self {
        Self {
            status: StatusCode::SERVICE_UNAVAILABLE,
            code: ProblemCode::TooManyUploads,
            detail: "the server is receiving other archives".into(),
            hint: "retry when they are complete".into(),
            param: None,
        }
    }
}
