//! A centre and its sensors as processes.

use super::start;
use std::io::Write;
use std::net::UdpSocket;
use std::path::Path;
use std::process::Output;

fn key(digit: char) -> String {
    digit.to_string().repeat(64)
}

/// Files of a centre at `place` and of its two sensors; the second has the key `second` at its side.
fn written(folder: &Path, place: &str, second: &str) {
    let centre = format!(
        "listen = \"{place}\"\nperiod = 0.04\nstate = \"centre.state\"\n\
         model = {{ kind = \"random-walk\", density = 0.01 }}\nprior = {{ mean = [0.0], deviation = [10.0] }}\n\
         [[sensor]]\nnumber = 1\nkey = \"{}\"\ndeviation = 0.5\nreport = {{ kind = \"value\" }}\nloss = 0.1\n\
         [[sensor]]\nnumber = 2\nkey = \"{}\"\ndeviation = 0.5\nreport = {{ kind = \"sign\" }}\nloss = 0.1\n",
        key('a'),
        key('b')
    );
    std::fs::write(folder.join("centre.toml"), centre).unwrap();
    for (number, key, kind) in [(1, key('a'), "value"), (2, second.to_owned(), "sign")] {
        let sensor = format!(
            "centre = \"{place}\"\nnumber = {number}\nkey = \"{key}\"\ndeviation = 0.5\n\
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

fn free_place() -> String {
    UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .to_string()
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
    estimates_and_goes_on(&free_place());
}

fn estimates_and_goes_on(place: &str) {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), place, &key('b'));
    // On a busy machine few reports come in time: the centre goes on until there were enough.
    let is_found = |rows: &[(u64, u32, f64)]| {
        let last = rows.last().map_or(f64::NAN, |last| last.2);
        rows.iter().any(|(_, reports, _)| *reports == 2) && (last - 5.1).abs() < 1.0
    };
    let mut runs = (0..20).map(|_| rows(&run(folder.path(), "75")));
    let first = runs.find(|rows| is_found(rows)).unwrap();
    let last = *first.last().unwrap();
    // Started again it writes its last row once more and goes on from it.
    let second = rows(&run(folder.path(), "2"));
    assert_eq!(second[0], last);
    assert!(second[1].0 > last.0 && (second[1].2 - last.2).abs() < 1.0, "{second:?}");
}

#[cfg(feature = "mqtt")]
#[test]
fn fleet_meets_at_a_broker() {
    let place = free_place();
    let (_, port) = place.rsplit_once(':').unwrap();
    // Debian's place is not on everybody's path.
    let path = format!("{}:/usr/sbin:/usr/local/sbin", std::env::var("PATH").unwrap_or_default());
    // Without this the second report of a slot waits 40 ms for the acknowledgement of the first.
    let folder = tempfile::tempdir().unwrap();
    let settings = format!("listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n");
    std::fs::write(folder.path().join("broker.conf"), settings).unwrap();
    let mut command = std::process::Command::new("mosquitto");
    let command = command.args(["-c", "broker.conf"]).current_dir(&folder);
    let command = command.env("PATH", path).stdout(std::process::Stdio::null());
    let Ok(mut broker) = command.stderr(std::process::Stdio::null()).spawn() else {
        println!("skipped: mosquitto is not installed");
        return;
    };
    while std::net::TcpStream::connect(&place).is_err() {
        assert!(broker.try_wait().unwrap().is_none(), "the broker has ended");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let outcome = std::panic::catch_unwind(|| estimates_and_goes_on(&format!("mqtt://{place}/plant/hall")));
    broker.kill().unwrap();
    broker.wait().unwrap();
    outcome.unwrap();
}

#[cfg(feature = "zenoh")]
#[test]
fn fleet_meets_over_zenoh() {
    estimates_and_goes_on(&format!("zenoh://{}/plant", free_place()));
}

#[test]
fn sensor_with_another_key_is_not_heard() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &free_place(), &key('c'));
    let rows = rows(&run(folder.path(), "50"));
    assert!(rows.iter().any(|(_, reports, _)| *reports == 1) && rows.iter().all(|(_, reports, _)| *reports < 2));
}

#[test]
fn configuration_errors_name_file_and_value() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), "127.0.0.1:1", &key('b'));
    let path = folder.path().join("centre.toml");
    let good = std::fs::read_to_string(&path).unwrap();
    for (from, to, said) in [
        ("period = 0.04", "period = 0", "period is 0: expected .001"),
        ("number = 2", "number = 1", "sensor 1 stands twice"),
        ("mean = [0.0]", "mean = [0.0, 1.0]", "expected 1 means"),
        ("kind = \"sign\"", "kind = \"sgin\"", "sgin"),
        (&key('b'), "abcd", "`key` is 2 bytes: expected 32 bytes or more"),
        ("127.0.0.1:1", "coap://127.0.0.1:1/plant", "coap://127.0.0.1:1/plant: expected host:port"),
        #[cfg(feature = "mqtt")]
        ("127.0.0.1:1", "mqtt://127.0.0.1:1", "expected host:port, mqtt://host:port/fleet"),
        #[cfg(not(feature = "mqtt"))]
        ("127.0.0.1:1", "mqtt://127.0.0.1:1/plant", "build it with `--features mqtt`"),
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
