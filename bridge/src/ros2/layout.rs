//! What rmw_zenoh calls things on the wire, from its docs/design.md.
//!
//! ```text
//! messages    <domain>/<topic>/<type>/<hash>
//! a node      @ros2_lv/<domain>/<session>/<node>/<node>/NN/<enclave>/<namespace>/<name>
//! a publisher @ros2_lv/<domain>/<session>/<node>/<id>/MP/<enclave>/<namespace>/<name>/<topic>/<type>/<hash>/<qos>
//! attachment  sequence number (i64), time (i64, ns), 16 (u8), gid (16 bytes); little-endian
//! ```
//!
//! In tokens `%` stands for every `/`; an empty enclave or namespace is `%`.

/// Where the tokens of nodes and publishers are.
const TOKENS: &str = "@ros2_lv";
/// The only node of its session.
const NODE_ID: u32 = 0;
const NO_ENCLAVE: &str = "%";

/// A node: its domain, its namespace (empty, or as in `/kitchen`) and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeName {
    pub domain: u32,
    pub namespace: String,
    pub name: String,
}

/// A topic that a node publishes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Topic<'a> {
    /// With its namespace, as in `/kitchen/joint_states`.
    pub name: &'a str,
    /// As in `sensor_msgs/msg/JointState`.
    pub type_name: &'a str,
    /// As in `RIHS01_a13e…`.
    pub type_hash: &'a str,
    /// The newest message reaches late subscribers, too (`transient_local`).
    pub is_latched: bool,
}

impl NodeName {
    /// The token of the node itself.
    pub fn token(&self, session: &str) -> String {
        format!("{}/{}", self.stem(session, NODE_ID, "NN"), self.name)
    }

    /// The token of the node's publisher number `id`.
    pub fn publisher_token(&self, session: &str, id: u32, topic: &Topic) -> String {
        let (stem, node) = (self.stem(session, id, "MP"), &self.name);
        let (name, of_type) = (mangled(topic.name), dds_type(topic.type_name));
        format!("{stem}/{node}/{name}/{of_type}/{}/{}", topic.type_hash, topic.qos())
    }

    fn stem(&self, session: &str, id: u32, kind: &str) -> String {
        let namespace = if self.namespace.is_empty() { "/" } else { &self.namespace };
        let (domain, namespace) = (self.domain, mangled(namespace));
        format!("{TOKENS}/{domain}/{session}/{NODE_ID}/{id}/{kind}/{NO_ENCLAVE}/{namespace}")
    }

    /// The key of a topic's messages.
    pub fn key(&self, topic: &Topic) -> String {
        let (domain, name) = (self.domain, topic.name.trim_matches('/'));
        format!("{domain}/{name}/{}/{}", dds_type(topic.type_name), topic.type_hash)
    }
}

impl Topic<'_> {
    /// Reliable, the last ten messages, or the last one of a latched topic; what is empty has rmw_zenoh's default.
    fn qos(&self) -> &'static str {
        if self.is_latched { ":1:,1:,:,:,," } else { "::,10:,:,:,," }
    }
}

/// Where zenoh-ext's advanced subscribers, which ROS subscriptions are, look for the newest message of a latched topic.
/// The order of its messages is that of their time stamps (`uhlc`).
pub fn cache_key(key: &str, session: &str) -> String {
    format!("{key}/@adv/pub/{session}/uhlc/_")
}

/// What comes with every message.
pub fn attachment(sequence: i64, at_ns: i64, gid: &[u8; 16]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(33);
    bytes.extend(sequence.to_le_bytes());
    bytes.extend(at_ns.to_le_bytes());
    bytes.push(gid.len() as u8);
    bytes.extend(gid);
    bytes
}

/// What names a publisher in its messages: XXH3 of its token, low half first.
#[cfg(feature = "network")]
pub fn gid(token: &str) -> [u8; 16] {
    xxhash_rust::xxh3::xxh3_128(token.as_bytes()).to_le_bytes()
}

/// Whether ROS takes `name` as a namespace: parts of letters, digits and `_`, none of which begins with a digit.
pub fn is_namespace(name: &str) -> bool {
    let is_part = |part: &str| {
        let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
        part.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && part.chars().all(is_letter)
    };
    name.strip_prefix('/').is_some_and(|parts| parts.split('/').all(is_part))
}

fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

/// `sensor_msgs/msg/JointState` as DDS names it.
fn dds_type(ros: &str) -> String {
    match ros.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => ros.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";
    const SESSION: &str = "8b20917502ee955ac4476e0266340d5c";

    fn chatter() -> Topic<'static> {
        let (name, type_name) = ("/chatter", "std_msgs/msg/String");
        Topic { name, type_name, type_hash: HASH, is_latched: false }
    }

    fn talker(namespace: &str) -> NodeName {
        NodeName { domain: 2, namespace: namespace.into(), name: "talker".into() }
    }

    /// The examples of docs/design.md.
    #[test]
    fn keys_and_tokens_are_those_of_the_specification() {
        let node = talker("");
        assert_eq!(node.token(SESSION), format!("@ros2_lv/2/{SESSION}/0/0/NN/%/%/talker"));
        assert_eq!(
            node.publisher_token(SESSION, 10, &chatter()),
            format!(
                "@ros2_lv/2/{SESSION}/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
            )
        );
        assert_eq!(node.key(&chatter()), format!("2/chatter/std_msgs::msg::dds_::String_/{HASH}"));
        let named = Topic { name: "/robot1/chatter", is_latched: true, ..chatter() };
        assert_eq!(
            talker("/robot1").key(&named),
            format!("2/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}")
        );
        let token = talker("/robot1").publisher_token(SESSION, 1, &named);
        assert!(token.contains("/1/MP/%/%robot1/talker/%robot1%chatter/"), "{token}");
        assert!(token.ends_with("/:1:,1:,:,:,,"), "{token}");
    }

    #[test]
    fn an_attachment_has_33_bytes() {
        let gid = [7; 16];
        let bytes = attachment(1, -2, &gid);
        assert_eq!(bytes.len(), 33);
        assert_eq!(bytes[..9], [1, 0, 0, 0, 0, 0, 0, 0, 0xfe]);
        assert_eq!((bytes[16], &bytes[17..]), (16, &gid[..]));
    }

    /// Values of Python's xxhash.
    #[cfg(feature = "network")]
    #[test]
    fn a_gid_is_the_hash_of_the_token() {
        let hex = |token: &str| gid(token).map(|byte| format!("{byte:02x}")).concat();
        assert_eq!(hex("@ros2_lv"), "35ad47f874b73898a98a992f2f655f1c");
        let token = talker("").publisher_token(SESSION, 10, &chatter()).replace(",10:", ",7:");
        assert_eq!(hex(&token), "ac170f31eadcd9ff0cd86d7a17907d1c");
    }

    #[test]
    fn namespaces_are_those_of_ros() {
        for good in ["/kitchen", "/line_2/arm1", "/_x"] {
            assert!(is_namespace(good), "{good}");
        }
        for bad in ["", "/", "kitchen", "/a//b", "/a/", "/2nd", "/a-b", "/a b", "/ä"] {
            assert!(!is_namespace(bad), "{bad}");
        }
    }
}
