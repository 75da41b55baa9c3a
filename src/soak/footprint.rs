//! What a process holds: memory and file descriptors.

use anyhow::{Context, Result};

use crate::bench::service::resident_mib;

/// Over the life of a process that nobody kills.
#[derive(Clone, Copy, Debug, Default)]
pub struct Footprint {
    pub first: Option<Held>,
    pub last: Option<Held>,
    pub most: Held,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Held {
    pub memory_mib: f64,
    pub files: usize,
}

impl Footprint {
    /// Adds a look at the process `pid`.
    pub fn look(&mut self, pid: u32) -> Result<()> {
        let files = std::fs::read_dir(format!("/proc/{pid}/fd")).context("counting its files")?;
        let held = Held { memory_mib: resident_mib(pid)?, files: files.count() };
        self.first.get_or_insert(held);
        self.last = Some(held);
        self.most.memory_mib = self.most.memory_mib.max(held.memory_mib);
        self.most.files = self.most.files.max(held.files);
        Ok(())
    }

    /// Growth of the memory from the first look to the last, relative.
    pub fn memory_growth(&self) -> Option<f64> {
        Some(self.last?.memory_mib / self.first?.memory_mib - 1.0)
    }

    /// More files at the end than at the beginning.
    pub fn file_growth(&self) -> Option<i64> {
        Some(self.last?.files as i64 - self.first?.files as i64)
    }
}
