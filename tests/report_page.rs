//! The page of a report as a browser shows it: nothing in the console, the flip and the curve above the fold, nothing
//! wider than the screen. Skipped where there is no Chromium.

mod util;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use util::{Bench, text};

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

fn browser() -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    let mut candidates = std::env::split_paths(&folders)
        .flat_map(|folder| BROWSERS.map(|name| folder.join(name)))
        .filter(|path| path.is_file());
    candidates.next()
}

/// Puts the page into a frame of `width` × 900 px, and measures there: where `selectors` end, and how wide the page is.
fn harness(page: &str, width: u32, selectors: &[&str]) -> String {
    let quoted = |text: &str| serde_json::to_string(text).unwrap().replace("</", "<\\/");
    format!(
        "<!DOCTYPE html><body><iframe id=\"f\" style=\"width:{width}px;height:900px;border:0\"></iframe>\
         <pre id=\"result\"></pre><script>\
         const frame = document.getElementById('f');\
         frame.onload = () => {{\
           const inner = frame.contentDocument, found = {{}};\
           for (const s of {selectors}) {{\
             const element = inner.querySelector(s);\
             found[s] = element ? element.getBoundingClientRect().bottom : null;\
           }}\
           found.width = inner.documentElement.scrollWidth;\
           found.moving = inner.getAnimations().length;\
           document.getElementById('result').textContent = 'RESULT' + JSON.stringify(found) + 'END';\
         }};\
         frame.srcdoc = {page};</script></body>",
        selectors = serde_json::to_string(selectors).unwrap(),
        page = quoted(page),
    )
}

/// What the harness measured of a page, and what the browser said in its console.
fn measure(
    browser: &Path,
    bench: &Bench,
    page: &str,
    width: u32,
    selectors: &[&str],
) -> (Value, String) {
    let file = bench.path(&format!("harness-{width}.html"));
    std::fs::write(&file, harness(page, width, selectors)).unwrap();
    let profile = bench.path("profile");
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        .args(["--enable-logging=stderr", "--log-level=0", "--virtual-time-budget=3000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(["--window-size=1600,1100", "--dump-dom"])
        .arg(format!("file://{}", file.display()))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let log = String::from_utf8_lossy(&output.stderr).into_owned();
    let start = dom.rfind("RESULT{").unwrap_or_else(|| panic!("no result: {dom:.2000}\n{log}"));
    let result = dom[start + "RESULT".len()..].split("END").next().unwrap();
    let result = serde_json::from_str(&result.replace("&quot;", "\"").replace("&gt;", ">"));
    let console =
        log.lines().filter(|line| line.contains("CONSOLE")).collect::<Vec<_>>().join("\n");
    (result.unwrap(), console)
}

#[test]
fn the_flip_and_the_curve_are_above_the_fold_and_the_console_is_silent() {
    let Some(browser) = browser() else {
        eprintln!("skipped: no Chromium among {}", BROWSERS.join(", "));
        return;
    };
    let bench = Bench::new();
    bench.ok(&["learn", "pancake", "--seed", "1", "--out", "s", "--rollouts", "12"]);
    bench.ok(&["report", "s"]);
    let page = text(&bench.path("s/report/index.html"));

    let parts = ["#motion svg", "#motion figcaption", "#reward .drawing", "#robustness svg"];
    let (wide, console) = measure(&browser, &bench, &page, 1440, &parts);
    assert_eq!(console, "");
    let bottom = |part: &str| wide[part].as_f64().unwrap_or_else(|| panic!("no {part}: {wide}"));
    assert!(bottom("#motion svg") <= 900.0 && bottom("#reward .drawing") <= 900.0, "{wide}");
    assert!(bottom("#robustness svg") > 900.0, "the measurement can fail: {wide}");
    assert!(wide["moving"].as_u64().unwrap() > 5, "the arm moves: {wide}");

    let (narrow, console) = measure(&browser, &bench, &page, 390, &parts);
    assert_eq!(console, "");
    assert!(narrow["width"].as_f64().unwrap() <= 390.0, "{narrow}");
}

#[test]
fn a_console_message_would_be_noticed() {
    let Some(browser) = browser() else { return };
    let bench = Bench::new();
    let page = "<p>x<script>console.error('noticed')</script>";
    let (_, console) = measure(&browser, &bench, page, 390, &["p"]);
    assert!(console.contains("noticed"), "{console}");
}
