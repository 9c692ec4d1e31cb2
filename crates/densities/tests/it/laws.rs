//! The laws of beliefs, run on particles, clouds and grids, and their way through JSON.

use fewbits_core::{Belief, Gaussian, laws};
use fewbits_densities::{GaussianCloud, Particles, PointMass, UniformGrid};
use nalgebra::{Matrix2, SMatrix};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use serde::de::DeserializeOwned;

const DRAWS: usize = 20_000;

fn rng() -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(5)
}

fn weighted(scale: f64) -> Particles<2> {
    let x = (0..40).map(|i| f64::from(i) * scale).collect();
    let y = (0..40).map(|i| f64::from(i * i % 17) * scale).collect();
    let mut logs: Vec<f64> = (0..40).map(|i| -0.05 * f64::from(i)).collect();
    logs[7] = f64::NEG_INFINITY;
    Particles::new([x, y], &logs)
        .unwrap()
        .with_auxiliary((0..120).map(f64::from).collect())
        .unwrap()
}

fn bumpy(scale: f64) -> PointMass {
    let grid = UniformGrid::symmetric(6.0 * scale, 0.2 * scale).unwrap();
    let log_density = |x: f64| (x / scale).sin() - 0.5 * (x / scale).powi(2);
    PointMass::new(grid, log_density).unwrap()
}

fn obeys<const D: usize>(belief: &impl Belief<D>) {
    laws::belief::samples_have_the_moments(belief, &mut rng(), DRAWS).unwrap();
    // One call draws particles from any belief.
    let drawn = Particles::from_belief(&mut rng(), belief, DRAWS).unwrap();
    let (mean, covariance) = (belief.mean(), belief.covariance());
    for d in 0..D {
        let error = 5.0 * (covariance[(d, d)] / DRAWS as f64).sqrt();
        assert!((drawn.mean()[d] - mean[d]).abs() <= error + 1e-12 * mean[d].abs());
    }
}

#[test]
fn draws_have_the_moments_at_every_scale() {
    for scale in [1e-4, 1.0, 1e4] {
        obeys(&weighted(scale));
        let shared = Matrix2::new(2.0, 0.5, 0.5, 1.0) * (scale * scale);
        obeys(&GaussianCloud::new(weighted(scale), shared).unwrap());
        obeys(&GaussianCloud::new(weighted(scale), SMatrix::zeros()).unwrap());
        obeys(&bumpy(scale));
    }
}

/// Erratum `dymbo-9`.
#[test]
fn densities_integrate_to_one() {
    for scale in [1e-4, 1.0, 1e4] {
        let belief = bumpy(scale);
        let wide = Gaussian::scalar(belief.mean(), 2.0 * belief.variance())
            .unwrap()
            .factored()
            .unwrap();
        laws::belief::density_integrates_to_one(&belief, &wide, &mut rng(), DRAWS).unwrap();
    }
}

#[test]
fn grids_hold_the_moments_of_a_normal() {
    let grid = UniformGrid::symmetric(12.0, 0.4).unwrap();
    let line = PointMass::normal(grid, 0.7, 1.3).unwrap();
    assert!((line.mean() - 0.7).abs() < 1e-12 && (line.variance() - 1.3).abs() < 1e-11);
}

fn restored<T: Serialize + DeserializeOwned>(belief: &T) -> T {
    serde_json::from_str(&serde_json::to_string(belief).unwrap()).unwrap()
}

#[test]
fn beliefs_come_back_from_json_to_the_last_bit() {
    let particles = weighted(0.3);
    let same = restored(&particles);
    assert_eq!((same.weights(), same.log_weights()), (particles.weights(), particles.log_weights()));
    assert_eq!(same.effective_sample_size(), particles.effective_sample_size());
    assert_eq!(same, particles);
    let cloud = GaussianCloud::new(particles, Matrix2::new(2.0, 0.5, 0.5, 1.0)).unwrap();
    assert_eq!(restored(&cloud), cloud);
    assert_eq!(restored(&bumpy(0.1)), bumpy(0.1));
}

#[test]
fn what_is_no_belief_is_refused() {
    let refused = |text: &str, name: &str| {
        let error = serde_json::from_str::<GaussianCloud<1>>(text).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    };
    let means = r#"{"columns":[[1.0,2.0]],"weights":[0.5,0.5]}"#;
    assert!(serde_json::from_str::<Particles<1>>(means).is_ok());
    refused(&format!(r#"{{"means":{means},"covariance":[-1.0]}}"#), "covariance");
    refused(r#"{"means":{"columns":[[1.0,2.0]],"weights":[0.7,0.5]},"covariance":[1.0]}"#, "weights");
    refused(
        r#"{"means":{"columns":[[1.0,2.0]],"weights":[0.5,0.5],"auxiliary":[1.0]},"covariance":[1.0]}"#,
        "auxiliary",
    );
    let wrong = r#"{"columns":[[1.0,2.0]],"weights":[0.5,0.5],"log_weights":[0.0,-1.0]}"#;
    refused(&format!(r#"{{"means":{wrong},"covariance":[1.0]}}"#), "log_weights");
    assert!(serde_json::from_str::<UniformGrid>(r#"{"lower":0.0,"spacing":0.0,"points":3}"#).is_err());
    assert!(serde_json::from_str::<UniformGrid>(r#"{"lower":0.0,"spacing":1.0,"points":1}"#).is_err());
    let grid = r#"{"lower":0.0,"spacing":1.0,"points":3}"#;
    for density in ["[0.5,0.5]", "[1.5,-0.5,0.0]", "[1.0,1.0,1.0]"] {
        assert!(serde_json::from_str::<PointMass>(&format!(r#"{{"grid":{grid},"density":{density}}}"#)).is_err());
    }
}

#[test]
fn selections_carry_side_rows() {
    let mut belief = weighted(1.0);
    let before = belief.clone();
    assert!(belief.select(&[]).is_err() && belief.select(&[0, 99]).is_err());
    assert_eq!(belief, before);
    belief.select(&[3, 3, 9]).unwrap();
    assert_eq!(belief.columns()[0], [3.0, 3.0, 9.0]);
    assert_eq!(belief.auxiliary(), [9.0, 10.0, 11.0, 9.0, 10.0, 11.0, 27.0, 28.0, 29.0]);
    assert_eq!((belief.weights(), belief.effective_sample_size()), (&[1.0 / 3.0; 3][..], 3.0));
    let mut copy = Particles::uniform([vec![0.0], vec![0.0]]).unwrap();
    copy.select_from(&before, &[3, 3, 9]).unwrap();
    assert_eq!((copy.columns(), copy.auxiliary()), (belief.columns(), belief.auxiliary()));
    assert!(weighted(1.0).with_auxiliary(vec![0.0; 41]).is_err());
}
