//! A ROS 2 graph as an outlet: every topic is a publisher that others find.

use anyhow::Result;
use bridge::ros2::layout;
use bridge::ros2::node::{Node, Publisher};

use super::cdr::Encoder;
use super::messages::TopicType;
use super::outlet::{Durability, Outlet, Topic};

/// One for the whole graph, whatever the namespace.
const LOGS: &str = "/rosout";

/// Publishes messages as a node.
pub struct GraphOutlet {
    node: Node,
    /// Before the names of topics; empty, or as in `/kitchen`.
    namespace: String,
    publishers: Vec<Publisher>,
    encoder: Encoder,
}

impl GraphOutlet {
    pub fn new(node: Node, namespace: &str) -> GraphOutlet {
        let (namespace, encoder) = (namespace.to_string(), Encoder::default());
        GraphOutlet { node, namespace, publishers: Vec::new(), encoder }
    }
}

impl Outlet for GraphOutlet {
    fn topic<M: TopicType>(
        &mut self,
        name: &'static str,
        durability: Durability,
    ) -> Result<Topic<M>> {
        let namespace = if name == LOGS { "" } else { &self.namespace };
        let topic = layout::Topic {
            name: &format!("{namespace}{name}"),
            type_name: &M::type_name(),
            type_hash: M::HASH,
            is_latched: durability == Durability::TransientLocal,
        };
        self.publishers.push(self.node.publisher(&topic)?);
        Ok(Topic::new(self.publishers.len() - 1))
    }

    /// The time is in the message, where its type has one.
    fn write<M: TopicType>(&mut self, topic: &Topic<M>, message: &M, _at_ns: u64) -> Result<()> {
        Ok(self.publishers[topic.index].put(self.encoder.encode(message))?)
    }
}
