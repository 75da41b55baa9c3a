//! Files of the kernel below a root: `/`, or a folder that a test fills.

use std::path::{Path, PathBuf};

#[derive(Clone, Copy)]
pub struct Root<'a>(pub &'a Path);

impl Root<'_> {
    /// `path` is relative: `proc/version`.
    pub fn path(&self, path: &str) -> PathBuf {
        self.0.join(path)
    }

    /// Without white space at its ends; `None` when it cannot be read.
    pub fn read(&self, path: &str) -> Option<String> {
        // Not every file of the kernel is UTF-8: a process may call itself anything.
        let bytes = std::fs::read(self.path(path)).ok()?;
        Some(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    pub fn number(&self, path: &str) -> Option<i64> {
        self.read(path)?.parse().ok()
    }

    /// Names in a folder, sorted; none when it cannot be read.
    pub fn names(&self, path: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(path)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    /// The value of `key` in a file of lines `key: value` or `key value`.
    pub fn value(&self, path: &str, key: &str) -> Option<String> {
        let text = self.read(path)?;
        let rest = text.lines().find_map(|line| {
            let rest = line.strip_prefix(key)?;
            rest.starts_with([':', ' ', '\t']).then_some(rest)
        })?;
        Some(rest.trim_start_matches([':', ' ', '\t']).trim().to_owned())
    }
}

/// Numbers of a list of the kernel: `0-2,5` is 0, 1, 2, 5.
pub fn list(text: &str) -> Vec<usize> {
    let mut numbers = Vec::new();
    for part in text.trim().split(',').filter(|part| !part.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        if let (Ok(first), Ok(last)) = (first.trim().parse(), last.trim().parse::<usize>()) {
            numbers.extend(first..=last);
        }
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_lists_of_the_kernel() {
        assert_eq!(list("0-2,5\n"), [0, 1, 2, 5]);
        assert_eq!(list("\n"), [0; 0]);
        assert_eq!(list("(null)"), [0; 0]);
    }

    #[test]
    fn finds_whole_keys_only() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("f"), "CapEffX:\t1\nCapEff:\t2\nSwapFree:  7 kB\n")
            .unwrap();
        let root = Root(folder.path());
        assert_eq!(root.value("f", "CapEff").as_deref(), Some("2"));
        assert_eq!(root.value("f", "SwapFree").as_deref(), Some("7 kB"));
        assert_eq!(root.value("f", "Swap"), None);
        assert_eq!(root.value("absent", "Swap"), None);
    }
}
