//! Receives a tar archive: writes its files to a temporary folder, within limits.
//!
//! An archive is untrusted. It contains regular files only: no links and no devices. Its paths stay in the folder.

use crate::{AppState, Problem};
use axum::extract::Request;
use futures_util::{StreamExt, TryStreamExt};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncReadExt};
use tokio::runtime::Handle;
use tokio::sync::Semaphore;
use tokio_util::io::StreamReader;

/// Maximum total size of the files of an archive (bytes).
pub(crate) const MAX_ARCHIVE_BYTES: u64 = 64_000_000_000;

/// Maximum number of entries of an archive.
const MAX_ENTRIES: usize = 100_000;

/// Maximum length of a path (bytes) and maximum number of its components.
const MAX_PATH_BYTES: usize = 255;
const MAX_PATH_DEPTH: usize = 8;

/// Maximum size of extended attributes of an entry (bytes), as some programs add them for file times.
const MAX_EXTENSION_BYTES: u64 = 1 << 16;

/// Maximum length of the padding after the last entry that is read (bytes).
const MAX_PADDING_BYTES: u64 = 1 << 20;

/// Free disk space is checked after this many bytes.
const SPACE_CHECK_BYTES: u64 = 64 << 20;

/// Maximum duration of an upload: the largest archive at about 3 MB/s. The body then ends.
const MAX_DURATION: Duration = Duration::from_secs(6 * 3600);

/// Limits concurrent uploads: each occupies a thread.
static PERMITS: Semaphore = Semaphore::const_new(2);

/// Received files.
#[derive(Debug)]
pub(crate) struct Received {
    /// Folder with the files; deleted with this value.
    _folder: TempDir,
    /// Folder that contains the manifest: the root of the archive, or the only folder in it.
    pub(crate) root: PathBuf,
    /// Paths of all files relative to the root, with slashes.
    pub(crate) paths: BTreeSet<String>,
}

/// Receives the archive in the body of a request. `manifest`: name of the file at its root.
pub(crate) async fn receive(
    state: &AppState,
    uploads: &Path,
    manifest: &'static str,
    request: Request,
) -> Result<Received, Problem> {
    state.quotas.ensure_free_space(uploads)?;
    let Ok(permit) = PERMITS.try_acquire() else { return Err(Problem::too_many_uploads()) };
    let unwritable = |error: io::Error| Problem::file_unreadable(&error);
    let folder = TempDir::new_in(uploads).map_err(unwritable)?;
    let body = request.into_body().into_data_stream().map_err(io::Error::other);
    let body = body.take_until(tokio::time::sleep(MAX_DURATION));
    let reader = StreamReader::new(Box::pin(body));
    let body = BlockingReader { reader, runtime: Handle::current() };
    let (state, uploads) = (state.clone(), uploads.to_owned());
    let received = tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let has_space = || state.quotas.ensure_free_space(&uploads);
        // The temporary folder itself is readable by its owner only.
        let root = folder.path().join("files");
        std::fs::create_dir(&root).map_err(unwritable)?;
        let paths = Unpacker::new(&root, &has_space).unpack(body)?;
        locate_root(folder, root, paths, manifest)
    });
    received.await.map_err(|error| Problem::file_unreadable(&io::Error::other(error)))?
}

/// Reads asynchronous data on a thread that may block.
struct BlockingReader<R> {
    reader: R,
    runtime: Handle,
}

impl<R: AsyncRead + Unpin> Read for BlockingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.runtime.block_on(self.reader.read(buffer))
    }
}

/// Writes the entries of an archive to a folder.
struct Unpacker<'a> {
    folder: &'a Path,
    ensure_free_space: &'a dyn Fn() -> Result<(), Problem>,
    paths: BTreeSet<String>,
    total_bytes: u64,
    /// Bytes written since the last check of the disk space.
    unchecked_bytes: u64,
}

impl<'a> Unpacker<'a> {
    fn new(folder: &'a Path, ensure_free_space: &'a dyn Fn() -> Result<(), Problem>) -> Self {
        let paths = BTreeSet::new();
        Self { folder, ensure_free_space, paths, total_bytes: 0, unchecked_bytes: 0 }
    }

    /// Writes all files; returns their paths.
    fn unpack(mut self, body: impl Read) -> Result<BTreeSet<String>, Problem> {
        let mut archive = tar::Archive::new(body);
        // Raw entries: the library would read extended attributes of any size into memory.
        let entries = archive.entries().map_err(|error| incomplete(&error))?.raw(true);
        for (index, entry) in entries.enumerate() {
            if index == MAX_ENTRIES {
                return Err(Problem::invalid_archive(format!("more than {MAX_ENTRIES} entries")));
            }
            let mut entry = entry.map_err(|error| invalid_header(&error))?;
            let path = relative_path(&entry.path_bytes())?;
            match entry.header().entry_type() {
                tar::EntryType::Directory => {}
                tar::EntryType::XHeader | tar::EntryType::XGlobalHeader => {
                    check_extension(&mut entry)?;
                }
                tar::EntryType::Regular | tar::EntryType::Continuous => {
                    self.write(&path, &mut entry)?;
                }
                other => {
                    let reason = format!("{path} is not a regular file (type {other:?})");
                    return Err(Problem::invalid_archive(reason));
                }
            }
        }
        // The padding at the end: a client may not read the response before it has sent everything.
        let mut rest = archive.into_inner().take(MAX_PADDING_BYTES);
        io::copy(&mut rest, &mut io::sink()).map_err(|error| incomplete(&error))?;
        Ok(self.paths)
    }

    /// Writes one file.
    fn write<R: Read>(&mut self, path: &str, entry: &mut tar::Entry<R>) -> Result<(), Problem> {
        let bytes = entry.header().entry_size().map_err(|error| invalid_header(&error))?;
        self.total_bytes = self.total_bytes.saturating_add(bytes);
        if self.total_bytes > MAX_ARCHIVE_BYTES {
            return Err(Problem::invalid_archive(format!("more than {MAX_ARCHIVE_BYTES} bytes")));
        }
        if !self.paths.insert(path.to_owned()) {
            return Err(Problem::invalid_archive(format!("{path} occurs twice")));
        }
        let target = self.folder.join(path);
        let unwritable = |error: io::Error| match error.kind() {
            // A file and a folder have the same path.
            io::ErrorKind::AlreadyExists | io::ErrorKind::NotADirectory => {
                Problem::invalid_archive(format!("{path} is both a file and a folder"))
            }
            _ => Problem::file_unreadable(&error),
        };
        std::fs::create_dir_all(target.parent().unwrap_or(self.folder)).map_err(unwritable)?;
        let mut file = File::create_new(&target).map_err(unwritable)?;
        let mut left = bytes;
        while left > 0 {
            let part = left.min(SPACE_CHECK_BYTES);
            let copied =
                io::copy(&mut entry.by_ref().take(part), &mut file).map_err(|e| incomplete(&e))?;
            if copied == 0 {
                return Err(Problem::incomplete_body("the archive ends in a file"));
            }
            left -= copied;
            self.unchecked_bytes += copied;
            if self.unchecked_bytes >= SPACE_CHECK_BYTES {
                self.unchecked_bytes = 0;
                (self.ensure_free_space)()?;
            }
        }
        Ok(())
    }
}

/// The body ended, or the disk is full.
fn incomplete(error: &io::Error) -> Problem {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            Problem::file_unreadable(error)
        }
        _ => Problem::incomplete_body(&error.to_string()),
    }
}

fn invalid_header(error: &io::Error) -> Problem {
    Problem::invalid_archive(format!("it is not a tar archive: {error}"))
}

/// Path of an entry: relative, of normal components, with slashes. Empty for the root folder.
fn relative_path(bytes: &[u8]) -> Result<String, Problem> {
    let shown = String::from_utf8_lossy(bytes);
    let invalid = |reason: &str| Problem::invalid_archive(format!("the path {shown:?} {reason}"));
    let text = std::str::from_utf8(bytes).map_err(|_| invalid("is not UTF-8"))?;
    if text.len() > MAX_PATH_BYTES {
        return Err(invalid("is too long"));
    }
    // Backslashes and colons separate components on Windows.
    if text.contains(['\\', ':']) || text.chars().any(char::is_control) {
        return Err(invalid("has an invalid character"));
    }
    let mut names = Vec::new();
    for component in Path::new(text).components() {
        match component {
            Component::Normal(name) => names.push(name.to_string_lossy()),
            Component::CurDir => {}
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => {
                return Err(invalid("leaves the folder"));
            }
        }
    }
    if names.len() > MAX_PATH_DEPTH {
        return Err(invalid("has too many folders"));
    }
    Ok(names.join("/"))
}

/// Skips extended attributes; rejects those that replace the path, the size or the target of the next entry.
fn check_extension<R: Read>(entry: &mut tar::Entry<R>) -> Result<(), Problem> {
    let mut text = Vec::new();
    entry
        .by_ref()
        .take(MAX_EXTENSION_BYTES + 1)
        .read_to_end(&mut text)
        .map_err(|e| incomplete(&e))?;
    if text.len() as u64 > MAX_EXTENSION_BYTES {
        return Err(Problem::invalid_archive("the extended attributes are too long"));
    }
    for extension in tar::PaxExtensions::new(&text) {
        let extension = extension.map_err(|error| invalid_header(&error))?;
        let key = String::from_utf8_lossy(extension.key_bytes());
        if ["path", "size", "linkpath"].contains(&key.as_ref()) || key.starts_with("GNU.sparse") {
            let reason =
                format!("extended attribute {key} is not supported; use tar --format=ustar");
            return Err(Problem::invalid_archive(reason));
        }
    }
    Ok(())
}

/// Finds the folder with the manifest, at the root of the archive or in its only folder.
fn locate_root(
    folder: TempDir,
    root: PathBuf,
    paths: BTreeSet<String>,
    manifest: &str,
) -> Result<Received, Problem> {
    if paths.contains(manifest) {
        return Ok(Received { _folder: folder, root, paths });
    }
    let top = paths.first().and_then(|path| Some(path.split_once('/')?.0.to_owned()));
    let inner = top.as_ref().and_then(|top| {
        let inner = |path: &String| Some(path.strip_prefix(top)?.strip_prefix('/')?.to_owned());
        paths.iter().map(inner).collect::<Option<BTreeSet<String>>>()
    });
    match (top, inner) {
        (Some(top), Some(paths)) if paths.contains(manifest) => {
            Ok(Received { _folder: folder, root: root.join(top), paths })
        }
        _ => Err(Problem::invalid_archive(format!("it has no {manifest} at its root"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ProblemCode;

    /// Archive with one entry of this type, path and contents.
    fn tar_of(kind: tar::EntryType, path: &[u8], contents: &[u8]) -> Vec<u8> {
        let mut header = tar::Header::new_ustar();
        header.as_old_mut().name[..path.len()].copy_from_slice(path);
        header.set_entry_type(kind);
        header.set_size(contents.len() as u64);
        header.set_cksum();
        let mut bytes = header.as_bytes().to_vec();
        bytes.extend(contents);
        bytes.resize(bytes.len().next_multiple_of(512), 0);
        bytes
    }

    fn file(path: &str) -> Vec<u8> {
        tar_of(tar::EntryType::Regular, path.as_bytes(), b"1")
    }

    fn unpack(bytes: &[u8]) -> Result<BTreeSet<String>, Problem> {
        let folder = tempfile::tempdir().unwrap();
        let outer = folder.path().join("inner");
        std::fs::create_dir(&outer).unwrap();
        let result = Unpacker::new(&outer, &|| Ok(())).unpack(bytes);
        assert_eq!(folder.path().read_dir().unwrap().count(), 1, "a file left the folder");
        result
    }

    fn assert_rejected(bytes: &[u8], reason: &str) {
        let problem = unpack(bytes).unwrap_err();
        assert_eq!(problem.code, ProblemCode::InvalidArchive, "{}", problem.detail);
        assert!(problem.detail.contains(reason), "{} has no {reason:?}", problem.detail);
    }

    #[test]
    fn regular_files_in_folders_are_unpacked() {
        let folder = tar_of(tar::EntryType::Directory, b"./a/", b"");
        let paths = unpack(&[folder, file("./a/b.json"), file("c")].concat()).unwrap();
        assert_eq!(paths, BTreeSet::from(["a/b.json".to_owned(), "c".to_owned()]));
    }

    #[test]
    fn paths_that_leave_the_folder_are_rejected() {
        for path in ["../x", "a/../../x", "/x", "a/../b"] {
            assert_rejected(&file(path), "leaves the folder");
        }
        for path in ["a\\..\\x", "c:x", "a\nb"] {
            assert_rejected(&file(path), "invalid character");
        }
        assert_rejected(&file("a/b/c/d/e/f/g/h/i"), "too many folders");
    }

    #[test]
    fn links_and_devices_are_rejected() {
        use tar::EntryType;
        for kind in [EntryType::Symlink, EntryType::Link, EntryType::Char, EntryType::Fifo] {
            assert_rejected(&tar_of(kind, b"x", b""), "not a regular file");
        }
    }

    #[test]
    fn ambiguous_paths_are_rejected() {
        assert_rejected(&[file("a"), file("./a")].concat(), "occurs twice");
        assert_rejected(&[file("a"), file("a/b")].concat(), "both a file and a folder");
        assert_rejected(&[file("a/b"), file("a")].concat(), "both a file and a folder");
    }

    #[test]
    fn only_harmless_extended_attributes_are_accepted() {
        let times = tar_of(tar::EntryType::XHeader, b"x", b"19 mtime=1700000.5\n");
        assert_eq!(unpack(&[times, file("a")].concat()).unwrap().len(), 1);
        let path = tar_of(tar::EntryType::XHeader, b"x", b"16 path=../../x\n");
        assert_rejected(&[path, file("a")].concat(), "path");
        let long = tar_of(tar::EntryType::XHeader, b"x", &vec![b'\n'; 1 << 17]);
        assert_rejected(&long, "too long");
    }

    #[test]
    fn incomplete_and_foreign_data_are_rejected() {
        let cut = tar_of(tar::EntryType::Regular, b"a", &[1; 2000]);
        assert_eq!(unpack(&cut[..1000]).unwrap_err().code, ProblemCode::IncompleteBody);
        assert_rejected(&[b'x'; 1024], "not a tar archive");
    }

    #[test]
    fn manifest_is_found_at_the_root_or_in_the_only_folder() {
        let locate = |paths: &[&str]| {
            let paths = paths.iter().map(|path| (*path).to_owned()).collect();
            locate_root(tempfile::tempdir().unwrap(), "root".into(), paths, "m.json")
        };
        let expected = BTreeSet::from(["data/x".to_owned(), "m.json".to_owned()]);
        assert_eq!(locate(&["m.json", "data/x"]).unwrap().paths, expected);
        let inner = locate(&["ds/m.json", "ds/data/x"]).unwrap();
        assert!(inner.root.ends_with("ds") && inner.paths == expected);
        for paths in [&["ds/m.json", "x"][..], &["ds/m.json", "dt/x"], &["x"], &[]] {
            assert!(locate(paths).is_err(), "{paths:?}");
        }
    }
}
