//! The network between the hosts: takes each packet from the TUN device of one and puts it into that of another,
//! late, twice or not at all. Links can be cut, in one direction or both.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Result;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::weather::{Fate, Weather};

/// All hosts are in 10.77.0.0/24, from .1 on.
const NET: [u8; 3] = [10, 77, 0];
/// The longest packet there can be.
const MAX_PACKET: usize = 65_536;
/// Packets under way at once; more are lost, as in a router.
const MAX_UNDER_WAY: usize = 20_000;
/// Packets taken from a host before others are looked at.
const AT_ONCE: usize = 64;
const LOOK: Duration = Duration::from_millis(20);

/// Which way the link of a host is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    None = 0,
    /// What it sends is lost.
    Out = 1,
    /// What is sent to it is lost.
    In = 2,
    Both = 3,
}

/// Packets, by what became of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    pub sent: u64,
    pub lost: u64,
    pub doubled: u64,
    pub overtaken: u64,
    pub cut: u64,
}

#[derive(Default)]
struct Shared {
    over: AtomicBool,
    cuts: Vec<AtomicU8>,
    sent: AtomicU64,
    lost: AtomicU64,
    doubled: AtomicU64,
    overtaken: AtomicU64,
    cut: AtomicU64,
}

pub struct Wan {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// The address of host `k`, from 0.
pub fn address(k: usize) -> String {
    let [a, b, c] = NET;
    format!("{a}.{b}.{c}.{}", k + 1)
}

impl Wan {
    /// Connects the hosts at the other ends of `links`.
    pub fn start(links: Vec<File>, weather: Weather, seed: u64) -> Result<Wan> {
        let cuts = links.iter().map(|_| AtomicU8::new(Cut::None as u8)).collect();
        let shared = Arc::new(Shared { cuts, ..Shared::default() });
        let its = shared.clone();
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let carry = move || {
            let under_way = BinaryHeap::new();
            Carrier { links, weather, rng, shared: its, under_way, number: 0 }.run();
        };
        let thread = std::thread::Builder::new().name("soak-wan".into()).spawn(carry)?;
        Ok(Wan { shared, thread: Some(thread) })
    }

    pub fn cut(&self, host: usize, cut: Cut) {
        self.shared.cuts[host].store(cut as u8, Ordering::Relaxed);
    }

    pub fn counts(&self) -> Counts {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let Shared { sent, lost, doubled, overtaken, cut, .. } = &*self.shared;
        Counts {
            sent: of(sent),
            lost: of(lost),
            doubled: of(doubled),
            overtaken: of(overtaken),
            cut: of(cut),
        }
    }
}

impl Drop for Wan {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A packet on its way; the order is that of arrival.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Parcel {
    due: Instant,
    number: u64,
    to: usize,
    bytes: Vec<u8>,
}

struct Carrier {
    links: Vec<File>,
    weather: Weather,
    rng: ChaCha8Rng,
    shared: Arc<Shared>,
    under_way: BinaryHeap<Reverse<Parcel>>,
    number: u64,
}

impl Carrier {
    fn run(mut self) {
        let mut buffer = vec![0; MAX_PACKET];
        while !self.shared.over.load(Ordering::Relaxed) {
            self.deliver();
            for from in self.ready() {
                for _ in 0..AT_ONCE {
                    let Ok(n) = self.links[from].read(&mut buffer) else { break };
                    self.take(from, &buffer[..n]);
                }
            }
        }
    }

    /// Hosts that have sent something, after a wait until that or the next arrival.
    fn ready(&self) -> Vec<usize> {
        let next = self.under_way.peek().map(|Reverse(parcel)| parcel.due);
        let wait = next.map_or(LOOK, |due| due.saturating_duration_since(Instant::now()).min(LOOK));
        let wait = Timespec { tv_sec: 0, tv_nsec: wait.subsec_nanos().into() };
        let mut looks: Vec<PollFd> =
            self.links.iter().map(|link| PollFd::new(link, PollFlags::IN)).collect();
        if poll(&mut looks, Some(&wait)).is_err() {
            return Vec::new(); // interrupted
        }
        let is_ready = |look: &PollFd| look.revents().contains(PollFlags::IN);
        looks.iter().enumerate().filter(|(_, look)| is_ready(look)).map(|(k, _)| k).collect()
    }

    fn take(&mut self, from: usize, packet: &[u8]) {
        // What hosts say to find neighbours and routers concerns nobody.
        let Some(to) = receiver(packet).filter(|to| *to < self.links.len() && *to != from) else {
            return;
        };
        let fate = self.weather.fate(&mut self.rng);
        let shared = self.shared.clone();
        let count = |of: &AtomicU64| of.fetch_add(1, Ordering::Relaxed);
        count(&shared.sent);
        let is_cut = |host: usize, way: Cut| {
            shared.cuts[host].load(Ordering::Relaxed) & way as u8 != Cut::None as u8
        };
        if is_cut(from, Cut::Out) || is_cut(to, Cut::In) {
            count(&shared.cut);
            return;
        }
        match fate {
            _ if self.under_way.len() >= MAX_UNDER_WAY => drop(count(&shared.lost)),
            Fate::Lost => drop(count(&shared.lost)),
            Fate::Arrives(after) => self.send(to, after, packet),
            Fate::Overtaken(after) => {
                count(&shared.overtaken);
                self.send(to, after, packet);
            }
            Fate::Twice(after) => {
                count(&shared.doubled);
                after.into_iter().for_each(|after| self.send(to, after, packet));
            }
        }
    }

    fn send(&mut self, to: usize, after: Duration, packet: &[u8]) {
        self.number += 1;
        let (due, number) = (Instant::now() + after, self.number);
        self.under_way.push(Reverse(Parcel { due, number, to, bytes: packet.to_vec() }));
    }

    fn deliver(&mut self) {
        let now = Instant::now();
        while self.under_way.peek().is_some_and(|Reverse(parcel)| parcel.due <= now) {
            if let Some(Reverse(parcel)) = self.under_way.pop() {
                // A host whose queue is full loses it, as any would.
                let _ = self.links[parcel.to].write(&parcel.bytes);
            }
        }
    }
}

/// The host, from 0, to which a packet goes.
fn receiver(packet: &[u8]) -> Option<usize> {
    let is_ipv4 = packet.first().is_some_and(|first| first >> 4 == 4);
    match packet.get(16..20)? {
        [net @ .., host] if is_ipv4 && *net == NET => usize::from(*host).checked_sub(1),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_goes_to_the_host_it_names_and_anything_else_to_nobody() {
        let mut packet = [0; 40];
        packet[0] = 0x45;
        packet[16..20].copy_from_slice(&[10, 77, 0, 3]);
        assert_eq!(receiver(&packet), Some(2));
        packet[18] = 1;
        assert_eq!(receiver(&packet), None, "another net");
        (packet[0], packet[18]) = (0x60, 0);
        assert_eq!(receiver(&packet), None, "IPv6");
        assert_eq!(receiver(&packet[..19]), None, "cut");
    }
}
