//! The listings of the documentation: every `$ fewbits ...` of a `console` block is run, and must print what stands below it.
//! A line `...` stands for any lines.

use crate::{fewbits, folder, good, text};
use std::path::Path;

/// Commands and what they print.
fn listings(page: &str) -> Vec<(Vec<String>, Vec<String>)> {
    let mut found: Vec<(Vec<String>, Vec<String>)> = Vec::new();
    let mut is_console = false;
    for line in page.lines() {
        if let Some(kind) = line.strip_prefix("```") {
            is_console = kind == "console";
        } else if is_console {
            match line.strip_prefix("$ ") {
                Some(command) => {
                    let words = command
                        .split_whitespace()
                        .map(|word| word.trim_matches('\'').to_owned());
                    found.push((words.collect(), Vec::new()));
                }
                None => found.last_mut().unwrap().1.push(line.trim_end().to_owned()),
            }
        }
    }
    found
}

/// Whether lines are as expected, where `...` is any number of them.
fn agrees(expected: &[String], lines: &[&str]) -> bool {
    match expected.split_first() {
        None => lines.is_empty(),
        Some((first, rest)) if first == "..." => (0..=lines.len()).any(|skipped| agrees(rest, &lines[skipped..])),
        Some((first, rest)) => lines
            .split_first()
            .is_some_and(|(line, others)| line.trim_end() == first && agrees(rest, others)),
    }
}

#[test]
fn listings_print_what_the_pages_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (page, least) in [
        ("track.md", 2),
        ("ranges.md", 1),
        ("fit.md", 2),
        ("leak.md", 1),
        ("quantizers.md", 1),
        ("record.md", 3),
    ] {
        let folder = tempfile::tempdir().unwrap();
        for file in std::fs::read_dir(root.join("tests/fixtures")).unwrap() {
            let path = file.unwrap().path();
            std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
        }
        let all = listings(&std::fs::read_to_string(root.join("../../docs").join(page)).unwrap());
        assert!(all.len() >= least, "{page}: {} listings", all.len());
        for (words, expected) in all {
            assert_eq!(words[0], "fewbits", "{page}");
            let words: Vec<&str> = words[1..].iter().map(String::as_str).collect();
            let output = fewbits(folder.path(), &words, b"");
            let printed = text(&output.stdout) + &text(&output.stderr);
            let lines: Vec<&str> = printed.lines().collect();
            assert!(agrees(&expected, &lines), "{page}: {words:?} printed\n{printed}");
        }
    }
}

#[test]
fn completions_and_manual_are_generated() {
    let (_kept, folder) = folder();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(text(&good(&folder, &["generate", shell], b"")).contains("rows-per-block"));
    }
    assert!(text(&good(&folder, &["generate", "man"], b"")).starts_with(".ie"));
    good(&folder, &["generate", "man", "--folder", "man"], b"");
    for page in [
        "fewbits.1",
        "fewbits-track.1",
        "fewbits-ranges.1",
        "fewbits-fit.1",
        "fewbits-leak.1",
        "fewbits-design.1",
        "fewbits-pack.1",
    ] {
        assert!(folder.join("man").join(page).is_file(), "{page}");
    }
}
