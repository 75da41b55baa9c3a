//! Timing of the loop over all runs of a session, as a small JSON file.
//!
//! ```json
//! {"version":1,"unit":"ns","loops":[{"pace":"realtime","ticks":3,"missed_deadlines":0,
//!  "wakeup":[[52223,2],[61439,1]],"tick":[[1799,3]]}]}
//! ```
//!
//! A histogram is a list of [upper end of a bin, count], by rising bins. Without the wall clock
//! nothing is waited for: there `wakeup` is empty.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::config::Pace;
use crate::disk::keeper::write_whole;

const VERSION: u32 = 1;
const UNIT: &str = "ns";

/// Bins that are not empty: upper end, ns, and count.
pub type Bins = Vec<(u64, u64)>;

/// One entry for every pace that the runs had.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimingFile {
    version: u32,
    unit: String,
    loops: Vec<LoopTiming>,
}

/// What a loop of one pace measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoopTiming {
    pub pace: Pace,
    pub ticks: u64,
    pub missed_deadlines: u64,
    /// From the deadline to the loop.
    pub wakeup: Bins,
    /// From the measurement to the torque.
    pub tick: Bins,
}

/// Why a file of timings is of no use.
#[derive(Debug, Error)]
pub enum TimingFileError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("it is damaged: {0}")]
    Damaged(String),
}

impl TimingFile {
    /// `None` where there is no file.
    pub fn read(path: &Path) -> Result<Option<TimingFile>, TimingFileError> {
        match std::fs::read(path) {
            Ok(bytes) => TimingFile::parse(&bytes).map(Some).map_err(TimingFileError::Damaged),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Adds a run to the file, which is left alone if it is damaged.
    pub fn add(path: &Path, run: LoopTiming) -> Result<(), TimingFileError> {
        let empty = TimingFile { version: VERSION, unit: UNIT.into(), loops: Vec::new() };
        let mut file = TimingFile::read(path)?.unwrap_or(empty);
        match file.loops.iter_mut().find(|timing| timing.pace == run.pace) {
            Some(timing) => timing.merge(&run),
            None => file.loops.push(run),
        }
        let text = serde_json::to_vec(&file).map_err(io::Error::from)?;
        Ok(write_whole(path, &text)?)
    }

    pub fn loops(&self) -> &[LoopTiming] {
        &self.loops
    }

    fn parse(bytes: &[u8]) -> Result<TimingFile, String> {
        let file: TimingFile = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if file.version != VERSION || file.unit != UNIT {
            return Err(format!(
                "version {} in {} instead of {VERSION} in {UNIT}",
                file.version, file.unit
            ));
        }
        if file.loops.is_empty() {
            return Err("it holds no loop".into());
        }
        for (i, timing) in file.loops.iter().enumerate() {
            timing.check()?;
            if file.loops[..i].iter().any(|other| other.pace == timing.pace) {
                return Err("the same pace twice".into());
            }
        }
        Ok(file)
    }
}

impl LoopTiming {
    /// Adds what another run with the same pace measured.
    fn merge(&mut self, run: &LoopTiming) {
        self.ticks = self.ticks.saturating_add(run.ticks);
        self.missed_deadlines = self.missed_deadlines.saturating_add(run.missed_deadlines);
        add_bins(&mut self.wakeup, &run.wakeup);
        add_bins(&mut self.tick, &run.tick);
    }

    /// Bins rise, hold something, and together hold every tick.
    fn check(&self) -> Result<(), String> {
        let total = |bins: &Bins| {
            let mut below = None;
            bins.iter().try_fold(0_u64, |sum, &(upper, count)| {
                let rises = below.replace(upper) < Some(upper);
                (rises && count > 0).then_some(())?;
                sum.checked_add(count)
            })
        };
        let waits = if self.pace == Pace::Realtime { self.ticks } else { 0 };
        for (name, bins, expected) in
            [("wakeup", &self.wakeup, waits), ("tick", &self.tick, self.ticks)]
        {
            if total(bins) != Some(expected) {
                return Err(format!("the bins of {name} do not hold {expected} ticks in order"));
            }
        }
        Ok(())
    }
}

fn add_bins(bins: &mut Bins, more: &Bins) {
    for &(upper, count) in more {
        match bins.binary_search_by_key(&upper, |bin| bin.0) {
            Ok(at) => bins[at].1 = bins[at].1.saturating_add(count),
            Err(at) => bins.insert(at, (upper, count)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn realtime() -> LoopTiming {
        LoopTiming {
            pace: Pace::Realtime,
            ticks: 3,
            missed_deadlines: 1,
            wakeup: vec![(50_000, 2), (2_000_000, 1)],
            tick: vec![(1800, 3)],
        }
    }

    /// A file in a folder of its own.
    fn place(name: &str) -> PathBuf {
        let dir =
            std::env::temp_dir().join(format!("skillet-timing-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        dir.join("timing.json")
    }

    #[test]
    fn runs_of_one_pace_add_up_and_paces_stay_apart() {
        let path = place("sum");
        assert_eq!(TimingFile::read(&path).unwrap(), None);
        TimingFile::add(&path, realtime()).unwrap();
        assert_eq!(TimingFile::read(&path).unwrap().unwrap().loops(), [realtime()]);

        let next = LoopTiming { wakeup: vec![(40_000, 1), (50_000, 2)], ..realtime() };
        TimingFile::add(&path, next).unwrap();
        let unpaced = LoopTiming { pace: Pace::Max, wakeup: Vec::new(), ..realtime() };
        TimingFile::add(&path, unpaced.clone()).unwrap();
        let sum = LoopTiming {
            ticks: 6,
            missed_deadlines: 2,
            wakeup: vec![(40_000, 1), (50_000, 4), (2_000_000, 1)],
            tick: vec![(1800, 6)],
            ..realtime()
        };
        assert_eq!(TimingFile::read(&path).unwrap().unwrap().loops(), [sum, unpaced]);
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }

    #[test]
    fn a_damaged_file_is_refused_and_left_alone() {
        let path = place("damaged");
        TimingFile::add(&path, realtime()).unwrap();
        let sound = std::fs::read_to_string(&path).unwrap();
        for (from, to) in [
            ("\"version\":1", "\"version\":2"),
            ("\"ns\"", "\"us\""),
            ("\"ticks\":3", "\"ticks\":4"),
            ("[50000,2]", "[50000,18446744073709551615]"),
            ("[50000,2]", "[50000,0],[50001,2]"),
            ("[50000,2]", "[3000000,2]"),
            ("realtime", "sometimes"),
            ("}]}", ""),
            ("}]}", "}],\"more\":1}"),
        ] {
            let damaged = sound.replacen(from, to, 1);
            assert_ne!(damaged, sound, "{from}");
            std::fs::write(&path, &damaged).unwrap();
            let error = TimingFile::read(&path).unwrap_err();
            assert!(matches!(error, TimingFileError::Damaged(_)), "{to}: {error}");
            assert!(TimingFile::add(&path, realtime()).is_err());
            assert_eq!(std::fs::read_to_string(&path).unwrap(), damaged);
        }
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }
}
