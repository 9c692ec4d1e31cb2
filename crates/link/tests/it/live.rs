//! The live page, as a browser asks for it.

use fewbits_core::{BitString, Observation};
use fewbits_link::{Counts, LivePage, Step};
use fewbits_protocol::SensorHealth;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::Command;
use std::time::Duration;

fn ask(page: &LivePage, path: &str) -> TcpStream {
    let mut stream = TcpStream::connect(page.address()).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: test\r\n\r\n").unwrap();
    stream
}

/// Reads until `text` has come.
fn read_until(stream: &mut TcpStream, text: &str) -> String {
    let (mut all, mut buffer) = (String::new(), [0; 4096]);
    while !all.contains(text) {
        let length = stream.read(&mut buffer).unwrap();
        assert!(length > 0, "ended after {all}");
        all.push_str(&String::from_utf8_lossy(&buffer[..length]));
    }
    all
}

fn page() -> LivePage {
    let page = LivePage::serve(([127, 0, 0, 1], 0).into(), (0..3).collect(), 0.1).unwrap();
    page.with_names(vec!["level (m)".to_owned()])
}

/// A report, a silence and a loss; the second sensor is dead.
fn step(slot: u64) -> Step {
    let observed = [
        Observation::Received(BitString::from_bytes(vec![0x80], 1).unwrap()),
        Observation::Nothing,
        Observation::Lost,
    ];
    let mut step = Step::new(slot, observed.to_vec(), vec![((slot as f64 / 7.0).sin() + 1.5, 0.25)]);
    let (working, excluded) = (0.25, false);
    step.health = [false, true, false]
        .map(|dead| SensorHealth {
            working,
            dead,
            excluded,
        })
        .to_vec();
    step
}

#[test]
fn page_shows_past_and_coming_slots() {
    let page = page();
    page.show(&step(41), Counts::default());
    let html = read_until(&mut ask(&page, "/"), "</html>");
    assert!(html.starts_with("HTTP/1.1 200") && html.contains("viewport"));
    let mut events = ask(&page, "/events");
    let past = read_until(&mut events, "}\n");
    assert!(past.contains("text/event-stream") && past.contains("\"slot\":41"), "{past}");
    assert!(past.contains("\"asked\":[true,true,true]") && past.contains("\"names\":[\"level (m)\"]"), "{past}");
    assert!(past.contains("\"observed\":[1,-1,-2]") && past.contains(",0.25]"), "{past}");
    assert!(past.contains("{\"working\":0.25,\"dead\":true,\"excluded\":false}"), "{past}");
    page.show(&step(42), Counts::default());
    assert!(read_until(&mut events, "}\n").contains("\"slot\":42"));
}

/// As wide as a phone. Says so and passes where Chromium is missing.
#[test]
fn page_is_drawn_by_a_browser() {
    let page = page();
    (0..60).for_each(|slot| page.show(&step(slot), Counts::default()));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/live-page.sh");
    let folder = tempfile::tempdir().unwrap();
    let drawn = Command::new("bash")
        .arg(script)
        .arg(format!("http://{}/", page.address()))
        .arg(folder.path().join("page.png"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&drawn.stdout);
    eprintln!("{said}");
    assert!(drawn.status.success() && (said.starts_with("ok") || said.starts_with("skipped")), "{drawn:?}");
}

#[test]
fn idle_connections_end_nothing_and_make_room() {
    let page = page();
    let folder = tempfile::tempdir().unwrap();
    let store = fewbits_link::Store::new(folder.path().join("state"));
    let idle: Vec<_> = (0..200)
        .filter_map(|_| TcpStream::connect(page.address()).ok())
        .collect();
    assert!(idle.len() > 64);
    // The centre goes on: it stores and shows.
    store.save(&1).unwrap();
    page.show(&step(7), Counts::default());
    // Within the time that a request may take there is room again.
    let start = std::time::Instant::now();
    loop {
        assert!(start.elapsed() < Duration::from_secs(60));
        let mut stream = TcpStream::connect(page.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
        let mut text = String::new();
        let asked = write!(stream, "GET /metrics HTTP/1.1\r\n\r\n").is_ok();
        if asked && stream.read_to_string(&mut text).is_ok() && text.contains("fewbits_slot 7") {
            break;
        }
        std::thread::sleep(Duration::from_millis(200));
    }
    drop(idle);
}

#[test]
fn other_requests_are_refused() {
    let page = page();
    for (request, answer) in [
        ("GET /other HTTP/1.1", "HTTP/1.1 404"),
        ("POST / HTTP/1.1", "HTTP/1.1 405"),
    ] {
        let mut stream = TcpStream::connect(page.address()).unwrap();
        write!(stream, "{request}\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        assert!(text.starts_with(answer), "{text}");
    }
    // One that is too long gets no answer.
    let mut stream = TcpStream::connect(page.address()).unwrap();
    let _ = stream.write_all(&[b'a'; 20_000]);
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert!(rest.is_empty());
}
