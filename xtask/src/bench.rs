//! `cargo xtask bench`: the benchmarks, each as a multiple of a unit measured in the same run.
//!
//! A bare time says more about the machine than about the code. Every bench binary therefore measures a unit of its own,
//! a benchmark named `standard_normal` (one draw) or ending in `_unit`, and each median is printed as a multiple of the
//! unit's median.

use crate::{Error, files};
use clap::Args;
use std::path::Path;
use std::process::Command;

/// Options of `cargo xtask bench`.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Crates to measure, by folder name (`core`, `dymbo`, ...); all with benchmarks without any.
    pub crates: Vec<String>,
}

/// One measured line.
#[derive(Debug, Clone, PartialEq)]
struct Measured {
    name: String,
    median_ns: f64,
}

/// Runs the benchmarks and prints ratios; `Ok(false)` if a bench binary failed.
///
/// # Errors
/// If a crate is unknown or cargo cannot be run.
pub fn run(options: &Options) -> Result<bool, Error> {
    let known = crates_with_benches()?;
    Error::check_crates(&options.crates, &known.iter().map(String::as_str).collect::<Vec<_>>())?;
    let chosen = if options.crates.is_empty() {
        &known
    } else {
        &options.crates
    };
    let mut fine = true;
    for name in chosen {
        let output = Command::new(env!("CARGO"))
            .args(["bench", "-q", "-p", &format!("fewbits-{name}"), "--benches"])
            .output()
            .map_err(Error::cargo)?;
        if !output.status.success() {
            eprintln!("{}", String::from_utf8_lossy(&output.stderr));
            fine = false;
        }
        let groups = parse(&String::from_utf8_lossy(&output.stdout)).map_err(|line| {
            Error(format!("the benchmarks of crate `{name}` ran, but their table was not understood: {line}"))
        })?;
        for group in groups {
            print(name, &group);
        }
    }
    Ok(fine)
}

fn crates_with_benches() -> Result<Vec<String>, Error> {
    let crates = files::list(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../crates")))?;
    let with_benches = crates.iter().filter(|path| path.join("benches").is_dir());
    let names = with_benches.filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
    Ok(names.collect())
}

/// Splits the output of divan into bench binaries and reads name and median of each line; else the line that has none, or that
/// there is no table.
fn parse(output: &str) -> Result<Vec<Vec<Measured>>, String> {
    let mut groups: Vec<Vec<Measured>> = Vec::new();
    let mut path: Vec<String> = Vec::new();
    for line in output.lines() {
        if line.contains("fastest") && line.contains("median") {
            groups.push(Vec::new());
            path.clear();
            continue;
        }
        let tree: usize = line.chars().take_while(|c| "│├╰─ ".contains(*c)).count();
        let rest: String = line.chars().skip(tree).collect();
        let cells: Vec<&str> = rest.split('│').map(str::trim).collect();
        // The first cell holds the name, which may have blanks, and the fastest time.
        let words: Vec<&str> = cells[0].split_whitespace().collect();
        let timed = words.len() > 2 && nanoseconds(&words[words.len() - 2..].join(" ")).is_some();
        let name = words[..words.len() - if timed { 2 } else { 0 }].join(" ");
        if name.is_empty() {
            continue;
        }
        if !line.starts_with(['├', '╰', '│', ' ']) {
            continue;
        }
        let depth = (tree / 3).max(1);
        path.truncate(depth - 1);
        path.push(name);
        // Columns: name and fastest, slowest, median, mean, samples, iterations.
        let median = cells.get(2).and_then(|cell| nanoseconds(cell));
        match (median, groups.last_mut()) {
            (Some(median_ns), Some(group)) => group.push(Measured {
                name: path.join("/"),
                median_ns,
            }),
            (None, _) if !timed => {}
            _ => return Err(format!("no median under its heading in `{line}`")),
        }
    }
    match groups.iter().any(Vec::is_empty) || groups.is_empty() {
        true => Err("no rows of times".to_owned()),
        false => Ok(groups),
    }
}

fn nanoseconds(cell: &str) -> Option<f64> {
    let (number, unit) = cell.split_once(' ')?;
    let factor = match unit.trim() {
        "ps" => 1e-3,
        "ns" => 1.0,
        "µs" => 1e3,
        "ms" => 1e6,
        "s" => 1e9,
        _ => return None,
    };
    number.parse::<f64>().ok().map(|value| value * factor)
}

fn print(name: &str, group: &[Measured]) {
    let named = |suffix: &str| {
        group
            .iter()
            .find(|m| m.name.split('/').any(|part| part.ends_with(suffix)))
    };
    let unit = named("standard_normal").or_else(|| named("_unit"));
    for measured in group {
        match unit {
            Some(unit) => {
                let ratio = measured.median_ns / unit.median_ns;
                println!("{name:12} {:52} {ratio:>12.2} x {}", measured.name, unit.name);
            }
            None => println!("{name:12} {:52} {:>12.1} ns (no unit)", measured.name, measured.median_ns),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_read_from_the_table_of_divan() {
        let output = "\
Timer precision: 20 ns
filter             fastest       │ slowest       │ median        │ mean          │ samples │ iters
├─ standard_normal  4.5 ns        │ 9 ns          │ 5 ns          │ 5.1 ns        │ 100     │ 6400
╰─ step                           │               │               │               │         │
   ├─ (1.0, 2.5)    1 µs          │ 2 µs          │ 1.5 µs        │ 1.6 µs        │ 100     │ 100
   ╰─ 1000          1 ms          │ 2 ms          │ 1.25 ms       │ 1.6 ms        │ 100     │ 100
";
        let groups = parse(output).unwrap();
        let names: Vec<_> = groups[0].iter().map(|m| (m.name.as_str(), m.median_ns)).collect();
        assert_eq!(
            names,
            [
                ("standard_normal", 5.0),
                ("step/(1.0, 2.5)", 1500.0),
                ("step/1000", 1.25e6)
            ]
        );
    }

    #[test]
    fn another_table_is_refused() {
        for output in [
            "",
            "filter fastest │ median\n",
            "step 5 ns\n",
            "filter fastest │ slowest │ median\n├─ step 1 ns │ 2 ns │ 3 fortnights │ 4 ns │ 1 │ 1\n",
        ] {
            assert!(parse(output).is_err(), "{output}");
        }
    }
}
