//! Bounds and names on the command line, and what `verify` compares.

use crate::{BOUND, fewbits, folder, good, refused, table, text};
use std::path::Path;

fn verdict(folder: &Path, words: &[&str]) -> (Option<i32>, serde_json::Value) {
    let output = fewbits(folder, &[&["verify", "--json"][..], words].concat(), b"");
    (output.status.code(), serde_json::from_slice(&output.stdout).unwrap())
}

#[test]
fn decimal_comma_in_a_bound_is_refused_by_every_command() {
    let (_kept, folder) = folder();
    for command in ["pack", "send", "bench"] {
        for bound in ["temp=±2,5", "±0,1", "*=±0,1", "temp=±1,flow=0,5%", "temp=±1,±2"] {
            let message = refused(&folder, &[command, "a.csv", "--time", "exact", "--bound", bound], b"");
            assert!(message.contains("all other columns"), "{command} {bound}: {message}");
        }
    }
    let message = refused(&folder, &["pack", "a.csv", "--bound", "temp=±2,5", "-o", "x"], b"");
    assert!(message.contains("temp=±2.5") && !folder.join("x").exists(), "{message}");
    let message = refused(&folder, &["track", "a.csv", "--noise", "temp=0,5"], b"");
    assert!(message.contains("temp=0.5"), "{message}");
}

#[test]
fn summary_prints_the_bound_of_every_column() {
    let (_kept, folder) = folder();
    let words = [
        "pack",
        "a.csv",
        "--time",
        "exact",
        "--bound",
        "temp=±0.1,flow=1%,direction=±2@360",
        "-o",
        "x",
    ];
    let message = text(&fewbits(&folder, &words, b"").stderr);
    assert!(message.contains("bounds: temp=±0.1,flow=1%,price=lossless,direction=±2@360"), "{message}");
    let message = text(&fewbits(&folder, &["pack", "a.csv", "--json", "--bound", "±0.5", "-o", "x"], b"").stderr);
    let done: serde_json::Value = serde_json::from_str(message.lines().last().unwrap()).unwrap();
    assert_eq!(done["bounds"][1][1], "±0.5");
}

#[test]
fn names_with_commas_are_quoted() {
    let (_kept, folder) = folder();
    std::fs::write(folder.join("c.csv"), "\"Temp, °F\",RH,\"say \"\"x\"\"\"\n70.25,40,1\n71.5,41,2\n").unwrap();
    let words = [
        "pack",
        "c.csv",
        "--bound",
        "\"Temp, °F\"=±0.5,*=lossless",
        "-o",
        "c.fewb",
    ];
    let message = text(&fewbits(&folder, &words, b"").stderr);
    assert!(message.contains("\"Temp, °F\"=±0.5,RH=lossless"), "{message}");
    let picked = text(&good(&folder, &["cat", "c.fewb", "--columns", "\"say \"\"x\"\"\",\"Temp, °F\""], b""));
    assert!(picked.starts_with("\"say \"\"x\"\"\",\"Temp, °F\"\n1,"), "{picked}");
    good(&folder, &["pack", "c.csv", "--columns", "\"Temp, °F\"", "-o", "d.fewb"], b"");
    let message = refused(&folder, &["pack", "c.csv", "--bound", "Temp, °F=±0.5", "-o", "x"], b"");
    assert!(message.contains("Temp") && !folder.join("x").exists(), "{message}");
    let message = refused(&folder, &["pack", "c.csv", "--bound", "Temp=±0.5", "-o", "x"], b"");
    assert!(message.contains("\"Temp, °F\"") && message.contains("quotes"), "{message}");
}

#[test]
fn few_cells_that_make_a_range_are_warned_of() {
    let (_kept, folder) = folder();
    let mut sentinel = "temp,wind\n".to_owned();
    for i in 0..200 {
        let temp = if i % 40 == 7 {
            -9999.0
        } else {
            20.0 + 0.01 * f64::from(i)
        };
        sentinel += &format!("{temp},{}\n", 3.0 + 0.1 * f64::from(i % 30));
    }
    std::fs::write(folder.join("s.csv"), sentinel).unwrap();
    let warned = |bound: &str| text(&fewbits(&folder, &["pack", "s.csv", "--bound", bound, "-o", "x"], b"").stderr);
    let message = warned("1%");
    assert!(
        message.contains("column `temp`") && message.contains("-9999") && !message.contains("`wind`"),
        "{message}"
    );
    assert!(!warned("±0.1").contains("warning"));
    assert!(!warned("wind=1%").contains("warning"));
}

#[test]
fn verify_reports_only_what_it_compared() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "--time", "exact", "-o", "a.fewb"], b"");
    let wrong: String = table().lines().enumerate().fold(String::new(), |all, (i, line)| {
        let (first, last) = line.rsplit_once(',').unwrap();
        all + &(if i == 0 {
            format!("{line}\n")
        } else {
            format!("{first},{last}5\n")
        })
    });
    std::fs::write(folder.join("wrong.csv"), wrong).unwrap();
    let (code, found) = verdict(&folder, &["wrong.csv", "a.fewb", "--columns", "temp"]);
    assert_eq!((code, found["columns"].as_array().unwrap().len()), (Some(0), 1));
    assert_eq!(found["not_compared"], serde_json::json!(["flow", "price", "direction"]));
    let said = text(&good(&folder, &["verify", "wrong.csv", "a.fewb", "--columns", "temp"], b""));
    assert!(said.contains("not compared: flow, price, direction") && !said.contains("all promises"), "{said}");
    assert_eq!(verdict(&folder, &["wrong.csv", "a.fewb"]).0, Some(1));
    // A column that is left out is no other column.
    let (code, found) = verdict(&folder, &["wrong.csv", "a.fewb", "--without", "direction"]);
    assert_eq!((code, found["columns"].as_array().unwrap().len()), (Some(0), 3));
    let message = refused(&folder, &["verify", "a.csv", "a.fewb", "--columns", "none"], b"");
    assert!(message.contains("none"), "{message}");
}

#[test]
fn verify_matches_columns_and_times_by_name() {
    let (_kept, folder) = folder();
    // The time stands in the middle, and the recording's columns have another order than the table's.
    let mixed: String = table()
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            format!("{},{},{},{},{}\n", cells[4], cells[2], cells[0], cells[1], cells[3])
        })
        .collect();
    std::fs::write(folder.join("m.csv"), &mixed).unwrap();
    let words = [
        "pack",
        "m.csv",
        "--time",
        "exact",
        "--time-column",
        "time",
        "--columns",
        "price,temp,direction",
        "-o",
        "m.fewb",
    ];
    good(&folder, &words, b"");
    let (code, found) = verdict(&folder, &["m.csv", "m.fewb"]);
    assert_eq!(
        (code, &found["times_checked"], &found["ticks_failed"]),
        (Some(0), &true.into(), &0.into()),
        "{found}"
    );
    // A wrong time is found where the time is not the first column.
    std::fs::write(folder.join("late.csv"), mixed.replacen(",1700000002", ",1700000003", 1)).unwrap();
    let (code, found) = verdict(&folder, &["late.csv", "m.fewb"]);
    assert_eq!((code, &found["ticks_failed"]), (Some(1), &1.into()), "{found}");
}

#[test]
fn verify_counts_rows_that_one_side_has() {
    let (_kept, folder) = folder();
    good(&folder, &["pack", "a.csv", "-o", "a.fewb"], b"");
    let short: String = table().lines().take(901).map(|line| format!("{line}\n")).collect();
    std::fs::write(folder.join("short.csv"), short).unwrap();
    std::fs::write(folder.join("long.csv"), table() + "1700009999,1,2,3,4\n").unwrap();
    let (code, found) = verdict(&folder, &["short.csv", "a.fewb"]);
    assert!(code == Some(1) && found["extra_rows"].as_u64() > Some(0), "{found}");
    let (code, found) = verdict(&folder, &["long.csv", "a.fewb"]);
    assert_eq!((code, &found["missing_rows"]), (Some(1), &1.into()));
}

/// Behind lost rows, rows with the same number are others: those with the same time are compared.
#[test]
fn verify_compares_rows_of_one_time_where_rows_are_lost() {
    let (_kept, folder) = folder();
    let words = ["pack", "a.csv", "--time", "exact", "--bound", BOUND, "-o", "a.fewb"];
    good(&folder, &words, b"");
    let is_lost = |i: usize| (300..340).contains(&i) || i % 100 == 7;
    let some: Vec<String> = table()
        .lines()
        .enumerate()
        .filter(|(i, _)| !is_lost(*i))
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    std::fs::write(folder.join("some.csv"), some.concat()).unwrap();
    let lost = (0..1001).filter(|i| is_lost(*i)).count() as u64;
    let (code, found) = verdict(&folder, &["some.csv", "a.fewb"]);
    assert_eq!((code, &found["by_time"], &found["extra_rows"]), (Some(1), &true.into(), &lost.into()), "{found}");
    assert!(
        found["columns"]
            .as_array()
            .unwrap()
            .iter()
            .all(|column| column["failed"] == 0),
        "{found}"
    );
    let wrong = some
        .concat()
        .replacen(&some[600], &some[600].replacen(',', ",77", 1), 1);
    std::fs::write(folder.join("wrong.csv"), wrong).unwrap();
    let (_, found) = verdict(&folder, &["wrong.csv", "a.fewb"]);
    assert_eq!(found["columns"][0]["failed"], 1, "{found}");
    // The other way round, from a pipe: by number, as it is read once.
    good(&folder, &["pack", "some.csv", "--time", "exact", "-o", "some.fewb"], b"");
    let output = fewbits(&folder, &["verify", "a.csv", "some.fewb"], b"");
    let said = text(&output.stdout);
    assert!(output.status.code() == Some(1) && said.contains(&format!("{lost} rows are missing")), "{said}");
    assert!(said.contains("their promises hold, others are missing"), "{said}");
}
