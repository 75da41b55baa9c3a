//! One hash for the whole contract, so that two builds with different layouts refuse each other.
//!
//! iceoryx2 compares type name, size and alignment; two fields of one type that trade places pass
//! that comparison. The hash covers names, order and types of all fields.

use crate::{command, episode, equipment, measures, news, policy, telemetry};

/// 64-bit FNV-1a.
#[derive(Clone, Copy)]
pub struct Digest(u64);

impl Digest {
    pub const fn new() -> Self {
        Digest(0xcbf2_9ce4_8422_2325)
    }

    pub const fn bytes(mut self, bytes: &[u8]) -> Self {
        let mut i = 0;
        while i < bytes.len() {
            self.0 = (self.0 ^ bytes[i] as u64).wrapping_mul(0x0100_0000_01b3);
            i += 1;
        }
        self
    }

    pub const fn u64(self, value: u64) -> Self {
        self.bytes(&value.to_le_bytes())
    }

    pub const fn f64(self, value: f64) -> Self {
        self.u64(value.to_bits())
    }

    pub const fn finish(self) -> u64 {
        self.0
    }
}

impl Default for Digest {
    fn default() -> Self {
        Self::new()
    }
}

/// Hash of every message layout; carried in each message and as an attribute of each service.
pub const SCHEMA: u64 = Digest::new()
    .bytes(policy::Component::LAYOUT.as_bytes())
    .bytes(policy::LinearSystem::LAYOUT.as_bytes())
    .bytes(policy::PolicyMsg::LAYOUT.as_bytes())
    .bytes(policy::PolicyName::LAYOUT.as_bytes())
    .bytes(episode::TickRecord::LAYOUT.as_bytes())
    .bytes(measures::Measures::LAYOUT.as_bytes())
    .bytes(equipment::Equipment::LAYOUT.as_bytes())
    .bytes(episode::EpisodeHeader::LAYOUT.as_bytes())
    .bytes(episode::Ack::LAYOUT.as_bytes())
    .bytes(telemetry::TelemetryTick::LAYOUT.as_bytes())
    .bytes(telemetry::Telemetry::LAYOUT.as_bytes())
    .bytes(telemetry::Heartbeat::LAYOUT.as_bytes())
    .bytes(news::ModeNews::LAYOUT.as_bytes())
    .bytes(news::TrialNews::LAYOUT.as_bytes())
    .bytes(news::MeasuresNews::LAYOUT.as_bytes())
    .bytes(command::Command::LAYOUT.as_bytes())
    .bytes(command::Status::LAYOUT.as_bytes())
    .bytes(command::Reply::LAYOUT.as_bytes())
    .finish();
