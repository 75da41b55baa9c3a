//! Every check on a good host, and on hosts that differ from it in one thing.

use std::fs;

use tempfile::TempDir;

use super::memory::{CELL_BYTES, Space};
use super::*;

/// A host that is fit for hard real time: file and content.
const GOOD: &[(&str, &str)] = &[
    ("proc/version", "Linux version 6.12.9-rt (a@b) #1 SMP PREEMPT_RT"),
    ("proc/sys/kernel/sched_rt_runtime_us", "-1"),
    ("proc/sys/kernel/sched_rt_period_us", "1000000"),
    ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc"),
    ("proc/self/status", "CapEff:\t0000000000000000\nCpus_allowed_list:\t0-1\n"),
    (
        "proc/self/limits",
        "Max locked memory         unlimited            unlimited            bytes\n\
         Max realtime priority     98                   98\n",
    ),
    ("sys/devices/system/cpu/online", "0-1"),
    ("sys/devices/system/cpu/cpu0/cpufreq/scaling_driver", "intel_pstate"),
    ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance"),
    ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance"),
    ("dev/cpu_dma_latency", ""),
    ("sys/devices/system/cpu/cpu1/cpuidle/state0/name", "POLL"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state0/latency", "0"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state0/disable", "0"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state1/name", "C6"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state1/latency", "133"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state1/disable", "0"),
    ("sys/devices/system/cpu/isolated", "1"),
    ("sys/devices/system/cpu/nohz_full", "1"),
    ("proc/irq/24/smp_affinity_list", "0-1"),
    ("proc/irq/24/effective_affinity_list", "0"),
    ("sys/devices/system/cpu/cpu1/topology/thread_siblings_list", "1"),
    ("proc/meminfo", "MemAvailable: 8000000 kB\nSwapTotal:  0 kB\nSwapFree:  0 kB\n"),
    ("proc/sys/vm/swappiness", "60"),
    (
        "proc/17/task/17/stat",
        "17 (migration/1) S 2 0 0 0 -1 69238848 0 0 0 0 0 0 0 0 -100 0 1 0 0 \
      0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 17 1 99 1 0 0 0",
    ),
    ("proc/cpuinfo", "model name\t: Fixture\nflags\t\t: fpu tsc\n"),
    ("proc/stat", "cpu  90 0 5 900 0 0 0 0 0 0\ncpu0 1 2\n"),
    ("proc/self/cgroup", "0::/user.slice"),
    ("sys/fs/cgroup/user.slice/cpu.max", "max 100000"),
];

/// A host, and what no file says about it.
struct Fixture {
    folder: TempDir,
    attempt: Result<Attempt, String>,
    space: Option<Space>,
}

impl Fixture {
    fn good() -> Fixture {
        let fixture = Fixture {
            folder: tempfile::tempdir().unwrap(),
            attempt: Ok(Attempt { fifo: true, missing: Vec::new() }),
            space: Some(Space { size: 8 * CELL_BYTES, free: 4 * CELL_BYTES }),
        };
        for (file, content) in GOOD {
            fixture.write(file, content);
        }
        fixture
    }

    fn write(&self, file: &str, content: &str) {
        let path = self.folder.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    fn checks(&self) -> Vec<Check> {
        let root = Root(self.folder.path());
        let (attempt, space) = (self.attempt.clone(), self.space);
        examine(&Subject { root, priority: 80, core: 1, attempt, space })
    }

    fn grade(&self, name: &str) -> Grade {
        let checks = self.checks();
        checks.iter().find(|check| check.name == name).expect("a check of this name").verdict
    }
}

/// Content that removes a file of the good host.
const ABSENT: &str = "absent";

/// Check, what to change in the good host, and the grade that follows.
type Case<'a> = (&'a str, &'a [(&'a str, &'a str)], Grade);

#[rustfmt::skip]
const CASES: &[Case] = &[
    ("kernel preemption", &[("proc/version", "#1 SMP PREEMPT_DYNAMIC Debian")], Grade::Fair),
    ("kernel preemption", &[("proc/version", "#1 SMP PREEMPT_DYNAMIC"), ("sys/kernel/debug/sched/preempt", "none (voluntary) full")], Grade::Poor),
    ("kernel preemption", &[("proc/version", "#1 SMP PREEMPT_DYNAMIC"), ("sys/kernel/debug/sched/preempt", "none voluntary (full) lazy")], Grade::Fair),
    ("kernel preemption", &[("proc/version", "#1 SMP PREEMPT_DYNAMIC"), ("proc/cmdline", "quiet preempt=none")], Grade::Poor),
    ("kernel preemption", &[("proc/version", "#1 SMP")], Grade::Poor),
    ("kernel preemption", &[("proc/version", "#1 SMP"), ("sys/kernel/realtime", "1")], Grade::Good),
    ("kernel preemption", &[("proc/version", ABSENT)], Grade::Unknown),
    ("real-time throttling", &[("proc/sys/kernel/sched_rt_runtime_us", "950000")], Grade::Fair),
    ("real-time throttling", &[("proc/sys/kernel/sched_rt_runtime_us", "0")], Grade::Poor),
    ("real-time throttling", &[("proc/sys/kernel/sched_rt_runtime_us", "1000000")], Grade::Good),
    ("real-time throttling", &[("proc/sys/kernel/sched_rt_period_us", ABSENT)], Grade::Unknown),
    ("clock source", &[("sys/devices/system/clocksource/clocksource0/current_clocksource", "kvm-clock")], Grade::Fair),
    ("clock source", &[("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet")], Grade::Poor),
    ("clock source", &[("sys/devices/system/clocksource/clocksource0/current_clocksource", "new")], Grade::Unknown),
    ("priority limit", &[("proc/self/limits", "Max realtime priority     0      0\n")], Grade::Poor),
    ("priority limit", &[("proc/self/limits", "Max realtime priority     79     98\n")], Grade::Poor),
    ("priority limit", &[("proc/self/limits", ABSENT), ("proc/self/status", "CapEff:\t0000000000800000\n")], Grade::Good),
    ("memory lock limit", &[("proc/self/limits", "Max locked memory   8388608   8388608  bytes\n")], Grade::Poor),
    ("memory lock limit", &[("proc/self/limits", "Max locked memory   268435456 8388608  bytes\n")], Grade::Good),
    ("memory lock limit", &[("proc/self/limits", ABSENT), ("proc/self/status", "CapEff:\t0000000000004000\n")], Grade::Good),
    ("cores", &[("sys/devices/system/cpu/online", "0")], Grade::Poor),
    ("cores", &[("sys/devices/system/cpu/online", ABSENT)], Grade::Unknown),
    ("frequency governor", &[("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "schedutil")], Grade::Fair),
    ("frequency governor", &[("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave")], Grade::Fair),
    ("frequency governor", &[("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave"), ("sys/devices/system/cpu/cpu0/cpufreq/scaling_driver", "acpi-cpufreq")], Grade::Poor),
    ("frequency governor", &[("sys/devices/system/cpu/online", "7")], Grade::Unknown),
    ("idle states", &[("dev/cpu_dma_latency", ABSENT)], Grade::Poor),
    ("idle states", &[("dev/cpu_dma_latency", ABSENT), ("sys/devices/system/cpu/cpu1/cpuidle/state1/latency", "50")], Grade::Fair),
    ("idle states", &[("dev/cpu_dma_latency", ABSENT), ("sys/devices/system/cpu/cpu1/cpuidle/state1/disable", "1")], Grade::Good),
    ("isolated core", &[("sys/devices/system/cpu/isolated", "\n")], Grade::Fair),
    ("isolated core", &[("sys/devices/system/cpu/isolated", "0")], Grade::Fair),
    ("interrupts", &[("proc/irq/24/effective_affinity_list", "1")], Grade::Fair),
    ("interrupts", &[("proc/irq/24/effective_affinity_list", "")], Grade::Fair),
    ("interrupts", &[("proc/irq/24/effective_affinity_list", ABSENT), ("proc/irq/24/smp_affinity_list", ABSENT)], Grade::Unknown),
    ("SMT", &[("sys/devices/system/cpu/cpu1/topology/thread_siblings_list", "1,5")], Grade::Fair),
    ("SMT", &[("sys/devices/system/cpu/cpu1/topology/thread_siblings_list", ABSENT)], Grade::Unknown),
    ("memory and swap", &[("proc/meminfo", "MemAvailable: 8000000 kB\nSwapTotal: 900000 kB\nSwapFree: 900000 kB\n")], Grade::Fair),
    ("memory and swap", &[("proc/meminfo", "MemAvailable: 8000000 kB\nSwapTotal: 900000 kB\nSwapFree: 900000 kB\n"), ("proc/sys/vm/swappiness", "1")], Grade::Good),
    ("memory and swap", &[("proc/meminfo", "MemAvailable: 8000000 kB\nSwapTotal: 900000 kB\nSwapFree: 800000 kB\n"), ("proc/sys/vm/swappiness", "1")], Grade::Fair),
    ("memory and swap", &[("proc/meminfo", "MemAvailable: 80000 kB\nSwapTotal: 0 kB\nSwapFree: 0 kB\n")], Grade::Poor),
    ("memory and swap", &[("proc/meminfo", ABSENT)], Grade::Unknown),
    ("other real-time tasks", &[("proc/9/task/9/stat", "9 (a b) c) S 1 9 9 0 -1 4194560 0 0 0 0 0 0 0 0 -81 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 17 1 80 1 0 0 0")], Grade::Fair),
    ("other real-time tasks", &[("proc/9/task/9/stat", "9 (deadline) S 1 9 9 0 -1 4194560 0 0 0 0 0 0 0 0 -101 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 17 1 0 6 0 0 0")], Grade::Fair),
    ("other real-time tasks", &[("proc/9/task/9/stat", "9 (lower) S 1 9 9 0 -1 4194560 0 0 0 0 0 0 0 0 -51 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 17 1 50 1 0 0 0")], Grade::Good),
    ("virtual machine", &[("proc/cpuinfo", "flags\t\t: fpu hypervisor\n")], Grade::Fair),
    ("virtual machine", &[("proc/cpuinfo", "flags\t\t: fpu hypervisor\n"), ("proc/stat", "cpu  90 0 5 900 0 0 0 50 0 0\n")], Grade::Poor),
    ("virtual machine", &[("sys/hypervisor/type", "xen")], Grade::Fair),
    ("virtual machine", &[("proc/cpuinfo", ABSENT)], Grade::Unknown),
    ("CPU quota", &[("sys/fs/cgroup/user.slice/cpu.max", "150000 100000")], Grade::Fair),
    ("CPU quota", &[("sys/fs/cgroup/cpu.max", "150000 100000")], Grade::Fair),
    ("CPU quota", &[("proc/self/cgroup", "4:cpu,cpuacct:/box"), ("sys/fs/cgroup/cpu,cpuacct/box/cpu.rt_runtime_us", "0")], Grade::Poor),
    ("CPU quota", &[("proc/self/cgroup", "4:cpu,cpuacct:/box"), ("sys/fs/cgroup/cpu,cpuacct/cpu.rt_runtime_us", "950000")], Grade::Good),
    ("CPU quota", &[("proc/self/cgroup", "4:cpu:/box"), ("sys/fs/cgroup/cpu/box/cpu.cfs_quota_us", "50000"), ("sys/fs/cgroup/cpu/box/cpu.cfs_period_us", "100000")], Grade::Fair),
    ("CPU quota", &[("proc/self/cgroup", ABSENT)], Grade::Unknown),
    ("allowed cores", &[("proc/self/status", "Cpus_allowed_list:\t0\n")], Grade::Poor),
    ("allowed cores", &[("proc/self/status", "Cpus_allowed_list:\t1\n")], Grade::Poor),
    ("allowed cores", &[("proc/self/status", ABSENT)], Grade::Unknown),
];

#[test]
fn a_good_host_is_good_in_everything() {
    let checks = Fixture::good().checks();
    for check in &checks {
        assert_eq!(check.verdict, Grade::Good, "{}: {}", check.name, check.found);
        assert_eq!(check.fix, None);
    }
    assert_eq!(overall(&checks), Grade::Good);
}

#[test]
fn a_host_that_differs_in_one_thing_gets_the_grade_of_it() {
    for (name, changes, grade) in CASES {
        let host = Fixture::good();
        for (file, content) in *changes {
            match *content {
                ABSENT => fs::remove_file(host.folder.path().join(file)).unwrap(),
                content => host.write(file, content),
            }
        }
        assert_eq!(host.grade(name), *grade, "{name} with {changes:?}");
    }
}

#[test]
fn what_the_attempt_came_to_is_graded() {
    let mut host = Fixture::good();
    let missing = vec!["cores may sleep deeply".to_owned()];
    host.attempt = Ok(Attempt { fifo: true, missing: missing.clone() });
    assert_eq!(host.grade("real time granted"), Grade::Fair);
    host.attempt = Ok(Attempt { fifo: false, missing });
    assert_eq!(host.grade("real time granted"), Grade::Poor);
    host.attempt = Err("no executable".into());
    assert_eq!(host.grade("real time granted"), Grade::Unknown);
}

#[test]
fn shared_memory_is_graded_by_what_a_cell_needs() {
    let mut host = Fixture::good();
    for (free, grade) in
        [(CELL_BYTES - 1, Grade::Poor), (CELL_BYTES, Grade::Fair), (2 * CELL_BYTES, Grade::Good)]
    {
        host.space = Some(Space { size: 4 * CELL_BYTES, free });
        assert_eq!(host.grade("shared memory"), grade, "{free} bytes");
    }
    host.space = None;
    assert_eq!(host.grade("shared memory"), Grade::Poor);
}

#[test]
fn every_check_can_fail_and_then_says_what_to_do() {
    // A host of which nothing can be read, and the cases above.
    let nothing = tempfile::tempdir().unwrap();
    let attempt = Ok(Attempt { fifo: false, missing: vec!["all".into()] });
    let root = Root(nothing.path());
    let blank = examine(&Subject { root, priority: 80, core: 1, attempt, space: None });
    for check in &blank {
        let failed = CASES.iter().any(|(name, _, grade)| {
            *name == check.name && matches!(grade, Grade::Fair | Grade::Poor)
        });
        let has_fix = check.verdict == Grade::Poor && check.fix.is_some();
        assert!(failed || has_fix, "{} is never poor or fair", check.name);
        assert_ne!(check.verdict, Grade::Good, "{} on a host without files", check.name);
        assert_eq!(check.fix.is_some(), !matches!(check.verdict, Grade::Unknown));
    }
    assert_eq!(overall(&blank), Grade::Poor);
}

#[test]
fn the_description_names_what_it_reads() {
    let host = Fixture::good();
    host.write("proc/sys/kernel/osrelease", "6.12.9-rt\n");
    host.write("proc/loadavg", "0.10 0.20 0.30 1/84 10605");
    let found = crate::host::Host::read(Root(host.folder.path()));
    assert_eq!((found.cpu.as_str(), found.cores, found.virtualised), ("Fixture", 2, false));
    assert_eq!((found.kernel.as_str(), found.load_average), ("6.12.9-rt", Some([0.1, 0.2, 0.3])));
    assert_eq!(found.governor.as_deref(), Some("performance"));
}
