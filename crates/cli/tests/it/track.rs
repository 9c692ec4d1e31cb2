//! `fewbits track`: levels and places, from files and pipes.

use crate::{fewbits, good, refused, text};
use std::path::{Path, PathBuf};

/// Tables of the documentation: ten thermometers, ranges of a walk, its anchors.
fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// Splitmix64, and from it numbers that are nearly normal (twelve uniform ones added up).
struct Numbers(u64);

impl Numbers {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A random walk of steps of .2 that three sensors measure in noise of .5, at irregular times; its truth.
fn walk(rows: usize) -> (String, Vec<f64>) {
    let (mut numbers, mut level, mut time) = (Numbers(3), 5.0, 0.0);
    let (mut table, mut truth) = ("time,a,b,c\n".to_owned(), Vec::new());
    for _ in 0..rows {
        let seconds = 0.5 + numbers.uniform();
        time += seconds;
        level += 0.2 * seconds.sqrt() * numbers.normal();
        let cells: Vec<String> = (0..3)
            .map(|_| format!("{:.4}", level + 0.5 * numbers.normal()))
            .collect();
        table += &format!("{time:.3},{}\n", cells.join(","));
        truth.push(level);
    }
    (table, truth)
}

/// Columns of a CSV by name, empty cells as NaN.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let at = lines
        .next()
        .unwrap()
        .split(',')
        .position(|known| known == name)
        .unwrap();
    lines
        .map(|line| line.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN))
        .collect()
}

fn rms(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), (a, b)| (sum + (a - b) * (a - b), count + 1.0));
    f64::sqrt(sum / count)
}

#[test]
fn level_is_found_with_bands_that_hold_it() {
    let folder = tempfile::tempdir().unwrap();
    let (table, truth) = walk(600);
    let mut errors = Vec::new();
    for send in ["value", "word:3", "bit"] {
        let out = text(&good(folder.path(), &["track", "-", "--send", send], table.as_bytes()));
        let (level, low, high) = (column(&out, "level"), column(&out, "level_low"), column(&out, "level_high"));
        // The start and what was learnt late count as well: 95 % within five.
        let inside = (0..600)
            .filter(|i| low[*i] <= truth[*i] && truth[*i] <= high[*i])
            .count();
        assert!(inside >= 540, "{send}: {inside} of 600");
        errors.push(rms(level.iter().copied().zip(truth.iter().copied()).skip(20)));
    }
    // The steady error of a Kalman filter with these numbers: variance p with (p + q) r / (p + q + r) = p, r = .25 / 3, q = .04.
    let (q, r) = (0.04_f64, 0.25 / 3.0);
    let least = (0.5 * (q * q + 4.0 * q * r).sqrt() - 0.5 * q).sqrt();
    assert!(errors[0] < 1.1 * least, "{errors:?} {least}");
    // A sign bit has 2 / pi of a value's information, three bits more than nine tenths.
    assert!(errors[1] < 1.15 * least && errors[2] < 1.5 * least, "{errors:?} {least}");
}

#[test]
fn reports_by_name_give_what_their_values_give() {
    let folder = tempfile::tempdir().unwrap();
    let (table, _) = walk(50);
    let known = ["--noise", "0.5", "--change", "0.2/1s", "--prior", "5±1"];
    let wide = text(&good(folder.path(), &[&["track", "-"], &known[..]].concat(), table.as_bytes()));
    let mut long = "name,time,value\n".to_owned();
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        (1..4).for_each(|i| long += &format!("{},{},{}\n", ["a", "b", "c"][i - 1], cells[0], cells[i]));
    }
    let by = ["track", "-", "--by", "name", "--time-column", "time"];
    let found = text(&good(folder.path(), &[&by[..], &known].concat(), long.as_bytes()));
    let (one, other) = (column(&wide, "level"), column(&found, "level"));
    assert_eq!(one.len(), other.len());
    // A table by names knows no gaps, and supposes another share of lost reports.
    assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-9), "{one:?} {other:?}");
}

#[test]
fn bits_against_fixed_thresholds_are_reports() {
    let folder = tempfile::tempdir().unwrap();
    // A float switch at 2 and one at 3, in water that rises by .01 per row from 1.5.
    let mut table = "low,high\n".to_owned();
    for i in 0..200 {
        let level = 1.5 + 0.01 * f64::from(i);
        table += &format!("{},{}\n", u8::from(level >= 2.0), u8::from(level >= 3.0));
    }
    let words = [
        "track",
        "-",
        "--reports",
        "--send",
        "bit",
        "--threshold",
        "low=2,high=3",
        "--noise",
        "0.1",
        "--change",
        "0.05",
        "--prior",
        "1.5±0.5",
    ];
    let out = text(&good(folder.path(), &words, table.as_bytes()));
    let (level, high) = (column(&out, "level"), column(&out, "level_high"));
    // When a switch turns the level is known.
    assert!((level[50] - 2.0).abs() < 0.15 && (level[150] - 3.0).abs() < 0.15, "{} {}", level[50], level[150]);
    assert!(high[150] - level[150] < 0.5);
}

#[test]
fn dead_sensor_is_named_in_the_summary() {
    let folder = tempfile::tempdir().unwrap();
    let words = [
        "track",
        "rooms.csv",
        "--align",
        "60",
        "--model",
        "velocity",
        "--send",
        "word:2",
        "--json",
    ];
    let svg = folder.path().join("rooms.svg");
    let words: Vec<&str> = words.into_iter().chain(["--plot", svg.to_str().unwrap()]).collect();
    let output = fewbits(&fixtures(), &words, b"");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stderr).unwrap();
    let of = |name: &str| {
        summary["sensors"]
            .as_array()
            .unwrap()
            .iter()
            .find(|s| s["name"] == name)
            .unwrap()
            .clone()
    };
    assert_eq!((of("s7")["used"].as_bool(), of("s1")["used"].as_bool()), (Some(false), Some(true)));
    assert!(
        summary["events"]
            .as_array()
            .unwrap()
            .iter()
            .any(|e| e["event"] == "dead" && e["sensor"] == "s7")
    );
    assert_eq!(summary["bits_per_report"], 2.0);
    let first: serde_json::Value = serde_json::from_str(text(&output.stdout).lines().next().unwrap()).unwrap();
    assert_eq!(first["time"], "2026-01-31T00:09:30Z");
    assert!(first["slope"].is_f64());
    let picture = std::fs::read_to_string(svg).unwrap();
    assert!(
        picture.starts_with("<svg") && picture.contains("polygon") && picture.contains("estimate from values in full")
    );
}

#[test]
fn place_is_found_from_ranges() {
    let words = [
        "track",
        "walk.csv",
        "--model",
        "ranges",
        "--by",
        "anchor",
        "--anchors",
        "anchors.csv",
        "--noise",
        "0.7",
        "--send",
        "word:2",
    ];
    let out = text(&good(&fixtures(), &words, b""));
    let (time, x, y) = (column(&out, "time"), column(&out, "x"), column(&out, "y"));
    // The walk of the fixture: a figure of eight in 90 seconds.
    let truth = |t: f64| {
        let a = std::f64::consts::TAU * t / 90.0;
        (9.0 + 7.0 * a.cos(), 7.0 + 5.0 * (2.0 * a).sin())
    };
    let error = rms((10..time.len()).map(|i| ((x[i] - truth(time[i]).0).hypot(y[i] - truth(time[i]).1), 0.0)));
    assert!(time.len() == 600 && error < 0.8, "{error}");
}

#[test]
fn refusals_of_track() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (words, input, part) in [
        (vec!["track", "-"], "time,a\n", "no rows"),
        (vec!["track", "-"], "", "the file is empty"),
        (vec!["track", "-"], "time,a\n1,2\n1,x\n", "line 3 (row 2), column `a`: `x` is not a number"),
        (vec!["track", "-"], "time,a\n1,2\n1\n", "line 3 (row 2): 1 cell instead of 2: mend the row"),
        (vec!["track", "-", "--delimiter", "|"], "time;a\n1;2\n", "holds words, and numbers are expected"),
        (vec!["track", "-"], "time,a\n2,2\n1,3\n", "row 2: time 1 is before"),
        (vec!["track", "-"], "time,a\n1,2\n2,2\n3,2\n", "--noise is needed"),
        (vec!["track", "-", "--send", "b=bit"], "time,a\n1,2\n", "no column `b`: there are a"),
        (vec!["track", "-", "--send", "word:9"], "time,a\n1,2\n", "`word:9` is not understood"),
        (vec!["track", "-", "--noise", "-1"], "time,a\n1,2\n", "unexpected argument '-1'"),
        (
            vec!["track", "-", "--noise=-1"],
            "time,a\n1,2\n",
            "--noise: `-1` is not understood: expected a standard deviation",
        ),
        (vec!["track", "-", "--prior", "5"], "time,a\n1,2\n", "as `20±5`"),
        (vec!["track", "-", "--change", "5/never"], "time,a\n1,2\n", "as `0.5/1h`"),
        (
            vec!["track", "-", "--reports", "--send", "bit"],
            "time,a\n1,1\n",
            "--noise is needed: it cannot be found from reports",
        ),
        (
            vec![
                "track",
                "-",
                "--reports",
                "--send",
                "bit",
                "--noise",
                "1",
                "--change",
                "1",
                "--prior",
                "0±1",
            ],
            "time,a\n1,1\n2,7\n",
            "row 2: argument `report` is 7",
        ),
        (vec!["track", "-", "--by", "b"], "time,a\n1,2\n", "no column `b`: there are time, a"),
        (vec!["track", "-", "--model", "ranges"], "time,a\n1,2\n", "--anchors"),
        (
            vec!["track", "-", "--model", "ranges", "--anchors", "none.csv"],
            "time,a\n1,2\n",
            "none.csv: cannot open",
        ),
    ] {
        let message = refused(here, &words, input.as_bytes());
        assert!(message.contains(part), "{words:?}: {message}");
    }
    std::fs::write(here.join("anchors.csv"), "n,x,y\na,0,0\nb,1,0\na,0,1\n").unwrap();
    let words = ["track", "-", "--model", "ranges", "--anchors", "anchors.csv"];
    let message = refused(here, &words, b"time,a\n1,2\n");
    assert!(message.contains("anchors.csv: row 3: anchor `a` stands here twice"), "{message}");
    std::fs::write(here.join("anchors.csv"), "n,x,y\na,0,0\nb,1,0\nc,0,1\n").unwrap();
    let message = refused(here, &words, b"time,a,d\n1,2,3\n");
    assert!(message.contains("`d` is no anchor of anchors.csv"), "{message}");
}
