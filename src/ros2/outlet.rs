//! Where ROS messages go: into a bag, or, with the feature `bridge`, onto a graph.

use std::marker::PhantomData;

use anyhow::Result;

use super::messages::TopicType;

/// How long the last messages of a topic stay available.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Durability {
    Volatile,
    /// The last message also reaches subscribers that come later.
    TransientLocal,
}

/// A topic of an outlet, which carries messages of type `M`.
pub struct Topic<M> {
    pub(super) index: usize,
    message: PhantomData<M>,
}

impl<M: TopicType> Topic<M> {
    pub(super) fn new(index: usize) -> Topic<M> {
        Topic { index, message: PhantomData }
    }
}

/// Takes messages by topic.
pub trait Outlet {
    fn topic<M: TopicType>(
        &mut self,
        name: &'static str,
        durability: Durability,
    ) -> Result<Topic<M>>;

    /// Takes a message of the time `at_ns` since the epoch.
    fn write<M: TopicType>(&mut self, topic: &Topic<M>, message: &M, at_ns: u64) -> Result<()>;
}
