//! The laws of schemes, on every scheme of this crate and all kinds of links.

use fewbits_core::laws::{factor, message, scheme};
use fewbits_core::{Deterministic, Gaussian, Link, Message, Observation, Scheme, Sign};
use fewbits_dymbo::{CellIndex, InnovationWord, Multiple, Prediction, RoundedSample, SignBit};
use fewbits_monte_carlo::Stream;
use nalgebra::Vector1;
use rand::RngExt;
use rand_distr::StandardNormal;

/// All laws of one scheme with the given reports, in a unit of measurement.
fn obeys<S: Deterministic<1>>(
    scheme_: &S,
    feedback: &S::Feedback,
    noise_variance: f64,
    unit: f64,
    reports: &[S::Report],
) where
    S::Report: Copy + PartialEq + std::fmt::Debug,
{
    let points = [-7.0, -1.2, 0.0, 0.31, 2.0, 40.0].map(|m| Vector1::new(m * unit));
    let prior = Gaussian::scalar(0.4 * unit, 1.7 * unit * unit).unwrap();
    for link in [
        Link::PERFECT,
        Link::lossy(0.3).unwrap(),
        Link::flipping(0.1).unwrap(),
        Link::new(0.2, 0.5).unwrap(),
        Link::new(0.25, 0.05).unwrap(),
        Link::new(0.25, 0.05).unwrap().with_erasure(0.3).unwrap(),
    ] {
        scheme::total_probability(scheme_, feedback, &link, reports.to_vec(), &points).unwrap();
        for report in reports {
            let seen = scheme_
                .factor(feedback, &Observation::Received(*report), &link)
                .unwrap();
            factor::is_a_number(&seen, &points).unwrap();
            factor::sweep_is_scalar(&seen, &points).unwrap();
            factor::tilted_is_quadrature(&seen, &prior, 14.0 * unit, 4001, 1e-7).unwrap();
        }
        let mut rng = Stream::new(7).rng();
        let noise = |rng: &mut _| Vector1::new(noise_variance.sqrt() * RngExt::sample::<f64, _>(rng, StandardNormal));
        for m in [-0.8, 1.1] {
            let m = Vector1::new(m * unit);
            scheme::frequencies(scheme_, feedback, &link, &mut rng, 4000, &m, noise, reports.to_vec()).unwrap();
        }
    }
    let sources = [Stream::new(1).rng(), Stream::new(2).rng()];
    scheme::deterministic(scheme_, feedback, &sources, &points[1..4]).unwrap();
    let format = scheme_.report_format();
    for report in reports {
        message::round_trip(report, &format).unwrap();
        assert!(message::decoding_is_total::<S::Report>(&report.to_bits(&format).unwrap().with_flipped(0), &format));
    }
    let mut rng = Stream::new(1).rng();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(
            scheme_
                .encode(&mut rng, &mut scheme_.start(), &Vector1::new(bad), feedback)
                .is_err()
        );
    }
}

#[test]
fn sign_bits_obey_at_any_threshold() {
    for (unit, threshold) in [(1.0, 0.3), (1e-4, -2.0), (1e4, 5.0)] {
        let bit = SignBit::new(0.6 * unit * unit).unwrap();
        obeys(&bit, &(threshold * unit), 0.6 * unit * unit, unit, &[Sign::Below, Sign::Above]);
    }
}

#[test]
fn innovation_words_obey() {
    for (unit, bits) in [(1.0, 1), (1e-4, 2), (1e4, 3)] {
        let word = InnovationWord::new(0.6 * unit * unit, bits).unwrap();
        let prediction = Prediction {
            mean: 0.2 * unit,
            deviation: 1.3 * unit,
        };
        let reports: Vec<CellIndex> = (0..1 << bits).map(CellIndex).collect();
        obeys(&word, &prediction, 0.6 * unit * unit, unit, &reports);
        let nothing = Prediction {
            mean: f64::NAN,
            deviation: unit,
        };
        assert!(word.word(0.0, &nothing).is_err());
        assert!(word.factor(&nothing, &Observation::Lost, &Link::PERFECT).is_err());
        assert_eq!(message::round_trip(&prediction, &word.feedback_format()), Ok(128));
    }
}

#[test]
fn rounded_samples_obey() {
    for unit in [1.0, 1e-4, 1e4] {
        let rounded = RoundedSample::new(0.6 * unit * unit, 0.9 * unit)
            .unwrap()
            .with_bits(3)
            .unwrap();
        let reports: Vec<Multiple> = (-4..4).map(Multiple).collect();
        obeys(&rounded, &(), 0.6 * unit * unit, unit, &reports);
    }
}
