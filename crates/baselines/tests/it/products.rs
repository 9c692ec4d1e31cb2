//! Products of mixtures: enumeration against quadrature, samplers against enumeration.

use crate::common::{lobe, random_mixture};
use fewbits_baselines::pf_mpa::ProductSampler;
use fewbits_baselines::pf_mpa::product::exact;
use fewbits_core::Belief;
use fewbits_densities::{Component, Mixture};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1, SVector, Vector1};

fn line(means: &[f64], variance: f64, weights: &[f64]) -> Mixture<1> {
    let parts = means
        .iter()
        .zip(weights)
        .map(|(m, w)| Component::new(*w, Vector1::new(*m), Matrix1::new(variance)).unwrap());
    Mixture::new(parts.collect()).unwrap()
}

/// Case A of the message-passing spec.
fn case_a() -> [Mixture<1>; 3] {
    [
        line(&[0.0, 1.0, 2.5], 0.25, &[0.2, 0.5, 0.3]),
        line(&[0.5, 1.5, 3.0], 0.36, &[0.3, 0.3, 0.4]),
        line(&[0.2, 1.1, 2.0], 0.5, &[0.6, 0.3, 0.1]),
    ]
}

/// Case C.
fn case_c() -> [Mixture<2>; 2] {
    let a = [0.3, 0.1, 0.2];
    let b = [0.5, -0.1, 0.4];
    [
        Mixture::new(vec![
            lobe(0.4, [0.0, 0.0], a),
            lobe(0.4, [1.0, 0.5], a),
            lobe(0.2, [2.0, 1.0], a),
        ])
        .unwrap(),
        Mixture::new(vec![
            lobe(0.2, [0.3, 0.2], b),
            lobe(0.5, [1.2, 0.2], b),
            lobe(0.3, [1.5, 1.5], b),
        ])
        .unwrap(),
    ]
}

#[test]
fn enumeration_meets_the_reference_values() {
    let [a, b, c] = case_a();
    let product = exact(&[&a, &b, &c]).unwrap();
    assert!((product.log_normaliser - -2.787_789_706_6).abs() < 1e-10);
    assert!((product.belief.mean()[0] - 0.930_082_888_8).abs() < 1e-10);
    assert!((product.belief.covariance()[(0, 0)] - 0.384_544_187_3).abs() < 1e-10);
    let [a, b] = case_c();
    let belief = exact(&[&a, &b]).unwrap().belief;
    assert!((belief.mean() - SVector::from([0.922_865_8, 0.450_029_3])).amax() < 1e-7);
    let covariance = belief.covariance();
    for (found, expected) in [
        (covariance[(0, 0)], 0.417_746_7),
        (covariance[(0, 1)], 0.161_001_2),
        (covariance[(1, 1)], 0.202_292_3),
    ] {
        assert!((found - expected).abs() < 1e-7);
    }
}

#[test]
fn enumeration_is_the_pointwise_product_at_every_scale() {
    let mut rng = Stream::new(31).rng();
    for unit in [1e-4, 1.0, 1e4] {
        let factors: Vec<Mixture<2>> = (0..3).map(|_| random_mixture(&mut rng, 3, unit)).collect();
        let views: Vec<&Mixture<2>> = factors.iter().collect();
        let product = exact(&views).unwrap();
        for _ in 0..20 {
            let x = product.belief.sample(&mut rng);
            let sum: f64 = factors.iter().map(|f| f.log_pdf(&x)).sum();
            let gap = sum - product.log_normaliser - product.belief.log_pdf(&x);
            assert!(gap.abs() < 1e-8, "{gap}");
        }
    }
    // Far from the origin nothing is lost.
    let shift = |m: &Mixture<1>| m.affine(&Matrix1::new(1.0), &Vector1::new(1e6)).unwrap();
    let [a, b, c] = case_a();
    let (near, far) = (exact(&[&a, &b, &c]).unwrap(), exact(&[&shift(&a), &shift(&b), &shift(&c)]).unwrap());
    assert!((near.log_normaliser - far.log_normaliser).abs() < 1e-8);
    assert!((far.belief.mean()[0] - 1e6 - near.belief.mean()[0]).abs() < 1e-8);
}

/// Law of the labels of case A after a number of sweeps, and their law in the product, by enumeration of all 27.
fn label_laws(factors: &[Mixture<1>; 3], sweeps: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let labels = |s: usize| [s % 3, s / 3 % 3, s / 9];
    let part = |l: usize, b: usize| &factors[l].components()[b];
    let term = |s: usize| {
        let chosen: Vec<Mixture<1>> = labels(s)
            .iter()
            .enumerate()
            .map(|(l, b)| Mixture::single(&part(l, *b).gaussian()).unwrap())
            .collect();
        let product = exact(&chosen.iter().collect::<Vec<_>>()).unwrap();
        let weight: f64 = labels(s)
            .iter()
            .enumerate()
            .map(|(l, b)| part(l, *b).weight())
            .product();
        (weight * product.log_normaliser.exp(), product.belief.mean()[0], weight)
    };
    let terms: Vec<(f64, f64, f64)> = (0..27).map(term).collect();
    let total: f64 = terms.iter().map(|t| t.0).sum();
    let truth: Vec<f64> = terms.iter().map(|t| t.0 / total).collect();
    let mut law: Vec<f64> = terms.iter().map(|t| t.2).collect();
    for step in 0..3 * sweeps {
        let stride = [1, 3, 9][step % 3];
        let mut next = vec![0.0; 27];
        for s in 0..27 {
            let base = s - labels(s)[step % 3] * stride;
            let others: f64 = (0..3).map(|b| truth[base + b * stride]).sum();
            for b in 0..3 {
                next[base + b * stride] += law[s] * truth[base + b * stride] / others;
            }
        }
        law = next;
    }
    (law, truth, terms.iter().map(|t| t.1).collect())
}

#[test]
fn gibbs_sweeps_have_the_law_of_their_chain() {
    let factors = case_a();
    let views: Vec<&Mixture<1>> = factors.iter().collect();
    let belief = exact(&views).unwrap().belief;
    let mut rng = Stream::new(32).rng();
    let n = 15_000;
    // Total variation between chain and product after some sweeps, from the message-passing spec.
    for (sweeps, variation) in [
        (0, 0.526_71),
        (1, 0.161_73),
        (2, 0.047_38),
        (5, 0.005_98),
        (10, 0.000_175),
    ] {
        let (law, truth, means) = label_laws(&factors, sweeps);
        let distance = 0.5 * law.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum::<f64>();
        assert!((distance - variation).abs() < 5e-6, "{sweeps}: {distance}");
        let mean: f64 = law.iter().zip(&means).map(|(p, m)| p * m).sum();
        let draws = ProductSampler::Gibbs { sweeps }.sample(&mut rng, &views, n).unwrap();
        let error = (draws.covariance()[(0, 0)] / n as f64).sqrt();
        assert!((draws.mean()[0] - mean).abs() < 4.0 * error, "{sweeps}: {} {mean}", draws.mean()[0]);
    }
    let draws = ProductSampler::Gibbs { sweeps: 10 }
        .sample(&mut rng, &views, n)
        .unwrap();
    for x in [-0.5, 0.5, 1.0, 1.5, 2.5] {
        let below = draws.columns()[0].iter().filter(|s| **s < x).count() as f64 / n as f64;
        assert!((below - belief.cdf(x)).abs() < 4.0 * (0.25 / n as f64).sqrt(), "{x}");
    }
    let single = ProductSampler::Gibbs { sweeps: 5 }
        .sample(&mut rng, &views[..1], n)
        .unwrap();
    assert!(
        (single.mean()[0] - factors[0].mean()[0]).abs() < 4.0 * (factors[0].covariance()[(0, 0)] / n as f64).sqrt()
    );
}

#[test]
fn gibbs_draws_the_product_in_the_plane() {
    let [a, b] = case_c();
    let truth = exact(&[&a, &b]).unwrap();
    let mut rng = Stream::new(33).rng();
    let n = 15_000;
    let slack = 4.0 * (truth.belief.covariance()[(0, 0)] / n as f64).sqrt();
    let draws = ProductSampler::Gibbs { sweeps: 10 }
        .sample(&mut rng, &[&a, &b], n)
        .unwrap();
    assert!((draws.mean() - truth.belief.mean()).amax() < slack);
}

#[test]
fn components_of_no_weight_are_never_chosen() {
    let zero = line(&[-50.0, 0.3, 50.0], 0.5, &[0.0, 1.0, 0.0]);
    let other = line(&[1.2, -0.5], 0.8, &[0.3, 0.7]);
    let mut rng = Stream::new(35).rng();
    let draws = ProductSampler::Gibbs { sweeps: 2 }
        .sample(&mut rng, &[&zero, &other], 2000)
        .unwrap();
    assert!(draws.columns()[0].iter().all(|x| x.abs() < 10.0));
}

#[test]
fn contradictions_and_bad_arguments_are_errors() {
    let mut rng = Stream::new(34).rng();
    let a = line(&[0.0], 1e-6, &[1.0]);
    let b = line(&[1e200], 1e-6, &[1.0]);
    assert!(exact(&[&a, &b]).is_err());
    let sampler = ProductSampler::Gibbs { sweeps: 5 };
    assert!(exact::<1>(&[]).is_err() && sampler.sample::<1, _>(&mut rng, &[], 5).is_err());
    assert!(sampler.sample(&mut rng, &[&a], 0).is_err());
    let widths = [0.04, 3.0].map(|v| Component::new(0.5, Vector1::new(0.0), Matrix1::new(v)).unwrap());
    let widths = Mixture::new(widths.to_vec()).unwrap();
    assert!(sampler.sample(&mut rng, &[&widths], 5).is_err() && exact(&[&widths]).is_ok());
    let many = line(&[0.0; 101], 1.0, &[1.0; 101]);
    let refusal = exact(&[&many, &many, &many]).unwrap_err().to_string();
    assert!(refusal.contains("factors") && refusal.contains("1000000"), "{refusal}");
}
