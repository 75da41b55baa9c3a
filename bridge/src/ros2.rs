//! A node on a ROS 2 graph, over Zenoh and in the layout of rmw_zenoh (Jazzy and later), without ROS.
//!
//! It only publishes. It subscribes to nothing, and answers nobody except late subscribers of a latched topic.

pub mod layout;
#[cfg(feature = "network")]
pub mod node;
