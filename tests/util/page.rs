//! The page of `skillet watch --web`, and a client that speaks HTTP by hand.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Stdio;

use serde_json::Value;

use super::{Bench, Running, WATCHDOG, eventually, text};

pub struct Page {
    pub address: String,
    pub token: String,
    process: Running,
}

/// Status code, head and body.
pub struct Answer {
    pub code: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

impl Page {
    /// Waits for the link.
    pub fn start(bench: &Bench, arguments: &[&str]) -> Page {
        let watch = ["watch", "--cell", "c1", "--web", "127.0.0.1:0"];
        let mut command = bench.skillet(&[&watch[..], arguments].concat());
        let said = bench.path("page.err");
        command.stdout(Stdio::null()).stderr(File::create(&said).unwrap());
        let process = Running::start(&mut command);
        let (address, token) = eventually("a link", || {
            let said = text(&said);
            let (link, _) = said.split("open http://").nth(1)?.split_once('\n')?;
            let (address, token) = link.split_once("/#token=")?;
            Some((address.to_string(), token.to_string()))
        });
        Page { address, token, process }
    }

    pub fn link(&self) -> String {
        format!("http://{}/#token={}", self.address, self.token)
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        stream
    }

    /// Sends these very bytes, and reads to the end.
    pub fn send(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let split = bytes.windows(4).position(|four| four == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8(bytes[..split].to_vec()).unwrap();
        let code = head.split(' ').nth(1).unwrap().parse().unwrap();
        Answer { code, head, body: bytes[split + 4..].to_vec() }
    }

    pub fn get(&self, path: &str) -> Answer {
        self.send(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.address))
    }

    /// The head of a command by the page itself; tests leave out or replace lines of it.
    pub fn command_head(&self) -> String {
        let (address, token) = (&self.address, &self.token);
        format!(
            "POST /command HTTP/1.1\r\nHost: {address}\r\nOrigin: http://{address}\r\n\
             Content-Type: application/json\r\nX-Skillet-Token: {token}\r\n"
        )
    }

    pub fn command(&self, body: &str) -> Answer {
        self.send(&with_body(&self.command_head(), body))
    }

    pub fn stream_request(&self) -> String {
        let (address, token) = (&self.address, &self.token);
        format!("GET /stream HTTP/1.1\r\nHost: {address}\r\nX-Skillet-Token: {token}\r\n\r\n")
    }

    pub fn stream(&self) -> Lines {
        let mut stream = self.connect();
        stream.write_all(self.stream_request().as_bytes()).unwrap();
        Lines { reader: BufReader::new(stream) }
    }

    /// Ends as at Ctrl-C.
    pub fn interrupt(self) {
        self.process.signal("INT");
        self.process.wait();
    }
}

pub fn with_body(head: &str, body: &str) -> String {
    format!("{head}Content-Length: {}\r\n\r\n{body}", body.len())
}

/// A stream being read.
pub struct Lines {
    reader: BufReader<TcpStream>,
}

impl Lines {
    /// The status line.
    pub fn status(&mut self) -> String {
        let mut line = String::new();
        self.reader.read_line(&mut line).unwrap();
        line.trim().to_string()
    }

    /// The next object of this kind.
    pub fn next(&mut self, kind: &str) -> Value {
        eventually(kind, || {
            let mut line = String::new();
            assert!(self.reader.read_line(&mut line).unwrap() > 0, "the stream has ended");
            let value: Value = serde_json::from_str(&line).ok()?;
            (value["kind"] == kind).then_some(value)
        })
    }
}
