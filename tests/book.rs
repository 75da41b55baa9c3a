//! The documents are a book: every page is in its contents, every link leads to a page or a heading of it, and the page of
//! measures lists what the tasks measure.

mod util;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use util::Bench;

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")
}

fn read(page: &str) -> String {
    fs::read_to_string(docs().join(page)).unwrap_or_else(|error| panic!("docs/{page}: {error}"))
}

/// Every page, its path from `docs`.
fn pages() -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for folder in ["", "adr/", "upstream/"] {
        for entry in fs::read_dir(docs().join(folder)).unwrap().flatten() {
            let name = format!("{folder}{}", entry.file_name().to_string_lossy());
            if name.ends_with(".md") && name != "SUMMARY.md" {
                found.insert(name);
            }
        }
    }
    found
}

/// The targets of all links and pictures outside of code blocks.
fn links(text: &str) -> Vec<String> {
    let mut in_block = false;
    let mut found = Vec::new();
    for line in text.lines() {
        in_block ^= line.trim_start().starts_with("```");
        if in_block {
            continue;
        }
        for rest in line.split("](").skip(1) {
            let target = rest.split(')').next().expect("there is always a first part");
            found.push(target.to_string());
        }
    }
    found
}

/// How mdBook and the forges name a heading: `## Your own arm` is `your-own-arm`.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut in_block = false;
    let mut found = BTreeSet::new();
    for line in text.lines() {
        in_block ^= line.trim_start().starts_with("```");
        if let Some(heading) = line.strip_prefix('#').filter(|_| !in_block) {
            let heading = heading.trim_start_matches('#').trim().to_lowercase();
            let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            found.insert(kept.map(|c| if c == ' ' { '-' } else { c }).collect());
        }
    }
    found
}

#[test]
fn every_page_is_in_the_contents_once() {
    let mut listed = links(&read("SUMMARY.md"));
    listed.sort();
    let all: Vec<String> = pages().into_iter().collect();
    assert_eq!(listed, all, "docs/SUMMARY.md must list every page of docs once");
}

#[test]
fn every_link_of_a_page_leads_somewhere_in_the_book() {
    let mut followed = 0;
    for page in pages() {
        let text = read(&page);
        for link in links(&text).iter().filter(|link| !link.starts_with("http")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let folder = docs().join(&page).parent().unwrap().to_path_buf();
            let target = if path.is_empty() { docs().join(&page) } else { folder.join(path) };
            let target = target.canonicalize().unwrap_or_else(|_| panic!("{page}: no {link}"));
            let inside = target.starts_with(docs().canonicalize().unwrap());
            assert!(inside && target.is_file(), "{page}: {link} leads out of the book");
            if !anchor.is_empty() {
                let there = anchors(&fs::read_to_string(&target).unwrap());
                assert!(there.contains(anchor), "{page}: {link} has no such heading: {there:?}");
            }
            followed += 1;
        }
    }
    assert!(followed > 60, "only {followed} links followed");
}

/// Name and unit of each row of a table whose first cells are code: `` `a`, `b` `` or `` `a_1` to `a_7` ``.
fn rows(section: &str) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for row in section.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let names: Vec<&str> = cells[1].split('`').skip(1).step_by(2).collect();
        let all: Vec<String> = match (cells[1].contains(" to "), &names[..]) {
            (true, [first, _]) => (1..=7).map(|n| first.replace('1', &n.to_string())).collect(),
            (false, names) => names.iter().map(|name| name.to_string()).collect(),
            _ => panic!("{row}: `first` to `last`"),
        };
        found.extend(all.into_iter().map(|name| (name, cells[2].to_string())));
    }
    found
}

#[test]
fn the_page_of_measures_lists_what_tasks_measure() {
    let page = read("measures.md");
    let sections: BTreeMap<&str, BTreeMap<String, String>> = page
        .split("\n## ")
        .skip(1)
        .map(|section| (section.lines().next().unwrap().trim_matches('`'), rows(section)))
        .collect();
    let of_arm = &sections["Every task with an arm"];
    let listed = Bench::new().json(&["task", "list"]);
    let tasks = listed["tasks"].as_array().unwrap();
    assert_eq!(sections.len(), tasks.len() + 1, "a section for each task");
    for task in tasks {
        let name = task["task"].as_str().unwrap();
        let mut written = sections[name].clone();
        if task["has_arm"] == true {
            written.extend(of_arm.clone());
        }
        let measured: BTreeMap<String, String> =
            serde_json::from_value(task["measures"].clone()).unwrap();
        assert_eq!(written, measured, "docs/measures.md, `{name}`");
    }
}
