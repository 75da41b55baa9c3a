//! The answer of a judge's program: what is taken of it is finite and fits, and its words are text.
#![no_main]

#[allow(dead_code)] // it belongs to a program that uses all of it
#[path = "../../src/judging/answer.rs"]
mod answer;

use std::collections::BTreeMap;

use answer::{Answer, parse};
use libfuzzer_sys::fuzz_target;
use shm_types::measures::{Measure, Measures};

const ROLLOUT: u64 = 12;
const OWN: [(&str, &str); 2] = [("gap_m", "m"), ("straight", "bool")];

fuzz_target!(|line: &[u8]| {
    let own: BTreeMap<String, String> =
        OWN.iter().map(|(name, unit)| (name.to_string(), unit.to_string())).collect();
    let is_text = |words: &str| words.chars().all(|c| !c.is_control()) && words.len() < 4000;
    match parse(line, ROLLOUT, &own) {
        Ok(Answer::Judged(values)) => {
            let units = [("reward", "1"), ("success", "bool")].into_iter().chain(OWN);
            assert_eq!(values.len(), 2 + OWN.len());
            let measures =
                units.zip(values).map(|((name, unit), value)| Measure { name, unit, value });
            Measures::of(measures).expect("it is fit to be told");
        }
        Ok(Answer::Declined(words)) => assert!(is_text(&words)),
        Err(words) => assert!(is_text(&words) && !words.is_empty(), "{words}"),
    }
});
