//! Several files for one task: lines, failures, shares, kills.

use crate::{fewbits, folder, good, refused, start, text};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// Tables of different content in a folder `in`.
fn tables(folder: &Path, count: usize) {
    std::fs::create_dir(folder.join("in")).unwrap();
    for file in 0..count {
        let mut table = "time,temp,flow\n".to_owned();
        for row in 0..300 {
            let x = f64::from(row) + file as f64;
            table += &format!("{row},{},{}\n", 20.0 + (0.03 * x).sin(), (100.0 * (0.01 * x).cos()).round());
        }
        std::fs::write(folder.join(format!("in/t{file:02}.csv")), table).unwrap();
    }
}

/// The files of a folder that are no hidden ones.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).unwrap()))
        .filter(|(name, _)| !name.starts_with('.'))
        .collect()
}

fn recordings(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let all = content(folder);
    all.into_iter().filter(|(name, _)| name.ends_with(".fewb")).collect()
}

const PACK: [&str; 6] = ["pack", "in/*.csv", "--time", "exact", "--bound", "*=±0.1"];

#[test]
fn every_file_has_a_line_and_failures_do_not_stop_the_rest() {
    let (_kept, folder) = folder();
    tables(&folder, 6);
    std::fs::write(folder.join("in/t02.csv"), "time,temp,flow\n1,2\n").unwrap();
    std::fs::write(folder.join("in/t04.csv"), "").unwrap();
    let output = fewbits(&folder, &[&PACK[..], &["-o", "out"]].concat(), b"");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().count(), 7, "{said}");
    for (file, part) in [("t00", "300 rows of 2 columns"), ("t02", "error: "), ("t04", "error: ")] {
        let line = said
            .lines()
            .find(|line| line.starts_with(&format!("in/{file}.csv: ")))
            .unwrap();
        assert!(line.contains(part), "{line}");
    }
    assert!(said.ends_with("4 of 6 files done, 2 refused\n"), "{said}");
    assert_eq!(recordings(&folder.join("out")).len(), 4);
    // The same bytes as one by one, and by any number of jobs.
    for file in ["t00", "t05"] {
        let table = format!("in/{file}.csv");
        good(&folder, &["pack", &table, "--time", "exact", "--bound", "*=±0.1", "-o", "one"], b"");
        assert_eq!(
            std::fs::read(folder.join("one")).unwrap(),
            recordings(&folder.join("out"))[&format!("{file}.fewb")]
        );
    }
    // What was refused is tried again, what was done is kept.
    let output = fewbits(&folder, &[&PACK[..], &["-o", "out", "--jobs", "1"]].concat(), b"");
    assert!(text(&output.stderr).ends_with("0 of 6 files done, 4 done before, 2 refused\n"));
    // Other options are other work.
    let words = [
        "pack",
        "in/t00.csv",
        "in/t01.csv",
        "--time",
        "exact",
        "--bound",
        "*=±0.2",
        "-o",
        "out",
    ];
    assert!(text(&fewbits(&folder, &words, b"").stderr).ends_with("2 of 2 files done\n"));
}

#[test]
fn several_files_are_verified_and_tracked() {
    let (_kept, folder) = folder();
    tables(&folder, 4);
    good(&folder, &[&PACK[..], &["-o", "out"]].concat(), b"");
    let output = fewbits(&folder, &["verify", "in/t00.csv", "in/t01.csv", "out"], b"");
    let said = text(&output.stderr);
    assert!(
        output.status.success() && said.contains("in/t01.csv: ") && said.contains("all promises hold"),
        "{said}"
    );
    std::fs::copy(folder.join("in/t00.csv"), folder.join("in/t01.csv")).unwrap();
    let output = fewbits(&folder, &["verify", "in/*.csv", "out"], b"");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).ends_with("3 of 4 files done, 1 failed\n"));
    let words = [
        "track",
        "in/*.csv",
        "--columns",
        "temp",
        "--noise",
        "0.1",
        "-o",
        "tracks",
        "--jobs",
        "2",
    ];
    good(&folder, &words, b"");
    let tracks = content(&folder.join("tracks"));
    assert_eq!(tracks.keys().filter(|name| name.ends_with(".track.csv")).count(), 4);
    assert_eq!(text(&tracks["t03.track.csv"]).lines().count(), 301);
}

#[test]
fn shares_are_the_whole() {
    let (_kept, folder) = folder();
    tables(&folder, 7);
    good(&folder, &[&PACK[..], &["-o", "whole"]].concat(), b"");
    for (share, count) in [("1/3", 3), ("2/3", 5), ("3/3", 7)] {
        good(&folder, &[&PACK[..], &["-o", "shares", "--shard", share]].concat(), b"");
        assert_eq!(recordings(&folder.join("shares")).len(), count);
    }
    assert_eq!(recordings(&folder.join("shares")), recordings(&folder.join("whole")));
    assert!(folder.join("shares/fewbits-pack-2-of-3.jsonl").is_file());
}

#[test]
fn several_files_without_places_of_their_own_are_refused() {
    let (_kept, folder) = folder();
    tables(&folder, 2);
    std::fs::create_dir(folder.join("other")).unwrap();
    std::fs::copy(folder.join("in/t00.csv"), folder.join("other/t00.csv")).unwrap();
    let message = refused(&folder, &["pack", "in/t00.csv", "in/t01.csv"], b"");
    assert!(message.contains("--output FOLDER"), "{message}");
    let message = refused(&folder, &["pack", "in/t00.csv", "other/t00.csv", "-o", "out"], b"");
    assert!(message.contains("both in/t00.csv and other/t00.csv"), "{message}");
    let message = refused(&folder, &["pack", "none*.csv", "-o", "out"], b"");
    assert!(message.contains("none*.csv"), "{message}");
    let message = refused(&folder, &["pack", "in/t00.csv", "-", "-o", "out"], b"");
    assert!(message.contains("alone"), "{message}");
    // A table with the name of the other's recording.
    std::fs::write(folder.join("in/t00.fewb"), "a\n1\n").unwrap();
    let before = content(&folder.join("in"));
    let message = refused(&folder, &["pack", "in/t00.csv", "in/t00.fewb", "-o", "in"], b"");
    assert!(message.contains("the same file as"), "{message}");
    assert_eq!(content(&folder.join("in")), before);
}

/// Kills at different moments, then the same command once more: as without kills.
#[test]
fn killed_work_goes_on_with_the_same_bytes() {
    let (_kept, folder) = folder();
    tables(&folder, 12);
    good(&folder, &[&PACK[..], &["-o", "whole"]].concat(), b"");
    let words = [&PACK[..], &["-o", "killed", "--jobs", "2"]].concat();
    for wait in [5, 15, 30, 45, 60, 80] {
        let mut child = start(&folder, &words);
        std::thread::sleep(Duration::from_millis(wait));
        let _ = child.kill();
        child.wait().unwrap();
        // Whatever has its final name is whole.
        let killed = folder.join("killed");
        if !killed.exists() {
            continue;
        }
        for (name, bytes) in recordings(&killed) {
            assert_eq!(Some(&bytes), recordings(&folder.join("whole")).get(&name), "{name}");
        }
    }
    good(&folder, &words, b"");
    assert_eq!(recordings(&folder.join("killed")), recordings(&folder.join("whole")));
    let manifest = |of: &str| {
        let text = text(&content(&folder.join(of))["fewbits-pack.jsonl"]);
        text.replace(&format!("\"{of}/"), "\"")
            .lines()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(manifest("killed"), manifest("whole"));
    // No unfinished file of a killed run is left.
    let left: Vec<_> = std::fs::read_dir(folder.join("killed"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.contains("fewbits-new"))
        .collect();
    assert_eq!(left, [""; 0]);
}

/// Recordings of several blocks have an identity. It comes from the table and the options, so that the same command gives the same bytes.
#[test]
fn the_same_table_gives_the_same_bytes() {
    let (_kept, folder) = folder();
    tables(&folder, 2);
    let pack = |file: &str, bound: &str, output: &str| {
        let words = [
            "pack",
            file,
            "--time",
            "exact",
            "--bound",
            bound,
            "--rows-per-block",
            "64",
            "-o",
            output,
        ];
        good(&folder, &words, b"");
        std::fs::read(folder.join(output)).unwrap()
    };
    let first = pack("in/t00.csv", "*=±0.1", "a");
    assert_eq!(pack("in/t00.csv", "*=±0.1", "b"), first);
    std::fs::copy(folder.join("in/t00.csv"), folder.join("copy.csv")).unwrap();
    assert_eq!(pack("copy.csv", "*=±0.1", "c"), first);
    // Another table with the same columns has another identity (bytes 5 to 9 or so differ), as has one with another bound.
    let head = |bytes: &[u8]| bytes[..12].to_vec();
    assert_ne!(head(&pack("in/t01.csv", "*=±0.1", "d")), head(&first));
    assert_ne!(head(&pack("in/t00.csv", "*=±0.2", "e")), head(&first));
}
