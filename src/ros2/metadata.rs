//! `metadata.yaml` of a bag, in version 9 of rosbag2 (ROS 2 Jazzy and later).

use serde_json::json;

use super::outlet::Durability;

/// What a bag tells of a topic.
pub struct TopicInfo {
    pub name: &'static str,
    /// `sensor_msgs/msg/JointState`.
    pub type_name: String,
    pub type_hash: &'static str,
    pub durability: Durability,
    pub n_messages: u64,
}

/// What a bag tells of its file.
pub struct BagInfo<'a> {
    pub file: &'a str,
    pub start_ns: u64,
    pub duration_ns: u64,
    pub topics: &'a [TopicInfo],
}

impl BagInfo<'_> {
    pub fn n_messages(&self) -> u64 {
        self.topics.iter().map(|topic| topic.n_messages).sum()
    }

    /// The text of the file.
    pub fn to_yaml(&self) -> String {
        let BagInfo { file, start_ns, duration_ns, topics } = self;
        let n_messages = self.n_messages();
        // A JSON string is a YAML string.
        let file = json!(file);
        let topics: String = topics.iter().map(topic).collect();
        format!(
            "rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  duration:
    nanoseconds: {duration_ns}
  starting_time:
    nanoseconds_since_epoch: {start_ns}
  message_count: {n_messages}
  topics_with_message_count:
{topics}  compression_format: \"\"
  compression_mode: \"\"
  relative_file_paths:
    - {file}
  files:
    - path: {file}
      starting_time:
        nanoseconds_since_epoch: {start_ns}
      duration:
        nanoseconds: {duration_ns}
      message_count: {n_messages}
  custom_data: ~
  ros_distro: \"\"
"
        )
    }
}

fn topic(topic: &TopicInfo) -> String {
    let TopicInfo { name, type_name, type_hash, durability, n_messages } = topic;
    format!(
        "    - topic_metadata:
        name: {name}
        type: {type_name}
        serialization_format: cdr
        offered_qos_profiles:
{}        type_description_hash: {type_hash}
      message_count: {n_messages}
",
        qos_profiles(*durability, 10)
    )
}

/// The quality of service with which a topic is played, as a YAML sequence `indent` columns to the right.
pub fn qos_profiles(durability: Durability, indent: usize) -> String {
    let (durability, depth) = match durability {
        Durability::Volatile => ("volatile", 10),
        Durability::TransientLocal => ("transient_local", 1),
    };
    // No limit, as ROS writes it.
    let unlimited = "{sec: 9223372036, nsec: 854775807}";
    let profile = format!(
        "- history: keep_last
  depth: {depth}
  reliability: reliable
  durability: {durability}
  deadline: {unlimited}
  lifespan: {unlimited}
  liveliness: automatic
  liveliness_lease_duration: {unlimited}
  avoid_ros_namespace_conventions: false
"
    );
    profile.lines().map(|line| format!("{:indent$}{line}\n", "")).collect()
}
