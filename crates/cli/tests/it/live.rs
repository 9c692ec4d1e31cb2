//! Live sources: what was read before an error or a signal is kept.

use crate::{BOUND, fewbits, first_lines, folder, good, start, table, text, wait_for};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

/// The table with a line that is no row behind `rows` rows.
fn garbled(rows: usize) -> Vec<u8> {
    let lines: Vec<String> = table().lines().take(rows + 1).map(|line| format!("{line}\n")).collect();
    (lines.concat() + "17000,26..5,1,2,3\n1700001,1,2,3,4\n").into_bytes()
}

fn rows(folder: &Path, file: &str) -> usize {
    let output = fewbits(folder, &["cat", file], b"");
    text(&output.stdout).lines().count().saturating_sub(1)
}

#[test]
fn rows_before_a_garbled_line_are_packed() {
    let (_kept, folder) = folder();
    for count in [1, 5, 700] {
        let file = format!("{count}.fewb");
        let output = fewbits(&folder, &["pack", "-", "--time", "exact", "-o", &file], &garbled(count));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            message.contains(&format!("{count} rows before the error")) && message.contains("26..5"),
            "{message}"
        );
        assert_eq!(rows(&folder, &file), count);
        // It is finished, too.
        good(&folder, &["info", &file], b"");
    }
}

#[test]
fn rows_before_a_garbled_line_are_sent() {
    let (_kept, folder) = folder();
    for count in [1, 5, 700] {
        let words = ["send", "-", "--time", "exact", "--bound", BOUND];
        let output = fewbits(&folder, &words, &garbled(count));
        assert_eq!(output.status.code(), Some(2));
        let received = text(&good(&folder, &["receive"], &output.stdout));
        assert_eq!(received.lines().count(), count + 1);
        let words = [&words[..], &["-o", "sent"]].concat();
        let _ = std::fs::remove_file(folder.join("sent"));
        assert_eq!(fewbits(&folder, &words, &garbled(count)).status.code(), Some(2));
        assert_eq!(rows(&folder, "sent"), count);
    }
}

#[test]
fn rows_before_a_garbled_line_are_appended() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    let output = fewbits(&folder, &["pack", "-", "--append", "-o", "a.fewb"], &garbled(700));
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("700 rows before the error"));
    assert_eq!(rows(&folder, "a.fewb"), 1700);
    good(&folder, &["info", "a.fewb"], b"");
}

#[test]
fn earlier_output_of_a_failed_pipe_stays_and_the_rows_are_beside() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "-o", "old.fewb"], b"");
    let before = std::fs::read(folder.join("old.fewb")).unwrap();
    let output = fewbits(&folder, &["pack", "-", "-o", "old.fewb"], &garbled(5));
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(std::fs::read(folder.join("old.fewb")).unwrap(), before);
    let message = text(&output.stderr);
    let name = message
        .lines()
        .find_map(|line| line.split_once("the rows so far are in "))
        .unwrap()
        .1;
    assert_eq!(rows(&folder, name), 5);
    // A pipe that is refused at its first row leaves nothing.
    let output = fewbits(&folder, &["pack", "-", "-o", "none.fewb"], &garbled(0));
    assert!(output.status.code() == Some(2) && !folder.join("none.fewb").exists());
}

/// Whether a process handles SIGINT, and one of its threads is asleep in a read of its standard input: it has read all that was written.
#[cfg(unix)]
fn is_reading(id: u32) -> bool {
    let of = |path: String| std::fs::read_to_string(path).unwrap_or_default();
    let status = of(format!("/proc/{id}/status"));
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let Some(caught) = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()) else {
        // Other systems do not say.
        std::thread::sleep(Duration::from_secs(2));
        return true;
    };
    let threads = std::fs::read_dir(format!("/proc/{id}/task")).unwrap();
    // The number of the system call, which differs between machines, and its first argument, the descriptor.
    let mut calls = threads.map(|thread| of(format!("{}/syscall", thread.unwrap().path().display())));
    let read = if cfg!(target_arch = "x86_64") {
        "0 0x0 "
    } else {
        "63 0x0 "
    };
    caught & 2 != 0 && calls.any(|call| call.starts_with(read))
}

/// Feeds 700 rows and keeps the pipe open; `end` then ends the command.
#[cfg(unix)]
fn interrupted(folder: &Path, words: &[&str], signal: &str) -> std::process::Output {
    let mut child = start(folder, words);
    let lines: Vec<String> = table().lines().take(701).map(|line| format!("{line}\n")).collect();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(lines.concat().as_bytes()).unwrap();
    // The handler must be there, and the command wait for more.
    wait_for("the command waits for a row", || is_reading(child.id()));
    super::signal(&child, signal);
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    output
}

#[cfg(unix)]
#[test]
fn signals_lose_no_row() {
    let (_kept, folder) = folder();
    for signal in ["-INT", "-TERM", "-HUP"] {
        let file = format!("pack{signal}");
        let output = interrupted(&folder, &["pack", "-", "--time", "exact", "-o", &file], signal);
        assert!(output.status.success(), "{signal}: {}", text(&output.stderr));
        assert_eq!(rows(&folder, &file), 700, "{signal}");
        good(&folder, &["info", &file], b"");
    }
    let output = interrupted(&folder, &["send", "-", "--bound", BOUND], "-INT");
    let received = text(&good(&folder, &["receive"], &output.stdout));
    assert_eq!(received.lines().count(), 701);
}

#[cfg(unix)]
#[test]
fn signal_while_a_file_is_packed_leaves_nothing() {
    let (_kept, folder) = folder();
    let long: String = std::iter::once(table())
        .chain((0..300).map(|_| table().split_once('\n').unwrap().1.to_owned()))
        .collect();
    std::fs::write(folder.join("long.csv"), long).unwrap();
    std::fs::write(folder.join("old"), "earlier").unwrap();
    let child = start(&folder, &["pack", "long.csv", "-o", "old"]);
    let beside = || {
        std::fs::read_dir(&folder)
            .unwrap()
            .any(|entry| entry.unwrap().file_name().to_string_lossy().contains("fewbits-new"))
    };
    wait_for("an unfinished file", beside);
    super::signal(&child, "-TERM");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(!beside());
    assert_eq!(std::fs::read(folder.join("old")).unwrap(), b"earlier");
}

#[test]
fn deadline_writes_rows_of_a_slow_pipe() {
    let (_kept, folder) = folder();
    let mut child = start(&folder, &["pack", "-", "--deadline", "100ms", "-o", "slow.fewb"]);
    let mut stdin = child.stdin.take().unwrap();
    let head: String = table().lines().take(4).map(|line| format!("{line}\n")).collect();
    stdin.write_all(head.as_bytes()).unwrap();
    wait_for("rows before the pipe ends", || rows(&folder, "slow.fewb") >= 3);
    // A kill that cannot be caught leaves the rows so far.
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(rows(&folder, "slow.fewb"), 3);
}

/// A pipe given as a file name can be read once only.
#[cfg(unix)]
#[test]
fn named_pipe_is_read_once() {
    let (_kept, folder) = folder();
    let made = std::process::Command::new("mkfifo")
        .arg("pipe")
        .current_dir(&folder)
        .status();
    if !made.is_ok_and(|status| status.success()) {
        return;
    }
    let feed = |bytes: Vec<u8>| {
        let pipe = folder.join("pipe");
        std::thread::spawn(move || drop(std::fs::write(pipe, bytes)))
    };
    let long: String = std::iter::once(table())
        .chain((0..9).map(|_| table().split_once('\n').unwrap().1.to_owned()))
        .collect();
    std::fs::write(folder.join("long.csv"), &long).unwrap();
    for words in [
        &["pack", "pipe", "--bound", "1%", "-o", "p.fewb"][..],
        &["pack", "pipe", "--time", "±1ms", "--bound", "1%", "-o", "p.fewb"],
        &["send", "pipe", "--bound", "1%", "-o", "p.fewb"],
    ] {
        let _ = std::fs::remove_file(folder.join("p.fewb"));
        let feeder = feed(long.clone().into_bytes());
        good(&folder, words, b"");
        feeder.join().unwrap();
        assert_eq!(rows(&folder, "p.fewb"), 10_000, "{words:?}");
    }
    let feeder = feed(long.clone().into_bytes());
    let plan = text(&good(&folder, &["plan", "pipe", "--columns", "price", "--json"], b""));
    assert!(plan.contains("\"rows\": 10000"), "{plan}");
    feeder.join().unwrap();
    // Recordings come through pipes too.
    good(&folder, &["pack", "long.csv", "--time", "exact", "-o", "long.fewb"], b"");
    let bytes = std::fs::read(folder.join("long.fewb")).unwrap();
    for words in [
        &["unpack", "pipe"][..],
        &["cat", "pipe", "--columns", "temp"],
        &["info", "pipe"],
        &["verify", "long.csv", "pipe"],
        &["receive", "pipe"],
    ] {
        let feeder = feed(bytes.clone());
        good(&folder, words, b"");
        feeder.join().unwrap();
    }
}

/// Defect: estimates of a pipe waited until some hundreds of them were there, or the pipe ended.
#[test]
fn estimates_follow_a_pipe() {
    let (_kept, folder) = folder();
    let places = "anchor,x,y\nP,0,0\nQ,10,0\nR,0,10\n";
    std::fs::write(folder.join("anchors.csv"), places).unwrap();
    let level = vec!["track", "-", "--prior", "0±10", "--noise", "0.5", "--change", "0.1"];
    let place = vec!["ranges", "-", "--anchors", "anchors.csv", "--noise", "0.5"];
    let json = [&level[..], &["--json"]].concat();
    for (words, is_level, names) in [(level, true, 1), (json, true, 0), (place, false, 1)] {
        let mut child = start(&folder, &words);
        let mut stdin = child.stdin.take().unwrap();
        let row = |k: usize| match is_level {
            true => format!("{k},{}.5\n", k % 3),
            false => format!("{k},5.{k},7.1,7.{k}\n"),
        };
        let head = if is_level { "time,a\n" } else { "time,P,Q,R\n" };
        stdin.write_all(head.as_bytes()).unwrap();
        (0..3).for_each(|k| stdin.write_all(row(k).as_bytes()).unwrap());
        // The pipe is still open.
        let lines = first_lines(child, names + 3);
        assert_eq!(lines.len(), names + 3, "{words:?}: {lines:?}");
        drop(stdin);
    }
}
