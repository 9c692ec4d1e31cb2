//! What earlier runs left: kept, made anew, refused.

use super::{figures, files, text};
use std::process::Command;

#[test]
fn a_figure_whose_files_were_emptied_is_made_anew() {
    let out = tempfile::tempdir().unwrap();
    let make = || assert!(figures(out.path(), &["mi-table4-2", "--quick"]).status.success());
    make();
    let whole = files(out.path());
    for name in ["mi-table4-2.csv", "mi-table4-2.svg"] {
        std::fs::write(out.path().join(name), "").unwrap();
        make();
        assert!(files(out.path())[name] == whole[name], "{name} stayed empty");
    }
}

#[test]
fn a_damaged_file_is_not_merged() {
    let out = tempfile::tempdir().unwrap();
    let shard = out.path().join("shard");
    assert!(figures(&shard, &["mi-table4-2", "--quick"]).status.success());
    std::fs::write(shard.join("mi-table4-2.csv"), "").unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(["figures", "merge", "--out"])
        .args([&out.path().join("whole"), &shard])
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(2));
    assert!(text(&run.stderr).contains("mi-table4-2.csv is not as it was written"), "{}", text(&run.stderr));
}

/// Records come from other machines: what they name may lie anywhere.
#[test]
fn a_forged_record_reaches_no_file_outside_the_directory() {
    let out = tempfile::tempdir().unwrap();
    let (shard, whole, outside) = (out.path().join("shard"), out.path().join("whole"), out.path().join("outside.csv"));
    assert!(figures(&shard, &["mi-table4-2", "--quick"]).status.success());
    let record = std::fs::read_to_string(shard.join("mi-table4-2.json")).unwrap();
    let forgeries = [
        ("mi-table4-2.json", record.replacen("\"mi-table4-2.csv\"", "\"../outside.csv\"", 1)),
        ("mi-table4-2.json", record.replacen("\"mi-table4-2.csv\"", "\"mi-table4-2/../../outside.csv\"", 1)),
        ("x.json", record.replacen("\"id\": \"mi-table4-2\"", "\"id\": \"../outside\"", 1)),
    ];
    for (name, forged) in forgeries {
        assert_ne!(forged, record);
        let _ = std::fs::remove_file(shard.join("mi-table4-2.json"));
        std::fs::write(shard.join(name), forged).unwrap();
        std::fs::write(&outside, "kept").unwrap();
        Command::new(env!("CARGO_BIN_EXE_xtask"))
            .args(["figures", "merge", "--out"])
            .args([&whole, &shard])
            .output()
            .unwrap();
        assert!(figures(&shard, &["mi-table4-2", "--quick"]).status.success());
        assert_eq!(std::fs::read_to_string(&outside).unwrap(), "kept");
        assert!(!out.path().join("outside.json").exists());
        assert!(
            !files(&whole)
                .keys()
                .any(|name| name.contains("outside") || name.ends_with(".csv"))
        );
        let _ = std::fs::remove_file(shard.join("x.json"));
    }
}
