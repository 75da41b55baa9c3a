//! Recordings (MCAP) and live views of a cell: what was seen, written to topics with schemas that
//! Foxglove, PlotJuggler, Rerun and the `mcap` tool know.

pub mod bridged;
pub mod drawing;
pub mod file;
mod loop_policy;
pub mod messages;
pub mod recorder;
mod recover;
mod schema;
pub mod scribe;
pub mod session;
pub mod solids;
mod told;
pub mod watcher;

use anyhow::Result;

use crate::config::Config;
use crate::setup;
use drawing::Drawing;
use recorder::Attachment;
use scribe::Scribe;

/// A scribe for the world that `config` describes.
pub fn scribe(config: &Config) -> Result<Scribe> {
    if !config.has_arm() {
        return Ok(Scribe::new(None));
    }
    let solids = (config.task()?.arm()?.solids)(config);
    Ok(Scribe::new(Some(Drawing::new(setup::arm(config)?, solids))))
}

/// What a recording carries beside its messages.
pub fn attachments(config: &Config) -> Result<Vec<Attachment>> {
    let mut attachments = vec![("session.toml", "application/toml", config.to_toml()?)];
    if config.has_arm() {
        attachments.push(("arm.urdf", "application/xml", setup::arm_text(config)?));
    }
    Ok(attachments)
}
