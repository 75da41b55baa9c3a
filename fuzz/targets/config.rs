//! The configuration file over the defaults of a task, and all checks that no task makes.
#![no_main]

#[allow(dead_code)] // it belongs to a program that uses all of it
#[path = "../../src/config.rs"]
mod config;

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use config::Config;
use libfuzzer_sys::fuzz_target;
use skillet_fuzz::folder;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| folder().keep().join("c.toml"));

/// As a task would have it that changes nothing.
fn defaults(name: &str, options: BTreeMap<String, String>) -> Config {
    let mut config = Config::default();
    (config.task.name, config.task.options) = (name.into(), options);
    config
}

fn read() -> anyhow::Result<Config> {
    let config = Config::read(&FILE, defaults)?;
    config.validate_settings()?;
    Ok(config)
}

fuzz_target!(|data: &[u8]| {
    fs::write(&*FILE, data).expect("there is space");
    match read() {
        Ok(config) => {
            let text = config.to_toml().expect("it was read");
            fs::write(&*FILE, &text).expect("there is space");
            let again = read().expect("it was written so");
            assert_eq!(again.to_toml().expect("it was read"), text);
        }
        Err(error) => assert!(!format!("{error:#}").is_empty()),
    }
});
