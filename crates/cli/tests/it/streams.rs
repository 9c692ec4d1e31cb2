//! Closed and full standard outputs, and control characters in names.

use crate::{folder, good, text};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Tasks that print.
const PRINTERS: [&[&str]; 13] = [
    &["info", "a.fewb"],
    &["info", "a.fewb", "--json"],
    &["verify", "a.csv", "a.fewb"],
    &["verify", "a.csv", "a.fewb", "--json"],
    &["plan", "a.csv", "--columns", "temp"],
    &["plan", "a.csv", "--columns", "temp", "--json"],
    &["bench", "a.csv", "--columns", "temp"],
    &["generate", "bash"],
    &["generate", "man"],
    &["unpack", "a.fewb"],
    &["cat", "a.fewb", "--json"],
    &["design", "--prior", "20±4", "--noise", "1", "--bits", "1"],
    &["track", "a.csv", "--columns", "temp", "--noise", "0.1"],
];

fn run(folder: &Path, words: &[&str], stdout: Stdio, stderr: Stdio) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fewbits"))
        .args(words)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(stdout)
        .stderr(stderr)
        .output()
        .unwrap()
}

/// The write end of a pipe without a reader.
#[cfg(unix)]
fn closed() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

#[cfg(unix)]
fn full() -> Stdio {
    std::fs::File::options().write(true).open("/dev/full").unwrap().into()
}

#[cfg(unix)]
#[test]
fn closed_standard_output_is_a_quiet_end() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    for words in PRINTERS {
        let output = run(&folder, words, closed(), Stdio::piped());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{words:?}: {message}");
        assert!(!message.contains("panicked") && !message.contains("error"), "{words:?}: {message}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn full_standard_output_is_an_error_that_says_so() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    for words in PRINTERS {
        let output = run(&folder, words, full(), Stdio::piped());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {message}");
        assert!(message.contains("standard output") && !message.contains("panicked"), "{words:?}: {message}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn full_standard_error_stops_nothing() {
    let (_kept, folder) = folder();
    for (words, code) in [
        (&["pack", "a.csv", "-o", "a.fewb"][..], 0),
        (&["pack", "none.csv", "-o", "x"], 2),
        (&["track", "a.csv", "--columns", "temp", "--noise", "0.1"], 0),
    ] {
        let output = run(&folder, words, Stdio::null(), full());
        assert_eq!(output.status.code(), Some(code), "{words:?}");
    }
    good(&folder, &["verify", "a.csv", "a.fewb"], b"");
}

#[test]
fn escape_sequences_of_names_do_not_reach_the_terminal() {
    let (_kept, folder) = folder();
    let evil = "\u{1b}]0;evil\u{7}\u{1b}[2J\u{9b}31mtemp";
    std::fs::write(folder.join("e.csv"), format!("{evil},b\n1,2\n2,x\n")).unwrap();
    std::fs::write(folder.join("f.csv"), format!("{evil},b\n1,2\n2,3\n")).unwrap();
    std::fs::write(folder.join(format!("{evil}.csv")), "a\nx\n").unwrap();
    good(&folder, &["pack", "f.csv", "-o", "f.fewb"], b"");
    std::fs::write(folder.join("g.csv"), format!("{evil},b\n9,9\n2,3\n")).unwrap();
    let file = format!("{evil}.csv");
    for words in [
        &["info", "f.fewb"][..],
        &["verify", "g.csv", "f.fewb"],
        &["plan", "f.csv"],
        &["pack", "e.csv", "-o", "x"],
        &["pack", "f.csv", "--bound", "none=±1", "-o", "x"],
        &["pack", &file, "-o", "x"],
        &["cat", "f.fewb", "--columns", "none"],
        &["pack", "f.csv", "-o", "x"],
        &["track", "f.csv"],
    ] {
        let output = run(&folder, words, Stdio::piped(), Stdio::piped());
        let printed = text(&output.stdout) + &text(&output.stderr);
        assert!(!printed.contains(['\u{1b}', '\u{7}', '\u{9b}']), "{words:?}: {printed:?}");
        assert!(!printed.is_empty());
    }
    // A table that goes to a file or a pipe has its names as they are.
    assert!(text(&good(&folder, &["cat", "f.fewb"], b"")).contains(evil));
}
