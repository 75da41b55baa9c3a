//! Flight records on disk: `<state>/faults/<boot>-<tick>.csv`, the newest few.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::executor::flight::{FlightRecord, FlightTick};
use crate::fault::Fault;

/// Folder below the state folder.
pub const FAULTS_DIR: &str = "faults";
/// Files kept; a cell that faults again and again must not fill the disk.
const FILES_MAX: usize = 20;

/// The folder of a cell.
pub(crate) struct FlightFiles {
    dir: PathBuf,
    /// Their names sort by age.
    names: BTreeSet<String>,
}

impl FlightFiles {
    /// An absent folder is empty.
    pub fn open(state: &Path) -> FlightFiles {
        let dir = state.join(FAULTS_DIR);
        let entries = fs::read_dir(&dir).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let names = names.filter(|name| name.ends_with(".csv")).collect();
        FlightFiles { dir, names }
    }

    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Makes room for the record of this start of the controller and this tick; returns its path.
    pub fn add(&mut self, boot_id: u64, tick: u64) -> PathBuf {
        while self.names.len() >= FILES_MAX
            && let Some(oldest) = self.names.pop_first()
        {
            // One that cannot be removed is no reason to lose the new one.
            let _ = fs::remove_file(self.dir.join(oldest));
        }
        let name = format!("{boot_id:020}-{tick:012}.csv");
        let path = self.dir.join(&name);
        self.names.insert(name);
        path
    }
}

/// The record as a table, one line a tick, the tick of the fault last. Units are in the names of the
/// columns; `NaN` is what was measured.
pub(crate) fn csv(record: &FlightRecord, n_joints: usize) -> String {
    let mut text = String::from("tick,phase,fault,flags,t_s,late_us,sample");
    for (name, unit) in [("q", "rad"), ("qd", "rad_s"), ("tau", "Nm"), ("unexplained", "Nm")] {
        for joint in 1..=n_joints {
            let _ = write!(text, ",{name}{joint}_{unit}");
        }
    }
    for name in ["pan", "attractor"] {
        let _ = write!(text, ",{name}_x_m,{name}_y_m,{name}_z_m");
        let _ = write!(text, ",{name}_rx_rad,{name}_ry_rad,{name}_rz_rad");
    }
    text += ",object_x_m,object_y_m,object_z_m,object_qw,object_qi,object_qj,object_qk,contact\n";
    for tick in record.ticks() {
        line(&mut text, tick, n_joints);
    }
    text
}

fn line(text: &mut String, tick: &FlightTick, n_joints: usize) {
    let FlightTick { measured, phase, flags, t_s, .. } = tick;
    let (late_us, fault) = (tick.late_ns as f64 * 1e-3, Fault::describe(tick.fault));
    // Writing to a string does not fail.
    let _ = write!(text, "{},{phase},{fault},{flags},{t_s},{late_us}", tick.tick);
    let _ = write!(text, ",{}", measured.sample);
    for joints in [&measured.q, &measured.qd, &tick.tau, &tick.force] {
        cells(text, joints.iter().take(n_joints));
    }
    let object = &measured.object;
    let (place, r) = (object.p_WO.iter(), &object.R_WO);
    let rotation = [r.w, r.i, r.j, r.k];
    cells(text, tick.x.iter().chain(&tick.attractor).chain(place).chain(&rotation));
    let _ = writeln!(text, ",{}", u8::from(object.in_contact));
}

fn cells<'a>(text: &mut String, numbers: impl Iterator<Item = &'a f64>) {
    for x in numbers {
        let _ = write!(text, ",{x}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::executor::flight::tests::record_of;

    #[test]
    fn the_newest_files_are_kept_also_over_a_restart() {
        let dir = std::env::temp_dir().join(format!("skillet-flights-{}", std::process::id()));
        fs::create_dir_all(dir.join(FAULTS_DIR)).unwrap();
        let text = csv(&record_of(3), 7);
        assert_eq!(text.lines().count(), 4);
        for tick in 0..30 {
            let path = FlightFiles::open(&dir).add(1 + tick / 10, tick);
            fs::write(path, &text).unwrap();
        }
        let files = FlightFiles::open(&dir);
        assert_eq!(files.len(), FILES_MAX);
        assert_eq!(files.names.first().unwrap(), "00000000000000000002-000000000010.csv");
        fs::remove_dir_all(&dir).unwrap();
    }
}
