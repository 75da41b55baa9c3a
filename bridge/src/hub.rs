//! The hub, on the learner's machine: a local cell for every remote one, with the controller elsewhere.
//!
//! It listens, and hands over what cells say. What it knows it has from the learner and from the cells: killed and
//! started again, it is told everything anew, and nothing is lost or learnt twice.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use shm_types::cell::Cell;
use thiserror::Error;
use zenoh::Wait;
use zenoh::handlers::{FifoChannel, RingChannel};
use zenoh::query::Query;

use crate::counter::{Counter, Incoming};
use crate::desk::Desk;
use crate::event::Event;
use crate::net::{self, DOOR, Keys, NetError, all_alive_key, live_key, turn_key};
use crate::turn::{Turn, refusal};

/// Turns and tokens that may wait for the thread of their cell.
const QUEUE: usize = 16;
/// What is seen of a loop and waits for that thread; of more, the oldest is dropped.
const LIVE_QUEUE: usize = 16;
const LOOK: Duration = Duration::from_millis(50);

/// Where to listen, for whom.
pub struct HubConfig {
    /// `HOST:PORT`.
    pub listen: String,
    /// Without keys only this machine is listened to.
    pub keys: Option<Keys>,
    /// The allow-list: local cells, named as the remote ones.
    pub cells: Vec<Cell>,
    /// Which task on which arm, or empty; a cell that says something else is refused.
    pub world: String,
    /// Names this start of the hub; drawn at random.
    pub id: u64,
}

/// Why the hub does not run.
#[derive(Debug, Error)]
pub enum HubError {
    #[error(transparent)]
    Net(#[from] NetError),
    #[error(transparent)]
    Cell(#[from] shm_types::cell::CellError),
    #[error("listening for cell '{cell}': {reason}")]
    Declare { cell: String, reason: String },
}

/// Serves the cells until `stop`.
pub fn run(
    config: &HubConfig,
    stop: &AtomicBool,
    on_event: &(dyn Fn(Event) + Sync),
) -> Result<(), HubError> {
    let names: Vec<String> = config.cells.iter().map(|cell| cell.name().to_string()).collect();
    // Their places first: a hub that cannot play its part must not be found.
    let open = |cell: &Cell| Desk::open(cell, config.id);
    let desks = config.cells.iter().map(open).collect::<Result<Vec<Desk>, _>>()?;
    let (session, address) = net::listen(&config.listen, config.keys.as_ref(), &names)?;
    let failed = |cell: &str| {
        let cell = cell.to_string();
        move |error: zenoh::Error| HubError::Declare { cell, reason: error.to_string() }
    };
    let mut counters = Vec::new();
    for desk in desks {
        let cell = desk.cell().to_string();
        let tokens = session
            .liveliness()
            .declare_subscriber(all_alive_key(&cell))
            .with(FifoChannel::new(QUEUE))
            .wait()
            .map_err(failed(&cell))?;
        let queries = session
            .declare_queryable(turn_key(&cell))
            .with(FifoChannel::new(QUEUE))
            .wait()
            .map_err(failed(&cell))?;
        let live = session
            .declare_subscriber(live_key(&cell))
            .with(RingChannel::new(LIVE_QUEUE))
            .wait()
            .map_err(failed(&cell))?;
        let counter = Counter::new(desk, config.world.clone(), on_event);
        counters.push((counter, queries, tokens, live));
    }
    let door = session
        .declare_queryable(DOOR)
        .with(FifoChannel::new(QUEUE))
        .wait()
        .map_err(failed("any"))?;
    on_event(Event::Serves {
        address,
        cells: names.join(", "),
        is_encrypted: config.keys.is_some(),
    });
    std::thread::scope(|scope| {
        for (counter, queries, tokens, live) in counters {
            scope.spawn(move || {
                let (queries, tokens) = (queries.handler(), tokens.handler());
                counter.run(&Incoming { queries, tokens, live: live.handler() }, stop);
            });
        }
        while !stop.load(Ordering::Relaxed) {
            if let Ok(Some(query)) = door.recv_timeout(LOOK) {
                answer_at_the_door(&query, &names, on_event);
            }
        }
    });
    let _ = session.close().wait();
    Ok(())
}

/// Tells a cell why nobody answers its turns, if that is not for the network's sake.
fn answer_at_the_door(query: &Query, names: &[String], on_event: &(dyn Fn(Event) + Sync)) {
    let bytes = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
    let (cell, reason) = match Turn::decode(&bytes) {
        Err(error) => ("unknown".to_string(), error.to_string()),
        Ok(turn) => {
            let (cell, owner) = (turn.head.cell_name(), turn.head.certificate_name());
            let reason = if !owner.is_empty() && owner != cell {
                format!("it uses the keys of cell '{owner}': use those of '{cell}'")
            } else if !names.contains(&cell) {
                format!("not in the allow-list ({}): add it to --allow", names.join(", "))
            } else {
                let _ = query.reply(DOOR, Vec::new()).wait();
                return;
            };
            (cell, reason)
        }
    };
    let _ = query.reply_err(refusal(&reason)).wait();
    on_event(Event::Refused { cell, reason });
}
