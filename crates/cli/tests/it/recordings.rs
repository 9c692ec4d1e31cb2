//! Tasks on recordings: stretches of time, several recordings as one table, wider bounds.

use crate::{fewbits, folder, good, refused, text};
use std::path::Path;

/// Rows of a text with commas.
fn cells(csv: &[u8]) -> Vec<Vec<String>> {
    text(csv)
        .lines()
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

fn number(cell: &str) -> f64 {
    cell.parse().unwrap()
}

#[test]
fn stretches_are_means_of_the_rows() {
    let (_kept, folder) = folder();
    for (name, rows_per_block) in [("a", "65536"), ("b", "100")] {
        let file = format!("{name}.fewb");
        let words = [
            "pack",
            "a.csv",
            "--bound",
            "temp=±0.1",
            "--time",
            "exact",
            "-o",
            &file,
            "--independent",
            rows_per_block,
        ];
        good(&folder, &words, b"");
        let words = [
            "cat",
            &file,
            "--columns",
            "temp,flow",
            "--every",
            "5m",
            "--mean",
            "--min",
            "--max",
            "--count",
        ];
        let found = cells(&good(&folder, &words, b""));
        assert_eq!(found[0][..3], ["time", "temp mean", "temp min"].map(str::to_owned));
        let rows = cells(&good(&folder, &["cat", &file, "--columns", "temp,flow"], b""));
        let mut read = 0;
        for stretch in &found[1..] {
            let start = number(&stretch[0]);
            assert_eq!(start % 300.0, 0.0);
            let inside = rows[1..]
                .iter()
                .filter(|row| (start..start + 300.0).contains(&number(&row[0])));
            let inside: Vec<_> = inside.collect();
            for column in [1, 2] {
                let values: Vec<f64> = inside
                    .iter()
                    .filter(|row| !row[column].is_empty())
                    .map(|row| number(&row[column]))
                    .collect();
                let of = |kind: usize| number(&stretch[1 + 4 * (column - 1) + kind]);
                assert!((of(0) - values.iter().sum::<f64>() / values.len() as f64).abs() < 1e-9);
                assert_eq!(of(1), values.iter().copied().fold(f64::MAX, f64::min));
                assert_eq!(of(2), values.iter().copied().fold(f64::MIN, f64::max));
                assert_eq!(of(3), values.len() as f64);
            }
            read += inside.len();
        }
        assert_eq!(read, 1000);
    }
    // The mean is what is written if nothing is said; stretches of several recordings are put together.
    let one = cells(&good(&folder, &["cat", "a.fewb", "--columns", "price", "--every", "1h"], b""));
    let two = cells(&good(&folder, &["cat", "a.fewb", "b.fewb", "--columns", "price", "--every", "1h"], b""));
    assert_eq!(one[0], ["time", "price mean"].map(str::to_owned));
    assert!(one.len() == two.len() && (number(&one[1][1]) - number(&two[1][1])).abs() < 1e-9);
    for every in ["1x", "0s", "1us", "-1h", ""] {
        assert!(refused(&folder, &["cat", "a.fewb", "--every", every], b"").contains("--every"), "{every}");
    }
    assert!(refused(&folder, &["cat", "a.fewb", "--mean"], b"").contains("--every"));
}

#[test]
fn stretches_of_numbered_rows_count_rows() {
    let (_kept, folder) = folder();
    std::fs::write(folder.join("n.csv"), (0..50).fold("x\n".to_owned(), |all, i| format!("{all}{i}\n"))).unwrap();
    good(&folder, &["pack", "n.csv", "-o", "n.fewb"], b"");
    let found = text(&good(&folder, &["cat", "n.fewb", "--every", "20", "--from", "5", "--max", "--min"], b""));
    assert_eq!(found, "row,x min,x max\n0,5,19\n20,20,39\n40,40,49\n");
    assert!(refused(&folder, &["cat", "n.fewb", "--every", "1h"], b"").contains("number of rows"));
}

#[test]
fn several_recordings_are_one_table() {
    let (_kept, folder) = folder();
    let lines: Vec<String> = std::fs::read_to_string(folder.join("a.csv"))
        .unwrap()
        .lines()
        .map(str::to_owned)
        .collect();
    let part = |name: &str, keep: &dyn Fn(usize) -> bool| {
        let rows = lines[1..]
            .iter()
            .enumerate()
            .filter(|(i, _)| keep(*i))
            .map(|(_, line)| line.clone());
        let table: Vec<String> = std::iter::once(lines[0].clone()).chain(rows).collect();
        std::fs::write(folder.join(format!("{name}.csv")), table.join("\n") + "\n").unwrap();
        good(
            &folder,
            &[
                "pack",
                &format!("{name}.csv"),
                "--time",
                "exact",
                "-o",
                &format!("day-{name}.fewb"),
            ],
            b"",
        );
    };
    part("late", &|i| i >= 600);
    part("even", &|i| i < 600 && i % 2 == 0);
    part("odd", &|i| i < 600 && i % 2 == 1);
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "whole.fewb"], b"");
    let whole = good(&folder, &["unpack", "whole.fewb"], b"");
    assert_eq!(text(&good(&folder, &["unpack", "day-*.fewb"], b"")), text(&whole));
    let words = [
        "cat",
        "day-odd.fewb",
        "day-even.fewb",
        "--columns",
        "temp",
        "--from",
        "1700000100",
        "--to",
        "1700000200",
    ];
    let few = cells(&good(&folder, &words, b""));
    assert!(
        few.len() > 40
            && few
                .windows(2)
                .skip(1)
                .all(|pair| number(&pair[0][0]) < number(&pair[1][0]))
    );
    // Other columns are refused, an output that is one of the inputs too.
    good(
        &folder,
        &[
            "pack",
            "a.csv",
            "--time",
            "exact",
            "--columns",
            "temp",
            "-o",
            "other.fewb",
        ],
        b"",
    );
    assert!(refused(&folder, &["unpack", "whole.fewb", "other.fewb"], b"").contains("columns"));
    assert!(
        refused(&folder, &["unpack", "day-odd.fewb", "whole.fewb", "-o", "whole.fewb"], b"")
            .contains("the same file as")
    );
    assert!(refused(&folder, &["unpack", "nothing-*.fewb"], b"").contains("no file has a name like this"));
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

#[test]
fn repacked_recordings_state_both_bounds() {
    let (_kept, folder) = folder();
    let pack = [
        "pack",
        "a.csv",
        "--bound",
        "temp=±0.01,flow=0.1%,direction=±0.5@360,*=lossless",
        "--time",
        "exact",
        "-o",
        "a.fewb",
    ];
    good(&folder, &pack, b"");
    let before = bytes(&folder.join("a.fewb"));
    let repack = [
        "repack",
        "a.fewb",
        "--bound",
        "temp=±0.1,flow=1%,direction=±2",
        "-o",
        "b.fewb",
    ];
    good(&folder, &repack, b"");
    assert_eq!(bytes(&folder.join("a.fewb")), before);
    assert!(bytes(&folder.join("b.fewb")).len() < before.len());
    let info = text(&good(&folder, &["info", "b.fewb"], b""));
    assert!(info.contains("temp: ±0.1 (and ±0.01 of an earlier recording: ±0.11)"), "{info}");
    assert!(text(&good(&folder, &["verify", "a.csv", "b.fewb"], b"")).contains("all promises hold"));
    // In place, and a second time nothing changes.
    good(&folder, &["repack", "a.fewb", "--bound", "temp=±0.1,flow=1%,direction=±2"], b"");
    let once = bytes(&folder.join("a.fewb"));
    assert!(once.len() < before.len());
    let again = fewbits(&folder, &["repack", "a.fewb", "--bound", "temp=±0.1,flow=1%,direction=±2"], b"");
    assert!(text(&again.stderr).contains("left as it is") && bytes(&folder.join("a.fewb")) == once);
    let left: Vec<_> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left.len(), 3, "{left:?}");
}

#[test]
fn only_old_recordings_are_repacked() {
    let (_kept, folder) = folder();
    let now = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .unwrap()
        .as_secs();
    let rows = |start: u64| {
        (0..500).fold("time,x\n".to_owned(), |all, i| format!("{all}{},{}\n", start + i, (i as f64).sin()))
    };
    for (name, start) in [("old", now - 90 * 86_400), ("new", now - 1000)] {
        std::fs::write(folder.join(format!("{name}.csv")), rows(start)).unwrap();
        let (table, file) = (format!("{name}.csv"), format!("{name}.fewb"));
        good(&folder, &["pack", &table, "--time", "exact", "--bound", "±0.001", "-o", &file], b"");
    }
    let before = bytes(&folder.join("new.fewb"));
    let old = bytes(&folder.join("old.fewb"));
    good(&folder, &["repack", "*.fewb", "--bound", "±0.1", "--older-than", "30d"], b"");
    assert_eq!(bytes(&folder.join("new.fewb")), before);
    assert!(bytes(&folder.join("old.fewb")).len() < old.len());
    assert!(text(&good(&folder, &["verify", "old.csv", "old.fewb"], b"")).contains("all promises hold"));
}

#[test]
fn damaged_recordings_stay_as_they_are() {
    let (_kept, folder) = folder();
    good(
        &folder,
        &[
            "pack",
            "a.csv",
            "--time",
            "exact",
            "--independent",
            "100",
            "-o",
            "a.fewb",
        ],
        b"",
    );
    let whole = bytes(&folder.join("a.fewb"));
    for damage in [0, 1] {
        let mut damaged = whole.clone();
        match damage {
            0 => damaged[whole.len() / 2] ^= 1,
            _ => damaged.truncate(whole.len() - 9),
        }
        std::fs::write(folder.join("a.fewb"), &damaged).unwrap();
        refused(&folder, &["repack", "a.fewb", "--bound", "±1"], b"");
        assert_eq!(bytes(&folder.join("a.fewb")), damaged);
        let left: Vec<_> = std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(left.len(), 2, "{left:?}");
    }
}

#[test]
fn relative_bounds_are_packed_shown_and_verified() {
    let (_kept, folder) = folder();
    let table = (0..2000).fold("x\n".to_owned(), |all, i| {
        format!("{all}{}\n", (f64::from(i) * 0.01).sin() * f64::from(i % 700).exp2().min(1e6))
    });
    std::fs::write(folder.join("r.csv"), table).unwrap();
    good(&folder, &["pack", "r.csv", "--bound", "rel:1%±0.001", "-o", "r.fewb"], b"");
    assert!(text(&good(&folder, &["info", "r.fewb"], b"")).contains("x: rel:1%±0.001"));
    assert!(text(&good(&folder, &["verify", "r.csv", "r.fewb"], b"")).contains("all promises hold"));
    let samples = cells(&bytes(&folder.join("r.csv")));
    let values = cells(&good(&folder, &["unpack", "r.fewb"], b""));
    for (sample, value) in samples.iter().zip(&values).skip(1) {
        let (sample, value) = (number(&sample[0]), number(&value[0]));
        assert!((sample - value).abs() <= (0.01 * sample.abs()).max(0.001), "{sample} {value}");
    }
    for bound in [
        "rel:1%",
        "rel:±0.1",
        "rel:1±0.1",
        "rel:x%±1",
        "rel:1%±",
        "rel:60%±1",
        "rel:1%±0",
        "rel:1%±1@360",
    ] {
        refused(&folder, &["pack", "r.csv", "--bound", bound, "-o", "s.fewb"], b"");
    }
}

#[test]
fn stretches_of_whole_numbers_are_exact() {
    let (_kept, folder) = folder();
    let table = |from: i64| (0..60).fold("time,id\n".to_owned(), |all, i| format!("{all}{i},{}\n", from + 3 * i));
    for (name, from) in [("a", 9_007_199_254_740_993), ("b", 9_007_199_254_742_001), ("c", 5)] {
        std::fs::write(folder.join(format!("{name}.csv")), table(from)).unwrap();
        let words = ["pack", &format!("{name}.csv"), "--time", "exact", "-o", name];
        good(&folder, &words, b"");
    }
    let words = ["cat", "a", "--every", "30s", "--min", "--max", "--count"];
    assert_eq!(
        text(&good(&folder, &words, b"")),
        "time,id min,id max,id count\n0,9007199254740993,9007199254741080,30\n30,9007199254741083,9007199254741170,30\n"
    );
    let words = ["cat", "a", "b", "--every", "1m", "--min", "--max", "--count"];
    assert_eq!(
        text(&good(&folder, &words, b"")),
        "time,id min,id max,id count\n0,9007199254740993,9007199254742178,120\n"
    );
    let said = refused(&folder, &["cat", "a", "c", "--every", "1m"], b"");
    assert!(said.contains("whole numbers of 64 bits"), "{said}");
}
