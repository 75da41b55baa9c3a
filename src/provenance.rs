//! Where a session comes from: with which program, on which host, by which command and when it was learnt. Kept in a
//! file of its own beside the session, which is the same whenever and wherever it is learnt.

use std::path::Path;
use std::time::SystemTime;
use std::{env, fs};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::host::Host;

/// One run of a session's learner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// UTC.
    pub started: String,
    /// Trials there were before.
    pub after: u64,
    pub version: String,
    /// The commit the program was built from, where its build knew one.
    pub commit: Option<String>,
    pub host: String,
    pub cpu: String,
    pub kernel: String,
    pub command: String,
}

impl Run {
    /// This process, as it goes on with a session after `after` trials.
    pub fn here(after: u64) -> Run {
        let Host { cpu, kernel, .. } = Host::here();
        let started =
            prost_types::Timestamp { nanos: 0, ..prost_types::Timestamp::from(SystemTime::now()) };
        let words = env::args().enumerate().map(|(i, word)| match i {
            // The program, not where it lies.
            0 => "skillet".to_owned(),
            _ => quoted(&word),
        });
        Run {
            started: started.to_string(),
            after,
            version: env!("CARGO_PKG_VERSION").into(),
            commit: option_env!("SKILLET_BUILT_FROM").map(str::to_owned),
            host: fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().into(),
            cpu,
            kernel,
            command: words.collect::<Vec<_>>().join(" "),
        }
    }
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

/// All runs of a session, oldest first; none where there is no file.
///
/// # Errors
/// The file cannot be read, or is damaged.
pub fn read(path: &Path) -> Result<Vec<Run>> {
    match fs::read_to_string(path) {
        Ok(text) => serde_json::from_str(&text)
            .with_context(|| format!("{}: it is damaged; delete it", path.display())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(error).with_context(|| format!("{}: cannot read", path.display())),
    }
}

/// Adds a run. One that executed nothing yet is replaced: it was stopped before the first rollout.
///
/// # Errors
/// The file cannot be written, or is damaged.
pub fn add(path: &Path, run: Run) -> Result<()> {
    let mut runs = read(path)?;
    runs.retain(|other| other.after != run.after);
    runs.push(run);
    let text = serde_json::to_string_pretty(&runs)? + "\n";
    let draft = path.with_extension("json.new");
    fs::write(&draft, text)
        .and_then(|()| fs::rename(&draft, path))
        .with_context(|| format!("{}: cannot write", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_add_up_and_one_without_a_rollout_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("provenance.json");
        assert_eq!(read(&path).unwrap(), []);
        for (after, command) in [(0, "first"), (0, "again"), (60, "more")] {
            add(&path, Run { command: command.into(), ..Run::here(after) }).unwrap();
        }
        let runs = read(&path).unwrap();
        let commands: Vec<&str> = runs.iter().map(|run| run.command.as_str()).collect();
        assert_eq!(commands, ["again", "more"]);
        assert!(runs[0].started.ends_with('Z') && runs[0].started.len() == 20, "{runs:?}");
        fs::write(&path, "[{").unwrap();
        assert!(format!("{:#}", read(&path).unwrap_err()).contains("it is damaged"));
    }

    #[test]
    fn a_command_can_be_typed_again() {
        assert_eq!(
            ["--out", "a b", "it's", ""].map(quoted),
            ["--out", "'a b'", r"'it'\''s'", "''"]
        );
    }
}
