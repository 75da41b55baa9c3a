//! The stored path of a rollout: a table of numbers, or refused.
#![no_main]

use learner::path::{decode, encode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    match decode(data) {
        Ok(rows) => assert_eq!(encode(&rows), data),
        Err(error) => assert_eq!(error.bytes, data.len()),
    }
});
