//! A centre and its sensors as processes.

use std::io::Write;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

fn start(folder: &Path, words: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fewbits"))
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn key(digit: char) -> String {
    digit.to_string().repeat(64)
}

/// Files of a centre at `port` and of its two sensors; the second has `key` at its side.
fn written(folder: &Path, port: u16, second: &str) {
    let centre = format!(
        "listen = \"127.0.0.1:{port}\"\nperiod = 0.04\nstate = \"centre.state\"\n\
         model = {{ kind = \"random-walk\", density = 0.01 }}\nprior = {{ mean = [0.0], deviation = [10.0] }}\n\
         [[sensor]]\nnumber = 1\nkey = \"{}\"\ndeviation = 0.5\nreport = {{ kind = \"value\" }}\nloss = 0.1\n\
         [[sensor]]\nnumber = 2\nkey = \"{}\"\ndeviation = 0.5\nreport = {{ kind = \"sign\" }}\nloss = 0.1\n",
        key('a'),
        key('b')
    );
    std::fs::write(folder.join("centre.toml"), centre).unwrap();
    for (number, key, kind) in [(1, key('a'), "value"), (2, second.to_owned(), "sign")] {
        let sensor = format!(
            "centre = \"127.0.0.1:{port}\"\nnumber = {number}\nkey = \"{key}\"\ndeviation = 0.5\n\
             report = {{ kind = \"{kind}\" }}\nstate = \"sensor{number}.state\"\n"
        );
        std::fs::write(folder.join(format!("sensor{number}.toml")), sensor).unwrap();
    }
}

/// Runs the centre for some slots while both sensors measure 5 and 5.2 in turn.
fn run(folder: &Path, slots: &str) -> Output {
    let centre = start(folder, &["centre", "centre.toml", "--slots", slots]);
    let sensors = ["sensor1.toml", "sensor2.toml"].map(|file| {
        let mut child = start(folder, &["sensor", file]);
        let samples = "value\n".to_owned() + &"5.0\n5.2\n".repeat(400);
        child.stdin.take().unwrap().write_all(samples.as_bytes()).unwrap();
        child
    });
    let output = centre.wait_with_output().unwrap();
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Slot, reports and mean of each row.
fn rows(output: &Output) -> Vec<(u64, u32, f64)> {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("slot,reports,mean0,deviation0"));
    let row = |line: &str| {
        let mut cells = line.split(',');
        let mut next = || cells.next().unwrap();
        (next().parse().unwrap(), next().parse().unwrap(), next().parse().unwrap())
    };
    lines.map(row).collect()
}

#[test]
fn centre_estimates_what_its_sensors_read_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), free_port(), &key('b'));
    let first = rows(&run(folder.path(), "75"));
    assert!(first.iter().any(|(_, reports, _)| *reports == 2), "{first:?}");
    let last = *first.last().unwrap();
    assert!((last.2 - 5.1).abs() < 1.0, "{first:?}");
    // Started again it writes its last row once more and goes on from it.
    let second = rows(&run(folder.path(), "2"));
    assert_eq!(second[0], last);
    assert!(second[1].0 > last.0 && (second[1].2 - last.2).abs() < 1.0, "{second:?}");
}

#[test]
fn sensor_with_another_key_is_not_heard() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), free_port(), &key('c'));
    let rows = rows(&run(folder.path(), "75"));
    assert!(rows.iter().any(|(_, reports, _)| *reports == 1) && rows.iter().all(|(_, reports, _)| *reports < 2));
}

#[test]
fn configuration_errors_name_file_and_value() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), 1, &key('b'));
    let path = folder.path().join("centre.toml");
    let good = std::fs::read_to_string(&path).unwrap();
    for (from, to, said) in [
        ("period = 0.04", "period = 0", "period is 0: expected .001"),
        ("number = 2", "number = 1", "sensor 1 stands twice"),
        ("mean = [0.0]", "mean = [0.0, 1.0]", "expected 1 means"),
        ("kind = \"sign\"", "kind = \"sgin\"", "sgin"),
        (&key('b'), "abcd", "key has 2 bytes: expected 32 or more"),
    ] {
        std::fs::write(&path, good.replace(from, to)).unwrap();
        let output = start(folder.path(), &["centre", "centre.toml"])
            .wait_with_output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(message.contains("centre.toml") && message.contains(said), "{message}");
    }
}
