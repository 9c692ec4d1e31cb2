//! `send` and `receive` over UDP between several senders, with losses, repetitions and noise.

use super::{start, text, wait_for};
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Output};
use std::time::Duration;

/// A receiver, and its address. It ends once nothing comes for a while.
fn receiver(folder: &Path, words: &[&str]) -> (Child, String, std::thread::JoinHandle<String>) {
    let timeout: &[&str] = if words.contains(&"--timeout") {
        &[]
    } else {
        &["--timeout", "5s"]
    };
    let all = [&["receive", "--udp", "127.0.0.1:0"], timeout, words].concat();
    let mut receiver = start(folder, &all);
    let mut stderr = BufReader::new(receiver.stderr.take().unwrap());
    let mut line = String::new();
    stderr.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening at ").unwrap().to_owned();
    let rest = std::thread::spawn(move || stderr.lines().map_while(Result::ok).collect::<Vec<_>>().join("\n"));
    (receiver, address, rest)
}

/// The datagrams by which `send` sends a table.
fn datagrams(folder: &Path, table: &str, words: &[&str]) -> Vec<Vec<u8>> {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = socket.local_addr().unwrap().to_string();
    let all = [&["send", "-", "--udp", &address, "--max-bytes", "100"], words].concat();
    let mut sender = start(folder, &all);
    std::io::Write::write_all(&mut sender.stdin.take().unwrap(), table.as_bytes()).unwrap();
    assert!(sender.wait().unwrap().success());
    // On one machine what was sent has arrived.
    socket.set_nonblocking(true).unwrap();
    let (mut all, mut buffer) = (Vec::new(), [0; 2048]);
    while let Ok(length) = socket.recv(&mut buffer) {
        all.push(buffer[..length].to_vec());
    }
    all
}

/// Sends datagrams, a few more only when the receiver has taken those before.
fn deliver(address: &str, datagrams: impl IntoIterator<Item = Vec<u8>>) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for (i, datagram) in datagrams.into_iter().enumerate() {
        socket.send_to(&datagram, address).unwrap();
        if i % 32 == 0 {
            wait_for("datagrams are taken", || !is_waiting(address));
        }
    }
    wait_for("datagrams are taken", || !is_waiting(address));
}

/// Whether the system keeps datagrams for a socket of IPv4 that its owner has not read.
fn is_waiting(address: &str) -> bool {
    let port: u16 = address.rsplit_once(':').unwrap().1.parse().unwrap();
    let Ok(sockets) = std::fs::read_to_string("/proc/net/udp") else {
        // Other systems do not say.
        std::thread::sleep(Duration::from_millis(2));
        return false;
    };
    let own = sockets
        .lines()
        .skip(1)
        .map(|line| line.split_whitespace().collect::<Vec<_>>());
    let mut own = own.filter(|cells| cells[1].ends_with(&format!(":{port:04X}")));
    own.any(|cells| !cells[4].ends_with(":00000000"))
}

fn ended((mut child, _, rest): (Child, String, std::thread::JoinHandle<String>)) -> (Output, String) {
    drop(child.stdin.take());
    let output = child.wait_with_output().unwrap();
    (output, rest.join().unwrap())
}

fn two_columns() -> String {
    let rows: String = (0..400).map(|i| format!("{i},{}\n", 7 * i % 31)).collect();
    "a,b\n".to_owned() + &rows
}

#[test]
fn second_sender_neither_ends_nor_enters_the_first_table() {
    let folder = tempfile::tempdir().unwrap();
    let first = datagrams(folder.path(), &two_columns(), &[]);
    let narrow = datagrams(folder.path(), "only\n1\n2\n3\n", &[]);
    let alike = datagrams(folder.path(), "c,d\n100000,5\n100001,6\n", &[]);
    for output in [None, Some("day.csv")] {
        let words: &[&str] = if output.is_some() { &["-o", "day.csv"] } else { &[] };
        let receiver = receiver(folder.path(), words);
        let half = first.len() / 2;
        let all = first[..half].iter().chain(&narrow).chain(&alike).chain(&first[half..]);
        deliver(&receiver.1, all.cloned());
        let (ended, said) = ended(receiver);
        let table = match output {
            None => text(&ended.stdout),
            Some(file) => std::fs::read_to_string(folder.path().join(file)).unwrap(),
        };
        assert_eq!(table, two_columns());
        assert!(said.contains("another table begins"), "{said}");
        match output {
            // Rows were refused: the run says so.
            None => assert_eq!(ended.status.code(), Some(1), "{said}"),
            Some(_) => {
                assert_eq!(ended.status.code(), Some(0), "{said}");
                let other = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
                assert_eq!(other("day-2.csv"), "only\n1\n2\n3\n");
                assert_eq!(other("day-3.csv"), "c,d\n100000,5\n100001,6\n");
            }
        }
    }
}

#[test]
fn doubled_datagrams_give_their_rows_once_and_lost_ones_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let all = datagrams(folder.path(), &two_columns(), &[]);
    let one = receiver(folder.path(), &[]);
    deliver(
        &one.1,
        all.iter()
            .flat_map(|frame| [frame.clone(), frame.clone()])
            .chain(all.clone()),
    );
    let (output, said) = ended(one);
    assert_eq!(text(&output.stdout), two_columns());
    assert!(output.status.success() && said.contains("came again and were used once"), "{said}");
    // Any single datagram may be lost, the first one too; of rows, those of one frame.
    let some = [0, 1, 2, all.len() - 1].map(|lost| {
        let one = receiver(folder.path(), &[]);
        let others = all.iter().enumerate().filter(|(i, _)| *i != lost);
        deliver(&one.1, others.map(|(_, frame)| frame.clone()));
        (lost, one)
    });
    for (lost, one) in some {
        let (output, said) = ended(one);
        let (rows, has_rows) = (text(&output.stdout).lines().count(), all[lost][0] != 0);
        assert_eq!(rows < 401, has_rows, "{said}");
        assert_eq!(output.status.code(), Some(i32::from(has_rows)), "{said}");
        assert_eq!(said.contains("1 of "), has_rows, "{said}");
    }
}

/// Without the last pieces of the header it is not known how many frames are missing: what is there is kept.
#[test]
fn lost_end_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let all = datagrams(folder.path(), &two_columns(), &[]);
    let end = all.iter().rposition(|frame| frame[0] != 0).unwrap();
    let one = receiver(folder.path(), &["-o", "day.csv"]);
    deliver(&one.1, all[..=end].iter().cloned());
    let (output, said) = ended(one);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("the end of the table did not arrive"), "{said}");
    let kept = std::fs::read_to_string(folder.path().join("day.csv")).unwrap();
    assert_eq!(kept, two_columns());
}

/// A signal is an end as good as a timeout: rows are kept, and what is missing is counted.
#[cfg(unix)]
#[test]
fn signal_counts_what_did_not_arrive() {
    let folder = tempfile::tempdir().unwrap();
    let mut all = datagrams(folder.path(), &two_columns(), &[]);
    let lost = all.iter().position(|frame| frame[0] != 0).unwrap();
    all.remove(lost);
    let one = receiver(folder.path(), &["-o", "day.csv", "--timeout", "1h"]);
    deliver(&one.1, all);
    super::signal(&one.0, "-TERM");
    let (output, said) = ended(one);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("did not arrive"), "{said}");
    assert!(folder.path().join("day.csv").exists());
}

/// Noise, cut and inverted datagrams between those of a sender: its rows are all there, and nothing else.
#[test]
fn noise_enters_no_table() {
    let folder = tempfile::tempdir().unwrap();
    let all = datagrams(folder.path(), &two_columns(), &[]);
    let receiver = receiver(folder.path(), &[]);
    let mut state = 7_u64;
    let mut next = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut mixed = Vec::new();
    for frame in &all {
        for _ in 0..20 {
            let mut noise = frame.clone();
            match next() % 3 {
                0 => noise.truncate(next() % frame.len()),
                1 => noise[next() % frame.len()] ^= 1 << (next() % 8),
                _ => noise = (0..next() % 60).map(|_| next() as u8).collect(),
            }
            mixed.push(noise);
        }
        mixed.push(frame.clone());
    }
    deliver(&receiver.1, mixed);
    let (output, said) = ended(receiver);
    assert_eq!(text(&output.stdout), two_columns(), "{said}");
}

#[test]
fn addresses_that_cannot_be_listened_at_are_named() {
    let (_kept, folder) = super::folder();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = socket.local_addr().unwrap().to_string();
    for (address, said) in [
        (taken.as_str(), "another program listens there"),
        ("9000", "as 0.0.0.0:9000"),
    ] {
        let refusal = super::refused(&folder, &["receive", "--udp", address], b"");
        assert!(refusal.contains(said), "{refusal}");
    }
}

/// A receiver that starts again after a kill would replace its earlier rows unnoticed.
#[test]
fn an_output_that_is_there_is_told() {
    let (_kept, folder) = super::folder();
    std::fs::write(folder.join("day.csv"), "time,v\n1,2\n").unwrap();
    let (mut child, address, rest) = receiver(&folder, &["-o", "day.csv", "--timeout", "1s"]);
    deliver(&address, datagrams(&folder, "time,v\n5,6\n", &["--time", "exact"]));
    assert!(child.wait().unwrap().success());
    let said = rest.join().unwrap();
    assert!(said.contains("day.csv is there") && said.contains(".partial, which then replaces it"), "{said}");
}
