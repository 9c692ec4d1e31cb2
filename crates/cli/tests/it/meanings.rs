//! Times and units keep what they mean where tables and recordings are put together.

use crate::{folder, good, refused, start, text, wait_for};
use std::io::Write;
use std::path::Path;

fn put(folder: &Path, name: &str, lines: &[&str]) {
    std::fs::write(folder.join(name), lines.join("\n") + "\n").unwrap();
}

fn pack(folder: &Path, name: &str) {
    good(
        folder,
        &[
            "pack",
            &format!("{name}.csv"),
            "--time",
            "exact",
            "-o",
            &format!("{name}.fewb"),
        ],
        b"",
    );
}

#[test]
fn times_of_another_kind_are_not_appended() {
    let (_kept, folder) = folder();
    put(&folder, "utc.csv", &["time,v", "2024-03-05T10:00:00Z,1"]);
    put(&folder, "local.csv", &["time,v", "2024-03-05T11:00:00,1"]);
    put(&folder, "run.csv", &["time,v", "1,1", "2,2"]);
    put(&folder, "day.csv", &["time,v", "12:00:00,1", "12:00:01,1"]);
    put(&folder, "since.csv", &["time,v", "1709640000,1", "1709640001,2"]);
    for name in ["utc", "local", "run", "since"] {
        pack(&folder, name);
    }
    for (to, table, mend) in [
        ("utc", "local", "--time-zone UTC"),
        ("utc", "run", "of its own"),
        ("utc", "day", "of its own"),
        ("local", "utc", "of its own"),
        ("local", "since", "of its own"),
        ("run", "utc", "of its own"),
        ("run", "local", "of its own"),
    ] {
        let (file, csv) = (format!("{to}.fewb"), format!("{table}.csv"));
        let before = std::fs::read(folder.join(&file)).unwrap();
        let refusal = refused(&folder, &["pack", &csv, "--append", "-o", &file], b"");
        assert!(refusal.contains("its times are") && refusal.contains(mend), "{refusal}");
        assert_eq!(std::fs::read(folder.join(&file)).unwrap(), before, "{table} to {to}");
    }
    good(&folder, &["pack", "since.csv", "--append", "-o", "utc.fewb"], b"");
    good(
        &folder,
        &[
            "pack",
            "local.csv",
            "--time-zone",
            "+02:00",
            "--append",
            "-o",
            "utc.fewb",
        ],
        b"",
    );
    good(&folder, &["pack", "utc.csv", "--append", "-o", "since.fewb"], b"");
    let rows = text(&good(&folder, &["unpack", "utc.fewb"], b""));
    assert!(rows.ends_with("2024-03-05T12:00:01Z,2\n2024-03-05T09:00:00Z,1\n"), "{rows}");
}

#[test]
fn columns_of_other_units_are_not_put_together() {
    let (_kept, folder) = folder();
    put(&folder, "c.csv", &["time,T", "s,degC", "1,20", "2,21", "3,22"]);
    put(&folder, "f.csv", &["time,T", "s,degF", "4,70", "5,71", "6,72"]);
    put(&folder, "n.csv", &["time,T", "7,23", "8,24"]);
    for name in ["c", "f", "n"] {
        pack(&folder, name);
    }
    for words in [
        &["pack", "f.csv", "--append", "-o", "c.fewb"][..],
        &["cat", "c.fewb", "f.fewb"],
        &["unpack", "c.fewb", "f.fewb"],
        &["cat", "c.fewb", "f.fewb", "--every", "1m"],
    ] {
        let refusal = refused(&folder, words, b"");
        assert!(refusal.contains("column `T` is in degF, and in degC in c.fewb"), "{refusal}");
    }
    // A unit that is not stated may be the same.
    good(&folder, &["pack", "n.csv", "--append", "-o", "c.fewb"], b"");
}

#[test]
fn recordings_of_other_decimals_are_one_table() {
    let (_kept, folder) = folder();
    put(&folder, "a.csv", &["time,v", "2024-03-05T10:00:00Z,1", "2024-03-05T10:00:02Z,3"]);
    put(&folder, "b.csv", &["time,v", "2024-03-05T10:00:01.250Z,2", "2024-03-05T10:00:03.5Z,4"]);
    pack(&folder, "a");
    pack(&folder, "b");
    for words in [&["cat", "a.fewb", "b.fewb"], &["cat", "b.fewb", "a.fewb"]] {
        let rows = text(&good(&folder, &words[..], b""));
        let expected = ["10:00:00Z,1", "10:00:01.250Z,2", "10:00:02Z,3", "10:00:03.500Z,4"];
        let expected: String = expected.iter().map(|row| format!("2024-03-05T{row}\n")).collect();
        assert_eq!(rows, format!("time,v\n{expected}"));
    }
    let from = [
        "cat",
        "a.fewb",
        "b.fewb",
        "--from",
        "2024-03-05T10:00:00.5Z",
        "--to",
        "2024-03-05T10:00:02.5Z",
    ];
    assert_eq!(text(&good(&folder, &from, b"")).lines().count(), 3);
    for names in [["a.fewb", "b.fewb"], ["b.fewb", "a.fewb"]] {
        let rows = text(&good(&folder, &["cat", names[0], names[1], "--every", "2s"], b""));
        assert_eq!(rows, "time,v mean\n2024-03-05T10:00:00Z,1.5\n2024-03-05T10:00:02Z,3.5\n");
    }
    put(&folder, "c.csv", &["time,v", "2024-03-05T10:00:00,1"]);
    pack(&folder, "c");
    // Equal digits are other times.
    put(&folder, "d.csv", &["time,v", "2024-03-05T10:00:00,1", "2024-03-05T10:00:02,3"]);
    assert!(refused(&folder, &["verify", "d.csv", "a.fewb"], b"").contains("say --time-zone UTC"));
    good(&folder, &["verify", "d.csv", "a.fewb", "--time-zone", "UTC"], b"");
    assert!(refused(&folder, &["verify", "a.csv", "c.fewb"], b"").contains("no zone or date"));
    let refusal = refused(&folder, &["cat", "a.fewb", "c.fewb"], b"");
    assert!(refusal.contains("times without a zone in recording 2: expected UTC, as in the first"), "{refusal}");
}

#[test]
fn ends_of_a_range_mean_what_they_say() {
    let (_kept, folder) = folder();
    put(&folder, "local.csv", &["time,v", "2024-03-05T11:00:00,1", "2024-03-05T11:00:10,2"]);
    put(&folder, "run.csv", &["time,v", "1,1", "2,2"]);
    pack(&folder, "local");
    pack(&folder, "run");
    for zoned in ["2024-03-05T11:00:05Z", "2024-03-05T11:00:05+02:00"] {
        assert!(refused(&folder, &["cat", "local.fewb", "--from", zoned], b"").contains("without a zone"), "{zoned}");
    }
    let of = |words: &[&str]| text(&good(&folder, &[&["cat", "run.fewb"], words].concat(), b""));
    assert_eq!(of(&["--from", "1.5"]), "time,v\n2,2\n");
    assert_eq!(of(&["--to", "1.5"]), "time,v\n1,1\n");
    for every in ["1month", "1M", "2years", "1y 1d"] {
        assert!(refused(&folder, &["cat", "local.fewb", "--every", every], b"").contains("of one length"), "{every}");
    }
    good(&folder, &["cat", "local.fewb", "--every", "1day"], b"");
}

#[cfg(unix)]
#[test]
fn a_signal_is_the_end_of_a_line_and_of_a_pipe() {
    let (_kept, folder) = folder();
    let message = b"[{\"n\":\"a\",\"v\":1,\"t\":1.7e9}]\n";
    put(&folder, "day.csv", &["earlier"]);
    let mut child = start(&folder, &["receive", "--format", "senml", "-", "-o", "day.csv"]);
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(message).unwrap();
    let written = || {
        let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
        files
            .into_iter()
            .any(|path| std::fs::read_to_string(path).is_ok_and(|text| text.ends_with("1700000000,a,1,\n")))
    };
    wait_for("the row", written);
    super::signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    let said = text(&output.stderr);
    assert!(output.status.success() && said.contains("ended by a signal"), "{said}");
    let rows = std::fs::read_to_string(folder.join("day.csv")).unwrap();
    assert_eq!(rows, "time,name,value,unit\n1700000000,a,1,\n");

    // A named pipe stands for a line.
    let made = std::process::Command::new("mkfifo").arg(folder.join("line")).status();
    assert!(made.unwrap().success());
    let child = start(&folder, &["receive", "--serial", "line", "-o", "line.csv"]);
    let _open = std::fs::OpenOptions::new()
        .write(true)
        .open(folder.join("line"))
        .unwrap();
    good(&folder, &["send", "a.csv", "--time", "exact", "--serial", "line"], b"");
    let count = |name: &str| std::fs::read_to_string(folder.join(name)).map_or(0, |text| text.lines().count());
    wait_for("rows", || count("line.csv") == count("a.csv"));
    super::signal(&child, "-TERM");
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stderr);
    assert!(output.status.success() && said.contains("ended by a signal"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_whole_rows() {
    let (_kept, folder) = folder();
    let rows: String = (0..3000).map(|i| format!("{i},{}\n", f64::from(i) / 7.0)).collect();
    std::fs::write(folder.join("b.csv"), format!("time,x\n{rows}")).unwrap();
    good(&folder, &["send", "b.csv", "--time", "exact", "-o", "b.frames"], b"");
    // The limit of a file's size stands for that of a disk.
    let command = env!("CARGO_BIN_EXE_fewbits");
    let script = format!("trap '' XFSZ; ulimit -f 25; cat b.frames | {command} receive - -o r.csv");
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .current_dir(&folder)
        .output()
        .unwrap();
    let found = std::fs::read_to_string(folder.join("r.csv")).unwrap();
    assert!(!output.status.success() && text(&output.stderr).contains("r.csv"), "{}", text(&output.stderr));
    assert!(found.len() > 8000 && found.ends_with('\n'), "{}", found.len());
    assert!(format!("time,x\n{rows}").starts_with(&found));
}
