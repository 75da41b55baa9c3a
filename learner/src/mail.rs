//! The mailbox of a session: input from people to a learner that may be running, stopped or dying.
//!
//! A letter is a separate file in the folder `mail`, written aside, synchronised and renamed, so it is complete or
//! absent. The learner reads letters in the order of their names, which begin with the time. It stores their
//! effects together with their ids, and only then removes them. A letter found again after a kill is recognised
//! by its id: nothing is lost, nothing counts twice.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use shm_types::random_id;

/// Within the session folder.
const FOLDER: &str = "mail";
/// File endings of letters, and of refused letters.
const LETTER: &str = ".json";
const REFUSED: &str = "refused";

/// One message to a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Letter {
    /// Its unique id.
    pub id: u64,
    pub says: Says,
}

/// The content of a letter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Says {
    /// A rating of a rollout from 0 to 10; none withdraws the one it has.
    Rating { rollout: u64, rating: Option<f64> },
    /// A rollout, compared with another one.
    Comparison { rollout: u64, than: u64, is_better: bool },
    /// A further demonstration: the text and the name of its file.
    Demonstration { file: String, text: String },
}

/// A letter as it lies in the mailbox.
#[derive(Debug)]
pub struct Post {
    path: PathBuf,
    pub letter: Letter,
}

/// The mailbox of one session.
#[derive(Clone, Debug)]
pub struct Mail {
    dir: PathBuf,
    /// What kept it from being read, once said.
    trouble: Option<ErrorKind>,
}

impl Mail {
    /// The mailbox of the session in the folder `session`.
    pub fn of(session: &Path) -> Mail {
        Mail { dir: session.join(FOLDER), trouble: None }
    }

    /// Posts a letter: durable when this returns.
    pub fn post(&self, says: Says) -> io::Result<Post> {
        let letter = Letter { id: random_id(), says };
        let text = serde_json::to_string(&letter).map_err(io::Error::other)?;
        fs::create_dir_all(&self.dir)?;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let name = format!("{now:020}-{:016x}", letter.id);
        let (draft, path) = (self.dir.join(&name), self.dir.join(format!("{name}{LETTER}")));
        let mut file = File::create(&draft)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        fs::rename(&draft, &path)?;
        File::open(&self.dir)?.sync_all()?;
        Ok(Post { path, letter })
    }

    /// The letters that wait, the oldest first. Files that are no letters are put aside.
    pub fn read(&mut self) -> Vec<Post> {
        let mut paths = match self.letters() {
            Ok(paths) => paths,
            Err(error) => {
                if self.trouble.replace(error.kind()) != Some(error.kind()) {
                    tracing::warn!("{}: cannot be read: {error}", self.dir.display());
                }
                return Vec::new();
            }
        };
        self.trouble = None;
        paths.sort();
        let read = |path: PathBuf| match parse(&path) {
            Ok(letter) => Some(Post { path, letter }),
            Err(reason) => {
                refuse(&path, &reason);
                None
            }
        };
        paths.into_iter().filter_map(read).collect()
    }

    fn letters(&self) -> io::Result<Vec<PathBuf>> {
        let entries = match fs::read_dir(&self.dir) {
            // Nobody has ever written.
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let is_letter = |path: &PathBuf| {
            path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(LETTER))
        };
        let paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<PathBuf>>>()?;
        Ok(paths.into_iter().filter(is_letter).collect())
    }
}

impl Post {
    /// The learner has not taken it yet.
    pub fn waits(&self) -> bool {
        self.path.exists()
    }

    /// After what it says was made durable. What cannot be removed now is known by its id the next time.
    pub fn remove(&self) {
        let _ = fs::remove_file(&self.path);
    }

    /// Puts it aside, and says why.
    pub fn refuse(&self, reason: &str) {
        refuse(&self.path, reason);
    }
}

fn parse(path: &Path) -> Result<Letter, String> {
    let text = fs::read_to_string(path).map_err(|error| error.to_string())?;
    serde_json::from_str(&text).map_err(|error| error.to_string())
}

fn refuse(path: &Path, reason: &str) {
    let aside = path.with_extension(REFUSED);
    tracing::warn!("{}: refused: {reason}", aside.display());
    let _ = fs::rename(path, aside);
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn letters_come_in_their_order_and_stay_until_they_are_removed() {
        let folder = TempDir::new().unwrap();
        let mut mail = Mail::of(folder.path());
        assert!(mail.read().is_empty(), "nobody has written");
        let says = |rollout| Says::Rating { rollout, rating: Some(0.1 + 0.2) };
        let posted: Vec<Letter> = (1..4).map(|n| mail.post(says(n)).unwrap().letter).collect();
        for _ in 0..2 {
            let read: Vec<Letter> = mail.read().into_iter().map(|post| post.letter).collect();
            assert_eq!(read, posted);
        }
        let first = mail.read().remove(0);
        assert!(first.waits());
        first.remove();
        assert!(!first.waits());
        assert_eq!(mail.read().len(), 2);
    }

    #[test]
    fn what_is_no_letter_is_put_aside_and_what_is_not_finished_is_left_alone() {
        let folder = TempDir::new().unwrap();
        let mut mail = Mail::of(folder.path());
        let post = mail.post(Says::Comparison { rollout: 2, than: 1, is_better: true }).unwrap();
        let there = folder.path().join(FOLDER);
        for (name, text) in [
            ("1.json", "7"),
            ("2.json", r#"{"id": 1, "says": {"rating": {"rollout": 1}}, "more": 1}"#),
            ("3.json", r#"{"id": 1, "says": {"applause": {}}}"#),
            ("draft", r#"{"id": 1, "#),
        ] {
            fs::write(there.join(name), text).unwrap();
        }
        let read = mail.read();
        assert_eq!(read.len(), 1);
        assert_eq!(read[0].letter, post.letter);
        for n in 1..4 {
            assert!(there.join(format!("{n}.refused")).is_file(), "{n}");
        }
        assert!(there.join("draft").is_file());
    }
}
