//! A file of the controller's spool.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rt_controller::fuzzing::decode_spooled;
use shm_types::episode::{EpisodeHeader, TickRecord};
use shm_types::{Digest, SCHEMA};
use skillet_fuzz::{patched, split};
use zerocopy::IntoBytes;

fuzz_target!(|data: &[u8]| {
    let (mode, rest) = split(data);
    if mode & 1 == 0 {
        let _ = decode_spooled(rest);
        return;
    }
    // With the right digest, so that what lies behind it is reached.
    let header = EpisodeHeader { n_records: 2, ..Default::default() };
    let (in_header, in_records) = rest.split_at(rest.len().min(usize::from(mode >> 3) * 11));
    let mut bytes = b"SKEPISOD".to_vec();
    bytes.extend(SCHEMA.to_le_bytes());
    bytes.extend(patched(&header, in_header).as_bytes());
    bytes.extend(patched(&[TickRecord::ZERO; 2], in_records).as_bytes());
    if mode & 2 != 0 {
        bytes.truncate(bytes.len() - rest.len().min(200));
    }
    bytes.extend(Digest::new().bytes(&bytes).finish().to_le_bytes());
    if let Some((header, records)) = decode_spooled(&bytes) {
        assert!(header.validate(&records).is_ok());
    }
});
