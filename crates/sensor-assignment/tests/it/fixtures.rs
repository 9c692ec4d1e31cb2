//! Every entry of the fixture file, computed by independent programs, against the library.

use crate::entry::{Entry, check};
use fewbits_baselines::sensor_assignment::{all_errors, bit_error, by_precision, flipped_estimate};
use fewbits_sensor_assignment::{CodedSensors, Estimator, pair_costs, quantization_error};
use serde_json::Value;

fn entries() -> Vec<Entry> {
    serde_json::from_str(include_str!("../fixtures/assignment.json")).unwrap()
}

#[test]
fn no_entry_is_left_out() {
    let families = ["t61.", "f61.", "fC1.", "f634."];
    let all = entries();
    assert!(all.iter().all(|e| families.iter().any(|f| e.id.starts_with(f))));
    assert_eq!(all.len(), 92);
}

const VARIANCES_61: [f64; 8] = [0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001];

#[test]
fn table_6_1() {
    let sensors = CodedSensors::with_variances(1.0, &VARIANCES_61).unwrap();
    let costs = pair_costs(&sensors);
    for e in entries().iter().filter(|e| e.id.starts_with("t61.")) {
        let parts: Vec<&str> = e.id.split('.').collect();
        if e.id == "t61.cost" {
            for (b, row) in e.value.as_array().unwrap().iter().enumerate() {
                for (n, expected) in row.as_array().unwrap().iter().enumerate() {
                    let (ours, expected) = (costs.get(b, n).unwrap(), expected.as_f64().unwrap());
                    assert!((ours - expected).abs() <= 1e-8 * expected, "cost {b} {n}: {ours} instead of {expected}");
                }
            }
            continue;
        }
        if e.id == "t61.bruteforce.mmse" {
            let all = all_errors(&sensors, Estimator::PosteriorMean).unwrap();
            let (best, error) = (all.best, all.least);
            let one_based: Vec<usize> = best.iter().map(|n| n + 1).collect();
            assert_eq!(serde_json::json!(one_based), e.inputs["assign_1based"]);
            check(e, error).unwrap();
            continue;
        }
        let assignment: Vec<usize> = match parts[1] {
            "I" => (0..8).collect(),
            "II" => by_precision(&VARIANCES_61),
            "opt" => costs.solve(),
            other => panic!("unknown assignment {other}"),
        };
        if let Some(listed) = e.inputs.get("assign_1based") {
            let one_based: Vec<usize> = assignment.iter().map(|n| n + 1).collect();
            assert_eq!(serde_json::json!(one_based), *listed);
        }
        let ours = match parts[2] {
            "approx" => quantization_error(1.0, 8) + costs.cost(&assignment).unwrap(),
            "center" => sensors.mse(&assignment, Estimator::CellCentre).unwrap(),
            "mmse" => sensors.mse(&assignment, Estimator::PosteriorMean).unwrap(),
            other => panic!("unknown error {other}"),
        };
        check(e, ours).unwrap();
    }
    let best = all_errors(&sensors, Estimator::CellCentre).unwrap().best;
    assert_eq!(best, costs.solve(), "the linear optimum is the exact one");
}

fn points(e: &Entry) -> Vec<(f64, f64)> {
    let list = |v: &Value| -> Vec<f64> { serde_json::from_value(v.clone()).unwrap() };
    list(&e.inputs["x"]).into_iter().zip(list(&e.value)).collect()
}

#[test]
fn figures_6_1_and_c_1() {
    let sensors = CodedSensors::with_variances(1.0, &[0.03; 4]).unwrap();
    for e in entries()
        .iter()
        .filter(|e| e.id.starts_with("f61.") || e.id.starts_with("fC1."))
    {
        let bit: usize = e.id.rsplit_once('b').unwrap().1.parse::<usize>().unwrap() - 1;
        for (x, expected) in points(e) {
            if e.id.starts_with("f61.") {
                let ours = flipped_estimate(x, bit, 4, 1.0).unwrap();
                assert!((ours - expected).abs() <= 1e-12, "{} at {x}", e.id);
            } else {
                let ours = bit_error(&sensors.quantizers()[bit], x, 0.03f64.sqrt()).unwrap();
                assert!((ours - expected).abs() <= 1e-8 * expected, "{} at {x}", e.id);
            }
        }
    }
}

/// Averages over random networks are the figures' business (`assign-fig6-3`, `assign-fig6-4`, which claim every one of these
/// within four standard errors); here the one fixed network, exactly.
#[test]
fn figures_6_3_and_6_4() {
    for e in entries().iter().filter(|e| e.id.starts_with("f634.")) {
        if e.id != "f634.fixed.setup" {
            assert!(e.id.starts_with("f634.mu") && e.inputs["trials"] == 1000, "{}", e.id);
            continue;
        }
        let variances: Vec<f64> = serde_json::from_value(e.inputs["variances"].clone()).unwrap();
        let sensors = CodedSensors::with_variances(1.0, &variances).unwrap();
        let found = pair_costs(&sensors).solve();
        let one_based: Vec<usize> = found.iter().map(|n| n + 1).collect();
        assert_eq!(serde_json::json!(one_based), e.value["alg_assign_1based"]);
        for (estimator, name) in [(Estimator::CellCentre, "center"), (Estimator::PosteriorMean, "mmse")] {
            let all = all_errors(&sensors, estimator).unwrap();
            for (what, ours) in [
                ("alg", sensors.mse(&found, estimator).unwrap()),
                ("min", all.least),
                ("avg", all.mean),
            ] {
                let expected = e.value[format!("{name}_{what}")].as_f64().unwrap();
                assert!((ours - expected).abs() <= 1e-8 * expected, "{name} {what}: {ours} instead of {expected}");
            }
        }
    }
}
