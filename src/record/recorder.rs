//! Records all channels of a running cell at full rate into files of bounded size.

use std::path::{Path, PathBuf};

use anyhow::Result;
use shm_types::telemetry::TelemetryTick;

use super::bridged::Bridged;
use super::file::{RecordingFile, free};
use super::messages::{Measures, Mixture, Trial};
use super::scribe::{Detail, Scribe};
use super::watcher::Seen;

/// Name of the metadata of a recording through a bridge.
const BRIDGE: &str = "skillet-bridge";
/// Frames every so many ticks, 33 Hz at 1 kHz; stiffness and attractor as a drawing less often.
const FRAMES_EVERY: u64 = 30;
const SPRINGS_EVERY: u64 = 60;
const APPROACH: u32 = 1;

/// Name, media type and text of what is attached to every file: configuration and arm.
pub type Attachment = (&'static str, &'static str, String);

/// Where recordings go, and how large they may become.
pub struct Limits {
    pub max_bytes: u64,
    /// A new file for every rollout.
    pub by_rollout: bool,
    /// The pancake in every tick, not only where frames are drawn: a sixth more.
    pub object_always: bool,
}

pub struct Recorder {
    scribe: Scribe,
    file: RecordingFile,
    /// Name of the first file; the following ones are numbered.
    path: PathBuf,
    limits: Limits,
    attachments: Vec<Attachment>,
    finished: Vec<PathBuf>,
    last_phase: u32,
    /// Told before the first tick, whose time it gets; `None` from then on.
    early: Option<Vec<Seen>>,
    /// The ticks come through a bridge.
    bridged: Option<Bridged>,
    /// The bodies are in this file.
    is_drawn: bool,
    bytes_before: u64,
}

impl Recorder {
    pub fn new(
        scribe: Scribe,
        path: &Path,
        limits: Limits,
        attachments: Vec<Attachment>,
    ) -> Result<Recorder> {
        let file = begin(&scribe, &free(path), &attachments)?;
        Ok(Recorder {
            scribe,
            file,
            path: path.to_path_buf(),
            limits,
            attachments,
            finished: Vec::new(),
            last_phase: 0,
            early: Some(Vec::new()),
            bridged: None,
            is_drawn: false,
            bytes_before: 0,
        })
    }

    /// Writes what was received.
    pub fn write(&mut self, seen: Seen) -> Result<()> {
        if let Seen::Bridged(bridged) = &seen {
            self.file.describe(BRIDGE, bridged.metadata())?;
            self.bridged = Some(bridged.clone());
        }
        match (&mut self.early, seen) {
            (_, Seen::Tick(tick, at_ns)) => return self.tick(&tick, at_ns),
            (Some(early), seen) => early.push(seen),
            (None, seen) => self.tell(&seen),
        }
        Ok(())
    }

    fn tell(&mut self, seen: &Seen) {
        match seen {
            Seen::Policy(policy) => self.scribe.policy(policy),
            Seen::Outcome(header) => self.scribe.outcome(header),
            Seen::Tick(..) => {} // has a time of its own
            Seen::Trial(news) => {
                self.scribe.trial(&Trial::from(&**news));
                if let Some(mixture) = Mixture::of_news(news) {
                    self.scribe.mixture(&mixture);
                }
            }
            Seen::Measures(news) => self.scribe.measures(&Measures::from(&**news)),
            Seen::Bridged(bridged) => self.scribe.warn(bridged.sentence()),
            Seen::Lost(ticks) => self.scribe.warn(format!("{ticks} ticks were not seen")),
            Seen::ControllerGone => self.scribe.warn("the controller is gone".into()),
            Seen::ControllerBack => self.scribe.warn("the controller is back".into()),
        }
    }

    fn tell_early(&mut self) {
        self.early.take().into_iter().flatten().for_each(|seen| self.tell(&seen));
    }

    pub fn tick(&mut self, tick: &TelemetryTick, at_ns: u64) -> Result<()> {
        let phase = tick.record.phase;
        let begins = phase == APPROACH && self.last_phase != APPROACH;
        self.last_phase = phase;
        if begins {
            self.begin_rollout()?;
        } else if self.file.bytes() >= self.limits.max_bytes {
            self.next_file()?;
        }
        if !self.is_drawn {
            self.scribe.set_now(at_ns);
            self.tell_early();
            if !self.finished.is_empty() {
                self.scribe.policies_again();
                self.bridged.iter().for_each(|bridged| self.scribe.warn(bridged.sentence()));
            }
            self.scribe.bodies();
            self.is_drawn = true;
        }
        // What comes through a bridge is rare already, and has no numbers of its own choice.
        let every = |ticks| self.bridged.is_some() || tick.record.tick.is_multiple_of(ticks);
        let frames = every(FRAMES_EVERY);
        let object = frames || self.limits.object_always;
        let detail = Detail { object, frames, springs: every(SPRINGS_EVERY) };
        self.scribe.tick(tick, at_ns, detail);
        Ok(())
    }

    /// A new file for it, where that is asked for.
    pub fn begin_rollout(&mut self) -> Result<()> {
        if self.limits.by_rollout && self.is_drawn {
            self.next_file()?;
        }
        Ok(())
    }

    pub fn scribe(&mut self) -> &mut Scribe {
        &mut self.scribe
    }

    /// Bytes written so far, in all files.
    pub fn bytes(&self) -> u64 {
        self.bytes_before + self.file.bytes()
    }

    /// What is complete reaches the disk, once a second.
    pub fn keep(&mut self) -> Result<()> {
        self.file.keep()
    }

    fn next_file(&mut self) -> Result<()> {
        self.bytes_before += self.file.bytes();
        let next = begin(&self.scribe, &free(&self.path), &self.attachments)?;
        let full = std::mem::replace(&mut self.file, next);
        self.finished.push(full.finish()?);
        self.is_drawn = false;
        if let Some(bridged) = &self.bridged {
            self.file.describe(BRIDGE, bridged.metadata())?;
        }
        Ok(())
    }

    /// Completes the last file; returns all.
    pub fn finish(mut self) -> Result<Vec<PathBuf>> {
        self.tell_early();
        self.finished.push(self.file.finish()?);
        Ok(self.finished)
    }
}

fn begin(scribe: &Scribe, path: &Path, attachments: &[Attachment]) -> Result<RecordingFile> {
    let file = RecordingFile::create(path, scribe.context())?;
    for (name, media_type, text) in attachments {
        file.attach(name, media_type, text)?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    /// Its frames too: no tick of it is one of every 30.
    #[test]
    fn a_recording_through_a_bridge_says_so_in_every_file() {
        let directory = tempfile::TempDir::new().unwrap();
        let scribe = crate::record::scribe(&Config::default()).unwrap();
        let limits = Limits { max_bytes: 1_000_000, by_rollout: true, object_always: false };
        let path = directory.path().join("c.mcap");
        let mut recorder = Recorder::new(scribe, &path, limits, Vec::new()).unwrap();
        recorder.write(Seen::Bridged(Bridged { host: "arm-1".into(), hz: 50 })).unwrap();
        for (number, phase) in [(19, 0), (39, APPROACH)] {
            let mut tick = Box::new(TelemetryTick::ZERO);
            (tick.record.tick, tick.record.phase) = (number, phase);
            recorder.write(Seen::Tick(tick, number * 1_000_000)).unwrap();
        }
        let files = recorder.finish().unwrap();
        assert_eq!(files.len(), 2);
        for file in files {
            let bytes = std::fs::read(&file).unwrap();
            let told: Vec<String> = mcap::MessageStream::new(&bytes)
                .unwrap()
                .map(|message| message.unwrap().channel.topic.clone())
                .collect();
            assert!(told.iter().any(|topic| topic == "/tf"), "{told:?}");
            assert!(told.iter().any(|topic| topic == "/log"), "{told:?}");
            let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
            let [metadata] = &summary.metadata_indexes[..] else { panic!("{file:?}") };
            let metadata = mcap::read::metadata(&bytes, metadata).unwrap();
            assert_eq!((&*metadata.name, &*metadata.metadata["via"]), (BRIDGE, "arm-1"));
            assert_eq!(metadata.metadata["telemetry_hz"], "50");
        }
    }

    #[test]
    fn what_is_told_before_the_first_tick_gets_its_time() {
        let directory = tempfile::TempDir::new().unwrap();
        let mut scribe = crate::record::scribe(&Config::default()).unwrap();
        scribe.set_now(5_000_000_000);
        let limits = Limits { max_bytes: 1_000_000, by_rollout: false, object_always: false };
        let path = directory.path().join("c.mcap");
        let mut recorder = Recorder::new(scribe, &path, limits, Vec::new()).unwrap();
        recorder.write(Seen::Lost(3)).unwrap();
        let first = Seen::Tick(Box::new(TelemetryTick::ZERO), 4_990_000_000);
        recorder.write(first).unwrap();
        recorder.write(Seen::Lost(4)).unwrap();
        recorder.finish().unwrap();

        let bytes = std::fs::read(&path).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let told: Vec<_> = messages.map(|m| (m.channel.topic.clone(), m.log_time)).collect();
        assert!(told.iter().all(|(_, at_ns)| *at_ns == 4_990_000_000), "{told:?}");
        assert_eq!(told[0].0, "/log");
        assert_eq!(told.iter().filter(|(topic, _)| topic == "/log").count(), 2);
    }
}
