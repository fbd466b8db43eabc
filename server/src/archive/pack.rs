//! Sends files as a tar archive. Equal files give equal bytes, so that ranges of an archive can be requested.

use crate::jobs::scheduler::JobScheduler;
use axum::body::{Body, Bytes};
use futures_util::stream::{self, BoxStream, StreamExt, TryStreamExt};
use std::io::{self, SeekFrom};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio_util::io::ReaderStream;

/// Size (bytes) to which tar pads headers and files.
const BLOCK: u64 = 512;

/// Chunk size for reading files (bytes).
const CHUNK: usize = 1 << 16;

/// Where the contents of an entry are.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    /// A file on disk.
    File(PathBuf),
    /// An artifact of this scheduler with this BLAKE3 (hex).
    Artifact(Arc<JobScheduler>, String),
    /// Contents in memory.
    Bytes(Bytes),
}

/// A tar archive that is read on demand.
#[derive(Debug, Default)]
pub(crate) struct Archive {
    /// Headers, contents and padding in order, with their lengths (bytes).
    segments: Vec<(Source, u64)>,
}

impl Archive {
    /// Adds a file of `bytes` bytes under a path with slashes.
    pub(crate) fn add(&mut self, path: &str, source: Source, bytes: u64) -> io::Result<()> {
        let mut header = tar::Header::new_ustar();
        header.set_path(path)?;
        header.set_size(bytes);
        header.set_mode(0o644);
        // No time, owner or group: they would make the bytes differ between servers.
        header.set_mtime(0);
        header.set_uid(0);
        header.set_gid(0);
        header.set_entry_type(tar::EntryType::Regular);
        header.set_cksum();
        self.add_bytes(header.as_bytes().to_vec());
        self.segments.push((source, bytes));
        self.add_bytes(vec![0; (bytes.next_multiple_of(BLOCK) - bytes) as usize]);
        Ok(())
    }

    /// Adds the end of the archive: two blocks of zeros.
    pub(crate) fn finish(mut self) -> Self {
        self.add_bytes(vec![0; 2 * BLOCK as usize]);
        self
    }

    fn add_bytes(&mut self, bytes: Vec<u8>) {
        let length = bytes.len() as u64;
        self.segments.push((Source::Bytes(bytes.into()), length));
    }

    /// Length (bytes).
    pub(crate) fn len(&self) -> u64 {
        self.segments.iter().map(|(_, bytes)| bytes).sum()
    }

    /// Body with a byte range of the archive. If a file has become shorter, the body is too short, and the
    /// connection ends with an error.
    pub(crate) fn read_range(self, range: Range<u64>) -> Body {
        let mut start = 0;
        let mut parts = Vec::new();
        for (source, bytes) in self.segments {
            let [from, to] =
                [range.start, range.end].map(|at| at.clamp(start, start + bytes) - start);
            if from < to {
                parts.push((source, from..to));
            }
            start += bytes;
        }
        let chunks = stream::iter(parts).then(|(source, range)| source.read(range)).try_flatten();
        Body::from_stream(chunks)
    }
}

impl Source {
    /// Stream of a byte range.
    async fn read(self, range: Range<u64>) -> io::Result<BoxStream<'static, io::Result<Bytes>>> {
        Ok(match self {
            Self::Bytes(bytes) => {
                let part = bytes.slice(range.start as usize..range.end as usize);
                stream::iter([Ok(part)]).boxed()
            }
            Self::File(path) => {
                let mut file = tokio::fs::File::open(path).await?;
                file.seek(SeekFrom::Start(range.start)).await?;
                let part = file.take(range.end - range.start);
                ReaderStream::with_capacity(part, CHUNK).boxed()
            }
            Self::Artifact(scheduler, hash) => {
                let body = scheduler.store.read_range(&hash, range).await;
                let body = body.map_err(io::Error::other)?;
                body.into_data_stream().map_err(io::Error::other).boxed()
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use http_body_util::BodyExt;
    use std::io::Read;

    /// Two files, of which the second is on disk, in a new archive.
    fn archive(folder: &std::path::Path) -> Archive {
        let file = folder.join("b");
        std::fs::write(&file, [7; 1000]).unwrap();
        let mut archive = Archive::default();
        archive.add("x/a.json", Source::Bytes("{}".into()), 2).unwrap();
        archive.add("x/y/b", Source::File(file), 1000).unwrap();
        archive.finish()
    }

    async fn bytes(archive: Archive, range: Range<u64>) -> Vec<u8> {
        archive.read_range(range).collect().await.unwrap().to_bytes().to_vec()
    }

    #[tokio::test]
    async fn archive_has_all_files_and_the_announced_length() {
        let folder = tempfile::tempdir().unwrap();
        let archive = archive(folder.path());
        let length = archive.len();
        let all = bytes(archive, 0..length).await;
        // Header and contents of each file in blocks of 512 bytes, then two blocks.
        assert_eq!((all.len() as u64, length), (512 * (2 + 3 + 2), 512 * (2 + 3 + 2)));
        let mut reader = tar::Archive::new(&all[..]);
        let mut entries = reader.entries().unwrap().map(|entry| {
            let mut entry = entry.unwrap();
            let mut contents = Vec::new();
            entry.read_to_end(&mut contents).unwrap();
            (entry.path().unwrap().to_string_lossy().into_owned(), contents)
        });
        assert_eq!(entries.next(), Some(("x/a.json".to_owned(), b"{}".to_vec())));
        assert_eq!(entries.next(), Some(("x/y/b".to_owned(), vec![7; 1000])));
        assert_eq!(entries.next(), None);
    }

    #[tokio::test]
    async fn ranges_are_parts_of_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let all = bytes(archive(folder.path()), 0..3584).await;
        for (start, end) in [(0, 1), (500, 515), (511, 1024), (1530, 2600), (3583, 3584), (9, 9)] {
            let part = bytes(archive(folder.path()), start..end).await;
            assert_eq!(part, all[start as usize..end as usize], "{start}..{end}");
        }
    }
}
