//! Episodes on disk, from before they are sent until the learner holds them durable.
//!
//! A thread of its own writes them. A request for a rollout that lies here is answered from here: what was
//! executed is executed once.
//!
//! ```text
//! <state>/spool/<session>-<rollout>.episode    magic, schema, header, records, digest
//! ```

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use shm_types::channel::EpisodeLoan;
use shm_types::episode::{Ack, EpisodeError, EpisodeHeader, TickRecord};
use shm_types::policy::PolicyName;
use shm_types::{Digest, SCHEMA};
use thiserror::Error;
use zerocopy::{FromBytes, IntoBytes};

use crate::disk::keeper::{own_folder, write_whole};

/// Episodes kept of one session at most; then its learning pauses and the oldest stay.
const MAX_EPISODES: usize = 64;
/// Episodes kept of all sessions. Those whose learner never comes back must not block the others
/// soon, nor fill the disk.
const MAX_OF_ALL: usize = 1024;
const MAGIC: u64 = u64::from_le_bytes(*b"SKEPISOD");

/// Why a file is no episode.
#[derive(Debug, Error)]
pub(crate) enum SpoolError {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error("it is torn, damaged or from another build")]
    Damaged,
    #[error(transparent)]
    Episode(#[from] EpisodeError),
}

/// An episode on its way back from the disk.
pub(crate) struct Spooled {
    pub name: PolicyName,
    pub episode: EpisodeLoan,
    pub result: Result<(), String>,
}

pub(crate) struct Spool {
    dir: PathBuf,
    orders: Option<Sender<(PathBuf, PolicyName, EpisodeLoan)>>,
    spooled: Receiver<Spooled>,
    thread: Option<JoinHandle<()>>,
    /// What lies in the folder, by session and rollout.
    names: BTreeMap<(u64, u64), PolicyName>,
    /// With the thread; sent as soon as it is written.
    writing: Vec<PolicyName>,
    /// The session that asked last.
    asking: u64,
}

impl Spool {
    /// With what an earlier run left. A file that is no whole episode is removed: its rollout was
    /// never acknowledged and will be asked for again.
    pub fn open(dir: &Path) -> io::Result<Spool> {
        own_folder(dir)?;
        let (orders, inbox) = channel();
        let (outbox, spooled) = channel();
        let mut names = BTreeMap::new();
        for path in fs::read_dir(dir)?.flatten().map(|entry| entry.path()) {
            match read(&path) {
                Ok((header, _)) => {
                    names.insert((header.session, header.rollout), header.name());
                }
                Err(error) => {
                    tracing::warn!("{}: {error}; removed", path.display());
                    let _ = fs::remove_file(&path);
                }
            }
        }
        let work = move || spool(&inbox, &outbox);
        let thread = std::thread::Builder::new().name("skillet-spool".into()).spawn(work)?;
        let (orders, thread) = (Some(orders), Some(thread));
        let (dir, writing) = (dir.to_path_buf(), Vec::new());
        Ok(Spool { dir, orders, spooled, thread, names, writing, asking: 0 })
    }

    pub fn len(&self) -> usize {
        self.names.len()
    }

    pub fn asked_by(&mut self, session: u64) {
        self.asking = session;
    }

    /// For the session that asked last.
    pub fn is_full(&self) -> bool {
        let own = self.names.range((self.asking, 0)..=(self.asking, u64::MAX)).count();
        own >= MAX_EPISODES || self.len() >= MAX_OF_ALL
    }

    /// Orders a finished episode to be written; [`Spool::spooled`] gives it back.
    pub fn store(&mut self, name: PolicyName, episode: EpisodeLoan) {
        self.writing.push(name);
        if let Some(orders) = &self.orders {
            // The thread ends only after this sender.
            let _ = orders.send((self.path(name.session, name.rollout), name, episode));
        }
    }

    pub fn spooled(&mut self) -> Option<Spooled> {
        let spooled = self.spooled.try_recv().ok()?;
        self.writing.retain(|name| *name != spooled.name);
        if spooled.result.is_ok() {
            let PolicyName { session, rollout, .. } = spooled.name;
            self.names.insert((session, rollout), spooled.name);
        }
        Some(spooled)
    }

    /// Something is being written.
    pub fn is_busy(&self) -> bool {
        !self.writing.is_empty()
    }

    /// It is being written, and will be sent right after.
    pub fn is_writing(&self, name: &PolicyName) -> bool {
        self.writing.contains(name)
    }

    pub fn holds(&self, name: &PolicyName) -> bool {
        self.names.get(&(name.session, name.rollout)) == Some(name)
    }

    /// The episode of just this policy and rollout, if it lies here.
    pub fn find(&mut self, name: &PolicyName) -> Option<(EpisodeHeader, Vec<TickRecord>)> {
        if !self.holds(name) {
            return None;
        }
        match read(&self.path(name.session, name.rollout)) {
            Ok(episode) => Some(episode),
            Err(error) => {
                tracing::warn!(rollout = name.rollout, "spooled episode: {error}; run again");
                self.names.remove(&(name.session, name.rollout));
                None
            }
        }
    }

    /// What `ack` covers is the learner's now.
    pub fn acknowledged(&mut self, ack: &Ack) {
        let of_session = self.names.range((ack.session, 0)..=(ack.session, u64::MAX));
        let covered = of_session.filter(|((session, rollout), _)| ack.covers(*session, *rollout));
        let done: Vec<_> = covered.map(|(key, _)| *key).collect();
        for key in done {
            self.names.remove(&key);
            // What stays behind is acknowledged again at the next start.
            let _ = fs::remove_file(self.path(key.0, key.1));
        }
    }

    fn path(&self, session: u64, rollout: u64) -> PathBuf {
        self.dir.join(format!("{session:016x}-{rollout:08}.episode"))
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn spool(inbox: &Receiver<(PathBuf, PolicyName, EpisodeLoan)>, outbox: &Sender<Spooled>) {
    while let Ok((path, name, episode)) = inbox.recv() {
        let bytes = encode(episode.user_header(), episode.payload());
        let result =
            write_whole(&path, &bytes).map_err(|error| format!("{}: {error}", path.display()));
        if result.is_ok() {
            let PolicyName { session, rollout, .. } = name;
            let boot_id = episode.user_header().boot_id;
            tracing::info!(session, rollout, boot_id, "episode is durable");
        }
        // The exchange has ended: the episode is on disk and will be asked for.
        let _ = outbox.send(Spooled { name, episode, result });
    }
}

fn read(path: &Path) -> Result<(EpisodeHeader, Vec<TickRecord>), SpoolError> {
    decode(&fs::read(path)?)
}

/// Only the records in use are written.
fn encode(header: &EpisodeHeader, records: &[TickRecord]) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend_from_slice(MAGIC.as_bytes());
    bytes.extend_from_slice(SCHEMA.as_bytes());
    header.write(records, &mut bytes);
    let digest = Digest::new().bytes(&bytes).finish();
    bytes.extend_from_slice(digest.as_bytes());
    bytes
}

pub(crate) fn decode(bytes: &[u8]) -> Result<(EpisodeHeader, Vec<TickRecord>), SpoolError> {
    let (content, digest) = bytes.split_last_chunk::<8>().ok_or(SpoolError::Damaged)?;
    if Digest::new().bytes(content).finish() != u64::from_ne_bytes(*digest) {
        return Err(SpoolError::Damaged);
    }
    let ([magic, schema], rest) =
        <[u64; 2]>::read_from_prefix(content).map_err(|_| SpoolError::Damaged)?;
    if (magic, schema) != (MAGIC, SCHEMA) {
        return Err(SpoolError::Damaged);
    }
    let (header, records) = EpisodeHeader::read(rest).ok_or(SpoolError::Damaged)?;
    header.validate(&records)?;
    Ok((header, records))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode() -> (EpisodeHeader, Vec<TickRecord>) {
        let header = EpisodeHeader { session: 7, rollout: 3, n_records: 2, ..Default::default() };
        let mut records = vec![TickRecord::ZERO; 5];
        records[1].tau[3] = 1.0 / 3.0;
        (header, records)
    }

    fn ack(session: u64, durable_rollout: u64, rollout: u64) -> Ack {
        Ack { schema: SCHEMA, session, durable_rollout, rollout, success: 0 }
    }

    #[test]
    fn an_episode_comes_back_bit_for_bit() {
        let (header, records) = episode();
        assert_eq!(decode(&encode(&header, &records)).unwrap(), (header, records[..2].to_vec()));
    }

    #[test]
    fn an_episode_torn_at_any_byte_or_changed_in_any_is_none() {
        let (header, records) = episode();
        let whole = encode(&header, &records);
        for len in 0..whole.len() {
            assert!(decode(&whole[..len]).is_err(), "cut at {len}");
            let mut changed = whole.clone();
            changed[len] ^= 0x10;
            assert!(decode(&changed).is_err(), "changed at {len}");
        }
    }

    #[test]
    fn sessions_that_never_come_back_do_not_block_another() {
        let dir = std::env::temp_dir().join(format!("skillet-full-{}", std::process::id()));
        let mut spool = Spool::open(&dir).unwrap();
        let mut put = |session: u64, n: u64| {
            let names = (0..n).map(|rollout| ((session, rollout), PolicyName::NONE));
            spool.names.extend(names);
            spool.asked_by(7);
            spool.is_full()
        };
        assert!(!put(1, 64) && !put(8, 64), "others of 64");
        assert!(!put(7, 63) && put(7, 64), "its own 64th");
        spool.acknowledged(&ack(7, 0, 0));
        assert!(!spool.is_full(), "63 again");
        (10..24).for_each(|session| {
            spool.names.extend((0..64).map(|rollout| ((session, rollout), PolicyName::NONE)));
        });
        assert!(spool.is_full(), "all together");
        drop(spool);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn what_is_acknowledged_goes_and_what_is_broken_does_not_stay() {
        let dir = std::env::temp_dir().join(format!("skillet-spool-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        let put = |session: u64, rollout: u64| {
            let (header, records) = episode();
            let header = EpisodeHeader { session, rollout, ..header };
            let path = dir.join(format!("{session:016x}-{rollout:08}.episode"));
            fs::write(path, encode(&header, &records)).unwrap();
            header.name()
        };
        let names =
            [(1, 4), (1, 5), (1, 6), (2, 5)].map(|(session, rollout)| put(session, rollout));
        fs::write(dir.join("0000000000000009-00000001.episode"), "torn").unwrap();
        let mut spool = Spool::open(&dir).unwrap();
        assert_eq!(spool.len(), 4);
        let other = PolicyName { digest: 99, ..names[0] };
        assert!(spool.find(&other).is_none(), "another policy of the same rollout");
        assert_eq!(spool.find(&names[0]).unwrap().0.rollout, 4);
        spool.acknowledged(&ack(1, 4, 6));
        assert!(spool.find(&names[0]).is_none() && spool.find(&names[2]).is_none());
        assert!(spool.find(&names[1]).is_some() && spool.find(&names[3]).is_some());
        drop(spool);
        assert_eq!(fs::read_dir(&dir).unwrap().count(), 2);
        fs::remove_dir_all(&dir).unwrap();
    }
}
