//! Every pair of scheme and question of the documentation at one centre, as bits.

use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::scheme::{Censoring, CovarianceFeedback};
use fewbits_core::{Evolution, FullValue, Gaussian, Link, NumberFormat, OnAxes, SchemeNode, Sensing, SensorNode};
use fewbits_dymbo::{InnovationWord, Prediction, SignBit};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{Event, FusionCentre, RemoteSensor, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::{Moments, Stream};
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use fewbits_quantizers::{Labelling, Quantizer, QuantizingSensor, lloyd_max};
use nalgebra::{Matrix4, Vector1, Vector2, Vector4};
use rand::Rng;

pub type Measure = Box<dyn Fn(&mut dyn Rng, &Vector4<f64>) -> Vector1<f64>>;

/// A sensor's two halves, and what it measures.
pub struct Pair {
    pub name: &'static str,
    pub remote: Box<dyn RemoteSensor<4>>,
    pub node: Box<dyn SensorNode<1>>,
    pub measure: Measure,
}

const NOISE: f64 = 0.25;

fn pair(
    name: &'static str,
    sensing: impl Sensing<4, 1> + Clone + 'static,
    remote: impl RemoteSensor<4> + 'static,
    node: impl SensorNode<1> + 'static,
) -> Pair {
    Pair {
        name,
        remote: Box::new(remote),
        node: Box::new(node),
        measure: Box::new(move |rng, state| sensing.sample(rng, state)),
    }
}

/// All pairs of the documentation, as sensors of a point in the plane.
pub fn pairs() -> Vec<Pair> {
    let link = Link::lossy(0.1).unwrap();
    let x = OnAxes::<_, 4, 1>::new(LinearSensor::direct(NOISE).unwrap(), [0]).unwrap();
    let row = LinearSensor::scalar(Vector4::new(0.0, 0.0, 1.0, 0.0), NOISE).unwrap();
    let mut all = Vec::new();
    let value = FullValue::new(NOISE).unwrap();
    all.push(pair("value", x, Reporting::values(x, value, link), SchemeNode::new(value)));
    let bit = SignBit::new(NOISE).unwrap();
    let ask = |_: &Gaussian<4>, m: &Gaussian<1>| m.mean()[0];
    all.push(pair("bit", x, Reporting::new(x, bit, link, ask), SchemeNode::new(bit)));
    for bits in [2, 3, 4] {
        let word = InnovationWord::new(NOISE, bits).unwrap();
        let ask = |_: &Gaussian<4>, m: &Gaussian<1>| Prediction::from(m);
        all.push(pair("word", x, Reporting::new(x, word, link, ask), SchemeNode::new(word)));
    }
    for format in [NumberFormat::Double, NumberFormat::Single] {
        let rule = CovarianceFeedback::new(row, 1.0, format).unwrap();
        let ask = |state: &Gaussian<4>, _: &Gaussian<1>| *state;
        all.push(pair("covariance", row, Reporting::new(row, rule.clone(), link, ask), SchemeNode::new(rule)));
        let rule = CensoringRule::new(&nalgebra::Matrix1::new(0.5), 1.0).unwrap();
        let scheme = Censoring::new(row, rule, format).unwrap();
        let ask = |state: &Gaussian<4>, _: &Gaussian<1>| *state.mean();
        all.push(pair("censored", row, Reporting::new(row, scheme.clone(), link, ask), SchemeNode::new(scheme)));
    }
    let quantizer = Quantizer::from(&lloyd_max::gaussian(4).unwrap());
    let fixed = QuantizingSensor::with_variance(quantizer, Labelling::gray(4).unwrap(), NOISE).unwrap();
    let ask = |_: &Gaussian<4>, _: &Gaussian<1>| ();
    all.push(pair("quantizer", x, Reporting::new(x, fixed.clone(), link, ask), SchemeNode::new(fixed)));
    let noise = RangeNoise::new(0.1, 0.01).unwrap();
    for place in [Vector2::new(-9.0, 4.0), Vector2::new(7.0, 11.0)] {
        let sensing = OnAxes::<_, 4, 2>::new(RangeSensor::new(place, noise).unwrap(), [0, 2]).unwrap();
        for levels in [2, 4, 8] {
            let range = QuantizedRange::new(levels, noise).unwrap();
            let loading = optimal_loading(levels).unwrap();
            let ask = move |_: &Gaussian<4>, m: &Gaussian<1>| RangeReference::about(m, loading);
            let remote = Reporting::new(sensing, range.clone(), link, ask);
            all.push(pair("range", sensing, remote, SchemeNode::new(range)));
        }
    }
    all
}

/// Defect: nothing rounded the question to the precision in which it is told, and the centre failed at its first one.
#[test]
fn every_scheme_goes_with_its_question() {
    let (mut rng, mut world) = (Stream::new(2).rng(), Stream::new(3).rng());
    let model = ContinuousLinear::nearly_constant_velocity_2d(0.01).unwrap();
    let prior = Gaussian::new(Vector4::new(0.1, 0.2, -0.3, 0.1), Matrix4::identity() * 0.3).unwrap();
    let mut centre = FusionCentre::new(&mut rng, model, MomentFilter, &prior).unwrap();
    let mut pairs = pairs();
    let count = pairs.len();
    let mut halves = Vec::new();
    for (number, pair) in pairs.drain(..).enumerate() {
        centre.join_boxed(number as u32, pair.remote).unwrap();
        halves.push((pair.name, pair.node, pair.measure));
    }
    let mut truth = fewbits_core::Belief::sample(&prior, &mut world);
    let (mut reports, mut errors) = (vec![0; count], Moments::default());
    for k in 1..=200 {
        truth = Evolution::over(&model, 1.0).unwrap().propagate(&mut world, &truth);
        centre.advance(&mut rng, f64::from(k)).unwrap();
        let slots: Vec<Slot> = halves
            .iter_mut()
            .enumerate()
            .map(|(number, (name, node, measure))| {
                let asked = centre.feedback(number as u32);
                let asked = asked.unwrap_or_else(|error| panic!("{name}, instant {k}: {error}"));
                let sample = measure(&mut world, &truth);
                let report = node.report(&mut world, &sample, &asked);
                let report = report.unwrap_or_else(|error| panic!("{name}, instant {k}: {error}"));
                reports[number] += u32::from(report.is_some());
                Slot::new(number as u32, asked, report.into())
            })
            .collect();
        let events = centre.receive(&mut rng, &slots).unwrap().events;
        let is_out = |event: &Event| matches!(event, Event::Rejected(_) | Event::Excluded(_) | Event::Lost);
        assert!(!events.iter().any(is_out), "instant {k}: {events:?}");
        errors.add(centre.estimate().normalised_error_squared(&truth).unwrap());
    }
    assert!(reports.iter().all(|reports| *reports > 20), "{reports:?}");
    // Four standard errors of a mean of 200 values that are correlated over some 10 instants.
    println!("normalised error squared {:.2}, reports {reports:?}", errors.mean());
    assert!(errors.mean() < 2.0, "{}", errors.mean());
}
