//! Feeds the service manager's watchdog from a thread of its own: a manager that does not read blocks
//! whoever writes to it.

use std::sync::mpsc::{SyncSender, sync_channel};

use sd_notify::NotifyState;

use crate::serve::tell_manager;

pub(crate) struct Watchdog {
    signs: Option<SyncSender<()>>,
}

impl Watchdog {
    /// Without a thread there is no sign of life, and the manager will notice.
    pub fn start() -> Watchdog {
        let (signs, inbox) = sync_channel(1);
        let feed = move || inbox.iter().for_each(|()| tell_manager(NotifyState::Watchdog));
        let thread = std::thread::Builder::new().name("skillet-watchdog".into()).spawn(feed);
        Watchdog { signs: thread.is_ok().then_some(signs) }
    }

    /// One that is still under way is enough.
    pub fn feed(&self) {
        if let Some(signs) = &self.signs {
            let _ = signs.try_send(());
        }
    }
}
