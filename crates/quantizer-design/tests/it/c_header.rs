//! The C header and the Rust constants, compiled and run.

use fewbits_core::Link;
use fewbits_monte_carlo::Stream;
use fewbits_quantizer_design::solve::{Adc, BitBudget, Export, Request};
use fewbits_quantizer_design::{Noise, ObservationModel, Prior};
use rand::RngExt;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

const WORDS: usize = 100_000;

const PROGRAM: &str = r#"
#include <stdio.h>
#include "plant.h"
int main(void)
{
    unsigned w[PLANT_SENSORS];
    double y;
    unsigned long code;
    while (scanf("%u %u %lf %lu", &w[0], &w[1], &y, &code) == 4)
        printf("%.17g %u %u %u\n", plant_decode(w), plant_encode_0(y), plant_encode_1(y), plant_encode_code_1(code));
    return 0;
}
"#;

/// A directory of this test, removed when dropped.
struct Directory(PathBuf);

impl Drop for Directory {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// What the compiled header answers to lines of two symbols, a sample and a code; `None` without a compiler.
fn answers(export: &Export, name: &str, input: String) -> Option<String> {
    if Command::new("cc").arg("--version").output().is_err() {
        eprintln!("no `cc` here: the C header is not compiled");
        return None;
    }
    let directory = Directory(std::env::temp_dir().join(format!("fewbits-{name}-{}", std::process::id())));
    let path = |file: &str| directory.0.join(file);
    std::fs::create_dir_all(&directory.0).unwrap();
    std::fs::write(path("plant.h"), export.to_c_header()).unwrap();
    std::fs::write(path("main.c"), PROGRAM).unwrap();
    let flags = [
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wno-unused-function",
        "-Wno-unused-const-variable",
        "-Werror",
        "-O1",
    ];
    let built = Command::new("cc")
        .args(flags)
        .arg("-o")
        .arg(path("main"))
        .arg(path("main.c"))
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let mut child = Command::new(path("main"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Sensor 0 sends one word only: nothing gets through.
fn useless_link() -> Export {
    let noise = Noise::independent_with_deviations(&[1.0, 1.0]).unwrap();
    let model = ObservationModel::new(Prior::normal(20.0, 4.0).unwrap(), noise).unwrap();
    let links = vec![Link::flipping(0.5).unwrap(), Link::PERFECT];
    let request = Request {
        links,
        starts: 2,
        ..Request::estimation(model, BitBudget::Each(1), Link::PERFECT)
    };
    let adc = Adc::new(12, 0.0..=40.0).unwrap();
    let rounded = request.run().unwrap().best().rounded(&[adc, adc]);
    rounded.unwrap().export("plant", 4096).unwrap()
}

#[test]
fn a_sensor_with_one_word_makes_a_valid_header() {
    let export = useless_link();
    let Some(output) = answers(&export, "useless", "0 1 25.0 4000\n1 0 15.0 10\n".to_owned()) else {
        return;
    };
    let first = |symbols: &[usize]| export.decode(symbols).unwrap();
    for (line, (symbols, mean)) in output.lines().zip([([0, 1], first(&[0, 1])), ([1, 0], first(&[1, 0]))]) {
        assert_eq!(line.split(' ').next().unwrap().parse::<f64>().unwrap(), mean, "{symbols:?}");
    }
}

/// A program that has the constants as a module prints them, real numbers as their bits.
#[test]
fn the_rust_constants_are_the_design() {
    let noise = Noise::equicorrelated_with_deviations(&[1.0, 1.0], 0.5).unwrap();
    let model = ObservationModel::new(Prior::normal(20.0, 4.0).unwrap(), noise).unwrap();
    let request = Request {
        starts: 2,
        ..Request::estimation(model, BitBudget::PerSensor(vec![2, 1]), Link::new(0.05, 0.02).unwrap())
    };
    let adc = Adc::new(12, 0.0..=40.0).unwrap();
    let rounded = request.run().unwrap().best().rounded(&[adc, adc]).unwrap();
    let numbers = |values: &[f64]| values.iter().map(|v| v.to_bits().to_string()).collect::<Vec<_>>();
    let mut expected: Vec<Vec<String>> = Vec::new();
    for (sensor, thresholds) in rounded.solution.sensors().iter().zip(&rounded.thresholds) {
        expected.push(numbers(&sensor.breakpoints));
        expected.push(sensor.words.iter().map(ToString::to_string).collect());
        expected.push(thresholds.iter().map(ToString::to_string).collect());
    }
    let joint = rounded.export("plant", 4096).unwrap();
    let pairs = (0..5).flat_map(|a| (0..3).map(move |b| [a, b]));
    let means: Vec<f64> = pairs.map(|symbols| joint.decode(&symbols).unwrap()).collect();
    let additive = rounded.export("plant", 64).unwrap();
    let stored: serde_json::Value = serde_json::from_str(&additive.to_json().unwrap()).unwrap();
    let of = |part: &str| stored["decoder"][part].clone();
    let weights: Vec<Vec<f64>> = serde_json::from_value(of("weights")).unwrap();
    let mut linear = vec![numbers(&[of("offset").as_f64().unwrap()])];
    linear.extend(weights.iter().map(|w| numbers(w)));
    let sensors: String = (0..2)
        .map(|n| format!("bits(&plant::BREAKPOINTS_{n}); all(&plant::WORDS_{n}); all(&plant::THRESHOLDS_{n});"))
        .collect();
    let cases = [
        (joint, "bits(&plant::MEANS);", vec![numbers(&means)]),
        (additive, "bits(&plant::OFFSET); bits(&plant::WEIGHTS_0); bits(&plant::WEIGHTS_1);", linear),
    ];
    for (i, (export, decoder, tail)) in cases.into_iter().enumerate() {
        let directory = Directory(std::env::temp_dir().join(format!("fewbits-rust-{i}-{}", std::process::id())));
        let path = |file: &str| directory.0.join(file);
        std::fs::create_dir_all(&directory.0).unwrap();
        std::fs::write(path("plant.rs"), export.to_rust()).unwrap();
        let main = format!(
            "mod plant;\nfn all<T: ToString>(v: &[T]) {{ println!(\"{{}}\", v.iter().map(|v| v.to_string()).collect::<Vec<_>>().join(\" \")) }}\n\
             fn bits(v: &[f64]) {{ all(&v.iter().map(|v| v.to_bits()).collect::<Vec<_>>()) }}\n\
             fn main() {{ {sensors} {decoder} }}\n"
        );
        std::fs::write(path("main.rs"), main).unwrap();
        let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let built = Command::new(compiler)
            .args(["--edition=2024", "-D", "warnings", "-o"])
            .arg(path("main"))
            .arg(path("main.rs"))
            .output()
            .unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        let output = Command::new(path("main")).output().unwrap();
        let found: Vec<Vec<String>> = String::from_utf8(output.stdout)
            .unwrap()
            .lines()
            .map(|line| line.split(' ').map(str::to_owned).collect())
            .collect();
        assert_eq!(found, [expected.clone(), tail].concat());
    }
}

#[test]
fn the_c_header_decodes_as_the_library() {
    let noise = Noise::equicorrelated_with_deviations(&[1.0, 1.0], 0.5).unwrap();
    let model = ObservationModel::new(Prior::normal(20.0, 4.0).unwrap(), noise).unwrap();
    let link = Link::new(0.05, 0.02).unwrap();
    let request = Request {
        starts: 3,
        ..Request::estimation(model, BitBudget::PerSensor(vec![3, 2]), link)
    };
    let adc = Adc::new(12, 0.0..=40.0).unwrap();
    let rounded = request.run().unwrap().best().rounded(&[adc, adc]).unwrap();
    let mut rng = Stream::new(9).named("words").rng();
    let lines: Vec<([usize; 2], f64, u32)> = (0..WORDS)
        .map(|_| {
            (
                [rng.random_range(0..=8), rng.random_range(0..=4)],
                rng.random_range(0.0..40.0),
                rng.random_range(0..4096),
            )
        })
        .collect();
    let input: String = lines
        .iter()
        .map(|([a, b], y, code)| format!("{a} {b} {y:?} {code}\n"))
        .collect();
    // The table, and the additive decoder that a smaller memory asks for.
    for (name, bytes) in [("joint", 4096), ("additive", 200)] {
        let export = rounded.export("plant", bytes).unwrap();
        let Some(output) = answers(&export, name, input.clone()) else {
            return;
        };
        assert_eq!(output.lines().count(), WORDS);
        for (line, (symbols, y, code)) in output.lines().zip(&lines) {
            let numbers: Vec<f64> = line.split(' ').map(|s| s.parse().unwrap()).collect();
            let words = rounded.solution.encode(&[*y, *y]).unwrap();
            let expected = [words[0], words[1], rounded.encode(1, *code).unwrap()].map(|w| w as f64);
            assert_eq!(numbers[0].to_bits(), export.decode(symbols).unwrap().to_bits(), "{line}");
            assert_eq!(numbers[1..], expected, "{line}");
        }
    }
}
