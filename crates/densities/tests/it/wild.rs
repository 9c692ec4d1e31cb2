//! Wild arguments: beliefs are made of numbers or refused, answer numbers, and a failed step leaves them as they were.

use fewbits_core::Density;
use fewbits_core::laws::wild;
use fewbits_densities::{
    Bandwidth, Component, GaussianCloud, KernelEstimate, Mixture, Particles, PointMass, UniformGrid,
};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1x2, Matrix2, Vector1, Vector2};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}

/// What every belief must answer.
fn check(belief: &(impl Density<2> + std::fmt::Debug), at: [f64; 2]) {
    let log = belief.log_density(&at.into());
    assert!(!finite(&at) || !log.is_nan(), "{log} at {at:?}: {belief:?}");
    let mut logs = [0.0; 2];
    belief.add_log_densities(&[&[at[0]; 2], &[at[1]; 2]], &mut logs);
    assert!(!finite(&at) || logs.iter().all(|x| !x.is_nan()), "{logs:?} at {at:?}: {belief:?}");
    let (mut x, mut y) = ([0.0; 2], [0.0; 3]);
    belief.sample_columns(&mut Stream::new(1).rng(), [&mut x, &mut y]);
    assert!(x.iter().chain(&y).all(|x| x.is_nan()));
}

fn particles(x: &[f64]) -> Option<Particles<2>> {
    let columns = [x[..3].to_vec(), x[3..6].to_vec()];
    Particles::new(columns.clone(), &x[6..9])
        .or_else(|_| Particles::uniform(columns))
        .ok()
}

proptest! {
    #[test]
    fn particles_hold_numbers_and_survive_failed_steps(x in prop::array::uniform12(wild()), ancestors in prop::collection::vec(0..4_u32, 3)) {
        let Some(before) = particles(&x) else { return Ok(()) };
        prop_assert!((before.weights().iter().sum::<f64>() - 1.0).abs() < 1e-9 && before.effective_sample_size() <= 3.0 + 1e-9, "{:?}", before);
        let mut belief = before.clone();
        match belief.reweigh(|_, logs| logs.copy_from_slice(&x[9..12])) {
            Ok(log) => prop_assert!(log.is_finite() && finite(belief.weights()), "{:?}", belief),
            Err(_) => prop_assert_eq!(&belief, &before),
        }
        let mut belief = before.clone();
        if belief.select(&ancestors).is_err() {
            prop_assert_eq!(&belief, &before);
        }
    }

    #[test]
    fn mixtures_and_estimates_hold_numbers(x in prop::array::uniform12(wild()), count in 0..4_usize) {
        let covariance = Matrix2::new(x[0], x[1], x[1], x[2]);
        let parts: Vec<Component<2>> = [Component::new(x[3], Vector2::new(x[4], x[5]), covariance), Component::new(x[6], Vector2::new(x[7], x[8]), Matrix2::identity())].into_iter().flatten().collect();
        let mut rng = Stream::new(2).rng();
        if let Ok(mixture) = Mixture::new(parts) {
            check(&mixture, [x[9], x[10]]);
            let matched = mixture.moment_matched();
            let tame = x.iter().all(|x| x.abs() < 1e150);
            prop_assert!(!tame || matched.is_finite(), "{:?}: {:?}", mixture, matched);
            if let Ok(marginal) = mixture.affine(&Matrix1x2::new(0.0, 1.0), &Vector1::zeros()) {
                prop_assert!(!x[9].is_finite() || !marginal.cdf(x[9]).is_nan(), "{:?}", marginal);
            }
            let _ = (mixture.sample_systematic(&mut rng, count), mixture.affine(&covariance, &Vector2::new(x[9], x[10])));
        }
        let Some(cloud) = particles(&x) else { return Ok(()) };
        let bandwidth = Bandwidth { factor: x[9], floor: x[10], ..Bandwidth::default() };
        for estimate in [KernelEstimate::new(cloud.clone(), covariance), KernelEstimate::fit(cloud.clone(), &bandwidth)].into_iter().flatten() {
            check(&estimate, [x[9], x[11]]);
            prop_assert!(estimate.log_pdf_at_centres().iter().all(|log| !log.is_nan()), "{:?}", estimate);
        }
        if let Ok(cloud) = GaussianCloud::new(cloud.clone(), covariance) {
            let _ = cloud.gaussian();
        }
    }

    #[test]
    fn grids_hold_numbers_and_survive_failed_steps(x in prop::array::uniform8(wild())) {
        // The number of nodes is the width over the spacing; a grid of more than a few thousand is not the point here.
        let modest = (x[1] - x[0]).abs() < 2000.0 * x[2].abs();
        let grid = if modest { UniformGrid::new(x[0], x[1], x[2]).ok() } else { None }.unwrap_or(UniformGrid::symmetric(6.0, 0.25).unwrap());
        for before in [PointMass::new(grid, |t| -t * t * x[3]), PointMass::normal(grid, x[3], x[4])].into_iter().flatten() {
            prop_assert!(before.mean().is_finite() && before.variance() >= 0.0, "{:?}", before);
            let mut density = before.clone();
            match density.update_with(|t| if t > x[5] { x[6] } else { x[7] }) {
                Ok(log) => prop_assert!(log.is_finite() && density.mean().is_finite(), "{:?}", density),
                Err(_) => prop_assert_eq!(&density, &before),
            }
            if let Ok(log) = density.clone().reweight(&vec![x[6]; grid.points()]) {
                prop_assert!(log.is_finite());
            }
        }
    }
}
