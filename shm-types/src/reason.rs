//! A reason in a message: UTF-8 in a field of fixed size, filled up with zeros.

/// Bytes of a reason.
pub const REASON_LEN: usize = 320;

/// No reason.
pub const NO_REASON: [u8; REASON_LEN] = [0; REASON_LEN];

/// One that is too long loses its end.
pub fn pack(text: &str) -> [u8; REASON_LEN] {
    let mut end = text.len().min(REASON_LEN);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut reason = NO_REASON;
    reason[..end].copy_from_slice(&text.as_bytes()[..end]);
    reason
}

/// What a person reads: whoever sent it cannot write to his terminal anything but text.
pub fn unpack(reason: &[u8; REASON_LEN]) -> String {
    let end = reason.iter().position(|byte| *byte == 0).unwrap_or(REASON_LEN);
    let text = String::from_utf8_lossy(&reason[..end]);
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// UTF-8, and nothing but zeros after its end.
pub fn is_valid(reason: &[u8; REASON_LEN]) -> bool {
    let end = reason.iter().position(|byte| *byte == 0).unwrap_or(REASON_LEN);
    std::str::from_utf8(&reason[..end]).is_ok() && reason[end..].iter().all(|byte| *byte == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_cut_between_characters_and_is_text_alone() {
        let long = pack(&"µ".repeat(REASON_LEN));
        assert_eq!(unpack(&long), "µ".repeat(REASON_LEN / 2));
        assert!(is_valid(&long) && is_valid(&NO_REASON));
        assert_eq!((unpack(&pack("no")).as_str(), unpack(&NO_REASON).as_str()), ("no", ""));
        assert_eq!(unpack(&pack("a\x1b[2J\nb")), "a [2J b");
        let mut hidden = pack("no");
        hidden[5] = b'x';
        assert!(!is_valid(&hidden));
        hidden = NO_REASON;
        hidden[0] = 0xff;
        assert!(!is_valid(&hidden));
    }
}
