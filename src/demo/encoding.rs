//! Bytes of a recording → text: UTF-8, UTF-16 and Latin-1, with or without a byte order mark.

use anyhow::{Result, bail};

/// This much of a file tells what it is.
const SAMPLE_BYTES: usize = 4096;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    Utf8,
    Utf16,
    Latin1,
}

impl Encoding {
    pub fn name(self) -> &'static str {
        match self {
            Encoding::Utf8 => "UTF-8",
            Encoding::Utf16 => "UTF-16",
            Encoding::Latin1 => "Latin-1",
        }
    }
}

/// The text of `bytes`, with line feeds alone at the ends of lines.
pub fn decode(file: &str, bytes: &[u8]) -> Result<(String, Encoding)> {
    if bytes.starts_with(b"\xff\xfe\x00\x00") || bytes.starts_with(b"\x00\x00\xfe\xff") {
        bail!(
            "{file}: is encoded in UTF-32: convert it with `iconv -f UTF-32 -t UTF-8 {file} > utf8.csv`"
        );
    }
    let (text, encoding) = match bytes {
        [0xff, 0xfe, rest @ ..] => (utf16(rest, u16::from_le_bytes), Encoding::Utf16),
        [0xfe, 0xff, rest @ ..] => (utf16(rest, u16::from_be_bytes), Encoding::Utf16),
        _ => match zeros(bytes) {
            // Digits and separators have a zero beside them.
            (0, 1..) => (utf16(bytes, u16::from_le_bytes), Encoding::Utf16),
            (1.., 0) => (utf16(bytes, u16::from_be_bytes), Encoding::Utf16),
            _ => match std::str::from_utf8(bytes) {
                Ok(text) => (text.trim_start_matches('\u{feff}').to_string(), Encoding::Utf8),
                // The first 256 code points are Latin-1.
                Err(_) => (bytes.iter().map(|byte| char::from(*byte)).collect(), Encoding::Latin1),
            },
        },
    };
    let is_binary = |c: char| c.is_ascii_control() && !matches!(c, '\t' | '\n' | '\r' | '\x0c');
    if let Some(c) = text.chars().take(SAMPLE_BYTES).find(|c| is_binary(*c)) {
        bail!(
            "{file}: not a text file (contains byte {:#04x}): use a text table such as CSV",
            u32::from(c)
        );
    }
    Ok((text.replace("\r\n", "\n").replace('\r', "\n"), encoding))
}

/// Zero bytes at even and at odd places.
fn zeros(bytes: &[u8]) -> (usize, usize) {
    let sample = &bytes[..bytes.len().min(SAMPLE_BYTES)];
    let count = |from| sample.iter().skip(from).step_by(2).filter(|byte| **byte == 0).count();
    (count(0), count(1))
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "t_µs;x_m\r\n0;0,5\r\n";

    #[test]
    fn reads_each_encoding() {
        let expected = TEXT.replace('\r', "");
        let units = || TEXT.encode_utf16();
        let with = |mark: &[u8], bytes: Vec<u8>| [mark, &bytes].concat();
        let le: Vec<u8> = units().flat_map(u16::to_le_bytes).collect();
        let be: Vec<u8> = units().flat_map(u16::to_be_bytes).collect();
        let latin: Vec<u8> = TEXT.chars().map(|c| c as u8).collect();
        for (bytes, encoding) in [
            (TEXT.as_bytes().to_vec(), Encoding::Utf8),
            (with(b"\xef\xbb\xbf", TEXT.as_bytes().to_vec()), Encoding::Utf8),
            (TEXT.replace("\r\n", "\r").into_bytes(), Encoding::Utf8),
            (with(b"\xff\xfe", le.clone()), Encoding::Utf16),
            (with(b"\xfe\xff", be.clone()), Encoding::Utf16),
            (le, Encoding::Utf16),
            (be, Encoding::Utf16),
            (latin, Encoding::Latin1),
        ] {
            assert_eq!(decode("r.csv", &bytes).unwrap(), (expected.clone(), encoding));
        }
    }

    #[test]
    fn refuses_what_is_no_text() {
        for (bytes, word) in [
            (&b"\xff\xfe\x00\x00t\x00\x00\x00"[..], "iconv -f UTF-32"),
            (b"t,x\n\x00\x00\x01\x02", "not a text file"),
            (b"\x02\x01abc", "0x02"),
        ] {
            let message = decode("r.csv", bytes).unwrap_err().to_string();
            assert!(message.contains("r.csv") && message.contains(word), "{message}");
        }
    }
}
