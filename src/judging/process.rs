//! A judge's program as a child process: lines to it, lines from it, and its end.
//!
//! Nothing waits without a limit: its ends of the pipes do not block, and a deadline stands behind every poll.

use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::ioctl_fionbio;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

use super::answer::{MAX_BYTES, words};
use super::last_words::LastWords;
use crate::children::how_it_ended;

/// This executable, also when another one has taken its place on the disk.
const THIS_PROGRAM: &str = "/proc/self/exe";
/// How long the end of a program is waited for that has closed its output.
const TO_END: Duration = Duration::from_millis(200);

/// A program at work. It dies with this, and with the process that started it.
pub struct Process {
    child: Child,
    /// Nothing once it is told to end.
    stdin: Option<ChildStdin>,
    stdout: ChildStdout,
    said: LastWords,
    /// Not yet taken by the program.
    to_write: Vec<u8>,
    /// Not yet taken from here.
    heard: Vec<u8>,
    /// It has closed its standard output.
    is_mute: bool,
}

/// How a program ended, where it has.
type Ended = Option<String>;

impl Process {
    /// Starts the words of `program` in `folder`; its standard error goes to `log`.
    pub fn start(program: &[String], folder: &Path, log: &Path) -> io::Result<Process> {
        let mut child = Command::new(THIS_PROGRAM)
            .args(["child", "--parent", &std::process::id().to_string(), "--"])
            .args(program)
            .current_dir(folder)
            // Python would keep an answer until it has some thousand of them.
            .env("PYTHONUNBUFFERED", "1")
            // What a terminal sends to the group of its parent is the parent's matter.
            .process_group(0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(stdin), Some(stdout), Some(stderr)) = pipes else {
            unreachable!("all three are piped")
        };
        let said = LastWords::of(stderr, log);
        let (to_write, heard) = (Vec::new(), Vec::new());
        let process =
            Process { child, stdin: Some(stdin), stdout, said, to_write, heard, is_mute: false };
        ioctl_fionbio(&process.stdout, true)?;
        process.stdin.as_ref().map_or(Ok(()), |stdin| ioctl_fionbio(stdin, true))?;
        Ok(process)
    }

    /// Whether it is there to be asked. The error is what it said without being asked.
    pub fn is_ready(&mut self) -> Result<bool, String> {
        let has_ended = self.ended().is_some();
        self.read();
        match self.heard.is_empty() {
            true => Ok(!has_ended && !self.is_mute),
            false => Err(self.too_much()),
        }
    }

    /// Sends it a line, while it is heard.
    pub fn tell(&mut self, line: &[u8]) {
        self.to_write = line.to_vec();
    }

    /// The next line it says within `patience`, without its end; the error is why there will be none.
    pub fn hear(&mut self, patience: Duration) -> Result<Option<Vec<u8>>, String> {
        let deadline = Instant::now() + patience;
        loop {
            // First: what it said before its end counts.
            let ended = self.ended();
            let takes = self.write();
            self.read();
            if let Some(line) = self.line()? {
                return Ok(Some(line));
            }
            if let Some(how) = ended {
                return Err(format!("it {how}"));
            }
            if self.is_mute || takes.is_err() {
                return Err(self.closed());
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.wait(left);
        }
    }

    /// The last line on its standard error, once it is dead.
    pub fn last_words(&mut self) -> Option<String> {
        self.kill();
        self.said.line()
    }

    /// Closes its input, which tells it to end, and gives it so long.
    pub fn dismiss(&mut self, patience: Duration) {
        self.stdin = None;
        self.wait_for_end(patience);
    }

    /// As much as it takes now.
    fn write(&mut self) -> io::Result<()> {
        let Some(stdin) = &mut self.stdin else { return Ok(()) };
        while !self.to_write.is_empty() {
            match stdin.write(&self.to_write) {
                Ok(0) => break,
                Ok(n) => drop(self.to_write.drain(..n)),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// As much as there is, but no more than an answer may have.
    fn read(&mut self) {
        let mut some = [0; 4096];
        while self.heard.len() <= MAX_BYTES {
            match self.stdout.read(&mut some) {
                Ok(0) => self.is_mute = true,
                Ok(n) => {
                    self.heard.extend_from_slice(&some[..n]);
                    continue;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(_) => self.is_mute = true,
            }
            return;
        }
    }

    /// A whole line, with nothing behind it.
    fn line(&mut self) -> Result<Option<Vec<u8>>, String> {
        let end = self.heard.iter().position(|byte| *byte == b'\n');
        if end.unwrap_or(self.heard.len()) > MAX_BYTES {
            return Err(format!(
                "it wrote a line of more than {MAX_BYTES} bytes, which begins with `{}`: write one short \
                 line per rollout",
                words(&self.heard)
            ));
        }
        let Some(end) = end else { return Ok(None) };
        let mut line = std::mem::take(&mut self.heard);
        self.heard = line.split_off(end + 1);
        line.pop();
        match self.heard.is_empty() {
            true => Ok(Some(line)),
            false => Err(self.too_much()),
        }
    }

    fn too_much(&self) -> String {
        format!(
            "it wrote `{}` after its reply: write exactly one line per rollout to standard output, and \
             everything else to standard error",
            words(&self.heard)
        )
    }

    /// Why a pipe is closed: as a rule it has died.
    fn closed(&mut self) -> String {
        match self.wait_for_end(TO_END) {
            Some(how) => format!("it {how}"),
            None => "it closed its standard input or output: leave both open until the input ends"
                .into(),
        }
    }

    /// Until something may have changed.
    fn wait(&self, patience: Duration) {
        let mut fds = vec![PollFd::new(&self.stdout, PollFlags::IN)];
        if let Some(stdin) = self.stdin.as_ref().filter(|_| !self.to_write.is_empty()) {
            fds.push(PollFd::new(stdin, PollFlags::OUT));
        }
        let timeout =
            Timespec { tv_sec: patience.as_secs() as i64, tv_nsec: patience.subsec_nanos().into() };
        if poll(&mut fds, Some(&timeout)).is_err() {
            // A signal, as a rule; whatever it is must not turn the loop into a spin.
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn wait_for_end(&self, patience: Duration) -> Ended {
        let start = Instant::now();
        loop {
            let ended = self.ended();
            if ended.is_some() || start.elapsed() >= patience {
                return ended;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// It stays a zombie, and its number its own, until this is dropped.
    fn ended(&self) -> Ended {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        let status = waitid(WaitId::Pid(Pid::from_child(&self.child)), options).ok().flatten()?;
        Some(how_it_ended(status.exit_status(), status.terminating_signal()))
    }

    /// With everything that it has started.
    fn kill(&mut self) {
        // It may have ended since; then there is nobody to signal.
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
        // At once, as a rule; one that the kernel does not let go is left to it.
        if self.wait_for_end(TO_END).is_some() {
            let _ = self.child.wait();
        }
    }
}
