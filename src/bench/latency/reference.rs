//! Reference loops on the same host: an empty loop, and cyclictest.

use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use rt_controller::ControllerConfig;
use rt_controller::rt::{self, Clock};

use crate::bench::Row;
use crate::stderr::say;

/// cyclictest counts what is longer as longer, µs.
const CYCLICTEST_MAX_US: u64 = 20_000;

/// Sleeps to absolute deadlines until `over`, half a period away from the controller's.
pub fn bare_loop(config: &ControllerConfig, over: &AtomicBool, row: &mut Row) {
    let _granted = rt::acquire(config.priority, rt::loop_core(config.cpu));
    let period_ns = config.period_ns();
    let mut clock = Clock::new(period_ns, period_ns / 2, 0);
    let mut missed = 0;
    while !over.load(Ordering::Relaxed) {
        let wake = clock.wait();
        row.add_time(Duration::from_nanos(wake.late_ns));
        missed = wake.missed;
    }
    row.misses = Some(row.misses.unwrap_or(0) + missed);
}

/// Runs cyclictest for `slice` with the loop's period, priority and core; nothing where it is not
/// installed.
pub fn cyclictest(config: &ControllerConfig, slice: Duration, row: &mut Row) -> Result<()> {
    let core = rt::loop_core(config.cpu).to_string();
    let loops = (slice.as_nanos() as u64 / config.period_ns()).max(1).to_string();
    let output = Command::new("cyclictest")
        .args(["--quiet", "--mlockall", "--threads=1", "--affinity", &core])
        .args(["--priority", &config.priority.to_string()])
        .args(["--interval", &config.period_us.to_string(), "--loops", &loops])
        .args(["--histogram", &CYCLICTEST_MAX_US.to_string()])
        .output();
    let output = match output {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            say("skillet: cyclictest is not installed (package rt-tests); its row is left out");
            return Ok(());
        }
        Err(error) => return Err(error).context("starting cyclictest"),
    };
    if !output.status.success() {
        bail!("cyclictest: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    take_in(&String::from_utf8_lossy(&output.stdout), u64::from(config.period_us), row)
}

/// Lines `000023 000145`: so many µs late, so often. Those beyond the histogram come as a sum.
fn take_in(text: &str, period_us: u64, row: &mut Row) -> Result<()> {
    let mut misses = 0;
    let mut take = |us: u64, times: u64| {
        if times > 0 {
            row.add_times(Duration::from_micros(us), times);
            misses += times * (us / period_us);
        }
    };
    for line in text.lines() {
        if let Some(overflows) = line.strip_prefix("# Histogram Overflows:") {
            take(CYCLICTEST_MAX_US, overflows.trim().parse().context("cyclictest: overflows")?);
        }
        let mut numbers = line.split_whitespace().map(str::parse::<u64>);
        if let (Some(Ok(us)), Some(Ok(times)), None) =
            (numbers.next(), numbers.next(), numbers.next())
        {
            take(us, times);
        }
    }
    row.misses = Some(row.misses.unwrap_or(0) + misses);
    if row.n() == 0 {
        bail!("cyclictest: no histogram in what it said: {text}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_histogram_of_cyclictest() {
        let text = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000018 000990\n\
                    002500 000004\n# Total: 000000994\n# Min Latencies: 00018\n\
                    # Histogram Overflows: 00001\n# Histogram Overflow at cycle number:\n";
        let mut row = Row::time("g", "n", "s");
        take_in(text, 1000, &mut row).unwrap();
        assert_eq!((row.n(), row.misses), (995, Some(4 * 2 + 20)));
        assert!((row.quantile(0.5) / 18.0 - 1.0).abs() < 2e-3);
        assert!((row.max() / 20_000.0 - 1.0).abs() < 2e-3);
        assert!(take_in("nothing\n", 1000, &mut Row::time("g", "n", "s")).is_err());
    }
}
