//! Recordings as MCAP files: bounded in size, whole after a crash.
//!
//! A file in the making is called `NAME.mcap.part` and locked. It holds complete chunks up to the last
//! second; when its writer dies, the next recorder in the folder repairs the file.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use foxglove::{Context, McapCompression, McapWriteOptions, McapWriterHandle};
use rustix::fs::{FlockOperation, flock};

use super::recover::recover;

const PART: &str = "part";
/// So much is lost at most when the process is killed.
const FLUSH: Duration = Duration::from_secs(1);
/// zstd level that costs a core little at 1 kHz.
const COMPRESSION_LEVEL: u32 = 9;

/// A counting writer, since the library does not expose how much it has written.
struct Counted {
    file: BufWriter<File>,
    bytes: Arc<AtomicU64>,
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.file.write(bytes)?;
        self.bytes.fetch_add(n as u64, Ordering::Relaxed);
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Counted {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.file.seek(to)
    }
}

/// One MCAP file in the making.
pub struct RecordingFile {
    path: PathBuf,
    writer: McapWriterHandle<Counted>,
    bytes: Arc<AtomicU64>,
    flushed: Instant,
}

impl RecordingFile {
    /// Records what `context` is told from now on, as `path` when finished. What `path` held before
    /// stays until then.
    pub fn create(path: &Path, context: &Arc<Context>) -> Result<RecordingFile> {
        let part = part(path);
        let file = File::create(&part)
            .with_context(|| format!("{}: cannot record there; check --out", part.display()))?;
        if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
            anyhow::bail!("{}: is being written by another process", part.display());
        }
        let bytes = Arc::new(AtomicU64::new(0));
        let counted = Counted { file: BufWriter::new(file), bytes: bytes.clone() };
        let options = McapWriteOptions::new()
            .compression(Some(McapCompression::Zstd))
            .compression_level(COMPRESSION_LEVEL)
            // In the thread that writes: a recorder is to take no other core.
            .compression_threads(0)
            .profile("");
        let writer = context
            .mcap_writer_with_options(options)
            .create(counted)
            .with_context(|| format!("{}: cannot begin a recording", part.display()))?;
        Ok(RecordingFile { path: path.to_path_buf(), writer, bytes, flushed: Instant::now() })
    }

    /// Something that a reader may need beside the messages, such as the configuration.
    pub fn attach(&self, name: &str, media_type: &str, text: &str) -> Result<()> {
        let attachment = mcap::Attachment {
            log_time: 0,
            create_time: 0,
            name: name.into(),
            media_type: media_type.into(),
            data: text.as_bytes().into(),
        };
        self.writer.attach(&attachment).with_context(|| self.cannot("write"))
    }

    /// Something that a reader should know of the whole file.
    pub fn describe(&self, name: &str, values: BTreeMap<String, String>) -> Result<()> {
        self.writer.write_metadata(name, values).with_context(|| self.cannot("write"))
    }

    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Writes out what is complete, once a second.
    pub fn keep(&mut self) -> Result<()> {
        if self.flushed.elapsed() >= FLUSH {
            self.writer.flush().with_context(|| self.cannot("write"))?;
            self.flushed = Instant::now();
        }
        Ok(())
    }

    /// Completes the file and gives it its name.
    pub fn finish(self) -> Result<PathBuf> {
        let cannot = self.cannot("finish");
        let counted = self.writer.close().with_context(|| cannot.clone())?;
        let file = counted.file.into_inner().map_err(|error| error.into_error());
        file.and_then(|file| file.sync_all()).with_context(|| cannot.clone())?;
        fs::rename(part(&self.path), &self.path).context(cannot)?;
        Ok(self.path)
    }

    fn cannot(&self, what: &str) -> String {
        format!("{}: cannot {what} the recording; check the free space", self.path.display())
    }
}

/// Makes whole files of what dead processes left in `dir`; returns them.
pub fn recover_left(dir: &Path) -> Result<Vec<PathBuf>> {
    let mut recovered = Vec::new();
    let Ok(entries) = fs::read_dir(dir) else { return Ok(recovered) };
    for left in entries.flatten().map(|entry| entry.path()) {
        let is_part = left.extension().is_some_and(|extension| extension == PART);
        let path = left.with_extension("");
        if !is_part || path.extension().is_none_or(|extension| extension != "mcap") {
            continue;
        }
        let Ok(file) = File::open(&left) else { continue };
        // Locked: its recorder is still running.
        if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
            continue;
        }
        let path = first(&path, |path| !path.exists());
        recover(&left, &path)
            .with_context(|| format!("{}: cannot be recovered", left.display()))?;
        fs::remove_file(&left)?;
        recovered.push(path);
    }
    Ok(recovered)
}

/// `path`, or the first of `NAME-2.mcap`, `NAME-3.mcap` … that nobody has or writes.
pub fn free(path: &Path) -> PathBuf {
    first(path, |path| !path.exists() && !part(path).exists())
}

fn first(path: &Path, is_free: impl Fn(&Path) -> bool) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let numbered = (2..).map(|n| path.with_file_name(format!("{stem}-{n}.mcap")));
    let mut paths = std::iter::once(path.to_path_buf()).chain(numbered);
    paths.find(|path| is_free(path)).expect("some number is free")
}

fn part(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{PART}"));
    name.into()
}
