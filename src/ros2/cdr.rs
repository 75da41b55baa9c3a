//! CDR, the encoding of ROS 2 messages, and the definitions that readers of a bag decode it with.
//!
//! Little-endian XCDR version 1, as every ROS 2 middleware writes it: numbers are aligned to their size,
//! counted from the end of the header; strings end with a zero byte that counts; sequences begin with their
//! length.

/// The representation: CDR, little-endian, no options.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Encodes one message after the other into the same memory.
#[derive(Default)]
pub struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    /// The encoding of `message`, header included.
    pub fn encode(&mut self, message: &impl Message) -> &[u8] {
        self.bytes.clear();
        self.bytes.extend(HEADER);
        message.write(self);
        &self.bytes
    }

    /// Appends a number of `N` bytes at a multiple of `N`.
    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        let written = self.bytes.len() - HEADER.len();
        self.bytes.resize(HEADER.len() + written.next_multiple_of(N), 0);
        self.bytes.extend(bytes);
    }

    /// Lengths are 32 bits wide; nothing that is written here comes near 4 GB.
    fn length(&mut self, n: usize) {
        self.number((n as u32).to_le_bytes());
    }
}

/// Definitions of types by name, in the order in which they were first used.
#[derive(Default)]
pub struct Definitions(Vec<(&'static str, String)>);

impl Definitions {
    /// Adds a type; false if it is there already.
    pub fn add(&mut self, name: &'static str, fields: String) -> bool {
        let is_new = self.0.iter().all(|(known, _)| *known != name);
        if is_new {
            self.0.push((name, fields));
        }
        is_new
    }
}

/// A type of ROS interfaces.
pub trait Message {
    /// Name in a definition, `std_msgs/Header` or `float64`.
    fn name() -> String;

    /// Adds the definition of the type and those of its fields; the built-in types have none.
    fn define(_definitions: &mut Definitions) {}

    fn write(&self, to: &mut Encoder);
}

/// The definition of `M` with those of all types in it, in rosbag2's form (`ros2msg`).
pub fn definition<M: Message>() -> String {
    let mut definitions = Definitions::default();
    M::define(&mut definitions);
    let rule = "=".repeat(80);
    let part = |(i, (name, fields)): (usize, (&str, String))| match i {
        0 => fields,
        _ => format!("{rule}\nMSG: {name}\n{fields}"),
    };
    definitions.0.into_iter().enumerate().map(part).collect()
}

/// Declares a message once: the struct, its encoding and its definition.
macro_rules! messages {
    ($( $(#[$meta:meta])* $name:ident as $ros:literal { $($field:ident: $type:ty,)* } )*) => {$(
        $(#[$meta])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name { $(pub $field: $type,)* }

        impl Message for $name {
            fn name() -> String {
                $ros.into()
            }

            fn define(definitions: &mut Definitions) {
                let fields = [$(format!("{} {}\n", <$type>::name(), stringify!($field))),*];
                if definitions.add($ros, fields.concat()) {
                    $(<$type>::define(definitions);)*
                }
            }

            fn write(&self, to: &mut Encoder) {
                $(self.$field.write(to);)*
            }
        }
    )*};
}
pub(super) use messages;

macro_rules! numbers {
    ($($type:ident is $ros:literal),*) => {$(
        impl Message for $type {
            fn name() -> String {
                $ros.into()
            }

            fn write(&self, to: &mut Encoder) {
                to.number(self.to_le_bytes());
            }
        }
    )*};
}
numbers! { u8 is "uint8", i32 is "int32", u32 is "uint32", f64 is "float64" }

impl Message for String {
    fn name() -> String {
        "string".into()
    }

    fn write(&self, to: &mut Encoder) {
        to.length(self.len() + 1);
        to.bytes.extend(self.as_bytes());
        to.bytes.push(0);
    }
}

impl<T: Message> Message for Vec<T> {
    fn name() -> String {
        format!("{}[]", T::name())
    }

    fn define(definitions: &mut Definitions) {
        T::define(definitions);
    }

    fn write(&self, to: &mut Encoder) {
        to.length(self.len());
        self.iter().for_each(|item| item.write(to));
    }
}

#[cfg(test)]
mod tests {
    use super::super::messages::{
        Header, JointState, Log, Quaternion, Text, TfMessage, Time, Transform, TransformStamped,
        Vector3, WARN,
    };
    use super::*;

    fn encoded(message: &impl Message) -> String {
        let bytes = Encoder::default().encode(message).to_vec();
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    fn stamp() -> Time {
        Time { sec: -1, nanosec: 5 }
    }

    fn header() -> Header {
        Header { stamp: stamp(), frame_id: "ab".into() }
    }

    /// The bytes are those of rosbags 0.11.9, an encoder of its own: strings of every length, an empty sequence before
    /// a full one, a byte before a string, structs in a sequence.
    #[test]
    fn messages_are_aligned_as_other_encoders_do_it() {
        let joints = JointState {
            header: header(),
            name: ["a", "", "bcd"].map(String::from).into(),
            position: vec![1.5],
            velocity: vec![],
            effort: vec![-2.0, 0.25],
        };
        assert_eq!(
            encoded(&joints),
            "00010000ffffffff050000000300000061620000030000000200000061000000010000000000000004000000\
             6263640001000000000000000000f83f000000000200000000000000000000c0000000000000d03f"
        );
        let (name, msg) = ("n".into(), "grüß".into());
        let log = Log { stamp: stamp(), level: WARN, name, msg, line: 7, ..Log::default() };
        assert_eq!(
            encoded(&log),
            "00010000ffffffff050000001e000000020000006e000000070000006772c3bcc39f00000100000000000000\
             010000000000000007000000"
        );
        let transform = TransformStamped {
            header: header(),
            child_frame_id: "pan".into(),
            transform: Transform {
                translation: Vector3 { x: 1.0, y: 2.0, z: 3.0 },
                rotation: Quaternion { w: 1.0, ..Quaternion::default() },
            },
        };
        let one = "ffffffff0500000003000000616200000400000070616e00";
        let pose = "000000000000f03f000000000000004000000000000008400000000000000000000000000000000000000000\
                    00000000000000000000f03f";
        assert_eq!(
            encoded(&TfMessage { transforms: vec![transform.clone(), transform] }),
            // Only the first pose needs padding.
            format!("0001000002000000{one}00000000{pose}{one}{pose}")
        );
        assert_eq!(encoded(&Text::default()), "000100000100000000");
    }

    #[test]
    fn definitions_hold_every_type_once() {
        let rule = "=".repeat(80);
        assert_eq!(
            definition::<JointState>(),
            format!(
                "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
                 float64[] effort\n{rule}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n\
                 string frame_id\n{rule}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
            )
        );
        let transforms = definition::<TfMessage>();
        assert_eq!(transforms.matches("MSG: geometry_msgs/Vector3").count(), 1, "{transforms}");
        assert_eq!(transforms.matches("MSG: ").count(), 6, "{transforms}");
    }
}
