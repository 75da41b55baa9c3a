//! Files that import each other in a circle have no reading order. `cargo test --test circles -- --nocapture`
//! shows those there are.
//!
//! Read as text: every path from `crate::` or `super::` leads to the file of the module it names. A module and
//! its parts count as one house: what a file takes from the module above it is no arrow. Tests are left out.

#[path = "util/source.rs"]
mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use source::rust_files;

/// A cell's folder holds generations, and a generation is of a cell; `ports` offers the ends that observers and
/// tools hold, which are opened as its own are.
const HARMLESS: [&[&str]; 2] = [
    &["shm-types/src/cell.rs", "shm-types/src/generation.rs"],
    &["shm-types/src/observer.rs", "shm-types/src/ports.rs", "shm-types/src/tool.rs"],
];
const CRATES: [&str; 8] = [
    "",
    "shm-types/",
    "physics/",
    "search/",
    "imitation/",
    "learner/",
    "rt-controller/",
    "bridge/",
];

type Module = Vec<String>;

/// `src/a/b.rs` and `src/a/b/mod.rs` are the module a::b.
fn module(inside: &Path) -> Module {
    let whole = inside.with_extension("");
    let names = whole.iter().map(|name| name.to_str().unwrap().to_string());
    names.filter(|name| !["mod", "lib", "main"].contains(&name.as_str())).collect()
}

/// The code without comments and without its tests.
fn code(text: &str) -> String {
    let lines = text.lines().map(|line| line.split("//").next().unwrap());
    let before_tests: Vec<&str> = lines.take_while(|line| *line != "#[cfg(test)]").collect();
    before_tests.join("\n")
}

/// Every path that begins at `at`, groups in braces spread out: `a::{b, c::d}` is a::b and a::c::d.
fn spread(at: &str, so_far: &[String], paths: &mut Vec<Module>) {
    let mut path = so_far.to_vec();
    let mut rest = at;
    loop {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        if end > 0 {
            path.push(rest[..end].to_string());
        }
        match rest[end..].strip_prefix("::") {
            Some(more) if more.starts_with('{') => {
                for part in group(&more[1..]) {
                    spread(part.trim(), &path, paths);
                }
                return;
            }
            Some(more) => rest = more,
            None => {
                paths.push(path);
                return;
            }
        }
    }
}

/// The parts of a group, up to its closing brace.
fn group(text: &str) -> Vec<&str> {
    let (mut depth, mut start, mut parts) = (0, 0, Vec::new());
    for (i, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            ',' if depth == 0 => {
                parts.push(&text[start..i]);
                start = i + 1;
            }
            '}' if depth == 0 => {
                parts.push(&text[start..i]);
                return parts;
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    parts
}

/// Absolute paths of modules and items that the file of `own` names.
fn named(own: &Module, text: &str) -> Vec<Module> {
    let mut found = Vec::new();
    for word in ["crate::", "super::"] {
        for (i, _) in text.match_indices(word) {
            let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            if text[..i].ends_with(is_part) {
                continue;
            }
            let (mut rest, mut from) = match text[i..].strip_prefix("crate::") {
                Some(rest) => (rest, Module::new()),
                None => (&text[i..], own.clone()),
            };
            while let Some(more) = rest.strip_prefix("super::") {
                from.pop();
                rest = more;
            }
            match rest.strip_prefix('{') {
                Some(inner) => {
                    group(inner).iter().for_each(|part| spread(part.trim(), &from, &mut found));
                }
                None => spread(rest, &from, &mut found),
            }
        }
    }
    found
}

/// The file of the module that a path names, the longest part of it that is one.
fn target<'a>(
    path: &[String],
    files: &'a BTreeMap<Module, String>,
) -> Option<(&'a Module, &'a str)> {
    let lengths = (0..=path.len()).rev();
    lengths
        .filter_map(|n| files.get_key_value(&path[..n]))
        .map(|(module, file)| (module, file.as_str()))
        .next()
}

type Arrows = BTreeMap<String, BTreeSet<String>>;

fn arrows(crate_folder: &str, root: &Path) -> Arrows {
    let source = root.join(crate_folder).join("src");
    let mut paths = Vec::new();
    rust_files(&source, &mut paths);
    paths.retain(|path| !path.iter().any(|part| part == "tests") && !path.ends_with("tests.rs"));
    let inside = |path: &PathBuf| path.strip_prefix(&source).unwrap().to_path_buf();
    let name = |path: &PathBuf| format!("{crate_folder}src/{}", inside(path).display());
    let files: BTreeMap<Module, String> =
        paths.iter().map(|path| (module(&inside(path)), name(path))).collect();
    let mut arrows = Arrows::new();
    for path in &paths {
        let own = module(&inside(path));
        let text = code(&fs::read_to_string(path).unwrap());
        let used = named(&own, &text);
        let others = used.iter().filter_map(|path| target(path, &files));
        let others = others.filter(|(module, _)| !own.starts_with(module));
        arrows.insert(name(path), others.map(|(_, file)| file.to_string()).collect());
    }
    arrows
}

fn reached(from: &str, arrows: &Arrows) -> BTreeSet<String> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![from.to_string()]);
    while let Some(file) = open.pop() {
        for next in &arrows[&file] {
            if seen.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    seen
}

/// Groups of files each of which leads to every other.
fn circles(arrows: &Arrows) -> BTreeSet<Vec<String>> {
    let reach: BTreeMap<&String, BTreeSet<String>> =
        arrows.keys().map(|file| (file, reached(file, arrows))).collect();
    let circle = |file: &String| -> Vec<String> {
        let others = reach[file].iter().filter(|other| reach[*other].contains(file));
        others.cloned().collect()
    };
    arrows.keys().map(circle).filter(|circle| circle.len() > 1).collect()
}

#[test]
fn files_have_a_reading_order() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = BTreeSet::new();
    for folder in CRATES {
        let arrows = arrows(folder, root);
        assert!(arrows.values().map(BTreeSet::len).sum::<usize>() > 10, "{folder}: {arrows:?}");
        for circle in circles(&arrows) {
            println!("circle: {}", circle.join(", "));
            for file in &circle {
                let ties = arrows[file].iter().filter(|other| circle.contains(other));
                println!("  {file} -> {}", ties.cloned().collect::<Vec<_>>().join(", "));
            }
            found.insert(circle);
        }
    }
    let harmless =
        HARMLESS.iter().map(|circle| circle.iter().map(|file| file.to_string()).collect());
    assert_eq!(found, harmless.collect());
}

#[test]
fn a_circle_is_seen() {
    let (a, b) = (vec!["a".to_string()], vec!["b".to_string()]);
    let files = BTreeMap::from([(a.clone(), "a.rs".to_string()), (b, "b.rs".into())]);
    let names = named(&a, "use crate::{b::{self, C}, x};\nfn f() { super::b::g() }");
    let leads = |path: &Module| target(path, &files).map(|(_, file)| file);
    assert_eq!(names.iter().filter_map(leads).collect::<Vec<_>>(), ["b.rs"; 3]);
    let arrow = |from: &str, to: &str| (from.to_string(), BTreeSet::from([to.to_string()]));
    let ring = Arrows::from([arrow("a", "b"), arrow("b", "c"), arrow("c", "b")]);
    assert_eq!(circles(&ring), BTreeSet::from([vec!["b".to_string(), "c".into()]]));
}
