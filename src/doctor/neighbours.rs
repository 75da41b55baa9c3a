//! Other influences: real-time tasks, the hypervisor, the limits of a container.

use super::{Finding, Grade, Subject, good, not_good, unknown};
use crate::host::{self, Root, list};

/// Scheduling policies of the kernel, and the flag of its own threads.
const SCHED_FIFO: u64 = 1;
const SCHED_RR: u64 = 2;
const SCHED_DEADLINE: u64 = 6;
const PF_KTHREAD: u64 = 0x0020_0000;
/// Share of the time since boot that a hypervisor may have taken.
const STOLEN: f64 = 0.01;

pub fn realtime_tasks(subject: &Subject) -> Finding {
    let root = subject.root;
    let is_process = |name: &String| name.parse::<u32>().is_ok();
    let processes: Vec<String> = root.names("proc").into_iter().filter(is_process).collect();
    if processes.is_empty() {
        return unknown("no process can be seen");
    }
    let mut found: Vec<String> = Vec::new();
    for process in processes {
        for task in root.names(&format!("proc/{process}/task")) {
            let stat = root.read(&format!("proc/{process}/task/{task}/stat"));
            let rival = stat.and_then(|stat| rival(&stat, subject.priority));
            found.extend(rival.map(|rival| format!("{rival} (task {task})")));
        }
    }
    let n = found.len();
    if n == 0 {
        return good(format!("none of priority {} or above", subject.priority));
    }
    found.truncate(4);
    let fix = "end them, or give them another core with `taskset -cp CORES TASK`";
    let more =
        if n > found.len() { format!(" and {} more", n - found.len()) } else { String::new() };
    not_good(Grade::Fair, found.join(", ") + &more, fix)
}

/// Name and priority of a task that preempts a loop of `priority`. Threads of the kernel are
/// left out: those above the loop (migration, stop) are meant to be.
fn rival(stat: &str, priority: u8) -> Option<String> {
    let (before, after) = stat.rsplit_once(')')?;
    let name = before.split_once('(')?.1;
    // Field n of proc(5) is entry n − 3: 9 flags, 40 rt_priority, 41 policy.
    let fields: Vec<&str> = after.split_whitespace().collect();
    let number = |field: usize| fields.get(field - 3)?.parse::<u64>().ok();
    let (flags, rank, policy) = (number(9)?, number(40)?, number(41)?);
    if flags & PF_KTHREAD != 0 {
        return None;
    }
    match policy {
        SCHED_DEADLINE => Some(format!("{name}: SCHED_DEADLINE")),
        SCHED_FIFO | SCHED_RR if rank >= u64::from(priority) => {
            Some(format!("{name}: priority {rank}"))
        }
        _ => None,
    }
}

pub fn hypervisor(subject: &Subject) -> Finding {
    if subject.root.read("proc/cpuinfo").is_none() {
        return unknown("/proc/cpuinfo cannot be read");
    }
    if !host::is_virtualised(subject.root) {
        return good("none, bare metal");
    }
    let fix = "run on bare metal; or have the host pin the virtual cores to cores of their own";
    let stolen = stolen(subject.root).unwrap_or(0.0);
    let found = format!("yes; {:.2} % of the time taken by the host since boot", 100.0 * stolen);
    let grade = if stolen > STOLEN { Grade::Poor } else { Grade::Fair };
    not_good(grade, found, fix)
}

/// Share of the time since boot in which a core was ready and the hypervisor ran something else.
fn stolen(root: Root) -> Option<f64> {
    let times = root.value("proc/stat", "cpu")?;
    // user, nice, system, idle, iowait, irq, softirq, steal; guest times are within the first.
    let times: Vec<f64> = times.split(' ').take(8).filter_map(|time| time.parse().ok()).collect();
    let total: f64 = times.iter().sum();
    (times.len() == 8 && total > 0.0).then(|| times[7] / total)
}

pub fn quota(subject: &Subject) -> Finding {
    let root = subject.root;
    let Some(groups) = root.read("proc/self/cgroup") else {
        return unknown("/proc/self/cgroup cannot be read");
    };
    let mut found = Vec::new();
    let mut grade = Grade::Good;
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (parts.next(), parts.next()) else { continue };
        let mount = match controllers {
            "" => "sys/fs/cgroup".to_owned(),
            named if named.split(',').any(|name| name == "cpu") => format!("sys/fs/cgroup/{named}"),
            _ => continue,
        };
        for folder in ancestors(&mount, group) {
            if let Some(limit) = limit(root, &folder) {
                found.push(format!("{limit} in /{folder}"));
                grade = Grade::Fair;
            }
            if root.number(&format!("{folder}/cpu.rt_runtime_us")) == Some(0) {
                found.push(format!("no real-time budget in /{folder}"));
                grade = Grade::Poor;
            }
        }
    }
    match grade {
        Grade::Good => good("none"),
        _ => not_good(
            grade,
            found.join(", "),
            "start the container without `--cpus` and, on cgroup v1, with `--cpu-rt-runtime 950000`",
        ),
    }
}

/// The folder of a group and those above it. A container often sees its own group as the mount.
fn ancestors(mount: &str, group: &str) -> Vec<String> {
    let mut folders = vec![mount.to_owned()];
    for part in group.split('/').filter(|part| !part.is_empty()) {
        folders.push(format!("{}/{part}", folders[folders.len() - 1]));
    }
    folders
}

/// Cores that a group may use up, of cgroup v2 or v1.
fn limit(root: Root, folder: &str) -> Option<String> {
    let text = root.read(&format!("{folder}/cpu.max"));
    let (quota, period): (f64, f64) = match text.as_deref().and_then(|text| text.split_once(' ')) {
        Some((quota, period)) => (quota.parse().ok()?, period.parse().ok()?),
        None => {
            let number = |name: &str| root.number(&format!("{folder}/cpu.cfs_{name}_us"));
            (number("quota")? as f64, number("period")? as f64)
        }
    };
    (quota > 0.0 && period > 0.0).then(|| format!("{:.2} cores", quota / period))
}

pub fn allowed_cores(subject: &Subject) -> Finding {
    let Some(text) = subject.root.value("proc/self/status", "Cpus_allowed_list") else {
        return unknown("/proc/self/status cannot be read");
    };
    let (allowed, core) = (list(&text), subject.core);
    if !allowed.contains(&core) {
        return not_good(
            Grade::Poor,
            format!("cores {text}, the loop's is {core}"),
            "set `controller.cpu` to one of them, or start with another `taskset` or `--cpuset-cpus`",
        );
    }
    if allowed.len() < 2 {
        return not_good(
            Grade::Poor,
            format!("core {text} only"),
            "allow a second core, with `taskset` or `--cpuset-cpus`: the learner needs one",
        );
    }
    good(format!("cores {text}"))
}
