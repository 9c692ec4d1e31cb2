//! Every value of an independent program, one by one.
//!
//! The deterministic ones are computed here and compared within their tolerance. Those that carry a standard error are
//! Monte-Carlo results; the figures reproduce them, and this test only makes sure that none is forgotten.

use fewbits_baselines::dymbo::first_message::{first_message_mse, first_message_value};
use fewbits_baselines::dymbo::{
    SignFilter, contours, expected_information, iterated, scalar_fixed_lag_variance, skew_normal, steady_state, tree,
};
use fewbits_core::factor::{Factor, Levels};
use fewbits_core::{Gaussian, Link, Observation, Scheme, Sign};
use fewbits_dymbo::chain;
use fewbits_dymbo::{
    CountFusion, DymboFilter, MultibitFilter, Multiple, ParallelFilter, RoundedSample, ScalarFilter, ScalarPlant,
    filtered_variance,
};
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid, assumed_density, kalman};
use fewbits_models::{LinearGaussian, LinearSensor, ScalarSensor};
use fewbits_quantizers::lloyd_max::gaussian_table;
use nalgebra::{Matrix2, Vector2};
use serde_json::Value;
use std::f64::consts::FRAC_2_PI;

/// Monte-Carlo families, and the figures, or tests of `fewbits-experiments`, that reproduce them.
const HANDLED_BY_FIGURES: [(&str, &str); 6] = [
    ("thr.", "dymbo-threshold"),
    ("unstable.", "one_bit_cannot_hold_an_unstable_plant"),
    ("fig5mc.", "dymbo-fig5"),
    ("erasure.", "lost_bits_cost_what_the_bound_says"),
    ("rb.", "dymbo-gap, a_lag_of_four_beats_the_unquantized_filter_of_a_slow_plant"),
    ("vec.", "vectors_lose_little_to_the_exact_posterior"),
];

struct Entry<'a> {
    id: &'a str,
    inputs: &'a Value,
}

impl Entry<'_> {
    fn number(&self, name: &str) -> f64 {
        as_number(&self.inputs[name])
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        flat(&self.inputs[name])
    }

    fn plant(&self) -> ScalarPlant {
        ScalarPlant::new(self.number("a"), self.number("sigma_u2"), self.number("sigma2")).unwrap()
    }

    fn ends(&self, tail: &str) -> bool {
        self.id.ends_with(tail)
    }
}

fn as_number(value: &Value) -> f64 {
    match value.as_str() {
        Some("inf") => f64::INFINITY,
        Some("-inf") => f64::NEG_INFINITY,
        _ => value.as_f64().unwrap_or_else(|| panic!("{value} is no number")),
    }
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(entries) => entries.iter().flat_map(flat).collect(),
        other => vec![as_number(other)],
    }
}

#[test]
fn every_fixture() {
    let text = include_str!("../fixtures/dymbo.json");
    let entries: Vec<Value> = serde_json::from_str(text).unwrap();
    let (mut checked, mut left_to_figures, mut misses) = (0, 0, Vec::new());
    for entry in &entries {
        let id = entry["id"].as_str().unwrap();
        let expected = flat(&entry["value"]);
        if !entry["stderr"].is_null() {
            let known = HANDLED_BY_FIGURES.iter().any(|(family, _)| id.starts_with(family));
            assert!(known, "{id} is reproduced by no figure");
            left_to_figures += 1;
            continue;
        }
        let inputs = &entry["inputs"];
        let actual = compute(&Entry { id, inputs }).unwrap_or_else(|| panic!("{id} is not handled"));
        assert_eq!(actual.len(), expected.len(), "{id}");
        let tolerance = entry["tolerance"].as_f64().unwrap();
        for (a, e) in actual.iter().zip(&expected) {
            let within = (a - e).abs() <= tolerance;
            if !within {
                misses.push(format!("{id}: {a} instead of {e}, off by {:e}, allowed {tolerance:e}", (a - e).abs()));
            }
        }
        checked += 1;
    }
    assert!(misses.is_empty(), "{}", misses.join("\n"));
    assert_eq!((checked, left_to_figures, entries.len()), (343, 63, 406));
}

fn compute(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let family = entry.id.split('.').next()?;
    match family {
        "steady" => steady_entry(entry),
        "loss" => loss_entry(entry),
        "fig4" | "fig3" => Some(grid_entry(entry, family == "fig4")),
        "fig5" => fig5_entry(entry),
        "mmse_tree" => {
            let levels =
                tree::first_message_tree(&entry.plant(), entry.number("tau"), entry.number("N") as usize).unwrap();
            Some(
                levels
                    .iter()
                    .map(|l| if entry.ends("excess") { l.excess } else { l.mmse })
                    .collect(),
            )
        }
        "bit_update" => {
            let bit = Sign::try_from(entry.number("b") as i32).unwrap();
            let link = Link::flipping(entry.number("eps")).unwrap();
            let factor = Levels::sign(bit, entry.number("tau"), entry.number("sigma2"), &link).unwrap();
            Some(posterior(entry, &factor))
        }
        "cell_update" => {
            let cell = fewbits_core::Cell::new(entry.number("lo"), entry.number("hi")).unwrap();
            Some(posterior(entry, &Levels::certain(cell, entry.number("sigma2")).unwrap()))
        }
        "eta" => Some(vec![expected_information(entry.number("z"), &Link::PERFECT).unwrap()]),
        "lloyd_max" => {
            let quantizer = gaussian_table(entry.number("bits") as usize).unwrap();
            if entry.ends("tables") {
                let half = quantizer.centroids().len() / 2;
                Some([&quantizer.breakpoints()[half - 1..], &quantizer.centroids()[half..]].concat())
            } else {
                Some(vec![1.0 - quantizer.mean_squared_error()])
            }
        }
        "iq_exact_tree" => Some(vec![iterated::exact_tree_information(entry.number("bits") as usize).unwrap()]),
        "iq_gauss" => {
            let it = iterated::normal_assumption_information(entry.number("bits") as usize).unwrap();
            Some(vec![it.claimed, it.with_own_levels, it.with_centroids])
        }
        "mq" => {
            let filter = MultibitFilter::new(entry.plant(), entry.number("bits") as usize).unwrap();
            Some(vec![if entry.ends("riccati") {
                entry
                    .plant()
                    .steady_state(filter.information())
                    .unwrap()
                    .filtered_variance
            } else {
                chain::multibit_mse(&filter).unwrap()
            }])
        }
        "bsc" => {
            let actual = Link::flipping(entry.number("eps")).unwrap();
            let aware = DymboFilter::new(entry.plant()).with_link(actual);
            let naive = DymboFilter::new(entry.plant());
            Some(vec![if entry.ends("riccati") {
                entry
                    .plant()
                    .steady_state(aware.information())
                    .unwrap()
                    .filtered_variance
            } else if entry.ends("naive_mse") {
                chain::crossover_mse(&naive, &actual).unwrap()
            } else {
                chain::dymbo_mse(&aware).unwrap()
            }])
        }
        "prop1b" => {
            let (prior, noise) = (entry.number("sigma_theta"), entry.number("sigma"));
            Some(vec![skew_normal::distance_from_normal(prior * prior, noise * noise).unwrap()])
        }
        "prop2" => Some(prop2_entry(entry)),
        "prior_init" => {
            let plant = entry.plant();
            let prior = Gaussian::scalar(0.0, plant.dynamics().stationary_variance().unwrap()).unwrap();
            let scheme = RoundedSample::new(plant.measurement_variance(), entry.number("tau")).unwrap();
            let value = first_message_value(&scheme, &prior).unwrap();
            Some(vec![value.expected_variance, value.entropy_bits])
        }
        "sensors" => sensors_entry(entry),
        "regress" => regress_entry(entry),
        "vec" => vector_entry(entry),
        "rts" => {
            let plant = entry.plant();
            let lags = entry.numbers("lags");
            let of = |c: f64| {
                let steady = plant.steady_state(c).unwrap();
                lags.iter()
                    .map(move |lag| scalar_fixed_lag_variance(plant.coefficient(), &steady, *lag as usize))
                    .collect::<Vec<_>>()
            };
            Some([of(FRAC_2_PI), of(1.0)].concat())
        }
        "erasure" if entry.ends("bound") => {
            let link = Link::lossy(entry.number("p_erasure")).unwrap();
            let bound = contours::erasure_bound(&entry.plant(), &link).unwrap();
            Some(vec![bound.filtered_variance])
        }
        _ => None,
    }
}

fn posterior(entry: &Entry<'_>, factor: &Levels) -> Vec<f64> {
    let prior = Gaussian::scalar(entry.number("mu"), entry.number("P")).unwrap();
    let after = factor.tilted(&prior).unwrap();
    vec![after.mean[0], after.covariance[0]]
}

/// The filter's correction at its steady variance.
fn steady_step(plant: ScalarPlant) -> f64 {
    let steady = plant.steady_state(FRAC_2_PI).unwrap().filtered_variance;
    let belief = Gaussian::scalar(0.0, steady).unwrap();
    let above = Observation::Received(Sign::Above);
    DymboFilter::new(plant).step(&belief, &above).unwrap().1.correction
}

fn steady_entry(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let plant = entry.plant();
    let (kf, dymbo) = (plant.steady_state(1.0).unwrap(), plant.steady_state(FRAC_2_PI).unwrap());
    Some(vec![match entry.id.rsplit('.').next()? {
        "kf_filt" => kf.filtered_variance,
        "kf_pred" => kf.predicted_variance,
        "dymbo_filt" => dymbo.filtered_variance,
        "dymbo_pred" => dymbo.predicted_variance,
        "dymbo_gain" => steady_step(plant),
        "loss_riccati" => plant.loss().unwrap(),
        "dymbo_true_mse" => chain::dymbo_mse(&DymboFilter::new(plant)).unwrap(),
        "loss_true" => chain::true_loss(&plant).unwrap(),
        _ => return None,
    }])
}

fn loss_entry(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let at = |a: f64, gamma: f64| ScalarPlant::new(a, gamma, 1.0).unwrap();
    let value = match entry.id.strip_prefix("loss.")? {
        "max_unit_square" => at(1.0, 1.0).loss(),
        "gamma_at_2_a1" => return contours::noise_ratio_at_loss(2.0, 1.0).unwrap().map(|g| vec![g]),
        "gamma_at_2_a0.9" => return contours::noise_ratio_at_loss(2.0, 0.9).unwrap().map(|g| vec![g]),
        "gamma_at_2_a0" => return contours::noise_ratio_at_loss(2.0, 0.0).unwrap().map(|g| vec![g]),
        "a_at_2_g1" => return contours::coefficient_at_loss(2.0, 1.0).unwrap().map(|a| vec![a]),
        // The approach to the limit is of first order in sqrt(gamma).
        "a1_gamma_to_0" => at(1.0, 1e-26).loss(),
        "true_gamma_at_2_a1" => return contours::noise_ratio_at_true_loss(2.0, 1.0).unwrap().map(|g| vec![g]),
        "true_a_at_2_g1" => return contours::coefficient_at_true_loss(2.0, 1.0).unwrap().map(|a| vec![a]),
        "static_parameter" => {
            let after = |c: f64| (0..entry.number("n") as usize).fold(1.0, |m, _| filtered_variance(m, 1.0, c));
            Ok(after(FRAC_2_PI) / after(1.0))
        }
        _ => return None,
    };
    Some(vec![value.unwrap()])
}

fn grid_entry(entry: &Entry<'_>, loss: bool) -> Vec<f64> {
    let gammas = entry.numbers("gamma");
    let over = |a: f64| {
        gammas.iter().map(move |gamma| {
            let plant = ScalarPlant::new(a, *gamma, 1.0).unwrap();
            if loss {
                plant.loss().unwrap()
            } else {
                plant.steady_state(1.0).unwrap().filtered_variance
            }
        })
    };
    entry.numbers("a").into_iter().flat_map(over).collect()
}

fn fig5_entry(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let (plant, steps) = (entry.plant(), entry.number("N") as usize);
    if entry.ends("kf") {
        let mut belief = Gaussian::scalar(0.0, plant.measurement_variance()).unwrap();
        let mut variances = vec![belief.covariance()[0]];
        for _ in 0..steps {
            belief = kalman::step(plant.dynamics(), plant.sensor(), &belief, &[0.0].into())
                .unwrap()
                .0;
            variances.push(belief.covariance()[0]);
        }
        return Some(variances);
    }
    let transient = chain::first_message_transient(&plant, entry.number("tau"), entry.number("M00"), steps).unwrap();
    let pick = |step: &chain::TransientStep| {
        if entry.ends(".M") {
            step.filtered_variance
        } else {
            step.mse
        }
    };
    Some(transient.iter().map(pick).collect())
}

fn prop2_entry(entry: &Entry<'_>) -> Vec<f64> {
    let (sigma, tau) = (entry.number("sigma"), entry.number("tau"));
    let scheme = RoundedSample::new(sigma * sigma, tau).unwrap();
    let at = |theta: f64| first_message_mse(&scheme, &Gaussian::scalar(theta, 0.0).unwrap());
    if entry.inputs["theta"].is_null() {
        let tight = scheme.belief(Multiple(0)).unwrap().covariance()[0];
        vec![at(0.5 * tau), tight, (sigma + 0.5 * tau).powi(2)]
    } else {
        vec![at(entry.number("theta"))]
    }
}

fn sensors_entry(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let (plant, k) = (entry.plant(), entry.number("K") as usize);
    Some(match entry.id.rsplit('.').next()? {
        "seq" => vec![
            fewbits_dymbo::steady::sequential_steady_state(&plant, k)
                .unwrap()
                .filtered_variance,
        ],
        "par" => {
            let (mse, riccati) =
                chain::parallel_mse(&ParallelFilter::new(plant, k, CountFusion::Linear).unwrap()).unwrap();
            vec![riccati, mse]
        }
        "kf" => {
            let (a, q, r) = (plant.coefficient(), plant.process_variance(), plant.measurement_variance());
            let together = ScalarPlant::new(a, q, r / k as f64).unwrap();
            vec![together.steady_state(1.0).unwrap().filtered_variance]
        }
        _ => return None,
    })
}

fn regress_entry(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let plant = entry.plant();
    let x = entry.numbers("x");
    let part = entry.id.rsplit('.').next()?;
    if part == "kf" {
        let mut belief = Gaussian::scalar(x[0], plant.measurement_variance()).unwrap();
        let mut means = vec![x[0]];
        for sample in &x[1..] {
            belief = kalman::step(plant.dynamics(), plant.sensor(), &belief, &[*sample].into())
                .unwrap()
                .0;
            means.push(belief.mean()[0]);
        }
        return Some(means);
    }
    // Equation (14) as printed: the threshold is the previous estimate; the update stays exact.
    let printed = part.starts_with("eq14");
    let (filter, r) = (DymboFilter::new(plant), plant.measurement_variance());
    let scheme = RoundedSample::new(r, entry.number("tau")).unwrap();
    let message = scheme.round(x[0]).unwrap();
    let mut belief = scheme.belief(message).unwrap();
    let first = scheme
        .factor(&(), &Observation::Received(message), &Link::PERFECT)
        .unwrap();
    let exact = TransitionKernel::new(plant.dynamics(), UniformGrid::symmetric(16.0, 0.05).unwrap()).unwrap();
    let mut density = PointMass::new(*exact.grid(), |theta| first.log_likelihood(&[theta].into())).unwrap();
    let (mut bits, mut means, mut exact_moments) = (vec![], vec![belief.mean()[0]], vec![]);
    for sample in &x[1..] {
        let threshold = if printed {
            belief.mean()[0]
        } else {
            filter.threshold(&belief)
        };
        let bit = Sign::of(*sample, threshold).unwrap();
        let factor = Levels::sign(bit, threshold, r, &Link::PERFECT).unwrap();
        belief = if printed {
            let predicted = filter.predict(&belief);
            assumed_density::update(&predicted, &[[1.0]].into(), &factor).unwrap().0
        } else {
            filter.step(&belief, &Observation::Received(bit)).unwrap().0
        };
        bits.push(bit.value());
        means.push(belief.mean()[0]);
        if part.starts_with("exact") {
            density = exact.predict(&density).unwrap();
            density.update_with(|theta| factor.log_probability(theta)).unwrap();
            exact_moments.push((density.mean(), density.variance()));
        }
    }
    Some(match part {
        "bits" | "eq14_bits" => bits,
        "theta" | "eq14_theta" => means,
        "eq14_Mlast" => vec![belief.covariance()[0]],
        "exact_mean" => exact_moments.iter().map(|m| m.0).collect(),
        "exact_var" => exact_moments.iter().map(|m| m.1).collect(),
        _ => return None,
    })
}

fn vector_entry(entry: &Entry<'_>) -> Option<Vec<f64>> {
    let row_major = |name: &str| Matrix2::from_row_slice(&entry.numbers(name));
    let dynamics = LinearGaussian::with_covariance(row_major("A"), row_major("Q")).unwrap();
    let noise = entry.number("sigma2");
    let h = entry.numbers("H");
    let sensor = |i: usize| ScalarSensor::scalar(Vector2::new(h[2 * i], h[2 * i + 1]), noise).unwrap();
    let covariance = match h.len() / 2 {
        1 => vector_covariance(entry, dynamics, [sensor(0)]),
        3 => vector_covariance(entry, dynamics, [sensor(0), sensor(1), sensor(2)]),
        _ => return None,
    }?;
    Some(covariance.transpose().as_slice().to_vec())
}

fn vector_covariance<const M: usize>(
    entry: &Entry<'_>,
    dynamics: LinearGaussian<2, 2>,
    sensors: [ScalarSensor<2>; M],
) -> Option<Matrix2<f64>> {
    let filter = SignFilter::new(dynamics, sensors);
    Some(if entry.ends("seq.P") {
        filter.sequential_steady_state().unwrap().filtered_covariance
    } else if entry.ends("lm.P") {
        filter.parallel_steady_state().unwrap().filtered_covariance
    } else if entry.ends("kf.P") {
        let rows = sensors.map(|s| s.direction());
        let matrix = nalgebra::SMatrix::<f64, M, 2>::from_fn(|i, j| rows[i][j]);
        let noise = nalgebra::SMatrix::<f64, M, M>::identity() * entry.number("sigma2");
        let sensing = LinearSensor::new(matrix, noise).unwrap();
        steady_state(&dynamics, &sensing).unwrap().filtered_covariance
    } else {
        return None;
    })
}
