//! Ticks that come through a bridge: some of them, and said to be.

use std::collections::BTreeMap;

/// Where the loop is, and how many of its ticks a second come at most.
#[derive(Clone, Debug, PartialEq)]
pub struct Bridged {
    pub host: String,
    pub hz: u64,
}

impl Bridged {
    /// What a person should know who sees the ticks.
    pub fn sentence(&self) -> String {
        let Bridged { host, hz } = self;
        format!("live telemetry through the bridge to {host}, at most {hz} Hz: not every tick")
    }

    /// The same for a program that reads a recording.
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let pairs = [
            ("via", self.host.clone()),
            ("telemetry_hz", self.hz.to_string()),
            ("every_tick", "false".to_string()),
        ];
        pairs.map(|(key, value)| (key.to_string(), value)).into()
    }
}
