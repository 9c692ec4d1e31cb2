//! `fewbits leak`. The readings of `house.csv` are those of an independent solver, with cells of a third of the width, a diffusivity 10 % larger
//! and gains off by 8 %: a leak of 2 mg/s at (1.6, 1.8) from 250 s after the first reading on.

use crate::{fewbits, good, refused, text};
use std::path::Path;

fn house(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
    let text = std::fs::read_to_string(path).unwrap();
    // Larger cells than the default, which take less time.
    if name == "house.toml" {
        format!("split = 1\n{text}")
    } else {
        text
    }
}

/// The last row and the map of a run, of these rooms and readings.
fn found(rooms: &str, readings: &str) -> (serde_json::Value, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("house.toml"), rooms).unwrap();
    let words = ["leak", "-", "--rooms", "house.toml", "--last"];
    let page = fewbits(folder.path(), &words, readings.as_bytes()).stderr;
    let row = text(&good(folder.path(), &[&words[..], &["--json"]].concat(), readings.as_bytes()));
    let map = text(&page)
        .lines()
        .filter_map(|line| line.strip_prefix("  "))
        .map(str::to_owned)
        .collect();
    (serde_json::from_str(row.trim()).unwrap(), map)
}

#[test]
fn a_leak_is_found_from_bits_words_and_values() {
    let (row, map) = found(&house("house.toml"), &house("house.csv"));
    let is_within = |name: &str, truth: f64| {
        let [low, high] = ["low", "high"].map(|end| row[format!("{name}_{end}")].as_f64().unwrap());
        low < truth && truth < high
    };
    assert!(row["room"] == "kitchen" && row["p_kitchen"].as_f64().unwrap() > 0.9, "{row}");
    assert!(
        is_within("rate", 2.0) && is_within("start", 250.0) && row["misfit"].as_f64().unwrap() > 0.01,
        "{row}"
    );
    assert!(map[3].chars().nth(3) == Some('*') && map[10].contains("ssssss"), "{map:?}");
}

/// The same in other units, with a background, and in a table with a column for each sensor.
#[test]
fn units_background_and_form_of_the_table_do_not_matter() {
    let (first, _) = found(&house("house.toml"), &house("house.csv"));
    let scaled = |text: &str| -> String {
        let numbers: Vec<String> = text
            .split(',')
            .map(|x| (1e-6 * x.trim().parse::<f64>().unwrap() + 4e-4).to_string())
            .collect();
        numbers.join(", ")
    };
    let house_rooms = house("house.toml");
    let lines = house_rooms.lines().map(|line| {
        if let Some(list) = line.strip_prefix("thresholds = [") {
            return format!("thresholds = [{}]", scaled(list.trim_end_matches(']')));
        }
        line.replace("noise = 0.5", "noise = 5e-7")
            .replace("rate = [0.1, 10.0]", "rate = [1e-7, 1e-5]\nbackground = 4e-4")
    });
    let rooms: Vec<String> = lines.collect();
    let mut wide = "time,k1,b1,h1,s1,c1\n".to_owned();
    for line in house("house.csv").lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let value = if cells[1] == "h1" {
            scaled(cells[2])
        } else {
            cells[2].to_owned()
        };
        let cell = |name: &&str| if *name == cells[1] { value.as_str() } else { "" };
        let row: Vec<&str> = ["k1", "b1", "h1", "s1", "c1"].iter().map(cell).collect();
        wide += &format!("{},{}\n", cells[0], row.join(","));
    }
    let (second, _) = found(&rooms.join("\n"), &wide);
    for (name, factor) in [
        ("p_kitchen", 1.0),
        ("area", 1.0),
        ("rate", 1e-6),
        ("start", 1.0),
        ("misfit", 1.0),
    ] {
        let [first, second] = [&first, &second].map(|row| row[name].as_f64().unwrap());
        assert!((second - factor * first).abs() < 1e-3 * (factor * first).abs(), "{name}: {first} and {second}");
    }
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let (rooms, readings) = (house("house.toml"), house("house.csv"));
    for (change, to, said) in [
        ("height = 2.5", "heigth = 2.5", "heigth"),
        ("height = 2.5", "height = 0.0", "height = 0"),
        ("name = \"b1\"", "name = \"k1\"", "two sensors `k1`"),
        ("name = \"b1\"", "name = \"b2\"", "`b1` is no sensor"),
        ("place = [6.1, 0.9]", "place = [3.1, 0.9]", "blocked"),
        ("[-600, 1800]", "[2700, 2800]", "before the last reading"),
        ("[0.1, 10.0]", "[10.0, 0.1]", "rate"),
        ("thresholds = [1.0, 4.0, 16.0]", "thresholds = [1.0, 4.0]", "s1 reports 3"),
        ("[1.0, 4.0, 16.0]", "[1.0, 16.0, 4.0]", "thresholds = [1.0, 16.0, 4.0] of `s1`"),
        ("noise = 0.5", "noise = 0.0", "noise = 0 of `k1`"),
        ("noise = 0.5", "noise = inf", "noise = inf of `k1`"),
        ("#ssssss##cccccc#\n#", "#ssssss##ccccccc#\n#", "squares in line"),
    ] {
        assert!(rooms.contains(change), "{change}");
        std::fs::write(folder.path().join("house.toml"), rooms.replacen(change, to, 1)).unwrap();
        let message = refused(folder.path(), &["leak", "-", "--rooms", "house.toml"], readings.as_bytes());
        assert!(message.contains(said), "{to}: {message}");
    }
}

/// The same belief is made of bits that are taken for values, and nothing in it says so.
#[test]
fn bits_without_thresholds_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let rooms = house("house.toml").replacen("thresholds = [5.0]\n", "", 1);
    std::fs::write(folder.path().join("house.toml"), rooms).unwrap();
    let words = ["leak", "-", "--rooms", "house.toml", "--last"];
    let said = text(&fewbits(folder.path(), &words, house("house.csv").as_bytes()).stderr).to_owned();
    assert!(said.contains("k1 reports 0 and 1 only") && !said.contains("b1 reports"), "{said}");
    let rooms = house("house.toml").replace("start = [-600, 1800]", "");
    std::fs::write(folder.path().join("house.toml"), rooms).unwrap();
    assert!(refused(folder.path(), &words, b"time,sensor,reading\n5,k1,1\n").contains("`start` in the file of rooms"));
}
