//! Datasets, models and evaluations that jobs made, and meshes that were uploaded.

use super::{Store, StoreError};
use serde_json::Value;

/// What a record is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RecordKind {
    /// A dataset: a folder.
    Dataset,
    /// An encoder or a policy: artifacts.
    Model,
    /// What an evaluation counted of a model.
    Evaluation,
    /// A mesh that was uploaded: an artifact.
    Mesh,
}

impl RecordKind {
    /// Its name, in the database and in texts.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Dataset => "dataset",
            Self::Model => "model",
            Self::Evaluation => "evaluation",
            Self::Mesh => "mesh",
        }
    }
}

impl Store {
    /// Adds a record, or leaves the one of this id as it is.
    pub(crate) async fn add_record(
        &self,
        kind: RecordKind,
        id: &str,
        record: &Value,
    ) -> Result<(), StoreError> {
        sqlx::query("INSERT OR IGNORE INTO records (id, kind, record) VALUES (?, ?, ?)")
            .bind(id)
            .bind(kind.name())
            .bind(record.to_string())
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// One record.
    pub(crate) async fn record(
        &self,
        kind: RecordKind,
        id: &str,
    ) -> Result<Option<Value>, StoreError> {
        let record: Option<String> =
            sqlx::query_scalar("SELECT record FROM records WHERE id = ? AND kind = ?")
                .bind(id)
                .bind(kind.name())
                .fetch_optional(&self.readers)
                .await?;
        Ok(record.map(|record| serde_json::from_str(&record)).transpose()?)
    }

    /// Bytes of all records of a kind together.
    pub(crate) async fn bytes_of(&self, kind: RecordKind) -> Result<u64, StoreError> {
        let bytes: i64 = sqlx::query_scalar(
            "SELECT coalesce(sum(json_extract(record, '$.bytes')), 0) FROM records WHERE kind = ?",
        )
        .bind(kind.name())
        .fetch_one(&self.readers)
        .await?;
        Ok(bytes.unsigned_abs())
    }

    /// Forgets a record.
    pub(crate) async fn forget(&self, kind: RecordKind, id: &str) -> Result<(), StoreError> {
        sqlx::query("DELETE FROM records WHERE id = ? AND kind = ?")
            .bind(id)
            .bind(kind.name())
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// Records of a kind, newest first.
    pub(crate) async fn records(
        &self,
        kind: RecordKind,
        after: Option<&str>,
        limit: i64,
    ) -> Result<Vec<Value>, StoreError> {
        let records: Vec<String> = sqlx::query_scalar(
            "SELECT record FROM records
             WHERE kind = ? AND (? IS NULL OR seq < (SELECT seq FROM records WHERE id = ?))
             ORDER BY seq DESC LIMIT ?",
        )
        .bind(kind.name())
        .bind(after)
        .bind(after)
        .bind(limit)
        .fetch_all(&self.readers)
        .await?;
        Ok(records.iter().map(|record| serde_json::from_str(record)).collect::<Result<_, _>>()?)
    }

    /// Evaluations of a model, newest first.
    pub(crate) async fn evaluations_of(&self, model: &str) -> Result<Vec<Value>, StoreError> {
        let records: Vec<String> = sqlx::query_scalar(
            "SELECT record FROM records
             WHERE kind = ? AND json_extract(record, '$.model_id') = ? ORDER BY seq DESC LIMIT ?",
        )
        .bind(RecordKind::Evaluation.name())
        .bind(model)
        .bind(MOST_EVALUATIONS)
        .fetch_all(&self.readers)
        .await?;
        Ok(records.iter().map(|record| serde_json::from_str(record)).collect::<Result<_, _>>()?)
    }
}

/// Evaluations of one model that are shown.
const MOST_EVALUATIONS: i64 = 100;
