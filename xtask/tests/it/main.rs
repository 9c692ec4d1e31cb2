//! `cargo xtask figures` as a user meets it: files, options, refusals, determinism.

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

mod draw;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};

fn figures(out: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_xtask"))
        .arg("figures")
        .args(arguments)
        .args(["--out".as_ref(), out.as_os_str()])
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Name and content of every file, hidden ones included.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return BTreeMap::new();
    };
    entries
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(path).unwrap()))
        .collect()
}

#[test]
fn a_figure_leaves_csv_json_svg_and_a_gallery() {
    let out = tempfile::tempdir().unwrap();
    let run = figures(out.path(), &["dymbo-prop2", "--quick"]);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let files = files(out.path());
    assert_eq!(
        files.keys().collect::<Vec<_>>(),
        [
            "dymbo-prop2-starts.csv",
            "dymbo-prop2.csv",
            "dymbo-prop2.json",
            "dymbo-prop2.svg",
            "index.html"
        ]
    );
    let document: serde_json::Value = serde_json::from_slice(&files["dymbo-prop2.json"]).unwrap();
    for key in ["parameters", "seed", "trials", "version", "wall_time_s", "claims"] {
        assert!(document.get(key).is_some(), "no {key}");
    }
    for claim in document["claims"].as_array().unwrap() {
        for key in ["id", "statement", "verdict", "value", "expected", "tolerance"] {
            assert!(claim.get(key).is_some(), "no {key} in {claim}");
        }
        assert!(["pass", "fail", "skipped"].contains(&claim["verdict"].as_str().unwrap()));
    }
    assert!(text(&files["dymbo-prop2.svg"]).starts_with("<svg"));
    assert!(text(&files["index.html"]).contains("dymbo-prop2.svg"));
    let summary = text(&run.stdout);
    assert!(summary.contains("dymbo-prop2") && summary.contains("index.html"), "{summary}");
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let run = |threads: &str| {
        let out = tempfile::tempdir().unwrap();
        let arguments = [
            "dymbo-fig5",
            "dymbo-erasure",
            "cfwmd-fig1",
            "--quick",
            "--trials",
            "300",
            "--threads",
            threads,
        ];
        // Claims may fail at so few trials; the files are what matters here.
        figures(out.path(), &arguments);
        let mut files = files(out.path());
        files.retain(|name, _| name.ends_with(".csv") || name.ends_with(".svg"));
        files
    };
    let one = run("1");
    assert!(one.len() >= 6, "{:?}", one.keys());
    for threads in ["2", "7"] {
        assert!(one == run(threads), "other bytes on {threads} threads");
    }
}

#[test]
fn settings_reach_the_figure_and_its_default_claims_step_back() {
    let out = tempfile::tempdir().unwrap();
    let run = figures(
        out.path(),
        &[
            "dymbo-fig5",
            "--set",
            "a=0.8",
            "--set",
            "gamma=0.3",
            "--quick",
            "--seed",
            "5",
        ],
    );
    assert!(run.status.success(), "{}{}", text(&run.stdout), text(&run.stderr));
    let document: serde_json::Value = serde_json::from_slice(&files(out.path())["dymbo-fig5.json"]).unwrap();
    assert_eq!(document["parameters"]["a"], 0.8);
    assert_eq!(document["parameters"]["gamma"], serde_json::json!([0.3]));
    assert_eq!(document["seed"], 5);
    assert!(
        document["claims"]
            .as_array()
            .unwrap()
            .iter()
            .any(|claim| claim["verdict"] == "skipped")
    );
}

#[test]
fn without_plots_there_is_no_svg() {
    let out = tempfile::tempdir().unwrap();
    assert!(figures(out.path(), &["dymbo-prop2", "--no-plots"]).status.success());
    assert!(!files(out.path()).keys().any(|name| name.ends_with(".svg")));
}

#[test]
fn the_list_names_figures_with_their_parameters() {
    let out = tempfile::tempdir().unwrap();
    let run = figures(out.path(), &["dymbo-fig*", "--list"]);
    let listed = text(&run.stdout);
    assert!(run.status.success() && listed.contains("dymbo-fig5") && listed.contains("trials="), "{listed}");
    assert!(!listed.contains("cfwmd"));
    assert!(files(out.path()).is_empty());
}

#[test]
fn what_is_refused_is_named_and_nothing_is_written() {
    let cases: [(&[&str], &[&str]); 10] = [
        (&["dymbo-fig99"], &["dymbo-fig99", "dymbo-fig5"]),
        (&["nothing-*"], &["nothing-*", "dymbo-fig5"]),
        (&["dymbo-[fig"], &["dymbo-[fig", "pattern"]),
        (&["dymbo-fig5", "--set", "alpha=1"], &["alpha", "gamma"]),
        (&["dymbo-fig5", "--set", "a=fast"], &["`a`", "fast", "number"]),
        (&["dymbo-fig5", "--set", "a=NaN"], &["`a`", "NaN", "finite"]),
        (&["dymbo-fig5", "--set", "a=1.2"], &["a", "1.2"]),
        (&["dymbo-fig5", "--set", "gamma=-0.5"], &["-0.5"]),
        (&["dymbo-fig5", "--set", "a"], &["NAME=VALUE"]),
        (&["dymbo-fig5", "--trials", "0"], &["trials", "0"]),
    ];
    for (arguments, words) in cases {
        let out = tempfile::tempdir().unwrap();
        let run = figures(&out.path().join("made"), arguments);
        let message = text(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{arguments:?}: {message}");
        assert!(files(out.path()).is_empty(), "{arguments:?}");
    }
}

#[test]
fn an_unwritable_directory_is_refused_before_any_work() {
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let run = figures(&file.join("below"), &["dymbo-fig5"]);
    let message = text(&run.stderr);
    assert_eq!(run.status.code(), Some(2));
    assert!(message.contains("cannot write") && message.contains("below"), "{message}");
    assert_eq!(files(out.path()).len(), 1);
}
