//! Marginals against the enumeration of all joint associations.

use fewbits_monte_carlo::Stream;
use fewbits_multi_target::{Error, Weights, marginals};
use rand::RngExt;

/// Probability of each pair, each missed track and each unassigned report, and the sum of all weights, by brute force.
fn enumerate(weights: &Weights) -> (Vec<Vec<f64>>, Vec<f64>, Vec<f64>, f64) {
    let (tracks, reports) = (weights.missed.len(), weights.unassigned.len());
    let mut found = (vec![vec![0.0; reports]; tracks], vec![0.0; tracks], vec![0.0; reports], 0.0);
    // Each track has a choice: a report, or none.
    let choices = (reports + 1).pow(tracks as u32);
    for mut code in 0..choices {
        let choice: Vec<usize> = (0..tracks)
            .map(|_| {
                let own = code % (reports + 1);
                code /= reports + 1;
                own
            })
            .collect();
        let taken = |j: usize| choice.iter().filter(|c| **c == j).count();
        if (0..reports).any(|j| taken(j) > 1) {
            continue;
        }
        let mut log: f64 = (0..reports)
            .filter(|j| taken(*j) == 0)
            .map(|j| weights.unassigned[j])
            .sum();
        for (i, j) in choice.iter().enumerate() {
            log += if *j < reports {
                weights.pairs[i][*j]
            } else {
                weights.missed[i]
            };
        }
        let weight = log.exp();
        found.3 += weight;
        for (i, j) in choice.iter().enumerate() {
            if *j < reports {
                found.0[i][*j] += weight
            } else {
                found.1[i] += weight
            }
        }
        (0..reports)
            .filter(|j| taken(*j) == 0)
            .for_each(|j| found.2[j] += weight);
    }
    found
}

#[test]
fn marginals_are_those_of_all_joint_associations() {
    let mut rng = Stream::new(11).rng();
    for case in 0..60 {
        let (tracks, reports) = (case % 5, case / 5 % 6);
        let mut log = |zero: f64| {
            let excluded = rng.random::<f64>() < zero;
            let log = 6.0 * rng.random::<f64>() - 3.0;
            if excluded { f64::NEG_INFINITY } else { log }
        };
        let weights = Weights {
            pairs: (0..tracks).map(|_| (0..reports).map(|_| log(0.4)).collect()).collect(),
            missed: (0..tracks).map(|_| log(0.1)).collect(),
            unassigned: (0..reports).map(|_| log(0.1)).collect(),
        };
        let (pairs, missed, unassigned, total) = enumerate(&weights);
        if total == 0.0 {
            assert_eq!(marginals(&weights), Err(Error::Impossible));
            continue;
        }
        let found = marginals(&weights).unwrap();
        assert!((found.log_evidence - total.ln()).abs() < 1e-12);
        for i in 0..tracks {
            assert!((found.missed[i] - missed[i] / total).abs() < 1e-12);
            for j in 0..reports {
                assert!((found.assigned[i][j] - pairs[i][j] / total).abs() < 1e-12);
            }
        }
        for j in 0..reports {
            assert!((found.unassigned[j] - unassigned[j] / total).abs() < 1e-12);
        }
    }
}

/// Weights far below the smallest double are no zeros.
#[test]
fn nothing_underflows() {
    let weights = Weights {
        pairs: vec![vec![0.0], vec![-1.0]],
        missed: vec![-2000.0, -2000.0],
        unassigned: vec![-3000.0],
    };
    let found = marginals(&weights).unwrap();
    let first = 1.0 / (1.0 + (-1.0_f64).exp());
    assert!((found.assigned[0][0] - first).abs() < 1e-12 && (found.missed[1] - first).abs() < 1e-12);
    assert!((found.log_evidence + 2000.0 - (1.0 + (-1.0_f64).exp()).ln()).abs() < 1e-9);
}

/// Many that all look alike: by symmetry every pair has the same probability.
#[test]
fn the_larger_side_may_be_any_number() {
    let (tracks, reports) = (30, 4);
    let weights = Weights {
        pairs: vec![vec![0.0; reports]; tracks],
        missed: vec![0.0; tracks],
        unassigned: vec![f64::NEG_INFINITY; reports],
    };
    let found = marginals(&weights).unwrap();
    assert!(found.assigned.iter().flatten().all(|p| (p - 1.0 / 30.0).abs() < 1e-12));
    assert!((found.log_evidence - (30.0 * 29.0 * 28.0 * 27.0_f64).ln()).abs() < 1e-10);
    let many = 15;
    let crowd = Weights {
        pairs: vec![vec![0.0; many]; many],
        missed: vec![0.0; many],
        unassigned: vec![0.0; many],
    };
    assert!(
        marginals(&crowd)
            .unwrap_err()
            .to_string()
            .contains("15 tracks with 15 reports")
    );
    let broken = Weights {
        missed: vec![f64::NAN],
        pairs: vec![vec![]],
        unassigned: vec![],
    };
    assert!(marginals(&broken).is_err());
    assert!(
        marginals(&Weights {
            missed: vec![0.0],
            ..broken
        })
        .is_ok()
    );
}
