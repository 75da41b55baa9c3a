//! ROS 2 bags: what a recording or a rollout holds, as standard ROS messages that `ros2 bag` plays.
//!
//! A bag is a folder of its own. rosbag2 refuses an MCAP file with one channel that is not CDR, so a recording
//! cannot be a bag as well; see docs/recordings.md.

pub mod bag;
mod cdr;
pub mod conversion;
mod messages;
mod metadata;
pub mod recording;
pub mod robot;
