//! Text in a message: UTF-8 in a field of fixed size, filled up with zeros. A reason, a name.

/// Bytes of a reason.
pub const REASON_LEN: usize = 320;

/// No reason.
pub const NO_REASON: [u8; REASON_LEN] = [0; REASON_LEN];

/// Bytes of the name of a machine.
pub const HOST_LEN: usize = 64;

/// No machine: nothing came through a bridge.
pub const NO_HOST: [u8; HOST_LEN] = [0; HOST_LEN];

/// One that is too long loses its end.
pub fn pack<const LEN: usize>(text: &str) -> [u8; LEN] {
    let mut end = text.len().min(LEN);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut field = [0; LEN];
    field[..end].copy_from_slice(&text.as_bytes()[..end]);
    field
}

/// What a person reads: its sender cannot write anything but text to a terminal.
pub fn unpack<const LEN: usize>(field: &[u8; LEN]) -> String {
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(LEN);
    let text = String::from_utf8_lossy(&field[..end]);
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The machine in a field, if there is one.
pub fn host(field: &[u8; HOST_LEN]) -> Option<String> {
    (*field != NO_HOST).then(|| unpack(field))
}

/// UTF-8, and nothing but zeros after its end.
pub fn is_valid<const LEN: usize>(field: &[u8; LEN]) -> bool {
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(LEN);
    std::str::from_utf8(&field[..end]).is_ok() && field[end..].iter().all(|byte| *byte == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_cut_between_characters_and_is_text_alone() {
        let pack = pack::<REASON_LEN>;
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
