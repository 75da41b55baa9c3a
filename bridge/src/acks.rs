//! What a learner has acknowledged, session by session.
//!
//! A cell that was cut off may come back to a learner of another session. What it has of the sessions before is learnt
//! all the same, and must leave its spool.

use shm_types::SCHEMA;
use shm_types::episode::Ack;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Sessions of one cell that are remembered.
pub const SESSIONS: usize = 8;

/// The newest acknowledgement of each of the last sessions.
#[derive(Clone, Copy, Debug, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Acks {
    /// The oldest first, behind places that are free: those with `schema` 0.
    places: [Ack; SESSIONS],
}

impl Acks {
    pub const NONE: Acks = Acks { places: [Ack::NONE; SESSIONS] };

    /// Takes an acknowledgement in place of the one of its session; true if it was not the newest already.
    pub fn take(&mut self, ack: Ack) -> bool {
        if ack.schema != SCHEMA || self.newest() == Some(ack) {
            return false;
        }
        let of_session = |had: &Ack| had.schema == SCHEMA && had.session == ack.session;
        // The place of its session; else a free one, or that of the oldest: the first.
        let at = self.places.iter().position(of_session).unwrap_or(0);
        self.places[at..].rotate_left(1);
        self.places[SESSIONS - 1] = ack;
        true
    }

    /// The oldest first.
    pub fn iter(&self) -> impl Iterator<Item = Ack> {
        self.places.into_iter().filter(|ack| ack.schema == SCHEMA)
    }

    pub fn newest(&self) -> Option<Ack> {
        self.iter().last()
    }

    /// This rollout is durable, by what is acknowledged here.
    pub fn covers(&self, session: u64, rollout: u64) -> bool {
        self.iter().any(|ack| ack.covers(session, rollout))
    }

    /// The schema of every place, 0 where it is free.
    pub(crate) fn schemas(&self) -> impl Iterator<Item = u64> {
        self.places.into_iter().map(|ack| ack.schema)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ack(session: u64, durable_rollout: u64) -> Ack {
        Ack { schema: SCHEMA, session, durable_rollout, rollout: durable_rollout, success: 0 }
    }

    fn of(acks: &[Ack]) -> Acks {
        let mut all = Acks::NONE;
        assert!(acks.iter().all(|ack| all.take(*ack)));
        all
    }

    #[test]
    fn each_session_has_its_newest_one() {
        let mut acks = of(&[ack(1, 100), ack(2, 1), ack(2, 2)]);
        assert!(acks.iter().eq([ack(1, 100), ack(2, 2)]));
        assert!(acks.covers(1, 100) && acks.covers(2, 2));
        assert!(!acks.covers(1, 101) && !acks.covers(2, 3) && !acks.covers(0, 0));
        assert!(!acks.take(ack(2, 2)), "no news");
        assert!(acks.take(ack(1, 100)), "the learner works on the first one again");
        assert_eq!(acks.newest(), Some(ack(1, 100)));
    }

    #[test]
    fn the_oldest_session_goes_first() {
        let acks: Vec<Ack> = (1..=SESSIONS as u64 + 2).map(|session| ack(session, 5)).collect();
        assert!(of(&acks).iter().eq(acks[2..].iter().copied()));
    }

    #[test]
    fn one_of_another_build_is_not_taken() {
        let mut acks = Acks::NONE;
        assert!(!acks.take(Ack { schema: SCHEMA ^ 1, ..ack(1, 1) }));
        assert_eq!((acks, acks.newest()), (Acks::NONE, None));
    }
}
