//! What is stored as text comes back to the bit.

use fewbits_core::factor::{Levels, Scalar, Value};
use fewbits_core::number;
use fewbits_core::{Cell, Gaussian, Link};
use fewbits_densities::{GaussianCloud, KernelEstimate, Mixture, Particles, PointMass, UniformGrid};
use fewbits_filters::ImmBelief;
use fewbits_models::{Ar1, ContinuousLinear, LinearSensor, ReceivedPower, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector2};
use rand::RngExt;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;

fn check<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) {
    let stored = serde_json::to_value(value).unwrap();
    assert_eq!(&serde_json::from_value::<T>(stored).unwrap(), value);
    assert_eq!(&serde_json::from_str::<T>(&serde_json::to_string(value).unwrap()).unwrap(), value);
}

#[test]
fn beliefs_factors_and_models_come_back_to_the_bit() {
    let mut rng = Stream::new(4).rng();
    for _ in 0..200 {
        let mut x: [f64; 8] = std::array::from_fn(|_| 4.0 * rng.random::<f64>() - 2.0);
        let covariance = Matrix2::new(3.0 + x[0], x[1] / 3.0, x[1] / 3.0, 3.0 + x[2]);
        let belief = Gaussian::new(Vector2::new(x[3], x[4]), covariance).unwrap();
        check(&belief);
        check(
            &Link::new(0.3 + x[0] / 10.0, 0.2)
                .unwrap()
                .with_erasure(0.1 + x[1] / 30.0)
                .unwrap(),
        );
        check(&number::EvenLevels::new(x[0], x[0] + 1.0 / 3.0, 5).unwrap());
        let cell = Cell::new(x[5], f64::INFINITY).unwrap();
        check(&cell);
        check(&Scalar::from(Levels::new(cell, 1.0 + x[0].abs(), 0.1, 0.7).unwrap()));
        check(&Scalar::from(Value::scalar(x[0], 1.0 / 3.0).unwrap()));
        check(&Scalar::from(Levels::partition(&[x[0]], &[0.1, 0.9], 1.0 / 7.0).unwrap()));
        let columns = [x[..4].to_vec(), x[4..].to_vec()];
        let cloud = Particles::new(columns, &[0.0, -0.1, x[0], f64::NEG_INFINITY]).unwrap();
        check(&cloud);
        check(&GaussianCloud::new(cloud.clone(), covariance).unwrap());
        check(&Mixture::single(&belief).unwrap());
        let estimate = serde_json::to_value(KernelEstimate::new(cloud, covariance).unwrap()).unwrap();
        let again: KernelEstimate<2> = serde_json::from_str(&estimate.to_string()).unwrap();
        assert_eq!(serde_json::to_value(&again).unwrap(), estimate);
        check(&PointMass::normal(UniformGrid::symmetric(6.0, 0.3).unwrap(), x[0], 1.0 / 3.0).unwrap());
        check(&ImmBelief::new(vec![0.3, 0.7], vec![belief, belief]).unwrap());
        x[0] = x[0].abs() / 2.0;
        check(&Ar1::new(x[0], 1.0 / 3.0).unwrap());
        check(&ContinuousLinear::ornstein_uhlenbeck(x[1], 1.0 / 3.0, x[0] + 0.1).unwrap());
        check(&constant_velocity_2d(0.1 + x[0], 1.0 / 7.0).unwrap());
        check(&LinearSensor::<2, 1>::scalar(Vector2::new(x[1], x[2]), 1.0 / 7.0).unwrap());
        check(&ReceivedPower::<2>::new(Vector2::new(x[1], x[2]), [0, 1], 1.0 / 3.0, 0.7, 2.1, 1.0 / 7.0).unwrap());
    }
}
