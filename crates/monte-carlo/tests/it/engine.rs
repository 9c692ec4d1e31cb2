//! The Monte-Carlo engine: determinism, failures, cancellation; summary statistics.

use fewbits_monte_carlo::{Moments, MonteCarlo, MonteCarloError, Stream, Trial};
use proptest::prelude::*;
use rand::RngExt;
use std::convert::Infallible;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

fn sum_of_uniforms(threads: usize) -> f64 {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let run = MonteCarlo::new(Stream::new(9).named("threads"), 1000);
    let total = pool.install(|| {
        run.fold(
            || 0.0,
            |sum, trial| {
                *sum += trial.stream.rng().random::<f64>();
                Ok::<(), Infallible>(())
            },
            |sum, part| *sum += part,
        )
    });
    total.unwrap()
}

#[test]
fn the_result_is_the_same_to_the_last_bit_on_any_number_of_threads() {
    let one = sum_of_uniforms(1);
    for threads in [2, 7] {
        assert_eq!(one.to_bits(), sum_of_uniforms(threads).to_bits());
    }
}

#[test]
fn results_come_in_trial_order_and_progress_is_complete() {
    let seen = AtomicU64::new(0);
    let count = |trials| {
        seen.fetch_add(trials, Ordering::Relaxed);
    };
    let mut run = MonteCarlo::new(Stream::new(1), 333);
    run.progress = Some(&count);
    let indices = run.run(|trial| Ok::<_, Infallible>(trial.index)).unwrap();
    assert_eq!(indices, (0..333).collect::<Vec<_>>());
    assert_eq!(seen.load(Ordering::Relaxed), 333);
    assert!(
        MonteCarlo::new(Stream::new(1), 0)
            .run(|t| Ok::<_, Infallible>(t.index))
            .unwrap()
            .is_empty()
    );
}

#[test]
fn a_failing_trial_can_be_run_again_alone() {
    let draw = |trial: Trial| trial.stream.rng().random::<f64>();
    let run = MonteCarlo::new(Stream::new(4).named("failing"), 200);
    let error = run
        .run(|t| {
            if draw(t) < 0.05 {
                Err(format!("drew {}", draw(t)))
            } else {
                Ok(())
            }
        })
        .unwrap_err();
    let MonteCarloError::Trial { index, stream, message } = error else {
        panic!("not a failed trial")
    };
    let alone = run.single(index, |t| Ok::<_, Infallible>(draw(t))).unwrap();
    assert_eq!(message, format!("drew {alone}"));
    assert_eq!(stream, run.trial(index).stream);
    assert!((0..index).all(|i| draw(run.trial(i)) >= 0.05), "the first failing trial is reported");
}

#[test]
fn errors_of_any_type_and_panics_stay_with_their_trial() {
    let run = MonteCarlo::new(Stream::new(4), 100);
    let boxed = run.run(|t| {
        if t.index == 70 {
            Err::<(), Box<dyn std::error::Error>>("no luck".into())
        } else {
            Ok(())
        }
    });
    assert!(matches!(boxed, Err(MonteCarloError::Trial { index: 70, ref message, .. }) if message == "no luck"));
    let panicked = run.run(|t| {
        if t.index == 7 {
            panic!("trial {}", t.index)
        } else {
            Ok::<_, Infallible>(())
        }
    });
    assert!(matches!(panicked, Err(MonteCarloError::Panicked { index: 7, ref message, .. }) if message == "trial 7"));
}

#[test]
fn a_cancelled_run_stops() {
    let cancel = AtomicBool::new(false);
    let started = AtomicU64::new(0);
    let mut run = MonteCarlo::new(Stream::new(1), 1_000_000);
    run.cancel = Some(&cancel);
    let result = run.run(|_| {
        started.fetch_add(1, Ordering::Relaxed);
        cancel.store(true, Ordering::Relaxed);
        Ok::<_, Infallible>(())
    });
    assert_eq!(result, Err(MonteCarloError::Cancelled));
    assert!(started.load(Ordering::Relaxed) < 1000);
}

proptest! {
    #[test]
    fn merged_moments_are_the_moments_of_all(values in prop::collection::vec(-1e3..1e3_f64, 2..60), cut in 0_usize..60) {
        let cut = cut.min(values.len());
        let mut merged: Moments = values[..cut].iter().copied().collect();
        merged.merge(&values[cut..].iter().copied().collect());
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        prop_assert_eq!(merged.count(), values.len() as u64);
        prop_assert!((merged.mean() - mean).abs() <= 1e-10);
        prop_assert!((merged.variance() - variance).abs() <= 1e-9 * (1.0 + variance));
    }
}

#[test]
fn a_root_mean_square_has_the_standard_error_of_the_delta_method() {
    // Squared standard normal draws: RMSE 1, standard error sqrt(2/n)/2.
    let n = 40_000;
    let mut rng = Stream::new(2).rng();
    let squares: Moments = (0..n)
        .map(|_| rng.sample::<f64, _>(rand_distr::StandardNormal).powi(2))
        .collect();
    let rmse = squares.root_mean();
    let expected = (2.0 / f64::from(n)).sqrt() / 2.0;
    assert!((rmse.standard_error / expected - 1.0).abs() < 0.05);
    assert!(rmse.z_score(1.0).abs() < 4.0);
}

/// Defect: after a failure all other chunks ran to their end.
#[test]
fn a_failing_trial_stops_those_behind_it() {
    use std::sync::atomic::{AtomicU64, Ordering};
    let begun = AtomicU64::new(0);
    let run = MonteCarlo::new(Stream::new(1), 1_000_000);
    let failed = run.fold(
        || (),
        |(), trial| {
            begun.fetch_add(1, Ordering::Relaxed);
            if trial.index % 1000 == 70 { Err("no") } else { Ok(()) }
        },
        |(), ()| (),
    );
    // The lowest index of all that fail, on any number of threads.
    assert!(matches!(failed, Err(MonteCarloError::Trial { index: 70, .. })), "{failed:?}");
    assert!(begun.load(Ordering::Relaxed) < 100_000, "{begun:?}");
}

/// One value says nothing about its error.
#[test]
fn a_single_trial_has_no_standard_error() {
    let one: Moments = [2.0].into_iter().collect();
    assert_eq!((one.standard_error(), one.root_mean().standard_error), (f64::INFINITY, f64::INFINITY));
    assert_eq!(Moments::default().estimate().standard_error, f64::INFINITY);
}
