//! Bytes to a peer and back through channels of a cell: what the transport alone costs.
//!
//! No part of the contract: no service of a working cell is touched. Messages are copied in and
//! copied out, as with any other transport, so that like is compared with like.

use std::time::Duration;

use iceoryx2::port::{
    listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber,
};
use iceoryx2::prelude::*;

use crate::cell::Cell;
use crate::channel::{ChannelError, Ipc, Member, PubSub, failed};

/// There and back.
const NAMES: [&str; 2] = ["skillet/echo-there", "skillet/echo-back"];

/// One end. The side that asks creates it, the side that echoes opens it.
pub struct EchoPorts {
    sender: Publisher<Ipc, [u8], ()>,
    sent: Notifier<Ipc>,
    receiver: Subscriber<Ipc, [u8], ()>,
    arrived: Listener<Ipc>,
    /// Service of `sender`, and of `receiver`.
    names: [&'static str; 2],
    // Last, so that it is dropped after the ports: it owns their liveness.
    member: Member,
}

impl EchoPorts {
    /// Call with a lock of the cell held. No message is longer than `max_len` bytes.
    pub fn create(cell: &Cell, max_len: usize) -> Result<EchoPorts, ChannelError> {
        let ports = EchoPorts::join(Member::first(cell)?, NAMES, max_len)?;
        ports.member.generation.publish()?;
        Ok(ports)
    }

    /// The other end, in another process.
    pub fn open(cell: &Cell, max_len: usize) -> Result<EchoPorts, ChannelError> {
        let [there, back] = NAMES;
        let absent = || ChannelError::NoController { cell: cell.name().into(), seconds: 0.0 };
        let member = Member::join(cell)?.ok_or_else(absent)?;
        EchoPorts::join(member, [back, there], max_len)
    }

    fn join(
        member: Member,
        names: [&'static str; 2],
        max_len: usize,
    ) -> Result<EchoPorts, ChannelError> {
        let node = &member.node;
        let [out, incoming] = names;
        Ok(EchoPorts {
            sender: service(node, out)?
                .publisher_builder()
                .initial_max_slice_len(max_len)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
                .map_err(failed(out, "creating the publisher"))?,
            sent: events(node, out)?
                .notifier_builder()
                .create()
                .map_err(failed(out, "creating the notifier"))?,
            // Before the subscriber, so that a visible receiver can also be woken.
            arrived: events(node, incoming)?
                .listener_builder()
                .create()
                .map_err(failed(incoming, "creating the listener"))?,
            receiver: service(node, incoming)?
                .subscriber_builder()
                .create()
                .map_err(failed(incoming, "creating the subscriber"))?,
            names,
            member,
        })
    }

    /// Copies `message` into shared memory and sends it; true if there is a receiver.
    pub fn send(&self, message: &[u8]) -> Result<bool, ChannelError> {
        let loan = self
            .sender
            .loan_slice_uninit(message.len())
            .map_err(failed(self.names[0], "loaning a message"))?;
        let receivers = loan
            .write_from_slice(message)
            .send()
            .map_err(failed(self.names[0], "sending a message"))?;
        Ok(receivers > 0)
    }

    /// Wakes the peer.
    pub fn notify(&self) -> Result<(), ChannelError> {
        self.sent.notify().map_err(failed(self.names[0], "notifying"))?;
        Ok(())
    }

    /// Copies a message that has arrived into `buffer`, as much of it as fits; its length.
    pub fn receive(&self, buffer: &mut [u8]) -> Result<Option<usize>, ChannelError> {
        let sample = self.receiver.receive().map_err(failed(self.names[1], "receiving"))?;
        Ok(sample.map(|sample| {
            let len = sample.payload().len().min(buffer.len());
            buffer[..len].copy_from_slice(&sample.payload()[..len]);
            len
        }))
    }

    /// Sleeps until the peer notifies, up to `timeout`; true when it did.
    pub fn wait(&self, timeout: Duration) -> Result<bool, ChannelError> {
        let mut woken = false;
        self.arrived
            .timed_wait(|_| woken = true, timeout)
            .map_err(failed(self.names[1], "waiting"))?;
        Ok(woken)
    }
}

fn service(node: &Node<Ipc>, name: &'static str) -> Result<PubSub<[u8]>, ChannelError> {
    node.service_builder(&name.try_into().map_err(failed(name, "naming"))?)
        .publish_subscribe::<[u8]>()
        .enable_safe_overflow(false)
        .subscriber_max_buffer_size(2)
        .max_publishers(1)
        .max_subscribers(1)
        .open_or_create()
        .map_err(failed(name, "creating the service"))
}

fn events(
    node: &Node<Ipc>,
    name: &'static str,
) -> Result<iceoryx2::service::port_factory::event::PortFactory<Ipc>, ChannelError> {
    node.service_builder(&name.try_into().map_err(failed(name, "naming"))?)
        .event()
        .open_or_create()
        .map_err(failed(name, "creating the event"))
}
