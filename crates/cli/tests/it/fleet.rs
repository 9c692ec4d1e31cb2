//! A centre and its sensors as processes.

use super::{Running, fewbits, good, signal, start, text, wait_for};
use crate::numbers::Numbers;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::UdpSocket;
use std::path::Path;
use std::process::ExitStatus;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// Slot, reports, mean.
pub(crate) type Row = (u64, u32, f64);

/// Writes a file that only its owner may read.
fn private(path: &Path, content: &str) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::write(path, content).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).unwrap();
}

pub(crate) fn key(digit: char) -> String {
    digit.to_string().repeat(64)
}

/// Files of a centre at `place` and of its two sensors; the second has the key `second` at its side.
pub(crate) fn written(folder: &Path, place: &str, second: &str) {
    let centre = format!(
        "listen = \"{place}\"\nperiod = 0.04\nstate = \"centre.state\"\n\
         model = {{ kind = \"random-walk\", density = 0.01 }}\nprior = {{ mean = [0.0], deviation = [10.0] }}\n\
         [[sensor]]\nnumber = 1\nkey = \"{}\"\ndeviation = 0.5\nreport = {{ kind = \"value\" }}\nloss = 0.1\n\
         [[sensor]]\nnumber = 2\nkey = \"{}\"\ndeviation = 0.5\nreport = {{ kind = \"sign\" }}\nloss = 0.1\n",
        key('a'),
        key('b')
    );
    private(&folder.join("centre.toml"), &centre);
    for (number, key, kind) in [(1, key('a'), "value"), (2, second.to_owned(), "sign")] {
        let sensor = format!(
            "centre = \"{place}\"\nnumber = {number}\nkey = \"{key}\"\ndeviation = 0.5\n\
             report = {{ kind = \"{kind}\" }}\nstate = \"sensor{number}.state\"\n"
        );
        private(&folder.join(format!("sensor{number}.toml")), &sensor);
    }
}

/// Runs the centre for some slots while both sensors measure 5 and 5.2 in turn.
fn run(folder: &Path, slots: &str) -> Vec<Row> {
    let centre = Running::new(start(folder, &["centre", "centre.toml", "--slots", slots]));
    let sensors = measuring(folder);
    let output = centre.output();
    ended(sensors);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    rows(String::from_utf8(output.stdout).unwrap().lines())
}

/// The slots after which a centre whose event does not come ends by itself: more than a minute.
const MOST_SLOTS: &str = "1800";

/// The same until the rows so far are enough, however many slots that takes on a busy machine.
fn run_until(folder: &Path, is_enough: impl Fn(&[Row]) -> bool) -> Vec<Row> {
    let mut centre = Running::new(start(folder, &["centre", "centre.toml", "--slots", MOST_SLOTS]));
    let sensors = measuring(folder);
    let lines = lines_until(&mut centre, |lines| is_enough(&rows(lines.iter().map(String::as_str))));
    centre.kill().unwrap();
    centre.wait().unwrap();
    ended(sensors);
    rows(lines.iter().map(String::as_str))
}

/// The lines of a process until they are enough; all if they never are.
fn lines_until(process: &mut Running, is_enough: impl Fn(&[String]) -> bool) -> Vec<String> {
    let mut lines = Vec::new();
    for line in BufReader::new(process.stdout.take().unwrap()).lines() {
        lines.push(line.unwrap());
        if is_enough(&lines) {
            break;
        }
    }
    lines
}

/// Rows and words of a centre that is asked to end once they are enough, and how it ended.
fn stopped_after(
    mut centre: Running,
    is_enough: impl Fn(&[String], &[String]) -> bool,
) -> (Vec<String>, Vec<String>, ExitStatus) {
    let (rows, said) = (Arc::default(), Arc::default());
    let readers = [
        follow(centre.stdout.take().unwrap(), &rows),
        follow(centre.stderr.take().unwrap(), &said),
    ];
    wait_for("rows and words", || is_enough(&rows.lock().unwrap(), &said.lock().unwrap()));
    signal(&centre, "-TERM");
    let status = centre.wait().unwrap();
    readers.into_iter().for_each(|reader| reader.join().unwrap());
    let taken = |lines: &Mutex<Vec<String>>| std::mem::take(&mut *lines.lock().unwrap());
    (taken(&rows), taken(&said), status)
}

/// Collects lines while a process writes them.
fn follow(source: impl Read + Send + 'static, lines: &Arc<Mutex<Vec<String>>>) -> JoinHandle<()> {
    let lines = lines.clone();
    std::thread::spawn(move || {
        let written = BufReader::new(source).lines().map_while(Result::ok);
        written.for_each(|line| lines.lock().unwrap().push(line));
    })
}

fn ended(sensors: [Running; 2]) {
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
}

/// Both sensors at work.
pub(crate) fn measuring(folder: &Path) -> [Running; 2] {
    ["sensor1.toml", "sensor2.toml"].map(|file| sensor(folder, file))
}

/// A sensor at work.
pub(crate) fn sensor(folder: &Path, file: &str) -> Running {
    reading(folder, file, "5.0\n5.2\n")
}

/// A sensor that reads these samples again and again.
fn reading(folder: &Path, file: &str, samples: &str) -> Running {
    let mut child = Running::new(start(folder, &["sensor", file]));
    let samples = "value\n".to_owned() + &samples.repeat(1600);
    child.stdin.take().unwrap().write_all(samples.as_bytes()).unwrap();
    child
}

pub(crate) fn free_place() -> String {
    UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .to_string()
}

/// Slot, reports and mean of each row.
pub(crate) fn rows<'a>(mut lines: impl Iterator<Item = &'a str>) -> Vec<Row> {
    assert_eq!(lines.next(), Some("slot,reports,mean0,deviation0,refused,events"));
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
    let is_found = |rows: &[Row]| {
        let both = rows.iter().any(|(_, reports, _)| *reports == 2);
        both && rows.len() >= 75 && rows.last().is_some_and(|last| (last.2 - 5.1).abs() < 1.0)
    };
    let first = run_until(folder.path(), is_found);
    assert!(is_found(&first), "{first:?}");
    // Started again it writes its last row once more and goes on from it. It may have got further than was read.
    let last = *first.last().unwrap();
    let second = run(folder.path(), "2");
    assert!(second[0] == last || second[0].0 > last.0, "{second:?} after {last:?}");
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
    let centre = Running::new(start(folder.path(), &["centre", "centre.toml", "--slots", MOST_SLOTS]));
    let sensors = measuring(folder.path());
    let refused = |line: &String| {
        line.split(',')
            .nth(4)
            .unwrap()
            .parse::<u32>()
            .is_ok_and(|count| count > 0)
    };
    let is_said = |line: &String| line.contains("sensor 2: ") && line.contains("under another key were refused");
    let (lines, said, _) =
        stopped_after(centre, |lines, said| lines.iter().skip(1).any(refused) && said.iter().any(is_said));
    ended(sensors);
    // It is said at the centre, by the sensor's own number, and in the rows.
    assert!(said.iter().any(is_said), "{said:?}");
    assert!(lines.iter().skip(1).any(refused), "{lines:?}");
    let rows = run_until(folder.path(), |rows| rows.len() >= 50 && rows.iter().any(|(_, reports, _)| *reports == 1));
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
        ("127.0.0.1:1", "127.0.0.1", "`127.0.0.1`: expected host:port"),
        ("127.0.0.1:1", "127.0.0.1:99999", "the port at most 65535"),
        ("127.0.0.1:1", "::1:7070", "an IPv6 address in brackets"),
        ("127.0.0.1:1", "coap://127.0.0.1:1/plant", "coap://127.0.0.1:1/plant: expected host:port"),
        #[cfg(feature = "mqtt")]
        ("127.0.0.1:1", "mqtt://127.0.0.1:1", "expected host:port, mqtt://host:port/fleet"),
        #[cfg(not(feature = "mqtt"))]
        ("127.0.0.1:1", "mqtt://127.0.0.1:1/plant", "build it with `--features mqtt`"),
    ] {
        private(&path, &good.replace(from, to));
        let output = start(folder.path(), &["centre", "centre.toml"])
            .wait_with_output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(message.contains("centre.toml") && message.contains(said), "{message}");
    }
}

#[test]
fn all_faults_are_named_at_once_and_no_key_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), "127.0.0.1:1", &key('b'));
    let path = folder.path().join("centre.toml");
    let good = std::fs::read_to_string(&path).unwrap();
    let checked = |content: &str| {
        private(&path, content);
        let output = fewbits(folder.path(), &["check", "centre.toml"], b"");
        (output.status.code(), text(&output.stdout) + &text(&output.stderr))
    };
    let (code, said) = checked(&good);
    assert!(code == Some(0) && said.contains("no fault; 2 sensors"), "{said}");
    let bad = good
        .replace("period = 0.04", "period = -1\nhalt = 3")
        .replace("deviation = [10.0]", "deviation = [-1.0]")
        .replacen("deviation = 0.5", "deviation = -0.5", 1)
        .replacen("loss = 0.1", "loss = 1", 2)
        .replace(&key('b'), &key('a'))
        .replace("kind = \"sign\"", "kind = \"sgin\"");
    let (code, said) = checked(&bad);
    assert_eq!(code, Some(2));
    for fault in [
        "period is -1",
        "`halt` is unknown",
        "prior: a deviation is -1",
        "sensor 1: ",
        "sgin",
    ] {
        assert!(said.contains(fault), "{fault} is not in {said}");
    }
    // One fault of a sensor hides none of another.
    let (_, said) = checked(&good.replace("loss = 0.1", "loss = 1").replace(&key('b'), &key('a')));
    assert!(said.contains("sensor 1: ") && said.contains("sensor 2: ") && said.contains("loss is 1"), "{said}");
    // Nor another of its own.
    let bad = good
        .replace("deviation = 0.5", "deviation = -0.5\nreads = 3")
        .replace("loss = 0.1", "loss = 1")
        .replace(&key('b'), &key('a'));
    let (_, said) = checked(&bad);
    for fault in [
        "sensor 1: deviation is -0.5",
        "sensor 1: loss is 1",
        "sensor 1: reads is 3",
        "sensor 2: loss is 1",
        "sensor 2: its key is that of sensor 1",
    ] {
        assert!(said.contains(fault), "{fault} is not in {said}");
    }
    // A group has its fault once.
    let group =
        good.replace("number = 2", "numbers = \"2-9\"")
            .replacen(&format!("key = \"{}\"", key('b')), "loss = 2", 1);
    let group = group.replacen("report = { kind = \"sign\" }\nloss = 0.1", "report = \"bit\"", 1);
    let (_, said) = checked(&group);
    assert_eq!((said.matches("loss is 2").count(), said.matches("fleet_key_file").count()), (1, 1), "{said}");
    let (_, said) = checked(&group.replace("2-9", "2-200000"));
    assert!(said.contains("at most 100000 numbers in a range"), "{said}");
    let (_, said) = checked(&good.replace(&key('b'), &key('a')));
    assert!(said.contains("sensor 2: its key is that of sensor 1"), "{said}");
    // What is no TOML is named by its line, without the line.
    let (_, said) = checked(&good.replace(&format!("{}\"\ndev", key('b')), &format!("{}\ndev", key('b'))));
    assert!(said.contains("line ") && !said.contains(&key('b')), "{said}");
    let (_, said) = checked(&good.replace("127.0.0.1:1", "mqtt://me:secret@127.0.0.1:1"));
    assert!(said.contains("mqtt://127.0.0.1:1") && !said.contains("secret"), "{said}");
    // A sensor's file is checked as one.
    let checked = |from: &str, to: &str| {
        let path = folder.path().join("sensor1.toml");
        let before = std::fs::read_to_string(&path).unwrap();
        private(&path, &before.replacen(from, to, 1));
        let output = fewbits(folder.path(), &["check", "sensor1.toml"], b"");
        private(&path, &before);
        (output.status.code(), text(&output.stdout) + &text(&output.stderr))
    };
    assert_eq!(checked("number", "number"), (Some(0), "sensor1.toml: no fault; sensor 1\n".to_owned()));
    for (from, to, said) in [
        ("127.0.0.1:1", "127.0.0.1:0", "expected the port at which"),
        ("127.0.0.1:1", "127.0.0.1", "expected host:port"),
        ("deviation = 0.5", "deviation = -1", "deviation is -1"),
        ("kind = \"value\"", "kind = \"valeu\"", "valeu"),
        ("number", "nummer", "nummer"),
    ] {
        let (code, found) = checked(from, to);
        assert!(code == Some(2) && found.contains(said) && !found.contains(&key('a')), "{found}");
    }
    // Others may not read it.
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
    for task in [&["check", "centre.toml"], &["centre", "centre.toml"]] {
        let output = fewbits(folder.path(), task, b"");
        let said = text(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("chmod 600"), "{said}");
    }
}

/// One of three sensors contradicts the others: the rows say so.
#[test]
fn a_sensor_that_contradicts_the_others_is_named() {
    let (folder, place) = (tempfile::tempdir().unwrap(), free_place());
    let mut centre = format!(
        "listen = \"{place}\"\nperiod = 0.04\nmodel = {{ kind = \"random-walk\", density = 0.01 }}\n\
         prior = {{ mean = [0.0], deviation = [10.0] }}\n"
    );
    for (number, digit) in [(1, 'a'), (2, 'b'), (3, 'c')] {
        let same = format!("number = {number}\nkey = \"{}\"\ndeviation = 0.5\nreport = \"value\"\n", key(digit));
        centre += &format!("[[sensor]]\n{same}loss = 0.1\n");
        private(&folder.path().join(format!("sensor{number}.toml")), &format!("centre = \"{place}\"\n{same}"));
    }
    private(&folder.path().join("centre.toml"), &centre);
    let mut centre = Running::new(start(folder.path(), &["centre", "centre.toml", "--slots", "1500"]));
    let file = |number: u32| format!("sensor{number}.toml");
    let sensors = [(1, "5.0\n5.2\n"), (2, "5.1\n4.9\n"), (3, "50.0\n50.2\n")]
        .map(|(number, samples)| reading(folder.path(), &file(number), samples));
    let mut lines = BufReader::new(centre.stdout.take().unwrap())
        .lines()
        .map_while(Result::ok);
    // However many slots that takes on a busy machine.
    let named = lines.find(|line| line.contains("excluded"));
    centre.kill().unwrap();
    centre.wait().unwrap();
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
    assert!(named.as_ref().is_some_and(|line| line.contains("excluded 3")), "{named:?}");
}

/// The words of `track`, keys that follow from the fleet's, and a sensor that is revoked.
#[test]
fn fleet_begins_with_one_command() {
    let folder = tempfile::tempdir().unwrap();
    let init = ["centre", "centre.toml", "--init", "--sensors", "3"];
    let output = fewbits(folder.path(), &init, b"");
    assert!(output.status.success(), "{}", text(&output.stderr));
    for file in ["centre.toml", "fleet.key", "sensor-1.toml", "sensor-3.toml"] {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(folder.path().join(file))
            .unwrap()
            .permissions()
            .mode();
        assert_eq!(mode & 0o777, 0o600, "{file}");
    }
    assert_eq!(fewbits(folder.path(), &init, b"").status.code(), Some(2));
    assert!(fewbits(folder.path(), &["check", "centre.toml"], b"").status.success());
    let place = free_place();
    let path = folder.path().join("centre.toml");
    let template = std::fs::read_to_string(&path).unwrap();
    let content = template
        .replace("0.0.0.0:7070", &place)
        .replace("period = 1.0", "period = 0.04")
        .replace("revoked = []", "revoked = [2]");
    private(&path, &content);
    let printed = fewbits(folder.path(), &["centre", "centre.toml", "--sensor-file", "3"], b"");
    private(&folder.path().join("sensor-3.toml"), &text(&printed.stdout));
    let sensors = ["sensor-1.toml", "sensor-2.toml", "sensor-3.toml"].map(|file| {
        let path = folder.path().join(file);
        let sensor = std::fs::read_to_string(&path)
            .unwrap()
            .replace("192.168.1.5:7070", &place);
        private(&path, &sensor);
        let mut child = Running::new(start(folder.path(), &["sensor", file]));
        child
            .stdin
            .take()
            .unwrap()
            .write_all("5.0\n5.2\n".repeat(1600).as_bytes())
            .unwrap();
        child
    });
    let words = ["centre", "centre.toml", "--slots", MOST_SLOTS, "--json"];
    let centre = Running::new(start(folder.path(), &words));
    let parsed = |line: &String| serde_json::from_str::<serde_json::Value>(line).unwrap();
    let both = |row: &serde_json::Value| row["reports"] == 2;
    let (rows, said, status) = stopped_after(centre, |rows, said| {
        let unknown = said.iter().any(|line| line.contains("unknown or revoked"));
        unknown && rows.iter().map(parsed).any(|row| both(&row))
    });
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
    assert!(status.success(), "{said:?}");
    let rows: Vec<serde_json::Value> = rows.iter().map(parsed).collect();
    assert!(rows.iter().any(both) && rows.iter().all(|row| row["sensors"][1]["number"] == 3));
    let summary = parsed(said.last().unwrap());
    assert!(summary["envelopes"]["unknown"].as_u64().unwrap() > 0, "{said:?}");
}

/// What `fit` found of a table is what a centre supposes of its sensors: gains, offsets of either sign, and a switch.
#[test]
fn centre_takes_what_fit_found() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(11);
    let (mut level, mut table) = (20.0, "time,right,other,falling,switch\n".to_owned());
    for row in 0..300 {
        level += 0.5 * numbers.normal() - 0.05 * (level - 20.0);
        let mut noise = |size: f64| size * numbers.normal();
        let (right, other, falling) =
            (level + noise(0.1), 1.2 * level - 3.0 + noise(0.2), 100.0 - 2.0 * level + noise(0.4));
        table += &format!("{row},{right:.3},{other:.3},{falling:.3},{}\n", u8::from(level + noise(0.1) > 19.0));
    }
    std::fs::create_dir(folder.path().join("fleet")).unwrap();
    let fit = "fit - --reference right --bits switch --find gain,time-constant -o fleet/found.json";
    good(folder.path(), &fit.split(' ').collect::<Vec<_>>(), table.as_bytes());
    let init = "centre fleet/centre.toml --init --settings fleet/found.json";
    good(folder.path(), &init.split(' ').collect::<Vec<_>>(), b"");
    let place = free_place();
    let edit = |file: &str, changes: &[(&str, &str)]| {
        let path = folder.path().join("fleet").join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        private(&path, &changes.iter().fold(text, |text, (from, to)| text.replacen(from, to, 1)));
    };
    let kinds = ["silent:0.5", "word:3", "value"];
    let bit = "report = \"bit\"";
    let reports = kinds.map(|kind| format!("report = \"{kind}\""));
    let mut changes = vec![("0.0.0.0:7070", place.as_str()), ("period = 1.0", "period = 0.04")];
    changes.extend(reports.iter().map(|report| (bit, report.as_str())));
    edit("centre.toml", &changes);
    good(folder.path(), &["check", "fleet/centre.toml"], b"");
    // All read a level of 22, each in its own way.
    let samples = ["22.0\n", "23.4\n", "56.0\n", "1\n"];
    let sensors: Vec<_> = (1..=4)
        .zip(samples)
        .map(|(number, samples)| {
            let file = format!("sensor-{number}.toml");
            let report = reports.get(number - 1).map_or(bit, String::as_str);
            edit(&file, &[("192.168.1.5:7070", &place), (bit, report)]);
            reading(&folder.path().join("fleet"), &file, samples)
        })
        .collect();
    let mut centre = Running::new(start(folder.path(), &["centre", "fleet/centre.toml", "--slots", MOST_SLOTS]));
    let near = |lines: &[String]| {
        let rows = rows(lines.iter().map(String::as_str));
        rows.iter()
            .rev()
            .take(10)
            .filter(|row| row.1 >= 3 && (row.2 - 22.0).abs() < 0.3)
            .count()
            == 10
    };
    let lines = lines_until(&mut centre, |lines| near(lines));
    centre.kill().unwrap();
    centre.wait().unwrap();
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
    assert!(near(&lines), "{lines:?}");
    assert!(
        !lines
            .iter()
            .any(|line| line.contains("excluded") || line.contains("impossible")),
        "{lines:?}"
    );
}

/// Numbers that a sensor of a calibrated centre lacks or has twice.
#[test]
fn faults_of_calibrated_sensors_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let found = r#"{"relative_to": "a", "change": 0.1, "time_constant": null, "mean": 0.0, "estimates": [], "refused": [], "log_likelihood": 0.0,
        "sensors": [{"name": "a", "threshold": null, "noise": 0.5, "bias": 1.0, "gain": 2.0, "slope": 0.0, "walk": 0.0, "delay": 3.0},
        {"name": "s", "threshold": 4.0, "noise": 0.5, "bias": -4.0, "gain": 1.0, "slope": 0.0, "walk": 0.0, "delay": 0.0}]}"#;
    std::fs::write(folder.path().join("found.json"), found).unwrap();
    let checked = |head: &str, sensor: &str| {
        let text = format!(
            "listen = \"127.0.0.1:1\"\nperiod = 1\nprior = {{ mean = [0], deviation = [9] }}\n{head}\n[[sensor]]\nnumber = 1\nkey = \"{}\"\n{sensor}\n",
            key('a')
        );
        private(&folder.path().join("centre.toml"), &text);
        let output = fewbits(folder.path(), &["check", "centre.toml"], b"");
        text_of(&output)
    };
    let (with, without) = ("settings = \"found.json\"", "model = { kind = \"random-walk\", density = 1 }");
    for (head, sensor, said) in [
        (with, "name = \"a\"\nreport = \"value\"", "found.json: a is 3 s late, which is not corrected"),
        (with, "name = \"a\"\nreport = \"value\"", "no fault"),
        (
            with,
            "name = \"b\"\nreport = \"value\"",
            "name is `b`: expected one of the sensors in `settings`, a, s",
        ),
        (with, "report = \"value\"", "expected `deviation`, or `name`"),
        (
            with,
            "name = \"s\"\nreport = \"value\"",
            "report is `value`: expected `bit` of a sensor with a threshold",
        ),
        (without, "name = \"a\"\nreport = \"value\"", "expected `settings`"),
        (without, "deviation = 1\ngain = 0\nreport = \"bit\"", "gain is 0: expected"),
        (without, "deviation = 1\ngain = 2\nthreshold = 1\nreport = \"bit\"", "neither `gain` nor `offset`"),
        ("settings = \"none.json\"", "name = \"a\"\nreport = \"value\"", "none.json"),
    ] {
        let found = checked(head, sensor);
        assert!(found.contains(said), "{said}: {found}");
    }
}

fn text_of(output: &std::process::Output) -> String {
    text(&output.stdout) + &text(&output.stderr)
}

/// A garbled line is a missing measurement: the sensor goes on, names it, and its exit code shows it.
#[test]
fn a_sensor_goes_on_behind_garbled_lines() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &free_place(), &key('b'));
    let mut centre = Running::new(start(folder.path(), &["centre", "centre.toml", "--slots", MOST_SLOTS]));
    let mut sensor = Running::new(start(folder.path(), &["sensor", "sensor1.toml"]));
    let samples = b"value\n5.0\n5..2\n\xff\xfe\nNaN\n\ninf\n5.1\n5.2\n";
    sensor.stdin.take().unwrap().write_all(samples).unwrap();
    let output = sensor.output();
    centre.kill().unwrap();
    centre.wait().unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("line 3: `5..2` is no finite number") && said.contains("3 lines were no"), "{said}");
}

#[test]
fn second_centre_on_one_state_is_refused_and_nothing_else_is_silent() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &free_place(), &key('b'));
    let mut first = Running::new(start(folder.path(), &["centre", "centre.toml"]));
    wait_for("a state", || {
        assert!(first.try_wait().unwrap().is_none());
        folder.path().join("centre.state").exists()
    });
    let second = fewbits(folder.path(), &["centre", "centre.toml", "--slots", "1"], b"");
    assert!(text(&second.stderr).contains("in use by another process"), "{}", text(&second.stderr));
    first.kill().unwrap();
    first.wait().unwrap();
    // Alone: no report comes, and the run says so and fails.
    let alone = fewbits(folder.path(), &["centre", "centre.toml", "--slots", "12"], b"");
    let said = text(&alone.stderr);
    assert!(alone.status.code() == Some(1) && said.contains("no report in the first 10 slots"), "{said}");
    // A sensor whose centre does not run says so.
    let mut sensor = Running::new(start(folder.path(), &["sensor", "sensor1.toml"]));
    sensor.stdin.take().unwrap().write_all(&b"1\n".repeat(10)).unwrap();
    // It ends when it is dropped: until then it says so once a minute.
    let mut said = BufReader::new(sensor.stderr.take().unwrap())
        .lines()
        .map(Result::unwrap);
    assert!(said.any(|line| line.contains("no answer from 127.0.0.1:")));
}

/// A key of the fleet that others may read is one fault, and so is one that is not there or no key.
#[test]
fn a_fault_of_the_fleets_key_is_no_second_one() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let init = ["centre", "centre.toml", "--init", "--sensors", "3"];
    assert!(fewbits(folder.path(), &init, b"").status.success());
    let path = folder.path().join("fleet.key");
    let said = || text(&fewbits(folder.path(), &["check", "centre.toml"], b"").stderr);
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o644)).unwrap();
    let wide = said();
    private(&path, "abcd");
    let short = said();
    std::fs::remove_file(&path).unwrap();
    let none = said();
    assert!(
        wide.contains("chmod 600") && short.contains("fleet key") && none.contains("fleet.key"),
        "{wide}{short}{none}"
    );
    for said in [wide, short, none] {
        assert!(!said.contains("expected `key`") && !said.contains("faults"), "{said}");
    }
}

/// The files of centre and sensor say different reports, or numbers on which the meaning of a report depends: both ends name it, whether the
/// lengths of reports and questions differ or not, and however silent the sensor is. Nothing of it is used.
#[test]
fn reports_of_another_kind_are_named_at_both_ends() {
    let folder = tempfile::tempdir().unwrap();
    // In the centre's file, in the sensor's, deviation there, what the centre says of it.
    let pairs = [
        ("word:3", "word:4", 0.5, "`word:4`"),
        ("word:3", "bit", 0.5, "`bit`"),
        ("value", "silent:1.0", 0.5, "`silent`"),
        ("silent:1.0", "value", 0.5, "`value`"),
        ("silent:1.0", "bit", 0.5, "`bit`"),
        ("bit", "silent:1.0", 0.5, "`silent`"),
        ("bit", "value", 0.5, "`value`"),
        ("value", "bit", 0.5, "`bit`"),
        ("silent:1.0", "silent:1000.0", 0.5, "`silent` with another threshold"),
        ("word:3", "word:3", 0.6, "`word:3` with another `deviation`"),
        // What a bit and a value mean does not depend on it.
        ("bit", "bit", 0.6, ""),
        ("value", "value", 0.6, ""),
    ];
    let place = free_place();
    let mut centre = format!(
        "listen = \"{place}\"\nperiod = 0.04\nmodel = {{ kind = \"random-walk\", density = 0.01 }}\n\
         prior = {{ mean = [0.0], deviation = [10.0] }}\n"
    );
    for (number, (here, there, deviation, _)) in (1..).zip(pairs) {
        let key = format!("{number:064x}");
        centre += &format!(
            "[[sensor]]\nnumber = {number}\nkey = \"{key}\"\ndeviation = 0.5\nreport = \"{here}\"\nloss = 0.1\n"
        );
        let sensor = format!(
            "centre = \"{place}\"\nnumber = {number}\nkey = \"{key}\"\ndeviation = {deviation}\nreport = \"{there}\"\n"
        );
        private(&folder.path().join(format!("sensor{number}.toml")), &sensor);
    }
    private(&folder.path().join("centre.toml"), &centre);
    let centre = Running::new(start(folder.path(), &["centre", "centre.toml", "--json", "--slots", MOST_SLOTS]));
    let mut sensors = Vec::new();
    for number in 1..=pairs.len() {
        let mut process = sensor(folder.path(), &format!("sensor{number}.toml"));
        let said: Arc<Mutex<Vec<String>>> = Arc::default();
        let reader = follow(process.stderr.take().unwrap(), &said);
        sensors.push((process, said, reader));
    }
    let is_named = |at_centre: &[String]| {
        (1..)
            .zip(pairs)
            .zip(&sensors)
            .all(|((number, (here, there, _, name)), (_, said, _))| {
                let sends = format!("sensor {number}: it sends {name}");
                let has = |lines: &[String], text: &str| {
                    lines
                        .iter()
                        .any(|line| line.contains(text) && line.contains("`report` must"))
                };
                let own = format!("here it is `{there}`").replace(".0", "");
                let own_here = format!("here it is `{here}`").replace(".0", "");
                name.is_empty()
                    || has(at_centre, &sends) && has(at_centre, &own_here) && has(&said.lock().unwrap(), &own)
            })
    };
    // Only these two have reports that are used.
    let used = |row: &String| -> Vec<u64> {
        let row: serde_json::Value = serde_json::from_str(row).unwrap();
        let sensors = row["sensors"].as_array().unwrap().iter();
        let used = sensors.filter(|sensor| sensor["observed"].is_object());
        used.map(|sensor| sensor["number"].as_u64().unwrap()).collect()
    };
    let (rows, at_centre, _) = stopped_after(centre, |rows, at_centre| {
        let is_used = |number| rows.iter().any(|row| used(row).contains(&number));
        is_named(at_centre) && is_used(11) && is_used(12)
    });
    for (mut process, _, reader) in sensors {
        process.kill().unwrap();
        process.wait().unwrap();
        reader.join().unwrap();
    }
    assert!(rows.iter().flat_map(used).all(|number| number > 10));
    let of_the_same = |line: &String| line.contains("sensor 11:") || line.contains("sensor 12:");
    assert!(!at_centre.iter().any(of_the_same), "{at_centre:?}");
}

/// Defect: the time of a row for InfluxDB was computed in doubles, up to 128 ns beside the end of its slot, so that rows of several centres
/// with equal slots had other times.
#[test]
fn times_for_influx_are_ends_of_slots_to_the_nanosecond() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &free_place(), &key('b'));
    let options = ["centre", "centre.toml", "--rows", "influx", "--slots", "5"];
    let output = Running::new(start(folder.path(), &options)).output();
    let rows = text(&output.stdout);
    assert_eq!(rows.lines().count(), 5, "{rows}");
    for row in rows.lines() {
        let time: u64 = row.rsplit(' ').next().unwrap().parse().unwrap();
        assert_eq!(time % 40_000_000, 0, "{row}");
    }
}
