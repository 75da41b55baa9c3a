//! Serves the page, its stream and its commands on loopback.
//!
//! The link contains a random token; the page sends it in a header, which no other site can. Every
//! connection has a thread, and their number is bounded. See docs/adr/0037-browser-view.md.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use serde::Deserialize;
use serde_json::json;
use shm_types::cell::Cell;

use super::assets;
use super::board::{Board, Taken};
use super::http::{self, Refusal, Request, read, respond, respond_without_end};
use crate::stderr::say;
use crate::watch::action::Action;

const MAX_CONNECTIONS: usize = 32;
/// A browser opens six connections to a server at most. Streams in all its tabs leave it two for commands.
const MAX_STREAMS: usize = 4;
/// Poses at most so often, per client.
const FRAME: Duration = Duration::from_millis(33);
/// A line at least so often, so that a closed connection is noticed.
const ALIVE: Duration = Duration::from_secs(1);
/// What waits in the kernel for a slow client: it sees old poses for less than a second.
const SEND_BUFFER: usize = 16 * 1024;
const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";
const LINES: &str = "application/x-ndjson";

/// A command of a button.
#[derive(Debug, Deserialize)]
#[serde(tag = "action", rename_all = "kebab-case", deny_unknown_fields)]
enum Press {
    Hold {},
    Rearm {},
    Activate { policy_id: u64 },
    Rollback {},
    Pin {},
    Unpin {},
}

impl Press {
    fn action(&self) -> Action {
        match self {
            Press::Hold {} => Action::Hold,
            Press::Rearm {} => Action::Rearm,
            Press::Activate { policy_id } => Action::Activate(*policy_id),
            Press::Rollback {} => Action::RollBack,
            Press::Pin {} => Action::Pin,
            Press::Unpin {} => Action::Unpin,
        }
    }
}

/// What all connections share.
pub struct Page {
    pub cell: Cell,
    pub board: Board,
    /// The first line of every stream.
    pub first: String,
    pub allows_commands: bool,
    token: String,
    connections: Arc<AtomicUsize>,
    streams: Arc<AtomicUsize>,
}

/// Counts one more until it is dropped.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(count: &Arc<AtomicUsize>, most: usize) -> Option<Place> {
        if count.fetch_add(1, Ordering::Relaxed) >= most {
            count.fetch_sub(1, Ordering::Relaxed);
            return None;
        }
        Some(Place(count.clone()))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Page {
    pub fn new(cell: &Cell, first: String, allows_commands: bool) -> Result<Page> {
        let mut random = [0_u8; 16];
        let mut source = std::fs::File::open("/dev/urandom")?;
        source.read_exact(&mut random).context("/dev/urandom: cannot draw a token for the page")?;
        Ok(Page {
            cell: cell.clone(),
            board: Board::default(),
            first,
            allows_commands,
            token: random.map(|byte| format!("{byte:02x}")).concat(),
            connections: Arc::default(),
            streams: Arc::default(),
        })
    }

    /// Accepts connections at `address` until the process ends; returns the link to the page.
    pub fn serve(self: &Arc<Page>, address: SocketAddr) -> Result<String> {
        let cannot = || format!("--web {address}: cannot listen there; try another port");
        let listener = TcpListener::bind(address).with_context(cannot)?;
        let bound = listener.local_addr().with_context(cannot)?;
        let page = self.clone();
        let accept = move || {
            for stream in listener.incoming() {
                // Out of descriptors, for example.
                let Ok(stream) = stream else {
                    std::thread::sleep(ALIVE);
                    continue;
                };
                // One too many is closed: it comes again.
                let Some(place) = Place::take(&page.connections, MAX_CONNECTIONS) else { continue };
                let page = page.clone();
                let answer = move || {
                    let _place = place;
                    // So does a client that has gone.
                    let _ = page.answer(stream);
                };
                let _ = std::thread::Builder::new().name("skillet-page".into()).spawn(answer);
            }
        };
        std::thread::Builder::new().name("skillet-web".into()).spawn(accept)?;
        // The fragment of a link is not sent to servers and stays out of logs.
        Ok(format!("http://{bound}/#token={}", self.token))
    }

    fn answer(&self, mut stream: TcpStream) -> io::Result<()> {
        stream.set_write_timeout(Some(http::WRITE))?;
        let answered = match read(&mut stream)? {
            Ok(request) => match self.route(&request, &mut stream) {
                Ok(written) => written,
                Err(refusal) => refuse(&mut stream, refusal),
            },
            Err(refusal) => refuse(&mut stream, refusal),
        };
        answered?;
        // What the client still sends would reset the connection and take the response away.
        stream.shutdown(std::net::Shutdown::Write)?;
        stream.set_read_timeout(Some(Duration::from_millis(200)))?;
        let _ = stream.read(&mut [0; 4096]);
        Ok(())
    }

    /// Answers, or says why not.
    fn route(
        &self,
        request: &Request,
        stream: &mut TcpStream,
    ) -> std::result::Result<io::Result<()>, Refusal> {
        request.check_origin()?;
        match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/stream") => {
                self.check_token(request)?;
                let place = Place::take(&self.streams, MAX_STREAMS);
                let _place = place.ok_or((503, format!("{MAX_STREAMS} pages are open already")))?;
                Ok(self.stream(stream))
            }
            ("POST", "/command") => {
                self.check_token(request)?;
                let text = self.command(request)?;
                let body = json!({ "text": text }).to_string();
                Ok(respond(stream, 200, JSON, "", body.as_bytes()))
            }
            ("GET", path) => {
                let missing = || (404, format!("no {path} here"));
                let asset = assets::find(path.trim_start_matches('/')).ok_or_else(missing)?;
                let more = if asset.is_gzip { "Content-Encoding: gzip\r\n" } else { "" };
                Ok(respond(stream, 200, asset.media_type, more, asset.bytes))
            }
            _ => Err((405, "GET the page, or POST /command".into())),
        }
    }

    fn check_token(&self, request: &Request) -> std::result::Result<(), Refusal> {
        let given = request.header("x-skillet-token").unwrap_or_default().as_bytes();
        let known = self.token.as_bytes();
        // All bytes, so that the time says nothing about the first wrong one.
        let differences = given.iter().zip(known).fold(0, |sum, (a, b)| sum | (a ^ b));
        if given.len() != known.len() || differences != 0 {
            return Err((401, "use the link that `skillet watch --web` has printed".into()));
        }
        Ok(())
    }

    fn command(&self, request: &Request) -> std::result::Result<String, Refusal> {
        if request.header("content-type") != Some(JSON) {
            return Err((415, format!("send {JSON}")));
        }
        let press: Press = serde_json::from_slice(&request.body)
            .map_err(|error| (400, format!("not a command: {error}")))?;
        // The others may set an arm in motion.
        if !self.allows_commands && !matches!(press, Press::Hold {}) {
            let why =
                "this page may only hold: start it with `skillet watch --web --allow-commands`";
            return Err((403, why.into()));
        }
        let done = press.action().carry_out(&self.cell, None);
        say(&format!("page: {}", done.as_ref().unwrap_or_else(|refusal| refusal)));
        done.map_err(|refusal| (409, refusal))
    }

    fn stream(&self, stream: &mut TcpStream) -> io::Result<()> {
        rustix::net::sockopt::set_socket_send_buffer_size(&*stream, SEND_BUFFER)?;
        respond_without_end(stream, LINES)?;
        stream.write_all(self.first.as_bytes())?;
        let mut taken = Taken::default();
        loop {
            let frame = Instant::now();
            let lines = self.board.newer(&mut taken, ALIVE);
            let text = if lines.is_empty() { "\n".into() } else { lines.concat() };
            stream.write_all(text.as_bytes())?;
            std::thread::sleep(FRAME.saturating_sub(frame.elapsed()));
        }
    }
}

fn refuse(stream: &mut TcpStream, (code, why): Refusal) -> io::Result<()> {
    respond(stream, code, TEXT, "", format!("{why}\n").as_bytes())
}
