//! A node and its publishers, on a graph that is reached through a Zenoh router, or that connects here.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{Query, Queryable};
use zenoh::time::Timestamp;
use zenoh::{Session, Wait};

use super::layout::{NodeName, Topic, attachment, cache_key, gid};
use crate::net::{self, NetError};

/// Where the graph is.
#[derive(Clone, Debug)]
pub enum Graph {
    /// Behind the router at `HOST:PORT`. A router passes on what a client sends.
    Router(String),
    /// At those who connect here, at a loopback address `HOST:PORT`.
    Here(String),
}

/// A node that others see on the graph as long as it exists.
pub struct Node {
    session: Session,
    name: NodeName,
    address: String,
    n_publishers: u32,
    is_client: bool,
    _token: LivelinessToken,
}

impl Node {
    pub fn open(graph: &Graph, name: NodeName) -> Result<Node, NetError> {
        let (session, address, is_client) = match graph {
            Graph::Router(address) => (net::connect(address, None)?, address.clone(), true),
            Graph::Here(address) => {
                let (session, address) = net::listen(address, None, &[])?;
                (session, address, false)
            }
        };
        let token = name.token(&session.zid().to_string());
        let token = session.liveliness().declare_token(token).wait().map_err(failed(&address))?;
        Ok(Node { session, name, address, n_publishers: 0, is_client, _token: token })
    }

    /// Where the node is connected, or listens.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// What says later whether the router is there.
    pub fn link(&self) -> Link {
        Link { session: self.is_client.then(|| self.session.clone()) }
    }

    /// A publisher that others find.
    pub fn publisher(&mut self, topic: &Topic) -> Result<Publisher, NetError> {
        self.n_publishers += 1;
        let id = self.session.zid().to_string();
        let key = self.name.key(topic);
        let token = self.name.publisher_token(&id, self.n_publishers, topic);
        let gid = gid(&token);
        let failed = || failed(&self.address);
        let latch = topic.is_latched.then(|| Latch::declare(&self.session, &key, &id)).transpose();
        Ok(Publisher {
            latch: latch.map_err(failed())?,
            publisher: self.session.declare_publisher(key).wait().map_err(failed())?,
            session: self.session.clone(),
            gid,
            sequence: 0,
            address: self.address.clone(),
            _token: self.session.liveliness().declare_token(token).wait().map_err(failed())?,
        })
    }
}

/// The connection of a node behind a router.
pub struct Link {
    session: Option<Session>,
}

impl Link {
    /// Whether the router is there. A node that others connect to needs none.
    pub fn is_connected(&self) -> bool {
        self.session.as_ref().is_none_or(|session| {
            let info = session.info();
            info.routers_zid().wait().next().is_some() || info.peers_zid().wait().next().is_some()
        })
    }
}

/// Publishes the messages of one topic. What the network does not take at once is dropped.
pub struct Publisher {
    session: Session,
    publisher: zenoh::pubsub::Publisher<'static>,
    gid: [u8; 16],
    sequence: i64,
    address: String,
    latch: Option<Latch>,
    _token: LivelinessToken,
}

impl Publisher {
    /// Publishes a message in CDR.
    pub fn put(&mut self, message: &[u8]) -> Result<(), NetError> {
        self.sequence += 1;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let label = attachment(self.sequence, now.as_nanos() as i64, &self.gid);
        let (message, label) = (ZBytes::from(message), ZBytes::from(label));
        let stamp = self.session.new_timestamp();
        if let Some(latch) = &self.latch {
            latch.keep(Kept { message: message.clone(), label: label.clone(), stamp });
        }
        let put = self.publisher.put(message).attachment(label).timestamp(stamp).wait();
        put.map_err(failed(&self.address))
    }
}

/// The newest message of a latched topic, for those who come late.
struct Latch {
    newest: Arc<Mutex<Option<Kept>>>,
    _answers: Queryable<()>,
    _token: LivelinessToken,
}

#[derive(Clone)]
struct Kept {
    message: ZBytes,
    label: ZBytes,
    stamp: Timestamp,
}

impl Latch {
    fn declare(session: &Session, key: &str, id: &str) -> zenoh::Result<Latch> {
        let newest = Arc::new(Mutex::new(None::<Kept>));
        let (cache, topic, answered) = (cache_key(key, id), key.to_string(), newest.clone());
        let answer = move |query: Query| {
            let newest = answered.lock().unwrap_or_else(PoisonError::into_inner).clone();
            if let Some(kept) = newest {
                let reply = query.reply(&topic, kept.message).attachment(kept.label);
                // One who has left needs no answer.
                let _ = reply.timestamp(kept.stamp).wait();
            }
        };
        let answers = session.declare_queryable(&cache).callback(answer).wait()?;
        let token = session.liveliness().declare_token(cache).wait()?;
        Ok(Latch { newest, _answers: answers, _token: token })
    }

    fn keep(&self, kept: Kept) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(kept);
    }
}

fn failed(address: &str) -> impl Fn(zenoh::Error) -> NetError {
    let address = address.to_string();
    move |error| NetError::Transport { address: address.clone(), reason: error.to_string() }
}
