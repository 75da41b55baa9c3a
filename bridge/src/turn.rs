//! The turn: what a cell says of itself, and the episode it hands in or the reply to a command.
//!
//! ```text
//! magic, version, schema | TurnHead | EpisodeHeader, TickRecord × n_records   (where it has an episode)
//!                                   | SentReply                               (where it has a reply)
//! ```
//!
//! Every number is little-endian. The first three stay where they are in all versions, so that two builds that differ
//! can say so. A turn may arrive twice: what it says is then true twice.

use shm_types::command::Status;
use shm_types::episode::{EpisodeHeader, MAX_RECORDS, TickRecord};
use shm_types::equipment::Equipment;
use shm_types::telemetry::Heartbeat;
use shm_types::text;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::command::{SentReply, check_status};
pub use crate::message::{MessageError, Prefix, VERSION};

/// Bytes of a name: of a cell, of a host.
pub const NAME_LEN: usize = text::HOST_LEN;
/// Bytes of a world: which task on which arm.
pub const WORLD_LEN: usize = 192;
/// The longest turn, bytes.
pub const MAX_TURN: usize = size_of::<Prefix>()
    + size_of::<TurnHead>()
    + size_of::<EpisodeHeader>()
    + MAX_RECORDS * size_of::<TickRecord>();

/// How a refusal begins. The transport has refusals of its own, for a turn that takes too long for example.
const REFUSED: &str = "skillet bridge: ";

/// A refusal as it is sent: text, which every version understands.
pub fn refusal(reason: &str) -> String {
    format!("{REFUSED}{reason}")
}

/// The reason of a refusal, if it is one.
pub fn reason(text: &str) -> Option<&str> {
    text.strip_prefix(REFUSED)
}

/// The newest of a hub that a cell has: 0 of what it has not.
#[derive(Clone, Copy, Debug, Default, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Seen {
    /// Start of the hub that counts.
    pub hub: u64,
    /// Policies that the learner has published.
    pub policy: u64,
    /// Acknowledgements of the learner.
    pub ack: u64,
}

/// What a cell says in every turn.
#[derive(Clone, Copy, Debug, PartialEq, IntoBytes, FromBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct TurnHead {
    /// Start of the bridge; tells two bridges of one cell apart.
    pub bridge: u64,
    /// Machine of the cell; see [`shm_types::text`].
    pub host: [u8; NAME_LEN],
    pub cell: [u8; NAME_LEN],
    /// The cell in its certificate; empty without keys.
    pub certificate: [u8; NAME_LEN],
    /// Which task on which arm, as text; empty when it is not known.
    pub world: [u8; WORLD_LEN],
    /// The newest of the controller; `schema` 0 while none is heard.
    pub controller: Heartbeat,
    /// What that controller says of itself; of [`Status::ZERO`] while it has not been asked.
    pub status: Status,
    pub seen: Seen,
    /// The newest command of that hub that has come, by its number.
    pub commands: u64,
    /// 1: an episode follows.
    pub has_episode: u64,
    /// 1: a reply follows.
    pub has_reply: u64,
}

/// A turn that was received and checked.
#[derive(Debug, PartialEq)]
pub struct Turn {
    pub head: TurnHead,
    pub episode: Option<Episode>,
    pub reply: Option<Box<SentReply>>,
}

/// The records in use, behind their header.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    pub header: EpisodeHeader,
    pub records: Vec<TickRecord>,
}

impl TurnHead {
    pub fn cell_name(&self) -> String {
        text::unpack(&self.cell)
    }

    pub fn host_name(&self) -> String {
        text::unpack(&self.host)
    }

    pub fn world_name(&self) -> String {
        text::unpack(&self.world)
    }

    pub fn certificate_name(&self) -> String {
        text::unpack(&self.certificate)
    }

    /// The turn as bytes, with the records in use of an episode that is valid.
    pub fn encode(&self, episode: Option<(&EpisodeHeader, &[TickRecord])>) -> Vec<u8> {
        let head = TurnHead { has_episode: u64::from(episode.is_some()), has_reply: 0, ..*self };
        let records = episode.map_or(0, |(_, records)| size_of_val(records));
        let mut bytes = Vec::with_capacity(MAX_TURN.min(1024 + size_of::<TurnHead>() + records));
        bytes.extend_from_slice(Prefix::OURS.as_bytes());
        bytes.extend_from_slice(head.as_bytes());
        if let Some((header, records)) = episode {
            header.write(records, &mut bytes);
        }
        bytes
    }

    /// The turn as bytes, with the reply to a command.
    pub fn encode_reply(&self, reply: &SentReply) -> Vec<u8> {
        let head = TurnHead { has_episode: 0, has_reply: 1, ..*self };
        [Prefix::OURS.as_bytes(), head.as_bytes(), reply.as_bytes()].concat()
    }
}

impl Turn {
    /// Reads a turn and checks everything of it.
    pub fn decode(bytes: &[u8]) -> Result<Turn, MessageError> {
        let len = bytes.len();
        let rest = Prefix::take(bytes)?;
        let (head, rest) =
            TurnHead::read_from_prefix(rest).map_err(|_| MessageError::Length { len })?;
        let names = [&head.host, &head.cell, &head.certificate];
        let equipment = [&head.controller.equipment, &head.status.equipment];
        if !names.into_iter().all(text::is_valid)
            || !text::is_valid(&head.world)
            || !equipment.into_iter().all(Equipment::is_valid)
        {
            return Err(MessageError::Text);
        }
        check_status(&head.status)?;
        let (mut episode, mut reply) = (None, None);
        match (head.has_episode, head.has_reply) {
            (0, 0) if rest.is_empty() => {}
            (1, 0) if len <= MAX_TURN => episode = Some(read_episode(rest, len)?),
            (0, 1) => reply = Some(Box::new(read_reply(rest, len)?)),
            _ => return Err(MessageError::Length { len }),
        }
        Ok(Turn { head, episode, reply })
    }
}

fn read_reply(bytes: &[u8], len: usize) -> Result<SentReply, MessageError> {
    let sent = SentReply::read_from_bytes(bytes).map_err(|_| MessageError::Length { len })?;
    sent.check()?;
    Ok(sent)
}

fn read_episode(bytes: &[u8], len: usize) -> Result<Episode, MessageError> {
    let (header, records) = EpisodeHeader::read(bytes).ok_or(MessageError::Length { len })?;
    if header.validate(&records)?.len() != records.len() {
        return Err(MessageError::Length { len });
    }
    Ok(Episode { header, records })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use shm_types::SCHEMA;
    use shm_types::command::Reply;

    use super::*;

    fn head() -> TurnHead {
        TurnHead {
            bridge: 7,
            host: text::pack("oven"),
            cell: text::pack("kitchen"),
            certificate: text::pack(""),
            world: text::pack(""),
            controller: Heartbeat { schema: SCHEMA, boot_id: 1, counter: 2, ..Heartbeat::NONE },
            status: Status::ZERO,
            seen: Seen { hub: 1, policy: 2, ack: 3 },
            commands: 4,
            has_episode: 0,
            has_reply: 0,
        }
    }

    fn with_episode() -> (Vec<u8>, EpisodeHeader) {
        let header = EpisodeHeader { session: 7, rollout: 3, n_records: 2, ..Default::default() };
        let mut records = vec![TickRecord::ZERO; 5];
        records[1].tau[3] = 1.0 / 3.0;
        (head().encode(Some((&header, &records))), header)
    }

    #[test]
    fn a_turn_comes_back_bit_for_bit() {
        let turn = Turn::decode(&head().encode(None)).unwrap();
        assert_eq!(turn, Turn { head: head(), episode: None, reply: None });
        let (bytes, header) = with_episode();
        let episode = Turn::decode(&bytes).unwrap().episode.unwrap();
        assert_eq!((episode.header, episode.records.len()), (header, 2));
        assert_eq!(episode.records[1].tau[3], 1.0 / 3.0);
    }

    #[test]
    fn a_reply_comes_back_and_a_cut_one_is_none() {
        let reply = Reply::refused(9, Status::ZERO, "no arm");
        let sent = SentReply { age_ns: 5, reply };
        let bytes = head().encode_reply(&sent);
        let turn = Turn::decode(&bytes).unwrap();
        assert_eq!((turn.episode, turn.reply.as_deref()), (None, Some(&sent)));
        for len in (0..bytes.len()).step_by(7) {
            assert!(Turn::decode(&bytes[..len]).is_err(), "cut at {len}");
        }
        let odd = SentReply { reply: Reply { accepted: 9, ..reply }, ..sent };
        let refused = Turn::decode(&head().encode_reply(&odd));
        assert_eq!(refused, Err(MessageError::Value("accepted")));
        let status = Status { posture_s: f64::NAN, ..Status::ZERO };
        let endless = TurnHead { status, ..head() }.encode(None);
        assert_eq!(Turn::decode(&endless), Err(MessageError::Value("posture")));
    }

    #[test]
    fn a_turn_that_is_cut_or_too_long_is_none() {
        let (mut bytes, _) = with_episode();
        for len in 0..bytes.len() {
            assert!(Turn::decode(&bytes[..len]).is_err(), "cut at {len}");
        }
        bytes.extend_from_slice(TickRecord::ZERO.as_bytes());
        let len = bytes.len();
        assert_eq!(Turn::decode(&bytes), Err(MessageError::Length { len }), "one more record");
    }

    #[test]
    fn the_version_is_looked_at_first() {
        let (mut bytes, _) = with_episode();
        bytes[16] ^= 1;
        assert!(matches!(Turn::decode(&bytes), Err(MessageError::Schema { .. })));
        bytes[8..16].copy_from_slice(&9_u64.to_le_bytes());
        assert_eq!(Turn::decode(&bytes[..24]), Err(MessageError::Version { found: 9 }));
        bytes[0] ^= 1;
        assert_eq!(Turn::decode(&bytes), Err(MessageError::Magic));
    }

    #[test]
    fn what_is_not_finite_or_no_text_is_refused() {
        let header = EpisodeHeader { n_records: 1, ..Default::default() };
        let record = TickRecord { t_s: f64::NAN, ..TickRecord::ZERO };
        let bytes = head().encode(Some((&header, &[record])));
        assert!(matches!(Turn::decode(&bytes), Err(MessageError::Episode(_))));
        let mut nameless = head();
        nameless.host[9] = 0xff;
        assert_eq!(Turn::decode(&nameless.encode(None)), Err(MessageError::Text));
        let mut armless = head();
        armless.controller.equipment.arm[0] = 0xff;
        assert_eq!(Turn::decode(&armless.encode(None)), Err(MessageError::Text));
    }

    #[test]
    fn whatever_changes_on_the_way_is_refused_or_valid() {
        let (whole, _) = with_episode();
        let mut generator = ChaCha8Rng::seed_from_u64(5);
        let mut accepted = 0;
        for _ in 0..20_000 {
            let mut bytes = whole.clone();
            for _ in 0..generator.random_range(1..4) {
                let at = generator.random_range(0..bytes.len());
                bytes[at] = generator.random_range(0..=255);
            }
            if let Ok(Turn { head, episode, .. }) = Turn::decode(&bytes) {
                accepted += 1;
                let episode = episode.expect("nothing else fits its length");
                let again = head.encode(Some((&episode.header, &episode.records)));
                assert_eq!(again, bytes);
            }
        }
        assert!((100..20_000).contains(&accepted), "{accepted} accepted");
    }
}
