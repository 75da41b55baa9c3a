//! Reads a recording of ours from its beginning to its end, in bounded memory, and converts it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use foxglove::messages::Log;
use mcap::parse_record;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use prost::Message;
use shm_types::episode::TickRecord;

use super::bag::{Bag, Contents};
use super::conversion::Conversion;
use super::robot::{Robot, Scope};
use crate::config::Config;
use crate::record::messages::{Measures, Outcome, Policy, Tick, Trial};

/// Larger records are damage: an attached URDF has some hundred kB, a chunk about one MB.
const MAX_RECORD_BYTES: usize = 64 << 20;

/// Converts the recording `path` into a bag that becomes `folder`.
pub fn convert(path: &Path, folder: &Path, force: bool) -> Result<Contents> {
    let mut reading =
        Reading { folder, force, config: None, urdf: None, topics: Vec::new(), conversion: None };
    read(path, |record| reading.take(record)).with_context(|| path.display().to_string())?;
    let conversion = reading.conversion.with_context(|| {
        format!("{}: holds nothing to convert; was anything recorded?", path.display())
    })?;
    conversion.finish()
}

/// Gives all records of a file to `each`.
fn read(path: &Path, mut each: impl FnMut(Record) -> Result<()>) -> Result<()> {
    let mut file = File::open(path).context("cannot read the recording; check the path")?;
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let damaged = "not a whole MCAP file: give a recording of `skillet record`, `skillet learn --record` or \
                   `skillet replay`";
    while let Some(event) = reader.next_event() {
        match event.context(damaged)? {
            LinearReadEvent::ReadRequest(n) => {
                let n_read = file.read(reader.insert(n)).context("cannot read on")?;
                reader.notify_read(n_read);
            }
            LinearReadEvent::Record { data, opcode } => {
                each(parse_record(opcode, data).context(damaged)?)?;
            }
        }
    }
    Ok(())
}

/// What is known so far of a recording that is being read.
struct Reading<'a> {
    folder: &'a Path,
    force: bool,
    config: Option<String>,
    urdf: Option<String>,
    /// Topics by the number of their channel.
    topics: Vec<(u16, String)>,
    conversion: Option<Conversion<Bag>>,
}

impl Reading<'_> {
    fn take(&mut self, record: Record) -> Result<()> {
        match record {
            Record::Header(header) => ensure!(
                header.profile != "ros2",
                "is a ROS 2 bag already: give the recording it was made from"
            ),
            Record::Attachment { header, data, .. } => {
                let text = String::from_utf8_lossy(&data).into_owned();
                match header.name.as_str() {
                    "session.toml" => self.config = Some(text),
                    "arm.urdf" => self.urdf = Some(text),
                    _ => {}
                }
            }
            Record::Channel(channel) => self.topics.push((channel.id, channel.topic)),
            Record::Message { header, data } => {
                let conversion = match self.conversion.take() {
                    Some(conversion) => conversion,
                    None => self.begin()?,
                };
                let conversion = self.conversion.insert(conversion);
                let topic = self.topics.iter().find(|(id, _)| *id == header.channel_id);
                let topic = topic.map_or("", |(_, topic)| topic);
                message(conversion, topic, &data, header.log_time)
                    .with_context(|| format!("{topic} at {} ns", header.log_time))?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Begins the bag, when everything that is attached has been read.
    fn begin(&mut self) -> Result<Conversion<Bag>> {
        let text = self.config.take().context(
            "no session.toml is attached: give a recording of `skillet record`, `skillet learn --record` or \
             `skillet replay`",
        )?;
        let other_version =
            "recorded by another version of skillet: convert it with that one, or record again";
        let config: Config =
            toml::from_str(&text).context("session.toml").context(other_version)?;
        let has_arm = config.task().context(other_version)?.has_arm();
        let urdf = self.urdf.take().filter(|_| has_arm);
        if has_arm && urdf.is_none() {
            bail!("no arm.urdf is attached: record again");
        }
        let robot = urdf.map(|urdf| Robot::new(&config, urdf)).transpose()?;
        Conversion::to_bag(self.folder, self.force, robot)
    }
}

/// One message of the recording; what a bag has no place for is passed over.
fn message(conversion: &mut Conversion<Bag>, topic: &str, data: &[u8], at_ns: u64) -> Result<()> {
    match topic {
        "/tick" => {
            let (record, scope) = record_of(&Tick::decode(data)?, conversion.n_joints())?;
            conversion.tick(&record, scope, at_ns)
        }
        "/policy" => conversion.policy(&Policy::decode(data)?, at_ns),
        "/outcome" => conversion.outcome(&Outcome::decode(data)?, at_ns),
        "/trial" => conversion.trial(&Trial::decode(data)?, at_ns),
        "/measures" => conversion.measures(&Measures::decode(data)?, at_ns),
        "/log" => conversion.warn(Log::decode(data)?.message, at_ns),
        _ => Ok(()),
    }
}

/// The record of a tick, as far as it was recorded: what follows from the joints is not in it.
fn record_of(tick: &Tick, n_joints: usize) -> Result<(TickRecord, Scope)> {
    let mut record = TickRecord { tick: tick.tick, phase: tick.phase, ..TickRecord::ZERO };
    for (values, into) in [
        (&tick.q_rad, &mut record.q),
        (&tick.qd_rad_s, &mut record.qd),
        (&tick.tau_n_m, &mut record.tau),
    ] {
        if values.len() != n_joints {
            bail!("{} joints, but the attached arm has {n_joints}: it is damaged", values.len());
        }
        fill(into, values);
    }
    fill(&mut record.attractor, &tick.attractor_m_rad);
    let has_object = tick.object_m.len() == 3 && tick.object_quaternion.len() == 4;
    if has_object {
        fill(&mut record.object_position, &tick.object_m);
        fill(&mut record.object_quaternion, &tick.object_quaternion);
    }
    Ok((record, Scope { n_learnt: tick.attractor_m_rad.len(), has_object }))
}

fn fill(into: &mut [f64], values: &[f32]) {
    into.iter_mut().zip(values).for_each(|(into, value)| *into = f64::from(*value));
}

#[cfg(test)]
mod tests {
    use shm_types::telemetry::TelemetryTick;

    use super::*;
    use crate::record::recorder::{Limits, Recorder};
    use crate::record::{attachments, scribe};

    /// A recording of a few ticks in `folder`.
    fn recording(folder: &Path) -> std::path::PathBuf {
        let (config, path) = (Config::default(), folder.join("c.mcap"));
        let limits = Limits { max_bytes: u64::MAX, by_rollout: false, object_always: true };
        let attachments = attachments(&config).unwrap();
        let mut recorder =
            Recorder::new(scribe(&config).unwrap(), &path, limits, attachments).unwrap();
        for at_ns in [0, 1_000_000] {
            recorder.tick(&TelemetryTick::ZERO, at_ns).unwrap();
        }
        recorder.finish().unwrap();
        path
    }

    #[test]
    fn a_damaged_recording_is_an_error_or_converted_and_never_more() {
        let folder = tempfile::TempDir::new().unwrap();
        let (path, bag) = (recording(folder.path()), folder.path().join("bag"));
        let whole = std::fs::read(&path).unwrap();
        assert_eq!(convert(&path, &bag, false).unwrap().messages["/joint_states"], 2);
        let damaged = folder.path().join("damaged.mcap");
        let mut refused = 0;
        for at in (0..whole.len()).step_by(71) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            std::fs::write(&damaged, &bytes).unwrap();
            refused += usize::from(convert(&damaged, &bag, true).is_err());
            std::fs::write(&damaged, &whole[..at]).unwrap();
            assert!(convert(&damaged, &bag, true).is_err(), "cut at {at} of {}", whole.len());
        }
        assert!(refused > 5, "only {refused}");
    }
}
