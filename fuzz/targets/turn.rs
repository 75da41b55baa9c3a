//! A turn of a cell, as a hub receives it, what it shows of its loop, and the answer, as the cell does.
#![no_main]

use bridge::answer::Answer;
use bridge::live::Live;
use bridge::turn::{Prefix, Turn, TurnHead};
use libfuzzer_sys::fuzz_target;
use shm_types::episode::{EpisodeHeader, TickRecord};
use skillet_fuzz::{patched, split};
use zerocopy::{FromZeros, IntoBytes};

fuzz_target!(|data: &[u8]| {
    let (mode, data) = split(data);
    // As it comes, behind a prefix that is right.
    let raw = [Prefix::OURS.as_bytes(), data].concat();
    let _ = Answer::decode(&raw);
    let _ = Live::decode(&raw);
    if let Ok(Turn { head, episode: None, reply }) = Turn::decode(&raw) {
        let again = reply.map_or_else(|| head.encode(None), |reply| head.encode_reply(&reply));
        assert_eq!(again, raw);
    }
    // One that is nearly right.
    let (in_head, rest) = data.split_at(data.len().min(usize::from(mode & 7) * 11));
    let (in_header, in_records) = rest.split_at(rest.len().min(usize::from(mode >> 3 & 7) * 11));
    let head = patched(&TurnHead::new_zeroed(), in_head);
    let header = patched(&EpisodeHeader { n_records: 2, ..Default::default() }, in_header);
    let records = patched(&[TickRecord::ZERO; 2], in_records);
    let bytes = head.encode(Some((&header, &records)));
    if let Ok(Turn { head, episode: Some(episode), .. }) = Turn::decode(&bytes) {
        assert_eq!(head.encode(Some((&episode.header, &episode.records))), bytes);
    }
});
