//! Reference values, computed by an independent program.

use crate::diffusion_entries::{beginning_with, number};
use fewbits_baselines::diffusive::polynomials::{gaussian_moment, hermite, multi_indices};
use fewbits_baselines::diffusive::{Peak, cumulant_laplace};
use fewbits_core::{Belief, Gaussian, Likelihood};
use fewbits_diffusive::density::CellOptions;
use fewbits_diffusive::information::{Predictions, Unknown, fisher_information};
use fewbits_diffusive::{Posterior, Prior, RateModel, RateRange, RateSums, SearchBox, SourceLikelihood, SourceSensor};
use fewbits_models::diffusion::{Air, Ground};
use nalgebra::{Matrix2, Vector2, Vector3};
use serde_json::Value;

fn entries(prefix: &str) -> Vec<Value> {
    beginning_with(prefix, include_str!("../fixtures/diffusive.json"))
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn point(value: &Value) -> Vector2<f64> {
    Vector2::new(value[0].as_f64().unwrap(), value[1].as_f64().unwrap())
}

fn check(e: &Value, got: &[f64]) {
    let want = if e["value"].is_array() {
        list(&e["value"])
    } else {
        vec![e["value"].as_f64().unwrap()]
    };
    let tolerance = e["tolerance"].as_f64().unwrap();
    let largest = want.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let allowed = match e["tolerance_kind"].as_str().unwrap() {
        "rel_maxabs" => tolerance * largest,
        "rel_max1" => tolerance * largest.max(1.0),
        "abs" => tolerance,
        other => panic!("unknown tolerance kind {other}"),
    };
    assert_eq!(got.len(), want.len());
    for (g, w) in got.iter().zip(&want) {
        assert!((g - w).abs() <= allowed, "{}: {got:?}, expected {want:?} within {allowed}", e["id"]);
    }
}

fn range(e: &Value) -> RateRange {
    RateRange::new(number(e, "mu_low"), number(e, "mu_high")).unwrap()
}

/// Erratum `diffusive-1`.
#[test]
fn likelihoods() {
    for e in entries("loglik_sample") {
        let sums = RateSums::of(&[number(&e, "ytilde")], &[number(&e, "a")], number(&e, "sigma"));
        check(&e, &[sums.unwrap().log_marginal(&range(&e))]);
    }
    for e in entries("loglik_joint") {
        let sums = RateSums::of(&list(&e["inputs"]["ytilde"]), &list(&e["inputs"]["a"]), number(&e, "sigma")).unwrap();
        check(&e, &[sums.log_marginal(&range(&e))]);
    }
}

#[test]
fn hermite_polynomials_and_moments() {
    for e in entries("hermite_") {
        let nu = [
            e["inputs"]["nu"][0].as_u64().unwrap() as usize,
            e["inputs"]["nu"][1].as_u64().unwrap() as usize,
        ];
        let w = Matrix2::new(number(&e, "w11"), number(&e, "w12"), number(&e, "w12"), number(&e, "w22"));
        check(&e, &[hermite(nu, &point(&e["inputs"]["z"]), &w).unwrap()]);
    }
    for e in entries("moment_") {
        let nu = [
            e["inputs"]["nu"][0].as_u64().unwrap() as usize,
            e["inputs"]["nu"][1].as_u64().unwrap() as usize,
        ];
        check(&e, &[gaussian_moment(nu, &point(&e["inputs"]["mu"]), &matrix(&e["inputs"]["Sigma"])).unwrap()]);
    }
    for e in entries("lpg_moments") {
        let (mean, sigma) = (point(&e["inputs"]["mu"]), matrix(&e["inputs"]["Sigma"]));
        let terms: Vec<([usize; 2], f64)> = e["inputs"]["C"]
            .as_array()
            .unwrap()
            .iter()
            .map(|t| ([t[0][0].as_u64().unwrap() as usize, t[0][1].as_u64().unwrap() as usize], t[1].as_f64().unwrap()))
            .collect();
        let m = fewbits_baselines::diffusive::polynomials::series_moments(&mean, &sigma, &terms).unwrap();
        let c = m.covariance;
        check(&e, &[m.mass, m.mean[0], m.mean[1], c[(0, 0)], c[(0, 1)], c[(1, 0)], c[(1, 1)]]);
    }
    assert_eq!(multi_indices::<2>(5).unwrap().len(), 21);
}

fn matrix(value: &Value) -> Matrix2<f64> {
    Matrix2::from_fn(|i, j| value[i][j].as_f64().unwrap())
}

struct Case {
    likelihood: SourceLikelihood,
    prior: Gaussian<2>,
}

fn posterior_case(e: &Value) -> Case {
    let air = Air::new(number(e, "kappa"), Vector3::zeros(), Ground::Impermeable).unwrap();
    let sensor = SourceSensor::new(air, list(&e["inputs"]["t"]), number(e, "sigma")).unwrap();
    let source = point(&e["inputs"]["source"]);
    let records = e["inputs"]["nodes"].as_array().unwrap().iter().map(|node| {
        let node = point(node);
        let clean: Vec<f64> = sensor
            .responses(&node, &source)
            .unwrap()
            .iter()
            .map(|a| a * number(e, "mu_true"))
            .collect();
        sensor.record(&node, &clean).unwrap()
    });
    let sd = number(e, "prior_sd");
    Case {
        likelihood: SourceLikelihood::new(records.collect(), RateModel::Joint(range(e))).unwrap(),
        prior: Gaussian::new(point(&e["inputs"]["prior_mean"]), Matrix2::identity() * sd * sd).unwrap(),
    }
}

#[test]
fn posteriors() {
    let search = SearchBox {
        lower: [-20.0; 2],
        upper: [120.0; 2],
    };
    for e in entries("post_") {
        let case = posterior_case(&e);
        let posterior =
            Posterior::new(&Prior::Exact(case.prior), &case.likelihood, &search, None, &CellOptions::default())
                .unwrap();
        let id = e["id"].as_str().unwrap();
        if id.starts_with("post_mean") {
            check(&e, posterior.cells.mean().as_slice());
        } else if id.starts_with("post_cov") {
            check(&e, posterior.cells.covariance().as_slice());
        } else {
            let prior = case.prior.factored().unwrap();
            let log = |x: &Vector2<f64>| prior.log_pdf(x) + case.likelihood.log_likelihood(x);
            let scale = posterior.cells.covariance().diagonal().map(f64::sqrt);
            check(
                &e,
                Peak::climb(&log, &posterior.cells.mean(), &scale)
                    .unwrap()
                    .mode
                    .as_slice(),
            );
        }
    }
}

#[test]
fn cumulants_of_laplace() {
    for e in entries("tk_mgf_mean") {
        let case = posterior_case(&e);
        let prior = case.prior.factored().unwrap();
        let log = |x: &Vector2<f64>| prior.log_pdf(x) + case.likelihood.log_likelihood(x);
        let got = cumulant_laplace(&log, &point(&e["inputs"]["source"]), &Vector2::repeat(0.1)).unwrap();
        check(&e, got.mean().as_slice());
    }
}

#[test]
fn mutual_information() {
    let predictions = |e: &Value| {
        let means: Vec<Vec<f64>> = list(&e["inputs"]["means"]).into_iter().map(|m| vec![m]).collect();
        Predictions::new(&means, &list(&e["inputs"]["weights"]), number(e, "sigma")).unwrap()
    };
    entries("mi_1d")
        .iter()
        .for_each(|e| check(e, &[predictions(e).exact()]));
    entries("mi_kt_lower")
        .iter()
        .for_each(|e| check(e, &[predictions(e).pairwise_bounds().lower]));
    entries("mi_kt_upper")
        .iter()
        .for_each(|e| check(e, &[predictions(e).pairwise_bounds().upper]));
}

#[test]
fn fisher() {
    for e in entries("fim") {
        let air = Air::new(number(&e, "kappa"), Vector3::zeros(), Ground::Impermeable).unwrap();
        let sensor = SourceSensor::new(air, list(&e["inputs"]["t"]), number(&e, "sigma")).unwrap();
        let (node, source) = (point(&e["inputs"]["node"]), point(&e["inputs"]["source"]));
        let unknowns = [Unknown::X, Unknown::Y, Unknown::Rate];
        let got = fisher_information(&unknowns, &sensor, &[node], &source, number(&e, "mu")).unwrap();
        check(&e, got.as_slice());
    }
}
