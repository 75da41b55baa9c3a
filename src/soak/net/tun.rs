//! The end of a TUN device that is not a host's: what the host sends is read from it, a packet at a time, and what is
//! written to it arrives at the host.

#![allow(unsafe_code)] // TUNSETIFF has no safe wrapper

use std::fs::File;
use std::io;

use rustix::fs::{Mode, OFlags, open};
use rustix::ioctl::{Opcode, Updater, ioctl, opcode};

const DEVICE: &str = "/dev/net/tun";
const NAME_LEN: usize = 16;
const TUNSETIFF: Opcode = opcode::write::<i32>(b'T', 202);
/// Packets of the internet protocol, and nothing before them.
const IFF_TUN: u16 = 0x0001;
const IFF_NO_PI: u16 = 0x1000;

/// `struct ifreq` of the kernel, with the member that TUNSETIFF reads.
#[repr(C)]
struct Request {
    name: [u8; NAME_LEN],
    flags: u16,
    rest: [u8; 22],
}

/// Makes the device `name` in the network namespace of the calling thread. It is gone when the file is closed.
pub fn make(name: &str) -> io::Result<File> {
    let mut request = Request { name: [0; NAME_LEN], flags: IFF_TUN | IFF_NO_PI, rest: [0; 22] };
    // One byte stays 0: the kernel wants an end.
    request.name.iter_mut().take(NAME_LEN - 1).zip(name.bytes()).for_each(|(to, from)| *to = from);
    let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file = File::from(open(DEVICE, flags, Mode::empty())?);
    // SAFETY: TUNSETIFF reads and writes a `struct ifreq`, which `Request` is in layout and size.
    unsafe { ioctl(&file, Updater::<TUNSETIFF, Request>::new(&mut request))? };
    Ok(file)
}
