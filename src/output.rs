//! Standard output that a closed pipe does not turn into a panic, and files that replace none.

use std::io::{ErrorKind, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};

use crate::fields;

/// Nobody reads standard output any more.
static IS_CLOSED: AtomicBool = AtomicBool::new(false);

/// The reader has closed standard output: a command that prints repeatedly ends.
pub fn is_closed() -> bool {
    IS_CLOSED.load(Ordering::Relaxed)
}

/// Prints `text`. A closed pipe (`| head`) is not an error.
pub fn print(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {
            IS_CLOSED.store(true, Ordering::Relaxed);
            Ok(())
        }
        written => written.context("writing to standard output"),
    }
}

/// Prints one JSON object, with its version, and a newline.
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(&format!("{:#}\n", fields::versioned(value)?))
}

/// The same in one line, for a command that prints several.
pub fn json_line(value: &impl serde::Serialize) -> Result<String> {
    Ok(format!("{}\n", fields::versioned(value)?))
}

/// Writes a file that is not there yet.
pub fn write_new(path: &Path, text: &str) -> Result<()> {
    if path.exists() {
        bail!("{}: already exists: choose another name, or remove it first", path.display());
    }
    write(path, text)
}

/// Writes a file; it appears whole or not at all, also in place of another one.
pub fn write(path: &Path, text: &str) -> Result<()> {
    let name = path.file_name().with_context(|| format!("{}: not a file", path.display()))?;
    let draft = path.with_file_name(format!(".{}.new", name.to_string_lossy()));
    std::fs::write(&draft, text).and_then(|()| std::fs::rename(&draft, path)).with_context(|| {
        format!("{}: cannot write; check folder, permissions and free space", path.display())
    })
}
