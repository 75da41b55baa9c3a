//! Resources of a process that is never killed: memory and file descriptors.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::bench::service::resident_mib;

/// Share of the looks at the beginning that are left out: caches fill, pages are touched first.
const WARM_UP: f64 = 0.1;

/// Looks in a quarter of a life that is long enough to tell.
const MIN_LOOKS: usize = 5;

/// A controller cleans up after the dead once a second.
const REST: Duration = Duration::from_millis(1200);

/// A look after every session.
#[derive(Clone, Debug, Default)]
pub struct Footprint {
    looks: Vec<Held>,
}

#[derive(Clone, Copy, Debug)]
pub struct Held {
    pub memory_mib: f64,
    pub files: usize,
}

impl Held {
    /// Resources of a process whose clients are gone: the fewest files within [`REST`], after which it has
    /// closed their files.
    pub fn at_rest(pid: u32) -> Result<Held> {
        let until = Instant::now() + REST;
        let mut files = open_files(pid)?;
        while Instant::now() < until {
            std::thread::sleep(REST / 20);
            files = files.min(open_files(pid)?);
        }
        Ok(Held { memory_mib: resident_mib(pid)?, files })
    }
}

fn open_files(pid: u32) -> Result<usize> {
    let files = std::fs::read_dir(format!("/proc/{pid}/fd")).context("counting its files")?;
    Ok(files.count())
}

impl Footprint {
    pub fn add(&mut self, held: Held) {
        self.looks.push(held);
    }

    /// In the first and in the last quarter of its life after the warm-up: median memory, fewest
    /// files (a client that is just there holds some). `None` of a life too short to tell.
    pub fn trend(&self) -> Option<[Held; 2]> {
        let warm = &self.looks[(WARM_UP * self.looks.len() as f64).ceil() as usize..];
        let quarter = warm.len() / 4;
        (quarter >= MIN_LOOKS)
            .then(|| [typical(&warm[..quarter]), typical(&warm[warm.len() - quarter..])])
    }

    pub fn most(&self) -> Option<Held> {
        let memory_mib = self.looks.iter().map(|held| held.memory_mib).fold(0.0, f64::max);
        let files = self.looks.iter().map(|held| held.files).max()?;
        Some(Held { memory_mib, files })
    }
}

fn typical(looks: &[Held]) -> Held {
    let mut memory: Vec<f64> = looks.iter().map(|held| held.memory_mib).collect();
    memory.sort_by(f64::total_cmp);
    let files = looks.iter().map(|held| held.files).min().unwrap_or(0);
    Held { memory_mib: memory[memory.len() / 2], files }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leak_shows_and_a_visitor_does_not() {
        let of = |looks: &[(f64, usize)]| Footprint {
            looks: looks.iter().map(|&(memory_mib, files)| Held { memory_mib, files }).collect(),
        };
        assert!(of(&[(20.0, 40); 4]).trend().is_none(), "too short");
        let flat: Vec<_> = (0..40).map(|i| (20.0, if i % 3 == 0 { 47 } else { 40 })).collect();
        let [first, last] = of(&flat).trend().unwrap();
        assert_eq!((first.memory_mib, first.files), (last.memory_mib, last.files));
        let leak: Vec<_> = (0..40).map(|i| (20.0 + 0.1 * f64::from(i), 40 + i as usize)).collect();
        let [first, last] = of(&leak).trend().unwrap();
        assert!(last.memory_mib > 1.1 * first.memory_mib && last.files > first.files + 20);
    }
}
