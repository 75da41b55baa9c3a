//! Writes the cell's state to disk on a thread of its own: no tick and no command waits for a disk.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

/// A file's whole new content.
struct Order {
    ticket: u64,
    path: PathBuf,
    text: String,
}

/// What became of an order.
pub(crate) struct Kept {
    pub ticket: u64,
    pub result: Result<(), String>,
}

/// The thread's other end. Dropping it waits until everything ordered is on disk.
pub(crate) struct Keeper {
    orders: Option<Sender<Order>>,
    kept: Receiver<Kept>,
    thread: Option<JoinHandle<()>>,
    last_ticket: u64,
}

impl Keeper {
    pub fn start() -> io::Result<Keeper> {
        let (orders, inbox) = channel();
        let (outbox, kept) = channel();
        let work = move || keep(&inbox, &outbox);
        let thread = std::thread::Builder::new().name("skillet-keeper".into()).spawn(work)?;
        Ok(Keeper { orders: Some(orders), kept, thread: Some(thread), last_ticket: 0 })
    }

    /// Orders `text` to become the content of `path`; [`Keeper::kept`] tells when it has.
    pub fn order(&mut self, path: PathBuf, text: String) -> u64 {
        self.last_ticket += 1;
        let order = Order { ticket: self.last_ticket, path, text };
        if let Some(orders) = &self.orders {
            // The thread ends only after this sender.
            let _ = orders.send(order);
        }
        self.last_ticket
    }

    pub fn kept(&self) -> Option<Kept> {
        self.kept.try_recv().ok()
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn keep(inbox: &Receiver<Order>, outbox: &Sender<Kept>) {
    while let Ok(first) = inbox.recv() {
        let mut orders = vec![first];
        orders.extend(inbox.try_iter());
        for (i, order) in orders.iter().enumerate() {
            // Of several contents of one file only the newest is worth a write.
            let newest = orders[i..].iter().rfind(|other| other.path == order.path);
            let superseded = newest.is_some_and(|newest| newest.ticket != order.ticket);
            if superseded {
                continue;
            }
            let result = write_whole(&order.path, order.text.as_bytes())
                .map_err(|error| format!("{}: {error}", order.path.display()));
            for same in orders[..=i].iter().filter(|other| other.path == order.path) {
                let _ = outbox.send(Kept { ticket: same.ticket, result: result.clone() });
            }
        }
    }
}

/// Replaces the file as a whole and durably: old or new after a crash, never half.
pub(crate) fn write_whole(path: &Path, content: &[u8]) -> io::Result<()> {
    let dir = path.parent().unwrap_or(Path::new("."));
    fs::DirBuilder::new().recursive(true).mode(0o700).create(dir)?;
    let draft = path.with_extension("new");
    write_draft(&draft, content).and_then(|()| fs::rename(&draft, path)).inspect_err(|_| {
        // Half a draft would keep the space that is missing.
        let _ = fs::remove_file(&draft);
    })?;
    File::open(dir)?.sync_all()
}

fn write_draft(draft: &Path, content: &[u8]) -> io::Result<()> {
    let mut file =
        OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(draft)?;
    file.write_all(content)?;
    file.sync_all()
}

/// Creates a folder for this user alone, or makes sure that one may write there.
pub(crate) fn own_folder(dir: &Path) -> io::Result<()> {
    fs::DirBuilder::new().recursive(true).mode(0o700).create(dir)?;
    Ok(rustix::fs::access(dir, rustix::fs::Access::WRITE_OK)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_content_is_on_disk_when_the_keeper_has_ended() {
        let dir = std::env::temp_dir().join(format!("skillet-keeper-{}", std::process::id()));
        let (a, b) = (dir.join("a"), dir.join("b"));
        let mut keeper = Keeper::start().unwrap();
        for i in 0..200 {
            keeper.order(a.clone(), format!("a{i}"));
        }
        keeper.order(b.clone(), "b".into());
        let last = keeper.order(dir.join("a/below-a-file"), "c".into());
        let mut results = Vec::new();
        while results.len() < 202 {
            results.extend(keeper.kept());
        }
        drop(keeper);
        assert_eq!(fs::read_to_string(&a).unwrap(), "a199");
        assert_eq!(fs::read_to_string(&b).unwrap(), "b");
        let failed: Vec<_> = results.iter().filter(|kept| kept.result.is_err()).collect();
        assert_eq!(failed.iter().map(|kept| kept.ticket).collect::<Vec<_>>(), [last]);
        assert!(failed[0].result.as_ref().unwrap_err().contains("below-a-file"));
        fs::remove_dir_all(&dir).unwrap();
    }
}
