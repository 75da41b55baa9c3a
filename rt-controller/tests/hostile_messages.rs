//! Commands and episodes, as a broken or hostile peer would send them: nothing panics, and what is
//! taken keeps what the receiver relies on.
#![allow(non_snake_case)] // matrices

mod hostile;

use hostile::{messages, mutate, noise};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shm_types::SCHEMA;
use shm_types::command::{AT_NOW, COMMAND_POSTURE, COMMAND_STATUS, Command, Reply, Status};
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::news::{MAX_MODES, TrialNews};
use shm_types::telemetry::{TELEMETRY_TICKS, Telemetry};
use shm_types::text::{self, REASON_LEN};

const FEW: u64 = 100_000;
const RECORDS: usize = 3;

#[test]
fn a_command_that_is_taken_is_one() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut taken = 0;
    let sent = messages(FEW);
    for _ in 0..sent {
        let mut command: Command = noise(&mut rng);
        if rng.random_bool(0.8) {
            let kind = rng.random_range(COMMAND_STATUS - 1..=COMMAND_POSTURE + 1);
            command = Command { at: rng.random_range(0..3), ..Command::new(kind, 7) };
        }
        if rng.random() {
            mutate(&mut command, &mut rng);
        }
        if command.validate().is_ok() {
            taken += 1;
            assert_eq!(command.schema, SCHEMA);
            assert!(command.kind >= COMMAND_STATUS && command.kind <= COMMAND_POSTURE);
            assert!(command.at <= AT_NOW);
        }
    }
    assert!(taken * 5 > sent && taken * 5 < sent * 4, "{taken} of {sent}");
}

#[test]
fn a_reply_can_always_be_read() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for _ in 0..messages(FEW) {
        let mut reply: Reply = noise(&mut rng);
        if rng.random() {
            reply = Reply::refused(7, Status::ZERO, "joint 3: µ, ε and ∞ are no numbers");
            mutate(&mut reply, &mut rng);
        }
        assert!(reply.reason_text().len() <= 3 * REASON_LEN);
        assert!(!reply.status.active.describe().is_empty());
    }
}

/// Every number is looked at here by its bytes, not by its field.
#[test]
fn an_episode_that_is_taken_holds_numbers_only() {
    use zerocopy::IntoBytes;
    let is_number = |word: &[u8]| f64::from_ne_bytes(word.try_into().unwrap()).is_finite();
    // Tick, phase and fault; flags and reserved word.
    let in_record = size_of::<TickRecord>() - 8;
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (mut taken, sent) = (0, messages(FEW));
    for _ in 0..sent {
        let n_records = rng.random_range(0..=RECORDS as u64 + 1);
        let mut header = EpisodeHeader { n_records, ..Default::default() };
        let mut records = [TickRecord::ZERO; RECORDS];
        match rng.random_range(0..4) {
            0 => mutate(&mut header, &mut rng),
            1 => mutate(&mut records, &mut rng),
            2 if rng.random_bool(0.1) => header = noise(&mut rng),
            _ => {}
        }
        let Ok(used) = header.validate(&records) else { continue };
        taken += 1;
        assert_eq!((header.schema, used.len() as u64), (SCHEMA, header.n_records));
        assert!(text::is_valid(&header.reason));
        assert!(header.measures.iter().all(|measure| measure.value.is_finite()));
        for record in used {
            assert!(record.as_bytes()[16..in_record].chunks_exact(8).all(is_number), "{record:?}");
        }
    }
    assert!(taken * 3 > sent && taken < sent, "{taken} of {sent}");
}

#[test]
fn what_observers_are_told_can_always_be_read() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut believed = 0;
    for _ in 0..FEW / 10 {
        let mut sample: Telemetry = noise(&mut rng);
        if rng.random() {
            sample.schema = SCHEMA;
        }
        assert!(sample.ticks().len() <= TELEMETRY_TICKS);
        let mut news: TrialNews = noise(&mut rng);
        if rng.random() {
            (news.schema, news.n_modes) = (SCHEMA, rng.random_range(0..2 * MAX_MODES as u64));
        }
        if let Ok(modes) = news.validate() {
            believed += 1;
            assert!(news.reward.is_finite() && modes.len() <= MAX_MODES);
            assert!(modes.iter().all(|mode| mode.prior.is_finite()));
        }
    }
    assert!(believed > 0);
}
