//! A primitive of dmpbbo as JSON: what is read can be played and converted.
#![no_main]

use imitation::dmpbbo::{Conversion, Dmpbbo};
use libfuzzer_sys::fuzz_target;

const N_STEPS: usize = 50;

fuzz_target!(|text: &str| match Dmpbbo::from_json(text) {
    Ok(primitive) => {
        let (dim, duration_s) = (primitive.dim(), primitive.duration_s());
        assert!(dim > 0 && duration_s > 0.0 && duration_s.is_finite());
        let path = primitive.rollout(duration_s, duration_s / N_STEPS as f64);
        assert_eq!(path.shape(), (dim, N_STEPS + 1));
        let Conversion { dmp, largest_miss } = primitive.plain(8, 0.6);
        assert_eq!((dmp.forces.len(), dmp.goal.len()), (8, dim));
        assert!(largest_miss >= 0.0);
        if largest_miss.is_finite() {
            let path = dmp.rollout(duration_s, duration_s / N_STEPS as f64);
            assert_eq!(path.shape(), (dim, N_STEPS + 1));
        }
    }
    Err(error) => assert!(!error.to_string().is_empty()),
});
