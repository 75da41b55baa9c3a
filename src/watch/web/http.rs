//! As much of HTTP/1.1 as the page needs: one bounded request per connection, one response.
//!
//! `httparse` reads the head. Sizes and times are bounded, so that no client can hold a thread or memory.

use std::io::{self, Read, Write};
use std::net::{IpAddr, TcpStream};
use std::time::{Duration, Instant};

const MAX_HEAD: usize = 8192;
const MAX_HEADERS: usize = 64;
/// A command is a short JSON object.
const MAX_BODY: usize = 1024;
/// For the whole request.
const REQUEST: Duration = Duration::from_secs(5);
/// A client that takes no byte for this long is cut off.
pub const WRITE: Duration = Duration::from_secs(5);

/// The page loads nothing from elsewhere, runs no inline script, and cannot be framed: a click on a button
/// cannot be stolen by another site.
const SECURITY: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; \
    connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
    X-Content-Type-Options: nosniff\r\n\
    Referrer-Policy: no-referrer\r\n\
    Cross-Origin-Resource-Policy: same-origin\r\n\
    Cache-Control: no-store\r\n\
    Connection: close\r\n";

/// A request that is answered with an error: status code and a sentence.
pub type Refusal = (u16, String);

/// A complete request.
#[derive(Debug)]
pub struct Request {
    pub method: String,
    pub path: String,
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header, by its name in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        let named = self.headers.iter().find(|(known, _)| known == name);
        named.map(|(_, value)| value.as_str())
    }

    /// Refuses a request that a page of another origin caused: names other than loopback in `Host` are DNS
    /// rebinding, and a foreign `Origin` is a cross-site request.
    pub fn check_origin(&self) -> Result<(), Refusal> {
        let host = self.header("host").unwrap_or_default();
        if !is_loopback(host) {
            return Err((403, format!("host '{host}' is not a loopback address")));
        }
        match self.header("origin") {
            Some(origin) if origin != format!("http://{host}") => {
                Err((403, format!("origin '{origin}' is another site")))
            }
            _ => Ok(()),
        }
    }
}

/// `host` is `localhost` or a loopback address, with any port: a tunnel may change it.
fn is_loopback(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.parse::<u16>().is_ok() => name,
        _ => host,
    };
    let address = name.trim_start_matches('[').trim_end_matches(']');
    name == "localhost" || address.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

/// Reads a request. `Ok(Err(…))` is one to be refused; an error leaves nothing to answer.
pub fn read(stream: &mut TcpStream) -> io::Result<Result<Request, Refusal>> {
    let deadline = Instant::now() + REQUEST;
    let mut bytes = Vec::new();
    let (mut request, start, length) = loop {
        match parse(&bytes) {
            Ok(Some(parsed)) => break parsed,
            Ok(None) if bytes.len() < MAX_HEAD => {}
            Ok(None) => return Ok(Err((431, format!("the head exceeds {MAX_HEAD} bytes")))),
            Err(refusal) => return Ok(Err(refusal)),
        }
        more(stream, &mut bytes, deadline)?;
    };
    if length > MAX_BODY {
        return Ok(Err((413, format!("the body exceeds {MAX_BODY} bytes"))));
    }
    while bytes.len() < start + length {
        more(stream, &mut bytes, deadline)?;
    }
    request.body = bytes[start..start + length].to_vec();
    Ok(Ok(request))
}

fn more(stream: &mut TcpStream, bytes: &mut Vec<u8>, deadline: Instant) -> io::Result<()> {
    let left = deadline.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(io::ErrorKind::TimedOut.into());
    }
    stream.set_read_timeout(Some(left))?;
    let mut buffer = [0; 2048];
    match stream.read(&mut buffer)? {
        0 => Err(io::ErrorKind::UnexpectedEof.into()),
        n => {
            bytes.extend_from_slice(&buffer[..n]);
            Ok(())
        }
    }
}

/// A request without its body, where that begins, and how long it is; `None` of an incomplete head.
fn parse(bytes: &[u8]) -> Result<Option<(Request, usize, usize)>, Refusal> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut head = httparse::Request::new(&mut headers);
    let bad = |what: &str| (400, format!("not a valid request: {what}"));
    let start = match head.parse(bytes) {
        Ok(httparse::Status::Complete(start)) => start,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(error) => return Err(bad(&error.to_string())),
    };
    let mut pairs = Vec::new();
    for header in head.headers.iter() {
        let value = std::str::from_utf8(header.value).map_err(|_| bad("a header is not UTF-8"))?;
        let name = header.name.to_ascii_lowercase();
        if ["host", "content-length"].contains(&name.as_str())
            && pairs.iter().any(|(known, _)| *known == name)
        {
            return Err(bad(&format!("two headers {name}")));
        }
        pairs.push((name, value.to_string()));
    }
    let request = Request {
        method: head.method.unwrap_or_default().into(),
        path: head.path.unwrap_or_default().split('?').next().unwrap_or_default().into(),
        headers: pairs,
        body: Vec::new(),
    };
    if request.header("transfer-encoding").is_some() {
        return Err((411, "send the body with Content-Length".into()));
    }
    let length = match request.header("content-length") {
        None => 0,
        Some(length) => length.parse().map_err(|_| bad("Content-Length"))?,
    };
    Ok(Some((request, start, length)))
}

fn reason(code: u16) -> &'static str {
    match code {
        200 => "OK",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        431 => "Request Header Fields Too Large",
        _ => "Service Unavailable",
    }
}

/// Writes a whole response; `more` are header lines.
pub fn respond(
    stream: &mut TcpStream,
    code: u16,
    media_type: &str,
    more: &str,
    body: &[u8],
) -> io::Result<()> {
    let head = format!(
        "HTTP/1.1 {code} {}\r\nContent-Type: {media_type}\r\nContent-Length: {}\r\n{more}{SECURITY}\r\n",
        reason(code),
        body.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)
}

/// Begins a response that ends with the connection.
pub fn respond_without_end(stream: &mut TcpStream, media_type: &str) -> io::Result<()> {
    let head = format!("HTTP/1.1 200 OK\r\nContent-Type: {media_type}\r\n{SECURITY}\r\n");
    stream.write_all(head.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    const WHOLE: &[u8] =
        b"POST /command?x HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\n\r\n{}";

    #[test]
    fn only_loopback_names_are_answered() {
        for host in ["localhost", "localhost:8766", "127.0.0.1:1", "127.8.9.1", "[::1]:8766"] {
            assert!(is_loopback(host), "{host}");
        }
        for host in ["", "evil.example", "127.0.0.1.evil.example:80", "10.0.0.1:8766", "[::2]:1"] {
            assert!(!is_loopback(host), "{host}");
        }
    }

    #[test]
    fn a_request_is_read_in_pieces_and_ambiguous_ones_are_refused() {
        assert!(parse(&WHOLE[..30]).unwrap().is_none());
        let (request, start, length) = parse(WHOLE).unwrap().unwrap();
        assert_eq!((request.method.as_str(), request.path.as_str()), ("POST", "/command"));
        assert_eq!(
            (request.header("host"), start, length),
            (Some("localhost"), WHOLE.len() - 2, 2)
        );
        for bad in [
            "GET / HTTP/1.1\r\nHost: a\r\nHost: localhost\r\n\r\n",
            "POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
            "POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
            "POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n",
            "\x01\x02\r\n\r\n",
        ] {
            assert!(parse(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    #[test]
    fn no_bytes_are_too_strange() {
        let mut random = ChaCha8Rng::seed_from_u64(24);
        let mut complete = 0;
        for _ in 0..20_000 {
            let mut bytes = WHOLE.to_vec();
            for _ in 0..random.random_range(1..6) {
                let at = random.random_range(0..bytes.len());
                match random.random_range(0..3) {
                    0 => bytes[at] = random.random(),
                    1 => bytes.insert(at, random.random()),
                    _ => drop(bytes.remove(at)),
                }
            }
            if let Ok(Some((_, start, _))) = parse(&bytes) {
                assert!(start <= bytes.len());
                complete += 1;
            }
        }
        assert!(complete > 1000, "only {complete} of them were requests");
    }
}
