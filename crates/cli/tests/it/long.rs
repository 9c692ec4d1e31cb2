//! Long tables, second columns of times, whole numbers beyond doubles, words among numbers: through the command.

use super::{fewbits, good, refused, text};
use tempfile::TempDir;

fn folder(name: &str, content: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), content).unwrap();
    folder
}

/// A row per reading: two sensors and a switch.
fn long() -> String {
    let mut table = "entity_id,state,last_changed\n".to_owned();
    for i in 0..60 {
        let time = format!("2024-03-05T{:02}:{:02}:00Z", i / 30, 2 * (i % 30));
        table +=
            &format!("sensor.t,{}.25,{time}\nswitch.fan,{},{time}\n", 20 + i % 7, ["on", "off", "unavailable"][i % 3]);
        if i % 2 == 0 {
            table += &format!("sensor.p,{},{time}\n", 1000 + i);
        }
    }
    table
}

#[test]
fn long_tables_become_wide_in_every_command() {
    let kept = folder("h.csv", &long());
    let path = kept.path();
    let by = ["--by", "entity_id"];
    let words = [
        &[
            "pack",
            "h.csv",
            "--time",
            "exact",
            "--bound",
            "sensor.t=±0.5",
            "-o",
            "h.fewb",
        ][..],
        &by,
    ]
    .concat();
    good(path, &words, b"");
    let back = text(&good(path, &["unpack", "h.fewb"], b""));
    let lines: Vec<&str> = back.lines().collect();
    assert_eq!((lines.len(), lines[0]), (61, "last_changed,sensor.t,switch.fan,sensor.p"));
    assert!(
        lines[2].starts_with("2024-03-05T00:02:00Z,") && lines[2].ends_with(",0,") && lines[1].ends_with(",1,1000"),
        "{back}"
    );
    let verdict = text(&good(path, &[&["verify", "h.csv", "h.fewb"][..], &by].concat(), b""));
    assert!(verdict.contains("60 rows: all promises hold"), "{verdict}");
    let look = text(&good(path, &[&["look", "h.csv"][..], &by].concat(), b""));
    for part in [
        "60 rows",
        "sensor.t: number, 20.25 to 26.25",
        "switch.fan: boolean",
        "steps of 120 to 120 s",
        "--by 'entity_id'",
    ] {
        assert!(look.contains(part), "{part}\n{look}");
    }
    for command in ["plan", "bench"] {
        let shown = text(&good(path, &[&[command, "h.csv", "--columns", "sensor.t,sensor.p"][..], &by].concat(), b""));
        assert!(shown.contains("60 rows"), "{command}: {shown}");
    }
    good(path, &[&["send", "h.csv", "--time", "exact", "-o", "h.frames"][..], &by].concat(), b"");
    assert_eq!(text(&good(path, &["receive", "h.frames"], b"")).lines().count(), 61);
    // Columns of the long table choose its values; gaps of one sensor are named by it; faults have their line in the file.
    let noted = long().replace("state,", "state,note,").replace(",2024", ",x,2024");
    std::fs::write(path.join("n.csv"), &noted).unwrap();
    let words = [
        "pack",
        "n.csv",
        "--time",
        "exact",
        "--columns",
        "state",
        "--missing",
        "sensor.p=1004",
        "-o",
        "n.fewb",
    ];
    good(path, &[&words[..], &by].concat(), b"");
    let back = text(&good(path, &["unpack", "n.fewb"], b""));
    assert!(
        back.starts_with("last_changed,sensor.t,switch.fan,sensor.p\n") && back.lines().nth(5).unwrap().ends_with(','),
        "{back}"
    );
    let bad = long().replacen("1050,", "10.5.0,", 1);
    let line = bad.lines().position(|line| line.contains("10.5.0")).unwrap() + 1;
    std::fs::write(path.join("b.csv"), bad).unwrap();
    let message = refused(path, &[&["pack", "b.csv", "--time", "exact", "-o", "b.fewb"][..], &by].concat(), b"");
    // The line at which its row of the wide table begins.
    assert!(
        message.contains(&format!("line {}", line - 2)) && message.contains("column `sensor.p`: `10.5.0`"),
        "{message}"
    );
    let message = refused(path, &["pack", "h.csv", "--by", "entity", "-o", "b.fewb"], b"");
    assert!(message.contains("no column `entity`"), "{message}");
}

#[test]
fn a_share_of_a_range_beside_a_second_column_of_times() {
    let table = (0..40).fold("time,x,seen\n".to_owned(), |table, i| {
        table + &format!("2024-03-05T00:{i:02}:00Z,{},2024-03-05T00:{i:02}:30Z\n", 20 + i % 5)
    });
    let kept = folder("t.csv", &table);
    let words = [
        "pack",
        "t.csv",
        "--time",
        "exact",
        "--bound",
        "1%,seen=lossless",
        "-o",
        "t.fewb",
    ];
    good(kept.path(), &words, b"");
    let verdict = text(&good(kept.path(), &["verify", "t.csv", "t.fewb"], b""));
    assert!(verdict.contains("all promises hold"), "{verdict}");
    assert!(text(&good(kept.path(), &["unpack", "t.fewb"], b"")).contains(",1709596830\n"));
}

#[test]
fn whole_numbers_beyond_doubles_are_shown_and_can_be_left_out() {
    let table = (0..20).fold("time,id,x\n".to_owned(), |table, i| {
        table + &format!("{i},{},{i}.5\n", 9_007_199_254_740_993_i64 + i)
    });
    let kept = folder("t.csv", &table);
    let path = kept.path();
    let look = text(&good(path, &["look", "t.csv"], b""));
    assert!(look.contains("id: integer, 9007199254740993 to 9007199254741012"), "{look}");
    let json: serde_json::Value = serde_json::from_slice(&good(path, &["look", "t.csv", "--json"], b"")).unwrap();
    assert_eq!(json["columns"][1]["max"], serde_json::json!(9_007_199_254_741_012_i64));
    good(path, &["pack", "t.csv", "--time", "exact", "--without", "id", "-o", "t.fewb"], b"");
    let verdict = text(&good(path, &["verify", "t.csv", "t.fewb", "--without", "id"], b""));
    assert!(verdict.contains("20 rows: all promises hold"), "{verdict}");
}

#[test]
fn words_that_look_like_numbers_come_back_as_they_were() {
    let table = (0..40).fold("time,code\n".to_owned(), |table, i| {
        table + &format!("{i},{}\n", ["0000", "0FFF", "7", "A1", "B2"][i % 5])
    });
    let kept = folder("t.csv", &table);
    good(kept.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"");
    assert_eq!(text(&good(kept.path(), &["unpack", "t.fewb"], b"")), table);
    assert!(text(&good(kept.path(), &["verify", "t.csv", "t.fewb"], b"")).contains("all promises hold"));
}

#[test]
fn a_table_of_the_time_alone_and_many_sentinels() {
    let message = {
        let kept = folder("t.csv", "t:x\n0:10\n0:20\n");
        refused(kept.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"")
    };
    assert!(
        message.contains("no column of values beside the time") && message.contains("--delimiter"),
        "{message}"
    );
    let table = (0..60).fold("time,x\n".to_owned(), |table, i| {
        table
            + &format!(
                "{i},{}\n",
                if i % 3 == 0 {
                    "-9999".to_owned()
                } else {
                    format!("{}.5", 20 + i % 5)
                }
            )
    });
    let kept = folder("t.csv", &table);
    let output = fewbits(kept.path(), &["pack", "t.csv", "--time", "exact", "--bound", "1%", "-o", "t.fewb"], b"");
    let message = text(&output.stderr);
    assert!(
        output.status.success()
            && message.contains("make most of the range -9999 to 24.5")
            && message.contains("--missing"),
        "{message}"
    );
}
