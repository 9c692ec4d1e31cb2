//! A server of a few pages over HTTP/1.1, for a trusted network. Its limits protect the process that it is a part of: connections, their
//! duration before a request, and the length of requests are bounded, and what fails is tried again.

use crate::error::Error;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Largest number of connections at a time. Further ones are closed at once.
const MAX_CONNECTIONS: usize = 64;
/// Largest length of a request in bytes.
const MAX_REQUEST: usize = 8192;
/// Time in which a request must be complete.
const REQUEST_WITHIN: Duration = Duration::from_secs(5);
/// Time in which a client must take a part of the answer.
const WRITE_WITHIN: Duration = Duration::from_secs(10);
/// Pause after a connection could not be accepted.
const PAUSE: Duration = Duration::from_millis(100);
const STACK_BYTES: usize = 1 << 18;

/// An answer to a request.
pub(crate) enum Answer {
    Whole {
        kind: &'static str,
        text: String,
    },
    /// Server-sent events: what is called returns those that are new, and waits for them. An empty list becomes a comment.
    Events(Box<dyn FnMut() -> Vec<Arc<str>>>),
    Missing,
}

impl Answer {
    pub(crate) fn whole(kind: &'static str, text: impl Into<String>) -> Self {
        Self::Whole {
            kind,
            text: text.into(),
        }
    }
}

type Handler = dyn Fn(&str) -> Answer + Send + Sync;

/// A server in threads of its own, which end with the process.
pub(crate) struct Server {
    address: SocketAddr,
}

impl Server {
    /// # Errors
    /// If the address is in use or not an address of this machine.
    pub(crate) fn start(
        address: SocketAddr,
        handler: impl Fn(&str) -> Answer + Send + Sync + 'static,
    ) -> Result<Self, Error> {
        let failed = |source| Error::socket(address, source);
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let handler: Arc<Handler> = Arc::new(handler);
        let accept = move || accept(&listener, &handler);
        let thread = std::thread::Builder::new().stack_size(STACK_BYTES);
        thread.spawn(accept).map_err(failed)?;
        Ok(Self { address })
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }
}

fn accept(listener: &TcpListener, handler: &Arc<Handler>) {
    // One strong count per connection.
    let connections = Arc::new(());
    loop {
        let Ok((stream, _)) = listener.accept() else {
            // Too many open files, for example: they may be closed.
            std::thread::sleep(PAUSE);
            continue;
        };
        if Arc::strong_count(&connections) > MAX_CONNECTIONS {
            continue;
        }
        let (handler, connection) = (handler.clone(), connections.clone());
        let thread = std::thread::Builder::new().stack_size(STACK_BYTES);
        // Without a thread the connection is closed.
        let _ = thread.spawn(move || {
            // An error is that of the client, who has gone.
            let _ = serve(stream, &*handler);
            drop(connection);
        });
    }
}

fn serve(mut stream: TcpStream, handler: &Handler) -> std::io::Result<()> {
    stream.set_write_timeout(Some(WRITE_WITHIN))?;
    let Some(request) = request(&mut stream)? else {
        return Ok(());
    };
    let mut words = request.split(' ');
    let (method, target) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let path = target.split('?').next().unwrap_or_default();
    if method != "GET" {
        return write!(
            stream,
            "HTTP/1.1 405 Method Not Allowed\r\nAllow: GET\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
        );
    }
    match handler(path) {
        Answer::Missing => {
            write!(stream, "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
        }
        Answer::Whole { kind, text } => {
            let length = text.len();
            write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{text}"
            )
        }
        Answer::Events(mut next) => {
            write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-cache\r\nConnection: close\r\n\r\n"
            )?;
            loop {
                let events = next();
                let mut text: String = events.iter().map(|event| format!("data: {event}\n\n")).collect();
                if text.is_empty() {
                    text.push_str(":\n\n");
                }
                stream.write_all(text.as_bytes())?;
            }
        }
    }
}

/// The first line of a request, once the request is complete; `None` if it is too long, too slow, or not text.
fn request(stream: &mut TcpStream) -> std::io::Result<Option<String>> {
    let (start, mut bytes, mut buffer) = (Instant::now(), Vec::new(), [0; 1024]);
    while !bytes.windows(4).any(|end| end == b"\r\n\r\n") {
        let left = REQUEST_WITHIN.saturating_sub(start.elapsed());
        if left.is_zero() || bytes.len() > MAX_REQUEST {
            return Ok(None);
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut buffer)? {
            0 => return Ok(None),
            length => bytes.extend_from_slice(&buffer[..length]),
        }
    }
    let text = String::from_utf8(bytes).ok();
    Ok(text.and_then(|text| Some(text.lines().next()?.to_owned())))
}
