//! A policy in a file, as JSON or as TOML; what is read is written and read back the same.
#![no_main]

#[path = "../../src/policy_file/mod.rs"]
mod policy_file;

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use skillet_fuzz::folder;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| folder().keep().join("p.toml"));

fuzz_target!(|data: &[u8]| {
    fs::write(&*FILE, data).expect("there is space");
    if let Ok(policy) = policy_file::read(&FILE) {
        let text = policy_file::to_toml(&policy).expect("it was read");
        fs::write(&*FILE, text).expect("there is space");
        assert_eq!(policy_file::read(&FILE).expect("it was written so").digest, policy.digest);
    }
});
