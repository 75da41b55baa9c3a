//! Episodes that wait in the spools of the controllers, by their files.

use std::collections::BTreeMap;

use anyhow::Result;
use learner::store::Store;

use super::fleet::Fleet;

/// How many episodes wait, by the number of their session. Those of no session of this soak count as of `None`.
pub fn waiting(fleet: &Fleet, sessions: u64) -> Result<BTreeMap<Option<u64>, u64>> {
    let mut numbers = BTreeMap::new();
    for number in 0..sessions {
        let store = Store::open(&fleet.session(number).join("session.db"))?;
        numbers.insert(format!("{:016x}", store.meta().session_id), number);
    }
    let mut waiting = BTreeMap::new();
    for cell in &fleet.cells {
        let Ok(files) = std::fs::read_dir(cell.dir.join("state/spool")) else { continue };
        for file in files.flatten() {
            // <session>-<rollout>.episode, see `rt-controller/src/disk/spool.rs`.
            let name = file.file_name().to_string_lossy().into_owned();
            if name.ends_with(".episode") {
                let session = name.split('-').next().and_then(|id| numbers.get(id)).copied();
                *waiting.entry(session).or_insert(0) += 1;
            }
        }
    }
    Ok(waiting)
}
