//! A demonstration as CSV, and the policy a session would start from.
#![no_main]

use learner::Demonstration;
use learner::config::LearnerConfig;
use learner::problem::Problem;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(demonstration) = Demonstration::parse("pan.csv", text) {
        let poses = demonstration.poses();
        assert!(poses.iter().flatten().all(|x| x.is_finite()), "{poses:?}");
        let (speeds, accelerations) = demonstration.derivatives();
        assert_eq!((speeds.len(), accelerations.len()), (poses.len(), poses.len()));
        // The reach of the arm, which bounds the poses, is checked before this.
        if poses.iter().flatten().all(|x| x.abs() < 10.0) {
            let _ = Problem::new(&LearnerConfig::default(), &[demonstration]);
        }
    }
});
