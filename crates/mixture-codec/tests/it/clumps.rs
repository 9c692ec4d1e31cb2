//! Clumps and the mixtures fitted to them.

use fewbits_core::Belief;
use fewbits_mixture_codec::{Clumps, MixtureFit};
use fewbits_numerics::eigen::symmetric_eigen;
use nalgebra::{SMatrix, SVector};

fn two_lobes() -> ([Vec<f64>; 2], Vec<f64>) {
    let (mut x, mut y, mut w) = (Vec::new(), Vec::new(), Vec::new());
    for (mx, my, mass) in [(0.0_f64, 0.0_f64, 0.3), (10.0, 2.0, 0.7)] {
        for i in -20_i32..=20 {
            for j in -20_i32..=20 {
                let (a, b) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
                x.push(mx + a);
                y.push(my + b);
                w.push(mass * (-0.5 * (a * a + b * b)).exp());
            }
        }
    }
    ([x, y], w)
}

#[test]
fn two_lobes_are_found_and_moments_kept() {
    let (columns, weights) = two_lobes();
    let view = columns.each_ref().map(Vec::as_slice);
    let clumps = Clumps::new(&view, &[&[], &[]], &weights, 200).unwrap();
    let whole = Clumps::new(&view, &[&[], &[]], &weights, 1).unwrap();
    assert!((clumps.gaussian().mean() - whole.gaussian().mean()).amax() < 1e-12);
    assert!((clumps.gaussian().covariance() - whole.gaussian().covariance()).amax() < 1e-11);
    let mixture = clumps.fit(&MixtureFit::new(2).unwrap()).unwrap();
    let mut means: Vec<f64> = mixture.components().iter().map(|c| c.mean()[0]).collect();
    means.sort_by(f64::total_cmp);
    assert!((means[0]).abs() < 0.02 && (means[1] - 10.0).abs() < 0.02, "{means:?}");
    assert!(
        mixture
            .components()
            .iter()
            .all(|c| (c.covariance()[(0, 0)] - 1.0).abs() < 0.02)
    );
    // The step floor only adds 1e-9 of the spread.
    assert!((mixture.covariance() - whole.gaussian().covariance()).amax() < 1e-6);
}

#[test]
fn spread_goes_into_the_covariance() {
    let clumps = Clumps::new(&[&[0.0, 1.0]], &[&[2.0, 4.0]], &[1.0, 1.0], 8).unwrap();
    assert_eq!(clumps.gaussian().covariance()[0], 3.25);
    let clumps = Clumps::new(&[&[0.0, 1.0]], &[&[2.0, 4.0]], &[1.0, 3.0], 1).unwrap();
    assert!((clumps.gaussian().covariance()[0] - 3.0 / 16.0 - 3.5).abs() < 1e-15 && clumps.clumps().len() == 1);
    assert!(Clumps::<1>::new(&[&[0.0, 1.0]], &[&[1.0]], &[1.0, 1.0], 3).is_err());
    assert!(Clumps::<1>::new(&[&[0.0, 1.0]], &[&[]], &[1.0, -1.0], 3).is_err());
    assert!(Clumps::<1>::new(&[&[0.0]], &[&[]], &[0.0], 3).is_err());
    assert!(Clumps::<1>::new(&[&[0.0]], &[&[]], &[1.0, 1.0], 3).is_err());
}

/// Two loose pairs and a heavier tight one, in coordinates of very different units, with a point of no weight.
#[test]
fn what_spreads_most_is_cut_at_its_mean() {
    let x = [0.0, 4.0, 100.0, 103.0, 50.0, 0.0, 0.0];
    let y = [3e6, 3e6, 3e6, 3e6, 9e9, -3e6, -3e6];
    let weights = [1.0, 1.0, 5.0, 5.0, 0.0, 2.0, 3.0];
    let means = |count| {
        let clumps = Clumps::new(&[&x, &y], &[&[], &[]], &weights, count).unwrap();
        let whole = Clumps::new(&[&x, &y], &[&[], &[]], &weights, 1).unwrap();
        assert!(
            (clumps.gaussian().mean() - whole.gaussian().mean())
                .component_div(&SVector::from([1.0, 1e6]))
                .amax()
                < 1e-12
        );
        let gap = (clumps.gaussian().covariance() - whole.gaussian().covariance())
            .component_div(&SMatrix::from([[1.0, 1e6], [1e6, 1e12]]));
        assert!(gap.amax() < 1e-10);
        let mut means: Vec<_> = clumps
            .clumps()
            .iter()
            .map(|c| (c.mean.x, c.mean.y, c.weight * 17.0))
            .collect();
        means.sort_by(|a, b| a.partial_cmp(b).unwrap());
        means
    };
    let near = |found: Vec<(f64, f64, f64)>, exact: &[(f64, f64, f64)]| {
        assert_eq!(found.len(), exact.len(), "{found:?}");
        for (a, b) in found.iter().zip(exact) {
            assert!((a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-3 && (a.2 - b.2).abs() < 1e-12, "{found:?}");
        }
    };
    let (low, left, right) = ((0.0, -3e6, 5.0), (2.0, 3e6, 2.0), (101.5, 3e6, 10.0));
    near(means(2), &[(4.0 / 7.0, -9e6 / 7.0, 7.0), right]);
    near(means(3), &[low, left, right]);
    near(means(4), &[low, left, (100.0, 3e6, 5.0), (103.0, 3e6, 5.0)]);
    let all = [
        low,
        (0.0, 3e6, 1.0),
        (4.0, 3e6, 1.0),
        (100.0, 3e6, 5.0),
        (103.0, 3e6, 5.0),
    ];
    near(means(5), &all);
    // Equal points stay together.
    near(means(6), &all);
}

#[test]
fn components_are_no_narrower_than_what_the_points_resolve() {
    // Cells of side one under a Gaussian of deviation one: as many clumps as cells, and a component could shrink onto one.
    let (mut x, mut y, mut weights) = (Vec::new(), Vec::new(), Vec::new());
    for i in -5..=5 {
        for j in -5..=5 {
            let (a, b) = (f64::from(i), f64::from(j));
            x.push(a);
            y.push(b);
            weights.push((-0.5 * (a * a + b * b)).exp() / std::f64::consts::TAU);
        }
    }
    let least = 0.25;
    let clumps = Clumps::new(&[&x, &y], &[&[], &[]], &weights, 200).unwrap();
    let clumps = clumps.with_min_variances(SVector::from([least; 2])).unwrap();
    let fit = clumps.fit(&MixtureFit::new(8).unwrap()).unwrap();
    for c in fit.components() {
        let (values, _) = symmetric_eigen(*c.covariance());
        assert!(values.iter().all(|v| *v > least * (1.0 - 1e-9)), "{values:?}");
    }
    let kl: f64 = (0..weights.len())
        .map(|i| weights[i] * (weights[i].ln() - fit.log_pdf(&SVector::from([x[i], y[i]]))))
        .sum();
    // Sums over cells of a Gaussian this narrow are up to 3 per cent above one.
    assert!(kl > -0.03, "{kl}");
    let bad = Clumps::<1>::new(&[&[0.0, 1.0]], &[&[]], &[1.0, 1.0], 3).unwrap();
    assert!(bad.with_min_variances(SVector::from([-1.0])).is_err());
}
