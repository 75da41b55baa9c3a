//! One end of a connection, whatever it is made of: whole messages in and out.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use shm_types::echo::EchoPorts;

/// A peer that is silent for so long is not coming back.
const PATIENCE: Duration = Duration::from_secs(20);
/// Attempts between two looks at the clock.
const SPINS: u32 = 4096;

/// What to do until a message is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wait {
    Spin,
    Sleep,
}

pub trait End {
    fn send(&mut self, message: &[u8]) -> Result<()>;
    /// Fills `message`, whose length both ends know; false when the peer has closed.
    fn receive(&mut self, message: &mut [u8]) -> Result<bool>;
    /// Tells the peer, where dropping this end does not.
    fn close(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Socket or pipe.
pub struct Stream {
    reader: File,
    writer: File,
}

impl Stream {
    pub fn new(reader: OwnedFd, writer: OwnedFd, wait: Wait, len: usize) -> Result<Stream> {
        for fd in [&reader, &writer] {
            rustix::io::ioctl_fionbio(fd, wait == Wait::Spin).context("setting the mode")?;
            // Each suits one kind of stream, and as much as the host allows.
            let _ = rustix::pipe::fcntl_setpipe_size(fd, len);
            let _ = rustix::net::sockopt::set_socket_send_buffer_size(fd, len);
        }
        Ok(Stream { reader: reader.into(), writer: writer.into() })
    }
}

impl End for Stream {
    fn send(&mut self, message: &[u8]) -> Result<()> {
        let mut patience = Patience::new();
        let mut sent = 0;
        while sent < message.len() {
            match self.writer.write(&message[sent..]) {
                Ok(n) => sent += n,
                Err(error) if error.kind() == ErrorKind::WouldBlock => patience.spin()?,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error).context("sending to the peer"),
            }
        }
        Ok(())
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<bool> {
        let mut patience = Patience::new();
        let mut received = 0;
        while received < message.len() {
            match self.reader.read(&mut message[received..]) {
                Ok(0) => return Ok(false),
                Ok(n) => received += n,
                Err(error) if error.kind() == ErrorKind::WouldBlock => patience.spin()?,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error).context("receiving from the peer"),
            }
        }
        Ok(true)
    }
}

/// Shared memory.
pub struct Shared {
    pub ports: EchoPorts,
    pub wait: Wait,
}

impl End for Shared {
    fn send(&mut self, message: &[u8]) -> Result<()> {
        let mut patience = Patience::new();
        // Nobody there yet: the peer is starting.
        while !self.ports.send(message)? {
            patience.sleep()?;
        }
        if self.wait == Wait::Sleep {
            self.ports.notify()?;
        }
        Ok(())
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<bool> {
        let mut patience = Patience::new();
        loop {
            if self.wait == Wait::Sleep && !self.ports.wait(PATIENCE)? {
                bail!("the peer has not answered for {PATIENCE:?}: it may have been killed");
            }
            match self.ports.receive(message)? {
                Some(len) => return Ok(len == message.len()),
                None => patience.spin()?,
            }
        }
    }

    /// A message of another length is the last one.
    fn close(&mut self) -> Result<()> {
        self.send(&[])
    }
}

/// How long something has been waited for.
struct Patience {
    spins: u32,
    since: Option<Instant>,
}

impl Patience {
    fn new() -> Patience {
        Patience { spins: 0, since: None }
    }

    /// Reads the clock seldom: it would be part of what is measured.
    fn spin(&mut self) -> Result<()> {
        std::hint::spin_loop();
        self.spins += 1;
        if self.spins.is_multiple_of(SPINS) { self.check() } else { Ok(()) }
    }

    fn sleep(&mut self) -> Result<()> {
        std::thread::sleep(Duration::from_micros(200));
        self.check()
    }

    fn check(&mut self) -> Result<()> {
        if self.since.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
            bail!("the peer has not answered for {PATIENCE:?}: it may have been killed");
        }
        Ok(())
    }
}
