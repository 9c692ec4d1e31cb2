//! `fewbits fit`, and `track` with what it found.

use crate::numbers::Numbers;
use crate::{fewbits, good, refused, text};

/// A reference, a sensor with offset and gain, and a switch at 21.
fn table(numbers: &mut Numbers, rows: usize) -> (String, Vec<f64>) {
    let (mut level, mut truth) = (20.0, Vec::new());
    let mut table = "time,right,other,switch\n".to_owned();
    for row in 0..rows {
        level += 0.5 * numbers.normal() - 0.05 * (level - 20.0);
        truth.push(level);
        let right = level + 0.1 * numbers.normal();
        let other = 1.2 * level - 3.0 + 0.4 * numbers.normal();
        let switch = u8::from(level + 0.3 * numbers.normal() > 21.0);
        table += &format!("{row},{right:.4},{other:.4},{switch}\n");
    }
    (table, truth)
}

#[test]
fn what_was_found_is_shown_stored_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let (table, truth) = table(&mut Numbers(3), 400);
    std::fs::write(folder.path().join("t.csv"), &table).unwrap();
    let words = [
        "fit",
        "t.csv",
        "--reference",
        "right",
        "--bits",
        "switch",
        "--find",
        "gain",
        "-o",
        "found.json",
    ];
    let page = text(&good(folder.path(), &words, b""));
    assert!(page.contains("threshold of switch") && page.contains("other is explained"), "{page}");
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    let sensor = |at: usize, name: &str| found["sensors"][at][name].as_f64().unwrap();
    assert!((sensor(1, "gain") - 1.2).abs() < 0.05 && (sensor(1, "bias") + 3.0).abs() < 1.0, "{found}");
    assert!((sensor(2, "threshold") - 21.0).abs() < 0.3, "{found}");
    // The faulty sensor alone, corrected.
    let words = [
        "track",
        "t.csv",
        "--columns",
        "other",
        "--settings",
        "found.json",
        "--json",
    ];
    let out = text(&good(folder.path(), &words, b""));
    let mut squares = 0.0;
    for (row, truth) in out.lines().zip(&truth) {
        let row: serde_json::Value = serde_json::from_str(row).unwrap();
        squares += (row["level"].as_f64().unwrap() - truth).powi(2);
    }
    let error = (squares / truth.len() as f64).sqrt();
    assert!(error < 0.35, "{error}");
}

#[test]
fn what_a_table_cannot_tell_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let (table, _) = table(&mut Numbers(4), 200);
    std::fs::write(folder.path().join("t.csv"), &table).unwrap();
    let alone = text(&good(folder.path(), &["fit", "t.csv", "--columns", "right", "--find", "gain,delay"], b""));
    for fault in ["offset of right", "gain of right", "delay of right"] {
        assert!(alone.contains(&format!("not found: {fault}: with one sensor")), "{fault}: {alone}");
    }
    let bits = refused(folder.path(), &["fit", "t.csv", "--columns", "switch", "--bits", "switch"], b"");
    assert!(bits.contains("bits alone leave unit and zero"), "{bits}");
    let none = refused(folder.path(), &["fit", "t.csv", "--reference", "nobody"], b"");
    assert!(none.contains("no sensor `nobody`"), "{none}");
    let words = ["fit", "t.csv", "--columns", "right,other", "--bits", "other"];
    assert!(refused(folder.path(), &words, b"").contains("is no bit"));
    std::fs::write(folder.path().join("x.json"), "{}").unwrap();
    let words = ["track", "t.csv", "--columns", "right", "--settings", "x.json"];
    assert!(refused(folder.path(), &words, b"").contains("no file of `fewbits fit"));
}

/// Defects: `--by` was an option of two structures, of which the one that was not filled was read, so that such a table was refused; rounding was taken for noise.
#[test]
fn single_readings_and_rounded_ones() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(9);
    let (mut level, mut table, mut rounded) = (20.0, "time,name,value\n".to_owned(), "a,b\n".to_owned());
    for row in 0..600 {
        level += 0.1 * numbers.normal();
        let (a, b) = (level + 0.2 * numbers.normal(), level + 3.0 + 0.6 * numbers.normal());
        table +=
            &format!("{},{},{:.4}\n", 7 * row, if row % 3 == 0 { "b" } else { "a" }, if row % 3 == 0 { b } else { a });
        rounded += &format!("{:.0},{:.3}\n", level + 0.2 * numbers.normal(), b);
    }
    let words = ["fit", "-", "--by", "name", "--json"];
    let found: serde_json::Value = serde_json::from_slice(&good(folder.path(), &words, table.as_bytes())).unwrap();
    let near = |name: &str, truth: f64, found: &serde_json::Value| {
        let all = found["estimates"].as_array().unwrap();
        let one = all.iter().find(|one| one[0] == name).unwrap();
        let off = (one[1].as_f64().unwrap() - truth) / one[2].as_f64().unwrap();
        assert!(off.abs() < 4.0, "{name}: {one}");
    };
    near("noise of a", 0.2, &found);
    near("noise of b", 0.6, &found);
    near("offset of b", 3.0, &found);
    let words = ["fit", "-", "--json"];
    let found: serde_json::Value = serde_json::from_slice(&good(folder.path(), &words, rounded.as_bytes())).unwrap();
    near("noise of a", 0.2, &found);
    let page = text(&good(folder.path(), &["fit", "-"], rounded.as_bytes()));
    assert!(page.contains("a is rounded to 1") && !page.contains("b is rounded"), "{page}");
}

/// Defect: a level that jumps had a change of eight times the size.
#[test]
fn jumps_are_told() {
    let numbers = &mut Numbers(4);
    let mut table = "time,a,b\n".to_owned();
    for row in 0..300 {
        let level = if (100..220).contains(&row) { 24.0 } else { 20.0 };
        let mut value = |noise: f64| level + noise * numbers.normal();
        table += &format!("{},{:.4},{:.4}\n", 1000 + 60 * row, value(0.2), value(0.4));
    }
    let folder = tempfile::tempdir().unwrap();
    let page = text(&good(folder.path(), &["fit", "-", "-o", "found.json"], table.as_bytes()));
    assert!(page.contains("jumps of the level, which are no part of its change: 2, the first 6000 s"), "{page}");
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    assert!(found["change"].as_f64().unwrap() < 0.01, "{found}");
    let jumps: Vec<f64> = found["jumps"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|at| at.as_f64())
        .collect();
    assert!((jumps[0] - 6000.0).abs() < 1e-6 && (jumps[1] - 13200.0).abs() < 1e-6, "{jumps:?}");
}

/// Defect: nothing said that a noise that sensors share, one that lasts, and one that grows made the bands too narrow.
#[test]
fn track_tells_of_noise_that_is_not_as_supposed() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(5);
    let mut told = |kind: &str| {
        let (mut level, mut lasting, mut table) = (20.0, [0.0; 3], "a,b,c\n".to_owned());
        for row in 0..500 {
            level += 0.05 * numbers.normal();
            let shared = 0.5 * numbers.normal();
            lasting = lasting.map(|last| 0.9 * last + 0.2 * numbers.normal());
            let cells = lasting.map(|lasting| {
                let plain = numbers.normal();
                let off = match kind {
                    "shared" => shared + 0.1 * plain,
                    "lasting" => lasting,
                    "grows" if row >= 250 => 1.5 * plain,
                    _ => 0.3 * plain,
                };
                format!("{:.5}", level + off)
            });
            table += &if kind == "grows" {
                cells[0].clone() + "\n"
            } else {
                cells.join(",") + "\n"
            };
        }
        let table = if kind == "grows" {
            table.replace("a,b,c", "a")
        } else {
            table
        };
        let output = fewbits(folder.path(), &["track", "-"], table.as_bytes());
        text(&output.stderr)
    };
    for (kind, line) in [
        ("shared", "turn back"),
        ("lasting", "last for several rows"),
        ("grows", "its noise changes: 0."),
    ] {
        let told = told(kind);
        assert!(told.contains(line), "{kind}: {told}");
    }
    for _ in 0..4 {
        let told = told("plain");
        assert!(!told.contains("forecasts") && !told.contains("larger than supposed"), "{told}");
    }
}

/// Defect: a number that stands for gaps was fitted as a value without a word, and of a column that repeats another one nothing was said.
#[test]
fn numbers_for_gaps_copies_and_what_may_be_looked_for_are_told() {
    let mut numbers = Numbers(77);
    let (mut level, mut gaps, mut copies) = (4.0, "time,a,b\n".to_owned(), "time,a,b,c\n".to_owned());
    for row in 0..200 {
        level += 0.1 * numbers.normal();
        let [a, b, c] = [0.3, 0.3, 0.2].map(|noise| level + noise * numbers.normal());
        gaps += &format!("{row},{a:.3},{:.3}\n", if row < 120 { b } else { -999.0 });
        copies += &format!("{row},{a:.3},{b:.3},{:.3}\n", if row % 40 == 7 { c } else { a });
    }
    let folder = tempfile::tempdir().unwrap();
    let said = |table: &str, more: &[&str]| {
        text(&fewbits(folder.path(), &[&["fit", "-"], more].concat(), table.as_bytes()).stderr)
    };
    assert!(said(&gaps, &[]).contains("--missing 'b=-999'"), "{}", said(&gaps, &[]));
    let mended = said(&gaps, &["--missing", "b=-999"]);
    assert!(!mended.contains("--missing") && !mended.contains("--find"), "{mended}");
    let copied = said(&copies, &[]);
    assert!(copied.contains("c has the value of a in") && !copied.contains("b has the value"), "{copied}");
    assert!(copied.contains("--find gain,slope,walk,delay,time-constant"), "{copied}");
}

/// Defects: errors of noises that sensors share were stated as if they did not; a copy of a column made a noise of a thousandth of what it is; `design` took no file of `fit`.
#[test]
fn shared_noise_copies_and_a_design_from_what_was_found() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = &mut Numbers(21);
    let (mut level, mut table) = (0.0, "right,one,two,copy\n".to_owned());
    for _ in 0..500 {
        level += 0.5 * numbers.normal() - 0.05 * level;
        let (right, shared) = (20.0 + level + 0.1 * numbers.normal(), 0.4 * numbers.normal());
        let one = 20.0 + level + 0.3 * numbers.normal() + shared;
        let two = 1.0 + 2.0 * (20.0 + level) + 0.6 * numbers.normal() + shared;
        table += &format!("{right:.4},{one:.4},{two:.4},{one:.4}\n");
    }
    let words = [
        "fit",
        "-",
        "--reference",
        "right",
        "--find",
        "gain,time-constant",
        "-o",
        "found.json",
    ];
    let page = fewbits(folder.path(), &words, table.as_bytes());
    let said = text(&page.stdout) + &text(&page.stderr);
    assert!(said.contains("one and two share noise"), "{said}");
    assert!(
        said.contains("offset of copy: its readings repeat") && said.contains("no second measurement"),
        "{said}"
    );
    let found: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("found.json")).unwrap()).unwrap();
    let correlation = &found["correlations"][0];
    assert!(
        correlation[0] == "one" && correlation[1] == "two" && correlation[2].as_f64().unwrap() > 0.3,
        "{found}"
    );
    // Noise in the unit of the level, and the level's own spread.
    let words = ["design", "--settings", "found.json", "--bits", "1", "--json"];
    let design = fewbits(folder.path(), &words, b"");
    let json: serde_json::Value = serde_json::from_slice(&design.stdout).unwrap();
    let (mean, noise) = (found["mean"].as_f64().unwrap(), found["sensors"][2]["noise"].as_f64().unwrap());
    let gain = found["sensors"][2]["gain"].as_f64().unwrap();
    let said = text(&design.stderr);
    assert!((gain - 2.0).abs() < 0.1 && said.contains("sensor 2: two, noise"), "{said} {json}");
    let change = found["change"].as_f64().unwrap();
    let spread = (0.5 * change * change * found["time_constant"].as_f64().unwrap()).sqrt();
    let prior = format!("{mean}±{spread}");
    let deviations = (0..4).map(|at| {
        let one = |name: &str| found["sensors"][at][name].as_f64().unwrap();
        (one("noise") / one("gain").abs()).to_string()
    });
    let deviations = deviations.collect::<Vec<_>>().join(",");
    let words = [
        "design",
        "--prior",
        &prior,
        "--noise",
        &deviations,
        "--bits",
        "1",
        "--json",
    ];
    let stated: serde_json::Value = serde_json::from_slice(&good(folder.path(), &words, b"")).unwrap();
    let value = |one: &serde_json::Value| one["value"].as_f64().unwrap();
    assert!((value(&stated) / value(&json)).ln().abs() < 1e-6 && noise > 0.0, "{stated} {json}");
    // A level that wanders has no prior.
    good(folder.path(), &["fit", "-", "-o", "walk.json"], table.as_bytes());
    let none = refused(folder.path(), &["design", "--settings", "walk.json"], b"");
    assert!(none.contains("--prior") && none.contains("wanders"), "{none}");
}

/// Defects: values at a detection limit were taken for values (offset of .13 for 0, noise of .17 for .2), and rounding finer than the noise was part of it; a
/// level that returns, or has a cycle of a day, was fitted as a walk without a word.
#[test]
fn limits_rounding_and_levels_that_are_no_walk() {
    let folder = tempfile::tempdir().unwrap();
    let fitted = |table: &str, more: &[&str]| {
        let words = [&["fit", "-"], more].concat();
        let output = fewbits(folder.path(), &words, table.as_bytes());
        assert!(output.status.success(), "{}", text(&output.stderr));
        (text(&output.stdout), text(&output.stderr))
    };
    let numbers = &mut Numbers(21);
    let (mut level, mut returning) = (0.0, 0.0);
    let (mut clipped, mut rounded, mut day, mut back) = [const { String::new() }; 4].into();
    let head = "time,a,b\n";
    for table in [&mut clipped, &mut rounded, &mut day, &mut back] {
        *table += head;
    }
    for row in 0..500 {
        level += 0.1 * numbers.normal();
        returning += -0.15 * returning + 0.5 * numbers.normal();
        let seconds = 600 * row;
        let cycle = 3.0 * (f64::from(row) * std::f64::consts::TAU / 144.0).sin();
        let (one, two) = (0.2 * numbers.normal(), 0.4 * numbers.normal());
        clipped += &format!("{seconds},{:.4},{:.4}\n", (20.0 + level + one).min(20.3), 20.0 + level + two);
        let coarse = |value: f64| 0.25 * (4.0 * value).round();
        rounded += &format!("{seconds},{:.2},{:.2}\n", coarse(20.0 + level + one), coarse(20.0 + level + two));
        day += &format!("{seconds},{:.4},{:.4}\n", 20.0 + cycle + one, 20.0 + cycle + two);
        back += &format!("{seconds},{:.4},{:.4}\n", 20.0 + returning + one, 20.0 + returning + two);
    }
    let near = |table: &str, expected: [f64; 2]| {
        let found: serde_json::Value = serde_json::from_str(&fitted(table, &["--json"]).0).unwrap();
        for (sensor, expected) in expected.into_iter().enumerate() {
            let name = format!("noise of {}", ["a", "b"][sensor]);
            let all = found["estimates"].as_array().unwrap();
            let own = all.iter().find(|one| one[0] == name).unwrap();
            let off = (own[1].as_f64().unwrap() - expected) / own[2].as_f64().unwrap();
            assert!(off.abs() < 3.5, "{own}");
        }
    };
    near(&clipped, [0.2, 0.4]);
    near(&rounded, [0.2, 0.4]);
    assert!(
        fitted(&clipped, &[])
            .1
            .contains("a detection limit, as --limits ..20.3 says")
    );
    assert!(!fitted(&clipped, &["--limits", "no"]).1.contains("limit"));
    assert!(fitted(&rounded, &[]).0.contains("a is rounded to 0.25"));
    assert!(
        fitted(&day, &[])
            .0
            .contains("the level keeps a direction for many rows")
    );
    let found = fitted(&back, &[]).0;
    assert!(
        found.contains("the level returns to a mean") && !fitted(&rounded, &[]).0.contains("returns"),
        "{found}"
    );
}
