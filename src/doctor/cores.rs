//! The cores: how many, how fast, how deep they sleep, and what else happens on the loop's.

use std::fs::OpenOptions;

use super::{Finding, Grade, Subject, good, not_good, unknown};
use crate::host::{self, Root, list};

const CPU: &str = "sys/devices/system/cpu";
/// Ways back from an idle state, µs, that a 1 kHz loop does not notice, and that it can bear.
const SHALLOW_US: i64 = 10;
const BEARABLE_US: i64 = 100;

pub fn count(subject: &Subject) -> Finding {
    match host::online(subject.root).len() {
        0 => unknown("the cores cannot be counted"),
        1 => not_good(
            Grade::Poor,
            "1 online",
            "give the machine a second core: the learner would run in the loop's",
        ),
        n => good(format!("{n} online, the loop on core {}", subject.core)),
    }
}

pub fn governor(subject: &Subject) -> Finding {
    let governors = host::governors(subject.root);
    let driver = subject.root.read(&format!("{CPU}/cpu0/cpufreq/scaling_driver"));
    let driver = driver.unwrap_or_else(|| "unknown driver".into());
    let Some((core, slow)) = governors.iter().find(|(_, name)| name != "performance") else {
        return match governors.len() {
            0 => unknown("no frequency control: firmware or hypervisor decide"),
            _ => good(format!("performance ({driver})")),
        };
    };
    // The two drivers whose `powersave` still raises the frequency under load.
    let scales = driver == "intel_pstate" || driver == "amd-pstate-epp";
    let grade = if slow == "powersave" && !scales { Grade::Poor } else { Grade::Fair };
    let found = format!("{slow} on core {core} ({driver})");
    not_good(grade, found, "sudo cpupower frequency-set -g performance")
}

pub fn idle_states(subject: &Subject) -> Finding {
    if OpenOptions::new().write(true).open(subject.root.path("dev/cpu_dma_latency")).is_ok() {
        return good("the loop keeps cores awake (/dev/cpu_dma_latency)");
    }
    let folder = format!("{CPU}/cpu{}/cpuidle", subject.core);
    let states = subject.root.names(&folder);
    let enabled = states.iter().filter_map(|state| {
        let number = |file: &str| subject.root.number(&format!("{folder}/{state}/{file}"));
        let name = subject.root.read(&format!("{folder}/{state}/name"))?;
        (number("disable") != Some(1)).then_some((number("latency")?, name))
    });
    let Some((latency, name)) = enabled.max() else {
        return unknown("no idle states to see, /dev/cpu_dma_latency not writable");
    };
    let found = format!("{name}, {latency} µs; /dev/cpu_dma_latency not writable");
    let fix = "let this user write it: `echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", \
                MODE=\"0660\"' | sudo tee /etc/udev/rules.d/99-skillet.rules`; or boot with \
                `processor.max_cstate=1`";
    match latency {
        latency if latency <= SHALLOW_US => good(found),
        latency if latency <= BEARABLE_US => not_good(Grade::Fair, found, fix),
        _ => not_good(Grade::Poor, found, fix),
    }
}

pub fn isolated(subject: &Subject) -> Finding {
    let cores = |file: &str| list(&subject.root.read(&format!("{CPU}/{file}")).unwrap_or_default());
    let (isolated, tickless) = (cores("isolated"), cores("nohz_full"));
    let core = subject.core;
    let tick = if tickless.contains(&core) { "without" } else { "with" };
    if isolated.contains(&core) {
        return good(format!("core {core} is isolated, {tick} the scheduler's tick"));
    }
    let found = match isolated.as_slice() {
        [] => format!("core {core} is shared with every task"),
        others => format!("core {core} is shared; isolated are {others:?}"),
    };
    let fix = format!(
        "boot with `isolcpus=managed_irq,domain,{core} nohz_full={core} rcu_nocbs={core}` and set \
         `controller.cpu = {core}`"
    );
    not_good(Grade::Fair, found, fix)
}

pub fn interrupts(subject: &Subject) -> Finding {
    let (root, core) = (subject.root, subject.core);
    let numbers: Vec<String> = root
        .names("proc/irq")
        .into_iter()
        .filter(|name| name.parse::<u32>().is_ok())
        .filter(|irq| !affinity(root, irq).is_empty())
        .collect();
    if numbers.is_empty() {
        return unknown("/proc/irq cannot be read");
    }
    let here = numbers.iter().filter(|irq| affinity(root, irq).contains(&core)).count();
    let found = format!("{here} of {} may come to core {core}", numbers.len());
    if here == 0 {
        return good(found);
    }
    let others: Vec<String> =
        host::online(root).iter().filter(|other| **other != core).map(usize::to_string).collect();
    let fix = format!(
        "for i in /proc/irq/[0-9]*; do echo {} | sudo tee $i/smp_affinity_list; done (and stop \
         irqbalance)",
        others.join(",")
    );
    not_good(Grade::Fair, found, fix)
}

/// Where an interrupt is delivered, as far as the kernel says; else where it may be.
fn affinity(root: Root, irq: &str) -> Vec<usize> {
    let read = |file: &str| root.read(&format!("proc/irq/{irq}/{file}"));
    let effective = read("effective_affinity_list").filter(|text| !text.is_empty());
    list(&effective.or_else(|| read("smp_affinity_list")).unwrap_or_default())
}

pub fn smt(subject: &Subject) -> Finding {
    let core = subject.core;
    let topology = format!("{CPU}/cpu{core}/topology/thread_siblings_list");
    let siblings = list(&subject.root.read(&topology).unwrap_or_default());
    let others: Vec<usize> = siblings.iter().copied().filter(|other| *other != core).collect();
    match (siblings.len(), others.as_slice()) {
        (0, _) => unknown("the threads of the core cannot be read"),
        (_, []) => good(format!("core {core} has one thread")),
        (_, others) => not_good(
            Grade::Fair,
            format!("core {core} shares its execution units with {others:?}"),
            format!("echo off | sudo tee /{CPU}/smt/control"),
        ),
    }
}
