//! XML as robot files have it: text in any common encoding, prefixes nobody declared, white space
//! before the declaration.

use roxmltree::{Document, Node, ParsingOptions};

use super::finding::UrdfFault;

/// Prefixes without a declaration that are let pass, as in files cut out of larger ones.
const MAX_UNDECLARED: usize = 16;

/// Text of a file in UTF-8 or, by its byte order mark, UTF-16; anything else is read as Latin-1.
pub fn decode(bytes: &[u8]) -> String {
    let utf16 = |of: fn([u8; 2]) -> u16| {
        let units: Vec<u16> =
            bytes[2..].chunks_exact(2).map(|pair| of([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xFF, 0xFE, ..] => utf16(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => utf16(u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_string(),
            Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
        },
    }
}

/// A text that roxmltree reads, with the same lines as the file but for the skipped ones.
pub(super) struct Source {
    text: String,
    skipped_lines: u32,
}

impl Source {
    /// Drops what may not stand before the XML declaration and declares undeclared prefixes.
    pub fn new(text: &str) -> Result<Source, (Option<u32>, UrdfFault)> {
        let trimmed = text.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}');
        let skipped = text.len() - trimmed.len();
        let skipped_lines = text[..skipped].matches('\n').count() as u32;
        let mut source = Source { text: trimmed.to_string(), skipped_lines };
        for _ in 0..MAX_UNDECLARED {
            let parsed = source.parse().map(drop);
            match parsed {
                Ok(()) => return Ok(source),
                Err(roxmltree::Error::UnknownNamespace(prefix, _)) if source.declare(&prefix) => {}
                Err(error) => return Err(source.refusal(&error)),
            }
        }
        source.parse().map(|_| ()).map_err(|error| source.refusal(&error))?;
        Ok(source)
    }

    pub fn parse(&self) -> Result<Document<'_>, roxmltree::Error> {
        let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
        Document::parse_with_options(&self.text, options)
    }

    /// Line of the file in which a node begins.
    pub fn line(&self, node: Node) -> u32 {
        node.document().text_pos_at(node.range().start).row + self.skipped_lines
    }

    /// Adds a declaration of `prefix` to the root element, on its own line.
    fn declare(&mut self, prefix: &str) -> bool {
        let declaration = format!(" xmlns:{prefix}=\"undeclared:{prefix}\"");
        if self.text.contains(&declaration) {
            return false;
        }
        match self.text.find("<robot") {
            Some(at) => self.text.insert_str(at + "<robot".len(), &declaration),
            None => return false,
        }
        true
    }

    fn refusal(&self, error: &roxmltree::Error) -> (Option<u32>, UrdfFault) {
        let line = error.pos().row + self.skipped_lines;
        // The position of the message is that of a column nobody needs.
        let text = error.to_string();
        let reason = text.rsplit_once(" at ").map_or(text.as_str(), |(reason, _)| reason);
        (Some(line), UrdfFault::Xml(reason.to_string()))
    }
}

/// Is this an element of the name, in any case and without a prefix?
pub(super) fn is(node: &Node, name: &str) -> bool {
    node.is_element()
        && node.tag_name().namespace() == node.default_namespace()
        && node.tag_name().name().eq_ignore_ascii_case(name)
}

/// The first child element of the name.
pub(super) fn child<'a, 'd>(node: &Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    node.children().find(|child| is(child, name))
}

/// An attribute, its name in any case.
pub(super) fn attribute<'a>(node: &Node<'a, '_>, name: &str) -> Option<&'a str> {
    node.attributes()
        .find(|attribute| attribute.name().eq_ignore_ascii_case(name))
        .map(|attribute| attribute.value().trim())
}
