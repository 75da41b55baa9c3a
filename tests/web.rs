//! The browser view: its page, its stream and its buttons, by hand and in a headless Chromium.

mod util;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use rustix::net::{AddressFamily, SocketType, connect, socket, sockopt};
use serde_json::{Value, json};
use util::browser::Browser;
use util::page::{Page, with_body};
use util::{Bench, Running, eventually, rocking};

/// A controller and a learner, with two policies in the catalogue.
fn cell(bench: &Bench) -> [Running; 2] {
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    let config = bench.write("c.toml", "[learner]\nrollouts = 4000\n");
    let learner = ["learner", "--cell", "c1", "--session", "s", "--config"];
    let learner = bench.start(&[&learner[..], &[config.to_str().unwrap()]].concat());
    bench.wait_for_trials("s", 12);
    for amplitude in [0.01, 0.02] {
        let policy = shm_types::policy_json::to_json(&rocking(amplitude)).unwrap();
        let file = bench.write("policy.json", &policy);
        bench.ok(&["policy", "import", file.to_str().unwrap(), "--cell", "c1"]);
    }
    [controller, learner]
}

fn controller(bench: &Bench) -> Running {
    let controller = bench.start(&["controller", "--cell", "c1", "--pace", "max"]);
    eventually("a controller", || {
        (bench.run(&["status", "--cell", "c1"]).status.code() == Some(0)).then_some(())
    });
    controller
}

fn held(bench: &Bench) -> Value {
    let status = bench.run(&["status", "--cell", "c1", "--json"]);
    let status: Value = serde_json::from_slice(&status.stdout).unwrap();
    status["latched_fault"].clone()
}

#[test]
fn the_page_comes_whole_from_the_tool() {
    let bench = Bench::new();
    let _controller = controller(&bench);
    let page = Page::start(&bench, &[]);
    let html = page.get("/");
    assert_eq!(html.code, 200);
    for line in ["frame-ancestors 'none'", "default-src 'none'", "no-store", "nosniff"] {
        assert!(html.head.contains(line), "no {line} in {}", html.head);
    }
    let mut waiting = vec![("".to_string(), html.text())];
    let mut seen = vec!["".to_string()];
    while let Some((from, text)) = waiting.pop() {
        assert!(
            !text.contains("https://") && !text.contains("http://"),
            "/{from} is from elsewhere"
        );
        let after = ["src=\"", "href=\"", "from \"./", "import(\"./"];
        let names = after.iter().flat_map(|mark| text.split(mark).skip(1));
        for name in names.map(|rest| rest.split('"').next().unwrap().to_string()) {
            if seen.contains(&name) || name.starts_with("data:") {
                continue;
            }
            let file = page.get(&format!("/{name}"));
            assert_eq!(file.code, 200, "/{from} names {name}");
            let is_gzip = file.body.starts_with(&[0x1f, 0x8b]);
            assert_eq!(file.head.contains("Content-Encoding: gzip"), is_gzip, "{name}");
            if !name.contains("vendor/") {
                waiting.push((name.clone(), file.text()));
            }
            seen.push(name);
        }
    }
    assert!(seen.iter().any(|name| name == "vendor/three.js") && seen.len() >= 10, "{seen:?}");
    page.interrupt();
}

#[test]
fn another_site_and_another_user_are_refused() {
    let bench = Bench::new();
    let _controller = controller(&bench);
    let page = Page::start(&bench, &["--allow-commands"]);
    let (head, stream, hold) = (page.command_head(), page.stream_request(), r#"{"action":"hold"}"#);
    let (host, token) = (format!("Host: {}", page.address), &page.token);
    let without = |head: &str, name: &str| -> String {
        let kept = head.split_inclusive("\r\n").filter(|line| !line.starts_with(name));
        kept.collect()
    };
    let wrong = token.chars().rev().collect::<String>();
    let long = format!("{{\"action\":\"hold\",\"x\":\"{}\"}}", "x".repeat(2000));
    for (code, request) in [
        (403, with_body(&head.replace(&host, "Host: rebound.example"), hold)),
        (403, stream.replace(&host, "Host: rebound.example")),
        (403, "GET / HTTP/1.1\r\nHost: rebound.example:80\r\n\r\n".into()),
        (403, with_body(&head.replace("Origin: http://", "Origin: http://evil."), hold)),
        (403, with_body(&without(&head, "Host"), hold)),
        (401, with_body(&without(&head, "X-Skillet-Token"), hold)),
        (401, with_body(&head.replace(token, &wrong), hold)),
        (401, with_body(&head.replace(token, ""), hold)),
        (401, without(&stream, "X-Skillet-Token")),
        // What a form of another site can send.
        (415, with_body(&head.replace("application/json", "text/plain"), hold)),
        (413, with_body(&head, &long)),
        (400, with_body(&head, r#"{"action":"stop"}"#)),
        (400, with_body(&head, r#"{"action":"activate"}"#)),
        (400, "nonsense\r\n\r\n".into()),
        (431, format!("GET / HTTP/1.1\r\nX: {}", "x".repeat(9000))),
        (405, format!("PUT / HTTP/1.1\r\n{host}\r\n\r\n")),
        (404, format!("GET /../Cargo.toml HTTP/1.1\r\n{host}\r\n\r\n")),
    ] {
        let answer = page.send(&request);
        let (begin, text) = (request.lines().next().unwrap(), answer.text());
        assert_eq!(answer.code, code, "{begin}: {text}");
    }
    assert_eq!(held(&bench), Value::Null);
    assert_eq!(page.command(hold).code, 200, "the page itself may");
    bench.refused(&["watch", "--cell", "c1", "--web", "0.0.0.0:0"], &["loopback", "tunnel"]);
    bench.refused(&["watch", "--cell", "c1", "--allow-commands"], &["--web"]);
}

#[test]
fn without_leave_the_page_can_hold_and_no_more() {
    let bench = Bench::new();
    let _controller = controller(&bench);
    let page = Page::start(&bench, &[]);
    assert_eq!(page.stream().next("first")["allows_commands"], false);
    let done = page.command(r#"{"action":"hold"}"#);
    assert_eq!((done.code, done.text().as_str()), (200, r#"{"text":"hold: done"}"#));
    assert_eq!(held(&bench), "held by operator");
    for action in ["rearm", "rollback", "pin", "unpin"] {
        let refused = page.command(&json!({ "action": action }).to_string());
        assert_eq!(refused.code, 403);
        assert!(refused.text().contains("--allow-commands"), "{}", refused.text());
    }
    assert_eq!(page.command(r#"{"action":"activate","policy_id":1}"#).code, 403);
    assert_eq!(held(&bench), "held by operator");
    drop(page);
    let page = Page::start(&bench, &["--allow-commands"]);
    // The cause of a hold counts as present for a second.
    eventually("a re-armed arm", || {
        let done = page.command(r#"{"action":"rearm"}"#);
        (done.text() == r#"{"text":"re-arm: done"}"#).then_some(())
    });
    assert_eq!(held(&bench), Value::Null);
    let refused = page.command(r#"{"action":"activate","policy_id":99}"#);
    assert_eq!(refused.code, 409);
    assert!(refused.text().contains("99"), "{}", refused.text());
}

#[test]
fn the_stream_shows_arm_learner_and_policies() {
    let bench = Bench::new();
    let _services = cell(&bench);
    let page = Page::start(&bench, &[]);
    let mut stream = page.stream();
    let first = stream.next("first");
    let frames = first["scene"]["frames"].as_array().unwrap();
    assert_eq!((&first["cell"], frames.len()), (&json!("c1"), 9), "7 joints, pan and pancake");
    assert_eq!(frames[8], json!({ "name": "pancake", "parent": "world" }));
    let bodies = first["scene"]["bodies"].as_array().unwrap();
    assert!(bodies.iter().any(|body| body["id"] == "pan"), "{bodies:?}");
    let pose = stream.next("pose");
    let placed = pose["scene"]["frames"].as_array().unwrap();
    assert_eq!(placed.len(), frames.len());
    for frame in placed {
        let turn: f64 = (3..7).map(|i| frame[i].as_f64().unwrap().powi(2)).sum();
        assert!((turn - 1.0).abs() < 1e-3, "no rotation: {frame}");
    }
    let other = eventually("a movement", || {
        let next = stream.next("pose");
        (next["scene"]["frames"] != pose["scene"]["frames"]).then_some(next)
    });
    assert!(other["scene"]["springs"][0]["spheres"].as_array().unwrap().len() == 2);
    let state = eventually("a learner", || {
        let state = stream.next("state");
        (state["learner"] == "running" && state["rollout"] != 0).then_some(state)
    });
    assert_eq!((&state["controller"], &state["rollouts"]), (&json!("running"), &json!(4000)));
    assert_eq!(state["catalogue"]["policies"], json!([1, 2]));
    assert_eq!(state["status"]["held"], Value::Null);
    let curves = eventually("timing", || {
        let curves = stream.next("curves");
        (!curves["timing"]["at_s"].as_array().unwrap().is_empty()).then_some(curves)
    });
    let (rollout, reward) = (&curves["trials"]["rollout"], &curves["trials"]["reward"]);
    assert_eq!(rollout.as_array().unwrap().len(), reward.as_array().unwrap().len());
    let stored = &bench.trials("s")[0];
    assert_eq!(rollout[0], stored.rollout);
    assert!((reward[0].as_f64().unwrap() - stored.reward).abs() < 1e-4);
}

/// A connection whose kernel takes as little as possible for a reader that does not read.
fn slow(page: &Page) -> TcpStream {
    let address: std::net::SocketAddr = page.address.parse().unwrap();
    let slow = socket(AddressFamily::INET, SocketType::STREAM, None).unwrap();
    sockopt::set_socket_recv_buffer_size(&slow, 2048).unwrap();
    connect(&slow, &address).unwrap();
    let mut slow = TcpStream::from(slow);
    slow.write_all(page.stream_request().as_bytes()).unwrap();
    // It has its place.
    let mut begin = [0; 15];
    slow.read_exact(&mut begin).unwrap();
    assert_eq!(&begin, b"HTTP/1.1 200 OK");
    slow
}

#[test]
fn slow_clients_are_cut_off_and_the_others_see_everything() {
    let bench = Bench::new();
    let _services = cell(&bench);
    let page = Page::start(&bench, &[]);
    let mut good = page.stream();
    assert_eq!(good.status(), "HTTP/1.1 200 OK");
    let mut stuck: Vec<TcpStream> = (0..3).map(|_| slow(&page)).collect();
    assert_eq!(page.stream().status(), "HTTP/1.1 503 Service Unavailable", "4 are open");
    let mut poses = 0;
    let mut fresh = eventually("places that were taken from them", || {
        good.next("pose");
        poses += 1;
        let mut another = page.stream();
        (another.status() == "HTTP/1.1 200 OK").then_some(another)
    });
    fresh.next("pose");
    assert!(poses > 10, "the good one saw {poses} meanwhile");
    // Cut off, not only forgotten: what is left ends.
    let mut rest = Vec::new();
    let one = &mut stuck[0];
    one.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let end = one.read_to_end(&mut rest);
    assert!(end.is_ok() || end.unwrap_err().kind() == std::io::ErrorKind::ConnectionReset);
    good.next("pose");
}

/// Clicks until the answer contains `part`: a re-arm waits for a second after a hold, and a swap is refused while
/// another one blends.
fn click_until(browser: &Browser, clicks: &[&str], part: &str) {
    eventually(part, || {
        clicks.iter().for_each(|button| browser.click(button));
        let said = eventually("an answer", || {
            let said = browser.text("#said");
            (!said.ends_with('…')).then_some(said)
        });
        said.contains(part).then_some(())
    });
}

fn wait_for_poses(browser: &Browser) {
    eventually("poses", || {
        let poses = browser.value("Number(document.getElementById('scene').dataset.poses ?? 0)");
        (poses.as_u64()? > 5).then_some(())
    });
}

/// What the console says, without the software renderer's remarks on its speed.
fn complaints(browser: &Browser) -> Vec<String> {
    let said = browser.console().into_iter();
    said.filter(|message| !message.contains("GL Driver Message")).collect()
}

#[test]
fn a_person_clicks() {
    let bench = Bench::new();
    let Some(browser) = Browser::start(&bench) else { return };
    let _services = cell(&bench);
    let page = Page::start(&bench, &["--allow-commands"]);
    browser.set_window(1440, 900, "light");
    browser.open(&page.link());
    browser.wait_for("#cell", "c1");
    browser.wait_for("#learner", "running");
    wait_for_poses(&browser);
    assert_eq!(browser.value("location.hash"), "", "the token is not in what is copied");
    assert!(browser.drawn_bytes("#scene") > 10_000, "an arm on a floor");
    for plot in ["#reward", "#success", "#timing"] {
        eventually(plot, || (browser.drawn_bytes(plot) > 4000).then_some(()));
    }
    browser.screenshot("1440-light");

    browser.click("#hold");
    browser.wait_for("#said", "hold: done");
    browser.wait_for("#health", "bad");
    browser.wait_for("#policy", "held by operator");
    assert_eq!(held(&bench), "held by operator");
    browser.screenshot("1440-held");
    browser.click("#rearm");
    browser.wait_for("#rearm", "Let the arm move?");
    assert_eq!(held(&bench), "held by operator", "not at the first click");
    browser.wait_for("#rearm", "Re-arm");
    click_until(&browser, &["#rearm", "#rearm"], "re-arm: done");
    assert_eq!(held(&bench), Value::Null);

    for policy in ["1", "2"] {
        browser.value(&format!("document.getElementById('policies').value = '{policy}'"));
        let done = format!("activate {policy}: policy {policy} applied at tick");
        click_until(&browser, &["#activate"], &done);
        browser.wait_for("#policy", &format!("active\n{policy}"));
    }
    browser.click("#pin");
    browser.wait_for("#policy", "2, pinned");
    browser.wait_for("#pin", "Unpin");
    click_until(&browser, &["#rollback", "#rollback"], "policy 1 applied");
    browser.wait_for("#policy", "1, pinned");
    browser.click("#pin");
    browser.wait_for("#said", "unpin: done");
    assert_eq!(complaints(&browser), [""; 0]);

    for (width, height, scheme) in [(1440, 900, "dark"), (390, 844, "light"), (390, 844, "dark")] {
        browser.set_window(width, height, scheme);
        browser.open("about:blank");
        browser.open(&page.link());
        wait_for_poses(&browser);
        let wider = browser.value("document.scrollingElement.scrollWidth - innerWidth");
        assert!(wider.as_i64().unwrap() <= 0, "{width} px: {wider} px too wide");
        browser.screenshot(&format!("{width}-{scheme}"));
        browser.click("#hold");
        browser.wait_for("#said", "hold: done");
        browser.wait_for("#policy", "held by operator");
        browser.value("document.getElementById('rearm').scrollIntoView({block: 'center'})");
        click_until(&browser, &["#rearm", "#rearm"], "re-arm: done");
    }
    assert_eq!(complaints(&browser), [""; 0]);

    page.interrupt();
    browser.wait_for("#banner", "trying again");
    browser.wait_for("#health", "disconnected");
}
