//! Records of datasets, models and evaluations produced by jobs, and of uploaded meshes.

use super::damage::{parse, parse_listed};
use super::{Store, StoreError};
use serde_json::Value;

/// Kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RecordKind {
    /// Dataset; its files are a folder.
    Dataset,
    /// Encoder or policy; its files are artifacts.
    Model,
    /// Evaluation of a model.
    Evaluation,
    /// Uploaded mesh; its file is an artifact.
    Mesh,
}

impl RecordKind {
    /// Name in the database and in messages.
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
    /// Adds a record; an existing record with this id is not changed.
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

    /// Replaces an existing record.
    pub(crate) async fn replace_record(
        &self,
        kind: RecordKind,
        id: &str,
        record: &Value,
    ) -> Result<(), StoreError> {
        sqlx::query("UPDATE records SET record = ? WHERE id = ? AND kind = ?")
            .bind(record.to_string())
            .bind(id)
            .bind(kind.name())
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// The record with this id.
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
        record.map(|record| parse(id, &record)).transpose()
    }

    /// Total size of all records of a kind (bytes).
    pub(crate) async fn total_bytes(&self, kind: RecordKind) -> Result<u64, StoreError> {
        let bytes: i64 =
            sqlx::query_scalar("SELECT coalesce(sum(bytes), 0) FROM records WHERE kind = ?")
                .bind(kind.name())
                .fetch_one(&self.readers)
                .await?;
        Ok(bytes.unsigned_abs())
    }

    /// Deletes a record.
    pub(crate) async fn delete_record(&self, kind: RecordKind, id: &str) -> Result<(), StoreError> {
        sqlx::query("DELETE FROM records WHERE id = ? AND kind = ?")
            .bind(id)
            .bind(kind.name())
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// Records of a kind that follow `after`, newest first; damaged ones are omitted.
    pub(crate) async fn records(
        &self,
        kind: RecordKind,
        after: Option<&str>,
        limit: i64,
    ) -> Result<Vec<Value>, StoreError> {
        let records: Vec<(String, String)> = sqlx::query_as(
            "SELECT id, record FROM records
             WHERE kind = ? AND (? IS NULL OR seq < (SELECT seq FROM records WHERE id = ?))
             ORDER BY seq DESC LIMIT ?",
        )
        .bind(kind.name())
        .bind(after)
        .bind(after)
        .bind(limit)
        .fetch_all(&self.readers)
        .await?;
        Ok(records.into_iter().filter_map(parse_listed).collect())
    }

    /// The latest [`MAX_EVALUATIONS`] evaluations of a model, newest first.
    pub(crate) async fn evaluations_of(&self, model: &str) -> Result<Vec<Value>, StoreError> {
        let records: Vec<(String, String)> = sqlx::query_as(
            "SELECT id, record FROM records
             WHERE kind = ? AND model = ? ORDER BY seq DESC LIMIT ?",
        )
        .bind(RecordKind::Evaluation.name())
        .bind(model)
        .bind(MAX_EVALUATIONS)
        .fetch_all(&self.readers)
        .await?;
        Ok(records.into_iter().filter_map(parse_listed).collect())
    }
}

/// Maximum number of listed evaluations of one model.
const MAX_EVALUATIONS: i64 = 100;
