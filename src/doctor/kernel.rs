//! The kernel: preemption, the real-time budget, and the cost of its clock.

use super::{Finding, Grade, Subject, good, not_good, unknown};
use crate::host::{self, Preemption};

pub fn preemption(subject: &Subject) -> Finding {
    let found = Preemption::read(subject.root);
    let text = found.describe();
    let real_time = "install a PREEMPT_RT kernel: `sudo apt install linux-image-rt-amd64` (Debian), \
                     `sudo pro enable realtime-kernel` (Ubuntu)";
    match found {
        Preemption::RealTime => good(text),
        Preemption::Full | Preemption::Lazy | Preemption::Dynamic => {
            not_good(Grade::Fair, text, real_time)
        }
        Preemption::Voluntary | Preemption::None => not_good(
            Grade::Poor,
            text,
            format!("boot with `preempt=full` where the kernel is PREEMPT_DYNAMIC, or {real_time}"),
        ),
        Preemption::Unknown => unknown("/proc/version cannot be read"),
    }
}

pub fn throttling(subject: &Subject) -> Finding {
    let number = |name: &str| subject.root.number(&format!("proc/sys/kernel/sched_rt_{name}_us"));
    let (Some(runtime), Some(period)) = (number("runtime"), number("period")) else {
        return unknown("/proc/sys/kernel/sched_rt_runtime_us cannot be read");
    };
    if runtime < 0 || runtime >= period {
        return good("off");
    }
    let share = runtime as f64 / period.max(1) as f64;
    // The loop uses a small part of a core; the usual 95 % strike only when it runs wild.
    let grade = if share < 0.5 { Grade::Poor } else { Grade::Fair };
    let found = format!("{:.0} % of {} ms for real-time tasks", 100.0 * share, period / 1000);
    not_good(grade, found, "sudo sysctl kernel.sched_rt_runtime_us=-1")
}

pub fn clock_source(subject: &Subject) -> Finding {
    let Some(source) = host::clock_source(subject.root) else {
        return unknown("no clock source is named");
    };
    let tsc = "boot with `clocksource=tsc tsc=reliable` if the hardware's TSC is stable";
    match source.as_str() {
        "tsc" | "arch_sys_counter" => good(source),
        "hpet" | "acpi_pm" | "jiffies" | "refined-jiffies" => not_good(Grade::Poor, source, tsc),
        "kvm-clock" | "xen" | "hyperv_clocksource_tsc_page" => not_good(Grade::Fair, source, tsc),
        _ => unknown(source),
    }
}
