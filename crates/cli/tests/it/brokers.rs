//! Messages of other programs at a stock broker (mosquitto). Says so and passes where it is missing.

use crate::fleet::{free_place, key, measuring, written};
use crate::{Running, start, text};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// A broker at this place; `None` if there is none on this machine.
fn broker(folder: &Path, place: &str) -> Option<Running> {
    let (_, port) = place.rsplit_once(':').unwrap();
    let path = format!("{}:/usr/sbin:/usr/local/sbin", std::env::var("PATH").unwrap_or_default());
    std::fs::write(folder.join("broker.conf"), format!("listener {port} 127.0.0.1\nallow_anonymous true\n")).unwrap();
    let mut command = Command::new("mosquitto");
    let command = command
        .args(["-c", "broker.conf"])
        .current_dir(folder)
        .env("PATH", path);
    let Ok(child) = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn() else {
        println!("skipped: mosquitto is not installed");
        return None;
    };
    let child = Running::new(child);
    while std::net::TcpStream::connect(place).is_err() {
        std::thread::sleep(Duration::from_millis(20));
    }
    Some(child)
}

/// What is published on a topic, by a plain client of version 3.1.1 that is not the library's.
fn published(place: &str, topic: &str) -> impl Iterator<Item = (String, Vec<u8>)> {
    let mut stream = std::net::TcpStream::connect(place).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let connect = [&[0, 4][..], b"MQTT", &[4, 2, 0, 60, 0, 0]].concat();
    let subscribe = [&[0, 1, 0, topic.len() as u8][..], topic.as_bytes(), &[0]].concat();
    for (kind, body) in [(0x10, connect), (0x82, subscribe)] {
        stream.write_all(&[kind, body.len() as u8]).unwrap();
        stream.write_all(&body).unwrap();
    }
    let mut reader = BufReader::new(stream);
    std::iter::from_fn(move || {
        loop {
            let mut read = |count: usize| {
                let mut bytes = vec![0; count];
                std::io::Read::read_exact(&mut reader, &mut bytes).ok().map(|()| bytes)
            };
            let kind = read(1)?[0];
            let (mut length, mut shift) = (0, 0);
            loop {
                let byte = read(1)?[0];
                length |= usize::from(byte & 127) << shift;
                shift += 7;
                if byte < 128 {
                    break;
                }
            }
            let body = read(length)?;
            if kind >> 4 == 3 {
                let end = 2 + usize::from(body[0]) * 256 + usize::from(body[1]);
                return Some((String::from_utf8_lossy(&body[2..end]).into_owned(), body[end..].to_vec()));
            }
        }
    })
}

/// Publishes a message, by a plain client.
fn publish(place: &str, topic: &str, content: &str) {
    let mut stream = std::net::TcpStream::connect(place).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let connect = [&[0, 4][..], b"MQTT", &[4, 2, 0, 60, 0, 0]].concat();
    stream.write_all(&[0x10, connect.len() as u8]).unwrap();
    stream.write_all(&connect).unwrap();
    std::io::Read::read_exact(&mut stream, &mut [0; 4]).unwrap();
    let body = [&[0, topic.len() as u8][..], topic.as_bytes(), content.as_bytes()].concat();
    stream
        .write_all(&[0x30, (body.len() & 127) as u8 | 128, (body.len() >> 7) as u8])
        .unwrap();
    stream.write_all(&body).unwrap();
    stream.write_all(&[0xe0, 0]).unwrap();
}

#[test]
fn home_assistant_discovers_estimate_band_and_sensors() {
    let folder = tempfile::tempdir().unwrap();
    let place = free_place();
    let Some(_broker) = broker(folder.path(), &place) else {
        return;
    };
    written(folder.path(), &free_place(), &key('b'));
    let path = folder.path().join("centre.toml");
    let content = std::fs::read_to_string(&path).unwrap();
    let lines = format!(
        "home_assistant = \"mqtt://{place}/plant\"\ncoordinates = [{{ name = \"level\", unit = \"m\" }}]\n[[sensor]]\nnumber = 1"
    );
    std::fs::write(&path, content.replacen("[[sensor]]\nnumber = 1", &lines, 1)).unwrap();
    let centre = Running::new(start(folder.path(), &["centre", "centre.toml"]));
    let _sensors = measuring(folder.path());
    // The discovery is kept by the broker for those who come later.
    let mut seen = published(&place, "homeassistant/#");
    let configs: Vec<_> = (0..3).map(|_| seen.next().unwrap()).collect();
    let config = |object: &str| {
        let found = configs.iter().find(|(topic, _)| topic.contains(object)).unwrap();
        serde_json::from_slice::<serde_json::Value>(&found.1).unwrap()
    };
    let level = config("coordinate0");
    assert_eq!((&level["name"], &level["unit_of_measurement"]), (&"level".into(), &"m".into()));
    assert!(config("sensor2")["device_class"] == "connectivity");
    let topic = level["state_topic"].as_str().unwrap();
    let state = published(&place, topic)
        .map(|(_, content)| serde_json::from_slice::<serde_json::Value>(&content).unwrap())
        .find(|state| (state["mean0"].as_f64().unwrap() - 5.1).abs() < 1.0)
        .unwrap();
    assert!(state["low0"].as_f64() < state["high0"].as_f64() && state["sensor1"] == "ON");
    drop(centre);
}

#[test]
fn uplinks_are_read_at_the_broker() {
    let folder = tempfile::tempdir().unwrap();
    let place = free_place();
    let Some(_broker) = broker(folder.path(), &place) else {
        return;
    };
    let from = format!("mqtt://{place}/application/+/device/+/event/up");
    let mut receiver =
        Running::new(start(folder.path(), &["receive", "--format", "lorawan", "--mqtt", &from, "--timeout", "60s"]));
    let mut said = BufReader::new(receiver.stderr.take().unwrap()).lines();
    assert!(said.next().unwrap().unwrap().contains("listening at mqtt://"));
    let content = "{\"time\":\"2026-03-01T12:00:00Z\",\"deviceInfo\":{\"devEui\":\"0101010101010101\"},\"fPort\":2,\"data\":\"A2cBEAVnAP8=\"}";
    publish(&place, "application/17c8/device/0101010101010101/event/up", content);
    let mut rows = BufReader::new(receiver.stdout.take().unwrap()).lines();
    let row = rows.nth(1).unwrap().unwrap();
    assert_eq!(row, "2026-03-01T12:00:00Z,0101010101010101/3/temperature,27.2,°C");
}

#[test]
fn a_broker_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let from = format!("mqtt://me:secret@{}/t", free_place());
    let output = start(folder.path(), &["receive", "--format", "lorawan", "--mqtt", &from])
        .wait_with_output()
        .unwrap();
    let said = text(&output.stderr);
    assert!(output.status.code() == Some(2) && !said.contains("secret") && said.contains("127.0.0.1"), "{said}");
}
