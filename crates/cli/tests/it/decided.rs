//! What all rows of a file decide, what a recording's bytes depend on, and what a killed command leaves behind.

use crate::{fewbits, folder, good, refused, text};

/// Rows of a level once a minute, from 9:00 of the first of two days of February 2024.
fn level(days: [&str; 2]) -> String {
    let mut table = "date,level\n".to_owned();
    for (i, day) in days.iter().enumerate() {
        for minute in 0..200 {
            let x = f64::from(minute) + 200.0 * i as f64;
            table += &format!("{day} {:02}:{:02},{:.2}\n", 9 + minute / 60, minute % 60, 10.0 + (0.05 * x).sin());
        }
    }
    table
}

/// Defect: refused for the order of day and month, which rows behind the first ones decide.
#[test]
fn estimates_take_the_order_of_days_from_all_rows() {
    let (_kept, folder) = folder();
    for (days, from) in [
        (["01/02/2024", "13/02/2024"], "2024-02-01T09:00:00"),
        (["02/01/2024", "02/13/2024"], "2024-02-01T09:00:00"),
        (["1.2.2024", "13.2.2024"], "2024-02-01T09:00:00"),
    ] {
        std::fs::write(folder.join("level.csv"), level(days)).unwrap();
        let words = [
            "track",
            "level.csv",
            "--noise",
            "0.01",
            "--change",
            "0.1",
            "--prior",
            "10±1",
        ];
        let rows = text(&good(&folder, &words, b""));
        let first = rows.lines().nth(1).unwrap();
        assert!(first.starts_with(from), "{first}");
        assert_eq!(rows.lines().count(), 401);
    }
    // Nothing decides.
    std::fs::write(folder.join("level.csv"), level(["01/02/2024", "02/02/2024"])).unwrap();
    let said = refused(&folder, &["track", "level.csv", "--noise", "0.01"], b"");
    assert!(said.contains("may have the day or the month first") && said.contains("--time-format dmy"), "{said}");
}

#[test]
fn bytes_of_a_recording_depend_on_those_of_the_table_alone() {
    let (_kept, folder) = folder();
    let table = |change: &str| {
        let rows = (0..4000).map(|i| format!("{i},{},{}\n", i % 7, if i % 3 == 0 { "open" } else { "shut" }));
        let all = "time,x,door\n".to_owned() + &rows.collect::<String>();
        all.replace("1999,4,", change)
    };
    // Words need all rows first, shares of ranges too; the door left out is packed in a single pass.
    for options in [&["--bound", "1%"][..], &[], &["--without", "door"]] {
        let pack = |text: &str, name: &str| {
            std::fs::write(folder.join("t.csv"), text).unwrap();
            // A recording of one block has no identity.
            let words = ["pack", "t.csv", "--time", "exact", "--independent", "256", "-o", name];
            let words = [&words[..], options].concat();
            good(&folder, &words, b"");
            std::fs::read(folder.join(name)).unwrap()
        };
        let first = pack(&table("1999,4,"), "a");
        assert_eq!(first, pack(&table("1999,4,"), "b"));
        // A cell that is written otherwise is the same sample of another table.
        let other = pack(&table("1999,4.0,"), "c");
        assert_eq!(first.len(), other.len());
        assert_ne!(first, other, "{options:?}");
    }
}

#[test]
fn unfinished_files_of_killed_commands_are_removed() {
    let (_kept, folder) = folder();
    std::fs::create_dir(folder.join("out")).unwrap();
    for name in ["a", "b"] {
        std::fs::write(folder.join(format!("{name}.csv")), "time,x\n0,1\n1,2\n").unwrap();
        std::fs::write(folder.join(format!("out/.{name}.fewb.999999-0.fewbits-new")), "half").unwrap();
    }
    std::fs::write(folder.join("out/.other.fewb.999999-0.fewbits-new"), "half").unwrap();
    good(&folder, &["pack", "a.csv", "b.csv", "--time", "exact", "-o", "out", "--jobs", "1"], b"");
    let entries = std::fs::read_dir(folder.join("out")).unwrap();
    let mut left: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.contains("fewbits-new"))
        .collect();
    left.sort();
    assert_eq!(left, [".other.fewb.999999-0.fewbits-new"]);
}

#[test]
fn refusals_of_huge_ranges_are_short() {
    let (_kept, folder) = folder();
    std::fs::write(folder.join("t.csv"), "time,x\n0,-1.7e308\n1,1.7e308\n2,5\n").unwrap();
    let said = refused(&folder, &["pack", "t.csv", "--time", "exact", "--bound", "1%", "-o", "r"], b"");
    assert!(said.contains("-1.7e308 to 1.7e308") && said.len() < 300, "{said}");
    let output = fewbits(&folder, &["pack", "t.csv", "--time", "exact", "-o", "r"], b"");
    assert!(output.status.success(), "{}", text(&output.stderr));
}

/// Defect: a word of a line that is left out for its time made a column of booleans one of words, and `verify` raised an alarm.
#[test]
fn lines_that_are_left_out_do_not_tell_what_columns_are() {
    let (_kept, folder) = folder();
    for (name, bad) in [
        ("a", "no time,9,FAL\n"),
        ("b", ",x7,open\n"),
        ("c", "2024-13-05 10:09,7,0.5\n"),
    ] {
        let rows = (0..9).map(|i| format!("2024-03-05 10:0{i},{i},{}\n", if i % 2 == 0 { "TRUE" } else { "FALSE" }));
        let table = format!("{name}.csv");
        std::fs::write(folder.join(&table), "when,x,ok\n".to_owned() + &rows.collect::<String>() + bad).unwrap();
        for time in ["exact", "±1ms"] {
            let words = ["pack", &table, "--time", time, "--skip-bad", "1", "-o", name];
            good(&folder, &words, b"");
            let said = good(&folder, &["verify", &table, "--skip-bad", "1", name], b"");
            assert!(text(&said).contains("9 rows: all promises hold"), "{}", text(&said));
        }
    }
}
