//! The standard ROS messages of bags and graphs.
//!
//! Names, fields and their order are those of the public interfaces in `common_interfaces`, `rcl_interfaces`
//! (Apache-2.0) and `geometry2` (BSD-3-Clause), the same from Humble on. tests/read_bag.py compares them, by the
//! hashes below, with an independent copy.

use nalgebra::{Isometry3, UnitQuaternion, Vector3 as Vector};

use super::cdr::{Definitions, Encoder, Message, messages};

messages! {
    Time as "builtin_interfaces/Time" { sec: i32, nanosec: u32, }
    Header as "std_msgs/Header" { stamp: Time, frame_id: String, }
    Text as "std_msgs/String" { data: String, }
    Vector3 as "geometry_msgs/Vector3" { x: f64, y: f64, z: f64, }
    Point as "geometry_msgs/Point" { x: f64, y: f64, z: f64, }
    Quaternion as "geometry_msgs/Quaternion" { x: f64, y: f64, z: f64, w: f64, }
    Pose as "geometry_msgs/Pose" { position: Point, orientation: Quaternion, }
    PoseStamped as "geometry_msgs/PoseStamped" { header: Header, pose: Pose, }
    Transform as "geometry_msgs/Transform" { translation: Vector3, rotation: Quaternion, }
    TransformStamped as "geometry_msgs/TransformStamped" {
        header: Header,
        child_frame_id: String,
        transform: Transform,
    }
    TfMessage as "tf2_msgs/TFMessage" { transforms: Vec<TransformStamped>, }
    Wrench as "geometry_msgs/Wrench" { force: Vector3, torque: Vector3, }
    WrenchStamped as "geometry_msgs/WrenchStamped" { header: Header, wrench: Wrench, }
    /// Positions in rad, velocities in rad/s, efforts in N·m, one a name.
    JointState as "sensor_msgs/JointState" {
        header: Header,
        name: Vec<String>,
        position: Vec<f64>,
        velocity: Vec<f64>,
        effort: Vec<f64>,
    }
    Log as "rcl_interfaces/Log" {
        stamp: Time,
        level: u8,
        name: String,
        msg: String,
        file: String,
        function: String,
        line: u32,
    }
}

/// `Log.level` of a warning.
pub const WARN: u8 = 30;

/// A message that a topic may carry.
pub trait TopicType: Message {
    /// RIHS01, the hash of the type's description, with which ROS recognises the type.
    const HASH: &str;

    /// As in `sensor_msgs/msg/JointState`.
    fn type_name() -> String {
        Self::name().replace('/', "/msg/")
    }
}

macro_rules! hashes {
    ($($name:ident: $hash:literal,)*) => {
        $(impl TopicType for $name { const HASH: &str = concat!("RIHS01_", $hash); })*
    };
}
hashes! {
    Text: "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    PoseStamped: "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    TfMessage: "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    WrenchStamped: "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    JointState: "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    Log: "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
}

impl Time {
    /// The time `at_ns` since the epoch. Seconds of ROS end in 2038.
    pub fn of_ns(at_ns: u64) -> Time {
        const SECOND: u64 = 1_000_000_000;
        Time { sec: (at_ns / SECOND) as i32, nanosec: (at_ns % SECOND) as u32 }
    }
}

impl Header {
    pub fn new(at_ns: u64, frame: &str) -> Header {
        Header { stamp: Time::of_ns(at_ns), frame_id: frame.into() }
    }
}

impl From<&Vector<f64>> for Vector3 {
    fn from(v: &Vector<f64>) -> Vector3 {
        Vector3 { x: v.x, y: v.y, z: v.z }
    }
}

impl From<&UnitQuaternion<f64>> for Quaternion {
    fn from(q: &UnitQuaternion<f64>) -> Quaternion {
        Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
    }
}

impl From<&Isometry3<f64>> for Pose {
    fn from(pose: &Isometry3<f64>) -> Pose {
        let p = &pose.translation;
        let position = Point { x: p.x, y: p.y, z: p.z };
        Pose { position, orientation: (&pose.rotation).into() }
    }
}

impl TransformStamped {
    /// The pose of frame `child` in frame `parent`.
    pub fn new(at_ns: u64, parent: &str, child: &str, pose: &Isometry3<f64>) -> TransformStamped {
        TransformStamped {
            header: Header::new(at_ns, parent),
            child_frame_id: child.into(),
            transform: Transform {
                translation: (&pose.translation.vector).into(),
                rotation: (&pose.rotation).into(),
            },
        }
    }
}
