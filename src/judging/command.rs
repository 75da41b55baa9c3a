//! The command of a judge's program: its words, whether it can be started, and which one it is.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use rustix::fs::{Access, access};
use sha2::{Digest, Sha256};

use crate::children;
use crate::config::JudgeConfig;

/// Bytes of a file that tell it from others; a judge may be given whole sets of data.
const MAX_BYTES: u64 = 64_000_000;

/// Program and arguments of `command`, words apart by spaces. A file that ends in `.py` is a program of
/// Python.
pub fn words(command: &str) -> Result<Vec<String>> {
    let path = Path::new(command);
    if is_python(path) && path.is_file() {
        return Ok(vec![children::python(), command.into()]);
    }
    children::words(
        command,
        "the judge's program is empty: name one, such as my_task.py or \"python3 my_task.py\"",
    )
}

fn is_python(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "py")
}

/// Where the program runs.
pub fn folder(judge: &JudgeConfig) -> PathBuf {
    judge.directory.clone().unwrap_or_else(|| ".".into())
}

/// That the program of `judge`, where it has one, is there and can be started.
pub fn check(judge: &JudgeConfig) -> Result<()> {
    if !judge.has_program() {
        return Ok(());
    }
    let folder = folder(judge);
    if !folder.is_dir() {
        bail!(
            "{}: the judge's folder does not exist: set the judge again with --judge",
            folder.display()
        );
    }
    check_program("task.judge.program", &judge.program, &folder)
}

/// That the program `words`, which `setting` names, is there and can be started in `folder`.
pub fn check_program(setting: &str, words: &[String], folder: &Path) -> Result<()> {
    let Some((program, arguments)) = words.split_first() else { return Ok(()) };
    let is_path = program.contains('/');
    let path = std::env::var_os("PATH").unwrap_or_default();
    let mut places = match is_path {
        true => vec![folder.join(program)],
        false => std::env::split_paths(&path).map(|place| place.join(program)).collect(),
    };
    places.retain(|place| place.is_file());
    if places.is_empty() {
        let is_beside = !is_path && folder.join(program).is_file();
        let hint = match is_beside {
            true => format!(
                "there is one in {}: write ./{program}, or put its interpreter first",
                folder.display()
            ),
            false if is_path => format!("paths are relative to {}", folder.display()),
            false => "no folder of PATH has it".into(),
        };
        bail!("{setting}: {program} was not found; {hint}");
    }
    if !places.iter().any(|place| access(place.as_path(), Access::EXEC_OK).is_ok()) {
        bail!(
            "{setting}: {program} is not executable: put its interpreter first, as in [\"python3\", \
             \"{program}\"], or run `chmod +x`"
        );
    }
    let script = arguments.iter().find(|word| is_python(Path::new(word)));
    if let Some(missing) = script.filter(|word| !folder.join(word).is_file()) {
        bail!("{setting}: {missing} was not found in {}", folder.display());
    }
    Ok(())
}

/// Which program it is, in words: the command, and the digest of the files that it names.
pub fn identity(words: &[String], folder: &Path) -> String {
    let mut all = Sha256::new();
    let mut n_files = 0;
    for word in words {
        let path = folder.join(word);
        if path.is_file()
            && let Some((length, digest)) = file_digest(&path)
        {
            all.update(length.to_le_bytes());
            all.update(digest);
            n_files += 1;
        }
    }
    let command = words.join(" ");
    if n_files == 0 {
        return format!("{command} (no file)");
    }
    let hex: String = all.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    format!("{command} (sha256 {hex})")
}

/// Length and digest of a file that can be read.
fn file_digest(path: &Path) -> Option<(u64, [u8; 32])> {
    let file = File::open(path).ok()?;
    let length = file.metadata().ok()?.len();
    let (mut file, mut some, mut hash) = (file.take(MAX_BYTES), [0; 8192], Sha256::new());
    loop {
        match file.read(&mut some).ok()? {
            0 => return Some((length, hash.finalize().into())),
            n => hash.update(&some[..n]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn judge(folder: &Path, words: &[&str]) -> JudgeConfig {
        JudgeConfig {
            program: words.iter().map(|word| word.to_string()).collect(),
            directory: Some(folder.into()),
            ..JudgeConfig::default()
        }
    }

    #[test]
    fn what_cannot_be_started_is_refused_with_the_way_out() {
        let folder = tempfile::TempDir::new().unwrap();
        let dir = folder.path();
        std::fs::write(dir.join("my_task.py"), "pass").unwrap();
        std::fs::write(dir.join("run"), "#!/bin/sh\n").unwrap();
        std::fs::set_permissions(dir.join("run"), PermissionsExt::from_mode(0o755)).unwrap();
        for good in [&["sh", "my_task.py"][..], &["./run"], &["sh", "-c", "true"], &[]] {
            check(&judge(dir, good)).unwrap();
        }
        for (words, word) in [
            (&["my_task.py"][..], "write ./my_task.py"),
            (&["./my_task.py"], "is not executable"),
            (&["./absent"], "paths are relative to"),
            (&["no-such-program-anywhere"], "PATH"),
            (&["sh", "my_tsak.py"], "my_tsak.py was not found in"),
        ] {
            let message = check(&judge(dir, words)).unwrap_err().to_string();
            assert!(message.contains(word), "{words:?}: {message}");
        }
        let message = check(&judge(&dir.join("absent"), &["sh"])).unwrap_err().to_string();
        assert!(message.contains("does not exist"), "{message}");
    }

    #[test]
    fn a_program_that_was_changed_is_another_one() {
        let folder = tempfile::TempDir::new().unwrap();
        let write = |text: &str| std::fs::write(folder.path().join("a.py"), text).unwrap();
        let identity = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| word.to_string()).collect();
            super::identity(&words, folder.path())
        };
        assert_eq!(identity(&["python3", "-m", "mine"]), "python3 -m mine (no file)");
        write("1");
        let first = identity(&["python3", "a.py"]);
        assert!(
            first.starts_with("python3 a.py (sha256 ") && first.len() == 21 + 64 + 1,
            "{first}"
        );
        assert_eq!(identity(&["python3", "a.py"]), first);
        assert_ne!(identity(&["python3", "a.py", "--strict"]), first);
        write("2");
        assert_ne!(identity(&["python3", "a.py"]), first);
    }

    #[test]
    fn words_stand_apart_by_spaces() {
        assert_eq!(words("python3  my_task.py -v").unwrap(), ["python3", "my_task.py", "-v"]);
        assert_eq!(words("absent.py").unwrap(), ["absent.py"]);
        assert!(words("  ").unwrap_err().to_string().contains("my_task.py"));
    }
}
