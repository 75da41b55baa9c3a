//! A headless Chromium, driven over WebDriver.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{Bench, Running, WATCHDOG, eventually, text};

/// Key of an element's number in WebDriver.
const ELEMENT: &str = "element-6066-11e4-a52e-4f735466cecf";

pub struct Browser {
    port: u16,
    session: String,
    _driver: Running,
}

impl Browser {
    /// `None`, and said aloud, where Chromium or its driver is missing: the test then shows nothing.
    pub fn start(bench: &Bench) -> Option<Browser> {
        let is_there = |program: &str| {
            let found = Command::new(program).arg("--version").output();
            found.is_ok_and(|output| output.status.success())
        };
        if !["chromedriver", "chromium"].into_iter().all(is_there) {
            eprintln!("SKIPPED, NOTHING SHOWN: no chromium with chromedriver here");
            return None;
        }
        let log = bench.path("driver.log");
        let mut driver = Command::new("chromedriver");
        driver.arg("--port=0").stdout(File::create(&log).unwrap()).stderr(Stdio::null());
        // Its temporary files go with the test.
        driver.env("TMPDIR", bench.path(""));
        let driver = Running::start(&mut driver);
        let port = eventually("chromedriver", || {
            let said = text(&log);
            said.split("successfully on port ").nth(1)?.split('.').next()?.parse().ok()
        });
        let profile = format!("--user-data-dir={}", bench.path("profile").display());
        let arguments = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-unsafe-swiftshader",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            &profile,
        ];
        let mut browser = Browser { port, session: String::new(), _driver: driver };
        let options = json!({ "args": arguments, "binary": "/usr/bin/chromium" });
        let capabilities = json!({ "capabilities": { "alwaysMatch": {
            "goog:chromeOptions": options,
            "goog:loggingPrefs": { "browser": "ALL" },
        } } });
        let begun = browser.request("POST", "/session", Some(capabilities));
        browser.session = begun["sessionId"].as_str().unwrap().to_string();
        Some(browser)
    }

    /// Sends a request and returns its value; an error ends the test.
    fn request(&self, method: &str, path: &str, body: Option<Value>) -> Value {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        let body = body.map_or(String::new(), |body| body.to_string());
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\
             Content-Type: application/json\r\nContent-Length: {}\r\n\r\n",
            self.port,
            body.len()
        );
        stream.write_all((head + &body).as_bytes()).unwrap();
        // The driver keeps the connection open.
        let mut reader = BufReader::new(stream);
        let (mut status, mut length) = (String::new(), 0);
        reader.read_line(&mut status).unwrap();
        for line in reader.by_ref().lines().map(Result::unwrap).take_while(|line| !line.is_empty())
        {
            if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
                length = value.trim().parse().unwrap();
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).unwrap();
        let value: Value = serde_json::from_slice(&body).unwrap();
        assert!(status.contains(" 200 "), "{method} {path}: {value}");
        value["value"].clone()
    }

    fn post(&self, path: &str, body: Value) -> Value {
        self.request("POST", &format!("/session/{}{path}", self.session), Some(body))
    }

    pub fn open(&self, link: &str) {
        self.post("/url", json!({ "url": link }));
    }

    /// The value of an expression in the page.
    pub fn value(&self, expression: &str) -> Value {
        let script = format!("return {expression};");
        self.post("/execute/sync", json!({ "script": script, "args": [] }))
    }

    pub fn text(&self, selector: &str) -> String {
        let found = self.value(&format!("document.querySelector('{selector}').innerText"));
        found.as_str().unwrap().to_string()
    }

    /// Waits until the text of an element contains `part`.
    pub fn wait_for(&self, selector: &str, part: &str) {
        let start = Instant::now();
        loop {
            let last = self.text(selector);
            if last.contains(part) {
                return;
            }
            assert!(start.elapsed() < WATCHDOG, "{selector}: no '{part}' in '{last}'");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn element(&self, selector: &str) -> String {
        let found = self.post("/element", json!({ "using": "css selector", "value": selector }));
        found[ELEMENT].as_str().unwrap().to_string()
    }

    /// As with a mouse: what is covered or outside of the window cannot be clicked.
    pub fn click(&self, selector: &str) {
        let element = self.element(selector);
        self.post(&format!("/element/{element}/click"), json!({}));
    }

    /// The size of a screenshot of the element, bytes: little where nothing is drawn.
    pub fn drawn_bytes(&self, selector: &str) -> usize {
        let path =
            format!("/session/{}/element/{}/screenshot", self.session, self.element(selector));
        self.request("GET", &path, None).as_str().unwrap().len() * 3 / 4
    }

    pub fn set_window(&self, width: u32, height: u32, scheme: &str) {
        let metrics = json!({
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false,
        });
        let set = |cmd: &str, params: Value| {
            self.post("/goog/cdp/execute", json!({ "cmd": cmd, "params": params }))
        };
        set("Emulation.setDeviceMetricsOverride", metrics);
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        set("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Keeps a screenshot in the folder $SKILLET_SCREENSHOTS, for a person to look at.
    pub fn screenshot(&self, name: &str) {
        let Some(folder) = std::env::var_os("SKILLET_SCREENSHOTS") else { return };
        let taken = self.request("GET", &format!("/session/{}/screenshot", self.session), None);
        let path = std::path::Path::new(&folder).join(format!("{name}.png.base64"));
        std::fs::write(path, taken.as_str().unwrap()).unwrap();
    }

    /// What the console has said since it was last asked.
    pub fn console(&self) -> Vec<String> {
        let log = self.post("/se/log", json!({ "type": "browser" }));
        let entries = log.as_array().unwrap().iter();
        entries.map(|entry| entry["message"].as_str().unwrap().to_string()).collect()
    }
}

impl Drop for Browser {
    /// The driver ends Chromium; a killed one would leave it.
    fn drop(&mut self) {
        if !self.session.is_empty() && !std::thread::panicking() {
            self.request("DELETE", &format!("/session/{}", self.session), None);
        }
    }
}
