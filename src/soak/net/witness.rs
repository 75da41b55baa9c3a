//! What a cell does whose link is cut: alone, it must go on with its last good policy.

use std::time::{Duration, Instant};

use shm_types::cell::Cell;
use shm_types::command::Status;
use shm_types::ports::ToolPorts;

/// After this long the bridge must have stopped beating (2 s), and the controller have noticed (2 s).
const MUST_BE_ALONE: Duration = Duration::from_secs(6);
/// A cell that is alone for so long serves something.
const LONG: Duration = Duration::from_secs(10);
/// Between two looks, and how long one may take.
const EVERY: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(200);

/// One cell during one cut.
pub struct Witness {
    pub cell: usize,
    next: Instant,
    first: Option<(Instant, Status)>,
    last: Option<(Instant, Status)>,
}

/// Cuts that were long enough to tell, one for each cell behind the link.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone {
    /// The controller served rollouts of its last good policy.
    pub went_on: u64,
    pub rollouts: u64,
    /// It had a good policy and served nothing.
    pub stood_still: u64,
    /// It had no good policy yet.
    pub without_policy: u64,
    /// The controller was killed meanwhile, or the cut was too short to tell.
    pub not_told: u64,
}

impl Witness {
    pub fn of(cell: usize) -> Witness {
        Witness { cell, next: Instant::now() + MUST_BE_ALONE, first: None, last: None }
    }

    /// Looks at the cell, if it is time to. A controller that was killed does not answer.
    pub fn look(&mut self, cell: &Cell) {
        if Instant::now() < self.next {
            return;
        }
        self.next = Instant::now() + EVERY;
        let status = ToolPorts::open(cell, LOOK).ok().and_then(|tool| tool.status(LOOK));
        if let Some(status) = status {
            let seen = (Instant::now(), status);
            self.first.get_or_insert(seen);
            self.last = Some(seen);
        }
    }

    /// The cut is over.
    pub fn testify(self, alone: &mut Alone) {
        let (Some((from, first)), Some((to, last))) = (self.first, self.last) else {
            alone.not_told += 1;
            return;
        };
        let served = last.rollouts_served.saturating_sub(first.rollouts_served);
        let has_policy = first.last_good.digest != 0 || first.active.digest != 0;
        if first.boot_id != last.boot_id {
            alone.not_told += 1;
        } else if served > 0 {
            alone.went_on += 1;
            alone.rollouts += served;
        } else if to.duration_since(from) < LONG {
            alone.not_told += 1;
        } else if has_policy {
            alone.stood_still += 1;
        } else {
            alone.without_policy += 1;
        }
    }
}
