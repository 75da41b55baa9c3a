//! An episode as the learner takes it: validated, rewarded, stored, learnt; then the next proposal.
#![no_main]

use learner::Learner;
use libfuzzer_sys::fuzz_target;
use shm_types::episode::TickRecord;
use skillet_fuzz::{action_session, echo, folder, judge, patched, session, split};

fuzz_target!(|data: &[u8]| {
    let directory = folder();
    let mut learner = session(directory.path(), action_session(), &[]);
    for change in data.chunks(120).take(8) {
        let policy = learner.next_policy().expect("there is space");
        assert_eq!(policy.validate(), Ok(()));
        let (mode, change) = split(change);
        let (in_header, in_records) = change.split_at(change.len().min(usize::from(mode & 7) * 11));
        let header = patched(&echo(&policy, 2, 0.5), in_header);
        let records = patched(&[TickRecord::ZERO; 2], in_records);
        if learner.complete("", &header, &records).is_ok() {
            assert_eq!(learner.durable_rollout(), policy.rollout);
            let path = learner.store().path(policy.rollout).expect("stored").expect("stored");
            let columns = path.iter().flat_map(|row| row.columns());
            assert!(columns.clone().all(f32::is_finite), "{:?}", columns.collect::<Vec<_>>());
        }
    }
    let _ = learner.summary();
    learner.modes().expect("there is space");
    drop(learner);
    let resumed = Learner::resume(directory.path(), "landscape", &action_session(), &[], judge());
    assert!(resumed.is_ok(), "{:?}", resumed.err());
});
