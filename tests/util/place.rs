//! A disk of a few megabytes that one can fill, empty and make read-only, for real processes.
//!
//! It is a tmpfs in a mount namespace of its own, which an ordinary user may have on most systems.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{Bench, Running, eventually};

/// Shares everything with the test but what is mounted at `dir`. It is there as long as this is.
pub struct Place {
    holder: Running,
    dir: PathBuf,
}

impl Place {
    /// `None`, and said aloud, where the system forbids user namespaces: the test then shows nothing.
    pub fn new(bench: &Bench, size: &str) -> Option<Place> {
        let dir = bench.path("disk");
        fs::create_dir(&dir).unwrap();
        let mut holder = Command::new("unshare");
        let script =
            "mount -t tmpfs -o size=$1,mode=700 skillet-test $2 && echo up && exec sleep 600";
        holder
            .args(["--user", "--map-root-user", "--mount", "sh", "-c", script, "sh", size])
            .arg(&dir)
            .stdout(Stdio::piped());
        let holder = Running::start(&mut holder);
        let mut place = Place { holder, dir };
        let up = eventually("the disk, or its refusal", || {
            match fs::read_to_string(format!("/proc/{}/mounts", place.holder.pid())) {
                Ok(mounts) if mounts.contains("skillet-test") => Some(true),
                _ => place.holder.has_ended().then_some(false),
            }
        });
        if !up {
            eprintln!("SKIPPED, NOTHING SHOWN: no user namespaces here (unshare --user --mount)");
        }
        up.then_some(place)
    }

    /// As the processes on it call it.
    pub fn inside(&self, name: &str) -> String {
        self.dir.join(name).to_str().unwrap().to_string()
    }

    /// As the test reaches it.
    pub fn outside(&self, name: &str) -> PathBuf {
        let root = PathBuf::from(format!("/proc/{}/root", self.holder.pid()));
        root.join(self.dir.strip_prefix("/").unwrap()).join(name)
    }

    fn enter(&self) -> Command {
        let mut command = Command::new("nsenter");
        let target = self.holder.pid().to_string();
        command.args(["--target", &target, "--user", "--mount", "--preserve-credentials"]);
        command
    }

    /// `skillet <arguments>` as a process that sees the disk, not yet started.
    fn skillet(&self, bench: &Bench, arguments: &[&str]) -> Command {
        let skillet = bench.skillet(arguments);
        let mut command = self.enter();
        command.arg(skillet.get_program()).args(skillet.get_args());
        for (key, value) in skillet.get_envs() {
            match value {
                Some(value) => command.env(key, value),
                None => command.env_remove(key),
            };
        }
        command.stdin(Stdio::null());
        command
    }

    pub fn start(&self, bench: &Bench, arguments: &[&str]) -> Running {
        let mut command = self.skillet(bench, arguments);
        Running::start(command.stdout(Stdio::null()).stderr(Stdio::piped()))
    }

    /// Trials of the session `name`. SQLite itself must be on the disk: it resolves the links of /proc
    /// to places outside.
    pub fn trial_count(&self, bench: &Bench, name: &str) -> usize {
        let list = ["policy", "list", &self.inside(name), "--json"];
        let output = self.skillet(bench, &list).output().unwrap();
        let found: Option<serde_json::Value> = serde_json::from_slice(&output.stdout).ok();
        found.and_then(|found| Some(found["policies"].as_array()?.len())).unwrap_or(0)
    }

    pub fn wait_for_trials(&self, bench: &Bench, name: &str, n: usize) {
        let enough = || (self.trial_count(bench, name) >= n).then_some(());
        eventually(&format!("{n} trials on the disk"), enough);
    }

    /// Takes the last byte; again, when others have freed some.
    pub fn fill(&self) {
        let path = self.outside("ballast");
        let mut file = OpenOptions::new().create(true).append(true).open(path).unwrap();
        let mut block = &[0x5a_u8; 4096][..];
        while !block.is_empty() {
            // What is written by half is written; only nothing at all means full.
            if file.write(block).is_err() {
                block = &block[..block.len() / 2];
            }
        }
    }

    pub fn free(&self) {
        fs::remove_file(self.outside("ballast")).unwrap();
    }

    /// `ro` or `rw`. The kernel refuses it while a file is open for writing.
    pub fn remount(&self, options: &str) {
        let options = format!("remount,{options}");
        eventually(&options, || {
            let mut command = self.enter();
            let output = command.args(["mount", "-o", &options]).arg(&self.dir).output();
            output.unwrap().status.success().then_some(())
        });
    }

    /// A copy that outlives the disk.
    pub fn rescue(&self, name: &str, to: &Path) {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(self.outside(name)).unwrap().flatten() {
            if entry.path().is_file() {
                fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
            }
        }
    }
}
