//! The laws of schemes, on every scheme of this crate and all kinds of links.

use fewbits_core::laws::{factor, message, scheme};
use fewbits_core::{
    Deterministic, Error, Gaussian, LinearSensing, Link, Message, Observation, Quantized, Scheme, Sign,
};
use fewbits_dymbo::{
    CellIndex, DymboFilter, InnovationWord, MultibitFilter, Multiple, Prediction, RoundedSample, ScalarFilter,
    ScalarPlant, SignBit,
};
use fewbits_filters::assumed_density;
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
        assert!(word.report_of(0.0, &nothing).is_err());
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

/// Belief and log likelihood of an update, or its error.
type Updated = Result<([f64; 2], f64), Error>;

/// What a filter's closed form and the update of the contract make of an observation.
fn both_ways<F: ScalarFilter>(filter: &F, observation: &Observation<<F::Scheme as Scheme<1>>::Report>) -> [Updated; 2] {
    let predicted = Gaussian::scalar(0.4, 1.7).unwrap();
    let of = |belief: &Gaussian<1>| [belief.mean()[0], belief.covariance()[0]];
    let closed = filter
        .update(&predicted, observation)
        .map(|(belief, info)| (of(&belief), info.log_likelihood));
    let factor = filter
        .scheme()
        .factor(&filter.feedback(&predicted), observation, filter.link());
    let sensor = *filter.plant().sensor();
    let contract = factor.and_then(|factor| assumed_density::update(&predicted, sensor.matrix(), &factor));
    [
        closed,
        contract.map(|(belief, info)| (of(&belief), info.log_likelihood)),
    ]
}

/// Equal means and log likelihoods, or both impossible; the two variances.
fn same([closed, contract]: [Updated; 2], case: &str) -> Option<([f64; 2], f64)> {
    match (closed, contract) {
        (Ok((a, la)), Ok((b, lb))) => {
            let apart = (a[0] - b[0]).abs().max((la - lb).abs());
            assert!(apart < 1e-11, "{case}: {a:?} {la}, {b:?} {lb}");
            Some(([a[1], b[1]], la))
        }
        (Err(Error::Impossible), Err(Error::Impossible)) => None,
        (a, b) => panic!("{case}: {a:?}, {b:?}"),
    }
}

/// A report, and the two observations without one.
fn or_none<R>(report: R) -> [Observation<R>; 3] {
    [Observation::Received(report), Observation::Nothing, Observation::Lost]
}

/// Over links that lose nothing, half or all, and that invert bits: also where nothing arrives, and where something arrives that cannot.
/// The variance after a word is that of the contract on average over the words, and after a bit or without a report always.
#[test]
fn closed_forms_are_the_update_of_the_contract() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.3).unwrap();
    for (loss, crossover) in [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.3, 0.1), (1.0, 0.1)] {
        let link = Link::new(loss, crossover).unwrap();
        let bit = DymboFilter::new(plant).with_link(link);
        let words = MultibitFilter::new(plant, 2).unwrap().with_link(link);
        for observation in or_none(Sign::Above) {
            let case = format!("{loss} {crossover} {observation:?}");
            if let Some(([closed, contract], _)) = same(both_ways(&bit, &observation), &case) {
                assert!((closed - contract).abs() < 1e-12, "{case}: {closed} {contract}");
            }
        }
        let mut average = [0.0; 3];
        for word in 0..4 {
            let [received, nothing, lost] = or_none(CellIndex(word));
            let case = format!("{loss} {crossover} word {word}");
            if let Some(([closed, contract], log)) = same(both_ways(&words, &received), &case) {
                let p = log.exp();
                average = [average[0] + p, average[1] + p * closed, average[2] + p * contract];
            }
            for observation in [nothing, lost] {
                if let Some(([closed, contract], _)) = same(both_ways(&words, &observation), &case) {
                    assert!((closed - contract).abs() < 1e-12, "{case}: {closed} {contract}");
                }
            }
        }
        assert!((average[0] - (1.0 - loss)).abs() < 1e-11, "{average:?}");
        assert!((average[1] - average[2]).abs() < 1e-11, "{average:?}");
    }
}
