//! The example's logic on a small recording made for it: `a = 0.95`, `sigma_u = 0.3`, `sigma = 0.5` around 21, 300 rows.

#[allow(dead_code)]
#[path = "../../examples/recording.rs"]
mod example;

use example::{analyse, few_bits, fit, full_precision, read_column, rms_difference};
use fewbits_dymbo::ScalarFilter;
use std::path::Path;

fn samples() -> Vec<f64> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recording.csv");
    read_column(&file, "temp_degc").unwrap()
}

#[test]
fn the_fit_finds_the_plant() {
    let samples = samples();
    assert_eq!(samples.len(), 300);
    let fit = fit(&samples).unwrap();
    // Three standard deviations of such estimates from 300 samples.
    assert!((fit.plant.coefficient() - 0.95).abs() < 0.08, "{}", fit.plant.coefficient());
    assert!((fit.plant.process_variance().sqrt() - 0.3).abs() < 0.12);
    assert!((fit.plant.measurement_variance().sqrt() - 0.5).abs() < 0.1);
    // No neighbour is likelier.
    let (a, gamma) = (fit.plant.coefficient(), fit.plant.noise_ratio());
    for (b, g) in [
        (a + 1e-3, gamma),
        (a - 1e-3, gamma),
        (a, gamma * 1.01),
        (a, gamma / 1.01),
    ] {
        let centred: Vec<f64> = samples.iter().map(|x| x - fit.mean).collect();
        assert!(example::profile(&centred, b, g).unwrap().0 < fit.log_likelihood);
    }
}

#[test]
fn every_bit_brings_the_estimate_closer() {
    let samples = samples();
    let report = analyse(&samples).unwrap();
    let deviations: Vec<f64> = report.rows.iter().map(|row| row.1).collect();
    assert!(deviations[0] > 1.5 * deviations[1] && deviations[1] > 1.5 * deviations[2], "{deviations:?}");
    // In the steady state the squared deviation is the loss in variance.
    let kalman = report.fit.plant.steady_state(1.0).unwrap().filtered_variance;
    for (bits, deviation, held_out, spent) in &report.rows {
        let filter = fewbits_dymbo::MultibitFilter::new(report.fit.plant, *bits).unwrap();
        let own = report
            .fit
            .plant
            .steady_state(filter.information())
            .unwrap()
            .filtered_variance;
        let ratio = deviation / (own - kalman).sqrt();
        assert!((0.7..1.4).contains(&ratio), "{bits} bits: {ratio}");
        assert_eq!(*spent, 16 + bits * 299);
        // Prediction of the unseen half: worse than with every sample in full, better than by the mean.
        let [kalman, last, mean] = report.reference_errors;
        assert!(kalman < *held_out && *held_out < mean && kalman < last, "{bits} bits: {held_out} {kalman}");
    }
    assert!(report.to_string().contains("bits spent"));
}

/// Regression: a clock column was fitted to the bound of gamma without a word.
#[test]
fn a_fit_on_a_bound_says_so() {
    let clock: Vec<f64> = (0..200).map(f64::from).collect();
    let report = analyse(&clock).unwrap();
    assert!(report.fit.on_bounds.iter().any(|bound| bound.contains("gamma")), "{report}");
    assert!(report.to_string().contains("warning"));
    assert!(fit(&samples()).unwrap().on_bounds.is_empty());
}

#[test]
fn eight_bits_are_nearly_the_sample() {
    let samples = samples();
    let fit = fit(&samples).unwrap();
    let reference = full_precision(&fit, &samples).unwrap();
    let (estimates, _) = few_bits(&fit, &samples, 8).unwrap();
    assert!(rms_difference(&estimates[5..], &reference[5..]) < 0.02 * fit.plant.measurement_variance().sqrt());
}

#[test]
fn bad_files_are_refused_with_reasons() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recording.csv");
    let missing = read_column(&file, "pressure").unwrap_err().to_string();
    assert!(missing.contains("pressure") && missing.contains("temp_degc"));
    assert!(read_column(Path::new("no such file.csv"), "x").is_err());
    assert!(fit(&[1.0; 5]).is_err() && fit(&[1.0; 50]).is_err());
}
