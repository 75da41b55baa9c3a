//! The other process: how it is started and ended, and what it does.

use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use shm_types::cell::Cell;
use shm_types::echo::EchoPorts;

use super::link::{End, Shared, Stream, Wait};
use super::pin;
use crate::cli::bench::{EchoArgs, Link};
use crate::setup::end_with_parent;
use crate::signals::end_after_parent;

const GRACE: Duration = Duration::from_secs(5);

/// A process that sends back what it gets.
pub struct Peer {
    /// This process's end of the connection.
    pub end: Box<dyn End>,
    process: Process,
}

/// Does not outlive the process that started it.
struct Process(Child);

impl Peer {
    /// On another core. Socket and pipe are its standard input, and output.
    pub fn start(cell: &Cell, link: Link, wait: Wait, len: usize, core: usize) -> Result<Peer> {
        let executable = std::env::current_exe().context("finding this executable")?;
        let mut command = Command::new(executable);
        let link_name = link.to_possible_value().context("a link has a name")?;
        command
            .args(["bench", "echo", "--link", link_name.get_name(), "--cell", cell.name()])
            .args(["--len", &len.to_string(), "--core", &core.to_string()])
            .args(["--child", &std::process::id().to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null());
        if wait == Wait::Spin {
            command.arg("--spin");
        }
        let starting = "starting the peer";
        let (end, child): (Box<dyn End>, Child) = match link {
            Link::Iceoryx2 => {
                let ports = EchoPorts::create(cell, len)?;
                (Box::new(Shared { ports, wait }), command.spawn().context(starting)?)
            }
            Link::Socket => {
                let (ours, theirs) = UnixStream::pair().context("making a pair of sockets")?;
                let child = command.stdin(OwnedFd::from(theirs)).spawn().context(starting)?;
                // The command holds the peer's end as well: it must go, or nobody sees it close.
                drop(command);
                let reader = OwnedFd::from(ours);
                let writer = reader.try_clone().context("copying a socket")?;
                (Box::new(Stream::new(reader, writer, wait, len)?), child)
            }
            Link::Pipe => {
                command.stdin(Stdio::piped()).stdout(Stdio::piped());
                let mut child = command.spawn().context(starting)?;
                let reader = child.stdout.take().context("the peer has no output")?;
                let writer = child.stdin.take().context("the peer has no input")?;
                (Box::new(Stream::new(reader.into(), writer.into(), wait, len)?), child)
            }
        };
        Ok(Peer { end, process: Process(child) })
    }

    /// Closes the connection and waits until the other process has ended.
    pub fn stop(self) -> Result<()> {
        let Peer { mut end, mut process } = self;
        end.close()?;
        drop(end);
        let start = Instant::now();
        while process.0.try_wait().context("waiting for the peer")?.is_none() {
            if start.elapsed() > GRACE {
                bail!("the peer does not end within {GRACE:?}");
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Without effect on one that has ended and was waited for.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What the other process does until its peer closes.
pub fn echo(args: &EchoArgs) -> Result<()> {
    let cell = Cell::new(&args.cell)?;
    let shared = cell.clone();
    // The last of the two to end leaves nothing.
    end_after_parent(args.child, move || shared.tear_down())?;
    end_with_parent(args.child)?;
    pin(args.core)?;
    let wait = if args.spin { Wait::Spin } else { Wait::Sleep };
    let mut end: Box<dyn End> = match args.link {
        Link::Iceoryx2 => {
            let ports = EchoPorts::open(&cell, args.len)?;
            Box::new(Shared { ports, wait })
        }
        Link::Socket => {
            let input = std::io::stdin().as_fd().try_clone_to_owned()?;
            let output = input.try_clone()?;
            Box::new(Stream::new(input, output, wait, args.len)?)
        }
        Link::Pipe => {
            let input = std::io::stdin().as_fd().try_clone_to_owned()?;
            let output = std::io::stdout().as_fd().try_clone_to_owned()?;
            Box::new(Stream::new(input, output, wait, args.len)?)
        }
    };
    let mut message = vec![0_u8; args.len];
    while end.receive(&mut message)? {
        end.send(&message)?;
    }
    Ok(())
}
