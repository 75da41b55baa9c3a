//! A policy as text: what is read is valid, and written again it reads the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use shm_types::policy_json::{from_json, to_json};

fuzz_target!(|text: &str| {
    if let Ok(policy) = from_json(text) {
        assert_eq!(policy.validate(), Ok(()));
        let again = from_json(&to_json(&policy).expect("it is valid")).expect("it was written so");
        assert_eq!((again, again.digest), (policy, policy.digest));
    }
});
