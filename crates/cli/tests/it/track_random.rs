//! `fewbits track` on random tables, against the filter that is told everything: 2 to 10 sensors of unequal noise, offsets, spikes, gaps, sensors
//! that die and return.

use crate::numbers::Numbers;
use crate::{fewbits, text};

const ROWS: usize = 400;

struct Table {
    text: String,
    truth: Vec<f64>,
    /// Estimates of the filter that knows change, noises, offsets and spikes.
    told: Vec<f64>,
    has_offsets: bool,
    /// The median of the offsets, which no table tells.
    common: f64,
}

fn between(numbers: &mut Numbers, low: f64, high: f64) -> f64 {
    low + (high - low) * numbers.uniform()
}

struct Member {
    noise: f64,
    offset: f64,
    /// Rows in which it is silent.
    silent: std::ops::Range<usize>,
}

fn table(seed: u64) -> Table {
    let numbers = &mut Numbers(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) + 1);
    let sensors = between(numbers, 2.0, 11.0) as usize;
    let change = 10.0_f64.powf(between(numbers, -2.0, 0.0));
    let has_offsets = numbers.uniform() < 0.5;
    let gaps = [0.0, 0.05, 0.2][between(numbers, 0.0, 3.0) as usize];
    let spikes = [0.0, 0.002, 0.01][between(numbers, 0.0, 3.0) as usize];
    let mut members = Vec::new();
    for sensor in 0..sensors {
        let noise = change * 10.0_f64.powf(between(numbers, -0.3, 1.2));
        let is_off = has_offsets && numbers.uniform() < 0.4;
        let offset = if is_off { 2.0 * noise * numbers.normal() } else { 0.0 };
        let begin = between(numbers, 100.0, 350.0) as usize;
        let lasts = if numbers.uniform() < 0.5 {
            ROWS
        } else {
            between(numbers, 20.0, 150.0) as usize
        };
        let is_silent = sensor > 0 && numbers.uniform() < 0.2;
        let silent = if is_silent { begin..begin + lasts } else { 0..0 };
        members.push(Member { noise, offset, silent });
    }
    let mut level = between(numbers, -50.0, 50.0);
    let names: Vec<String> = (0..sensors).map(|sensor| format!("s{sensor}")).collect();
    let (mut text, mut truth, mut told) = (names.join(",") + "\n", Vec::new(), Vec::new());
    let (mut mean, mut variance) = (0.0, 1e12);
    for row in 0..ROWS {
        level += change * numbers.normal();
        truth.push(level);
        variance += change * change;
        let mut line = Vec::new();
        for member in &members {
            let mut value = level + member.offset + member.noise * numbers.normal();
            let is_spike = numbers.uniform() < spikes;
            let size = between(numbers, 20.0, 200.0) * if numbers.uniform() < 0.5 { -1.0 } else { 1.0 };
            if is_spike {
                value += member.noise * size;
            }
            if numbers.uniform() < gaps || member.silent.contains(&row) {
                line.push(String::new());
                continue;
            }
            line.push(format!("{value:.6}"));
            if !is_spike {
                let gain = variance / (variance + member.noise * member.noise);
                mean += gain * (value - member.offset - mean);
                variance *= 1.0 - gain;
            }
        }
        text += &(line.join(",") + "\n");
        told.push(mean);
    }
    let mut offsets: Vec<f64> = members.iter().map(|member| member.offset).collect();
    offsets.sort_by(f64::total_cmp);
    let common = 0.5 * (offsets[(sensors - 1) / 2] + offsets[sensors / 2]);
    Table {
        text,
        truth,
        told,
        has_offsets,
        common,
    }
}

/// Ratio of the errors to those of the filter that is told everything (geometric mean), share of the truth in the bands, exclusions.
fn measure(tables: u64) -> (f64, f64, usize) {
    let (mut logs, mut held, mut rows, mut excluded, mut over) = (0.0, 0, 0, 0, 0);
    for seed in 0..tables {
        let table = table(seed);
        let folder = tempfile::tempdir().unwrap();
        let mut words = vec!["track", "-", "--json"];
        if table.has_offsets {
            words.extend(["--align", "200"]);
        }
        let output = fewbits(folder.path(), &words, table.text.as_bytes());
        let (mut own, mut told) = (0.0, 0.0);
        for ((line, truth), known) in text(&output.stdout).lines().zip(&table.truth).zip(&table.told) {
            let row: serde_json::Value = serde_json::from_str(line).unwrap();
            let of = |name: &str| row[name].as_f64().unwrap() - table.common;
            own += (of("level") - truth).powi(2);
            told += (known - truth).powi(2);
            held += usize::from((of("level_low")..=of("level_high")).contains(truth));
            rows += 1;
            excluded += row["events"].as_str().unwrap().matches("excluded").count();
        }
        assert!(told > 0.0, "{seed}: {}", text(&output.stderr));
        let ratio = (own / told).sqrt();
        logs += ratio.ln();
        over += u32::from(ratio > 1.1);
        if ratio > 1.5 {
            println!("table {seed}: {ratio:.2}, offsets: {}", table.has_offsets);
        }
    }
    let (ratio, share) = ((logs / tables as f64).exp(), held as f64 / f64::from(rows));
    println!(
        "{tables} tables: {ratio:.4} of the filter that is told everything, {over} above 1.1, held {share:.4}, {excluded} excluded"
    );
    (ratio, share, excluded)
}

#[test]
fn random_tables_are_estimated_nearly_as_well_as_by_who_knows() {
    let (ratio, share, excluded) = measure(16);
    assert!(ratio < 1.1 && share > 0.9 && excluded == 0, "{ratio} {share} {excluded}");
}

/// The measurement in full.
#[test]
#[ignore = "a minute"]
fn two_hundred_tables() {
    let (ratio, share, excluded) = measure(200);
    assert!(ratio <= 1.1 && (0.93..=0.97).contains(&share), "{ratio} {share}");
    // Sensors that are right, of which one in a million observations is excluded.
    assert!(excluded <= 4, "{excluded}");
}
