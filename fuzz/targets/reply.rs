//! A controller's reply as the tool reads it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rt_controller::fault::Fault;
use shm_types::command::{Reply, Status};
use shm_types::text::REASON_LEN;
use skillet_fuzz::{patched, split};

fuzz_target!(|data: &[u8]| {
    let (mode, rest) = split(data);
    let (reason, changes) = rest.split_at(rest.len().min(usize::from(mode) * 2));
    let text = String::from_utf8_lossy(reason);
    let refused = Reply::refused(1, Status::ZERO, &text);
    let reply = patched(&refused, changes);
    assert!(reply.reason_text().len() <= 3 * REASON_LEN);
    let Status { in_loop, active, last_good, fault, .. } = reply.status;
    for name in [reply.policy, in_loop, active, last_good] {
        assert!(!name.describe().is_empty());
    }
    let _ = Fault::describe(fault as u32);
    let whole = refused.reason_text();
    let end = text.find('\0').unwrap_or(text.len());
    assert!(text[..end].starts_with(&whole), "{text:?} became {whole:?}");
});
