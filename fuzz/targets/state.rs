//! The state folder of a controller: `state.json` and an imported policy.
#![no_main]

use std::fs;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use rt_controller::disk::state_file::State;
use shm_types::policy_json::to_json;
use skillet_fuzz::{folder, springs};
use tempfile::TempDir;

static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = folder();
    fs::create_dir(folder.path().join("policies")).expect("there is space");
    let text = to_json(&springs()).expect("it is valid");
    fs::write(folder.path().join("policies/1.json"), text).expect("there is space");
    folder
});

fuzz_target!(|data: &[u8]| {
    let path = FOLDER.path();
    fs::write(path.join("state.json"), data).expect("there is space");
    if let Ok(state) = State::read(path) {
        for policy in [state.active, state.last_good].into_iter().flatten() {
            assert_eq!(policy.validate(), Ok(()));
        }
        assert!(state.policies.contains_key(&1));
    }
});
