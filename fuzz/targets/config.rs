//! The configuration file, defaults of its task and checks included.
#![no_main]

#[allow(dead_code)] // it belongs to a program that uses all of it
#[path = "../../src/config.rs"]
mod config;

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use config::Config;
use libfuzzer_sys::fuzz_target;
use skillet_fuzz::folder;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| folder().keep().join("c.toml"));

fuzz_target!(|data: &[u8]| {
    fs::write(&*FILE, data).expect("there is space");
    match Config::load(Some(&FILE)) {
        Ok(config) => {
            let text = config.to_toml().expect("it was read");
            fs::write(&*FILE, &text).expect("there is space");
            let again = Config::load(Some(&FILE)).expect("it was written so");
            assert_eq!(again.to_toml().expect("it was read"), text);
        }
        Err(error) => assert!(!format!("{error:#}").is_empty()),
    }
});
