//! Tables of strangers through the command: what is packed comes back, what cannot be kept is refused with the mend.

use super::{fewbits, good, refused, text};
use tempfile::TempDir;

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

/// Packs `t.csv` with these options, verifies it with `look`-like options only, and unpacks it.
fn round_trip(table: &str, options: &[&str]) -> String {
    let folder = folder(&[("t.csv", table)]);
    let path = folder.path();
    good(path, &[&["pack", "t.csv", "-o", "t.fewb"], options].concat(), b"");
    let said: Vec<&str> = options
        .chunks(2)
        .filter(|pair| !matches!(pair[0], "--time" | "--bound"))
        .flatten()
        .copied()
        .collect();
    let verdict = text(&good(path, &[&["verify", "t.csv", "t.fewb"], said.as_slice()].concat(), b""));
    assert!(verdict.contains("all promises hold"), "{verdict}");
    text(&good(path, &["unpack", "t.fewb"], b""))
}

#[test]
fn times_come_back_as_the_times_they_are() {
    for (cell, back) in [
        ("2023-11-15T00:13:20.5+02:00", "2023-11-14T22:13:20.500Z"),
        ("2018-10-28 02:00:00", "2018-10-28T02:00:00"),
        ("1952-01-01T00:00:00", "1952-01-01T00:00:00"),
        ("1952-01-01T00:00:00Z", "1952-01-01T00:00:00Z"),
        ("2018-01-01 24:00", "2018-01-02T00:00:00"),
        ("1700000000250", "2023-11-14T22:13:20.250Z"),
        ("1700000000.123456", "1700000000.123456"),
        ("9:42", "34920"),
    ] {
        assert_eq!(round_trip(&format!("when,x\n{cell},1.5\n"), &["--time", "exact"]), format!("when,x\n{back},1.5\n"));
    }
    // A tolerance is one of the times, not of their milliseconds.
    let rows: String = (0..50)
        .map(|i| format!("{},{i}\n", 1_700_000_000_000_i64 + 1000 * i + i % 7))
        .collect();
    let folder = folder(&[("t.csv", &format!("time,x\n{rows}"))]);
    let size = |time: &str| {
        good(folder.path(), &["pack", "t.csv", "--time", time, "-o", "t.fewb"], b"");
        assert!(text(&good(folder.path(), &["verify", "t.csv", "t.fewb"], b"")).contains("all promises hold"));
        std::fs::metadata(folder.path().join("t.fewb")).unwrap().len()
    };
    assert!(size("±10ms") < size("exact"));
}

#[test]
fn exact_times_are_exact_or_refused() {
    for (cell, mend) in [
        ("2016-12-31T23:59:60Z", "--time ±1s"),
        ("1/2/2023", "--time-format dmy"),
        ("2023-11-14T22:13:20.0123456789012345Z", "--time ±2ns"),
    ] {
        let folder = folder(&[("t.csv", &format!("time,x\n{cell},1\n"))]);
        let message = refused(folder.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"");
        assert!(message.contains(mend) && message.contains("line 2"), "{message}");
        assert!(!folder.path().join("t.fewb").exists());
    }
    let drift = "t,v\n0.30000000000000004,1\n92.30000000000001,2\n";
    let folder = folder(&[("t.csv", drift)]);
    let message = refused(folder.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"");
    assert!(message.contains("--time ±2ns") && message.contains("line 3"), "{message}");
    let back = round_trip(drift, &["--time", "±1us"]);
    assert!(back.lines().nth(1).unwrap().starts_with("0.3"), "{back}");
}

#[test]
fn words_and_booleans_are_kept_whatever_the_bound() {
    let table = "time,mode,on,temp\n0,off,true,1.04\n1,heat,false,2\n2,,true,\n3,\"a, b\",,3\n";
    let back = round_trip(table, &["--time", "exact", "--bound", "*=±0.4"]);
    let modes: Vec<&str> = back
        .lines()
        .skip(1)
        .map(|line| line.split_once(',').unwrap().1)
        .collect();
    assert!(modes[0].starts_with("off,1,") && modes[1].starts_with("heat,0,"), "{back}");
    assert!(modes[2].starts_with(",1,") && modes[3].starts_with("\"a, b\",,"), "{back}");
    // A word that the recording has not is refused.
    let folder = folder(&[
        ("t.csv", table),
        ("u.csv", "time,mode,on,temp\n4,heat,true,1\n5,dry,true,1\n"),
    ]);
    good(folder.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"");
    let message = refused(folder.path(), &["pack", "u.csv", "--time", "exact", "--append", "-o", "t.fewb"], b"");
    assert!(message.contains("`dry` is none of the words") && message.contains("line 3"), "{message}");
}

#[test]
fn sentinels_are_gaps_before_ranges_are_taken() {
    let rows: String = (0..100)
        .map(|i| {
            format!(
                "{i},{}\n",
                if i == 50 {
                    "-9999".to_owned()
                } else {
                    format!("{}.5", 16 + i % 7)
                }
            )
        })
        .collect();
    let table = format!("time,temp\n{rows}");
    let back = round_trip(&table, &["--time", "exact", "--bound", "1%", "--missing", "-9999"]);
    for (line, own) in back.lines().skip(1).zip(table.lines().skip(1)) {
        let (back, own) = (line.split_once(',').unwrap().1, own.split_once(',').unwrap().1);
        match own {
            "-9999" => assert_eq!(back, ""),
            own => assert!((back.parse::<f64>().unwrap() - own.parse::<f64>().unwrap()).abs() <= 0.0601, "{line}"),
        }
    }
}

#[test]
fn dialects_are_detected_said_and_stored() {
    let semicolons = "sep=;\nDatum;Zeit;Temp\n14.11.2023;22:13:20;19,75\n14.11.2023;22:13:21;20,5\n";
    let expected = "time,Temp\n2023-11-14T22:13:20,19.75\n2023-11-14T22:13:21,20.5\n";
    assert_eq!(round_trip(semicolons, &["--time", "exact", "--time-column", "Datum,Zeit"]), expected);
    let folder = folder(&[("t.csv", semicolons), ("n.dat", "1 2.5\n2 3.5\n")]);
    let path = folder.path();
    let stored = text(&good(path, &["look", "t.csv", "--time-column", "Datum,Zeit", "--toml"], b""));
    std::fs::write(path.join("d.toml"), stored).unwrap();
    good(
        path,
        &[
            "pack",
            "t.csv",
            "--dialect",
            "d.toml",
            "--time",
            "exact",
            "-o",
            "t.fewb",
        ],
        b"",
    );
    assert_eq!(text(&good(path, &["unpack", "t.fewb"], b"")), expected);
    let message = refused(path, &["pack", "n.dat", "-o", "n.fewb"], b"");
    assert!(message.contains("n.dat") && message.contains("--no-header"), "{message}");
    good(
        path,
        &[
            "pack",
            "n.dat",
            "--no-header",
            "--time",
            "exact",
            "--time-column",
            "#1",
            "-o",
            "n.fewb",
        ],
        b"",
    );
    assert_eq!(text(&good(path, &["unpack", "n.fewb"], b"")), "time,column_2\n1,2.5\n2,3.5\n");
}

#[test]
fn bad_lines_are_left_out_counted_and_named() {
    let table = "time,x\n0,1\n1,2..5\n2,3\n3\n";
    let folder = folder(&[("t.csv", table)]);
    let words = ["pack", "t.csv", "--time", "exact", "-o", "t.fewb"];
    let message = refused(folder.path(), &words, b"");
    assert!(message.contains("line 5 (row 4): 1 cell instead of 2"), "{message}");
    let whole = self::folder(&[("t.csv", table.strip_suffix("3\n").unwrap())]);
    let message = refused(whole.path(), &words, b"");
    assert!(message.contains("line 3 (row 2), column `x`: `2..5` is not a number"), "{message}");
    let output = fewbits(folder.path(), &[&words[..], &["--skip-bad", "2"]].concat(), b"");
    let message = text(&output.stderr);
    assert!(
        output.status.success() && message.contains("2 lines were left out") && message.contains("line 5"),
        "{message}"
    );
    assert_eq!(text(&good(folder.path(), &["unpack", "t.fewb"], b"")), "time,x\n0,1\n2,3\n");
}

#[test]
fn a_look_shows_what_was_understood() {
    let mut table = "# roof\ntime,temp,mode,id\n".to_owned();
    for i in 0..40 {
        table += &format!(
            "{},{},{},{}\n",
            60 * i,
            if i == 9 {
                "-9999".to_owned()
            } else {
                format!("{}.25", 16 + i % 5)
            },
            ["off", "on fire"][i % 2],
            "ERR".repeat(usize::from(i == 7))
        );
    }
    let folder = folder(&[("t.csv", &format!("{table}2400,x,off,\n"))]);
    let look = text(&good(folder.path(), &["look", "t.csv"], b""));
    for part in [
        "41 rows",
        "--delimiter ,",
        "time: time; seconds; 0 to 2400",
        "steps of 60 to 60 s",
        "temp: number, -9999 to 20.25",
        "1 cells that are no number, first at line 43 (row 41): `x`",
        "-9999 in 1 cells makes most of the range",
        "--missing 'temp=-9999'",
        "mode: words (off, on fire)",
    ] {
        assert!(look.contains(part), "{part}\n{look}");
    }
    let json: serde_json::Value =
        serde_json::from_slice(&good(folder.path(), &["look", "t.csv", "--json"], b"")).unwrap();
    assert_eq!((&json["rows"], &json["columns"][1]["sentinel"]), (&41.into(), &serde_json::json!(-9999.0)));
}

#[test]
fn whole_numbers_that_no_double_holds_are_refused() {
    for cell in ["9007199254740993", "9007199254740993.0", "1e400", "1e-400"] {
        let folder = folder(&[("t.csv", &format!("x\n1.5\n{cell}\n"))]);
        let message = refused(folder.path(), &["pack", "t.csv", "-o", "t.fewb"], b"");
        assert!(message.contains("line 3 (row 2), column `x`"), "{message}");
    }
    assert_eq!(
        round_trip("x,y\n1152921504606846976,1\n", &["--bound", "lossless"])
            .lines()
            .nth(1)
            .unwrap()
            .parse::<f64>()
            .ok(),
        None
    );
    // Blank lines of a table of one column are gaps, and an hour without data is a recording.
    assert_eq!(round_trip("x\n1.5\n\n2.5\n", &["--bound", "lossless"]), "x\n1.5\n\"\"\n2.5\n");
    assert_eq!(round_trip("time,x\n", &["--time", "exact"]), "time,x\n");
}

#[test]
fn whole_numbers_of_64_bits_come_back() {
    let ids = [
        "1152921504606846977",
        "1152921504606846979",
        "",
        "9223372036854775807",
        "-9223372036854775808",
        "7",
    ];
    let rows = |first: usize| -> String {
        let row = |(i, id): (usize, &&str)| format!("{},{id},{}.5\n", first + i, i);
        ids.iter().enumerate().map(row).collect()
    };
    let table = format!("time,id,x\n{}", rows(0));
    assert_eq!(round_trip(&table, &["--time", "exact", "--bound", "lossless"]), table);
    // Exactly, whatever the bound of all columns is.
    let folder = folder(&[
        ("t.csv", &table),
        ("u.csv", &format!("time,id,x\n{}", rows(6))),
        ("small.csv", "time,id,x\n12,5,0.5\n"),
        ("broken.csv", "time,id,x\n12,5.5,0.5\n"),
        ("doubles.csv", "time,id,x\n0,5.5,1\n"),
    ]);
    let path = folder.path();
    good(path, &["pack", "t.csv", "--time", "exact", "--bound", "±1000", "-o", "t.fewb"], b"");
    good(path, &["pack", "u.csv", "--time", "exact", "--bound", "±1000", "-o", "u.fewb"], b"");
    let column = |text: &str| -> Vec<String> {
        text.lines()
            .skip(1)
            .map(|line| line.split(',').nth(1).unwrap().to_owned())
            .collect()
    };
    assert_eq!(column(&text(&good(path, &["unpack", "t.fewb"], b""))), ids);
    assert!(text(&good(path, &["verify", "t.csv", "t.fewb"], b"")).contains("all promises hold"));
    let info = text(&good(path, &["info", "t.fewb"], b""));
    assert!(info.contains("id: lossless, -9223372036854775808 to 9223372036854775807, 1 gaps"), "{info}");
    // The first number of more than 53 bits stands behind many others; of a pipe it is then too late.
    let late: String = (0..3000)
        .map(|i| format!("{i},{}\n", if i == 2500 { (1_i64 << 60) + 1 } else { i }))
        .collect();
    std::fs::write(path.join("late.csv"), format!("time,id\n{late}")).unwrap();
    for options in [&[] as &[&str], &["--time", "exact"]] {
        good(path, &[&["pack", "late.csv", "-o", "late.fewb"], options].concat(), b"");
        assert!(text(&good(path, &["unpack", "late.fewb"], b"")).contains("1152921504606846977\n"));
        assert!(text(&good(path, &["verify", "late.csv", "late.fewb"], b"")).contains("all promises hold"));
    }
    let message = refused(path, &["pack", "-", "-o", "x"], format!("time,id\n{late}").as_bytes());
    assert!(message.contains("more than 53 bits"), "{message}");
    // Several recordings count from numbers of their own.
    let both = column(&text(&good(path, &["unpack", "u.fewb", "t.fewb"], b"")));
    assert_eq!(both, [ids, ids].concat());
    // Further rows, also of small numbers alone; no others.
    good(path, &["pack", "u.csv", "--time", "exact", "--append", "-o", "t.fewb"], b"");
    good(path, &["pack", "small.csv", "--time", "exact", "--append", "-o", "t.fewb"], b"");
    let all = column(&text(&good(path, &["unpack", "t.fewb"], b"")));
    assert_eq!(all, [ids.as_slice(), ids.as_slice(), &["5"]].concat());
    let message = refused(path, &["pack", "broken.csv", "--time", "exact", "--append", "-o", "t.fewb"], b"");
    assert!(message.contains("`5.5` is no whole number"), "{message}");
    good(path, &["pack", "doubles.csv", "--time", "exact", "-o", "d.fewb"], b"");
    let message = refused(path, &["pack", "t.csv", "--time", "exact", "--append", "-o", "d.fewb"], b"");
    assert!(message.contains("a recording of its own"), "{message}");
    // A recording under wider bounds has the same numbers. Stretches have those of the numbers, not of their codes.
    good(path, &["repack", "t.fewb", "--bound", "*=10%", "-o", "r.fewb"], b"");
    assert_eq!(column(&text(&good(path, &["unpack", "r.fewb"], b""))), all);
    assert_eq!(
        text(&good(path, &["cat", "t.fewb", "--every", "1h"], b""))
            .lines()
            .next(),
        Some("time,id mean,x mean")
    );
    let words = [
        "cat",
        "t.fewb",
        "--every",
        "100000h",
        "--columns",
        "id",
        "--min",
        "--max",
    ];
    let ends = text(&good(path, &words, b""));
    assert!(ends.contains(",-9223372036854775808,9223372036854775807\n"), "{ends}");
}

#[test]
fn commands_take_what_other_commands_took() {
    let rows: String = (0..40).map(|i| format!("{i},{}.25,3\n", i % 7)).collect();
    let folder = folder(&[
        ("t.csv", &format!("time,x,y\n{rows}")),
        ("leap.csv", "time,x\n2016-12-31T23:59:58Z,1\n2016-12-31T23:59:59Z,2\n2016-12-31T23:59:60Z,3\n"),
    ]);
    let path = folder.path();
    // Columns by number, in the table that they are columns of.
    good(path, &["pack", "t.csv", "--time", "exact", "--columns", "#3", "-o", "y.fewb"], b"");
    assert!(text(&good(path, &["verify", "t.csv", "y.fewb", "--columns", "#3"], b"")).contains("all promises hold"));
    assert!(refused(path, &["verify", "t.csv", "y.fewb", "--columns", "#2"], b"").contains("no column `x`"));
    // An output that was asked for is there, though no bound is wider.
    good(path, &["repack", "y.fewb", "--bound", "lossless", "-o", "copy.fewb"], b"");
    let bytes = |name: &str| std::fs::read(path.join(name)).unwrap();
    assert_eq!(bytes("copy.fewb"), bytes("y.fewb"));
    // The recording's own tolerance of times takes what it took before.
    good(path, &["pack", "leap.csv", "--time", "±1s", "-o", "leap.fewb"], b"");
    good(path, &["pack", "leap.csv", "--time", "±1s", "--append", "-o", "leap.fewb"], b"");
    assert_eq!(text(&good(path, &["unpack", "leap.fewb"], b"")).lines().count(), 7);
}

#[test]
fn verify_names_the_option_of_gaps() {
    let folder = folder(&[("s.csv", "time,a\n1,5.5\n2,-9999\n")]);
    let folder = folder.path();
    good(folder, &["pack", "s.csv", "--time", "exact", "--missing", "-9999", "-o", "s.fewb"], b"");
    let output = fewbits(folder, &["verify", "s.csv", "s.fewb"], b"");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).contains("--missing, as for pack"), "{}", text(&output.stdout));
    good(folder, &["verify", "s.csv", "s.fewb", "--missing", "-9999"], b"");
}

#[test]
fn look_names_columns_of_text_that_are_no_words() {
    let row = |i: usize| format!("{i},{}{i},\"+{i},1\",{}\n", "long ".repeat(6), i % 9);
    let table = (0..300).fold("time,note,code,x\n".to_owned(), |text, i| text + &row(i % 60));
    let codes = (0..300).fold("time,code\n".to_owned(), |text, i| text + &format!("{i},\"+{i},1\"\n"));
    let folder = folder(&[("s.csv", &table), ("t.csv", &codes)]);
    let shown = text(&good(folder.path(), &["look", "t.csv"], b""));
    assert!(shown.contains("all of its cells: if it is text, say --without code"), "{shown}");
    let shown = text(&good(folder.path(), &["look", "s.csv"], b""));
    assert!(shown.contains("too long for a recording, say --without note"), "{shown}");
}

/// Nothing but its numbers says that the first column is the time.
#[test]
fn first_column_taken_for_the_time_is_told() {
    for (name, is_told) in [("step", true), ("time", false)] {
        let kept = folder(&[("t.csv", &format!("{name},x\n1,5\n2,6\n4,7\n"))]);
        let output = fewbits(kept.path(), &["pack", "t.csv", "--time", "exact", "-o", "t.fewb"], b"");
        let said = text(&output.stderr);
        assert_eq!(
            said.matches("the first column, `step`, is taken for the time").count(),
            usize::from(is_told),
            "{said}"
        );
    }
}

#[test]
fn messages_do_not_repeat_long_names() {
    let name = "x".repeat(50_000);
    let bad = format!("time,{name}\n1,1\n2,2\n3,abc\n");
    let kept = folder(&[("long.csv", &bad), ("good.csv", &bad.replace("abc", "3"))]);
    let folder = kept.path();
    for words in [
        &["pack", "long.csv", "--time", "exact", "-o", "l.fewb"][..],
        &["pack", "good.csv", "--time", "exact", "-o", "l.fewb"],
        &["pack", "good.csv", "--bound", "q=1", "-o", "l.fewb"],
        &["pack", "good.csv", "--bound", &format!("{name}y=1"), "-o", "l.fewb"],
    ] {
        let refusal = refused(folder, words, b"");
        assert!(refusal.len() < 6000, "{}", refusal.len());
    }
    assert!(text(&good(folder, &["look", "good.csv"], b"")).len() < 2000);
}

/// A column of numbers of another spelling came back as words, and nothing said so.
#[test]
fn words_that_begin_with_digits_are_told() {
    let folder = folder(&[
        ("lat.csv", "time,lat,state\n0,52°31'12\"N,3 on\n1,52°31'13\"N,off\n"),
        ("codes.csv", "time,part,caller\n0,4k7,+491715550000\n1,5k7,+491715550001\n"),
    ]);
    let told = |file: &str| {
        let output = fewbits(folder.path(), &["pack", file, "--time", "exact", "-o", "a.fewb"], b"");
        text(&output.stderr)
    };
    let lat = told("lat.csv");
    assert_eq!(lat.matches("is kept as words").count(), 1, "{lat}");
    assert!(lat.contains("the column `lat` is kept as words, as `52°31'12\"N`"), "{lat}");
    let codes = told("codes.csv");
    assert!(!codes.contains("is kept as words"), "{codes}");
    assert_eq!(codes.matches("`+491715550000` of the column `caller`").count(), 1, "{codes}");
}
