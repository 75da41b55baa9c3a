//! Standard output that a closed pipe does not turn into a panic.

use std::io::{ErrorKind, Write};

use anyhow::{Context, Result};

/// Prints `text`. Whoever closed the pipe (`| head`) has seen enough: that is no error.
pub fn print(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("writing to standard output")
        }
        _ => Ok(()),
    }
}

/// Prints one JSON value and a newline.
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(&format!("{}\n", serde_json::to_string_pretty(value)?))
}
