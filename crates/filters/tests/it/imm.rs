//! The interacting-multiple-model filter against exact enumeration, one model, and invariances.

use fewbits_core::factor::{Factor, Levels, Value};
use fewbits_core::nalgebra::{Matrix1, Vector1};
use fewbits_core::{Belief, Cell, Gaussian, Observed, Sensing, Sign, laws};
use fewbits_filters::{Error, Imm, ImmBelief, MomentFilter, StateFilter, Switching, assumed_density, kalman};
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;

/// Models, and the filter of moments for each.
struct Models(Switching<Ar1>, Imm<1, MomentFilter>);

/// With `switching` the model is drawn anew uniformly.
fn switching(models: Vec<Ar1>, switching: f64) -> Models {
    let filter = Imm::new(MomentFilter, vec![1.0; models.len()], switching).unwrap();
    Models(Switching::new(models).unwrap(), filter)
}

/// With these probabilities of transition.
fn chain(models: Vec<Ar1>, transition: &[Vec<f64>]) -> Result<Models, Error> {
    let filter = Imm::of(vec![(MomentFilter, 1.0); models.len()], transition)?;
    Ok(Models(Switching::new(models)?, filter))
}

/// One slot: the next belief and `ln p(observation | past)`.
fn step(
    models: &Models,
    belief: &ImmBelief<1>,
    observed: &Observed<impl Sensing<1, 1>, impl Factor<1>, 1>,
) -> Result<(ImmBelief<1>, f64), Error> {
    let Models(motion, filter) = models;
    let (next, info) = filter
        .clone()
        .step(&mut Stream::new(9).rng(), motion, belief, &[observed])?;
    Ok((next, info.log_likelihood))
}

fn value(z: f64, r: f64) -> Value<1> {
    Value::new(Vector1::new(z), Matrix1::new(r)).unwrap()
}

fn models() -> Vec<Ar1> {
    [(0.9, 0.1), (0.5, 1.0), (0.99, 0.02)]
        .map(|(a, q)| Ar1::new(a, q).unwrap())
        .to_vec()
}

#[test]
fn one_model_is_the_assumed_density_filter() {
    let dynamics = Ar1::new(0.9, 0.3).unwrap();
    let filter = chain(vec![dynamics], &[vec![1.0]]).unwrap();
    let mut single = Gaussian::scalar(0.5, 2.0).unwrap();
    let mut belief = ImmBelief::agreed(&single, 1).unwrap();
    let sensor = LinearSensor::direct(0.5).unwrap();
    for n in 0..50 {
        let z = (f64::from(n) * 0.7).sin();
        let sign = Sign::of(z, 0.1).unwrap();
        let factor = Levels::sign(sign, 0.1, 0.5, &fewbits_core::Link::PERFECT).unwrap();
        let observed = Observed::new(sensor, factor);
        let predicted = assumed_density::predict(&dynamics, &single);
        let (next, info) = assumed_density::update_through(&predicted, &observed).unwrap();
        let (mixture, imm) = step(&filter, &belief, &observed).unwrap();
        (single, belief) = (next, mixture);
        assert!((info.log_likelihood - imm).abs() < 1e-12);
        assert!((belief.mean()[0] - single.mean()[0]).abs() < 1e-12);
        assert!((belief.covariance()[0] - single.covariance()[0]).abs() < 1e-12);
    }
}

/// Without switching the probabilities are exact: those of Bayes' rule with the Kalman filters' likelihoods.
#[test]
fn without_switching_probabilities_are_bayes_factors() {
    let (models, sensor) = (models(), LinearSensor::direct(0.4).unwrap());
    let filter = switching(models.clone(), 0.0);
    let start = Gaussian::scalar(0.0, 1.0).unwrap();
    let mut belief = ImmBelief::agreed(&start, 3).unwrap();
    let mut alone: Vec<(Gaussian<1>, f64)> = vec![(start, 0.0); 3];
    let mut total = 0.0;
    for n in 0..40 {
        let z = 1.5 * (f64::from(n) * 0.3).sin();
        let (next, log_likelihood) = step(&filter, &belief, &Observed::new(sensor, value(z, 0.4))).unwrap();
        belief = next;
        total += log_likelihood;
        for (model, (belief, log)) in models.iter().zip(&mut alone) {
            let (next, info) = kalman::step(model, &sensor, belief, &Vector1::new(z)).unwrap();
            *belief = next;
            *log += info.log_likelihood;
        }
    }
    let evidence: f64 = alone.iter().map(|(_, log)| log.exp() / 3.0).sum();
    assert!((total - evidence.ln()).abs() < 1e-9);
    for ((p, mode), (kalman, log)) in belief.probabilities().iter().zip(belief.modes()).zip(&alone) {
        assert!((p - log.exp() / 3.0 / evidence).abs() < 1e-9);
        assert!((mode.mean()[0] - kalman.mean()[0]).abs() < 1e-9);
    }
}

/// Two slots with switching, enumerated: nine histories, each a Kalman filter. The mixture's moments after two slots are exact in
/// the first and approximate in the second, where histories were merged: mean and evidence are close.
#[test]
fn switching_agrees_with_enumerated_histories() {
    let (models, sensor) = (models(), LinearSensor::direct(0.4).unwrap());
    let transition = [vec![0.8, 0.1, 0.1], vec![0.2, 0.7, 0.1], vec![0.05, 0.05, 0.9]];
    let filter = chain(models.clone(), &transition).unwrap();
    let start = Gaussian::scalar(0.3, 1.0).unwrap();
    let weights = [0.2, 0.5, 0.3];
    let first = ImmBelief::new(weights.to_vec(), vec![start; 3]).unwrap();
    let samples = [0.9, -0.4];
    let (one, info1) = step(&filter, &first, &Observed::new(sensor, value(samples[0], 0.4))).unwrap();
    let (two, info2) = step(&filter, &one, &Observed::new(sensor, value(samples[1], 0.4))).unwrap();
    let mut exact = [0.0; 2];
    let (mut mean, mut after_one) = (0.0, [0.0; 3]);
    for i in 0..3 {
        for j in 0..3 {
            let (b1, l1) = kalman::step(&models[j], &sensor, &start, &Vector1::new(samples[0])).unwrap();
            let p1 = weights[i] * transition[i][j] * l1.log_likelihood.exp();
            exact[0] += p1;
            after_one[j] += p1;
            for k in 0..3 {
                let (b2, l2) = kalman::step(&models[k], &sensor, &b1, &Vector1::new(samples[1])).unwrap();
                let p2 = p1 * transition[j][k] * l2.log_likelihood.exp();
                exact[1] += p2;
                mean += p2 * b2.mean()[0];
            }
        }
    }
    assert!((info1 - exact[0].ln()).abs() < 1e-12);
    for (p, e) in one.probabilities().iter().zip(after_one) {
        assert!((p - e / exact[0]).abs() < 1e-12);
    }
    assert!((info1 + info2 - exact[1].ln()).abs() < 0.01);
    assert!((two.mean()[0] - mean / exact[1]).abs() < 0.02);
}

#[test]
fn nothing_depends_on_the_unit() {
    let run = |unit: f64| {
        let models = [(0.9, 0.1), (0.5, 1.0)].map(|(a, q)| Ar1::new(a, q * unit * unit).unwrap());
        let filter = switching(models.to_vec(), 0.05);
        let sensor = LinearSensor::direct(0.2 * unit * unit).unwrap();
        let mut belief = ImmBelief::agreed(&Gaussian::scalar(0.0, unit * unit).unwrap(), 2).unwrap();
        for n in 0..60 {
            let edge = unit * (f64::from(n) * 0.4).sin();
            let cell = Cell::new(edge, edge + unit).unwrap();
            let observed = Observed::new(sensor, Levels::certain(cell, 0.2 * unit * unit).unwrap());
            belief = step(&filter, &belief, &observed).unwrap().0;
        }
        (belief.probabilities()[0], belief.mean()[0] / unit)
    };
    let (p, mean) = run(1.0);
    for unit in [1e-4, 1e4] {
        let scaled = run(unit);
        assert!((scaled.0 - p).abs() < 1e-9 && (scaled.1 - mean).abs() < 1e-9);
    }
}

#[test]
fn beliefs_obey_the_laws_and_failures_change_nothing() {
    let modes = [(-2.0, 0.5), (1.0, 2.0)].map(|(m, v)| Gaussian::scalar(m, v).unwrap());
    let belief = ImmBelief::new(vec![0.3, 0.7], modes.to_vec()).unwrap();
    laws::belief::samples_have_the_moments(&belief, &mut Stream::new(1).rng(), 40_000).unwrap();
    let stored = serde_json::to_string(&belief).unwrap();
    assert_eq!(serde_json::from_str::<ImmBelief<1>>(&stored).unwrap(), belief);
    assert!(serde_json::from_str::<ImmBelief<1>>(&stored.replace("0.3", "0.9")).is_err());

    let filter = switching(models()[..2].to_vec(), 0.1);
    let sensor = LinearSensor::direct(1.0).unwrap();
    let mut after = belief.clone();
    let impossible = Observed::new(sensor, value(f64::MAX, 1e-300));
    let outcome = filter
        .1
        .clone()
        .update(&mut Stream::new(9).rng(), &mut after, &[&impossible]);
    assert_eq!(outcome, Err(Error::Impossible));
    assert_eq!(after, belief);
    let three = ImmBelief::agreed(&modes[0], 3).unwrap();
    assert!(
        step(&filter, &three, &Observed::new(sensor, value(0.0, 1.0)))
            .unwrap_err()
            .to_string()
            .contains("models")
    );
    for bad in [vec![vec![0.5, 0.6], vec![0.5, 0.5]], vec![vec![1.0]]] {
        assert!(chain(models()[..2].to_vec(), &bad).is_err());
    }
    // A belief of another number of models is refused by both halves.
    let fit = Observed::new(sensor, value(0.0, 1.0));
    assert!(
        filter
            .1
            .clone()
            .update(&mut Stream::new(9).rng(), &mut three.clone(), &[&fit])
            .is_err()
    );
    assert!(Imm::<1, _>::new(MomentFilter, Vec::new(), 0.1).is_err() && Switching::<Ar1>::new(Vec::new()).is_err());
}
