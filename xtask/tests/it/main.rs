//! `cargo xtask figures` as a user meets it: files, options, refusals, determinism.

#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

mod draw;
mod kept;
#[cfg(feature = "mpi")]
mod ranks;

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
            "index.html",
            "summary.txt"
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
fn each_finished_figure_is_a_line_off_a_terminal() {
    let out = tempfile::tempdir().unwrap();
    let run = figures(out.path(), &["mi-table4-[25]", "--quick"]);
    let lines = text(&run.stderr);
    assert!(lines.contains("2 figures to make"), "{lines}");
    assert!(lines.contains("[1/2] ") && lines.contains("[2/2] ") && lines.contains("claims hold"), "{lines}");
    let summary = text(&files(out.path())["summary.txt"]);
    assert!(text(&run.stdout).contains("2 figures in") && summary.contains("2 figures in"), "{summary}");
}

#[test]
fn unchanged_figures_are_kept_until_forced() {
    let out = tempfile::tempdir().unwrap();
    let stamp = || {
        std::fs::metadata(out.path().join("mi-table4-2.csv"))
            .unwrap()
            .modified()
            .unwrap()
    };
    assert!(figures(out.path(), &["mi-table4-2", "--quick"]).status.success());
    let made = stamp();
    let again = figures(out.path(), &["mi-table4-2", "--quick"]);
    assert!(text(&again.stderr).contains("1 unchanged figures are kept"), "{}", text(&again.stderr));
    assert!(text(&again.stdout).contains("mi-table4-2"));
    assert_eq!(stamp(), made);
    // Another seed, and the same again by force.
    for arguments in [["--seed", "2"], ["--seed", "2"]] {
        let before = stamp();
        let force = ["mi-table4-2", "--quick", "--force"];
        assert!(
            figures(out.path(), &[&force[..], &arguments[..]].concat())
                .status
                .success()
        );
        assert_ne!(stamp(), before);
    }
}

#[test]
fn a_near_miss_of_an_id_is_mended() {
    let out = tempfile::tempdir().unwrap();
    let message = text(&figures(out.path(), &["dymbo-fgi5"]).stderr);
    assert!(message.contains("did you mean dymbo-fig5"), "{message}");
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let run = |threads: &str| {
        let out = tempfile::tempdir().unwrap();
        let arguments = [
            "dymbo-fig5",
            "dymbo-threshold",
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
fn the_list_is_a_line_a_figure_and_describe_has_the_rest() {
    let out = tempfile::tempdir().unwrap();
    let listed = text(&figures(out.path(), &["mi-table4-*", "--list"]).stdout);
    assert!(
        listed.contains("mi-table4-1") && listed.lines().all(|line| line.starts_with("mi-table")),
        "{listed}"
    );
    assert!(files(out.path()).is_empty());
    let run = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["figures", "describe", "mi-table4-3"])
        .output()
        .unwrap();
    let page = text(&run.stdout);
    for words in [
        "sensors = 9",
        "from 2 to 10",
        "mi_nats [nat]: Mutual information",
        "mi-table4-3-chain.csv",
    ] {
        assert!(page.contains(words), "{page}");
    }
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let mut run = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["figures", "--list"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(run.stdout.take());
    assert!(run.wait().unwrap().success());
}

#[test]
fn shards_merge_into_the_whole() {
    let out = tempfile::tempdir().unwrap();
    let shards: Vec<_> = ["1/2", "2/2"]
        .map(|shard| (shard, out.path().join(shard.replace('/', "-"))))
        .to_vec();
    for (shard, folder) in &shards {
        let run = figures(folder, &["mi-table4-[25]*", "--quick", "--shard", shard]);
        assert!(run.status.success(), "{}", text(&run.stdout));
    }
    assert_ne!(files(&shards[0].1).keys().collect::<Vec<_>>(), files(&shards[1].1).keys().collect::<Vec<_>>());
    let whole = out.path().join("whole");
    let run = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["figures", "merge", "--json", "--out"])
        .args([&whole, &shards[0].1, &shards[1].1])
        .output()
        .unwrap();
    let summary: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(summary["good"], true);
    assert_eq!(summary["figures"].as_array().unwrap().len(), 3);
    let files = files(&whole);
    for id in ["mi-table4-2", "mi-table4-5", "mi-table4-5-mismatch"] {
        assert!(files.contains_key(&format!("{id}.csv")) && files.contains_key(&format!("{id}.json")), "{id}");
    }
}

#[test]
fn what_failed_can_be_run_again_and_stands_first() {
    let out = tempfile::tempdir().unwrap();
    assert!(figures(out.path(), &["mi-table4-[25]", "--quick"]).status.success());
    let path = out.path().join("mi-table4-5.json");
    let bad = std::fs::read_to_string(&path)
        .unwrap()
        .replacen("\"pass\"", "\"fail\"", 1);
    std::fs::write(&path, bad).unwrap();
    let run = figures(out.path(), &["--failed", "--quick", "--seed", "2", "--json"]);
    let summary: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(summary["figures"][0]["id"], "mi-table4-5");
    assert_eq!(summary["figures"].as_array().unwrap().len(), 1);
    // The other one was not run this time, and has another seed.
    let page = text(&files(out.path())["index.html"]);
    assert!(page.find("id=\"mi-table4-5\"") < page.find("id=\"mi-table4-2\""));
    assert!(page.contains("different seeds: 1, 2") && page.contains("not run this time"));
    assert!(page.contains("quick ones"));
}

#[test]
#[cfg(unix)]
fn an_interrupted_run_leaves_what_is_complete() {
    let out = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["figures", "mi-table4-2", "cfwmd-fig5", "--threads", "2", "--out"])
        .arg(out.path())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let made = out.path().join("mi-table4-2.json");
    for _ in 0..600 {
        if made.exists() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    Command::new("kill")
        .args(["-INT", &run.id().to_string()])
        .status()
        .unwrap();
    assert_eq!(run.wait().unwrap().code(), Some(130));
    let files = files(out.path());
    assert!(files.contains_key("mi-table4-2.csv") && !files.keys().any(|name| name.starts_with("cfwmd-fig5")));
    assert!(text(&files["index.html"]).contains("Stopped by the user: 1 of 2"));
}

/// What a browser makes of the gallery, after its script has run.
#[test]
fn the_gallery_opens_in_a_browser() {
    let Some(browser) = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| {
            Command::new(name)
                .arg("--version")
                .output()
                .is_ok_and(|run| run.status.success())
        })
    else {
        eprintln!("SKIPPED: no Chromium is installed, so the gallery was not opened");
        return;
    };
    let out = tempfile::tempdir().unwrap();
    assert!(figures(out.path(), &["mi-table4-[25]", "--quick"]).status.success());
    let page = format!("file://{}/index.html", out.path().display());
    let run = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--window-size=400,800",
            "--dump-dom",
            &page,
        ])
        .output()
        .unwrap();
    let dom = text(&run.stdout);
    assert!(dom.contains("2 figures shown"), "{}", text(&run.stderr));
}

#[test]
fn what_is_refused_is_named_and_nothing_is_written() {
    let cases: [(&[&str], &[&str]); 13] = [
        (&["dymbo-fig99"], &["dymbo-fig99", "dymbo-fig5"]),
        (&["nothing-*"], &["nothing-*", "dymbo-fig5"]),
        (&["dymbo-[fig"], &["dymbo-[fig", "pattern"]),
        (&["dymbo-fig5", "--set", "alpha=1"], &["alpha", "gamma"]),
        (&["dymbo-fig5", "--set", "a=fast"], &["`a`", "fast", "number"]),
        (&["dymbo-fig5", "--set", "a=NaN"], &["`a`", "NaN", "number"]),
        (&["dymbo-fig5", "--set", "a=1.2"], &["a", "1.2"]),
        (&["dymbo-fig5", "--set", "gamma=-0.5"], &["-0.5"]),
        (&["dymbo-fig5", "--set", "a"], &["NAME=VALUE"]),
        (&["dymbo-fig5", "--trials", "0"], &["trials", "0"]),
        (&["mi-table4-3", "--set", "sensors=99"], &["`sensors`", "99", "greater than 10"]),
        (&["mi-table4-4", "--set", "signals=2,NaN"], &["`signals[1]`", "NaN", "expected a number"]),
        (&["mi-table4-4", "--shard", "3/2"], &["3/2", "I/N"]),
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
