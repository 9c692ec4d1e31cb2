//! `fewbits ranges` on tables as people write them: odometry, anchors' columns, negative ranges, late rows, an anchor that is wrong.

use crate::numbers::Numbers;
use crate::ranges::{Point, RECTANGLE, anchors, distance, holds, off, ranges, table};
use crate::{fewbits, good, refused, text};

/// Columns of what the target moved since the row before: it is followed between ranges, in rows without any too.
#[test]
fn odometry_carries_the_place_between_ranges() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let at = |row: usize| {
        let angle = 0.9 * row as f64;
        [6.0 + 2.0 * angle.cos(), 3.5 + 2.0 * (1.7 * angle).sin(), 0.0]
    };
    let mut numbers = Numbers(5);
    let mut input = "time,n0,n1,n2,n3,dx,dy\n".to_owned();
    for row in 0..120 {
        let (here, before) = (at(row), at(row.saturating_sub(1)));
        let cells: Vec<String> = (0..4)
            .map(|i| {
                let is_there = row < 4 || row % 5 == 0;
                let range = distance(&RECTANGLE[i], &here) + 0.03 * numbers.normal();
                if is_there { range.to_string() } else { String::new() }
            })
            .collect();
        let moved = [here[0] - before[0], here[1] - before[1]];
        input += &format!("{row},{},{},{}\n", cells.join(","), moved[0], moved[1]);
    }
    let options = ["--bias", "0", "--scale", "0"];
    let rms = |rows: &[serde_json::Value]| {
        let squares: f64 = rows
            .iter()
            .enumerate()
            .map(|(row, one)| off(one, &at(row)).powi(2))
            .sum();
        (squares / rows.len() as f64).sqrt()
    };
    let with = ranges(folder.path(), &input, &[&options[..], &["--odometry", "dx,dy"]].concat());
    assert!(with.iter().all(|row| row["x"].is_f64()), "{with:?}");
    assert!(rms(&with) < 0.15, "{}", rms(&with));
    // The same as reports of a long table.
    let mut long = "time,anchor,value\n".to_owned();
    for line in input.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let names = ["n0", "n1", "n2", "n3", "dx", "dy"];
        for (name, cell) in names.iter().zip(&cells[1..]).filter(|(_, cell)| !cell.is_empty()) {
            long += &format!("{},{name},{cell}\n", cells[0]);
        }
    }
    let words = [&options[..], &["--odometry", "dx,dy", "--by", "anchor"]].concat();
    assert!(rms(&ranges(folder.path(), &long, &words)) < 0.15);
    let words = ["ranges", "-", "--anchors", "anchors.csv", "--odometry"];
    for (bad, why) in [
        ("dx", "two columns"),
        ("dx,dz", "no column `dz`"),
        ("dx,n0", "no anchor"),
    ] {
        let error = refused(folder.path(), &[&words[..], &[bad]].concat(), input.as_bytes());
        assert!(error.contains(why), "{bad}: {error}");
    }
}

/// With bias and scale unknown, four anchors explain almost anything: if one is much too long, the rows must say that something is wrong, or hold
/// the place. Bands hold both coordinates in nine of ten cases. Calibrated ranges say nothing.
#[test]
fn an_anchor_that_bias_and_scale_take_up_is_not_silent() {
    let folder = tempfile::tempdir().unwrap();
    let places = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 3.0, 0.0], [0.0, 3.0, 0.0]];
    anchors(folder.path(), &places, 1.0, false);
    let mut silent = 0;
    let truths = [[1.4, 0.9, 0.0], [2.6, 1.8, 0.0], [1.1, 2.1, 0.0], [2.9, 0.7, 0.0]];
    for (seed, truth) in (1..).zip(truths) {
        for (bad, late) in [(0, 1.5), (2, 2.0), (1, 3.0)] {
            let mut numbers = Numbers(seed);
            let input = table(4, 100, |_, i| {
                distance(&places[i], &truth) + 0.04 * numbers.normal() + if i == bad { late } else { 0.0 }
            });
            let rows = ranges(folder.path(), &input, &[]);
            let last = rows.last().unwrap();
            silent += usize::from(last["events"].as_str().unwrap_or_default().is_empty() && !holds(last, &truth));
        }
        let mut numbers = Numbers(10 + seed);
        let good = table(4, 100, |_, i| distance(&places[i], &truth) + 0.04 * numbers.normal());
        let rows = ranges(folder.path(), &good, &[]);
        assert!(rows[10..].iter().all(|row| row["events"] != "doubtful"), "{truth:?}");
    }
    assert!(silent <= 2, "{silent} of 12");
}

/// Tables of anchors as people write them: the names of columns say which is which, whatever stands between them.
#[test]
fn anchors_are_read_by_the_names_of_their_columns() {
    let folder = tempfile::tempdir().unwrap();
    let truth = [4.1, 2.2, 0.0];
    let input = table(4, 12, |_, i| distance(&RECTANGLE[i], &truth));
    let with = |head: &str, row: &dyn Fn(usize, &Point) -> String| {
        let rows: Vec<String> = RECTANGLE.iter().enumerate().map(|(i, place)| row(i, place)).collect();
        format!("{head}{}\n", rows.join("\n"))
    };
    for anchors in [
        with("anchor,y,x\n", &|i, [x, y, _]| format!("n{i},{y},{x}")),
        with("x,y,id,remark\n", &|i, [x, y, _]| format!("{x},{y},n{i},by door {i}")),
        with("Y [m];Node;X [m]\n", &|i, [x, y, _]| format!("{y};n{i};{x}")),
        with("", &|i, [x, y, _]| format!("n{i},{x},{y}")),
    ] {
        std::fs::write(folder.path().join("anchors.csv"), &anchors).unwrap();
        let rows = ranges(folder.path(), &input, &["--bias", "0", "--scale", "0"]);
        assert!(off(rows.last().unwrap(), &truth) < 0.02, "{anchors}: {}", rows[11]);
    }
    let degrees = with("name,lat,lon\n", &|i, [x, y, _]| format!("n{i},{y},{x}"));
    std::fs::write(folder.path().join("anchors.csv"), degrees).unwrap();
    let error = refused(folder.path(), &["ranges", "-", "--anchors", "anchors.csv"], input.as_bytes());
    assert!(error.contains("no degrees"), "{error}");
}

/// Radios write a negative number, or zero, for no range.
#[test]
fn negative_ranges_and_zeros_are_left_out() {
    left_out("-1", "negative");
    left_out("0", "zero");
}

fn left_out(word: &str, count: &str) {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let truth = [4.1, 2.2, 0.0];
    let (mut numbers, mut written) = (Numbers(3), 0);
    let input = table(4, 150, |row, i| {
        let range = distance(&RECTANGLE[i], &truth) + 0.04 * numbers.normal();
        let is_none = (3 * row + i) % 7 < 2;
        written += usize::from(is_none);
        if is_none { word.parse().unwrap() } else { range }
    });
    let words = [
        "ranges",
        "-",
        "--anchors",
        "anchors.csv",
        "--json",
        "--bias",
        "0",
        "--scale",
        "0",
    ];
    let output = fewbits(folder.path(), &words, input.as_bytes());
    let rows: Vec<serde_json::Value> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert!(
        rows.iter()
            .skip(5)
            .all(|row| off(row, &truth) < 0.2 && row["events"] == ""),
        "{}",
        rows[149]
    );
    let summary: serde_json::Value = serde_json::from_str(text(&output.stderr).lines().last().unwrap()).unwrap();
    assert_eq!(summary[count], written, "{summary}");
}

/// A line of the table of anchors that is copied and not changed.
#[test]
fn anchors_at_one_place_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let places = [RECTANGLE[0], RECTANGLE[1], RECTANGLE[2], RECTANGLE[3], RECTANGLE[3]];
    anchors(folder.path(), &places, 1.0, false);
    let input = table(5, 20, |_, i| distance(&places[i], &[4.1, 2.2, 0.0]));
    let words = ["ranges", "-", "--anchors", "anchors.csv", "--json"];
    let output = fewbits(folder.path(), &words, input.as_bytes());
    assert!(text(&output.stderr).contains("n3 and n4 stand at one place"), "{}", text(&output.stderr));
}

/// Rows of several radios are not always in order.
#[test]
fn late_rows_are_taken_in() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let truth = [4.1, 2.2, 0.0];
    let mut rows: Vec<String> = (0..80)
        .map(|k| format!("{},n{},{}", 0.2 * f64::from(k), k % 4, distance(&RECTANGLE[k as usize % 4], &truth)))
        .collect();
    rows.swap(30, 31);
    let input = format!("time,anchor,range\n{}\n", rows.join("\n"));
    let options = ["--by", "anchor", "--late", "2s", "--bias", "0", "--scale", "0"];
    assert!(off(ranges(folder.path(), &input, &options).last().unwrap(), &truth) < 0.02);
    let words = ["ranges", "-", "--anchors", "anchors.csv", "--by", "anchor"];
    assert!(refused(folder.path(), &words, input.as_bytes()).contains("--late"));
}

/// Ranges in centimetres beside anchors in metres cannot be right, and a track that is lost again and again does not say why.
#[test]
fn ranges_of_another_unit_are_told() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    for (unit, told) in [(100.0, "many times longer"), (0.001, "many times shorter"), (1.0, "")] {
        let input = table(4, 60, |_, i| unit * distance(&RECTANGLE[i], &[4.1, 2.2, 0.0]));
        let output = fewbits(folder.path(), &["ranges", "-", "--anchors", "anchors.csv"], input.as_bytes());
        let said = text(&output.stderr);
        assert_eq!(said.contains("one unit"), !told.is_empty(), "{said}");
        assert!(said.contains(told), "{said}");
    }
}

/// Rounded ranges of a target at rest have errors that do not average out: the band was .06 wide and .18 beside the place.
#[test]
fn rounded_ranges_are_told_with_the_mend() {
    let folder = tempfile::tempdir().unwrap();
    let places = [
        [0.0, 0.0, 0.0],
        [14.0, 1.0, 0.0],
        [13.0, 10.0, 0.0],
        [-1.0, 9.0, 0.0],
        [6.0, 12.0, 0.0],
    ];
    anchors(folder.path(), &places, 1.0, false);
    let truth = [4.3, 3.6, 0.0];
    let said = |step: f64, options: &[&str]| {
        let input = table(5, 80, |_, i| (distance(&places[i], &truth) / step).round() * step);
        let words = [&["ranges", "-", "--anchors", "anchors.csv"], options].concat();
        text(&fewbits(folder.path(), &words, input.as_bytes()).stderr).to_owned()
    };
    assert!(said(0.5, &[]).contains("--anchor-bias 0.144"), "{}", said(0.5, &[]));
    assert!(!said(1e-4, &[]).contains("multiples"));
    let mend = ["--anchor-bias", "0.144"];
    assert!(!said(0.5, &mend).contains("multiples"));
    let input = table(5, 80, |_, i| (distance(&places[i], &truth) / 0.5).round() * 0.5);
    assert!(holds(ranges(folder.path(), &input, &mend).last().unwrap(), &truth));
}

/// Rows of two targets were mixed into one path without a word, 3 m off under a narrow band.
#[test]
fn several_targets_are_refused_with_the_mend() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let words = [
        "ranges",
        "t.csv",
        "--anchors",
        "anchors.csv",
        "--by",
        "anchor",
        "--columns",
        "range",
    ];
    let write = |column: &str, label: &dyn Fn(usize) -> String| {
        let mut input = format!("time,{column},anchor,range\n");
        for row in 0..200 {
            let truth = if row % 2 == 0 { [4.0, 2.0, 0.0] } else { [9.0, 5.0, 0.0] };
            let range = distance(&RECTANGLE[row / 2 % 4], &truth);
            input += &format!("{},{},n{},{range}\n", 0.1 * (row / 2) as f64, label(row), row / 2 % 4);
        }
        std::fs::write(folder.path().join("t.csv"), input).unwrap();
    };
    for (column, label) in [("tag", "t"), ("id", "badge "), ("target", "")] {
        write(column, &|row| format!("{label}{}", row % 2));
        let error = refused(folder.path(), &words, b"");
        assert!(error.contains("names 2 targets") && error.contains(&format!("--target {column}")), "{error}");
    }
    // One target, a counter, and another name of the anchors.
    for label in [
        |_| "t".to_owned(),
        |row: usize| row.to_string(),
        |row: usize| format!("b{}", row / 2 % 4),
    ] {
        write("id", &label);
        assert!(fewbits(folder.path(), &words, b"").status.success());
    }
}

/// Two targets of one file have each a track, in one table.
#[test]
fn several_targets_have_a_track_each() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let truths = [[4.0, 2.0, 0.0], [9.0, 5.0, 0.0]];
    let line = |row: usize| {
        let range = distance(&RECTANGLE[row / 2 % 4], &truths[row % 2]);
        format!("{},t{},n{},{range}\n", 0.1 * (row / 2) as f64, row % 2, row / 2 % 4)
    };
    let mixed: String = (0..200).map(line).collect();
    let apart: String = (0..200).step_by(2).chain((1..200).step_by(2)).map(line).collect();
    // In turns, one behind the other, and with rows of no target.
    for rows in [mixed.clone(), apart, mixed + "9.9,,n0,700\n"] {
        std::fs::write(folder.path().join("t.csv"), format!("time,tag,anchor,range\n{rows}")).unwrap();
        let words = [
            "ranges",
            "t.csv",
            "--anchors",
            "anchors.csv",
            "--target",
            "tag",
            "--json",
        ];
        let out = text(&good(folder.path(), &words, b"")).to_owned();
        let found: Vec<serde_json::Value> = out.lines().map(|row| serde_json::from_str(row).unwrap()).collect();
        assert_eq!(found.len(), 200);
        for (name, truth) in ["t0", "t1"].iter().zip(&truths) {
            let own: Vec<&serde_json::Value> = found.iter().filter(|row| row["target"] == **name).collect();
            assert_eq!(own.len(), 100);
            assert!(holds(own[99], truth) && off(own[99], truth) < 0.1, "{}", own[99]);
        }
    }
    let told =
        text(&fewbits(folder.path(), &["ranges", "t.csv", "--anchors", "anchors.csv", "--target", "tag"], b"").stderr)
            .to_owned();
    assert!(told.contains("t1: 100 rows"), "{told}");
    let pipe = refused(folder.path(), &["ranges", "-", "--anchors", "anchors.csv", "--target", "tag"], b"a,b\n1,2\n");
    assert!(pipe.contains("--target") && pipe.contains("a file"), "{pipe}");
}

/// Rows that state how accurate they are, five times too small a number: the bad ones were believed as the good ones.
#[test]
fn accuracies_of_rows_are_taken_in_proportion() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let mut numbers = Numbers(5);
    let truth = |row: usize| {
        let angle = 0.01 * row as f64;
        [6.0 + 3.0 * angle.sin(), 3.5 + 2.0 * (0.8 * angle).cos(), 0.0]
    };
    let (mut rows, mut wide) = (String::new(), String::from("time,n0,n1,n2,n3,accuracy\n"));
    for row in 0..600 {
        let accuracy = if row % 3 == 0 { 0.02 } else { 0.4 };
        let mut measured = |i: usize| distance(&RECTANGLE[i], &truth(row)) + accuracy * numbers.normal();
        let range = measured(row % 4);
        rows += &format!("{},n{},{range},{}\n", 0.05 * row as f64, row % 4, 0.2 * accuracy);
        let cells = [0, 1, 2, 3].map(|i| measured(i).to_string());
        wide += &format!("{},{},{accuracy}\n", 0.05 * row as f64, cells.join(","));
    }
    let rms = |table: &str, options: &[&str]| {
        let found = ranges(folder.path(), table, options);
        let late = found.iter().enumerate().skip(100);
        let held = late.clone().filter(|(row, found)| holds(found, &truth(*row))).count();
        let squares: f64 = late.map(|(row, found)| off(found, &truth(row)).powi(2)).sum();
        ((squares / 500.0).sqrt(), held)
    };
    let found = rms(&format!("time,anchor,range,std\n{rows}"), &[]);
    let named = rms(&format!("time,anchor,range,q\n{rows}"), &["--by", "anchor", "--accuracy-column", "q"]);
    let none = rms(&format!("time,anchor,range,q\n{rows}"), &["--by", "anchor", "--columns", "range"]);
    let wide = rms(&wide, &[]);
    println!("{found:?} {named:?} {none:?} {wide:?}");
    assert!(found == named && found.0 < 0.6 * none.0 && wide.0 < 0.1, "{found:?} {named:?} {none:?} {wide:?}");
    assert!(found.1 > 420 && wide.1 > 420, "{found:?} {wide:?}");
    let table = format!("time,anchor,range,std\n{rows}");
    let told =
        text(&fewbits(folder.path(), &["ranges", "-", "--anchors", "anchors.csv"], table.as_bytes()).stderr).to_owned();
    assert!(told.contains("times as much as rows state"), "{told}");
    let bits = refused(folder.path(), &["ranges", "-", "--anchors", "anchors.csv", "--send", "bit"], table.as_bytes());
    assert!(bits.contains("ranges in full"), "{bits}");
}

/// A table that is written every 10 s, with old ranges where there is no new one: bands held .69 of the truths.
#[test]
fn ranges_that_repeat_and_slow_ones_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let places = [
        [0.0, 0.0, 0.0],
        [100.0, 0.0, 0.0],
        [100.0, 80.0, 0.0],
        [0.0, 80.0, 0.0],
        [50.0, 95.0, 0.0],
    ];
    anchors(folder.path(), &places, 1.0, false);
    let mut numbers = Numbers(8);
    let truth = |row: usize| {
        let angle = 0.07 * row as f64;
        [50.0 + 30.0 * angle.sin(), 40.0 + 25.0 * (0.8 * angle).cos(), 0.0]
    };
    let (mut last, mut rows) = ([0.0; 5], String::from("time,n0,n1,n2,n3,n4\n"));
    for row in 0..200 {
        for (i, last) in last.iter_mut().enumerate() {
            if row == 0 || numbers.normal() > 0.0 {
                *last = distance(&places[i], &truth(row)) + 0.2 * numbers.normal();
            }
        }
        rows += &format!("{},{}\n", 10 * row, last.map(|range| format!("{range:.3}")).join(","));
    }
    std::fs::write(folder.path().join("t.csv"), &rows).unwrap();
    let words = ["ranges", "t.csv", "--anchors", "anchors.csv", "--json"];
    let out = text(&good(folder.path(), &words, b"")).to_owned();
    let found: Vec<serde_json::Value> = out.lines().map(|row| serde_json::from_str(row).unwrap()).collect();
    let held = found
        .iter()
        .enumerate()
        .filter(|(row, found)| holds(found, &truth(*row)))
        .count();
    assert!(held > 170, "{held}");
    let told = text(&fewbits(folder.path(), &words[..4], b"").stderr).to_owned();
    assert!(told.contains("that repeat the one before are left out") && told.contains("--silence 80"), "{told}");
}

/// The range among other columns, a status in words among them; a row whose range is missing has the place that is expected.
#[test]
fn the_column_of_ranges_is_found_among_others() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let truth = [4.0, 2.0, 0.0];
    let mut rows = String::from("time,anchor,range,state,fp_power\n");
    for row in 0..100 {
        let range = distance(&RECTANGLE[row % 4], &truth);
        let range = if row % 5 == 4 { String::new() } else { range.to_string() };
        rows += &format!("{},n{},{range},{},-{}\n", 0.1 * row as f64, row % 4, ["ok", "late"][row % 2], 80 + row % 7);
    }
    std::fs::write(folder.path().join("t.csv"), &rows).unwrap();
    let words = ["ranges", "t.csv", "--anchors", "anchors.csv", "--json"];
    let out = text(&good(folder.path(), &words, b"")).to_owned();
    let found: Vec<serde_json::Value> = out.lines().map(|row| serde_json::from_str(row).unwrap()).collect();
    assert!(found.len() == 100 && found[20..].iter().all(|row| holds(row, &truth)), "{out}");
    let told = text(&fewbits(folder.path(), &words[..4], b"").stderr).to_owned();
    assert!(
        told.contains("range is taken for the range") && told.contains("left out: state, fp_power"),
        "{told}"
    );
    let pipe = refused(folder.path(), &["ranges", "-", "--anchors", "anchors.csv"], rows.as_bytes());
    assert!(pipe.contains("--columns"), "{pipe}");
}

/// Ranges between two targets are not those of an anchor; and a target far from all anchors is told.
#[test]
fn ranges_between_targets_and_far_ones_are_told() {
    let folder = tempfile::tempdir().unwrap();
    anchors(folder.path(), &RECTANGLE, 1.0, false);
    let truths = [[4.0, 2.0, 0.0], [120.0, 70.0, 0.0]];
    let mut rows = String::from("time,tag,anchor,range\n");
    for row in 0..400 {
        let (target, step) = (row % 2, row / 2);
        let (name, place) = match step % 5 {
            4 => (format!("t{}", 1 - target), truths[1 - target]),
            anchor => (format!("n{anchor}"), RECTANGLE[anchor]),
        };
        rows += &format!("{},t{target},{name},{}\n", 0.1 * step as f64, distance(&place, &truths[target]));
    }
    std::fs::write(folder.path().join("t.csv"), rows).unwrap();
    let told = fewbits(folder.path(), &["ranges", "t.csv", "--anchors", "anchors.csv", "--target", "tag"], b"");
    let told = text(&told.stderr).to_owned();
    assert!(told.contains("t0: 40 ranges to other targets were left out"), "{told}");
    let far = "the target is far from the anchors";
    assert!(told.contains(&format!("t1: {far}")) && !told.contains(&format!("t0: {far}")), "{told}");
}

/// Anchors whose names are exchanged, and ranges that are no distances: the mend is told.
#[test]
fn mistakes_of_tables_are_told_with_the_mend() {
    let folder = tempfile::tempdir().unwrap();
    let places = [
        [0.0, 0.0, 0.0],
        [14.0, 1.0, 0.0],
        [13.0, 10.0, 0.0],
        [-1.0, 9.0, 0.0],
        [6.0, 12.0, 0.0],
    ];
    anchors(folder.path(), &places, 1.0, false);
    let said = |range: &dyn Fn(usize, f64) -> f64, swapped: bool| {
        let mut numbers = Numbers(3);
        let input = table(5, 80, |row, i| {
            let angle = 0.06 * row as f64;
            let truth = [6.0 + 3.0 * angle.sin(), 5.0 + 2.5 * (0.8 * angle).cos(), 0.0];
            let place = match i {
                1 | 2 if swapped => 3 - i,
                _ => i,
            };
            range(i, distance(&places[place], &truth) + 0.05 * numbers.normal())
        });
        text(&fewbits(folder.path(), &["ranges", "-", "--anchors", "anchors.csv"], input.as_bytes()).stderr).to_owned()
    };
    let right = said(&|_, range| range, false);
    assert!(!right.contains("as if") && !right.contains("--missing"), "{right}");
    let swapped = said(&|_, range| range, true);
    assert!(swapped.contains("anchors n1 and n2 had each other's place"), "{swapped}");
    let times = said(&|_, range| range / 0.149_896_229, false);
    assert!(times.contains("multiply them by 0.149896229"), "{times}");
    let limited = said(&|_, range| range.min(8.0), false);
    assert!(limited.contains("--missing 8 leaves them out"), "{limited}");
}
