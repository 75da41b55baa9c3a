//! The timings of a session's loops; what is read takes another run, and is read again.
#![no_main]

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use rt_controller::config::Pace;
use rt_controller::disk::timing_file::{LoopTiming, TimingFile};
use skillet_fuzz::folder;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| folder().keep().join("timing.json"));

fuzz_target!(|data: &[u8]| {
    fs::write(&*FILE, data).expect("there is space");
    let Ok(Some(file)) = TimingFile::read(&FILE) else { return };
    let pace = Pace::Realtime;
    let ticks = |file: &TimingFile| {
        file.loops().iter().find(|timing| timing.pace == pace).map_or(0, |timing| timing.ticks)
    };
    // No loop ever counts so far.
    if file.loops().iter().any(|timing| timing.ticks > u64::MAX / 2) {
        return;
    }
    let (wakeup, tick) = (vec![(50_000, 2), (60_000, 1)], vec![(1800, 3)]);
    let run = LoopTiming { pace, ticks: 3, missed_deadlines: 1, wakeup, tick };
    TimingFile::add(&FILE, run).expect("it was read");
    let sum = TimingFile::read(&FILE).expect("it was written so").expect("it is there");
    assert_eq!(ticks(&sum), ticks(&file) + 3);
});
