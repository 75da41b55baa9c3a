//! A host: a network namespace with one link, and folders of its own for everything a machine has.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};
use shm_types::cell::Cell;

use super::super::process::Process;
use super::{tun, wan};

/// Where `ip netns` keeps its namespaces.
const NAMESPACES: &str = "/run/netns";
const PREFIX: &str = "skillet-soak-";
const LINK: &str = "wan0";
/// What most machines have, whatever this one has.
const CONGESTION: (&str, &str) = ("/proc/sys/net/ipv4/tcp_congestion_control", "cubic");

pub struct Host {
    namespace: String,
    pub address: String,
    /// Its $SKILLET_RUNTIME_DIR.
    runtime: PathBuf,
    pub dir: PathBuf,
}

/// That this process may make hosts.
pub fn check() -> Result<()> {
    ensure!(
        rustix::process::geteuid().is_root(),
        "--hosts makes network namespaces and needs root: run it with sudo"
    );
    ip(&["netns", "list"]).map(drop).context("--hosts needs `ip` (package iproute2)")
}

/// Removes what soaks that were killed have left.
pub fn remove_left() {
    let Ok(entries) = fs::read_dir(NAMESPACES) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let pid = name.strip_prefix(PREFIX).and_then(|rest| rest.split('-').next());
        if pid.is_some_and(|pid| !Path::new("/proc").join(pid).exists()) {
            let _ = ip(&["netns", "del", &name]);
        }
    }
}

impl Host {
    /// Host `k`, from 0, with the other end of its link; `dir` is where all hosts keep their files.
    pub fn make(k: usize, dir: &Path) -> Result<(Host, File)> {
        let (pid, letter) = (std::process::id(), char::from(b'a' + k as u8));
        let dir = dir.join(letter.to_string());
        fs::create_dir_all(&dir)
            .with_context(|| format!("{}: cannot create the folder", dir.display()))?;
        // Short: the paths of sockets are.
        let runtime =
            std::env::temp_dir().join(format!("skillet-run-{pid}")).join(letter.to_string());
        let namespace = format!("{PREFIX}{pid}-{letter}");
        let host = Host { namespace, address: wan::address(k), runtime, dir };
        ip(&["netns", "add", &host.namespace])?;
        let link = host.inside(|| {
            // Where the kernel has no other, it is what it is.
            let _ = fs::write(CONGESTION.0, CONGESTION.1);
            tun::make(LINK).context("/dev/net/tun: cannot make a TUN device")
        })?;
        let address = format!("{}/24", host.address);
        ip(&["-n", &host.namespace, "link", "set", "lo", "up"])?;
        ip(&["-n", &host.namespace, "addr", "add", &address, "dev", LINK])?;
        ip(&["-n", &host.namespace, "link", "set", LINK, "up"])?;
        Ok((host, link))
    }

    /// Does something in this host's network, in a thread that ends afterwards.
    fn inside<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        let path = Path::new(NAMESPACES).join(&self.namespace);
        let namespace = File::open(&path).with_context(|| format!("{}", path.display()))?;
        let enter = || {
            move_into_link_name_space(namespace.as_fd(), Some(LinkNameSpaceType::Network))
                .with_context(|| format!("entering {}", path.display()))?;
            work()
        };
        std::thread::scope(|scope| scope.spawn(enter).join().ok().context("a thread panicked"))?
    }

    /// Starts `skillet <arguments>` on this host; log and notification socket are in `dir`.
    pub fn start(&self, name: &'static str, arguments: &[&OsStr], dir: &Path) -> Result<Process> {
        let program = std::env::current_exe().context("finding this executable")?;
        let enter = ["ip", "netns", "exec", &self.namespace].map(OsString::from);
        let command = enter.into_iter().chain([program.into_os_string()]);
        let command = command.chain(arguments.iter().map(OsString::from));
        let command: Vec<OsString> = command.collect();
        let environment = [("SKILLET_RUNTIME_DIR", self.runtime.as_os_str())];
        Process::start_program(name, &command, dir, &environment)
    }

    pub fn cell(&self, name: &str) -> Result<Cell> {
        Ok(Cell::in_dir(&self.runtime, name)?)
    }

    /// What is still shared here when all its processes have ended.
    pub fn left_over(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(&self.runtime) else { return Vec::new() };
        entries.flatten().map(|entry| entry.path().display().to_string()).collect()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        Cell::remove_idle(&self.runtime, "");
        let _ = ip(&["netns", "del", &self.namespace]);
        let _ = fs::remove_dir_all(&self.runtime);
        if let Some(all) = self.runtime.parent() {
            let _ = fs::remove_dir(all); // the last host's
        }
    }
}

fn ip(arguments: &[&str]) -> Result<String> {
    let output = Command::new("ip").args(arguments).output().context("starting `ip`")?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).trim().to_string();
        bail!("`ip {}`: {said}", arguments.join(" "));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
