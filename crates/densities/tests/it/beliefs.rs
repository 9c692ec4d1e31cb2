//! The laws of beliefs, on every density of this crate; marginals; ellipses.

use crate::common::{crescent, d1, random_mixture};
use fewbits_core::{Belief, Density, Gaussian, laws};
use fewbits_densities::{Component, KernelEstimate, Mixture, PointMass, UniformGrid, ellipse};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2};

fn obeys_the_laws<const D: usize>(belief: &impl Density<D>, seed: u64) {
    let mut rng = Stream::new(seed).rng();
    laws::belief::samples_have_the_moments(belief, &mut rng, 100_000).unwrap();
    let wide = Gaussian::new(belief.mean(), belief.covariance() * 2.5)
        .unwrap()
        .factored()
        .unwrap();
    laws::belief::density_integrates_to_one(belief, &wide, &mut rng, 20_000).unwrap();
}

#[test]
fn mixtures_and_estimates_are_beliefs() {
    let mut rng = Stream::new(5).rng();
    obeys_the_laws(&random_mixture::<1, _>(&mut rng, 4, 1.0), 1);
    obeys_the_laws(&random_mixture::<2, _>(&mut rng, 7, 1e4), 2);
    obeys_the_laws(&random_mixture::<3, _>(&mut rng, 3, 1e-4), 3);
    obeys_the_laws(&random_mixture::<4, _>(&mut rng, 1, 1.0), 4);
    obeys_the_laws(&d1(), 5);
    obeys_the_laws(&crescent(1, 100, 1e-4), 6);
    laws::belief::samples_have_the_moments(crescent(1, 100, 1.0).particles(), &mut rng, 100_000).unwrap();
}

/// Largest gap between an empirical distribution and a distribution function, times the square root of the sample's size.
fn kolmogorov(mut sample: Vec<f64>, cdf: impl Fn(f64) -> f64) -> f64 {
    sample.sort_by(f64::total_cmp);
    let n = sample.len() as f64;
    let gap = |(i, x): (usize, &f64)| {
        let p = cdf(*x);
        (p - i as f64 / n).abs().max(((i + 1) as f64 / n - p).abs())
    };
    n.sqrt() * sample.iter().enumerate().map(gap).fold(0.0, f64::max)
}

/// The marginal density of some coordinates.
fn coordinates<const D: usize, const K: usize>(belief: &Mixture<D>, axes: [usize; K]) -> Mixture<K> {
    let chosen = SMatrix::from_fn(|i, j| f64::from(u8::from(axes[i] == j)));
    belief.affine(&chosen, &SVector::zeros()).unwrap()
}

#[test]
fn samples_pass_kolmogorovs_test_in_every_marginal() {
    let mut rng = Stream::new(8).rng();
    let belief = random_mixture::<3, _>(&mut rng, 5, 1.0);
    let draws: Vec<SVector<f64, 3>> = (0..20_000).map(|_| belief.sample(&mut rng)).collect();
    for axis in 0..3 {
        let marginal = coordinates(&belief, [axis]);
        let statistic = kolmogorov(draws.iter().map(|x| x[axis]).collect(), |x| marginal.cdf(x));
        // Exceeded with probability 1e-4.
        assert!(statistic < 2.23, "axis {axis}: {statistic}");
    }
    let estimate = crescent(3, 60, 1.0);
    let mixture = coordinates(&estimate.to_mixture().unwrap(), [1]);
    let sample = estimate.sample_systematic(&mut rng, 20_000).unwrap();
    assert!(kolmogorov(sample.columns()[1].to_vec(), |x| mixture.cdf(x)) < 2.23);
}

#[test]
fn an_estimate_is_its_mixture() {
    let estimate = crescent(2, 80, 1.0);
    let mixture = estimate.to_mixture().unwrap();
    assert!((estimate.mean() - mixture.mean()).amax() < 1e-13);
    assert!((estimate.covariance() - mixture.covariance()).amax() < 1e-13);
    let points = [vec![0.3, -5.0, 100.0, 1e6], vec![1.2, 4.0, -70.0, 1e6]];
    let columns = [points[0].as_slice(), points[1].as_slice()];
    let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
    estimate.log_pdf_columns(columns, &mut a);
    mixture.log_pdf_columns(columns, &mut b);
    for k in 0..4 {
        assert!((a[k] - b[k]).abs() < 1e-10 * a[k].abs().max(1.0), "{} {}", a[k], b[k]);
        let x = SVector::from([points[0][k], points[1][k]]);
        assert!((mixture.log_pdf(&x) - b[k]).abs() < 1e-12 * b[k].abs().max(1.0));
    }
    let at_centres = estimate.log_pdf_at_centres();
    let mut direct = vec![0.0; estimate.len()];
    estimate.log_pdf_columns(estimate.particles().columns(), &mut direct);
    assert!(at_centres.iter().zip(&direct).all(|(a, b)| (a - b).abs() < 1e-12));
}

/// A centre of weight zero far from all others, where the plain sum of kernels is zero.
#[test]
fn log_density_at_centres_is_exact_in_the_tails() {
    let particles = fewbits_densities::Particles::new(
        [vec![0.0, 0.5, 1000.0, 40.0], vec![0.0, 0.2, 0.0, 3.0]],
        &[0.0, -1.0, f64::NEG_INFINITY, f64::NEG_INFINITY],
    )
    .unwrap();
    let estimate = KernelEstimate::new(particles, Matrix2::identity()).unwrap();
    let at_centres = estimate.log_pdf_at_centres();
    for (i, log) in at_centres.iter().enumerate() {
        let [x, y] = estimate.particles().columns();
        let direct = estimate.log_pdf(&Vector2::new(x[i], y[i]));
        assert!((log - direct).abs() < 1e-12 * direct.abs().max(1.0), "{i}: {log} {direct}");
    }
    assert!(at_centres[2] < -499_000.0, "{}", at_centres[2]);
}

/// Sums over kernels run in lanes, blocks and pairs: every remainder, against the plain sum.
#[test]
fn estimates_of_every_size_are_plain_sums() {
    for n in [1, 2, 7, 8, 9, 16, 17, 31, 32, 33, 40, 41, 49, 75, 101] {
        let x: Vec<f64> = (0..n)
            .map(|i| (1.3 * f64::from(i)).sin() + 0.02 * f64::from(i))
            .collect();
        let y: Vec<f64> = (0..n).map(|i| (0.7 * f64::from(i)).cos() * 2.0).collect();
        let logs: Vec<f64> = (0..n).map(|i| (2.1 * f64::from(i)).sin()).collect();
        let total: f64 = logs.iter().map(|l| l.exp()).sum();
        let kernel = Matrix2::new(0.09, 0.02, 0.02, 0.04);
        let normal = Gaussian::new(Vector2::zeros(), kernel).unwrap().factored().unwrap();
        let plain = |a: f64, b: f64| {
            let terms = (0..n as usize)
                .map(|i| logs[i].exp() / total * normal.log_pdf(&Vector2::new(a - x[i], b - y[i])).exp());
            terms.sum::<f64>().ln()
        };
        let particles = fewbits_densities::Particles::new([x.clone(), y.clone()], &logs).unwrap();
        let estimate = KernelEstimate::new(particles, kernel).unwrap();
        let close = |found: f64, exact: f64| assert!((found - exact).abs() < 1e-11, "{n}: {found} {exact}");
        let at_centres = estimate.log_pdf_at_centres();
        assert_eq!((at_centres.len(), estimate.len()), (n as usize, n as usize));
        at_centres
            .iter()
            .enumerate()
            .for_each(|(i, log)| close(*log, plain(x[i], y[i])));
        let points = [0.3, -0.8, 1.1, 0.0, 0.6];
        for count in 0..=5 {
            let mut out = vec![0.0; count];
            estimate.log_pdf_columns([&points[..count], &points[..count]], &mut out);
            out.iter().zip(points).for_each(|(log, p)| close(*log, plain(p, p)));
        }
        close(estimate.log_pdf(&Vector2::new(0.4, -0.2)), plain(0.4, -0.2));
    }
}

#[test]
fn densities_stay_numbers_everywhere() {
    let mixture = d1().to_mixture().unwrap();
    let far = [
        vec![0.0, 1e160, 1e300, -1e200, f64::MAX],
        vec![0.0, 1e160, 0.0, 1e300, f64::MAX],
    ];
    let columns = [far[0].as_slice(), far[1].as_slice()];
    let mut logs = [0.0; 5];
    mixture.log_pdf_columns(columns, &mut logs);
    assert!(logs.iter().all(|l| !l.is_nan()) && logs[0].is_finite(), "{logs:?}");
    d1().log_pdf_columns(columns, &mut logs);
    assert!(logs.iter().all(|l| !l.is_nan()) && logs[0].is_finite(), "{logs:?}");
    for k in 0..5 {
        assert!(!mixture.log_pdf(&SVector::from([far[0][k], far[1][k]])).is_nan());
    }
}

#[test]
fn marginals_and_affine_images_have_the_moments_they_must() {
    let mut rng = Stream::new(9).rng();
    let belief = random_mixture::<4, _>(&mut rng, 3, 1.0);
    let marginal = coordinates(&belief, [2, 0]);
    assert!((marginal.mean()[0] - belief.mean()[2]).abs() < 1e-14);
    assert!((marginal.covariance()[(0, 1)] - belief.covariance()[(2, 0)]).abs() < 1e-13);
    let image = belief
        .affine(&SMatrix::<f64, 1, 4>::from([[1.0], [2.0], [0.0], [-1.0]]), &Vector1::new(3.0))
        .unwrap();
    let m = belief.mean();
    assert!((image.mean()[0] - (m[0] + 2.0 * m[1] - m[3] + 3.0)).abs() < 1e-13);
}

#[test]
fn components_give_back_what_they_were_made_of() {
    let covariance = Matrix2::new(2.0, 0.3, 0.3, 0.7);
    let c = Component::new(1.7, Vector2::new(0.4, -2.0), covariance).unwrap();
    assert_eq!((c.weight(), *c.mean(), *c.covariance()), (1.7, Vector2::new(0.4, -2.0), covariance));
    assert_eq!((c.gaussian().mean(), c.gaussian().covariance()), (c.mean(), c.covariance()));
    assert!((c.factor().lower * c.factor().lower.transpose() - covariance).amax() < 1e-15);
    assert!((2.0 * c.factor().half_log_det - (1.4_f64 - 0.09).ln()).abs() < 1e-14);
    let x = Vector2::new(1.1, -0.8);
    let exact = Gaussian::new(*c.mean(), covariance)
        .unwrap()
        .factored()
        .unwrap()
        .log_pdf(&x);
    assert!((c.log_pdf(&x) - exact).abs() < 1e-13);
    let single = Mixture::single(&c.gaussian()).unwrap();
    assert_eq!((single.len(), single.components()[0].weight()), (1, 1.0));
    assert_eq!(single.moment_matched(), c.gaussian());
}

#[test]
fn densities_of_mixtures_are_sums_of_normals() {
    let at = |w, x: f64, s: f64| Component::new(w, Vector1::new(x), Matrix1::new(s * s)).unwrap();
    let belief = Mixture::new(vec![
        at(0.2, -1.0, 0.5),
        at(0.0, 0.1, 1.0),
        at(0.5, 0.3, 2.0),
        at(0.3, 1.7, 0.4),
    ])
    .unwrap();
    for x in [-1.3, 0.4, 2.9] {
        let normal = |c: &Component<1>| {
            let v = c.covariance()[0];
            c.weight() * (-0.5 * (x - c.mean()[0]).powi(2) / v).exp() / (std::f64::consts::TAU * v).sqrt()
        };
        let total: f64 = belief.components().iter().map(normal).sum();
        assert!((belief.log_pdf(&Vector1::new(x)) - total.ln()).abs() < 1e-13);
    }
    // A component that is nothing, before one that is something.
    let mixed = Mixture::new(vec![at(0.5, 0.0, 1e-150), at(0.5, 0.0, 1e10)]).unwrap();
    let exact = -0.5 - (2.0 * 1e10 * std::f64::consts::TAU.sqrt()).ln();
    let mut column = [0.0];
    mixed.log_pdf_columns([&[1e10]], &mut column);
    assert!((mixed.log_pdf(&Vector1::new(1e10)) - exact).abs() < 1e-12 && (column[0] - exact).abs() < 1e-12);
}

/// Systematic draws take `n w` of each where that is a whole number, whatever the offset, and one more or less elsewhere.
#[test]
fn systematic_draws_are_shared_out_to_the_last_one() {
    let mut rng = Stream::new(14).rng();
    let (weights, n) = ([0.25, 0.0, 0.5, 0.125, 0.125], 40);
    let lobe = |k: usize| Component::new(weights[k], Vector1::new(100.0 * k as f64), Matrix1::new(1.0)).unwrap();
    let mixture = Mixture::new((0..5).map(lobe).collect()).unwrap();
    let particles =
        fewbits_densities::Particles::new([(0..5).map(|k| 100.0 * f64::from(k)).collect()], &weights.map(f64::ln))
            .unwrap();
    let estimate = KernelEstimate::new(particles, Matrix1::new(1.0)).unwrap();
    let count = |draws: &fewbits_densities::Particles<1>, k: usize| {
        let near = |x: &&f64| (**x - 100.0 * k as f64).abs() < 10.0;
        draws.columns()[0].iter().filter(near).count()
    };
    for _ in 0..20 {
        for draws in [
            mixture.sample_systematic(&mut rng, n).unwrap(),
            estimate.sample_systematic(&mut rng, n).unwrap(),
        ] {
            assert_eq!([0, 1, 2, 3, 4].map(|k| count(&draws, k)), [10, 0, 20, 5, 5]);
        }
        for draws in [
            mixture.sample_systematic(&mut rng, 13).unwrap(),
            estimate.sample_systematic(&mut rng, 13).unwrap(),
        ] {
            let off = |k: usize| (count(&draws, k) as f64 - 13.0 * weights[k]).abs();
            assert!(draws.len() == 13 && (0..5).all(|k| off(k) < 1.0));
        }
    }
    assert!(mixture.sample_systematic(&mut rng, 0).is_err() && estimate.sample_systematic(&mut rng, 0).is_err());
}

#[test]
fn an_ellipse_is_evenly_spread_around_its_gaussian() {
    let gaussian = *d1().to_mixture().unwrap().moment_matched().mean();
    let normal = Gaussian::new(gaussian, d1().covariance()).unwrap();
    let outline = ellipse(&normal, 0.5, 16).unwrap();
    // Evenly spread in whitened coordinates, once around, anticlockwise.
    let whitener = nalgebra::Cholesky::new(*normal.covariance())
        .unwrap()
        .l()
        .try_inverse()
        .unwrap();
    let angle = |x: [f64; 2]| {
        (whitener * (SVector::from(x) - normal.mean()))
            .yx()
            .iter()
            .copied()
            .reduce(f64::atan2)
            .unwrap()
    };
    assert_eq!(outline.len(), 16);
    for k in 0..16 {
        let turn = (angle(outline[(k + 1) % 16]) - angle(outline[k])).rem_euclid(std::f64::consts::TAU);
        assert!((turn - std::f64::consts::TAU / 16.0).abs() < 1e-12, "{turn}");
    }
    for x in outline {
        let half_squared = normal.normalised_error_squared(&SVector::from(x)).unwrap();
        assert!((half_squared - 2.0_f64.ln()).abs() < 5e-13);
    }
}

#[test]
fn storage_keeps_every_bit_and_checks() {
    let mut rng = Stream::new(13).rng();
    let belief = random_mixture::<2, _>(&mut rng, 3, 1.0);
    let text = serde_json::to_string(&belief).unwrap();
    assert_eq!(serde_json::from_str::<Mixture<2>>(&text).unwrap(), belief);
    assert!(serde_json::from_str::<Mixture<3>>(&text).is_err());
    assert!(
        serde_json::from_str::<Mixture<1>>(r#"{"weights":[-1.0],"means":[[0.0]],"covariances":[[[1.0]]]}"#).is_err()
    );
    let estimate = d1();
    // Rows too few, too short, too many; means of another dimension.
    for (means, covariances) in [
        ("[[0.0,0.0]]", "[[[1.0,0.0]]]"),
        ("[[0.0,0.0]]", "[[[1.0,0.0],[0.0]]]"),
        ("[[0.0,0.0]]", "[[[1.0,0.0],[0.0,1.0],[0.0,0.0]]]"),
        ("[[0.0]]", "[[[1.0,0.0],[0.0,1.0]]]"),
        ("[]", "[[[1.0,0.0],[0.0,1.0]]]"),
    ] {
        let text = format!(r#"{{"weights":[1.0],"means":{means},"covariances":{covariances}}}"#);
        let error = serde_json::from_str::<Mixture<2>>(&text).unwrap_err().to_string();
        assert!(error.contains("of another length") || error.contains("`means`"), "{error}");
    }
    let text = serde_json::to_string(&estimate).unwrap();
    let restored: KernelEstimate<2> = serde_json::from_str(&text).unwrap();
    assert!((restored.mean() - estimate.mean()).amax() < 1e-14 && restored.kernel() == estimate.kernel());
}

#[test]
fn bad_mixtures_are_refused_by_name() {
    let new = |w, m, v| {
        Component::new(w, Vector1::new(m), Matrix1::new(v))
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    assert!(new(-1.0, 0.0, 1.0).contains("weight"));
    assert!(new(1.0, f64::INFINITY, 1.0).contains("mean"));
    assert!(new(1.0, 0.0, 0.0).contains("covariance"));
    let zero = Component::new(0.0, Vector1::new(0.0), Matrix1::new(1.0)).unwrap();
    assert!(Mixture::new(vec![zero]).is_err() && Mixture::<1>::new(vec![]).is_err());
}

#[test]
fn a_grid_holds_the_density_at_its_nodes() {
    let belief = PointMass::normal(UniformGrid::symmetric(8.0, 0.1).unwrap(), 0.3, 1.5).unwrap();
    assert_eq!(belief.density().len(), belief.grid().nodes().count());
    for (x, density) in belief.grid().nodes().zip(belief.density()) {
        let exact = (-0.5 * (x - 0.3_f64).powi(2) / 1.5).exp() / (std::f64::consts::TAU * 1.5).sqrt();
        assert!((density - exact).abs() < 1e-6, "{density} against {exact} at {x}");
    }
}
