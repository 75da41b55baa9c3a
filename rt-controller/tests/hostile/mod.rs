//! Messages as a broken or hostile peer would send them, and what must hold of those that pass.
#![allow(dead_code)] // each test file uses its own part

pub mod bounds;
pub mod fields;
pub mod policies;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use zerocopy::{FromBytes, Immutable, IntoBytes};

/// Numbers that a bound may have forgotten.
const SPECIAL: [f64; 18] = [
    f64::NAN,
    -f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    0.0,
    -0.0,
    f64::EPSILON,
    1.0,
    -1.0,
    100.0,
    1e6,
    1e12,
    1e300,
];

/// How many messages: a short run, or as many as the variable says.
pub fn messages(few: u64) -> u64 {
    match std::env::var("SKILLET_HOSTILE_MESSAGES") {
        Ok(text) => text.parse().expect("SKILLET_HOSTILE_MESSAGES is a number"),
        Err(_) => few,
    }
}

/// Nothing but noise.
pub fn noise<T: FromBytes + IntoBytes>(rng: &mut ChaCha8Rng) -> T {
    let mut message = T::new_zeroed();
    rng.fill(message.as_mut_bytes());
    message
}

/// One to eight changes somewhere in the message: bits, bytes, words, or two words in each other's
/// place. Every message is a multiple of 8 bytes.
pub fn mutate<T: FromBytes + IntoBytes + Immutable>(message: &mut T, rng: &mut ChaCha8Rng) {
    let bytes = message.as_mut_bytes();
    let words = bytes.len() / 8;
    for _ in 0..rng.random_range(1..=8) {
        let at = rng.random_range(0..words) * 8;
        match rng.random_range(0..5) {
            0 => bytes[at + rng.random_range(0..8)] ^= 1 << rng.random_range(0..8),
            1 => bytes[at + rng.random_range(0..8)] = rng.random(),
            2 => rng.fill(&mut bytes[at..at + 8]),
            3 => {
                let special = SPECIAL[rng.random_range(0..SPECIAL.len())];
                bytes[at..at + 8].copy_from_slice(&special.to_ne_bytes());
            }
            _ => {
                let other = rng.random_range(0..words) * 8;
                (0..8).for_each(|i| bytes.swap(at + i, other + i));
            }
        }
    }
}
