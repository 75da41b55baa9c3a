//! ROS 2: what Skillet records and what a cell does, as standard ROS messages, in bags that `ros2 bag` plays and, with
//! the feature `bridge`, live on a graph.
//!
//! A bag is a folder of its own. rosbag2 refuses an MCAP file with one channel that is not CDR, so a recording
//! cannot be a bag as well; see docs/recordings.md.

pub mod bag;
mod cdr;
pub mod conversion;
#[cfg(feature = "bridge")]
mod graph;
#[cfg(feature = "bridge")]
pub mod live;
mod messages;
mod metadata;
mod outlet;
#[cfg(feature = "bridge")]
mod pace;
pub mod recording;
pub mod robot;
