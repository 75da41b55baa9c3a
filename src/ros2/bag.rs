//! A bag in the making: the folder `NAME` with `metadata.yaml` and `NAME_0.mcap`, all of it CDR.
//!
//! It is written as `.NAME.new` and gets its name when it is whole.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};

use super::cdr::{Encoder, definition};
use super::messages::TopicType;
use super::metadata::{BagInfo, TopicInfo, qos_profiles};
use super::outlet::{Durability, Outlet, Topic};

const METADATA: &str = "metadata.yaml";

/// What a finished bag holds.
pub struct Contents {
    pub folder: PathBuf,
    pub duration_ns: u64,
    /// Numbers of messages by topic.
    pub messages: BTreeMap<&'static str, u64>,
    pub bytes: u64,
}

/// See the head of the file.
pub struct Bag {
    folder: PathBuf,
    draft: PathBuf,
    file: String,
    writer: Writer<BufWriter<File>>,
    topics: Vec<TopicInfo>,
    /// The channel of each topic.
    channels: Vec<u16>,
    /// Times of the first and the last message.
    times: Option<(u64, u64)>,
    encoder: Encoder,
}

impl Bag {
    /// Begins a bag that becomes `folder`. With `force` it replaces another bag there, when it is finished.
    pub fn create(folder: &Path, force: bool) -> Result<Bag> {
        let name = folder.file_name().with_context(|| {
            format!("{}: not a name for a folder; choose another --out", folder.display())
        })?;
        if folder.exists() {
            expect_replaceable(folder, force)?;
        }
        let name = name.to_string_lossy();
        let (draft, file) =
            (folder.with_file_name(format!(".{name}.new")), format!("{name}_0.mcap"));
        let cannot = || format!("{}: cannot write there; check --out", draft.display());
        remove(&draft).and_then(|()| fs::create_dir_all(&draft)).with_context(cannot)?;
        let target = BufWriter::new(File::create(draft.join(&file)).with_context(cannot)?);
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("skillet ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_threads(0);
        let writer = options.create(target).with_context(cannot)?;
        let folder = folder.to_path_buf();
        let (topics, channels) = (Vec::new(), Vec::new());
        let (times, encoder) = (None, Encoder::default());
        Ok(Bag { folder, draft, file, writer, topics, channels, times, encoder })
    }

    /// Completes the bag and gives it its name.
    pub fn finish(mut self) -> Result<Contents> {
        let cannot = format!("{}: cannot finish the bag", self.folder.display());
        self.writer.finish().with_context(|| cannot.clone())?;
        let (start_ns, end_ns) = self.times.unwrap_or_default();
        let duration_ns = end_ns - start_ns;
        let info = BagInfo { file: &self.file, start_ns, duration_ns, topics: &self.topics };
        let bytes = fs::write(self.draft.join(METADATA), info.to_yaml())
            .and_then(|()| fs::metadata(self.draft.join(&self.file)))
            .with_context(|| cannot.clone())?
            .len();
        remove(&self.folder)
            .and_then(|()| fs::rename(&self.draft, &self.folder))
            .context(cannot)?;
        let messages = self.topics.iter().map(|topic| (topic.name, topic.n_messages)).collect();
        Ok(Contents { folder: self.folder.clone(), duration_ns, messages, bytes })
    }
}

impl Outlet for Bag {
    fn topic<M: TopicType>(
        &mut self,
        name: &'static str,
        durability: Durability,
    ) -> Result<Topic<M>> {
        let type_name = M::type_name();
        let definition = definition::<M>();
        let schema = self.writer.add_schema(&type_name, "ros2msg", definition.as_bytes())?;
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_string(), qos_profiles(durability, 0)),
            ("topic_type_hash".to_string(), M::HASH.to_string()),
        ]);
        let channel = self.writer.add_channel(schema, name, "cdr", &metadata)?;
        let topic = Topic::new(self.topics.len());
        self.channels.push(channel);
        let type_hash = M::HASH;
        self.topics.push(TopicInfo { name, type_name, type_hash, durability, n_messages: 0 });
        Ok(topic)
    }

    fn write<M: TopicType>(&mut self, topic: &Topic<M>, message: &M, at_ns: u64) -> Result<()> {
        let header = MessageHeader {
            channel_id: self.channels[topic.index],
            sequence: 0,
            log_time: at_ns,
            publish_time: at_ns,
        };
        let bytes = self.encoder.encode(message);
        self.writer.write_to_known_channel(&header, bytes).with_context(|| {
            format!("{}: cannot write the bag; check the free space", self.draft.display())
        })?;
        self.topics[topic.index].n_messages += 1;
        let (first, last) = self.times.unwrap_or((at_ns, at_ns));
        self.times = Some((first.min(at_ns), last.max(at_ns)));
        Ok(())
    }
}

impl Drop for Bag {
    /// Leaves nothing behind when the conversion has failed.
    fn drop(&mut self) {
        let _ = remove(&self.draft);
    }
}

/// Only a bag or an empty folder is replaced, and only when that is asked for.
fn expect_replaceable(folder: &Path, force: bool) -> Result<()> {
    let name = folder.display();
    if !force {
        bail!("{name}: already exists; choose another --out, or --force to replace a bag");
    }
    let is_empty = || fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    if !folder.join(METADATA).is_file() && !is_empty() {
        bail!("{name}: is not a bag and is not replaced; choose another --out");
    }
    Ok(())
}

fn remove(folder: &Path) -> std::io::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}
