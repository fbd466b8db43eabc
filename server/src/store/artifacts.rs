//! Files that never change, each named by the BLAKE3 of what it holds.

use super::{Store, StoreError};
use chrono::Utc;
use object_store::path::Path as Key;
use object_store::{GetOptions, MultipartUpload, ObjectStore, ObjectStoreExt, PutMode, PutOptions};
use sqlx::Row;
use std::path::Path;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

/// A file of a job.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
pub(crate) struct Artifact {
    /// What the job called it.
    pub(crate) name: String,
    /// BLAKE3, hex.
    pub(crate) hash: String,
    /// How long it is.
    pub(crate) bytes: u64,
    /// What it is.
    pub(crate) content_type: String,
}

fn key(hash: &str) -> Key {
    Key::from(format!("{}/{hash}", hash.get(..2).unwrap_or_default()))
}

/// What a file is, by its name.
fn content_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("json") => "application/json",
        Some("jsonl") => "application/x-ndjson",
        Some("svg") => "image/svg+xml",
        Some("txt" | "md") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

/// Bytes of a file that are in memory at a time. The allocator leaves with every thread as much as it ever held in one
/// piece: a server that read models whole had grown from 27 to 61 MB after ten minutes of a training.
const PIECE: u64 = 1 << 20;

/// A file as it was when it was opened, piece by piece.
struct Pieces {
    file: tokio::fs::File,
    left: u64,
}

impl Pieces {
    async fn of(path: &Path) -> std::io::Result<Self> {
        let file = tokio::fs::File::open(path).await?;
        let left = file.metadata().await?.len();
        Ok(Self { file, left })
    }

    async fn next(&mut self) -> std::io::Result<Option<Vec<u8>>> {
        let mut piece = vec![0; self.left.min(PIECE) as usize];
        self.left -= piece.len() as u64;
        self.file.read_exact(&mut piece).await?;
        Ok((!piece.is_empty()).then_some(piece))
    }
}

/// Writes a file of so many bytes that was found to have a hash.
async fn put(
    upload: &mut dyn MultipartUpload,
    path: &Path,
    bytes: u64,
    hash: blake3::Hash,
) -> Result<(), StoreError> {
    let (mut pieces, mut hasher) = (Pieces::of(path).await?, blake3::Hasher::new());
    pieces.left = bytes;
    while let Some(piece) = pieces.next().await? {
        hasher.update(&piece);
        upload.put_part(piece.into()).await?;
    }
    if hasher.finalize() != hash {
        return Err(std::io::Error::other(format!("{} changed meanwhile", path.display())).into());
    }
    Ok(())
}

impl Store {
    /// Keeps a file of a job; what is appended to it meanwhile is left out.
    pub(crate) async fn keep(
        &self,
        job: &str,
        name: &str,
        path: &Path,
    ) -> Result<Artifact, StoreError> {
        let mut pieces = Pieces::of(path).await?;
        let bytes = pieces.left;
        if bytes <= PIECE {
            let contents = pieces.next().await?.unwrap_or_default();
            return self.keep_bytes(job, name, contents).await;
        }
        let mut hasher = blake3::Hasher::new();
        while let Some(piece) = pieces.next().await? {
            hasher.update(&piece);
        }
        let hash = hasher.finalize();
        let _alone = self.keeping.lock().await;
        let key = key(&hash.to_hex());
        let is_there = match self.artifacts.head(&key).await {
            Ok(found) => found.size == bytes,
            Err(object_store::Error::NotFound { .. }) => false,
            Err(error) => return Err(error.into()),
        };
        if !is_there {
            let mut upload = self.artifacts.put_multipart(&key).await?;
            if let Err(error) = put(&mut *upload, path, bytes, hash).await {
                upload.abort().await?;
                return Err(error);
            }
            upload.complete().await?;
        }
        self.note_file(job, name, hash.to_hex().to_string(), bytes).await
    }

    /// Keeps bytes as a file of a job, or of whatever else has an id.
    pub(crate) async fn keep_bytes(
        &self,
        job: &str,
        name: &str,
        contents: Vec<u8>,
    ) -> Result<Artifact, StoreError> {
        let (hash, contents) = tokio::task::spawn_blocking(move || {
            (blake3::hash(&contents).to_hex().to_string(), contents)
        })
        .await
        .map_err(std::io::Error::other)?;
        let _alone = self.keeping.lock().await;
        let bytes = contents.len() as u64;
        let only_new = PutOptions { mode: PutMode::Create, ..PutOptions::default() };
        let payload = object_store::PutPayload::from(contents);
        match self.artifacts.put_opts(&key(&hash), payload.clone(), only_new).await {
            Ok(_) => {}
            Err(object_store::Error::AlreadyExists { .. }) => {
                // Left by a machine that lost its power in the middle.
                if self.artifacts.head(&key(&hash)).await?.size != bytes {
                    self.artifacts.put(&key(&hash), payload).await?;
                }
            }
            Err(error) => return Err(error.into()),
        }
        self.note_file(job, name, hash, bytes).await
    }

    /// Writes down that a job has a file.
    async fn note_file(
        &self,
        job: &str,
        name: &str,
        hash: String,
        bytes: u64,
    ) -> Result<Artifact, StoreError> {
        let content_type = content_type(name);
        let mut change = self.begin().await?;
        sqlx::query("INSERT OR IGNORE INTO artifacts (hash, bytes, content_type, created_at) VALUES (?, ?, ?, ?)")
            .bind(&hash)
            .bind(bytes as i64)
            .bind(content_type)
            .bind(Utc::now().to_rfc3339())
            .execute(&mut *change)
            .await?;
        sqlx::query("INSERT OR REPLACE INTO job_artifacts (job, name, hash) VALUES (?, ?, ?)")
            .bind(job)
            .bind(name)
            .bind(&hash)
            .execute(&mut *change)
            .await?;
        change.commit().await?;
        Ok(Artifact { name: name.into(), hash, bytes, content_type: content_type.into() })
    }

    /// Forgets the files of a job, or of whatever else has an id, all of them or those of these names, and removes what
    /// nothing else names.
    pub(crate) async fn forget_files(
        &self,
        owner: &str,
        names: Option<&[String]>,
    ) -> Result<(), StoreError> {
        let _alone = self.keeping.lock().await;
        let mut change = self.begin().await?;
        let mut files: Vec<(String, String)> =
            sqlx::query_as("SELECT name, hash FROM job_artifacts WHERE job = ?")
                .bind(owner)
                .fetch_all(&mut *change)
                .await?;
        files.retain(|(name, _)| names.is_none_or(|names| names.contains(name)));
        for (name, _) in &files {
            sqlx::query("DELETE FROM job_artifacts WHERE job = ? AND name = ?")
                .bind(owner)
                .bind(name)
                .execute(&mut *change)
                .await?;
        }
        change.commit().await?;
        self.remove_unnamed(files.into_iter().map(|(_, hash)| hash).collect()).await
    }

    /// Ids under which a file of a mesh is kept, though there is no such mesh.
    pub(crate) async fn meshes_without_record(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT DISTINCT job FROM job_artifacts
             WHERE substr(job, 1, 4) = 'msh_' AND job NOT IN (SELECT id FROM records)",
        )
        .fetch_all(&self.readers)
        .await?)
    }

    /// Removes those of these files that nothing names any more.
    pub(crate) async fn forget_unnamed(&self, hashes: Vec<String>) -> Result<(), StoreError> {
        let _alone = self.keeping.lock().await;
        self.remove_unnamed(hashes).await
    }

    async fn remove_unnamed(&self, hashes: Vec<String>) -> Result<(), StoreError> {
        let mut change = self.begin().await?;
        let mut orphans = Vec::new();
        for hash in hashes {
            let gone = sqlx::query(
                "DELETE FROM artifacts WHERE hash = ?
                 AND NOT EXISTS (SELECT 1 FROM job_artifacts WHERE hash = artifacts.hash)
                 AND NOT EXISTS (SELECT 1 FROM records WHERE instr(record, artifacts.hash))",
            )
            .bind(&hash)
            .execute(&mut *change)
            .await?;
            if gone.rows_affected() == 1 {
                orphans.push(hash);
            }
        }
        change.commit().await?;
        for hash in orphans {
            match self.artifacts.delete(&key(&hash)).await {
                Ok(()) | Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Files of a job, by name.
    pub(crate) async fn artifacts_of(&self, job: &str) -> Result<Vec<Artifact>, StoreError> {
        let rows = sqlx::query(
            "SELECT name, hash, bytes, content_type FROM job_artifacts JOIN artifacts USING (hash)
             WHERE job = ? ORDER BY name",
        )
        .bind(job)
        .fetch_all(&self.readers)
        .await?;
        let artifact = |row: &sqlx::sqlite::SqliteRow| -> Result<Artifact, StoreError> {
            Ok(Artifact {
                name: row.try_get("name")?,
                hash: row.try_get("hash")?,
                bytes: row.try_get::<i64, _>("bytes")? as u64,
                content_type: row.try_get("content_type")?,
            })
        };
        rows.iter().map(artifact).collect()
    }

    /// Length and type of an artifact, if there is one of this hash.
    pub(crate) async fn artifact(&self, hash: &str) -> Result<Option<(u64, String)>, StoreError> {
        let found: Option<(i64, String)> =
            sqlx::query_as("SELECT bytes, content_type FROM artifacts WHERE hash = ?")
                .bind(hash)
                .fetch_optional(&self.readers)
                .await?;
        Ok(found.map(|(bytes, content_type)| (bytes as u64, content_type)))
    }

    /// What an artifact holds, from one byte to before another.
    pub(crate) async fn contents(
        &self,
        hash: &str,
        range: std::ops::Range<u64>,
    ) -> Result<axum::body::Body, StoreError> {
        if range.is_empty() {
            return Ok(axum::body::Body::empty());
        }
        let wanted = GetOptions::new().with_range(Some(range));
        let found = self.artifacts.get_opts(&key(hash), wanted).await?;
        Ok(axum::body::Body::from_stream(found.into_stream()))
    }

    /// Writes an artifact to a file, beside its place and renamed.
    pub(crate) async fn copy_to(&self, hash: &str, path: &Path) -> Result<(), StoreError> {
        let bytes = self.artifacts.get(&key(hash)).await?.bytes().await?;
        if let Some(parent) = path.parent() {
            tokio::fs::create_dir_all(parent).await?;
        }
        let beside = path.with_extension("part");
        let mut file = tokio::fs::File::create(&beside).await?;
        file.write_all(&bytes).await?;
        // What has its name is whole, whenever the power fails.
        file.sync_all().await?;
        Ok(tokio::fs::rename(&beside, path).await?)
    }
}
