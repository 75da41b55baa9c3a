//! What a document tells people to type: its command lines, and its fenced blocks.
#![allow(dead_code)] // each test uses its own part

use std::fs;
use std::path::Path;

/// A Markdown file, its path from the root of the project.
pub struct Document {
    pub name: String,
    pub text: String,
}

/// Something a reader would paste into a shell.
#[derive(Debug, PartialEq)]
pub struct Line {
    /// `file, line n`.
    pub at: String,
    pub text: String,
    /// From a block; otherwise code within a sentence or a table, which may be a mere mention.
    pub in_block: bool,
}

/// Everything people read first; decisions (ADRs) and the changelog tell of their time.
pub fn documents(root: &Path) -> Vec<Document> {
    let mut all = Vec::new();
    for folder in ["", "docs/"] {
        for entry in fs::read_dir(root.join(folder)).unwrap().flatten() {
            let name = format!("{folder}{}", entry.file_name().to_string_lossy());
            if name.ends_with(".md") && name != "CHANGELOG.md" {
                let text = fs::read_to_string(entry.path()).unwrap();
                all.push(Document { name, text });
            }
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

impl Document {
    /// The fenced blocks ```` ```language ````, with the line each begins in.
    pub fn blocks(&self, language: &str) -> Vec<(usize, String)> {
        let mut blocks = Vec::new();
        let mut open: Option<(bool, usize, String)> = None;
        for (i, line) in self.text.lines().enumerate() {
            match (line.trim().strip_prefix("```"), &mut open) {
                (Some(info), None) => open = Some((info == language, i + 2, String::new())),
                (Some(_), Some(_)) => {
                    let (wanted, start, block) = open.take().expect("it was there");
                    blocks.extend(wanted.then_some((start, block)));
                }
                (None, Some((_, _, block))) => *block += &format!("{line}\n"),
                (None, None) => {}
            }
        }
        blocks
    }

    /// Every line of its `sh` blocks, and every code span that is a command of `skillet`.
    pub fn lines(&self) -> Vec<Line> {
        let mut lines = self.spans();
        for (start, block) in self.blocks("sh") {
            let mut rows = block.lines().enumerate();
            while let Some((i, row)) = rows.next() {
                let mut text = row.trim().to_string();
                while text.ends_with('\\') {
                    text.pop();
                    text += rows.next().expect("a line that goes on has a next one").1.trim();
                }
                if !text.is_empty() && !text.starts_with('#') {
                    lines.push((start + i, text, true));
                }
            }
        }
        lines.sort_by_key(|(line, ..)| *line);
        let line = |(line, text, in_block)| Line {
            at: format!("{}, line {line}", self.name),
            text,
            in_block,
        };
        lines.into_iter().map(line).collect()
    }

    /// Code spans outside of blocks; they may run over the end of a line.
    fn spans(&self) -> Vec<(usize, String, bool)> {
        let mut in_block = false;
        let outside = self.text.lines().map(|line| {
            let is_fence = line.trim().starts_with("```");
            in_block ^= is_fence;
            if in_block || is_fence { "\n".to_string() } else { format!("{line}\n") }
        });
        let (mut spans, mut number) = (Vec::new(), 1);
        for (i, part) in outside.collect::<String>().split('`').enumerate() {
            let text = part.split_whitespace().collect::<Vec<_>>().join(" ");
            if i % 2 == 1 && commands(&text).iter().any(|words| arguments(words).is_some()) {
                spans.push((number, text, false));
            }
            number += part.matches('\n').count();
        }
        spans
    }
}

/// The simple commands of a shell line as words: without redirections, comments and quotes.
pub fn commands(line: &str) -> Vec<Vec<String>> {
    let mut commands = vec![Vec::new()];
    let (mut word, mut quote, mut redirected) = (String::new(), None, false);
    for c in line.chars().chain([' ']) {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (Some(_), c) => word.push(c),
            (None, '\'' | '"') => quote = Some(c),
            (None, '#') if word.is_empty() => break,
            (None, ' ' | '|' | '&' | ';' | '>' | '<') => {
                let word = std::mem::take(&mut word);
                // `2> file`: the number of what is redirected.
                let is_number = c == '>' && word.chars().all(|c| c.is_ascii_digit());
                if !word.is_empty() && !is_number && !std::mem::take(&mut redirected) {
                    commands.last_mut().expect("never empty").push(word);
                }
                match c {
                    '|' | '&' | ';' => commands.push(Vec::new()),
                    '>' | '<' => redirected = true,
                    _ => {}
                }
            }
            (None, c) => word.push(c),
        }
    }
    commands.retain(|words| !words.is_empty());
    commands
}

/// The arguments of a command of `skillet`, `None` for another tool's. Placeholders stand for what
/// they say; what follows an ellipsis is left to the reader.
pub fn arguments(words: &[String]) -> Option<Vec<String>> {
    let word = |i: usize| words.get(i).map(String::as_str);
    let from_source = ["cargo", "run", "--release", "--"];
    let start = match words.iter().take(4).eq(from_source) {
        true => 4,
        // The last one: `sudo -u skillet env … skillet status`.
        false => words.iter().rposition(|word| word == "skillet")? + 1,
    };
    word(start)?;
    let until_ellipsis = words[start..].iter().take_while(|word| *word != "…");
    Some(until_ellipsis.map(|word| placeholder(word).to_string()).collect())
}

/// The line as a reader would run it: with the installed tool, placeholders filled in.
pub fn as_typed(line: &str) -> String {
    let installed = line.replace("cargo run --release -- ", "skillet ");
    installed.split(' ').map(placeholder).collect::<Vec<_>>().join(" ")
}

/// What a word in capitals stands for.
fn placeholder(word: &str) -> &str {
    match word {
        "SESSION" | "FILE-OR-SESSION" => "s7",
        "NAME" => "landscape",
        "N" | "S" => "1",
        "FILE" => "s7",
        "DIR" => "folder",
        word => word,
    }
}
