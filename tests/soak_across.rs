//! A short `skillet soak --hosts`: cells on other hosts, over a bridge and a bad network.
//!
//! It needs root, `ip`, and the feature `bridge`: `cargo test --features bridge --test soak_across`.

mod util;

use serde_json::Value;
use util::Bench;

/// What is missing to run it, if something is.
fn missing() -> Option<&'static str> {
    if !cfg!(feature = "bridge") {
        return Some("the feature bridge");
    }
    if !rustix::process::geteuid().is_root() {
        return Some("root");
    }
    let ip = std::process::Command::new("ip").args(["netns", "list"]).output();
    let has_ip = ip.is_ok_and(|output| output.status.success());
    let has_tun = std::fs::File::open("/dev/net/tun").is_ok();
    match (has_ip, has_tun) {
        (false, _) => Some("`ip netns`"),
        (_, false) => Some("/dev/net/tun"),
        _ => None,
    }
}

#[test]
fn cells_on_other_hosts_lose_nothing_over_a_bad_network() {
    if let Some(missing) = missing() {
        eprintln!("SKIPPED, NOTHING SHOWN: needs {missing}");
        return;
    }
    let bench = Bench::new();
    let arguments = ["soak", "--hosts", "3", "--cells", "3", "--minutes", "0.5", "--rollouts", "8"];
    let network = ["--delay-ms", "20", "--seed", "1", "--json", "--out", "o"];
    let output = bench.run(&[&arguments[..], &network].concat());
    let summary: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", util::stderr(&output)));
    assert_eq!(output.status.code(), Some(0), "{summary:#}");
    assert_eq!(summary["passed"], true);
    // What it says it did, it must have done.
    let kills = summary["kills"].as_object().unwrap().values().filter_map(Value::as_u64);
    assert!(kills.sum::<u64>() > 0, "{summary:#}");
    for what in ["packets", "lost", "duplicated", "reordered"] {
        assert!(summary["network"][what].as_u64() > Some(0), "{what}: {summary:#}");
    }
    let (sessions, episodes) = (summary["sessions"].as_u64().unwrap(), &summary["episodes"]);
    assert!(sessions > 0 && episodes["learnt"] == 8 * sessions, "{summary:#}");
    assert_eq!(episodes["produced"], episodes["learnt"]);
    assert_eq!(summary["replayed"], episodes["learnt"]);
    assert_eq!(episodes["in_spools"], 0);
}

#[test]
fn a_build_without_the_bridge_says_how_to_get_it() {
    if cfg!(feature = "bridge") {
        return;
    }
    let bench = Bench::new();
    bench.refused(&["soak", "--hosts", "3"], &["--hosts", "--features bridge"]);
}
