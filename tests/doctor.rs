//! `skillet doctor` on this host, whatever it is worth, and what a running cell takes of it.

mod util;

use rustix::process::Pid;
use rustix::thread::{CpuSet, sched_getaffinity};
use serde_json::Value;
use shm_types::cell::Cell;
use util::{Bench, eventually, stderr};

#[test]
fn says_in_json_what_it_found() {
    let bench = Bench::new();
    let output = bench.run(&["doctor", "--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let checks = found["checks"].as_array().unwrap();
    assert!(checks.len() >= 15);
    let mut grades = Vec::new();
    for check in checks {
        let verdict = check["verdict"].as_str().unwrap();
        assert!(["good", "fair", "poor", "unknown"].contains(&verdict), "{check}");
        for field in ["name", "found", "why"] {
            assert!(check[field].as_str().is_some_and(|text| !text.is_empty()), "{check}");
        }
        let has_fix = check["fix"].is_string();
        assert!(
            if verdict == "good" { !has_fix } else { has_fix || verdict == "unknown" },
            "{check}"
        );
        grades.push(verdict);
    }
    assert!(found["host"]["cores"].as_u64().unwrap() >= 1);
    assert!(found["host"]["kernel"].is_string() && found["host"]["build"].is_string());
    let poor = grades.contains(&"poor");
    assert_eq!(found["verdict"] == "poor", poor);
    assert_eq!(output.status.code(), Some(i32::from(poor)), "{}", stderr(&output));
}

#[test]
fn prints_a_line_a_check_and_the_verdict() {
    let bench = Bench::new();
    let output = bench.run(&["doctor"]);
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["kernel preemption", "shared memory", "interrupts", "\nverdict: "] {
        assert!(text.contains(part), "no '{part}' in:\n{text}");
    }
    let config = bench.write("bad.toml", "[controller]\npriority = 400\n");
    bench.refused(&["doctor", "--config", config.to_str().unwrap()], &["priority"]);
}

/// The number in the report is enough for what a cell really takes.
#[test]
fn a_cell_needs_no_more_shared_memory_than_doctor_says() {
    let bench = Bench::new();
    let output = bench.run(&["doctor", "--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let checks = found["checks"].as_array().unwrap();
    let check = checks.iter().find(|check| check["name"] == "shared memory").unwrap();
    let words: Vec<&str> = check["found"].as_str().unwrap().split(' ').collect();
    let needs: u64 = words[words.len() - 2].parse().unwrap();

    // Other tests have cells at the same time.
    let cell = format!("room-{}", std::process::id());
    let _controller = bench.start(&["controller", "--cell", &cell, "--pace", "max"]);
    let _learner = bench.start(&["learner", "--cell", &cell, "--session", "s"]);
    bench.wait_for_trials("s", 2);
    let used = eventually("the cell's memory", || {
        let files = Cell::in_dir(&bench.path("run"), &cell).unwrap().traces().into_iter();
        let files = files.filter(|path| path.starts_with("/dev/shm"));
        let used: u64 = files.filter_map(|file| Some(file.metadata().ok()?.len())).sum();
        (used > 0).then_some(used)
    });
    assert!(used <= needs << 20, "{used} bytes in use, {needs} MiB said");
    assert!(used > (needs << 20) / 2, "{needs} MiB is said for {used} bytes");
}

/// What starts or dies beside the loop does so elsewhere.
#[test]
fn the_loop_at_the_wall_clock_has_its_core_to_itself() {
    let bench = Bench::new();
    let controller = bench.start(&["controller", "--cell", "c1"]);
    let learner = bench.start(&["learner", "--cell", "c1", "--session", "s"]);
    bench.wait_for_trials("s", 1);

    let here = cores(std::process::id());
    let (last, others) = match here.split_last() {
        Some((last, [])) => (*last, vec![*last]),
        Some((last, others)) => (*last, others.to_vec()),
        None => panic!("this process runs nowhere"),
    };
    let mut is_loop = Vec::new();
    for (name, cores) in threads(controller.pid()) {
        is_loop.push(name == "skillet-rt");
        let expected = if name == "skillet-rt" { &vec![last] } else { &others };
        assert_eq!(&cores, expected, "{name} of the controller");
    }
    assert_eq!(is_loop.iter().filter(|is_loop| **is_loop).count(), 1, "{is_loop:?}");
    for (name, cores) in threads(learner.pid()) {
        assert_eq!(cores, others, "{name} of the learner");
    }
}

/// Name and cores of every thread of a process.
fn threads(pid: u32) -> Vec<(String, Vec<usize>)> {
    let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).unwrap();
    let thread = |task: std::io::Result<std::fs::DirEntry>| {
        let task = task.unwrap();
        let name = std::fs::read_to_string(task.path().join("comm")).unwrap();
        let id = task.file_name().into_string().unwrap().parse().unwrap();
        (name.trim_end().to_string(), cores(id))
    };
    tasks.map(thread).collect()
}

fn cores(thread: u32) -> Vec<usize> {
    let set = sched_getaffinity(Pid::from_raw(thread as i32)).unwrap();
    (0..CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect()
}
