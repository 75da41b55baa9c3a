//! Samples and replies in shared memory, for a simulator that polls on its own core.
//!
//! Each visit of a plant has two blackboards to itself, under names never used before: a writer that is killed
//! blocks its key for ever. A blackboard holds the newest value, and in lockstep there is no other. Reading
//! and writing it neither allocates nor enters the kernel.

use core::fmt::Debug;
use std::path::Path;
use std::sync::Arc;

use iceoryx2::port::reader::{BlackboardValue, EntryHandle};
use iceoryx2::port::writer::EntryHandleMut;
use iceoryx2::prelude::{Node, ServiceName, ZeroCopySend};
use iceoryx2::service::port_factory::blackboard;
use zerocopy::{Immutable, IntoBytes};

use super::socket::Message;
use super::{PlantCommand, PlantState};
use crate::cell::{Cell, CellError};
use crate::channel::{ChannelError, Door, Ipc, Member, failed};

/// The only entry of a board.
const KEY: u64 = 0;
/// For errors.
const CHANNEL: &str = "skillet/plant";

/// What a board carries, one way.
pub trait Carried: Copy + Debug + ZeroCopySend + IntoBytes + Immutable + 'static {
    const NAME: &'static str;
    const EMPTY: Self;

    fn message(&self) -> Message<'_>;
}

impl Carried for PlantState {
    const NAME: &'static str = "state";
    const EMPTY: PlantState = PlantState::EMPTY;

    fn message(&self) -> Message<'_> {
        Message::State(self)
    }
}

impl Carried for PlantCommand {
    const NAME: &'static str = "command";
    const EMPTY: PlantCommand = PlantCommand::HOLD;

    fn message(&self) -> Message<'_> {
        Message::Command(self)
    }
}

/// One end of both boards of a visit: writes `S`, reads `R`. Make and drop it off the rt thread.
pub struct Shared<S: Carried, R: Carried> {
    sent: EntryHandleMut<Ipc, u64, S>,
    received: EntryHandle<Ipc, u64, R>,
    seen: BlackboardValue<R>,
    // Dropped last: what is above lives in its folder.
    _member: Arc<Member>,
}

impl<S: Carried, R: Carried> Shared<S, R> {
    fn enter(member: &Arc<Member>, visit: u64, door: Door) -> Result<Shared<S, R>, ChannelError> {
        let (sent, received) =
            (board::<S>(&member.node, visit, door)?, board::<R>(&member.node, visit, door)?);
        let writer =
            sent.writer_builder().create().map_err(failed(CHANNEL, "creating the writer"))?;
        let reader =
            received.reader_builder().create().map_err(failed(CHANNEL, "creating the reader"))?;
        let sent = writer.entry::<S>(&KEY).map_err(failed(CHANNEL, "taking the entry"))?;
        let received = reader.entry::<R>(&KEY).map_err(failed(CHANNEL, "reading the entry"))?;
        let seen = received.get();
        Ok(Shared { sent, received, seen, _member: member.clone() })
    }

    pub(super) fn write(&self, message: &S) {
        self.sent.update_with_copy(*message);
    }

    /// Something was written that was not taken.
    pub(super) fn has_news(&self) -> bool {
        !self.received.is_up_to_date(&self.seen)
    }

    pub(super) fn take(&mut self) -> &R {
        self.seen = self.received.get();
        &self.seen
    }
}

fn board<T: Carried>(
    node: &Node<Ipc>,
    visit: u64,
    door: Door,
) -> Result<blackboard::PortFactory<Ipc, u64>, ChannelError> {
    let name = ServiceName::new(&format!("{CHANNEL}-{visit}/{}", T::NAME))
        .map_err(failed(CHANNEL, "naming"))?;
    let builder = node.service_builder(&name);
    match door {
        Door::Create => builder
            .blackboard_creator::<u64>()
            .add::<T>(KEY, T::EMPTY)
            .max_readers(1)
            .create()
            .map_err(failed(CHANNEL, "creating the board")),
        Door::Open => {
            builder.blackboard_opener::<u64>().open().map_err(failed(CHANNEL, "opening the board"))
        }
    }
}

/// Makes the boards of one visit after the other, in the current generation of a cell.
pub struct Host {
    member: Arc<Member>,
    dir: String,
    n_visits: u64,
}

impl Host {
    /// Beside the controller's services; `None` while they are not there.
    pub fn join(cell: &Cell) -> Result<Option<Host>, ChannelError> {
        Ok(Member::join(cell)?.map(|member| Host::of(cell, member)))
    }

    /// In a cell without services. Call with its controller lock held.
    pub fn alone(cell: &Cell) -> Result<Host, ChannelError> {
        let member = Member::first(cell)?;
        member.generation.publish()?;
        Ok(Host::of(cell, member))
    }

    fn of(cell: &Cell, member: Member) -> Host {
        let dir = cell.dir().display().to_string();
        Host { member: Arc::new(member), dir, n_visits: 0 }
    }

    /// The controller's end of a visit, and the words by which the plant finds its own.
    pub fn invite(&mut self) -> Result<(Shared<PlantCommand, PlantState>, String), ChannelError> {
        self.n_visits += 1;
        let shared = Shared::enter(&self.member, self.n_visits, Door::Create)?;
        Ok((shared, format!("{} {}", self.dir, self.n_visits)))
    }
}

/// The plant's end, by what its controller's Welcome says.
pub fn follow(invitation: &str) -> Result<Shared<PlantState, PlantCommand>, ChannelError> {
    let unknown = || ChannelError::Cell(CellError::Name(invitation.to_string()));
    let (dir, visit) = invitation.rsplit_once(' ').ok_or_else(unknown)?;
    let visit = visit.parse().map_err(|_| unknown())?;
    let dir = Path::new(dir);
    let name = dir.file_name().and_then(|name| name.to_str()).ok_or_else(unknown)?;
    let cell = Cell::in_dir(dir.parent().ok_or_else(unknown)?, name)?;
    let member = Member::join(&cell)?
        .ok_or_else(|| ChannelError::NoController { cell: cell.name().into(), seconds: 0.0 })?;
    Shared::enter(&Arc::new(member), visit, Door::Open)
}
