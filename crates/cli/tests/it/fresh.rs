//! Tables read once or twice, units of times, dates that late rows decide, tables without rows, errors that a recording states.

use super::{fewbits, good, refused, text};
use tempfile::TempDir;

fn folder(table: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("t.csv"), table).unwrap();
    folder
}

/// The table that comes back, and what the program said of it.
fn back(folder: &TempDir, options: &[&str]) -> String {
    let path = folder.path();
    good(path, &[&["pack", "t.csv", "-o", "t.fewb"], options].concat(), b"");
    let verdict = text(&good(path, &["verify", "t.csv", "t.fewb"], b""));
    assert!(verdict.contains("all promises hold"), "{verdict}");
    text(&good(path, &["unpack", "t.fewb"], b""))
}

#[test]
fn units_of_times_survive_a_second_packing() {
    for (name, own, scale) in [
        ("time_ms", "time", 1e-3),
        ("Time (us)", "Time", 1e-6),
        ("t_h", "t", 3600.0),
    ] {
        let rows: String = (0..40).map(|i| format!("{},{i}.5\n", 20 * i)).collect();
        let folder = folder(&format!("{name},x\n{rows}"));
        let look = text(&good(folder.path(), &["look", "t.csv"], b""));
        assert!(look.contains("from numbers of "), "{look}");
        let first = back(&folder, &["--time", "exact"]);
        let line = first.lines().nth(2).unwrap();
        let seconds: f64 = line.split(',').next().unwrap().parse().unwrap();
        assert!(
            first.starts_with(&format!("{own},x\n")) && (seconds - 20.0 * scale).abs() < 1e-9 * seconds,
            "{first}"
        );
        std::fs::write(folder.path().join("t.csv"), &first).unwrap();
        assert_eq!(back(&folder, &["--time", "exact"]), first);
    }
}

#[test]
fn a_late_date_tells_day_from_month() {
    let row = |i: usize| format!("{:02}/04/2024 {:02}:00,{i}\n", 1 + i / 24, i % 24);
    let rows: String = (0..700).map(row).collect();
    let folder = folder(&format!("date,x\n{rows}"));
    let table = back(&folder, &["--time", "exact"]);
    assert!(table.contains("\n2024-04-01T01:00:00,1\n") && table.contains("\n2024-04-30T03:00:00,699\n"));
    assert!(text(&good(folder.path(), &["look", "t.csv"], b"")).contains("--time-format dmy"));
    // What none of the rows tells is refused.
    std::fs::write(folder.path().join("t.csv"), "date,x\n".to_owned() + &(0..200).map(row).collect::<String>())
        .unwrap();
    let refusal = refused(folder.path(), &["pack", "t.csv", "--time", "exact", "-o", "u.fewb"], b"");
    assert!(refusal.contains("--time-format dmy"), "{refusal}");
}

#[test]
fn late_rows_of_another_kind_are_packed_as_if_all_had_been_known() {
    // The first rows are whole numbers at whole seconds; later ones are not.
    for late in [
        "5000.25,1.5\n",
        "5000,NA\n",
        "5000,4611686018427387905\n",
        "5000,1e300\n",
    ] {
        let rows: String = (0..5000).map(|i| format!("{i},{}\n", i % 50)).collect();
        let folder = folder(&format!("time,x\n{rows}{late}"));
        let table = back(&folder, &["--time", "exact"]);
        assert!(table.ends_with(&late.replace("NA", "")), "{late}");
        // The same table with the odd row first tells the kinds at once: both recordings have the same times and kinds.
        assert_eq!(table.lines().count(), 5002);
    }
    // A row that is refused leaves nothing, and the message has its line.
    let rows: String = (0..5000).map(|i| format!("{i},{}\n", i % 50)).collect();
    let folder = folder(&format!("time,x\n{rows}5000,ERR\n"));
    let refusal = refused(folder.path(), &["pack", "t.csv", "--time", "exact", "-o", "u.fewb"], b"");
    assert!(refusal.contains("line 5002") && refusal.contains("--missing"), "{refusal}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_table_without_rows_is_sent() {
    let folder = folder("time,x,y\n");
    good(folder.path(), &["send", "t.csv", "--time", "exact", "--bound", "±0.1", "-o", "s.fewb"], b"");
    assert_eq!(text(&good(folder.path(), &["receive", "s.fewb"], b"")), "time,x,y\n");
}

#[test]
fn info_states_the_largest_and_the_mean_error() {
    let rows: String = (0..3000)
        .map(|i| format!("{i},{}\n", (f64::from(i) * 0.37).sin() * 10.0))
        .collect();
    let folder = folder(&format!("time,x\n{rows}"));
    for bound in ["±0.1", "0.5%"] {
        good(folder.path(), &["pack", "t.csv", "--time", "exact", "--bound", bound, "-o", "t.fewb"], b"");
        let info: serde_json::Value =
            serde_json::from_slice(&good(folder.path(), &["info", "t.fewb", "--json"], b"")).unwrap();
        let column = &info["columns"][0];
        let (largest, mean) = (column["largest_error"].as_f64().unwrap(), column["mean_error"].as_f64().unwrap());
        let verdict: serde_json::Value =
            serde_json::from_slice(&good(folder.path(), &["verify", "t.csv", "t.fewb", "--json"], b"")).unwrap();
        let found = &verdict["columns"][0];
        assert!(found["largest_error"].as_f64().unwrap() <= largest && largest < 0.103, "{info}");
        // 3000 errors that are spread evenly have a mean within three hundredths of half of the bound.
        let measured = found["mean_error"].as_f64().unwrap();
        assert!((measured / mean - 1.0).abs() < 0.05, "{measured} {mean}");
        assert!(text(&good(folder.path(), &["info", "t.fewb"], b"")).contains("mean about"));
    }
}

#[test]
fn long_tables_name_the_option() {
    let row = |i: usize| {
        let state = if i.is_multiple_of(3) {
            "idle".to_owned()
        } else {
            format!("{i}.5")
        };
        format!("sensor.{},{state},2024-03-05T10:{:02}:{:02}Z\n", i % 3, i / 60, i % 60)
    };
    let rows: String = (0..1500).map(row).collect();
    let folder = folder(&format!("entity_id,state,last_changed\n{rows}"));
    let output = fewbits(folder.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"");
    let message = text(&output.stderr);
    assert!(!output.status.success() && message.contains("--by entity_id --columns state"), "{message}");
    let look = text(&good(folder.path(), &["look", "t.csv"], b""));
    assert!(look.contains("--by entity_id --columns state"), "{look}");
    let table = {
        let options = ["--by", "entity_id", "--columns", "state"];
        good(folder.path(), &[&["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], &options[..]].concat(), b"");
        text(&good(folder.path(), &["unpack", "t.fewb"], b""))
    };
    assert!(
        table.starts_with("last_changed,sensor.0,sensor.1,sensor.2\n") && table.contains(",idle,"),
        "{table}"
    );
}
