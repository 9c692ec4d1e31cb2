//! Outputs never destroy inputs, and a task that fails leaves earlier outputs as they were. Every test looks at the files afterwards.

use crate::{fewbits, folder, good, refused, start, table, text, wait_for};
use std::io::Write;
use std::path::Path;

/// All files of a folder with their bytes.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.file_type().unwrap().is_file())
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

/// A table, a recording, a stream of frames, ranges and their anchors.
fn prepare(folder: &Path) {
    good(folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    good(folder, &["send", "a.csv", "-o", "a.frames"], b"");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    for file in ["walk.csv", "anchors.csv"] {
        std::fs::copy(fixtures.join(file), folder.join(file)).unwrap();
    }
}

/// Tasks that write, with the place of the output, and an input of each.
const WRITERS: [(&[&str], &str); 11] = [
    (&["pack", "a.csv", "-o", "OUT"], "a.csv"),
    (&["unpack", "a.fewb", "-o", "OUT"], "a.fewb"),
    (&["cat", "a.fewb", "--to", "1700000100", "-o", "OUT"], "a.fewb"),
    (&["cat", "a.fewb", "--json", "-o", "OUT"], "a.fewb"),
    (&["send", "a.csv", "-o", "OUT"], "a.csv"),
    (&["receive", "a.frames", "-o", "OUT"], "a.frames"),
    (&["track", "a.csv", "--columns", "temp", "--noise", "0.1", "-o", "OUT"], "a.csv"),
    (&["track", "a.csv", "--columns", "temp", "--noise", "0.1", "--plot", "OUT"], "a.csv"),
    (&["plan", "a.csv", "--columns", "temp", "--plot", "OUT"], "a.csv"),
    (
        &[
            "design", "a.csv", "--column", "temp", "--noise", "1", "--bits", "1", "-o", "OUT",
        ],
        "a.csv",
    ),
    (
        &[
            "design", "a.csv", "--column", "temp", "--noise", "1", "--bits", "1", "--plot", "OUT",
        ],
        "a.csv",
    ),
];

#[test]
fn output_that_is_the_input_is_refused() {
    let (_kept, folder) = folder();
    prepare(&folder);
    for (words, input) in WRITERS {
        #[cfg(unix)]
        {
            let _ = std::fs::remove_file(folder.join("soft"));
            let _ = std::fs::remove_file(folder.join("hard"));
            std::os::unix::fs::symlink(input, folder.join("soft")).unwrap();
            std::fs::hard_link(folder.join(input), folder.join("hard")).unwrap();
        }
        let before = files(&folder);
        let dotted = format!("./{input}");
        let mut outputs = vec![input, dotted.as_str()];
        if cfg!(unix) {
            outputs.extend(["soft", "hard"]);
        }
        for output in outputs {
            let words: Vec<&str> = words
                .iter()
                .map(|word| if *word == "OUT" { output } else { word })
                .collect();
            let message = refused(&folder, &words, b"");
            assert!(message.contains("the same file as"), "{words:?}: {message}");
            assert_eq!(files(&folder), before, "{words:?}");
        }
    }
}

#[test]
fn a_dash_is_standard_output() {
    let (_kept, folder) = folder();
    let packed = good(&folder, &["pack", "a.csv", "-o", "-"], b"");
    let table = good(&folder, &["unpack", "-", "--output", "-"], &packed);
    assert_eq!(table, good(&folder, &["unpack", "-", "--output=-"], &packed));
    assert!(text(&table).starts_with("time,temp") && !folder.join("-").exists());
}

#[test]
fn second_input_and_second_output_are_compared_too() {
    let (_kept, folder) = folder();
    prepare(&folder);
    let before = files(&folder);
    for words in [
        &[
            "track",
            "walk.csv",
            "--model",
            "ranges",
            "--anchors",
            "anchors.csv",
            "-o",
            "anchors.csv",
        ][..],
        &[
            "track",
            "a.csv",
            "--columns",
            "temp",
            "--noise",
            "0.1",
            "-o",
            "x",
            "--plot",
            "x",
        ],
        &["pack", "a.fewb", "--append", "-o", "a.fewb"],
    ] {
        assert!(refused(&folder, words, b"").contains("the same file as"));
        assert_eq!(files(&folder), before, "{words:?}");
    }
}

#[cfg(unix)]
#[test]
fn redirected_input_and_output_are_compared_too() {
    use std::fs::File;
    use std::process::{Command, Stdio};
    let (_kept, folder) = folder();
    for words in [
        &["pack", "-", "-o", "a.csv"][..],
        &["pack", "a.csv"],
        &["send", "a.csv"],
    ] {
        let input = File::open(folder.join("a.csv")).unwrap();
        // Appending, as `>>` does: the shell has not emptied the file.
        let append = File::options().append(true).open(folder.join("a.csv")).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_fewbits"))
            .args(words)
            .current_dir(&folder)
            .stdin(input)
            .stdout(if words.len() == 2 {
                Stdio::from(append)
            } else {
                Stdio::null()
            })
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert_eq!(std::fs::read_to_string(folder.join("a.csv")).unwrap(), table(), "{words:?}");
    }
}

#[test]
fn failed_task_leaves_the_earlier_output() {
    let (_kept, folder) = folder();
    prepare(&folder);
    // The last row is refused, so that most rows were already written.
    std::fs::write(folder.join("bad.csv"), table() + "1700009999,1,2,x,4\n").unwrap();
    let unsorted = table() + "1,1,2,3,4\n";
    std::fs::write(folder.join("unsorted.csv"), unsorted).unwrap();
    let mut frames = std::fs::read(folder.join("a.frames")).unwrap();
    frames.truncate(20);
    std::fs::write(folder.join("bad.frames"), frames).unwrap();
    for output in ["old", "new"] {
        std::fs::write(folder.join("old"), "earlier").unwrap();
        for (words, code) in [
            (&["pack", "bad.csv", "--rows-per-block", "64", "-o", output][..], 2),
            (&["pack", "bad.csv", "--time", "exact", "--bound", "1%", "-o", output], 2),
            (&["send", "bad.csv", "--max-bytes", "100", "-o", output], 2),
            (&["unpack", "a.csv", "-o", output], 2),
            (&["cat", "a.fewb", "--columns", "none", "-o", output], 2),
            (&["receive", "bad.frames", "-o", output], 2),
            (
                &[
                    "track",
                    "unsorted.csv",
                    "--columns",
                    "temp",
                    "--noise",
                    "0.1",
                    "-o",
                    output,
                ],
                2,
            ),
            (
                &[
                    "design", "bad.csv", "--column", "price", "--noise", "1", "--bits", "1", "-o", output,
                ],
                2,
            ),
        ] {
            let before = files(&folder);
            let found = fewbits(&folder, words, b"");
            assert_eq!(found.status.code(), Some(code), "{words:?}: {}", text(&found.stderr));
            assert_eq!(files(&folder), before, "{words:?}");
        }
    }
}

#[test]
fn finished_task_replaces_the_earlier_output_and_leaves_nothing_beside() {
    let (_kept, folder) = folder();
    prepare(&folder);
    for (words, _) in WRITERS {
        std::fs::write(folder.join("old"), "earlier").unwrap();
        let before = files(&folder).len();
        let words: Vec<&str> = words
            .iter()
            .map(|word| if *word == "OUT" { "old" } else { word })
            .collect();
        good(&folder, &words, b"");
        assert_eq!(files(&folder).len(), before, "{words:?}");
        assert_ne!(std::fs::read(folder.join("old")).unwrap(), b"earlier", "{words:?}");
    }
}

#[cfg(unix)]
#[test]
fn links_and_permissions_of_an_output_stay() {
    use std::os::unix::fs::PermissionsExt;
    let (_kept, folder) = folder();
    std::fs::write(folder.join("target"), "earlier").unwrap();
    std::fs::set_permissions(folder.join("target"), PermissionsExt::from_mode(0o640)).unwrap();
    std::os::unix::fs::symlink("target", folder.join("link")).unwrap();
    good(&folder, &["pack", "a.csv", "-o", "link"], b"");
    assert!(folder.join("link").is_symlink());
    good(&folder, &["verify", "a.csv", "target"], b"");
    let mode = std::fs::metadata(folder.join("target")).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
}

#[test]
fn refused_append_leaves_the_recording() {
    let (_kept, folder) = folder();
    let options = ["-o", "a.fewb", "--rows-per-block", "64"];
    good(&folder, &[&["pack", "a.csv", "--time", "exact"][..], &options].concat(), b"");
    let before = std::fs::read(folder.join("a.fewb")).unwrap();
    // The last of 1000 rows is refused, the columns are others, there is no such table, a time is finer than a tick.
    std::fs::write(folder.join("late.csv"), table() + "1700009999,1,2,x,4\n").unwrap();
    std::fs::write(folder.join("fine.csv"), table() + "1700009999.00001,1,2,3,4\n").unwrap();
    std::fs::write(folder.join("other.csv"), "time,a\n1,2\n").unwrap();
    for file in ["late.csv", "fine.csv", "other.csv", "none.csv"] {
        refused(&folder, &["pack", file, "--append", "-o", "a.fewb"], b"");
        assert_eq!(std::fs::read(folder.join("a.fewb")).unwrap(), before, "{file}");
    }
    good(&folder, &["pack", "a.csv", "--append", "-o", "a.fewb"], b"");
    let rows = text(&good(&folder, &["unpack", "a.fewb"], b""));
    assert_eq!(rows.lines().count(), 2001);
}

/// Defect: the places of words in their list were appended to numbers, and verified as such.
#[test]
fn words_are_no_numbers_of_a_recording() {
    let (_kept, folder) = folder();
    std::fs::write(folder.join("n.csv"), "time,s\n0,0\n1,1\n2,0\n").unwrap();
    std::fs::write(folder.join("w.csv"), "time,s\n0,a\n1,b\n2,a\n").unwrap();
    good(&folder, &["pack", "n.csv", "--time", "exact", "-o", "n.fewb"], b"");
    let before = std::fs::read(folder.join("n.fewb")).unwrap();
    for words in [
        &["pack", "w.csv", "--append", "-o", "n.fewb"][..],
        &["verify", "w.csv", "n.fewb"],
    ] {
        let message = refused(&folder, words, b"");
        assert!(message.contains("column `s` holds words, and numbers are expected"), "{message}");
    }
    refused(&folder, &["pack", "-", "--append", "-o", "n.fewb"], b"time,s\n3,a\n4,b\n");
    assert_eq!(std::fs::read(folder.join("n.fewb")).unwrap(), before);
}

#[test]
fn append_of_earlier_times_is_told() {
    let (_kept, folder) = folder();
    std::fs::write(folder.join("n.csv"), "time,s\n10,0\n11,1\n").unwrap();
    std::fs::write(folder.join("later.csv"), "time,s\n11,0\n12,1\n").unwrap();
    good(&folder, &["pack", "n.csv", "--time", "exact", "-o", "n.fewb"], b"");
    let told = |file: &str| {
        let output = fewbits(&folder, &["pack", file, "--append", "-o", "n.fewb"], b"");
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("is before the last of n.fewb, 1")
    };
    assert!(!told("later.csv"));
    assert!(told("n.csv"));
}

#[test]
fn append_without_time_takes_the_times_of_the_table() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    good(&folder, &["pack", "a.csv", "--append", "-o", "a.fewb"], b"");
    let rows = text(&good(&folder, &["unpack", "a.fewb"], b""));
    let times: Vec<&str> = rows.lines().skip(1).map(|row| row.split(',').next().unwrap()).collect();
    assert_eq!(times[..1000], times[1000..]);
    good(&folder, &["pack", "a.csv", "--columns", "temp", "-o", "b.fewb"], b"");
    let words = [
        "pack",
        "a.csv",
        "--columns",
        "temp",
        "--time",
        "exact",
        "--append",
        "-o",
        "b.fewb",
    ];
    assert!(refused(&folder, &words, b"").contains("have no times"));
}

/// Commands that append at once: one is refused, or they follow each other. No row is lost, mixed or doubled.
#[test]
fn two_appenders_lose_nothing() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    let mut expected = 1000;
    for _ in 0..5 {
        let both = [(); 2].map(|()| start(&folder, &["pack", "a.csv", "--append", "-o", "a.fewb"]));
        for child in both {
            let output = child.wait_with_output().unwrap();
            match output.status.code() {
                Some(0) => expected += 1000,
                code => {
                    assert_eq!(code, Some(2));
                    assert!(text(&output.stderr).contains("being written by another program"));
                }
            }
        }
        let rows = text(&good(&folder, &["cat", "a.fewb", "--columns", "price"], b""));
        assert_eq!(rows.lines().count(), expected + 1);
    }
}

/// Kills at different moments of appending: the recording has all new rows or none, and is whole.
#[test]
fn killed_append_leaves_the_recording_or_completes_it() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    let mut rows = 1000;
    for wait in [4, 8, 12, 16, 20, 24, 28, 32, 40, 60] {
        let mut child = start(&folder, &["pack", "a.csv", "--append", "-o", "a.fewb"]);
        std::thread::sleep(std::time::Duration::from_millis(wait));
        let _ = child.kill();
        child.wait().unwrap();
        let info: serde_json::Value =
            serde_json::from_slice(&good(&folder, &["info", "a.fewb", "--json"], b"")).unwrap();
        let found = info["rows"].as_u64().unwrap();
        assert!(found == rows || found == rows + 1000, "{found} rows after {rows}");
        rows = found;
    }
    good(&folder, &["pack", "a.csv", "--append", "-o", "a.fewb"], b"");
    let left = files(&folder)
        .iter()
        .filter(|(name, _)| name.contains("fewbits-new") || name.ends_with(".append"))
        .count();
    assert_eq!(left, 0);
}

#[test]
fn appended_rows_follow() {
    let (_kept, folder) = folder();
    let options = ["pack", "a.csv", "-o", "a.fewb", "--columns", "price,temp"];
    good(&folder, &[&options[..], &["--bound", "*=±0.01"]].concat(), b"");
    good(&folder, &[&options[..], &["--append"]].concat(), b"");
    let unpacked = text(&good(&folder, &["unpack", "a.fewb"], b""));
    assert_eq!(unpacked.lines().count(), 2001);
    let message = refused(&folder, &["pack", "a.csv", "-o", "a.fewb", "--append"], b"");
    assert!(message.contains("--columns"), "{message}");
}

/// A name that ends as that of something else is refused before anything is written, with what would write it.
#[test]
fn names_of_outputs_end_as_what_is_written() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "-o", "a.fewb"], b"");
    let design = "design --prior normal:0,1 --noise 0.5 --bits 1 -o";
    for (words, name, mend) in [
        ("pack a.csv -o", "b.csv", "`.fewb`"),
        ("pack a.csv -o", "b.fewb.gz", "pipe"),
        ("send a.csv -o", "b.json", "`.fewb`"),
        ("repack a.fewb --bound temp=±1 -o", "b.parquet", "`.fewb`"),
        ("receive a.fewb -o", "b.FEWB", "fewbits pack - -o"),
        ("receive a.fewb -o", "b.arrow", "`.parquet`"),
        ("unpack a.fewb -o", "b.json", "fewbits cat --json"),
        ("unpack a.fewb -o", "b.csv.zst", "pipe"),
        ("cat a.fewb --json -o", "b.csv", "`.jsonl`"),
        ("cat a.fewb --json -o", "b.parquet", "`.jsonl`"),
        ("cat a.fewb --every 60s -o", "b.parquet", "`.csv`"),
        ("track a.csv --columns temp -o", "b.parquet", "`.csv`"),
        ("track a.csv --columns temp -o", "b.jsonl", "--json"),
        ("track a.csv --columns temp --plot", "b.png", "`.svg`"),
        ("fit a.csv -o", "b.csv", "`.json`"),
        (design, "b.json", "--json"),
    ] {
        let all: Vec<&str> = words.split(' ').chain([name]).collect();
        let message = refused(&folder, &all, b"");
        assert!(message.contains(name) && message.contains(mend), "{words}: {message}");
        assert!(!folder.join(name).exists());
    }
    // Other endings say nothing.
    good(&folder, &["pack", "a.csv", "-o", "b.2024"], b"");
    good(&folder, &["unpack", "a.fewb", "-o", "b.txt"], b"");
}

/// A second recorder into a file would put its own in place of the first one's, whose rows are then nowhere.
#[cfg(unix)]
#[test]
fn second_recorder_into_one_file_is_refused() {
    let (_kept, folder) = folder();
    for earlier in [false, true] {
        let words = ["pack", "-", "--deadline", "10ms", "-o", "w.fewb"];
        if earlier {
            good(&folder, &["pack", "a.csv", "-o", "w.fewb"], b"");
        }
        let before = files(&folder);
        let mut first = start(&folder, &words);
        first.stdin.as_mut().unwrap().write_all(table().as_bytes()).unwrap();
        wait_for("the first recorder writes", || files(&folder) != before);
        for words in [&words[..], &["pack", "a.csv", "-o", "w.fewb"]] {
            let message = refused(&folder, words, table().as_bytes());
            assert!(message.contains("w.fewb: another command writes to it"), "{message}");
        }
        drop(first.stdin.take());
        assert!(first.wait().unwrap().success());
        good(&folder, &["verify", "a.csv", "w.fewb"], b"");
        std::fs::remove_file(folder.join("w.fewb")).unwrap();
    }
}

/// What is read before it is continued is a file: a pipe would be waited for without an end.
#[cfg(unix)]
#[test]
fn pipe_is_not_continued() {
    let (_kept, folder) = folder();
    let made = std::process::Command::new("mkfifo").arg(folder.join("pipe")).status();
    assert!(made.unwrap().success());
    assert!(refused(&folder, &["pack", "a.csv", "--append", "-o", "pipe"], b"").contains("this is no file"));
}
