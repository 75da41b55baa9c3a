//! A whole MCAP file from one whose writer died: everything up to the first damage.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;

use anyhow::Result;
use mcap::read::{LinearReader, MessageStream, Options};
use mcap::records::Record;
use mcap::{Compression, WriteOptions, Writer};

/// Copies what is complete in `from` to a new file `to`; returns the number of messages.
pub fn recover(from: &Path, to: &Path) -> Result<u64> {
    let bytes = fs::read(from)?;
    let options = || Options::IgnoreEndMagic.into();
    let file = BufWriter::new(File::create_new(to)?);
    let mut writer: Writer<_> =
        WriteOptions::new().compression(Some(Compression::Zstd)).create(file)?;
    if let Ok(records) = LinearReader::new_with_options(&bytes, options()) {
        for record in records.map_while(Result::ok) {
            if let Record::Attachment { header, data, .. } = record {
                writer.attach(&mcap::Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })?;
            }
        }
    }
    let mut messages = 0;
    if let Ok(stream) = MessageStream::new_with_options(&bytes, options()) {
        for message in stream.map_while(Result::ok) {
            writer.write(&message)?;
            messages += 1;
        }
    }
    writer.finish()?;
    Ok(messages)
}
