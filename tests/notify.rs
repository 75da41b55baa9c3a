//! A service manager that does not read: its socket is full, and no service waits for it.

mod util;

use std::os::unix::net::UnixDatagram;
use std::process::Stdio;

use util::{Bench, Running, eventually};

#[test]
fn services_work_beside_a_manager_that_does_not_read_and_tell_it_later() {
    let bench = Bench::new();
    let path = bench.path("notify");
    let manager = UnixDatagram::bind(&path).unwrap();
    let other = UnixDatagram::unbound().unwrap();
    other.set_nonblocking(true).unwrap();
    while other.send_to(b"X=1", &path).is_ok() {}
    let start = |arguments: &[&str]| {
        let mut command = bench.skillet(arguments);
        command.env("NOTIFY_SOCKET", &path).stdout(Stdio::null()).stderr(Stdio::piped());
        Running::start(&mut command)
    };
    let controller = start(&["controller", "--cell", "c1", "--pace", "max"]);
    let config = bench.write("c.toml", "[learner]\nrollouts = 12\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    let output = learner.wait();
    assert_eq!(output.status.code(), Some(0), "{}", util::stderr(&output));
    assert_eq!(bench.trials("s").len(), 12);
    bench.ok(&["hold", "--cell", "c1"]);

    // What had to wait is told when there is room again.
    manager.set_nonblocking(true).unwrap();
    let mut buffer = [0; 256];
    eventually("readiness", || {
        let n = manager.recv(&mut buffer).ok()?;
        String::from_utf8_lossy(&buffer[..n]).lines().any(|line| line == "READY=1").then_some(())
    });
    while other.send_to(b"X=1", &path).is_ok() {}
    controller.signal("TERM");
    let output = controller.wait();
    assert_eq!(output.status.code(), Some(0), "{}", util::stderr(&output));
}
