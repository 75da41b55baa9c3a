//! On a terminal: no escape sequences where they are not understood, no colours where none are wanted.

mod util;

use std::fs::{File, OpenOptions};
use std::io::Read;
use std::os::fd::OwnedFd;
use std::os::unix::fs::OpenOptionsExt;
use std::process::Command;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use util::{Bench, Running, eventually};

/// A terminal, and how the program in it opens its end.
fn terminal() -> (OwnedFd, impl Fn() -> File) {
    let host = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&host).unwrap();
    unlockpt(&host).unwrap();
    let size = Winsize { ws_row: 30, ws_col: 90, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&host, size).unwrap();
    let name = ptsname(&host, Vec::new()).unwrap().into_string().unwrap();
    let open = move || {
        let flags = OpenptFlags::NOCTTY.bits() as i32;
        OpenOptions::new().read(true).write(true).custom_flags(flags).open(&name).unwrap()
    };
    (host, open)
}

/// Starts `skillet <arguments>` on a terminal of its own.
fn start(bench: &Bench, arguments: &[&str], change: impl Fn(&mut Command)) -> (File, Running) {
    let (host, open) = terminal();
    let mut command = bench.skillet(arguments);
    command.stdin(open()).stdout(open()).stderr(open());
    command.env_remove("NO_COLOR");
    change(&mut command);
    (File::from(host), Running::start(&mut command))
}

/// Runs `skillet <arguments>` on a terminal of its own; returns what it showed.
fn on_terminal(bench: &Bench, arguments: &[&str], change: impl Fn(&mut Command)) -> String {
    let (mut host, running) = start(bench, arguments, change);
    let reader = std::thread::spawn(move || {
        let (mut shown, mut some) = (Vec::new(), [0; 4096]);
        // It fails, once nobody has the other end any more.
        while let Ok(n @ 1..) = host.read(&mut some) {
            shown.extend_from_slice(&some[..n]);
        }
        String::from_utf8_lossy(&shown).into_owned()
    });
    running.wait();
    reader.join().unwrap()
}

fn cell() -> (Bench, Running) {
    let bench = Bench::new();
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    eventually("a controller", || {
        bench.run(&["status", "--cell", "c1"]).status.success().then_some(())
    });
    (bench, controller)
}

const COMMANDS: [&str; 9] = [
    "watch --cell c1 --duration-s 1.5",
    "learn pancake --rollouts 11 --out s",
    "learner --cell c1 --session t --config few.toml",
    "record --cell c1 --duration-s 1.2",
    "replay s --all",
    "status --cell c1",
    "policy modes s",
    "status --cell UP",
    "--help",
];

#[test]
fn a_dumb_terminal_gets_no_escape_sequences() {
    let (bench, _controller) = cell();
    bench.write("few.toml", "[learner]\nrollouts = 2\n");
    for command in COMMANDS {
        let arguments: Vec<&str> = command.split(' ').collect();
        let shown = on_terminal(&bench, &arguments, |command| {
            // Build servers and shells set these; some libraries then colour any terminal.
            command.env("TERM", "dumb").env("CI", "true").env("CLICOLOR", "1");
        });
        assert!(!shown.contains('\x1b'), "{command}: {shown:?}");
        assert!(shown.len() > 20, "{command}: {shown:?}");
    }
    let watch: Vec<&str> = COMMANDS[0].split(' ').collect();
    let shown = on_terminal(&bench, &watch, |command| {
        command.env_remove("TERM");
    });
    assert!(!shown.contains('\x1b') && shown.contains("controller running"), "{shown:?}");
}

#[test]
fn the_view_of_a_terminal_that_is_gone_ends() {
    let (bench, _controller) = cell();
    let (mut host, running) = start(&bench, &["watch", "--cell", "c1"], |command| {
        command.env("TERM", "xterm-256color");
    });
    // It has drawn something.
    assert!(host.read(&mut [0; 4096]).unwrap() > 0);
    drop(host);
    running.wait();
}

#[test]
fn no_color_turns_colours_off() {
    let (bench, _controller) = cell();
    bench.write("few.toml", "[learner]\nrollouts = 2\n");
    let plain = |command: &mut Command| {
        command.env("TERM", "xterm-256color").env("NO_COLOR", "1");
    };
    let color = |command: &mut Command| {
        command.env("TERM", "xterm-256color");
    };
    for command in COMMANDS {
        let arguments: Vec<&str> = command.split(' ').collect();
        let shown = on_terminal(&bench, &arguments, plain);
        for (start, _) in shown.match_indices("\x1b[") {
            let sequence: String = shown[start + 2..]
                .chars()
                .take_while(|c| c.is_ascii_digit() || *c == ';')
                .collect();
            let is_style = shown[start + 2 + sequence.len()..].starts_with('m');
            let is_color = sequence
                .split(';')
                .any(|n| n.len() == 2 && "349".contains(&n[..1]) && !n.ends_with('9'));
            assert!(!(is_style && is_color), "{command}: {sequence} in {shown:?}");
        }
    }
    // It is not that there never are any.
    let watch: Vec<&str> = COMMANDS[0].split(' ').collect();
    let shown = on_terminal(&bench, &watch, color);
    assert!(shown.contains("\x1b[?1049h"), "a screen of its own: {shown:?}");
    assert!(shown.contains("\x1b[38;5;"), "{shown:?}");
}
