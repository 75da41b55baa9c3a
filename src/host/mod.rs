//! What this host is: the description beside every timing, and where doctor and bench read it.

mod root;

use std::path::Path;

use serde::Serialize;

pub use root::{Root, list};

/// A host and the build that runs on it.
#[derive(Clone, Debug, Serialize)]
pub struct Host {
    pub cpu: String,
    /// Cores that are online.
    pub cores: usize,
    pub kernel: String,
    pub preemption: Preemption,
    /// Frequency governor of the cores; absent where the host controls no frequency.
    pub governor: Option<String>,
    pub clock_source: Option<String>,
    pub virtualised: bool,
    /// Mean number of runnable tasks over 1, 5 and 15 minutes.
    pub load_average: Option<[f64; 3]>,
    /// Profile of this executable.
    pub build: &'static str,
}

/// Who may interrupt the kernel, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Preemption {
    RealTime,
    Full,
    Lazy,
    /// PREEMPT_DYNAMIC in a mode that cannot be read.
    Dynamic,
    Voluntary,
    None,
    Unknown,
}

impl Preemption {
    pub fn describe(self) -> &'static str {
        match self {
            Preemption::RealTime => "PREEMPT_RT",
            Preemption::Full => "full (PREEMPT)",
            Preemption::Lazy => "lazy (PREEMPT_LAZY)",
            Preemption::Dynamic => "PREEMPT_DYNAMIC, mode not readable",
            Preemption::Voluntary => "voluntary",
            Preemption::None => "none or voluntary",
            Preemption::Unknown => "not readable",
        }
    }

    pub fn read(root: Root) -> Preemption {
        let Some(version) = root.read("proc/version") else { return Preemption::Unknown };
        let has = |word: &str| version.split([' ', '\n']).any(|other| other == word);
        if root.number("sys/kernel/realtime") == Some(1) || has("PREEMPT_RT") {
            return Preemption::RealTime;
        }
        if has("PREEMPT_DYNAMIC") {
            return dynamic(root);
        }
        match (has("PREEMPT"), has("PREEMPT_LAZY")) {
            (true, _) => Preemption::Full,
            (_, true) => Preemption::Lazy,
            _ => Preemption::None,
        }
    }
}

/// The mode of a kernel that can change it: in brackets among all, else as the kernel was booted.
fn dynamic(root: Root) -> Preemption {
    let modes = root.read("sys/kernel/debug/sched/preempt").unwrap_or_default();
    let current = modes.split(['(', ')']).nth(1).map(str::to_owned);
    let booted = || {
        let line = root.read("proc/cmdline")?;
        line.split(' ').rev().find_map(|word| Some(word.strip_prefix("preempt=")?.to_owned()))
    };
    match current.or_else(booted).as_deref() {
        Some("full") => Preemption::Full,
        Some("lazy") => Preemption::Lazy,
        Some("voluntary") => Preemption::Voluntary,
        Some("none") => Preemption::None,
        _ => Preemption::Dynamic,
    }
}

impl Host {
    /// The host this process runs on.
    pub fn here() -> Host {
        Host::read(Root(Path::new("/")))
    }

    pub fn read(root: Root) -> Host {
        let cpuinfo = |key: &str| root.value("proc/cpuinfo", key);
        let cpu =
            cpuinfo("model name").or_else(|| cpuinfo("Model")).or_else(|| cpuinfo("Hardware"));
        Host {
            cpu: cpu.unwrap_or_else(|| std::env::consts::ARCH.into()),
            cores: online(root).len(),
            kernel: root.read("proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown".into()),
            preemption: Preemption::read(root),
            governor: governors(root).first().map(|(_, governor)| governor.clone()),
            clock_source: clock_source(root),
            virtualised: is_virtualised(root),
            load_average: load_average(root),
            build: if cfg!(debug_assertions) { "development" } else { "release" },
        }
    }

    /// Every property with its name, for people.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let unknown = || "unknown".to_owned();
        let load = self.load_average.map_or_else(unknown, |[a, b, c]| format!("{a} {b} {c}"));
        vec![
            ("cpu", format!("{}, {} cores", self.cpu, self.cores)),
            ("kernel", format!("{}, preemption {}", self.kernel, self.preemption.describe())),
            ("governor", self.governor.clone().unwrap_or_else(|| "none".into())),
            ("clock source", self.clock_source.clone().unwrap_or_else(unknown)),
            ("virtual", if self.virtualised { "yes" } else { "no" }.into()),
            ("load average", load),
            ("build", self.build.into()),
        ]
    }
}

pub fn online(root: Root) -> Vec<usize> {
    list(&root.read("sys/devices/system/cpu/online").unwrap_or_default())
}

/// Each core whose frequency is controlled, and the governor of its frequency.
pub fn governors(root: Root) -> Vec<(usize, String)> {
    let of_core = |core| {
        let file = format!("sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor");
        Some((core, root.read(&file)?))
    };
    online(root).into_iter().filter_map(of_core).collect()
}

pub fn clock_source(root: Root) -> Option<String> {
    root.read("sys/devices/system/clocksource/clocksource0/current_clocksource")
}

/// A hypervisor is below: it may stop a core whenever it likes.
pub fn is_virtualised(root: Root) -> bool {
    let flags = root.value("proc/cpuinfo", "flags").unwrap_or_default();
    flags.split(' ').any(|flag| flag == "hypervisor") || root.read("sys/hypervisor/type").is_some()
}

fn load_average(root: Root) -> Option<[f64; 3]> {
    let text = root.read("proc/loadavg")?;
    let numbers: Vec<f64> = text.split(' ').take(3).filter_map(|word| word.parse().ok()).collect();
    numbers.try_into().ok()
}
