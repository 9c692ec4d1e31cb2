//! `fewbits design`: from numbers or a sample to tables, JSON and C.

use crate::{good, refused, text};
use std::process::Command;

const JOB: [&str; 7] = ["design", "--prior", "20±4", "--noise", "1,1", "--flips", "0.02"];

#[test]
fn design_is_written_in_every_form() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let job = |more: &[&'static str]| [&JOB[..], &["--bits", "2", "--plot", "cells.svg"], more].concat();
    let table = text(&good(here, &job(&["--adc", "12:0..40"]), b""));
    assert!(table.contains("mean squared error") && table.contains("sensor 1: thresholds in codes"), "{table}");
    let json = good(here, &job(&["--json"]), b"");
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    let value = json["value"].as_f64().unwrap();
    // More than without flips could be reached, less than the prior.
    assert!(value > 0.5 && value < 16.0, "{json}");
    assert!(
        std::fs::read_to_string(here.join("cells.svg"))
            .unwrap()
            .contains("<rect")
    );
    assert!(text(&good(here, &job(&["--form", "rust"]), b"")).contains("pub const BREAKPOINTS_1"));
    good(here, &job(&["--form", "c", "--name", "plant", "-o", "plant.h"]), b"");
    std::fs::write(
        here.join("main.c"),
        "#include <stdio.h>\n#include \"plant.h\"\nint main(void) { unsigned s[2] = {plant_encode_0(21.0), plant_encode_1(21.0)};\n\
         printf(\"%.3f\", plant_decode(s)); return 0; }\n",
    )
    .unwrap();
    // A machine without a compiler skips the rest.
    let Ok(built) = Command::new("cc")
        .args(["-std=c99", "-o", "a.out", "main.c"])
        .current_dir(here)
        .output()
    else {
        return;
    };
    assert!(built.status.success(), "{}", text(&built.stderr));
    let estimate: f64 = text(&Command::new(here.join("a.out")).output().unwrap().stdout)
        .parse()
        .unwrap();
    assert!((estimate - 21.0).abs() < 3.0 * value.sqrt(), "{estimate}");
}

#[test]
fn sample_of_a_column_is_a_prior() {
    let folder = tempfile::tempdir().unwrap();
    let table: String = (0..400)
        .map(|i| format!("{},{}\n", i, 12.0 + 3.0 * (f64::from(i) * 0.37).sin()))
        .collect();
    let table = format!("n,flow\n{table}");
    let words = [
        "design", "-", "--column", "flow", "--noise", "0.5", "--bits", "2", "--json",
    ];
    let json: serde_json::Value = serde_json::from_slice(&good(folder.path(), &words, table.as_bytes())).unwrap();
    let breakpoints = json["sensors"][0]["breakpoints"].as_array().unwrap();
    assert!(breakpoints.len() == 3 && (breakpoints[1].as_f64().unwrap() - 12.0).abs() < 0.3, "{json}");
    let message = refused(folder.path(), &["design", "-", "--noise", "0.5"], table.as_bytes());
    assert!(message.contains("columns n, flow: name the one of the sample with --column"), "{message}");
}

#[test]
fn refusals_of_design() {
    let folder = tempfile::tempdir().unwrap();
    for (words, part) in [
        (vec!["design", "--noise", "1"], "--prior"),
        (vec!["design", "--prior", "20±4"], "--noise"),
        (vec!["design", "--prior", "twenty", "--noise", "1"], "--prior: `twenty` is not understood"),
        (vec!["design", "--prior", "uniform:4..1", "--noise", "1"], "above low = 4"),
        (vec!["design", "--prior", "20±4", "--noise", "-1"], "noise"),
        (vec!["design", "--prior", "20±4", "--noise", "1", "--bits", "9"], "at most 6 bits"),
        (vec!["design", "--prior", "20±4", "--noise", "1,1", "--flips", "0.1,0.1,0.1"], "one per sensor"),
        (vec!["design", "--prior", "20±4", "--noise", "1", "--flips", "2"], "crossover"),
        (vec!["design", "--prior", "20±4", "--noise", "1", "--adc", "12"], "--adc: `12` is not understood"),
        (vec!["design", "--prior", "20±4", "--noise", "1", "--criterion", "decision"], "discrete"),
        (
            vec![
                "design", "--prior", "20±4", "--noise", "1", "--bits", "1", "--form", "c", "--name", "a b",
            ],
            "name",
        ),
        (vec!["design", "none.csv", "--noise", "1"], "none.csv: cannot open"),
    ] {
        let message = refused(folder.path(), &words, b"");
        assert!(message.contains(part), "{words:?}: {message}");
    }
    let message = refused(folder.path(), &["design", "-", "--noise", "1"], b"a\nx\n");
    assert!(message.contains("column `a` holds words"), "{message}");
    let message = refused(folder.path(), &["design", "-", "--noise", "1"], b"a\n");
    assert!(message.contains("no numbers in the column"), "{message}");
}

/// Noise 0 was refused. The thresholds of a normal unknown without noise are those of Max (1960); points of mass are parted in the middle.
#[test]
fn a_sensor_without_noise_is_designed() {
    let folder = tempfile::tempdir().unwrap();
    let json = |words: &[&str], input: &str| -> serde_json::Value {
        serde_json::from_str(&text(&good(folder.path(), words, input.as_bytes()))).unwrap()
    };
    let design = json(&["design", "--prior", "3±2", "--noise", "0", "--bits", "2", "--json"], "");
    let edges = design["sensors"][0]["breakpoints"].as_array().unwrap();
    for (edge, expected) in edges.iter().zip([3.0 - 2.0 * 0.9816, 3.0, 3.0 + 2.0 * 0.9816]) {
        assert!((edge.as_f64().unwrap() - expected).abs() < 2e-3, "{design}");
    }
    let small = ["design", "--prior", "3±2", "--noise", "1e-7", "--bits", "2"];
    assert!(refused(folder.path(), &small, b"").contains("0 stands for none"));
    let sample = "y\n".to_owned() + &"0\n0.3\n0.6\n1\n".repeat(50);
    let design = json(&["design", "-", "--noise", "0", "--bits", "2", "--json"], &sample);
    let edges = design["sensors"][0]["breakpoints"].as_array().unwrap();
    for (edge, expected) in edges.iter().zip([0.15, 0.45, 0.8]) {
        assert!((edge.as_f64().unwrap() - expected).abs() < 0.01, "{design}");
    }
}

/// Defect: encoders were numbered by place, so that the one of sensor 1, if sensor 0 sends nothing, had the name of sensor 0's.
#[test]
fn encoders_have_the_numbers_of_their_sensors() {
    let folder = tempfile::tempdir().unwrap();
    let job = |form: &str| {
        let words = format!("design --prior 20±4 --noise 1,2,1 --bits 0,2,1 --form {form}");
        text(&good(folder.path(), &words.split(' ').collect::<Vec<_>>(), b""))
    };
    let (c, rust) = (job("c"), job("rust"));
    assert!(
        c.contains("fewbits_encode_1(") && c.contains("fewbits_encode_2(") && !c.contains("fewbits_encode_0"),
        "{c}"
    );
    assert!(c.contains("received from sensors 1, 2, in this order") && c.contains("fewbits_words_2["), "{c}");
    assert!(rust.contains("WORDS_2") && !rust.contains("WORDS_0"), "{rust}");
}
