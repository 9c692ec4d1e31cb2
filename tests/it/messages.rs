//! Particle message passing in closed form: rings, kernels, weights, and how fast the labels of a product of mixtures mix. References:
//! `mpa-ring/...`, `mpa-gibbs/...`.

use crate::references::{agree, numbers};
use fewbits::core::Belief;
use fewbits::densities::{Component, Mixture};
use fewbits::monte_carlo::{Moments, Stream};
use fewbits_baselines::pf_mpa::{LabelChain, ProductSampler, RingBias, kernel_error, product, ratio_second_moments};
use nalgebra::{Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2};

/// Erratum `mpa-3`.
#[test]
fn rings_have_larger_radii_than_printed() {
    let ring = |lower: f64, upper: f64, deviation: f64| {
        let ring = RingBias::new(lower, upper, deviation).unwrap();
        assert!(ring.exact > ring.printed, "{lower} to {upper}");
        ring
    };
    let named = |row: &str| match row {
        "9-10.5" => ring(9.0, 10.5, 0.03),
        "1-2.5" => ring(1.0, 2.5, 0.005),
        "0.2-1.7" => ring(0.2, 1.7, 0.003),
        "4-5" => ring(4.0, 5.0, 0.3),
        _ => panic!("{row}"),
    };
    agree("mpa-ring", "printed", "", |row| named(row).printed);
    agree("mpa-ring", "exact", "", |row| named(row).exact);
    agree("mpa-ring", "tv", "", |row| named(row).total_variation);
    for lower in (0..24).map(|i| 0.25 * f64::from(i) + 0.1) {
        ring(lower, lower + 1.5, 0.01);
    }
}

/// Erratum `mpa-5`.
#[test]
fn printed_kernels_are_worse_from_forty_points_on() {
    // Integrated squared errors with the printed factor of the variance and with Silverman's.
    let errors = |row: &str| {
        let [points, dimensions] = numbers(row)[..] else {
            panic!("{row}");
        };
        let silverman = (4.0 / ((dimensions + 2.0) * points)).powf(2.0 / (dimensions + 4.0));
        let errors = [points.powf(-1.0 / 6.0), silverman].map(|factor| kernel_error(points, dimensions as u32, factor));
        assert!(points < 40.0 || errors[1] < errors[0], "{row}");
        errors
    };
    agree("mpa-ring", "kernel-printed", "", |row| errors(row)[0]);
    agree("mpa-ring", "kernel-silverman", "", |row| errors(row)[1]);
    for points in [100, 500, 4000] {
        errors(&format!("N{points}-d2"));
    }
}

/// Erratum `mpa-4`.
#[test]
fn printed_weights_have_large_second_moments() {
    agree("mpa-ring", "weights", "", |row| {
        let (components, spacing) = row.split_once('x').unwrap();
        let spacing: f64 = spacing.parse().unwrap();
        let means: Vec<f64> = (0..components.parse().unwrap())
            .map(|i: u32| spacing * f64::from(i))
            .collect();
        ratio_second_moments(&means, 1.0).0
    });
}

fn mixture<const D: usize>(means: &[SVector<f64, D>], covariance: SMatrix<f64, D, D>, weights: &[f64]) -> Mixture<D> {
    let components = means.iter().zip(weights);
    let components = components.map(|(m, w)| Component::new(*w, *m, covariance).unwrap());
    Mixture::new(components.collect()).unwrap()
}

fn line(means: &[f64], variance: f64, weights: &[f64]) -> Mixture<1> {
    let means: Vec<_> = means.iter().map(|m| Vector1::new(*m)).collect();
    mixture(&means, Matrix1::new(variance), weights)
}

/// Moderately overlapping.
fn case_a() -> Vec<Mixture<1>> {
    vec![
        line(&[0.0, 1.0, 2.5], 0.25, &[0.2, 0.5, 0.3]),
        line(&[0.5, 1.5, 3.0], 0.36, &[0.3, 0.3, 0.4]),
        line(&[0.2, 1.1, 2.0], 0.5, &[0.6, 0.3, 0.1]),
    ]
}

/// Two separated modes.
fn case_b() -> Vec<Mixture<1>> {
    vec![line(&[0.0, 4.0], 0.25, &[0.5, 0.5]); 2]
}

/// Moderately overlapping, in the plane.
fn case_c() -> Vec<Mixture<2>> {
    let v = Vector2::new;
    vec![
        mixture(&[v(0.0, 0.0), v(1.0, 0.5), v(2.0, 1.0)], Matrix2::new(0.3, 0.1, 0.1, 0.2), &[0.4, 0.4, 0.2]),
        mixture(&[v(0.3, 0.2), v(1.2, 0.2), v(1.5, 1.5)], Matrix2::new(0.5, -0.1, -0.1, 0.4), &[0.2, 0.5, 0.3]),
    ]
}

/// Compares the references of a case, draws from its sampler after five sweeps, and returns by how much the mean of a draw is off:
/// exactly, and of the draws.
fn mixing<const D: usize>(case: &str, factors: &[Mixture<D>]) -> [SVector<f64, D>; 2] {
    const SWEEPS: usize = 5;
    let factors: Vec<&Mixture<D>> = factors.iter().collect();
    let (chain, exact) = (LabelChain::new(&factors).unwrap(), product::exact(&factors).unwrap());
    let mean = exact.belief.mean();
    agree("mpa-gibbs", "tv", case, |row| chain.total_variation(numbers(row)[0] as usize));
    agree("mpa-gibbs", "mean", case, |row| mean[numbers(row)[0] as usize]);
    agree("mpa-gibbs", "log-mass", case, |_| exact.log_normaliser);
    agree("mpa-gibbs", "eigenvalue", case, |_| chain.second_eigenvalue());
    let bias = SVector::from_vec(chain.bias(SWEEPS));
    let mut rng = Stream::new(1).named("mpa-gibbs").named(case).fast_rng();
    let drawn = ProductSampler::Gibbs { sweeps: SWEEPS }
        .sample(&mut rng, &factors, 400_000)
        .unwrap();
    let mut off = SVector::zeros();
    for (axis, column) in drawn.columns().into_iter().enumerate() {
        let moments: Moments = column.iter().copied().collect();
        off[axis] = moments.mean() - mean[axis];
        assert!((off[axis] - bias[axis]).abs() < 4.0 * moments.standard_error(), "{case}, axis {axis}");
    }
    [bias, off]
}

#[test]
fn five_sweeps_leave_a_bias_with_overlapping_mixtures() {
    // Beyond the 0.004 that was asked for; draws alone cannot show it.
    let [bias, _] = mixing("A", &case_a());
    assert!((bias[0] - 0.009_346).abs() < 1e-5, "{bias}");
}

#[test]
fn labels_do_not_move_between_separated_modes() {
    mixing("B", &case_b());
    let factors = case_b();
    let chain = LabelChain::new(&factors.iter().collect::<Vec<_>>()).unwrap();
    assert!(chain.second_eigenvalue() > 0.999_999);
}

#[test]
fn five_sweeps_suffice_for_overlapping_mixtures_in_the_plane() {
    let [_, off] = mixing("C", &case_c());
    assert!(off.amax() < 0.004, "{off}");
}
