//! The tests of the command run the binary.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[cfg(feature = "mqtt")]
mod brokers;
mod decided;
mod design;
mod doors;
mod fit;
mod fit_faults;
mod fleet;
mod fresh;
mod kills;
mod language;
mod leak;
mod links;
mod live;
mod long;
mod many;
mod meanings;
mod node;
mod numbers;
mod outputs;
mod pages;
mod ranges;
mod ranges_strengths;
mod ranges_tables;
mod recordings;
mod streams;
mod tables;
mod track;
mod track_bands;
mod track_columns;
mod track_devices;
mod track_faults;
mod track_found;
mod track_kinds;
mod track_meanings;
mod track_moves;
mod track_noise;
mod track_random;

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use tempfile::TempDir;

/// Starts the command in a folder.
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

/// A process that ends with its test, also with one that fails.
struct Running(Option<Child>);

impl Running {
    fn new(child: Child) -> Self {
        Self(Some(child))
    }

    /// Waits for the end of the process.
    fn output(mut self) -> Output {
        self.0.take().unwrap().wait_with_output().unwrap()
    }
}

impl std::ops::Deref for Running {
    type Target = Child;

    fn deref(&self) -> &Child {
        self.0.as_ref().unwrap()
    }
}

impl std::ops::DerefMut for Running {
    fn deref_mut(&mut self) -> &mut Child {
        self.0.as_mut().unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Asks a process to end.
fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(status.unwrap().success());
}

/// Waits for an event, however slow the machine is; after a minute it is said not to have come.
fn wait_for(what: &str, mut came: impl FnMut() -> bool) {
    let began = std::time::Instant::now();
    while !came() {
        assert!(began.elapsed() < std::time::Duration::from_secs(60), "{what}: not within a minute");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

/// The first `count` lines that a process writes, which is then ended; those there are if none comes for a minute. However slow the
/// machine is, the same lines.
fn first_lines(mut child: Child, count: usize) -> Vec<String> {
    let (sender, written) = std::sync::mpsc::channel();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let reader = std::thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sender.send(line)));
    let next = || written.recv_timeout(std::time::Duration::from_secs(60)).ok();
    let lines = std::iter::from_fn(next).take(count).collect();
    let _ = child.kill();
    child.wait().unwrap();
    drop(written);
    let _ = reader.join();
    lines
}

/// Runs the command in a folder.
fn fewbits(folder: &Path, words: &[&str], input: &[u8]) -> Output {
    let mut child = start(folder, words);
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_vec();
    let feeder = std::thread::spawn(move || {
        // A task that refuses early closes its input.
        let _ = stdin.write_all(&input);
    });
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    output
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn good(folder: &Path, words: &[&str], input: &[u8]) -> Vec<u8> {
    let output = fewbits(folder, words, input);
    assert!(output.status.success(), "{words:?}: {}", text(&output.stderr));
    output.stdout
}

/// The message of a refusal.
fn refused(folder: &Path, words: &[&str], input: &[u8]) -> String {
    let output = fewbits(folder, words, input);
    assert_eq!(output.status.code(), Some(2), "{words:?}: {}", text(&output.stderr));
    text(&output.stderr)
}

/// 1000 rows: time, a wave, a flow with gaps, decimals, a direction.
fn table() -> String {
    let mut table = "time,temp,flow,price,direction\n".to_owned();
    for i in 0..1000 {
        let x = f64::from(i);
        let flow = if i % 97 == 5 {
            String::new()
        } else {
            format!("{}", 40.0 + 9.0 * (0.01 * x).cos())
        };
        let price = (1e5 + 300.0 * (0.02 * x).cos()).round() / 1000.0;
        let direction = (350.0 + 0.3 * x) % 360.0;
        let time = 1_700_000_000.0 + 2.0 * x + 0.001 * f64::from(i * 7 % 5);
        table += &format!("{time:.3},{},{flow},{price},{direction}\n", 20.0 + (0.03 * x).sin());
    }
    table
}

const BOUND: &str = "temp=±0.1,flow=1%,direction=±2@360,*=decimals:3";

fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.csv"), table()).unwrap();
    let path = folder.path().to_owned();
    (folder, path)
}

#[test]
fn packed_table_verifies_and_unpacks() {
    let (_kept, folder) = folder();
    for time in ["exact", "±10ms"] {
        good(&folder, &["pack", "a.csv", "--bound", BOUND, "--time", time, "--output", "a.fewb"], b"");
        let verdict = good(&folder, &["verify", "a.csv", "a.fewb"], b"");
        assert!(text(&verdict).contains("all promises hold"));
        let size = std::fs::metadata(folder.join("a.fewb")).unwrap().len();
        assert!(size < table().len() as u64 / 12, "{size}");
        let unpacked = text(&good(&folder, &["unpack", "a.fewb"], b""));
        assert_eq!(unpacked.lines().count(), 1001);
        assert!(unpacked.starts_with("time,temp,flow,price,direction\n"));
        if time == "exact" {
            let times = |table: &str| -> Vec<f64> {
                table
                    .lines()
                    .skip(1)
                    .map(|line| line.split(',').next().unwrap().parse().unwrap())
                    .collect()
            };
            assert_eq!(times(&unpacked), times(&table()));
        }
    }
}

#[test]
fn refused_bound_names_its_column() {
    let (_kept, folder) = folder();
    let words = [
        "pack",
        "a.csv",
        "--bound",
        "temp=±0.1,flow=-1",
        "--time",
        "exact",
        "-o",
        "a.fewb",
    ];
    let message = refused(&folder, &words, b"");
    assert!(message.contains("a.csv: column `flow`") && message.contains("-1"), "{message}");
}

#[test]
fn altered_table_fails_verification() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--bound", "*=±0.01", "--time", "exact", "-o", "a.fewb"], b"");
    let altered = table().replacen(",20,", ",20.5,", 1);
    assert_ne!(altered, table());
    std::fs::write(folder.join("b.csv"), altered).unwrap();
    let output = fewbits(&folder, &["verify", "b.csv", "a.fewb", "--json"], b"");
    assert_eq!(output.status.code(), Some(1));
    let verdict: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&verdict["holds"], &verdict["columns"][0]["failed"]), (&false.into(), &1.into()));
    let failure = verdict["columns"][0]["first_failures"][0].as_str().unwrap();
    assert!(failure.contains(": 20.5 was restored as 20.0"), "{failure}");
}

#[test]
fn pipes_and_ranges_agree() {
    let (_kept, folder) = folder();
    let packed = good(&folder, &["pack", "-", "--bound", "*=1%", "--rows-per-block", "64"], table().as_bytes());
    let whole = text(&good(&folder, &["unpack", "-"], &packed));
    assert_eq!(whole.lines().count(), 1001);
    std::fs::write(folder.join("a.fewb"), &packed).unwrap();
    let words = [
        "cat",
        "a.fewb",
        "--from",
        "100",
        "--to",
        "199",
        "--columns",
        "price,temp",
    ];
    let part = text(&good(&folder, &words, b""));
    let lines: Vec<&str> = part.lines().collect();
    assert_eq!((lines.len(), lines[0]), (101, "price,temp"));
    let cells: Vec<&str> = whole.lines().nth(101).unwrap().split(',').collect();
    assert_eq!(lines[1], format!("{},{}", cells[3], cells[1]));
    let json = text(&good(&folder, &["cat", "a.fewb", "--from", "999", "--json"], b""));
    let row: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(row["row"], 999);
}

#[test]
fn info_and_plan_speak_of_columns() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--bound", BOUND, "--time", "exact", "-o", "a.fewb"], b"");
    let info: serde_json::Value = serde_json::from_slice(&good(&folder, &["info", "a.fewb", "--json"], b"")).unwrap();
    assert_eq!(
        (&info["rows"], &info["index"], &info["columns"][1]["gaps"]),
        (&1000.into(), &true.into(), &11.into())
    );
    assert!(text(&good(&folder, &["info", "a.fewb"], b"")).contains("direction: ±2@360"));
    let plan = good(&folder, &["plan", "a.csv", "--time", "exact", "--json", "--plot", "plan.svg"], b"");
    assert!(
        std::fs::read_to_string(folder.join("plan.svg"))
            .unwrap()
            .contains("direction")
    );
    let plan: serde_json::Value = serde_json::from_slice(&plan).unwrap();
    assert_eq!(plan["columns"][2]["name"], "price");
    assert!((plan["columns"][2]["steps"][0].as_f64().unwrap() - 0.001).abs() < 1e-9);
    assert!(plan["columns"][0]["bounds"][4][2].as_f64().unwrap() < 2.0);
    assert!(text(&good(&folder, &["bench", "a.csv", "--bound", "*=1%"], b"")).contains("lattice + pco"));
}

#[test]
fn damaged_recording_is_read_around_the_damage() {
    let (_kept, folder) = folder();
    good(
        &folder,
        &[
            "pack",
            "a.csv",
            "--rows-per-block",
            "100",
            "-o",
            "a.fewb",
            "--columns",
            "price",
        ],
        b"",
    );
    let mut bytes = std::fs::read(folder.join("a.fewb")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(folder.join("b.fewb"), bytes).unwrap();
    let output = fewbits(&folder, &["unpack", "b.fewb"], b"");
    assert_eq!((output.status.code(), text(&output.stdout).lines().count()), (Some(1), 901));
    assert!(text(&output.stderr).contains("b.fewb: ") && text(&output.stderr).contains("damaged"));
}

#[test]
fn refusals_name_file_row_column_and_mend() {
    let (_kept, folder) = folder();
    std::fs::write(folder.join("bad.csv"), "t,x\n1,2\n2,abc\n").unwrap();
    let message = refused(&folder, &["pack", "bad.csv", "-o", "x"], b"");
    assert_eq!(
        message,
        "error: bad.csv: line 3 (row 2), column `x`: `abc` is not a number: make it a gap with --missing, leave such lines out with \
         --skip-bad, or the column with --without x\n"
    );
    let message = refused(&folder, &["pack", "a.csv", "--bound", "x=1%", "-o", "x"], b"");
    assert_eq!(message, "error: a.csv: no column `x`: there are time, temp, flow, price, direction\n");
    for (bound, part) in [
        ("temp=-1", "-1"),
        ("temp=warm", "warm"),
        ("temp", "column=bound"),
        ("temp=200%", "share"),
    ] {
        let message = refused(&folder, &["pack", "a.csv", "--bound", bound, "-o", "x"], b"");
        assert!(message.contains(part), "{message}");
    }
    let message = refused(&folder, &["pack", "none.csv", "-o", "x"], b"");
    assert!(message.starts_with("error: none.csv: cannot open: "), "{message}");
    let message = refused(&folder, &["unpack", "a.csv"], b"");
    assert!(message.contains("a.csv: not a recording"), "{message}");
    let message = refused(&folder, &["pack", "bad.csv", "--time", "exact", "--time-column", "x", "-o", "x"], b"");
    assert!(message.contains("(row 2), column `x`") && message.contains("is not a time"), "{message}");
    let message = refused(&folder, &["pack", "-", "-o", "x"], b"n\n1.5\n18014398509481985\n");
    assert!(message.contains("more than 53 bits"), "{message}");
    let message = refused(&folder, &["pack", "-", "-o", "x"], b"time,x\n2026-01-31T12:00:00Z,1\n");
    assert!(
        message.contains("line 2 (row 1), column `time`") && message.contains("add --time exact"),
        "{message}"
    );
}

#[cfg(not(feature = "parquet"))]
#[test]
fn parquet_names_the_missing_feature() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "-o", "a.fewb"], b"");
    let message = refused(&folder, &["unpack", "a.fewb", "-o", "a.parquet"], b"");
    assert!(
        message.contains("a.parquet: this program was built without Parquet") && message.contains("--features parquet")
    );
    std::fs::write(folder.join("table"), b"PAR1....PAR1").unwrap();
    assert!(refused(&folder, &["pack", "table", "-o", "x"], b"").contains("--features parquet"));
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_returns_what_it_holds() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    let csv = text(&good(&folder, &["unpack", "a.fewb"], b""));
    good(&folder, &["unpack", "a.fewb", "-o", "a.parquet"], b"");
    good(
        &folder,
        &[
            "pack",
            "a.parquet",
            "--columns",
            "temp,flow,price,direction",
            "-o",
            "b.fewb",
        ],
        b"",
    );
    let values = |text: &str| -> Vec<String> {
        text.lines()
            .skip(1)
            .map(|line| line.split_once(',').map_or("", |cells| cells.1).to_owned())
            .collect()
    };
    let again = text(&good(&folder, &["unpack", "b.fewb"], b""));
    assert!(again.lines().skip(1).eq(values(&csv)));
    let times = good(&folder, &["pack", "a.parquet", "--time", "exact"], b"");
    assert_eq!(text(&good(&folder, &["unpack", "-"], &times)), csv);
    good(&folder, &["cat", "a.fewb", "--columns", "price,temp", "-o", "c.parquet"], b"");
    let message = refused(&folder, &["pack", "c.parquet", "--bound", "flow=1%", "-o", "x"], b"");
    assert!(message.contains("there are time, price, temp"), "{message}");
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_has_words_as_text() {
    let (_kept, folder) = folder();
    let table = "time,mode,temp\n0,heat,1.5\n1,,2.5\n2,\"cool, slow\",3.5\n";
    good(&folder, &["pack", "-", "--time", "exact", "-o", "a.fewb"], table.as_bytes());
    good(&folder, &["unpack", "a.fewb", "-o", "a.parquet"], b"");
    let file = std::fs::File::open(folder.join("a.parquet")).unwrap();
    let mut back = fewbits_table::Table::open_parquet(file, &fewbits_table::Dialect::default()).unwrap();
    let mut batch = fewbits_table::Batch::default();
    back.read(&mut batch, 10).unwrap();
    assert_eq!(back.words(1), ["cool, slow", "heat"]);
    assert_eq!(batch.columns[1], fewbits_table::Cells::Words(vec![Some(1), None, Some(0)]));
}

#[test]
fn sent_stream_is_received() {
    let (_kept, folder) = folder();
    let words = ["send", "-", "--bound", BOUND, "--time", "exact", "--max-bytes", "80"];
    let stream = good(&folder, &words, table().as_bytes());
    let received = text(&good(&folder, &["receive"], &stream));
    assert_eq!(received.lines().count(), 1001);
    // It is a recording too.
    std::fs::write(folder.join("a.fewb"), &stream).unwrap();
    good(&folder, &["verify", "a.csv", "a.fewb"], b"");
}

#[test]
fn datagrams_are_received() {
    let (_kept, folder) = folder();
    let mut receiver = start(&folder, &["receive", "--udp", "127.0.0.1:0"]);
    let mut line = String::new();
    let mut stderr = BufReader::new(receiver.stderr.take().unwrap());
    stderr.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening at ").unwrap();
    let some: String = table().lines().take(201).map(|line| format!("{line}\n")).collect();
    let words = [
        "send",
        "-",
        "--bound",
        BOUND,
        "--max-bytes",
        "200",
        "--udp",
        address,
        "--header-every",
        "1",
    ];
    good(&folder, &words, some.as_bytes());
    // Datagrams may be lost, but hardly any between two sockets of one machine.
    assert_eq!(first_lines(receiver, 151).len(), 151);
}

/// A named pipe stands for a serial line: what begins in the middle, and noise, cost whole frames only.
#[cfg(unix)]
#[test]
fn serial_line_is_received() {
    let (_kept, folder) = folder();
    if !Command::new("mkfifo")
        .arg("line")
        .current_dir(&folder)
        .status()
        .is_ok_and(|status| status.success())
    {
        return;
    }
    let receiver = start(&folder, &["receive", "--serial", "line"]);
    let mut noise = std::fs::OpenOptions::new()
        .write(true)
        .open(folder.join("line"))
        .unwrap();
    noise.write_all(b"\x07noise\x00\x00\xff").unwrap();
    let words = [
        "send",
        "-",
        "--bound",
        BOUND,
        "--max-bytes",
        "200",
        "--serial",
        "line",
        "--header-every",
        "4",
    ];
    good(&folder, &words, table().as_bytes());
    // The noise is one frame with the first piece of the header, which comes again.
    assert_eq!(first_lines(receiver, 1001).len(), 1001);
}
