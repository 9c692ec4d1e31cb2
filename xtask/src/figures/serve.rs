//! `--serve`: the output directory in a browser.

use crate::Error;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use tiny_http::{Header, Method, Request, Response, StatusCode};

/// Time between two looks whether the user has ended it.
const LOOK: Duration = Duration::from_millis(50);

/// A server of one directory on the loopback interface.
pub(super) struct Server {
    thread: JoinHandle<()>,
}

impl Server {
    /// Serves `folder` on a free port, says where, and opens a browser where there is one.
    ///
    /// # Errors
    /// If no port of the loopback interface can be opened.
    pub(super) fn start(folder: &Path) -> Result<Self, Error> {
        let server = tiny_http::Server::http("127.0.0.1:0").map_err(Error::Serve)?;
        let address = format!("http://{}/index.html", server.server_addr());
        eprintln!("gallery: {address} (Ctrl-C ends)");
        // Without a desktop the address is enough.
        let opener = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
        let _ = std::process::Command::new(opener)
            .arg(&address)
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn();
        let folder = folder.to_owned();
        let thread = std::thread::spawn(move || {
            for request in server.incoming_requests() {
                // A browser that went away needs no answer.
                let _ = answer(request, &folder);
            }
        });
        Ok(Self { thread })
    }

    /// Serves until `stop` is set, by Ctrl-C, or the server ends.
    pub(super) fn wait(self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) && !self.thread.is_finished() {
            std::thread::park_timeout(LOOK);
        }
    }
}

/// The file that a request names; none outside the directory.
fn named(folder: &Path, url: &str) -> Option<PathBuf> {
    let name = url.split(['?', '#']).next()?.trim_start_matches('/');
    let path = Path::new(if name.is_empty() { "index.html" } else { name });
    let inside = path.components().all(|part| matches!(part, Component::Normal(_)));
    inside.then(|| folder.join(path))
}

fn answer(request: Request, folder: &Path) -> std::io::Result<()> {
    let path = named(folder, request.url()).filter(|_| *request.method() == Method::Get);
    let Some(content) = path.as_ref().and_then(|path| std::fs::read(path).ok()) else {
        return request.respond(Response::empty(StatusCode(404)));
    };
    let kind = match path.as_ref().and_then(|path| path.extension()?.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("csv") => "text/csv; charset=utf-8",
        Some("json") => "application/json",
        _ => "text/plain; charset=utf-8",
    };
    let mut response = Response::from_data(content);
    if let Ok(header) = Header::from_bytes("Content-Type", kind) {
        response.add_header(header);
    }
    request.respond(response)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_the_directory_are_named() {
        let folder = Path::new("out");
        assert_eq!(named(folder, "/"), Some(folder.join("index.html")));
        assert_eq!(named(folder, "/dymbo-fig5.svg?x=1"), Some(folder.join("dymbo-fig5.svg")));
        assert_eq!(named(folder, "/../secret"), None);
        assert_eq!(named(folder, "//etc/passwd"), Some(folder.join("etc/passwd")));
    }
}
